"""Widths of the kernels: shares of typical distances to the nearest movement of another class, or beyond a gap."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.kernels.pair_distances import CloudSpec, ElasticSpec
from kineme.similarity import describe as described_module
from kineme.similarity.describe import describe, squared_distances
from kineme.similarity.similarity import SHARE, averaged, gap_widths, given_weights, impostor_widths
from kineme.similarity.specification import (
    DEFAULT_REPRESENTATIONS,
    DETAILED_CLOUD,
    DETAILED_ELASTIC,
    ComparisonSpecification,
    Representation,
)
from movement_samples import draw_shapes


def as_coarse(widths):
    """Those in detail as of the same quantities that are rotated: elastic path and point cloud."""
    return np.append(widths[:5], widths[[2, 4]])


@pytest.fixture(scope="module")
def shapes():
    demos = draw_shapes([40, 30, 50], spread=0.8)
    return describe(demos), np.asarray(demos.labels)


def test_a_width_is_the_share_of_the_median_distance_to_an_impostor_among_hundreds(shapes):
    described, labels = shapes
    other = np.sqrt(np.where(labels[:, None] == labels, np.inf, squared_distances(described, described)))
    each = SHARE * np.median(other.min(axis=2), axis=1)
    np.testing.assert_allclose(impostor_widths(described, labels), as_coarse(each))


def test_widths_in_detail_are_those_of_the_same_quantity_that_is_rotated(shapes):
    """Also where some are left out; without a twin it is a width of their own."""
    described, labels = shapes[0].take(slice(30, 80)), shapes[1][30:80]
    assert described.coarse() == [0, 1, 2, 3, 4, 2, 4]
    assert described.select([0, 4, 5, 6]).coarse() == [0, 1, 2, 1]
    assert described.select([0, 1]).coarse() == [0, 1]
    widths = impostor_widths(described, labels)
    alone = impostor_widths(described.select([0, 5, 6]), labels)
    np.testing.assert_array_equal(widths[5:], widths[[2, 4]])
    assert (np.abs(alone[1:] - widths[5:]) > 1e-3).all()
    free = gap_widths(described)
    np.testing.assert_array_equal(free[5:], free[[2, 4]])
    assert (np.abs(gap_widths(described.select([0, 5, 6]))[1:] - free[5:]) > 1e-3).all()


def test_of_one_class_every_other_movement_is_an_impostor(shapes):
    described = shapes[0].take(slice(0, 20))
    squares = squared_distances(described, described)
    squares[:, np.arange(20), np.arange(20)] = np.inf
    expected = SHARE * np.sqrt(np.median(squares.min(axis=2), axis=1))
    np.testing.assert_allclose(impostor_widths(described, np.zeros(20)), as_coarse(expected), rtol=0.05)


def test_without_labels_it_is_the_first_distance_beyond_the_largest_ratio(shapes):
    """Of at most half of the movements, so that a stranger at the end of the order is no gap."""
    described = shapes[0].take(np.r_[:10, 40:50, 70:80])
    widths = []
    for squares in squared_distances(described, described):
        ordered = np.sort(np.sqrt(squares), axis=1)[:, 1:]
        at = np.diff(np.log(np.maximum(ordered[:, :15], 1e-9)), axis=1).argmax(axis=1)
        widths.append(SHARE * np.median(ordered[np.arange(30), at + 1]))
    np.testing.assert_allclose(gap_widths(described), as_coarse(np.array(widths)), rtol=1e-6)


def test_many_pairs_are_compared_as_few_are(shapes, monkeypatch):
    described, whole = shapes[0], squared_distances(shapes[0], shapes[0])
    monkeypatch.setattr(described_module, "_TILE_PAIRS", 7 * len(described))
    np.testing.assert_allclose(squared_distances(described, described), whole, rtol=1e-5, atol=2e-3)


def test_what_is_selected_of_what_is_compared_pair_by_pair(shapes):
    described, whole = shapes[0].take(slice(0, 9)), squared_distances(*2 * (shapes[0].take(slice(0, 9)),))
    for chosen in ([0, 4], [0, 3], [0, 2, 4], [1, 3], [0, 5], [1, 4, 6], [0, 2, 5, 6]):
        some = described.select(chosen)
        np.testing.assert_allclose(squared_distances(some, some), whole[chosen], rtol=1e-6, atol=1e-6)


def test_positions_give_the_rotation_wherever_they_stand():
    demos = draw_shapes([3] * 3, 3)
    elastic, timing, positions = Representation("elastic"), Representation("forcing", 0.0), Representation("positions")
    for order in ((elastic, timing, positions), (timing, positions, elastic), (positions, timing, elastic)):
        how = ComparisonSpecification(representations=order)
        assert how.representations[-1] is elastic
        described = describe(demos, how)
        squares = squared_distances(described, described)
        default = describe(demos)
        np.testing.assert_allclose(squares[2], squared_distances(default, default)[2], atol=1e-5)


def test_the_size_of_what_is_compared_pair_by_pair_is_that_of_opposite_tangents(shapes):
    np.testing.assert_allclose(shapes[0].sizes(), [10.0, shapes[0].sizes()[1], *[2.0] * 5], rtol=1e-4)


def test_an_average_over_the_first_representations_is_one(shapes):
    similarity = averaged(shapes[0]).by_rows(2)
    assert similarity.weights is None
    weighted = type(similarity)(similarity.procrustes, np.ones(7), weights=np.array([2.0, 1, 2, 1, 2, 6, 6]) / 20)
    np.testing.assert_allclose(weighted.by_rows(2).weights, [2 / 3, 1 / 3])
    np.testing.assert_allclose(weighted.by_rows(2).log_weights(), np.log([4 / 3, 2 / 3]))


def test_the_largest_weights_that_can_be_given():
    np.testing.assert_allclose(given_weights([1.7e308, 1.7e308, 0], 3), [0.5, 0.5, 0.0])


def test_the_numbers_that_docs_and_benchmarks_justify():
    """`python -m bench --only defaults` and `nested` tell what hangs on them: whoever changes one runs these again."""
    named = [(one.quantity, one.arc_share, one.weight, one.detailed) for one in DEFAULT_REPRESENTATIONS]
    assert named == [
        ("positions", 1.0, 2.0, False), ("forcing", 0.0, 1.0, False), ("elastic", 1.0, 2.0, False),
        ("turning", 1.0, 1.0, False), ("cloud", 1.0, 2.0, False), ("elastic", 1.0, 6.0, True),
        ("cloud", 1.0, 6.0, True),
    ]  # fmt: skip
    assert all(one.signal for one in DEFAULT_REPRESENTATIONS)
    assert ComparisonSpecification().detailed_cutoff == 4 * ComparisonSpecification().cutoff == 40
    assert ElasticSpec(n_segments=66) == DETAILED_ELASTIC
    assert CloudSpec(n_points=32) == DETAILED_CLOUD
    assert SHARE == 0.4
    assert ElasticSpec() == ElasticSpec(n_segments=33, band=6, position_weight=0.5, turning_weight=8.0)
    assert CloudSpec() == CloudSpec(n_points=20, turning_weight=16.0, line_weight=0.75)

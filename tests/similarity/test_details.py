"""Paths in detail: smoothed less, finer, and rotated only where something says how movements are rotated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme import Demonstrations, Recognizer
from kineme.errors import SpecificationError
from kineme.kernels.pair_distances import CloudSpec, ElasticSpec, pair_distances, shapes_of
from kineme.kernels.rotation import RotationPrior
from kineme.similarity.describe import describe, feature_rows, squared_distances
from kineme.similarity.scores import most_similar
from kineme.similarity.similarity import averaged
from kineme.similarity.specification import (
    DEFAULT_REPRESENTATIONS,
    DETAILED_POSITIONS,
    ROW_REPRESENTATIONS,
    ComparisonSpecification,
    Representation,
)
from movement_samples import draw_shapes, turn
from soaking import examples

IN_DETAIL = slice(5, 7)
#: Parameters of a recognizer, and whether what is compared in detail stays as it is.
ROTATIONS = [
    ({}, True),
    ({"rotation_prior": RotationPrior()}, True),
    ({"rotation_prior": RotationPrior(0.3)}, False),
    ({"rotation_prior": None}, False),
    ({"max_angle": math.pi}, False),
    ({"max_angle": 0.4}, False),
    ({"max_angle": 0.0}, False),  # there is nothing to rotate by
]


@pytest.mark.parametrize(("parameters", "upright"), ROTATIONS)
@pytest.mark.parametrize("d", [2, 3])
def test_details_are_rotated_by_what_a_user_says_of_rotations_and_not_by_default(parameters, upright, d):
    """Against the distances of pairs themselves, with and without the rotations of the positions."""
    demos = draw_shapes([2] * 3, d, seed=3)
    recognizer = Recognizer(**parameters, weights="own").fit(demos)
    how = recognizer.specification
    assert how.upright is upright
    assert recognizer.comparison_.specification.upright is upright  # also without the parameters it was made of
    described = describe(demos, how)
    assert described.pairs.upright is upright
    paths = [rows.reshape(6, d, -1).astype(np.float32) for rows in feature_rows(demos, how)]
    coarse, details = shapes_of(paths[0]), shapes_of(paths[-1], ElasticSpec(n_segments=66), CloudSpec(n_points=32))
    rotations = described.procrustes.align(described.blocks[0], described.blocks[0])[1]
    squares = squared_distances(described, described)
    np.testing.assert_allclose(squares[2:5], pair_distances(coarse, coarse, rotations), rtol=1e-5, atol=1e-7)
    detailed = pair_distances(details, details, None if upright else rotations)
    np.testing.assert_allclose(squares[IN_DETAIL], detailed[[0, 2]], rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("d", [2, 3])
def test_a_turned_copy_is_another_movement_in_detail_unless_rotations_are_told(d):
    demos = draw_shapes([1] * 4, d, seed=2)
    turned = Demonstrations.from_arrays([one.positions @ turn(0.9, d).T for one in demos])
    free, default = (
        squared_distances(describe(demos, how), describe(turned, how))[:, range(4), range(4)]
        for how in (Recognizer(max_angle=math.pi).specification, ComparisonSpecification())
    )
    assert (free[2:] <= 2e-4).all()
    assert (default[IN_DETAIL] >= 0.05).all()
    assert (default[IN_DETAIL] >= 2.0 * default[[2, 4]]).all()  # the others are rotated, at some cost


def test_of_movements_that_differ_by_their_direction_alone_those_in_detail_tell():
    """Straight on, up, and down: without their directions nothing is left of the difference."""
    stroke = np.column_stack((np.linspace(0.0, 1.0, 60), 0.1 * np.sin(np.linspace(0.0, 3.0, 60))))
    rng = np.random.default_rng(0)

    def drawn(n):
        angles = np.repeat([0.0, 1.5, -1.5], n) + rng.normal(size=3 * n) * 0.15
        return [stroke @ turn(angle, 2).T + 0.003 * rng.normal(size=stroke.shape) for angle in angles]

    shown, asked = drawn(1), drawn(20)
    truth = np.repeat(["on", "up", "down"], 20)
    default = Recognizer().fit(shown, ["on", "up", "down"])
    assert default.score(asked, truth) >= 0.95
    assert Recognizer(max_angle=math.pi).fit(shown, ["on", "up", "down"]).score(asked, truth) <= 0.7


@pytest.mark.parametrize(("cutoff", "detailed"), [(5.0, 20.0), (10.0, 40.0), (None, None)])
@pytest.mark.parametrize("scale", ["path", "per-dimension"])
def test_details_are_positions_smoothed_below_four_times_as_many_cycles(cutoff, detailed, scale):
    """At 67 places along the path; without noise nothing is smoothed. Pauses are cut as those of whole paths are."""
    rest = np.repeat(kineme.load_lasa()[3].positions[400:401], 300, axis=0)
    demos = Demonstrations.from_arrays(
        [np.insert(one.positions, 400, rest, axis=0) for one in kineme.load_lasa()[[3, 60]]]
    )
    how = Recognizer(cutoff=cutoff, scale=scale).specification
    assert how.detailed_cutoff == detailed
    positions, _, details = feature_rows(demos, how)
    fine = (Representation("positions", n_points=67),)
    expected = Recognizer(fine, cutoff=detailed, scale=scale).specification
    np.testing.assert_array_equal(details, feature_rows(demos, expected)[0])
    assert positions.shape == (2, 200)
    coarse = Recognizer(fine, cutoff=cutoff, scale=scale).specification
    assert (np.abs(details - feature_rows(demos, coarse)[0]).max() > 1e-3) == (cutoff is not None)


def test_only_what_is_compared_in_detail_needs_more_rows():
    assert ComparisonSpecification().stored_rows == (*DEFAULT_REPRESENTATIONS[:2], DETAILED_POSITIONS)
    for representations in (ROW_REPRESENTATIONS, DEFAULT_REPRESENTATIONS[:5]):
        how = ComparisonSpecification(representations)
        assert how.stored_rows == how.by_rows
        described = describe(draw_shapes([2, 1]), how)
        assert described.pairs is None or described.pairs.details is None


def test_those_in_detail_come_last_wherever_they_are_named():
    """So that the distances of pairs are in the order of the representations."""
    mixed = tuple(DEFAULT_REPRESENTATIONS[k] for k in (6, 0, 4, 5, 1, 3, 2))
    how = ComparisonSpecification(mixed)
    assert [one.name for one in how.representations] == [
        "positions over arc length", "forcing over time", "point cloud", "turning angles", "elastic path",
        "point cloud in detail", "elastic path in detail",
    ]  # fmt: skip
    demos = draw_shapes([2, 2])
    ours, default = describe(demos, how), describe(demos)
    np.testing.assert_array_equal(
        squared_distances(ours, ours), squared_distances(default, default)[[0, 1, 4, 3, 2, 6, 5]]
    )


@pytest.mark.parametrize("quantity", ["positions", "forcing"])
def test_what_is_compared_sample_by_sample_has_no_detail(quantity):
    with pytest.raises(SpecificationError, match=f"detailed=True with quantity elastic, .*, got it with '{quantity}'"):
        Representation(quantity, detailed=True)
    for wrong in ("yes", 1, None):
        with pytest.raises(SpecificationError, match="detailed"):
            Representation("elastic", detailed=wrong)
        with pytest.raises(SpecificationError, match="signal"):
            Representation("elastic", signal=wrong)


@pytest.mark.parametrize("parameters", [{}, {"max_angle": math.pi}])
def test_what_is_compared_in_detail_is_the_same_compiled_and_plain(parameters, monkeypatch):
    demos = kineme.load_lasa()[::20]
    how, squares = Recognizer(**parameters).specification, []
    for choice in ("always", "never"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        described = describe(demos, how)
        squares.append(squared_distances(described, described))
    np.testing.assert_allclose(squares[0][2:], squares[1][2:], rtol=1e-4, atol=1e-5)


@settings(max_examples=examples(3, 10))
@given(seed=st.integers(0, 10**6), d=st.integers(1, 4), most=st.sampled_from([1, 3, 100]))
def test_how_many_movements_are_described_at_a_time_does_not_matter(seed, d, most):
    demos = draw_shapes([3] * 3, d, seed)
    described, parts = describe(demos), []
    for start in range(0, 9, most):
        parts.append(describe(demos[start : start + most]))
    squares = np.concatenate([squared_distances(part, described) for part in parts], axis=1)
    expected = squared_distances(described, described)
    np.testing.assert_allclose(squares[2:], expected[2:], rtol=1e-5, atol=2e-5)


def test_the_nearest_by_what_is_compared_in_detail_alone_is_found():
    """There are no bounds then: all are compared."""
    demos = kineme.load_lasa()
    some, others = describe(demos[::7]).select([0, 5]), describe(demos[1::7]).select([0, 5])
    similarity = averaged(some)
    expected = similarity.log_average(others, some).argmax(axis=1)
    np.testing.assert_array_equal(most_similar(similarity, others, some), expected)

"""Friedman's test and Nemenyi's critical difference, against Demsar's own example and against their words."""

import numpy as np
import pytest

from kineme_experiments.evaluation.methods import METHODS
from kineme_experiments.evaluation.rank_figure import draw_ranks
from kineme_experiments.evaluation.ranks import MIN_BLOCKS, Ranks, blocks_of, rank, rank_rows
from kineme_experiments.evaluation.rows import Row

#: Table 6 of Demsar (JMLR 2006): C4.5 and three variants of its parameters on 14 data sets.
DEMSAR = np.array(
    [
        [0.763, 0.768, 0.771, 0.798], [0.599, 0.591, 0.590, 0.569], [0.954, 0.971, 0.968, 0.967],
        [0.628, 0.661, 0.654, 0.657], [0.882, 0.888, 0.886, 0.898], [0.936, 0.931, 0.916, 0.931],
        [0.661, 0.668, 0.609, 0.685], [0.583, 0.583, 0.563, 0.625], [0.775, 0.838, 0.866, 0.875],
        [1.000, 1.000, 1.000, 1.000], [0.940, 0.962, 0.965, 0.962], [0.619, 0.666, 0.614, 0.669],
        [0.972, 0.981, 0.9751, 0.975], [0.957, 0.978, 0.946, 0.970],
    ]
)  # fmt: skip
NAMES = ("C4.5", "C4.5+m", "C4.5+cf", "C4.5+m+cf")


def test_the_example_of_the_paper():
    found = rank(NAMES, DEMSAR)
    assert found.methods == ("C4.5+m+cf", "C4.5+m", "C4.5+cf", "C4.5")
    np.testing.assert_allclose(found.mean_ranks, [1.964, 2.000, 2.893, 3.143], atol=5e-4)
    by_hand = 12 * 14 / (4 * 5) * (sum(np.square(found.mean_ranks)) - 4 * 5**2 / 4)
    assert by_hand == pytest.approx(9.28, abs=5e-3)  # the paper's formula, which does not correct for ties
    assert found.statistic == pytest.approx(10.23, abs=5e-3)
    assert found.p_value < 0.05
    assert found.critical_difference == pytest.approx(1.25, abs=5e-3)
    assert found.alike() == [(0, 3)]  # as the paper notes, the test finds no pair here


def test_methods_that_never_differ_are_all_alike():
    found = rank(NAMES, np.ones((6, 4)))
    assert found.p_value == 1.0
    assert found.mean_ranks == (2.5,) * 4
    assert found.alike() == [(0, 3)]


def test_groups_are_the_longest_runs_within_the_critical_difference():
    found = Ranks(("a", "b", "c", "d", "e"), (1.0, 1.5, 2.4, 4.5, 4.9), 20, 0.0, 0.0, 1.0)
    assert found.alike() == [(0, 1), (1, 2), (3, 4)]
    assert found._replace(mean_ranks=(1.0, 2.0, 3.0, 4.0, 5.0)).alike() == []


def rows_of(values, protocol="few-shot", measure="accuracy", conditions=("1 shot", "3 shots")):
    """A row for each method (column) and block (data set, row), with the same value in every condition."""
    methods = list(METHODS)[: values.shape[1]]
    return [
        Row(f"set {b}", protocol, condition, "shots", 1, measure, method, 0, "", float(values[b, k]))
        for b in range(len(values))
        for condition in conditions
        for k, method in enumerate(methods)
    ]


def test_blocks_are_data_sets_protocols_and_people():
    values = np.random.default_rng(0).random((6, 4))
    blocks, methods, means = blocks_of(rows_of(values))
    assert blocks == [(f"set {b}", "few-shot", "") for b in range(6)]
    assert methods == list(METHODS)[:4]
    np.testing.assert_allclose(means, values)
    both = rows_of(values) + [row._replace(person="ann", value=0.5) for row in rows_of(values[:1])]
    assert len(blocks_of(both)[0]) == 7
    assert len(blocks_of(rows_of(values) + rows_of(values, measure="auroc"))[0]) == 6


def test_who_went_through_less_does_not_spoil_the_others_blocks():
    values = np.random.default_rng(0).random((6, 4))
    rows = rows_of(values)
    slow = list(METHODS)[3]
    reference_only = [row for row in rows if row.method != slow or row.condition == "1 shot"]
    assert blocks_of(reference_only)[1] == list(METHODS)[:3]
    assert len(blocks_of(reference_only)[0]) == 6
    early = [row._replace(protocol="earliness") for row in rows if row.method == "kineme"]
    assert [block[1] for block in blocks_of(rows + early)[0]] == ["few-shot"] * 6


def test_too_little_is_said_so():
    values = np.random.default_rng(0).random((MIN_BLOCKS, 4))
    assert isinstance(rank_rows(rows_of(values)), Ranks)
    assert "these are 4; name more data" in rank_rows(rows_of(values[1:]))
    assert "at least 3 methods" in rank_rows(rows_of(values[:, :2]))
    assert "these are 0" in rank_rows([])


def test_the_diagram_names_every_method_with_its_rank_inside_the_figure():
    names = tuple(METHODS)
    ranks = Ranks(names, tuple(np.linspace(1.2, 11.4, len(names)).tolist()), 12, 30.0, 1e-5, 4.2)
    figure = draw_ranks(ranks)
    figure.canvas.draw()
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    assert {METHODS[name].title for name in names} <= {text.get_text().strip("0123456789. ") or "" for text in texts}
    whole = figure.bbox
    for text in texts:
        box = text.get_window_extent()
        assert whole.x0 <= box.x0 <= box.x1 <= whole.x1, text
        assert whole.y0 <= box.y0 <= box.y1 <= whole.y1, text
    assert len([line for line in figure.axes[0].lines if line.get_linewidth() > 3]) == len(ranks.alike())

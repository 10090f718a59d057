"""What a recognizer cannot do is refused in words that say what to pass."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Recognizer
from kineme.errors import SpecificationError, TrajectoryError
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, Representation
from movement_samples import draw_shapes

DEMOS = draw_shapes([2, 2])


@pytest.mark.parametrize("given", [(), [], 3, "positions", (None,), (Representation,), [DEFAULT_REPRESENTATIONS]])
def test_representations_that_are_none(given):
    with pytest.raises(SpecificationError, match=r"expected representations to be a tuple of .*Representation, one or"):
        Recognizer(representations=given).fit(DEMOS)


@pytest.mark.parametrize(
    "weights", [[0] * 7, [1] * 5, [-1, *[2] * 6], [np.nan, *[1] * 6], [np.inf, *[1] * 6], {}, ["a"] * 7, 1j]
)
def test_weights_that_are_none(weights):
    with pytest.raises(
        SpecificationError,
        match="expected weights to be 'auto', 'own', 'equal', 'fitted' or 7 numbers from 0, not all 0",
    ):
        Recognizer(weights=weights).fit(DEMOS)


def test_only_the_ratio_of_weights_matters_however_large():
    recognizer = Recognizer(weights=[1e308, 1e308, 0.5e308, *[1e308] * 4]).fit(DEMOS)
    np.testing.assert_allclose(recognizer.weights_, np.array([2, 2, 1, 2, 2, 2, 2]) / 13)


@pytest.mark.parametrize("angle", ["wide", [1.0], np.nan, -0.1, 4.0])
def test_angles_that_are_none(angle):
    with pytest.raises(SpecificationError, match="max_angle"):
        Recognizer(max_angle=angle).fit(DEMOS)


def test_a_phase_cannot_turn_back():
    """Compiled, it was read beside its array."""
    with pytest.raises(SpecificationError, match=r"arc_share to be a share of at most 1, got 1\.5"):
        Representation("positions", arc_share=1.5)


def test_a_search_beside_the_array_stays_inside():
    from kineme.movements.trajectories._compiled import locate

    interval, local = np.zeros(7, dtype=np.int64), np.zeros(5)
    locate(np.array([0.0, -2.0, np.nan, -0.3, 1.0]), interval[1:6], local)
    assert interval[0] == interval[6] == 0
    assert ((interval >= 0) & (interval <= 3)).all()


@pytest.mark.parametrize("early", [3, "soon", [1.0], Representation])
def test_what_is_no_early(early):
    recognizer = Recognizer().fit(DEMOS)
    for ask in (recognizer.stream, lambda early: recognizer.predict_partial(DEMOS, early)):
        with pytest.raises(SpecificationError, match=r"expected early to be .*Early\(\.\.\.\) or None"):
            ask(early=early)


def test_movements_with_labels_are_scored_by_them():
    recognizer = Recognizer().fit(DEMOS)
    fresh = draw_shapes([5, 5], seed=3)
    assert (
        recognizer.score(fresh) == recognizer.score(fresh, fresh.labels) == recognizer.score(list(fresh), fresh.labels)
    )
    assert recognizer.score(DEMOS) == 1.0
    with pytest.raises(TrajectoryError, match="labels"):
        recognizer.score([one.positions for one in fresh])
    with pytest.raises(TrajectoryError, match="one label for each of the 10 movements"):
        recognizer.score(fresh, ["a"])


@pytest.mark.parametrize(
    ("groups", "kinds"), [([None] * 4, "NoneType"), ([1, "a", None, 2.0], "NoneType and float and int and str")]
)
def test_groups_that_are_none(groups, kinds):
    with pytest.raises(TrajectoryError, match=f"expected groups to be all texts or all numbers, got {kinds}$"):
        Recognizer().fit(DEMOS, groups=groups)

"""The least duration within limits, against what a movement of that duration reaches."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP, SpecificationError
from kineme.primitives.discrete.formulations import FORMULATIONS


@pytest.fixture(scope="module")
def learned():
    return DMP().learn(kineme.load_lasa(["GShape"]))


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    "limits",
    [
        {"velocity": 30.0},
        {"acceleration": [100.0, 300.0]},
        {"velocity": [5.0, 1e4], "acceleration": 200.0},
        {"velocity": np.array([30.0, 40.0])},
    ],
)
def test_it_touches_a_limit_and_exceeds_none(formulation, limits):
    primitives = DMP(formulation).learn(kineme.load_lasa(["CShape"]))
    goal = primitives.goals + 3.0
    via = [(0.4, primitives.rollout(goal=goal, n_samples=11).positions[:, 4] + 2.0)]
    least = primitives.rollout(goal=goal, via=via).least_duration(**limits)
    fastest = primitives.rollout(goal=goal, via=via, duration=least)
    used = np.zeros(len(primitives))
    for name, limit in limits.items():
        rates = fastest.velocities if name == "velocity" else fastest.accelerations
        used = np.maximum(used, (np.abs(rates) / limit).max(axis=(1, 2)))
    np.testing.assert_allclose(used, 1.0, rtol=1e-9)
    assert fastest.least_duration(**limits) == pytest.approx(least)


def test_paths_that_depend_on_the_duration_are_refused(learned):
    for asked in ({"velocity": [1.0, 0.0]}, {"end_velocity": [0.0, 1.0]}):
        with pytest.raises(SpecificationError, match="path depends on the duration"):
            learned.rollout(**asked).least_duration(velocity=1.0)
    at_rest = learned.rollout(velocity=[0.0, 0.0], end_velocity=[0.0, 0.0])
    assert (at_rest[2:4].least_duration(velocity=10.0) > 0).all()


def test_no_limit_or_a_wrong_one(learned):
    with pytest.raises(SpecificationError, match="expected a limit"):
        learned.rollout().least_duration()
    for wrong in (0.0, -1.0, [1.0, np.nan], [1.0, 2.0, 3.0], np.inf):
        with pytest.raises(SpecificationError, match="expected acceleration to be a number above 0, or 2 of them"):
            learned.rollout().least_duration(acceleration=wrong)

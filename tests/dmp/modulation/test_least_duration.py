"""The least duration within limits, against what a movement of that duration reaches."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP
from kineme.dmp.discrete import rollout as base_rollout
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError


@pytest.fixture(scope="module")
def learned():
    return DMP().learn(kineme.load_lasa(["GShape"]))


@pytest.mark.soak("combinations")
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
    fastest = primitives.rollout(goal=goal, via=via, duration=least, n_samples=10_000)
    used = np.zeros(len(primitives))
    for name, limit in limits.items():
        rates = fastest.velocities if name == "velocity" else fastest.accelerations
        used = np.maximum(used, (np.abs(rates) / limit).max(axis=(1, 2)))
    np.testing.assert_allclose(used, 1.0, rtol=1e-5)
    assert fastest.least_duration(**limits) == pytest.approx(least, rel=1e-9)


def test_a_limit_is_kept_between_samples_too():
    """At its 200 samples this movement has 1.1 % less acceleration than between two of them."""
    primitive = DMP().learn(kineme.load_lasa(["PShape"]))
    least = primitive.rollout().least_duration(acceleration=200.0)
    dense = np.abs(primitive.rollout(duration=least, n_samples=10_000).accelerations).max(axis=(1, 2))
    np.testing.assert_allclose(dense, 200.0, rtol=1e-5)
    sparse = np.abs(primitive.rollout(duration=least).accelerations).max(axis=(1, 2))
    assert sparse.min() < 199.0
    few = primitive.rollout(n_samples=50).least_duration(acceleration=200.0)
    np.testing.assert_allclose(few, least, rtol=1e-12)


def test_each_movement_of_many_has_its_own(learned, monkeypatch):
    rollout = learned.rollout()
    together = rollout.least_duration(velocity=30.0, acceleration=200.0)
    monkeypatch.setattr(base_rollout, "_LIMITED_SAMPLES", 1)  # one movement at a time
    np.testing.assert_allclose(rollout.least_duration(velocity=30.0, acceleration=200.0), together, rtol=1e-9)
    assert np.ptp(together) > 0.01


def test_a_rhythm_keeps_its_limit_between_samples_too():
    t = np.linspace(0.0, 4.0, 400)
    rhythm = kineme.RhythmicDMP().learn([kineme.Trajectory(t, np.column_stack((np.sin(8 * t), np.cos(16 * t))))])
    least = rhythm.rollout(n_samples=30).least_period(velocity=1.0)
    dense = rhythm.rollout(period=least, n_samples=10_000)
    np.testing.assert_allclose(np.abs(dense.velocities).max(), 1.0, rtol=1e-5)


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

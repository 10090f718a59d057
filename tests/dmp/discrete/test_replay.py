"""Learning a movement and moving again gives the movement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP, Trajectory
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import DegenerateMovementError

# Largest rms distance, as a share of the largest side, of 20 smooth movements of 400 samples: N -> error.
STATED = {
    "local": {10: 0.07, 20: 0.02, 40: 0.006, 80: 0.002},
    "ridge": {10: 3e-3, 20: 2e-4, 40: 1.5e-4},
    "trajectory": {10: 6e-3, 20: 1e-3, 40: 2e-4},
}


def _error(dmp, block):
    path = dmp.learn(block).rollout(n_samples=block.shape[1]).positions
    return np.sqrt(((path - block) ** 2).sum(axis=2).mean(axis=1)) / np.ptp(block, axis=1).max(axis=1)


@pytest.fixture(scope="module")
def smooth_block(make_movement):
    return np.stack([make_movement(seed, n_samples=400)[1] for seed in range(20)])


def test_the_replay_stays_within_the_stated_error_which_falls_with_the_basis(dmp, smooth_block):
    stated = STATED[dmp.regression if dmp.fit == "forcing" else dmp.fit]
    errors = [_error(replace(dmp, n_basis=n, n_points=200), smooth_block).max() for n in stated]
    assert (np.array(errors) < list(stated.values())).all(), errors
    assert (np.diff(errors) < 0).all(), errors


@given(seed=st.integers(0, 10**6), n_dims=st.integers(1, 4), even=st.booleans())
def test_the_replay_keeps_start_goal_and_duration(dmp, make_movement, seed, n_dims, even):
    t, x = make_movement(seed, n_dims, even=even)
    replay = dmp.learn(Trajectory(t + 3, x)).rollout().trajectories[0]
    np.testing.assert_allclose(replay.positions[0], x[0], rtol=1e-12)
    np.testing.assert_allclose(replay.positions[-1], x[-1], atol=0.03 * np.ptp(x, axis=0).max())
    assert replay.duration == pytest.approx(2.0, rel=1e-12)


def test_the_replay_keeps_labels_and_names(dmp, make_movement):
    demos = [Trajectory(*make_movement(i), label=label, name=f"take {i}") for i, label in enumerate("abc")]
    again = dmp.learn(demos).rollout().trajectories
    assert again.labels.tolist() == ["a", "b", "c"]
    assert again.names == ("take 0", "take 1", "take 2")


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_velocities_and_accelerations_are_the_derivatives_of_the_path(make_movement, formulation):
    learned = DMP(formulation, n_basis=20).learn(Trajectory(*make_movement(4)))
    path = learned.rollout(n_samples=4001)
    step = path.times[0, 1]
    np.testing.assert_allclose(
        path.velocities[0, 1:-1], (path.positions[0, 2:] - path.positions[0, :-2]) / (2 * step), atol=1e-4
    )
    np.testing.assert_allclose(
        path.accelerations[0, 1:-1], (path.velocities[0, 2:] - path.velocities[0, :-2]) / (2 * step), atol=2e-3
    )


def test_moving_start_and_goal_together_moves_the_path(dmp, make_movement, agree):
    learned = dmp.learn(Trajectory(*make_movement(5)))
    shift = np.array([3.0, -40.0])
    moved = learned.rollout(learned.starts[0] + shift, learned.goals[0] + shift)
    agree(moved.positions - shift, learned.rollout().positions, 1e-9)


def test_the_path_does_not_depend_on_the_duration(dmp, make_movement, agree):
    learned = dmp.learn(Trajectory(*make_movement(6)))
    agree(learned.rollout(duration=17.0).positions, learned.rollout().positions, 1e-12)


def test_one_primitive_goes_to_many_goals_as_it_would_one_by_one(dmp, make_movement, agree):
    learned = dmp.learn(Trajectory(*make_movement(7)))
    goals = np.random.default_rng(0).normal(scale=3, size=(6, 2))
    together = learned.rollout(goal=goals).positions
    for path, goal in zip(together, goals, strict=True):
        agree(path, learned.rollout(goal=goal).positions[0], 1e-10)


def test_settling_ends_within_the_tolerance_of_the_goal(dmp, make_movement):
    learned = dmp.learn([make_movement(seed, n_samples=60)[1] for seed in range(3)])
    far = learned.rollout(goal=learned.goals + 1.0, settle=1e-3)
    np.testing.assert_allclose(far.positions[:, -1], learned.goals + 1.0, atol=1e-3)


def test_a_rate_is_a_lower_bound_on_the_samples_per_second(dmp, make_movement):
    path = dmp.learn(Trajectory(*make_movement(8))).rollout(rate=125.0)
    assert 1 / np.diff(path.times[0]).max() == pytest.approx(125.0, rel=1e-9)


@pytest.mark.parametrize("rounding", [0.0, 1e-16, -1e-16])
def test_a_closed_dimension_keeps_its_shape_when_it_moves_elsewhere(rounding):
    """g - x0 = -2.4e-16 after sin(2 pi) is closed too: the ratio of two roundings would mirror or magnify."""
    u = np.linspace(0, 1, 100)
    x = np.column_stack((u, np.sin(2 * np.pi * u) + rounding * u))
    learned = DMP("original", n_basis=30, fit="trajectory").learn([x])
    moved = learned.rollout(learned.starts[0] + 1.0, learned.goals[0] + 1.0, n_samples=100).positions[0]
    np.testing.assert_allclose(moved, x + 1.0, atol=1e-2)


def test_a_closed_dimension_of_the_original_formulation_refuses_another_goal():
    u = np.linspace(0, 1, 100)
    learned = DMP("original").learn(Trajectory(u, np.column_stack((u, np.sin(2 * np.pi * u))), name="loop"))
    with pytest.raises(DegenerateMovementError, match=r"trajectory 0 \('loop'\): .*dimension 1.*\"bio-inspired\""):
        learned.rollout(goal=[1.0, 2.0])

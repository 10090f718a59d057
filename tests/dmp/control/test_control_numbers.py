"""Numbers that the documentation gives for control: each falls here if it is changed."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.dmp.control.plan import MovingGoal, ObstacleAvoidance, Status, steering


def test_how_strongly_obstacles_turn_a_movement_by_default():
    """``1000 |v| phi exp(-20 / pi phi)``: strongest at nine degrees, however far."""
    angles = np.pi * np.array([0.01, 0.05, 0.1, 0.5])
    still = np.zeros((1, 2))
    for distance in (0.1, 30.0):
        for phi in angles:
            obstacle = distance * np.array([[np.cos(phi), np.sin(phi)]])
            term = steering(ObstacleAvoidance(), np.array([[0.0, 0.0], [2.0, 0.0]]), obstacle, still)
            expected = [0.0, -1000.0 * 2.0 * phi * np.exp(-20.0 / np.pi * phi)]
            np.testing.assert_allclose(term, expected, rtol=1e-9, atol=1e-9)
    assert angles[np.argmax(angles * np.exp(-20.0 / np.pi * angles))] == pytest.approx(np.deg2rad(9))


def test_a_movement_has_settled_within_a_thousandth_of_its_extent(bio):
    controller = bio.controller(0.02)
    states = [controller.step() for _ in range(400)]
    first = next(k for k, state in enumerate(states) if state.status & Status.SETTLED)
    allowed = 1e-3 * bio.extents.max()

    def away(state):
        slope = state.velocity * bio.durations[0]
        return max(np.abs(state.position - bio.goals[0]).max(), np.abs(slope).max())

    assert away(states[first]) <= allowed
    assert states[first - 1].progress < 1 or away(states[first - 1]) > allowed
    assert all(state.status & Status.SETTLED for state in states[first:])


@pytest.mark.parametrize("dt", [0.02, 0.3])
def test_of_a_filtered_goal_the_mean_over_the_step_acts(bio, dt):
    """On the way to a new target by ``filter dg/dt = target - g``."""
    plan = bio.controller(dt=0.01)._plan
    old = bio.goals[0] - bio.starts[0]
    goal = MovingGoal(plan, old, 0.2)
    goal.aim(old + 1.0)
    mean, _ = goal.follow(dt)
    on_the_way = old + 1.0 - np.exp(-np.linspace(0.0, dt, 20_001) / 0.2)[:, None]
    np.testing.assert_allclose(mean, on_the_way.mean(axis=0), atol=1e-4)
    np.testing.assert_allclose(goal.now, on_the_way[-1])

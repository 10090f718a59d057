"""Batches that move to goals that move: what the controller does step by step, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme import DMP
from kineme.dmp import Primitives
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError, TrajectoryError
from soaking import examples

DEMOS = kineme.load_lasa(["GShape"])


def stepped(primitive, duration, goal, velocity, n_steps):
    """Positions, velocities and accelerations (3, n_steps, d) of the controller that is told once."""
    controller = primitive.controller(duration / n_steps, duration=duration)
    states = [controller.step(goal=goal, goal_velocity=velocity)]
    states += [controller.step() for _ in range(n_steps - 1)]
    return np.array([[one.position, one.velocity, one.acceleration] for one in states]).transpose(1, 0, 2)


@settings(max_examples=examples(8, 25), deadline=None)
@given(
    st.sampled_from(sorted(FORMULATIONS)),
    st.sampled_from(["none", "phase"]),
    st.integers(0, 6),
    st.floats(0.3, 20.0),
    st.tuples(st.floats(-30, 30), st.floats(-30, 30)),
    st.sampled_from([None, 14.0, 33.0]),
)
def test_it_is_what_the_controller_does(formulation, gating, i, duration, moved, damping):
    """Over all formulations, to integration error; `moved` is how far the goal goes meanwhile."""
    primitive = DMP(formulation, gating=gating, n_basis=25, damping=damping).learn(DEMOS)[i]
    velocity, goal = np.array(moved) / duration, primitive.goals[0] + [3.0, -2.0]
    path = primitive.rollout(goal=goal, duration=duration, goal_velocity=velocity, n_samples=81)
    expected = stepped(primitive, duration, goal, velocity, 80)
    for order, ours in enumerate((path.positions, path.velocities, path.accelerations)):
        size = np.abs(expected[order]).max()
        np.testing.assert_allclose(ours[0, 1:], expected[order], rtol=0, atol=1e-6 * size)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_past_the_duration_it_follows_without_a_lag_and_settles(formulation):
    primitive = DMP(formulation).learn(DEMOS)[0]
    path = primitive.rollout(goal_velocity=[5.0, -3.0], settle=1e-3)
    gone = path.times[:, -1:] * [5.0, -3.0]
    assert path.times[0, -1] > primitive.durations[0]
    np.testing.assert_allclose(path.positions[:, -1], primitive.goals + gone, rtol=0, atol=1e-3)
    np.testing.assert_allclose(path.velocities[:, -1], [[5.0, -3.0]], rtol=0, atol=0.05)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_via_points_end_velocity_and_limits_go_with_it(formulation):
    primitive = DMP(formulation).learn(DEMOS)[0]
    tau, velocity = primitive.durations[0], np.array([4.0, -2.0])
    asked = {"via": [(0.5, [-20.0, -8.0])], "end_velocity": velocity, "goal_velocity": velocity}
    path = primitive.rollout(**asked, n_samples=101)
    arrival = primitive.goals[0] + tau * velocity
    np.testing.assert_allclose(path.positions[0, 50], [-20.0, -8.0], atol=1e-6)
    np.testing.assert_allclose(path.positions[0, -1], arrival, atol=1e-6)
    np.testing.assert_allclose(path.velocities[0, -1], velocity, atol=1e-5)
    low = primitive.rollout(**asked).positions[0].min(axis=0) * 0.97
    kept = primitive.rollout(**asked, position_limits=(low, np.inf))
    assert (kept.positions[0].min(axis=0) > low - 1e-6).all()
    np.testing.assert_allclose(kept.positions[0, -1], arrival, atol=1e-6)


def test_one_primitive_to_many_goals_is_each_alone():
    primitive, velocities = DMP().learn(DEMOS)[1], np.array([[1.0, 0.0], [0.0, 0.0], [-4.0, 7.0]])
    many = primitive.rollout(goal_velocity=velocities)
    for i, velocity in enumerate(velocities):
        alone = primitive.rollout(goal_velocity=velocity).positions[0]
        np.testing.assert_allclose(many.positions[i], alone, atol=1e-9)
        np.testing.assert_array_equal(many[i : i + 1].positions[0], many.positions[i])
    at_rest = primitive.rollout().positions[0]
    np.testing.assert_allclose(many.positions[1], at_rest, atol=1e-9)


def test_averages_too():
    average, velocity = kineme.styles.average(DMP().learn(DEMOS)), [3.0, 1.0]
    path = average.rollout(goal_velocity=velocity).positions
    np.testing.assert_allclose(path, average.primitive.rollout(goal_velocity=velocity).positions, atol=1e-9)


def test_what_depends_on_the_duration_or_is_no_primitive_is_refused():
    primitive = DMP().learn(DEMOS)[0]
    path = primitive.rollout(goal_velocity=[1.0, 0.0])
    with pytest.raises(SpecificationError, match="goal_velocity= other than 0"):
        path.least_duration(velocity=1.0)
    with pytest.raises(SpecificationError, match="expected movements to goals at rest"):
        Primitives.from_rollout(path)
    at_rest = primitive.rollout(goal_velocity=[0.0, 0.0])
    assert at_rest.least_duration(velocity=1.0).shape == (1,)
    np.testing.assert_array_equal(Primitives.from_rollout(at_rest).goals, primitive.goals)
    with pytest.raises(TrajectoryError, match="goal_velocity of shape"):
        primitive.rollout(goal_velocity=[1.0])
    with pytest.raises(TrajectoryError, match="finite numbers for goal_velocity"):
        primitive.rollout(goal_velocity=[np.nan, 0.0])

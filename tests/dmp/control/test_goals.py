"""A goal that changes: nearer, farther, across the start, before or during the movement, at once or gradually."""

from __future__ import annotations

import numpy as np
import pytest

from soaking import combined

SHARES = {"closer": 0.3, "farther": 2.5, "across the start": -1.0}


def shifted(primitive, share):
    return primitive.starts[0] + share * (primitive.goals[0] - primitive.starts[0])


@pytest.mark.parametrize("share", SHARES.values(), ids=SHARES.keys())
def test_a_goal_in_the_first_step_is_the_rollouts_goal(primitive, steps, agree, share):
    goal = shifted(primitive, share)
    positions, _, _ = steps(primitive.controller(0.02), 100, goal=goal)
    agree(positions, primitive.rollout(goal=goal, n_samples=101).positions[0], 1e-10)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize(("share", "when", "goal_filter"), combined(SHARES.values(), [4, 18, 28], [None, 0.3]))
def test_a_goal_changed_in_flight_is_reached(primitive, steps, share, when, goal_filter):
    controller, goal = primitive.controller(0.1, goal_filter=goal_filter), shifted(primitive, share)
    steps(controller, when)
    controller.step(goal=goal)
    steps(controller, 120)
    assert controller.state.status.name == "SETTLED"
    np.testing.assert_allclose(controller.state.position, goal, atol=1e-9)
    np.testing.assert_allclose(controller.state.goal, goal, rtol=1e-15)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_a_goal_in_flight_obeys_the_printed_equation(learn, twin, steps, witness, agree, formulation):
    primitive = learn(formulation)
    goal, later = shifted(primitive, 1.0), shifted(primitive, 1.7)
    controller = primitive.controller(0.04)
    before, speeds, _ = steps(controller, 20)
    after, _, _ = steps(controller, 25, goal=later)
    times = np.arange(21) * 0.04
    expected, _ = witness(primitive, times, goal=goal)
    agree(before, expected, 1e-8)
    state = (before[-1], speeds[-1])
    expected, _ = witness(primitive, np.arange(26) * 0.04, goal=later, state=state, u=controller_u(20, 0.04, primitive))
    agree(after, expected, 1e-8)


def controller_u(n, dt, primitive):
    return n * dt / primitive.durations[0]


@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_a_filtered_goal_is_followed_with_second_order(learn, witness, formulation):
    primitive = learn(formulation)
    first, last, T = primitive.goals[0], shifted(primitive, 2.0), 0.2
    expected, _ = witness(primitive, np.array([1.6]), goal=lambda t: last + (first - last) * np.exp(-t / T))
    errors = []
    for n in (40, 80, 160):
        controller = primitive.controller(1.6 / n, goal_filter=T)
        for _ in range(n):
            state = controller.step(goal=last)
        errors.append(np.abs(state.position - expected[-1]).max())
        np.testing.assert_allclose(state.goal, last + (first - last) * np.exp(-8.0), atol=1e-12)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.2)


def test_the_filter_spares_the_jump_in_acceleration(bio, steps):
    jumps = {}
    for goal_filter in (None, 0.2):
        controller = bio.controller(0.002, goal_filter=goal_filter)
        steps(controller, 500)
        before = controller.state.acceleration
        jumps[goal_filter] = np.abs(controller.step(goal=shifted(bio, 3.0)).acceleration - before).max()
    assert jumps[0.2] < 0.02 * jumps[None]


def test_a_second_change_starts_from_the_goal_in_force(bio):
    controller = bio.controller(0.02, goal_filter=0.5)
    for _ in range(10):
        between = controller.step(goal=[9.0, 9.0, 9.0]).goal
    after = controller.step(goal=[-9.0, 0.0, 9.0]).goal
    np.testing.assert_allclose(after, [-9, 0, 9] + (between - [-9, 0, 9]) * np.exp(-0.02 / 0.5), rtol=0, atol=1e-12)


def test_a_mirrored_goal_mirrors_the_original_formulation_only(learn, steps):
    for formulation, mirrors in (("original", True), ("bio-inspired", False), ("amplitude-scaled", False)):
        primitive = learn(formulation)
        x0 = primitive.starts[0]
        as_shown, _, _ = steps(primitive.controller(0.02), 100)
        mirrored, _, _ = steps(
            primitive.controller(0.02, velocity=-primitive.velocities[0]), 100, goal=shifted(primitive, -1.0)
        )
        assert np.allclose(mirrored - x0, x0 - as_shown, atol=1e-9) is mirrors


def test_in_one_dimension_a_number_will_do(learn):
    primitive = learn(n_dims=1)
    one, other = primitive.controller(0.02, goal=3.0), primitive.controller(0.02, goal=[3.0])
    for _ in range(3):
        np.testing.assert_array_equal(one.step(goal=2.0).position, other.step(goal=[2.0]).position)
    np.testing.assert_array_equal(one.step(0.5, 0.1).position, other.step([0.5], [0.1]).position)
    assert not one.state.status.rejected

"""Goals that move with a velocity: followed without a lag, in both twins, and by the printed equation."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP
from kineme.control import Status


@pytest.fixture
def reach():
    """A reach of 2 s along the first axis, in meters."""
    u = np.linspace(0, 1, 200)
    rise = u**3 * (10 - 15 * u + 6 * u**2)
    return DMP().learn([np.column_stack((0.3 * rise, 0.05 * np.sin(np.pi * u) ** 2))])[0].rollout(duration=2.0)


@pytest.fixture
def primitive_of_2_s(reach):
    from kineme.dmp import Primitives

    return Primitives.from_rollout(reach)[0]


def distance_behind(primitive, *, told):
    """From a goal that moves at 0.1 m/s, after three durations [m]."""
    controller, velocity = primitive.controller(0.01), np.array([0.0, 0.1])
    for k in range(600):
        goal = primitive.goals[0] + velocity * 0.01 * k
        state = controller.step(goal=goal, **({"goal_velocity": velocity} if told else {}))
    return np.linalg.norm(state.position - (primitive.goals[0] + velocity * 0.01 * 600))


def test_a_goal_at_a_tenth_of_a_meter_per_second_is_trailed_by_4_cm_or_not_at_all(primitive_of_2_s, twin):
    assert distance_behind(primitive_of_2_s, told=False) == pytest.approx(0.041, abs=1e-3)
    assert distance_behind(primitive_of_2_s, told=True) < 1e-5


@pytest.mark.soak("combinations")
def test_it_moves_on_by_itself(primitive, twin):
    told, once = primitive.controller(0.02), primitive.controller(0.02)
    velocity, start = np.array([0.3, -0.2, 0.1]), primitive.goals[0] - [0.6, -0.4, 0.2]
    states, others = [], []
    for k in range(500):
        states.append(told.step(goal=start + 0.02 * k * velocity, goal_velocity=velocity))
        others.append(once.step(**({"goal": start, "goal_velocity": velocity} if k == 0 else {})))
    positions, goals = ([getattr(state, name) for state in others] for name in ("position", "goal"))
    np.testing.assert_allclose(positions, [state.position for state in states], rtol=0, atol=1e-9)
    np.testing.assert_allclose(goals, start + 0.02 * np.arange(1, 501)[:, None] * velocity, rtol=0, atol=1e-12)
    state = states[-1]
    np.testing.assert_allclose(state.position, state.goal, atol=1e-4)
    np.testing.assert_allclose(state.velocity, velocity, atol=1e-3)
    assert Status.SETTLED not in state.status
    at_rest = once.step(goal=start)
    for _ in range(400):
        at_rest = once.step()
    np.testing.assert_allclose(at_rest.position, start, atol=1e-8)
    assert Status.SETTLED in at_rest.status


@pytest.mark.soak("combinations")
def test_steps_of_any_length_lead_to_the_same_places(primitive, twin):
    """What moves evenly is carried exactly, as everything else that is undisturbed."""
    asked = {"goal": primitive.goals[0] - [1.0, 0.5, 0.0], "goal_velocity": [0.5, 0.25, 0.1]}
    fine, coarse = primitive.controller(0.01), primitive.controller(0.1)
    fine.step(**asked)
    coarse_state = coarse.step(**asked)
    for _ in range(29):
        coarse_state = coarse.step()
    for _ in range(299):
        state = fine.step()
    for one, other in zip(state[2:5], coarse_state[2:5], strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-8)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_it_obeys_the_printed_equation(learn, twin, steps, witness, agree, formulation):
    """The equation with a goal that is ahead by D / K of its velocity; scale f is of where the goal arrives."""
    primitive = learn(formulation)
    tau, velocity = primitive.durations[0], np.array([0.4, -0.3, 0.2])
    arrival = primitive.goals[0]
    ahead = 2.0 / np.sqrt(primitive.dmp.K) * tau * velocity
    controller = primitive.controller(0.04)
    controller.step(goal=arrival - tau * velocity, goal_velocity=velocity)
    for _ in range(24):
        state = controller.step()

    def goal(t):
        return arrival + (t - tau) * velocity + ahead

    added = None
    if formulation == "original":  # the witness multiplies f by the goal in force

        def added(t, x, v):
            f = primitive.dmp.basis.design(np.array([t / tau])) @ primitive.weights[0]
            return (arrival - goal(t)) * f[0] / tau**2

    expected, speeds = witness(primitive, np.array([0.0, 1.0]), goal=goal, added=added)
    agree(state.position, expected[-1], 1e-7)
    agree(state.velocity, speeds[-1], 1e-7)


def test_tempo_and_pauses_do_not_stop_a_goal(bio):
    controller, velocity = bio.controller(0.02), np.array([0.5, 0.0, 0.0])
    controller.step(goal=bio.goals[0], goal_velocity=velocity)
    for tempo in (0.0, 0.0, 2.0, 0.5):
        state = controller.step(tempo=tempo)
    np.testing.assert_allclose(state.goal, bio.goals[0] + 0.1 * velocity, atol=1e-12)


@pytest.mark.parametrize("goal_filter", [None, 0.2])
def test_a_filtered_goal_arrives_at_the_moving_one(bio, goal_filter):
    controller, velocity = bio.controller(0.01, goal_filter=goal_filter), np.array([0.2, 0.1, 0.0])
    controller.step(goal=bio.goals[0] + 1.0, goal_velocity=velocity)
    for _ in range(900):
        state = controller.step()
    np.testing.assert_allclose(state.position, bio.goals[0] + 1.0 + 9.01 * velocity, atol=1e-5)


@pytest.mark.parametrize("velocity", [[np.nan, 0, 0], [1.0, 2.0], "fast", [np.inf, 0, 0]])
def test_a_velocity_that_is_none_leaves_the_goal_as_it_is(bio, velocity):
    controller = bio.controller(0.02)
    state = controller.step(goal=[9.0, 9.0, 9.0], goal_velocity=velocity)
    assert Status.GOAL_REJECTED in state.status
    np.testing.assert_allclose(state.goal, bio.goals[0], rtol=1e-15)

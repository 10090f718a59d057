"""A measured state: the movement goes on from it, or waits for it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

TIMES = np.arange(26) * 0.04


def test_its_own_state_fed_back_changes_nothing(primitive, steps, agree):
    expected, _, _ = steps(primitive.controller(0.02), 120, tempo=0.8)
    controller = primitive.controller(0.02)
    controller.step(tempo=0.8)
    for k in range(1, 120):
        last = controller.state
        agree(controller.step(last.position, last.velocity, tempo=0.8).position, expected[k + 1], 1e-10)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_after_a_push_it_obeys_the_printed_equation(learn, twin, steps, witness, agree, formulation):
    primitive = learn(formulation)
    controller = primitive.controller(0.04)
    steps(controller, 20)
    x, v = np.array([[0.5, -1.0, 0.2], [-3.0, 0.0, 1.0]]) + controller.state[2:4]
    controller.step(x, v)
    actual, _, _ = steps(controller, 24)
    expected, _ = witness(primitive, TIMES, goal=primitive.goals[0], state=(x, v), u=20 * 0.04 / primitive.durations[0])
    agree(actual, expected[1:], 1e-8)


def test_a_position_alone_keeps_the_velocity_and_the_other_way_round(bio, agree):
    for k, passed in ((0, {"position": [1.0, 2.0, 3.0]}), (1, {"velocity": [1.0, 2.0, 3.0]})):
        one, both = bio.controller(0.04), bio.controller(0.04)
        one.step(), both.step()
        full = [both.state.position, both.state.velocity]
        full[k] = np.array([1.0, 2.0, 3.0])
        agree(one.step(**passed).position, both.step(*full).position, 1e-12)


@given(seed=st.integers(0, 10**6), when=st.integers(0, 150), size=st.floats(1e-3, 1e3))
def test_from_any_perturbation_it_comes_to_the_goal(seed, when, size):
    random = np.random.default_rng(seed)
    primitive = _primitives(("original", "bio-inspired", "amplitude-scaled", "decoupled")[seed % 4])
    controller = primitive.controller(0.02)
    for _ in range(when):
        controller.step()
    controller.step(*(size * random.normal(size=(2, 3))))
    for _ in range(60):
        state = controller.step(dt=0.1)
    assert state.status.name == "SETTLED"
    np.testing.assert_allclose(state.position, primitive.goals[0], rtol=0, atol=1e-9 * max(1.0, size))


def _primitives(formulation, cache={}):  # noqa: B006 - one learned primitive per formulation for all examples
    from kineme import DMP

    if formulation not in cache:
        u = np.linspace(0, 1, 60)
        positions = np.column_stack((u, u**2 + np.sin(6 * u), 2 - u + 0.3 * np.sin(9 * u)))
        cache[formulation] = DMP(formulation, n_basis=15, n_points=60).learn([positions])[0]
    return cache[formulation]


def test_the_phase_slows_with_the_squared_error(bio, twin):
    controller = bio.controller(0.02, feedback="phase", phase_stopping=3.0)
    controller.step()
    last = controller.state
    state = controller.step(last.position + np.array([0.3, 0.0, -0.4]))
    du = state.progress - last.progress
    assert du == pytest.approx(0.02 / bio.durations[0] / (1 + 3.0 * 0.25), rel=1e-12)
    np.testing.assert_allclose(state.position - last.position, state.velocity * 0.02, atol=0.02 * 0.1)


def test_the_movement_waits_for_a_blocked_robot_and_keeps_its_path(primitive, steps):
    path, _, _ = steps(primitive.controller(0.002), 1000)
    controller = primitive.controller(0.02, feedback="phase", phase_stopping=1e6)
    steps(controller, 30)
    blocked = controller.state
    for _ in range(300):
        state = controller.step(blocked.position)
    assert state.time == pytest.approx(6.6)
    assert state.progress - blocked.progress < 0.05  # it would have been 3
    assert np.abs(path - state.position).max(axis=1).min() < 2e-3
    after = steps(controller, 500)[0]  # released
    np.testing.assert_allclose(after[-1], primitive.goals[0], atol=1e-8)
    distance = np.linalg.norm(path[:, None] - after[None, :70:10], axis=2).min(axis=0)
    assert distance.max() < 5e-3


def test_phase_feedback_never_touches_the_path(bio, agree):
    controller = bio.controller(0.02, feedback="phase", phase_stopping=2.0)
    random, even = np.random.default_rng(0), bio.controller(0.02)
    for _ in range(60):
        before = controller.state.progress
        state = controller.step(controller.state.position + random.normal(size=3), random.normal(size=3))
        du = state.progress - before
        agree(state.position, even.step(dt=du * bio.durations[0]).position, 1e-10)


def test_a_lost_measurement_keeps_a_blocked_movement_waiting(bio, twin):
    controller = bio.controller(0.02, feedback="phase", phase_stopping=1e6)
    controller.step()
    held = controller.state.position + 1.0
    first = controller.step(held)
    lost = controller.step([np.nan] * 3)
    assert lost.progress - first.progress == pytest.approx(first.progress - 0.01, rel=1e-6)
    assert controller.step().progress - lost.progress == pytest.approx(0.01)

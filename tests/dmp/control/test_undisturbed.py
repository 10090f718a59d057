"""Undisturbed, a controller is the rollout, at any dt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kineme import DMP


def assert_same(steps, controller, movement, agree):
    ours = steps(controller, movement.n_samples - 1)
    for actual, expected in zip(ours, (movement.positions, movement.velocities, movement.accelerations), strict=True):
        agree(actual, expected[0], 1e-10)


@pytest.mark.parametrize("n_samples", [6, 81])
def test_it_equals_the_rollout(primitive, twin, steps, agree, n_samples):
    controller = primitive.controller(primitive.durations[0] / (n_samples - 1))
    assert_same(steps, controller, primitive.rollout(n_samples=n_samples), agree)


def test_it_equals_the_rollout_in_a_thousand_steps(primitive, steps, agree):
    assert_same(steps, primitive.controller(primitive.durations[0] / 1000), primitive.rollout(n_samples=1001), agree)


def test_it_equals_the_rollout_with_wishes_and_beyond_the_end(primitive, twin, steps, agree):
    options = {
        "start": [1.0, 2.0, -1.0],
        "goal": primitive.goals[0] + [2.0, 1.5, 0.1],
        "duration": 5.0,
        "velocity": [0.3, 0, 1],
    }
    movement = replace(primitive.rollout(**options), n_samples=201, end=4.0)  # a sample at u = 1, where f has a kink
    assert_same(steps, primitive.controller(0.1, **options), movement, agree)


@pytest.mark.parametrize("damping", [4.0, 20.0, 20.0 + 1e-9, 90.0])
def test_it_equals_the_rollout_below_at_and_above_critical_damping(learn, twin, steps, agree, damping):
    primitive = learn(damping=damping)
    assert_same(steps, primitive.controller(0.02), primitive.rollout(n_samples=101), agree)


def test_steps_of_different_lengths_lead_to_the_same_places(primitive, agree):
    random = np.random.default_rng(0)
    on_grid = replace(primitive.rollout(), n_samples=1601, end=1.6)  # dt = 2 ms
    controller, k = primitive.controller(0.1), 0
    while k < 1500:
        n = int(random.integers(1, 100))
        state = controller.step(dt=0.002 * n)
        k += n
        agree(state.position, on_grid.positions[0, k], 1e-10)
        agree(state.velocity, on_grid.velocities[0, k], 1e-10)


def test_a_far_start_costs_no_accuracy(bio, steps):
    near, far = bio.controller(0.02), bio.controller(0.02, start=bio.starts[0] + 1e6, goal=bio.goals[0] + 1e6)
    np.testing.assert_allclose(steps(far, 150)[0] - 1e6, steps(near, 150)[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("n_basis", [3, 80])
@pytest.mark.parametrize("phase_end", [0.5, 1e-6])
def test_any_basis(make_movement, twin, steps, agree, n_basis, phase_end):
    primitive = DMP(n_basis=n_basis, phase_end=phase_end, n_points=100).learn([make_movement(1)[1]])[0]
    assert_same(steps, primitive.controller(0.01), primitive.rollout(n_samples=101), agree)


def test_it_settles_at_the_goal_and_stays(primitive):
    controller = primitive.controller(0.2)
    states = [controller.step() for _ in range(200)]
    names = [state.status.name for state in states]
    first = names.index("SETTLED")
    assert states[first].progress >= 1.0
    assert names == ["MOVING"] * first + ["SETTLED"] * (200 - first)
    np.testing.assert_allclose(states[-1].position, primitive.goals[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(states[-1].velocity, 0.0, atol=1e-12)


def test_reset_begins_anew(bio, steps):
    controller = bio.controller(0.02, goal_filter=0.1)
    first = steps(controller, 50)
    for _ in range(20):
        controller.step([9, 9, 9], goal=[5, 5, 5], tempo=0.5, coupling=[1, 1, 1], obstacles=[[1, 1, 1]])
    state = controller.reset()
    assert (state.time, state.progress) == (0.0, 0.0)
    np.testing.assert_array_equal(steps(controller, 50), first)


def test_reported_arrays_belong_to_the_caller(bio, twin, steps):
    expected = steps(bio.controller(0.02), 20)
    controller = bio.controller(0.02)
    for k in range(20):
        state = controller.step()
        np.testing.assert_array_equal(state.position, expected[0][k + 1])
        for array in state[2:6]:
            array[:] = np.nan

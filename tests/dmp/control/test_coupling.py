"""An external acceleration, held over each step."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
@pytest.mark.parametrize("n", [10, 50])
def test_a_constant_coupling_is_exact_at_any_dt(learn, twin, steps, witness, agree, formulation, n):
    primitive, push = learn(formulation), np.array([5.0, -20.0, 0.0])
    times = np.linspace(0, 1.8, n + 1)
    actual = steps(primitive.controller(1.8 / n), n, coupling=push)
    expected = witness(primitive, times, goal=primitive.goals[0], added=lambda t, x, v: push)
    agree(actual[0], expected[0], 1e-8)
    agree(actual[1][1:], expected[1][1:], 1e-8)


@pytest.mark.parametrize(("sampled_at", "order"), [(0.0, 1.0), (0.5, 2.0)])
def test_a_varying_coupling_converges_with_the_order_of_its_sampling(bio, witness, sampled_at, order):
    def push(t):
        return 20.0 * np.array([np.sin(5 * t), np.cos(3 * t), t])

    expected, _ = witness(bio, np.array([1.6]), goal=bio.goals[0], added=lambda t, x, v: push(t))
    errors = []
    for n in (40, 80, 160):
        controller, dt = bio.controller(1.6 / n), 1.6 / n
        for k in range(n):
            state = controller.step(coupling=push((k + sampled_at) * dt))
        errors.append(np.abs(state.position - expected[-1]).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([order] * 2, abs=0.15)


def test_it_acts_per_second_squared_whatever_the_tempo(bio):
    """A free step from rest: the coupling adds a dt^2 / 2 and a dt, up to what spring and damper take."""
    for tempo in (0.5, 1.0, 3.0):
        pushed, free = bio.controller(1e-4), bio.controller(1e-4)
        difference = pushed.step(coupling=[100.0, 0, 0], tempo=tempo).velocity - free.step(tempo=tempo).velocity
        np.testing.assert_allclose(difference, [0.01, 0, 0], rtol=0, atol=2e-5)


def test_the_reported_acceleration_contains_it(bio):
    pushed, free = bio.controller(1e-9 * 2), bio.controller(1e-9 * 2)
    difference = pushed.step(coupling=[7.0, 0, -1.0]).acceleration - free.step().acceleration
    np.testing.assert_allclose(difference, [7.0, 0, -1.0], rtol=0, atol=1e-5)

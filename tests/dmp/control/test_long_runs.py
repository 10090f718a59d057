"""A controller that runs for hours: time does not drift, memory does not grow, steps stay good."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from kineme.dmp.control.controller import RunningSum


@pytest.mark.parametrize("step", [0.001, 0.002, 1 / 3, 1e-9])
def test_a_million_steps_are_one_product(step):
    total, plain = RunningSum(), 0.0
    for _ in range(1_000_000):
        total.add(step)
        plain += step
    assert total.value == pytest.approx(1_000_000 * step, rel=3e-16)
    assert abs(plain - 1_000_000 * step) > 1e3 * abs(total.value - 1_000_000 * step)


def test_memory_is_flat_and_rest_is_rest(bio):
    controller = bio.controller(0.001, goal_filter=0.1)
    obstacles = np.ones((2, 3))

    def many(n):
        for k in range(n):
            goal = bio.goals[0] + (k // 1000) % 2
            state = controller.step(
                goal=goal, obstacles=obstacles, tempo=1.0 + 0.1 * (k % 7), dt=0.001 + 1e-6 * (k % 5)
            )
        return state

    many(3000)
    tracemalloc.start()
    try:
        many(300)
        before = tracemalloc.get_traced_memory()[0]
        many(6000)
        assert abs(tracemalloc.get_traced_memory()[0] - before) < 2_000
    finally:
        tracemalloc.stop()


@pytest.mark.soak
def test_after_a_day_it_still_moves_to_a_new_goal(bio):
    controller = bio.controller(0.02)
    for _ in range(43_200):
        controller.step(dt=2.0)
    assert controller.state.time == 86_400.0
    np.testing.assert_allclose(controller.state.position, bio.goals[0], rtol=0, atol=1e-14)
    for _ in range(400):
        state = controller.step(goal=[1.0, 2.0, 3.0])
    np.testing.assert_allclose(state.position, [1.0, 2.0, 3.0], atol=1e-12)
    assert state.time == pytest.approx(86_408.0, rel=1e-15)

"""Limits are reported, never enforced."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.dmp.control.plan import Status


@pytest.mark.parametrize("per_dimension", [False, True])
def test_the_velocity_limit_is_reported_where_it_is_exceeded(bio, steps, per_dimension):
    _, velocities, _ = steps(bio.controller(0.02), 100)
    limit = np.median(np.abs(velocities), axis=0) if per_dimension else float(np.median(np.abs(velocities)))
    controller = bio.controller(0.02, velocity_limit=limit)
    for k in range(1, 101):
        state = controller.step()
        np.testing.assert_array_equal(state.velocity, velocities[k])
        assert bool(state.status & Status.VELOCITY_LIMIT) is bool((np.abs(velocities[k]) > limit).any())


def test_the_acceleration_limit_is_reported_where_it_is_exceeded(bio, steps):
    _, velocities, accelerations = steps(bio.controller(0.02), 100)
    mean = np.diff(velocities, axis=0) / 0.02
    largest = np.maximum(np.abs(accelerations[1:]), np.abs(mean)).max(axis=1)
    limit = float(np.median(largest))
    controller = bio.controller(0.02, acceleration_limit=limit)
    for k in range(100):
        assert bool(controller.step().status & Status.ACCELERATION_LIMIT) is bool(largest[k] > limit)


def test_a_jump_in_tempo_is_an_acceleration(bio, steps):
    _, _, accelerations = steps(bio.controller(0.02), 100)
    controller = bio.controller(0.02, acceleration_limit=1.5 * np.abs(accelerations).max())
    for _ in range(30):
        assert not controller.step().status & Status.ACCELERATION_LIMIT
    assert controller.step(tempo=3.0).status & Status.ACCELERATION_LIMIT

"""Tempo changes when, never where."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.mark.parametrize("tempo", [0.5, 2.0])
def test_a_tempo_keeps_the_path(primitive, steps, agree, tempo):
    expected = steps(primitive.controller(0.02), 100)
    actual = steps(primitive.controller(0.02 / tempo), 100, tempo=tempo)
    for order, (one, other) in enumerate(zip(actual, expected, strict=True)):
        agree(one[1:], other[1:] * tempo**order, 1e-10)


def test_a_tempo_is_another_duration(bio, steps, agree):
    fast = steps(bio.controller(0.01), 150, tempo=2.0)
    short = steps(bio.controller(0.01, duration=bio.durations[0] / 2), 150)
    for one, other in zip(fast, short, strict=True):
        agree(one[1:], other[1:], 1e-10)


def test_any_sequence_of_tempos_keeps_the_path(primitive, agree):
    random = np.random.default_rng(3)
    varied, even = primitive.controller(0.02), primitive.controller(0.02)
    for tempo in random.uniform(0.1, 3.0, 60):
        state = varied.step(tempo=tempo)
        expected = even.step(dt=0.02 * tempo)
        assert state.progress == pytest.approx(expected.progress, abs=1e-14)
        agree(state.position, expected.position, 1e-11)
        agree(state.velocity, expected.velocity * tempo, 1e-11)


def test_a_pause_holds_the_state_and_the_path_goes_on_from_there(bio, twin, steps, agree):
    controller = bio.controller(0.02)
    before, _, _ = steps(controller, 40)
    expected = steps(bio.controller(0.02), 80)
    for _ in range(5):
        state = controller.step(tempo=0.0, coupling=[1, 1, 1], obstacles=[[0, 0, 0]])
        assert state.status.name == "PAUSED"
        np.testing.assert_array_equal(state.position, before[-1])
        assert not state.velocity.any()
    assert state.time == pytest.approx(0.9)
    after = steps(controller, 40)
    for order in (0, 1, 2):
        agree(after[order][1:], expected[order][41:], 1e-11)

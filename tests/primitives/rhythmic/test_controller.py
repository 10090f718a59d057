"""Live running: the rollout step by step, and what may change on the way."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import RhythmicDMP, SpecificationError, TrajectoryError
from kineme.primitives.control.state import Status


@pytest.fixture(scope="module")
def learned(make_rhythm):
    return RhythmicDMP().learn([make_rhythm(3), make_rhythm(4, period=0.7)])


def _run(controller, n_steps):
    return np.array([controller.step() for _ in range(n_steps)]).transpose(1, 0, 2)


@pytest.mark.parametrize("dt", [0.001, 0.02, 0.4])
def test_steps_of_any_length_follow_the_rollout(learned, agree, dt):
    n_steps = round(0.8 / dt)
    stepped = _run(learned.controller(dt, phase=learned.phases), n_steps)
    for i in range(2):
        one = learned[i]
        exact = one.rollout(n_steps * dt / one.periods[0], phase=one.phases, n_samples=n_steps + 1)
        agree(stepped[i], exact.positions[0, 1:], 1e-8)


def test_a_pushed_state_returns(learned, agree):
    controller, undisturbed = learned.controller(0.01), learned.controller(0.01)
    for one in (controller, undisturbed):
        _run(one, 30)
    controller.positions = controller.positions + 20.0
    controller.velocities = [[100.0, -100.0]]
    agree(_run(controller, 400)[:, -50:], _run(undisturbed, 400)[:, -50:], 1e-7)


def test_amplitude_baseline_and_tempo_changed_in_flight_converge_to_their_limit_cycle(learned, agree):
    controller = learned.controller(0.01)
    _run(controller, 37)
    before, speed = controller.positions, controller.velocities
    controller.amplitude = 0.4
    controller.baseline = [3.0, -8.0]
    controller.period = [2.0, 1.5]
    np.testing.assert_array_equal(controller.positions, before)
    np.testing.assert_array_equal(controller.velocities, speed)
    _run(controller, 500)
    phases = controller.phases
    goes_on = learned.rollout(0.5, amplitude=0.4, baseline=[3.0, -8.0], period=[2.0, 1.5], phase=phases, n_samples=2)
    agree(controller.positions, goes_on.positions[:, 0], 1e-6)
    agree(controller.velocities, goes_on.velocities[:, 0], 1e-6)


def test_a_change_is_exact_from_the_moment_it_happens(learned, agree):
    controller = learned[0].controller(0.01)
    _run(controller, 37)
    begin = {"start": controller.positions, "velocity": controller.velocities, "phase": controller.phases}
    controller.period, controller.amplitude = 0.8, 3.0
    exact = learned[0].rollout(0.5, period=0.8, amplitude=3.0, **begin, n_samples=41)
    agree(_run(controller, 40)[0], exact.positions[0, 1:], 1e-9)


def test_the_state_cannot_be_reached_by_accident(learned):
    controller = learned.controller(0.01)
    controller.step()[:] = 99.0
    controller.positions[:] = 99.0
    assert np.abs(controller.positions).max() < 50


@pytest.mark.parametrize(
    ("name", "value", "error", "message"),
    [
        ("period", 0.0, SpecificationError, "expected period above 0 seconds, got 0 for movement 0"),
        ("amplitude", [1.0, 2.0, 3.0], TrajectoryError, "expected amplitude for one or all of the 2 movements, got 3"),
        (
            "baseline",
            [1.0, 2.0, 3.0],
            TrajectoryError,
            r"expected baseline of shape \(2,\) or \(n, 2\), got shape \(3,\)",
        ),
        ("positions", [np.nan, 0.0], TrajectoryError, "expected finite numbers for positions, got .nan, 0.0."),
        ("velocities", None, TrajectoryError, "expected velocities for one or all of the 2 movements, got None"),
    ],
)
def test_a_change_that_cannot_be_is_refused_and_nothing_changes(learned, name, value, error, message):
    controller = learned.controller(0.01)
    before = getattr(controller, name)
    with pytest.raises(error, match=message):
        setattr(controller, name, value)
    np.testing.assert_array_equal(getattr(controller, name), before)


def test_the_step_is_a_positive_number(learned):
    with pytest.raises(SpecificationError, match="expected dt to be a number above 0, got -1"):
        learned.controller(-1)


def test_a_measurement_is_where_the_movement_goes_on(learned):
    one, other = learned.controller(0.01), learned.controller(0.01)
    where, speed = one.positions + 2.0, one.velocities * 0.5
    other.positions, other.velocities = where, speed
    np.testing.assert_array_equal(one.step(where, speed), other.step())
    np.testing.assert_array_equal(one.step([3.0, 1.0]), other.step(np.tile([3.0, 1.0], (2, 1))))
    assert one.status == Status.MOVING


class Broken:
    def __array__(self, *_, **__):
        raise RuntimeError("the driver died")


BAD = [[np.nan, 0.0], np.ones(3), np.ones((3, 2)), "left", [1e300, 0.0], 1.0, [], object(), Broken()]


@pytest.mark.parametrize("value", BAD, ids=range(len(BAD)))
@pytest.mark.parametrize("name", ["position", "velocity"])
def test_a_measurement_that_cannot_be_used_is_left_out_and_said_so(learned, name, value):
    one, other = learned.controller(0.01), learned.controller(0.01)
    for k in range(4):
        bad = {name: value} if k == 2 else {}
        np.testing.assert_array_equal(one.step(**bad), other.step())
        assert one.status == (Status.MOVING | Status.MEASUREMENT_REJECTED if bad else Status.MOVING)
        assert one.status.rejected is bool(bad)

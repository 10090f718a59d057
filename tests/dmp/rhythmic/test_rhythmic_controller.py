"""Rhythms step by step: the rollout, pushes, and what may change on the way: baseline, amplitude, period."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import RhythmicDMP
from kineme.control import RhythmicState, State, Status
from kineme.errors import SpecificationError, TrajectoryError
from soaking import SOAK


@pytest.fixture(scope="module")
def learned(make_rhythm):
    return RhythmicDMP().learn([make_rhythm(3), make_rhythm(4, period=0.7)])


@pytest.fixture(params=["always", "never"])
def twin(request, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", request.param)


def _run(controller, n_steps, **told):
    return np.array([controller.step(**told).position for _ in range(n_steps)])


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("dt", [0.001, 0.02, 0.4, 5.0])
@pytest.mark.parametrize("which", [0, 1])
def test_steps_of_any_length_follow_the_rollout(learned, twin, agree, dt, which):
    one, n_steps = learned[which], max(3, round(0.8 / dt))
    stepped = _run(one.controller(dt, phase=one.phases), n_steps)
    exact = one.rollout(n_steps * dt / one.periods[0], phase=one.phases, n_samples=n_steps + 1)
    agree(stepped, exact.positions[0, 1:], 1e-8)


def test_it_begins_as_the_rollout_would(learned, twin, agree):
    options = {"phase": 2.0, "period": 1.3, "amplitude": 0.4, "baseline": [3.0, -8.0], "start": [1.0, 2.0]}
    options["velocity"] = [9.0, -9.0]
    controller = learned[0].controller(0.013, **options)
    states = [controller.state, *(controller.step() for _ in range(200))]
    exact = learned[0].rollout(2.0, **options, n_samples=201)
    for name, expected in (
        ("position", exact.positions),
        ("velocity", exact.velocities),
        ("acceleration", exact.accelerations),
    ):
        agree(np.array([getattr(state, name) for state in states]), expected[0], 1e-10)


def test_a_pushed_state_returns(learned, agree):
    controller, undisturbed = learned[0].controller(0.01), learned[0].controller(0.01)
    for one in (controller, undisturbed):
        _run(one, 30)
    here = controller.state.position
    controller.step(here + 20.0, [100.0, -100.0])
    undisturbed.step()
    assert np.abs(controller.state.position - undisturbed.state.position).max() > 10
    agree(_run(controller, 400)[-50:], _run(undisturbed, 400)[-50:], 1e-7)


def test_amplitude_baseline_and_period_changed_in_flight_converge_to_their_limit_cycle(learned, agree):
    controller = learned[0].controller(0.01)
    _run(controller, 37)
    state = controller.step(goal=[3.0, -8.0], amplitude=0.4, period=2.0)
    assert state.status == Status.MOVING
    assert (state.amplitude, state.period) == (pytest.approx(0.4), 2.0)
    _run(controller, 500)
    state = controller.state
    exact = learned[0].rollout(0.5, amplitude=0.4, baseline=[3.0, -8.0], period=2.0, phase=state.phase, n_samples=2)
    agree(state.position, exact.positions[0, 0], 1e-6)
    agree(state.velocity, exact.velocities[0, 0], 1e-6)
    np.testing.assert_allclose(state.goal, [3.0, -8.0])


def test_a_change_is_exact_from_the_moment_it_happens(learned, agree):
    controller = learned[0].controller(0.01)
    _run(controller, 37)
    state = controller.state
    begin = {"start": state.position, "velocity": state.velocity, "phase": state.phase}
    exact = learned[0].rollout(0.5, period=0.8, amplitude=3.0, **begin, n_samples=41)
    agree(_run(controller, 40, period=0.8, amplitude=3.0), exact.positions[0, 1:], 1e-9)


def test_a_new_period_leaves_the_velocity_and_a_new_tempo_the_path(learned, agree):
    for told, factor in (({"period": 0.4}, 1.0), ({"tempo": 2.0}, 2.0)):
        controller = learned[0].controller(1e-9)
        _run(controller, 3)
        before, after = controller.state, controller.step(**told)
        agree(after.velocity, factor * before.velocity, 1e-5)
    path, fast = learned[0].controller(0.02), learned[0].controller(0.01)
    agree(_run(fast, 50, tempo=2.0), _run(path, 50), 1e-10)


def test_with_a_filter_baseline_and_amplitude_glide(learned):
    period = float(learned.periods[0])
    controller = learned[0].controller(0.01, goal_filter=0.2)
    amplitude, goal = controller.state.amplitude, controller.state.goal
    for k in range(1, 101):
        state = controller.step(goal=goal + 2.0, amplitude=3.0 * amplitude)
        left = np.exp(-0.01 * k / 0.2)
        np.testing.assert_allclose(state.goal, goal + 2.0 * (1 - left), rtol=1e-12)
        assert state.amplitude == pytest.approx(amplitude * (3.0 - 2.0 * left), rel=1e-12)
    exact = learned[0].rollout(1.0, amplitude=3.0 * amplitude, baseline=goal + 2.0, phase=_run_phase(controller, 800))
    np.testing.assert_allclose(controller.state.position, exact.positions[0, 0], atol=1e-6)
    assert controller.state.progress == pytest.approx(9.0 / period)


def _run_phase(controller, n):
    _run(controller, n)
    return controller.state.phase


def test_a_rhythm_never_settles_and_can_be_paused(learned):
    controller = learned[0].controller(0.5)
    assert {controller.step().status for _ in range(100)} == {Status.MOVING}
    before, state = controller.state, controller.step(tempo=0.0)
    assert state.status == Status.PAUSED
    np.testing.assert_array_equal(state.position, before.position)
    assert state.phase == before.phase


@pytest.mark.soak
def test_after_a_million_periods_the_phase_is_as_exact_as_in_the_first(make_rhythm, agree):
    """A million in `make soak`, else eighty thousand."""
    n_steps = 2500 if SOAK else 200
    one = RhythmicDMP(n_basis=5).learn([make_rhythm(3)])[0]  # the fewer, the fewer parts of a period a step takes
    dt = float(one.periods[0]) * (400.0 + 0.25)
    controller = one.controller(dt)
    for _ in range(n_steps):
        state = controller.step()
    assert state.progress == pytest.approx(n_steps * 400.25, rel=1e-14)
    expected = one.rollout(1.0, phase=n_steps * 0.25 * 2 * np.pi, n_samples=2)
    agree(state.position, expected.positions[0, 0], 1e-8)


def test_the_state_is_a_state_with_phase_amplitude_and_period(learned):
    controller = learned[0].controller(0.01, phase=1.5, amplitude=0.3, period=2.0)
    state = controller.state
    assert isinstance(state, State)
    assert isinstance(state, RhythmicState)
    assert state.progress == 0.0
    assert (state.phase, state.amplitude, state.period) == (pytest.approx(1.5), pytest.approx(0.3), 2.0)
    state = controller.step()
    assert state.phase == pytest.approx(1.5 + 2 * np.pi * 0.01 / 2.0)


def test_reset_forgets_what_was_changed(learned):
    controller = learned[0].controller(0.01, goal_filter=0.1)
    first = _run(controller, 20)
    _run(controller, 20, amplitude=5.0, period=0.5, goal=[9.0, 9.0])
    state = controller.reset()
    assert (state.time, state.progress, state.period) == (0.0, 0.0, learned.periods[0])
    assert state.amplitude == pytest.approx(learned.amplitudes[0])
    np.testing.assert_array_equal(_run(controller, 20), first)


class Broken:
    def __float__(self):
        raise RuntimeError("the driver died")


BAD = [np.nan, np.inf, "wide", [], [1.0, 2.0], object(), Broken()]


@pytest.mark.parametrize("value", [*BAD, 0.0, -1.0, 1e-9], ids=lambda value: type(value).__name__)
def test_a_period_that_cannot_be_is_left_out_and_said_so(learned, value):
    _goes_on(learned[0], {"period": value}, Status.PERIOD_REJECTED)


@pytest.mark.parametrize("value", BAD, ids=lambda value: type(value).__name__)
def test_an_amplitude_that_cannot_be_is_left_out_and_said_so(learned, value):
    _goes_on(learned[0], {"amplitude": value}, Status.AMPLITUDE_REJECTED)


def _goes_on(primitive, told, status):
    one, other = primitive.controller(0.01), primitive.controller(0.01)
    for k in range(4):
        state, expected = one.step(**(told if k == 2 else {})), other.step()
        for name in ("position", "velocity", "acceleration", "phase", "amplitude", "period"):
            np.testing.assert_array_equal(getattr(state, name), getattr(expected, name))
        assert state.status == (Status.MOVING | status if k == 2 else Status.MOVING)
        assert state.status.rejected is (k == 2)


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        ({"dt": -1}, SpecificationError, "expected dt to be a number above 0, got -1"),
        ({"period": 0.0}, SpecificationError, "expected period above 0 seconds, got 0 for movement 0"),
        ({"amplitude": [1.0, 2.0]}, SpecificationError, "expected one primitive to control, got 2"),
        ({"amplitude": np.nan}, TrajectoryError, "expected finite numbers for amplitude, got nan"),
        ({"baseline": [1.0, 2.0, 3.0]}, SpecificationError, "expected baseline to be 2 finite numbers"),
        ({"start": [np.nan, 0.0]}, SpecificationError, "expected start to be 2 finite numbers, one per dimension"),
        ({"goal_filter": 0}, SpecificationError, "expected goal_filter to be a number above 0, got 0"),
    ],
)
def test_wishes_that_cannot_be_are_refused_at_once(learned, wrong, error, message):
    with pytest.raises(error, match=message):
        learned[0].controller(**({"dt": 0.01} | wrong))


def test_one_rhythm_at_a_time(learned):
    with pytest.raises(SpecificationError, match=r"expected one primitive to control, got 2; choose one: prim"):
        learned.controller(0.01)


def test_goal_is_another_name_of_the_baseline(learned):
    goal = learned[0].controller(0.01, goal=[3.0, -8.0]).step()
    np.testing.assert_array_equal(goal.position, learned[0].controller(0.01, baseline=[3.0, -8.0]).step().position)
    with pytest.raises(SpecificationError, match="got both"):
        learned[0].controller(0.01, goal=[3.0, -8.0], baseline=[3.0, -8.0])


@pytest.mark.parametrize("n_steps", [0, 7])
def test_an_obstacle_at_its_own_position_turns_it_little_and_the_same_way_wherever_it_is(learned, twin, agree, n_steps):
    """Not by the rounding that is left of the difference of two equal positions."""
    turned = []
    for baseline in ([0.0, 0.0], [0.1, -0.3], [1000.3, 7.7], [-3e5, 1e5 / 3]):
        controller, free = (learned[0].controller(1e-3, phase=0.3, baseline=baseline) for _ in range(2))
        for one in (controller, free):
            _run(one, n_steps)
        with_it, without = controller.step(obstacles=[controller.state.position]), free.step()
        turned.append(with_it.velocity - without.velocity)
    for one in turned[1:]:
        agree(one, turned[0], 1e-3)

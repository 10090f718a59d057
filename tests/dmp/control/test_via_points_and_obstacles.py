"""Via points beside obstacles are passed, or it is said by how much they are missed."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

import kineme
from kineme.dmp.control import controller as controlling
from kineme.dmp.control.plan import Status, passed
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.dmp.generation.generate import Learned, MovementOptions, generate
from kineme.errors import heard_warnings
from kineme.orientation import PoseDMP
from soaking import examples

DURATION = 2.0


def curve(n=200):
    """An S of one unit, with the velocity of least jerk."""
    u = np.linspace(0, 1, n)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    return kineme.Trajectory(DURATION * u, np.column_stack((s, 0.3 * np.sin(2 * np.pi * s))))


def away(made, share, point):
    """Distance of the movement from a point at a share of its duration."""
    x, times = made.columns["positions"], made.columns["times"]
    return np.linalg.norm([np.interp(share * DURATION, times, x[:, k]) - point[k] for k in range(len(point))])


@pytest.mark.parametrize("formulation", FORMULATIONS)
@settings(max_examples=examples(3, 8), deadline=None)
@given(share=st.floats(0.2, 0.8), side=st.floats(-0.15, 0.15), along=st.floats(0.3, 0.7), beside=st.floats(-0.1, 0.1))
def test_a_via_point_is_passed_or_the_distance_is_said(formulation, share, side, along, beside):
    primitive = kineme.DMP(formulation).learn([curve()])
    x = curve().positions
    point, obstacle = x[int(199 * share)] + [0, side], x[int(199 * along)] + [0, beside]
    options = MovementOptions(via=((share, point),), obstacles=obstacle[None], rate=100.0)
    with heard_warnings() as heard:
        made = generate(Learned(primitive), options)
    off = away(made, share, point)
    said = [re.search(r"is missed by (\S+): ", message) for message in heard]
    distances = [float(match[1]) for match in said if match]
    if distances:
        assert distances == pytest.approx([off], rel=0.01)
    else:
        assert off <= 0.0101 * np.ptp(made.columns["positions"], axis=0).max()


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_via_point_at_some_distance_from_the_obstacle_is_passed(formulation):
    primitive = kineme.DMP(formulation).learn([curve()])
    options = MovementOptions(via=((0.7, np.array([0.85, -0.35])),), obstacles=np.array([[0.3, 0.3]]), rate=100.0)
    with heard_warnings() as heard:
        made = generate(Learned(primitive), options)
    assert not heard
    assert away(made, 0.7, [0.85, -0.35]) < 0.01


def test_a_via_point_on_the_obstacle_is_missed_and_said_with_point_distance_and_what_to_do():
    primitive = kineme.DMP().learn([curve()])
    middle = curve().positions[100]
    options = MovementOptions(via=((0.5, middle),), obstacles=middle[None], rate=100.0)
    with pytest.warns(
        kineme.errors.ExtrapolationWarning, match=r"the via point \[.*\] at 0\.5 .* missed by .*: .* move one"
    ):
        generate(Learned(primitive), options)


def test_of_poses_the_positions_are_led_through():
    x = np.column_stack((curve().positions, np.zeros(200)))
    poses = np.column_stack((x, np.tile([1.0, 0.0, 0.0, 0.0], (200, 1))))
    primitive = PoseDMP().learn([kineme.Trajectory(curve().times, poses)])
    point = np.array([0.85, -0.35, 0.0, 1.0, 0.0, 0.0, 0.0])
    options = MovementOptions(via=((0.7, point),), obstacles=np.array([[0.3, 0.3, 0.0]]), rate=100.0)
    with heard_warnings() as heard:
        made = generate(Learned(primitive), options)
    assert not heard
    assert away(made, 0.7, point[:3]) < 0.01


def passing(controller, steps, **told):
    """Time, distance and status of the steps in which a via point is passed, and the path (T, d) at all steps."""
    states = [controller.state] + [controller.step(**told) for _ in range(steps)]
    path = CubicSpline([state.time for state in states], [state.position for state in states])
    return [(state.time, state.via_missed, state.status) for state in states if state.via_missed > 0], path


@pytest.mark.parametrize("formulation", FORMULATIONS)
@settings(max_examples=3)
@given(share=st.floats(0.2, 0.8), side=st.floats(-0.15, 0.15), along=st.floats(0.3, 0.7), beside=st.floats(-0.1, 0.1))
def test_a_live_controller_says_when_and_by_how_much_it_misses_its_via_point(formulation, share, side, along, beside):
    primitive = kineme.DMP(formulation).learn([curve()])
    x = curve().positions
    point, obstacle = x[int(199 * share)] + [0, side], x[int(199 * along)] + [0, beside]
    controller = primitive.controller(0.007, via=[(share, point)])
    ((time, distance, status),), path = passing(controller, 320, obstacles=obstacle[None])
    assert time - 0.007 <= share * DURATION <= time
    assert distance == pytest.approx(np.linalg.norm(path(share * DURATION) - point), rel=1e-3, abs=1e-5)
    assert (Status.VIA_POINT_MISSED in status) == (distance > 0.01 * np.ptp(x, axis=0).max())
    assert controller.state.via_missed == 0.0


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("dt", [0.01, 0.9])
def test_undisturbed_a_live_controller_meets_its_via_points_in_steps_of_any_length(formulation, dt):
    primitive = kineme.DMP(formulation).learn([curve()])
    via = [(0.2, [0.1, 0.2]), (0.5, [np.nan, 0.1]), (0.6, [0.7, np.nan])]
    met, _ = passing(primitive.controller(dt, via=via), int(2.2 / dt))
    assert max(distance for _, distance, _ in met) < 1e-9
    assert not any(Status.VIA_POINT_MISSED in status for *_, status in met)


def test_of_several_in_one_step_the_largest_distance_is_said_and_of_a_point_that_of_its_dimensions(monkeypatch):
    x = curve().positions + np.array([3.0, 4.0])
    primitive, obstacle = kineme.DMP().learn([kineme.Trajectory(curve().times, x)]), x[[90]] + [0, 0.02]
    via = [(0.4, x[80] + [0, 0.05]), (0.5, [np.nan, x[100, 1] + 0.1])]
    distances = []
    for order in (list, lambda some: [*some][::-1]):
        monkeypatch.setattr(controlling, "passed", lambda *told, order=order: order(passed(*told)))
        distances.append(primitive.controller(0.55 * DURATION, via=via).step(obstacles=obstacle).via_missed)
    assert distances[0] == distances[1] > 0.01
    ((_, missed, status),), path = passing(primitive.controller(0.01, via=via[1:]), 200, obstacles=obstacle)
    assert missed == pytest.approx(abs(path(0.5 * DURATION)[1] - via[1][1][1]), rel=1e-3)
    assert Status.VIA_POINT_MISSED in status


def test_of_a_rhythm_they_are_passed_in_every_period_and_missed_at_another_amplitude():
    t = np.linspace(0, 3, 300)
    circle = np.column_stack((np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)))
    primitive = kineme.RhythmicDMP().learn([kineme.Trajectory(t, circle)])
    point = np.array([0.1, 1.2])
    controller = primitive.controller(0.03, via=[(0.0, [1.1, 0.0]), (np.pi / 2, point)])
    met, _ = passing(controller, 102)
    assert len(met) == 6
    assert all(status == Status.MOVING for *_, status in met)
    for _ in range(400):
        state = controller.step(amplitude=2 * primitive.amplitudes[0])
        if state.via_missed > 0.5 and state.time > 10:
            assert Status.VIA_POINT_MISSED in state.status
            break
    else:
        pytest.fail("no via point is missed at twice the amplitude")
    assert controller.reset().via_missed == 0.0
    controller = primitive.controller(0.03, via=[(np.pi / 2, point)])
    controller.step(dt=0.6)
    assert controller.step(dt=3.5).via_missed > 0  # in all periods of a step, which ends before that phase


def test_of_a_live_pose_the_positions_are_measured():
    x = np.column_stack((curve().positions, np.zeros(200)))
    poses = np.column_stack((x, np.tile([1.0, 0.0, 0.0, 0.0], (200, 1))))
    primitive = PoseDMP().learn([kineme.Trajectory(curve().times, poses)])
    point = np.append(x[100] + [0, 0.05, 0], [1.0, 0.0, 0.0, 0.0])
    controller = primitive.controller(0.01, via=[(0.5, point)])
    ((_, distance, status),), path = passing(controller, 200, obstacles=x[[100]])
    assert distance == pytest.approx(np.linalg.norm(path(1.0)[:3] - point[:3]), rel=1e-3)
    assert distance > 0.01
    assert Status.VIA_POINT_MISSED in status
    assert "via_missed" in " ".join(status.messages)

"""Via points beside obstacles are passed, or it is said by how much they are missed."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.errors import heard_warnings
from kineme.orientation import PoseDMP
from kineme.primitives.discrete.formulations import FORMULATIONS
from kineme.primitives.generation.generate import MovementOptions, generate
from kineme.primitives.generation.learned import Learned

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
@settings(max_examples=8, deadline=None)
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
    with pytest.warns(kineme.ExtrapolationWarning, match=r"the via point \[.*\] at 0\.5 .* missed by .*: .* move one"):
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

"""Movements of the tip and of the joints, executable and checked."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme.errors import TrajectoryError
from kineme.robots import InfeasibleError, load, move
from kineme.robots.kinematics.inverse import InverseKinematics
from kineme.robots.models.table import MODELS

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


def stroke(robot, seconds=3.0, size=1.0, n=150):
    """An S in front of the tip at rest, with the velocity of least jerk."""
    u = np.linspace(0, 1, n)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    scale = size * (0.25 if robot.name == "so101" else 1.0)
    shape = np.column_stack((0 * s - 0.05, 0.42 * (s - 0.5), 0.1 * np.sin(2 * np.pi * s)))
    return kineme.Trajectory(times=seconds * u, positions=InverseKinematics(robot).tip_position + scale * shape)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("timing", ["generated", "slowed", "fastest"])
def test_every_arm_follows_a_stroke_within_its_limits(name, timing):
    robot = load(name)
    made = move(stroke(robot), robot, timing=timing)
    t = made.trajectory
    assert np.all((t.positions >= robot.lower - 1e-9) & (t.positions <= robot.upper + 1e-9))
    assert np.all(np.abs(t.velocities) <= robot.velocity)
    assert np.all(np.abs(t.accelerations) <= robot.acceleration)
    off = next(check.worst for check in made.preflight.checks if check.what == "tracking")
    assert off < 0.05  # mm


def test_a_stroke_that_is_too_fast_is_refused_with_the_duration_that_works():
    robot = load("ur5e")
    with pytest.raises(InfeasibleError, match=r"limit .* It works in .* s instead of 0\.4") as caught:
        move(stroke(robot, 0.4), robot)
    made = move(stroke(robot, 0.4), robot, timing="slowed")
    assert made.preflight.passed
    assert made.factor == pytest.approx(caught.value.preflight.slower, rel=0.02)


def test_what_is_out_of_reach_is_said_with_the_distance():
    robot = load("panda")
    far = stroke(robot)
    with pytest.raises(TrajectoryError, match=r"does not reach \(.*\) m at 0\.00 s: its tip stays .* m away"):
        move(kineme.Trajectory(times=far.times, positions=far.positions + np.array([2.0, 0, 0])), robot)


def test_a_free_place_brings_a_far_movement_within_reach():
    robot = load("wam")
    far = stroke(robot, size=0.5)
    made = move(
        kineme.Trajectory(times=far.times, positions=far.positions + np.array([2.0, 0, 0])), robot, place="free"
    )
    assert made.preflight.passed


def test_movements_of_the_joints_need_no_kinematics():
    robot = load("so101")
    u = np.linspace(0, 1, 60)[:, None]
    joints = robot.rest + 0.3 * np.sin(np.pi * u) ** 2 * np.array([1, -1, 1, 0.5, 0])
    made = move(kineme.Trajectory(times=3 * u[:, 0], positions=joints), robot, space="joints")
    np.testing.assert_allclose(made.trajectory.positions[-1], joints[-1], atol=1e-9)


def test_force_returns_what_did_not_pass():
    robot = load("ur5e")
    made = move(stroke(robot, 0.4), robot, force=True)
    assert not made.preflight.passed

"""Letters of LASA on arms, as fast as they go and slowed down: limits between samples, and no slower than needed."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import kineme
from arm_samples import stroke
from kineme.robots import load, move
from kineme.robots.execution.joint_trajectory import as_generated, between, fastest
from kineme.robots.execution.preflight import along
from kineme.robots.planning import robot_movement

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

_robot = lru_cache(load)


@lru_cache
def letter(name, size, seconds):
    """The first demonstration of a letter, so many meters large."""
    (demonstration,) = kineme.load_lasa([name])[:1]
    path = size * demonstration.positions / np.ptp(demonstration.positions, axis=0).max()
    return kineme.DMP().learn([kineme.Trajectory(demonstration.times, path)]).rollout(duration=seconds)


def shares(robot, trajectory, parts=20):
    """The largest velocity, acceleration and torque between samples, in their limits."""
    t = trajectory.times
    fine = np.append((t[:-1, None] + np.diff(t)[:, None] * np.arange(parts) / parts).ravel(), t[-1])
    followed = between(trajectory, fine)
    state = along(robot, between(trajectory, fine[:: parts // 4]))
    torques = np.abs(state.holding_torques + state.moving_torques)
    return (
        (np.abs(followed.velocities) / robot.velocity).max(),
        (np.abs(followed.accelerations) / robot.acceleration).max(),
        np.max(torques / np.where(np.isnan(robot.effort), np.inf, robot.effort)),
    )


@pytest.mark.parametrize(
    ("arm", "name", "size", "least"),
    [("panda", "Leaf_1", 0.2, 1.02), ("ur5e", "NShape", 0.1, 1.11), ("so101", "JShape_2", 0.07, 1.43)],
)
def test_letters_with_sharp_corners_are_timed_near_the_optimum_within_all_limits(arm, name, size, least):
    robot = _robot(arm)
    made = move(letter(name, size, 5.0), robot, timing="fastest", place="free")
    assert max(shares(robot, made.trajectory)) <= 1.001
    duration = made.trajectory.duration - made.begins
    assert duration == pytest.approx(least, rel=0.06)
    used = np.abs(made.trajectory.accelerations[made.first :]) / robot.acceleration
    assert np.median(used.max(axis=1)) > 0.9  # a joint is at a limit nearly always


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("arm", ["ur5e", "so101"])
@pytest.mark.parametrize("seconds", [0.07, 0.31, 0.55])
def test_slowed_down_passes_and_half_a_percent_faster_does_not(arm, seconds):
    robot = _robot(arm)
    made = move(letter("GShape", 0.05, seconds), robot, timing="slowed", place="free")
    assert made.preflight.passed
    assert max(shares(robot, made.trajectory)) <= 1.001
    largest = shares(robot, made.trajectory)
    assert max(largest[0], np.sqrt(largest[1]), largest[2]) > 0.994


def test_a_weak_arm_is_slowed_down_to_its_torques_and_timed_within_them():
    """Torques do not fall with the square of the duration: what gravity takes stays."""
    robot = _robot("so101")
    holding = np.abs(along(robot, move(stroke(robot, 9.0), robot).trajectory).holding_torques).max(axis=0)
    weak = kineme.robots.load("so101", max_acceleration=60.0)
    weak.effort[:] = 1.1 * holding.max()
    for timing in ("slowed", "fastest"):
        made = move(stroke(weak, 0.4), weak, timing=timing)
        assert made.preflight.passed
        assert 0.9 < shares(weak, made.trajectory)[2] <= 1.001


def test_the_fastest_is_never_slower_than_the_movement_itself_where_that_passes():
    """A sample a second is too little for the fastest timing, and enough for a movement of eight."""
    robot = _robot("so101")
    movement = stroke(robot, 8.0)
    assert move(movement, robot, rate=1.0).preflight.passed
    made = move(movement, robot, rate=1.0, timing="fastest")
    assert made.preflight.passed
    assert made.factor == pytest.approx(1.0, abs=1e-4)  # with the ramps of a tail that has not come to rest


def test_a_path_without_any_timing_is_slowed_down(monkeypatch):
    robot = _robot("ur5e")
    monkeypatch.setattr(robot_movement, "fastest", lambda *_: None)
    slowed, fast = (move(stroke(robot, 0.8), robot, timing=timing) for timing in ("slowed", "fastest"))
    assert fast.preflight.passed
    assert fast.factor == slowed.factor > 1


def test_joints_that_an_arm_cannot_hold_have_no_timing():
    weak = kineme.robots.load("so101")
    weak.effort[:] = 0.01
    u = np.linspace(0, 1, 60)
    path = CubicSpline(u, weak.rest + np.outer(10 * u**3 - 15 * u**4 + 6 * u**5, np.full(5, 0.1)))
    assert fastest(weak, path) is None
    assert len(as_generated(weak, path, 100.0).generated) > 100

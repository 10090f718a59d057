"""What `move` returns, looked at by other code: limits between samples too, tips by MuJoCo, timings by formulas."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, CubicSpline

import kineme
from arm_samples import simulated, stroke, tip_in
from kineme.errors import TrajectoryError
from kineme.robots import load, move
from kineme.robots.execution.joint_trajectory import fastest, sampled
from kineme.robots.kinematics.descent import InverseKinematics, postures
from kineme.robots.models.robot import MODELS
from soaking import examples

pytest.importorskip("pinocchio", reason="the extra robot is not installed")
mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")

_robot = lru_cache(load)


@lru_cache
def _simulated(name):
    return simulated(mujoco, _robot(name))


def random_stroke(robot, seed, seconds):
    """A smooth curve near the tip at rest that begins and ends at rest, of 2 to 25 cm."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, 80)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    waves = np.sin(np.pi * np.outer(s, [1, 2, 3])) @ (rng.normal(size=(3, 3)) / [[1], [2], [3]])
    path = s[:, None] * rng.normal(size=3) + 0.5 * waves
    path *= rng.uniform(0.02, 0.25) / np.ptp(path, axis=0).max()
    path += rng.uniform(-0.1, 0.1, 3) * (0.3 if robot.name == "so101" else 1.0)
    return kineme.Trajectory(times=seconds * u, positions=InverseKinematics(robot).tip_position + path)


@settings(max_examples=examples(5), deadline=None)
@given(
    name=st.sampled_from(list(MODELS)),
    seed=st.integers(0, 2**32 - 1),
    seconds=st.floats(0.3, 6.0),
    timing=st.sampled_from(["generated", "slowed", "fastest"]),
    place=st.sampled_from(["as given", "free"]),
)
def test_what_is_returned_keeps_every_limit_and_the_path(name, seed, seconds, timing, place):
    robot = _robot(name)
    try:
        made = move(random_stroke(robot, seed, seconds), robot, timing=timing, place=place)
    except TrajectoryError:
        return
    t = made.trajectory
    between = CubicHermiteSpline(t.times, t.positions, t.velocities)
    fine = np.linspace(0, t.duration, 20 * len(t))
    q, v = between(fine), between(fine, 1)
    assert np.all((q >= robot.lower - 1e-4) & (q <= robot.upper + 1e-4))
    assert np.all(np.abs(v) <= 1.01 * robot.velocity)
    assert np.all(np.abs(np.diff(t.velocities, axis=0) / np.diff(t.times)[:, None]) <= 1.01 * robot.acceleration)
    assert np.all(np.abs(t.velocities[[0, -1]]) <= 0.02 * robot.velocity)
    arm = _simulated(name)
    data = mujoco.MjData(arm)
    first = int(np.searchsorted(t.times, made.begins - 1e-9))
    for k in range(first, len(t), 7):
        data.qpos[:] = t.positions[k]
        mujoco.mj_kinematics(arm, data)
        position, rotation = tip_in(mujoco, arm, data, robot)
        assert np.linalg.norm(position - made.path.positions[k - first]) < 1e-3
        if robot.n_joints >= 6:
            cosine = (np.trace(rotation.T @ made.path.rotations[k - first]) - 1) / 2
            assert np.degrees(np.arccos(np.clip(cosine, -1, 1))) < 1.0


def test_the_fastest_straight_line_of_the_joints_is_a_trapezoid():
    """One joint over a distance d, at most v and a: ``d / v + v / a``, or ``2 sqrt(d / a)`` if it never reaches v."""
    robot = load("ur5e", max_velocity=1.0, max_acceleration=2.0)
    v, a = 1.0, 2.0
    for distance in (0.1, 0.5, 2.0):
        s = np.linspace(0, 1, 60)
        joints = np.tile(robot.rest, (60, 1))
        joints[:, 0] += distance * (10 * s**3 - 15 * s**4 + 6 * s**5)
        timing = fastest(robot, CubicSpline(s, joints))
        least = distance / v + v / a if distance > v**2 / a else 2 * np.sqrt(distance / a)
        assert timing.course.x[-1] == pytest.approx(least, rel=0.005)
        made = sampled(robot, timing, 100.0).trajectory
        assert made.duration == pytest.approx(least + 0.02, rel=0.005)


def test_slowed_takes_the_ratio_of_velocities_or_the_root_of_that_of_accelerations():
    robot = load("ur5e", max_velocity=1.0, max_acceleration=4.0)
    for seconds, distance in ((0.4, 1.0), (0.2, 0.1)):
        u = np.linspace(0, 1, 200)
        shape = 10 * u**3 - 15 * u**4 + 6 * u**5
        joints = np.tile(robot.rest, (200, 1))
        joints[:, 2] += distance * shape
        made = move(kineme.Trajectory(times=seconds * u, positions=joints), robot, timing="slowed", rate=1000.0)
        by_velocity = 15 / 8 * distance / seconds / 1.0
        by_acceleration = np.sqrt(10 / np.sqrt(3) * distance / seconds**2 / 4.0)
        assert made.factor == pytest.approx(max(by_velocity, by_acceleration), rel=5e-3)


def test_branches_are_those_that_an_analytic_solver_finds():
    ssik = pytest.importorskip("ssik", reason="ssik is not installed")
    robot = load("ur5e")
    alpha = [np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0]
    a, d = [0, -0.425, -0.3922, 0, 0, 0], [0.1625, 0, 0, 0.1333, 0.0997, 0.0996]
    other = ssik.Manipulator.from_dh(alpha, a, d)
    ik = InverseKinematics(robot)
    for shift in ([0.0, 0.0, 0.0], [0.1, 0.2, -0.1], [-0.1, -0.3, 0.1]):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = ik.tip_rotation, ik.tip_position + shift
        in_base = np.diag([-1.0, -1.0, 1.0, 1.0]) @ pose  # of the controller, which ROS turns by 180 degrees
        known = np.array([solution.q for solution in other.solve(in_base, respect_limits=False)])
        found = postures(robot, pose[:3, 3], pose[:3, :3], ik.costs).joints
        apart = np.angle(np.exp(1j * (found[:, None] - known)))
        distances = np.abs(apart).max(axis=2)
        assert distances.min(axis=1).max() < 1e-2
        assert len(np.unique(distances.argmin(axis=1))) >= 0.75 * len(known)


def test_a_stroke_and_its_mirror_image_take_as_long():
    robot = load("panda")
    there = stroke(robot)
    mirrored = kineme.Trajectory(times=there.times, positions=there.positions * [1, -1, 1])
    made = [move(one, robot, timing="fastest").trajectory.duration for one in (there, mirrored)]
    assert made[0] == pytest.approx(made[1], rel=0.15)


def test_velocities_and_accelerations_are_derivatives_also_in_slowed_ramps():
    robot = load("ur5e", max_velocity=1.0, max_acceleration=4.0)
    joints = np.tile(robot.rest, (60, 1))
    joints[:, 2] += np.linspace(0, 0.8, 60)  # at full speed at both ends
    made = move(kineme.Trajectory(times=np.linspace(0, 0.5, 60), positions=joints), robot, timing="slowed", rate=2000.0)
    t = made.trajectory
    assert made.factor > 1
    np.testing.assert_allclose(np.gradient(t.positions, t.times, axis=0)[1:-1], t.velocities[1:-1], atol=5e-3)
    moving = t.times > made.begins + 0.01
    changes = np.gradient(t.velocities, t.times, axis=0)[moving][1:-1]
    np.testing.assert_allclose(changes, t.accelerations[moving][1:-1], atol=0.1)


def test_an_arm_that_holds_still_takes_its_own_time():
    robot, t = load("panda"), np.linspace(0, 2, 101)
    still = kineme.Trajectory(t, np.tile(robot.rest, (101, 1)))
    own, quick = (move(still, robot, space="joints", timing=timing, steps={"gripper": (t > 1) * 1.0})
                  for timing in ("generated", "fastest"))  # fmt: skip
    assert quick.preflight.passed
    assert quick.trajectory.duration == pytest.approx(own.trajectory.duration)

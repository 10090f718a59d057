"""Recorded paths of an arm: that arm follows them, and what is left free never loses a movement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

import kineme
from kineme.errors import TrajectoryError
from kineme.robots import load, move
from kineme.robots.kinematics.descent import ORIENTATIONS, kinematics
from kineme.robots.models.robot import MODELS
from soaking import combined, examples

pinocchio = pytest.importorskip("pinocchio", reason="the extra robot is not installed")

H, PI = np.pi / 2, np.pi

# Joints of arms that do not come with kineme: kind, place and turn in the frame before, axis, limits [deg or m].
# KUKA's data sheet of the LBR iiwa 14 R820, and the torso and the right arm of pr2_description.
ARMS = {
    "iiwa": [
        ("revolute", (0, 0, 0.1575), (0, 0, 0), "0 0 1", (-170, 170)),
        ("revolute", (0, 0, 0.2025), (H, 0, PI), "0 0 1", (-120, 120)),
        ("revolute", (0, 0.2045, 0), (H, 0, PI), "0 0 1", (-170, 170)),
        ("revolute", (0, 0, 0.2155), (H, 0, 0), "0 0 1", (-120, 120)),
        ("revolute", (0, 0.1845, 0), (-H, PI, 0), "0 0 1", (-170, 170)),
        ("revolute", (0, 0, 0.2155), (H, 0, 0), "0 0 1", (-120, 120)),
        ("revolute", (0, 0.081, 0), (-H, PI, 0), "0 0 1", (-175, 175)),
    ],
    "pr2": [
        ("prismatic", (-0.05, 0, 0.739675), (0, 0, 0), "0 0 1", (0.0115, 0.325)),
        ("revolute", (0, -0.188, 0), (0, 0, 0), "0 0 1", (-122.35, 32.35)),
        ("revolute", (0.1, 0, 0), (0, 0, 0), "0 1 0", (-20.26, 74.27)),
        ("revolute", (0, 0, 0), (0, 0, 0), "1 0 0", (-214.86, 37.24)),
        ("revolute", (0.4, 0, 0), (0, 0, 0), "0 1 0", (-121.54, -8.59)),
        ("continuous", (0, 0, 0), (0, 0, 0), "1 0 0", (0, 0)),
        ("revolute", (0.321, 0, 0), (0, 0, 0), "0 1 0", (-114.59, -5.73)),
        ("continuous", (0, 0, 0), (0, 0, 0), "1 0 0", (0, 0)),
    ],
}


def arm(name, folder):
    """An arm without shapes: what touches what is not asked here."""
    if name not in ARMS:
        return replace(load(name), geometry=pinocchio.GeometryModel())
    text = '<link name="l0"/>'
    for i, (kind, place, turn, axis, limits) in enumerate(ARMS[name], 1):
        lower, upper = limits if kind == "prismatic" else np.radians(limits)
        text += (
            f'<link name="l{i}"/><joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<origin xyz="{" ".join(map(str, place))}" rpy="{" ".join(map(str, turn))}"/><axis xyz="{axis}"/>'
            f'<limit lower="{lower}" upper="{upper}" velocity="2" effort="0" acceleration="10"/></joint>'
        )
    path = folder / f"{name}.urdf"
    path.write_text(f'<robot name="{name}">{text}</robot>')
    return load(path)


def recorded(robot, seed, n=100, share=0.97):
    """Poses of the tip (n, 7) along joints that move at random, smoothly and slowly within their limits."""
    rng = np.random.default_rng(seed)
    lower, upper = np.clip((-PI, PI), robot.lower[:, None], robot.upper[:, None]).T
    points = rng.uniform(-1, 1, robot.n_joints) + np.cumsum(rng.normal(scale=0.25, size=(7, robot.n_joints)), axis=0)
    points = share * (2 / PI * np.arcsin(np.sin(PI / 2 * points)))  # turned back at the limits
    joints = (lower + upper) / 2 + (upper - lower) / 2 * BSpline(np.arange(11) - 3.0, points, 3)(np.linspace(0, 4, n))
    seconds = 3 * (np.abs(np.diff(joints, axis=0)).max(axis=0) * n / robot.velocity).max()
    positions, rotations, _ = kinematics(robot, joints)
    turned = Rotation.from_matrix(rotations).as_quat(scalar_first=True)
    return kineme.Trajectory(np.linspace(0, seconds, n), np.hstack((positions, turned)))


def tracked(made):
    return next(check.worst for check in made.preflight.checks if check.what == "tracking")


SEEDS = {"panda": 1, "ur5e": 2, "wam": 1, "so101": 2, "iiwa": 0, "pr2": 0}


@pytest.mark.parametrize(("name", "follow"), combined(SEEDS, ORIENTATIONS, together=1))
def test_the_path_that_an_arm_recorded_is_followed_whatever_is_left_free(tmp_path, name, follow):
    robot = arm(name, tmp_path)
    made = move(recorded(robot, SEEDS[name]), robot, follow=follow, timing="slowed")
    assert tracked(made) < 0.02  # mm
    assert np.all((made.trajectory.positions >= robot.lower) & (made.trajectory.positions <= robot.upper))


@pytest.mark.soak
def test_joints_that_a_pose_leaves_free_keep_off_their_stops_and_do_not_slow_the_movement_down(tmp_path):
    robot = arm("pr2", tmp_path)
    made = move(recorded(robot, 13), robot, timing="slowed")
    assert tracked(made) < 0.02  # mm
    assert made.factor < 1.1


HURRIED = {  # a posture of the UR5e, and how far its joints go: the quickest way lets them hurry past a singular one
    "free": ((-1.3, 1.2, 0.7, 1.1, -1.2, 1.1), (-0.5, -0.6, 0.5, 0.5, 0.6, 0.0)),
    "full": ((1.9, -1.0, -0.9, -1.6, -0.9, 1.0), (0.3, -0.6, -0.2, -0.1, 0.2, -0.1)),
}


@pytest.mark.parametrize("follow", HURRIED)
def test_what_joints_showed_is_executed_as_fast_though_another_way_would_be_slower(follow):
    robot = arm("ur5e", None)
    posture, change = map(np.array, HURRIED[follow])
    u = np.linspace(0, 1, 60)[:, None]
    positions, rotations, _ = kinematics(robot, posture + change * u**2 * (3 - 2 * u))
    turned = Rotation.from_matrix(rotations).as_quat(scalar_first=True)
    movement = kineme.Trajectory(1.5 * u[:, 0], np.hstack((positions, turned)))
    assert move(movement, robot, follow=follow, timing="slowed", rate=50.0).factor < 1.1


@pytest.mark.soak
@settings(max_examples=examples(1, 2))
@example(name="so101", seed=676, share=0.34)
@given(name=st.sampled_from(list(SEEDS)), seed=st.integers(0, 999), share=st.floats(0.3, 0.97))
def test_what_is_followed_in_full_is_followed_by_its_axis_and_by_its_position_alone(
    tmp_path_factory, name, seed, share
):
    robot = arm(name, tmp_path_factory.getbasetemp())
    movement = recorded(robot, seed, share=share)
    followed = [follows(movement, robot, follow) for follow in ORIENTATIONS]
    assert followed == sorted(followed)


def follows(movement, robot, follow):
    try:
        return tracked(move(movement, robot, follow=follow, timing="slowed", rate=25.0)) <= 1.0  # mm
    except TrajectoryError:
        return False


def test_the_shortest_turn_of_the_axis_does_not_depend_on_the_turn_about_it():
    """An orientation that is turned about its z axis in every sample is the same movement of the axis."""
    robot = load("panda")
    movement = recorded(replace(robot, geometry=pinocchio.GeometryModel()), 2, share=0.3)
    spun = Rotation.from_quat(movement.positions[:, 3:], scalar_first=True) * Rotation.from_euler("z", 3.0)
    other = np.hstack((movement.positions[:, :3], spun.as_quat(scalar_first=True)))
    made = [move(one, robot, follow="axis", timing="slowed", force=True) for one in (movement.positions, other)]
    np.testing.assert_allclose(*(one.trajectory.positions[-1] for one in made), atol=1e-3)


def test_an_arm_of_one_joint_follows_its_arc(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="r"><link name="a"/><link name="b"/><link name="tool0"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-2" upper="2"/></joint>'
        '<joint name="f" type="fixed"><origin xyz="0.4 0 0"/><parent link="b"/><child link="tool0"/></joint></robot>'
    )
    u = np.linspace(0, 1, 80)
    angles = 0.2 + (10 * u**3 - 15 * u**4 + 6 * u**5)
    arc = 0.4 * np.column_stack((np.cos(angles), np.sin(angles), 0 * u))
    made = move(kineme.Trajectory(3 * u, arc), load(path), timing="slowed")
    np.testing.assert_allclose(made.trajectory.positions[-1], angles[-1], atol=1e-3)


@pytest.mark.parametrize("name", MODELS)
def test_joints_far_outside_their_limits_are_refused_before_anything_is_solved(name, monkeypatch):
    from kineme.robots.planning import move as planning

    robot = load(name)
    monkeypatch.setattr(planning.robot_movement, "with_timing", lambda *_: pytest.fail("it is solved"))
    joints = np.tile(robot.rest, (40, 1))
    joints[:, 1] = np.linspace(robot.upper[1] + 1, robot.rest[1], 40)
    with pytest.raises(kineme.robots.InfeasibleError, match=rf"position of {robot.joints[1]} at 0\.00 s: .*, limit"):
        move(kineme.Trajectory(np.linspace(0, 2, 40), joints), robot, space="joints")

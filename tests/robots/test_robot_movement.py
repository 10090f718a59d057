"""Movements of the tip and of the joints, executable and checked."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kineme
from arm_samples import stroke
from kineme.dmp.generation.generate import learn_one
from kineme.errors import SpecificationError, TrajectoryError
from kineme.orientation import PoseDMP
from kineme.robots import InfeasibleError, load, move
from kineme.robots.execution.preflight import along
from kineme.robots.kinematics.descent import InverseKinematics
from kineme.robots.models.robot import MODELS
from kineme.robots.planning.generate_at import generate_at
from kineme.robots.planning.move import request_of

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


@pytest.mark.soak("combinations")
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
    assert off < (0.1 if timing == "fastest" else 0.05)  # mm; the fastest rounds what its accelerations step at


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


def test_a_pose_out_of_reach_in_the_middle_is_said_with_time_place_and_distance():
    robot = load("panda")
    there = stroke(robot)
    lifted = there.positions + np.column_stack((np.zeros((150, 2)), 1.2 * np.sin(np.pi * np.linspace(0, 1, 150))))
    high = kineme.Trajectory(times=there.times, positions=lifted)
    with pytest.raises(
        TrajectoryError, match=r"reach \(0\.\d+, .*, 1\.\d+\) m at 1\.\d+ s: its tip stays 0\.\d+ m away"
    ):
        move(high, robot)
    assert not move(high, robot, force=True).preflight.passed


def test_a_primitive_of_poses_moves_the_tip_as_it_was_shown():
    robot = load("panda")
    ik = InverseKinematics(robot)
    u = np.linspace(0, 1, 120)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    turned = Rotation.from_matrix(ik.tip_rotation) * Rotation.from_euler("z", 0.6 * s)
    shown = np.hstack((ik.tip_position + s * [0.05, 0.25, -0.1], turned.as_quat(scalar_first=True)))
    primitive = PoseDMP().learn([shown])
    made = move(primitive.rollout(duration=3.0)[0], robot)
    end = along(robot, made.trajectory)
    np.testing.assert_allclose(end.tip_positions[-1], shown[-1, :3], atol=1e-4)
    assert Rotation.from_matrix(end.tip_rotations[-1].T @ turned[-1].as_matrix()).magnitude() < 1e-3
    again = move(primitive, robot, timing="slowed")
    np.testing.assert_allclose(again.trajectory.positions[-1], made.trajectory.positions[-1], atol=1e-6)


def test_several_movements_are_refused():
    robot = load("panda")
    with pytest.raises(TrajectoryError, match="expected one recording, got 2 movements"):
        move(kineme.DMP().learn([stroke(robot), stroke(robot)]).rollout(), robot)


def recorded(heads, columns, folder):
    """A recording in a file, whose heads say what its columns are."""
    path = folder / "movement.csv"
    np.savetxt(path, columns, delimiter=",", header=",".join(heads), comments="")
    return kineme.read_recordings(path)[0]


def test_angles_in_degrees_as_many_as_the_joints_move_the_joints(tmp_path):
    robot = load("ur5e")
    u = np.linspace(0, 1, 60)[:, None]
    joints = robot.rest + 0.3 * np.sin(np.pi * u) ** 2 * np.array([1, -1, 1, 0.5, 0.3, -1])
    columns = np.hstack((3 * u, np.degrees(joints), u > 0.4))
    movement = recorded(["time [s]", *(f"joint{k} [deg]" for k in range(6)), "gripper"], columns, tmp_path)
    with pytest.warns(UserWarning, match="joint5 .* are taken as shoulder_pan_joint"):
        made = move(movement, robot)
    assert made.path is None
    np.testing.assert_allclose(made.trajectory.positions[-1], joints[-1], atol=1e-6)
    changes = np.flatnonzero(np.diff(made.trajectory.steps["gripper"]))
    assert len(changes) == 1
    assert made.trajectory.times[changes[0] + 1] - made.begins == pytest.approx(1.2, abs=0.06)


@pytest.mark.parametrize("unit", ["degrees", "Degree", "DEG", "°", "degs"])
def test_every_spelling_of_degrees_moves_the_joints_alike(tmp_path, unit):
    robot = load("panda")
    joints = robot.rest + np.linspace(0, 0.3, 20)[:, None]
    columns = np.column_stack((np.linspace(0, 3, 20), np.degrees(joints)))
    asked = request_of(
        recorded(["time [s]", *(f"{name} [{unit}]" for name in robot.joints)], columns, tmp_path), robot, "auto"
    )
    np.testing.assert_allclose(asked.positions, joints, atol=1e-12)


def test_joints_are_known_by_their_names_in_any_order_and_others_go_along(tmp_path):
    robot = load("ur5e")
    u = np.linspace(0, 1, 60)
    joints = robot.rest + 0.3 * (10 * u**3 - 15 * u**4 + 6 * u**5)[:, None] * np.array([1, -1, 1, 0.5, 0.3, -1])
    heads = ["time [s]", "width", *(f"/joint_states.{name} [deg]" for name in robot.joints[::-1])]
    one = recorded(heads, np.column_stack((4 * u, 100 * u, np.degrees(joints)[:, ::-1])), tmp_path)
    made = move(one, robot, timing="fastest")
    np.testing.assert_allclose(made.trajectory.positions[-1], joints[-1], atol=1e-6)
    width = made.trajectory.steps["width"]
    assert (width[0], width[-1]) == (0, pytest.approx(100, abs=1))
    assert np.diff(width).min() >= 0


def test_units_of_joints_are_those_of_the_heads_or_as_is_said(tmp_path):
    robot = load("ur5e")
    u = np.linspace(0, 1, 60)[:, None]
    joints = robot.rest + 0.1 * (10 * u**3 - 15 * u**4 + 6 * u**5)
    share = (joints - robot.lower) / (robot.upper - robot.lower)
    for unit, values, said in (
        ("", np.degrees(joints), "deg"),
        ("", joints, "rad"),
        ("", 200 * share - 100, "percent"),
        (" [-100..100]", 200 * share - 100, "percent"),
        (" [%]", 100 * share, "percent"),
        (" [deg]", np.degrees(joints), "deg"),
    ):
        one = recorded(["time [s]", *(name + unit for name in robot.joints)], np.hstack((3 * u, values)), tmp_path)
        asked = request_of(one, robot, "auto", joint_units=said)
        np.testing.assert_allclose(asked.positions, joints, atol=1e-9)
        if unit == " [deg]":
            with pytest.raises(TrajectoryError, match="whose columns say no other unit, got 'shoulder_pan_joint"):
                request_of(one, robot, "auto", joint_units="rad")
        if unit == " [%]":
            with pytest.raises(TrajectoryError, match=r"in a unit of angle .* say joint_units='percent'"):
                request_of(one, robot, "auto")
    with pytest.raises(TrajectoryError, match="if these are degrees, say joint_units='deg'"):
        request_of(kineme.Trajectory(3 * u[:, 0], np.degrees(joints)), robot, "joints")
    with pytest.raises(SpecificationError, match="joint_units"):
        move(kineme.Trajectory(3 * u[:, 0], joints), robot, joint_units="grad")


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("Grad", r"expected 'panda_joint1 \[Grad\]' in a unit of angle \(rad, deg\), got 'Grad'; convert the column"),
        ("mm", r"in a unit of angle .*, got 'mm'"),
        ("%", r"in a unit of angle .*, got '%'"),
        ("deg/s", r"in a unit of angle .*, got 'deg/s'"),
    ],
)
def test_joints_in_what_is_no_angle_do_not_move(tmp_path, unit, message):
    robot = load("panda")
    columns = np.column_stack((np.linspace(0, 3, 20), robot.rest + np.linspace(0, 0.3, 20)[:, None]))
    one = recorded(["time [s]", *(f"{name} [{unit}]" for name in robot.joints)], columns, tmp_path)
    with pytest.raises(TrajectoryError, match=message):
        move(one, robot, space="joints")


def test_joints_without_a_unit_are_said_to_be_taken_as_radians(tmp_path):
    robot, u = load("panda"), np.linspace(0, 1, 20)[:, None]
    columns = np.hstack((3 * u, robot.rest + 0.1 * u))
    own, others = robot.joints, [f"q{k}" for k in range(1, 8)]
    for names, unit in ((others, ""), (others, " [rad]"), (own, "")):  # ROS and the URDF have radians by these names
        one = recorded(["time [s]", *(name + unit for name in names)], columns, tmp_path)
        learned, generated = learn_one(one, kineme.DMP()), partial(generate_at, joints=robot)
        generated(learned, joint_units="rad")
        with nullcontext() if unit or names is own else pytest.warns(UserWarning, match="q7 are taken as radians"):
            generated(learned)


def test_a_primitive_that_repeats_is_moved_as_its_rollout():
    t = np.linspace(0, 6, 300)
    path = np.column_stack((0.45 + 0 * t, 0.08 * np.cos(np.pi * t), 0.4 + 0.05 * np.sin(np.pi * t)))
    primitive = kineme.RhythmicDMP().learn([kineme.Trajectory(times=t, positions=path)])
    requests = [request_of(movement, load("panda"), "tip") for movement in (primitive, primitive.rollout())]
    np.testing.assert_array_equal(requests[0].positions, requests[1].positions)


@pytest.mark.parametrize(
    ("head", "asked", "goal"),
    [
        ("{} [deg]", {}, [10, -70, 60, -80, -85, 90]),
        ("{}", {"joint_units": "deg"}, [10, -70, 60, -80, -85, 90]),
        ("{} [rad]", {}, [0.2, -1.2, 1.0, -1.4, -1.5, 1.6]),
    ],
)
def test_start_and_goal_of_joints_are_in_the_units_and_the_order_of_the_columns(tmp_path, head, asked, goal):
    """A goal in degrees was taken as radians, and one in the order of a sorted file as in that of the arm."""
    robot, size = load("ur5e"), 1.0 if "rad" in head else np.degrees(1)
    order = sorted(range(6), key=robot.joints.__getitem__)  # as /joint_states has it
    u = np.linspace(0, 1, 40)
    rows = np.column_stack((3 * u, size * (robot.rest + 0.3 * (u**2 * (3 - 2 * u))[:, None])[:, order]))
    heads = ["time", *(head.format(robot.joints[k]) for k in order)]
    learned = learn_one(recorded(heads, rows, tmp_path), kineme.DMP())
    made = generate_at(learned, rows[0, 1:], np.array(goal)[order], joints=robot, **asked)
    np.testing.assert_allclose(made.movement.positions[-1], np.array(goal) / size, atol=1e-6)
    np.testing.assert_allclose(made.movement.positions[0], robot.rest, atol=1e-6)
    unit = "rad" if "rad" in head else "deg"
    assert made.said[1].startswith(
        f"goal is elbow_joint [{unit}] {goal[2]:g}, shoulder_lift_joint [{unit}] {goal[1]:g}"
    )
    with pytest.raises(TrajectoryError, match=rf"goal is in the units of the columns, elbow_joint \[{unit}\].*convert"):
        generate_at(learned, None, [9999.0] * 6, joints=robot, **asked)


def test_a_tip_in_what_is_no_length_moves_by_the_scale_alone(tmp_path):
    u = np.linspace(0, 1, 60)[:, None]
    one = recorded(["time", "x [px]", "y [px]", "z [px]"], np.hstack((3 * u, 100 * u, 50 * u**2, 20 * u**3)), tmp_path)
    learned = learn_one(one, kineme.DMP())
    with pytest.raises(TrajectoryError, match=r"expected 'x \[px\]' in a unit of length .*, got 'px'"):
        generate_at(learned)
    assert np.ptp(generate_at(learned, scale=0.001).movement.positions[:, 0]) == pytest.approx(0.1, rel=0.05)


def test_a_goal_beside_the_plane_of_a_movement_is_refused_and_lies_in_its_plane_without_a_start(tmp_path):
    u = np.linspace(0, 1, 60)[:, None]
    learned = learn_one(recorded(["time", "x [m]", "y [m]"], np.hstack((3 * u, 0.1 * u, u**2)), tmp_path), kineme.DMP())
    with pytest.raises(SpecificationError, match=r"in the plane of its start, y = 0 m, got 0\.02; give both the same"):
        generate_at(learned, [0.4, 0.0, 0.3], [0.5, 0.02, 0.4], plane="xz")
    goal = [0.5, 0.1, 0.4]
    for start in ([0.4, 0.1, 0.3], None):
        made = generate_at(learned, start, goal, plane="xz").movement.positions
        np.testing.assert_allclose(made[-1], goal, atol=1e-3)


def test_positions_in_millimeters_are_meters_for_the_arm(tmp_path):
    robot = load("panda")
    there = stroke(robot)
    columns = np.column_stack((there.times, 1e3 * there.positions))
    made = move(recorded(["time", "x [mm]", "y [mm]", "z [mm]"], columns, tmp_path), robot)
    np.testing.assert_allclose(made.path.positions[-1], there.positions[-1], atol=1e-6)


def test_two_dimensional_movements_lie_in_their_plane():
    robot = load("wam")
    there = stroke(robot)
    made = move(kineme.Trajectory(times=there.times, positions=there.positions[:, 1:]), robot, plane="yz")
    np.testing.assert_allclose(made.path.positions[:, 0], InverseKinematics(robot).tip_position[0], atol=1e-12)
    np.testing.assert_allclose(made.path.positions[-1, 1:], there.positions[-1, 1:], atol=1e-9)


@pytest.mark.parametrize(("name", "lowest"), [("panda", 0.0), ("ur5e", 0.0), ("wam", 0.0), ("so101", -0.03)])
def test_a_free_place_is_not_below_the_plane_on_which_the_arm_stands(name, lowest):
    u = np.linspace(0, 1, 120)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    wave = kineme.Trajectory(4 * u, np.column_stack((0 * s, 0.3 * s, 0.06 * np.sin(2 * np.pi * s))))
    made = move(wave, load(name), place="free", timing="slowed")
    assert made.path.positions[:, 2].min() >= lowest - 1e-9
    assert made.factor < 1.5  # and not where a joint comes to a stop


@pytest.mark.soak
def test_joints_that_come_to_a_stop_stay_within_their_limits_between_samples():
    robot = load("so101")
    u = np.linspace(0, 1, 120)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    turned = Rotation.from_euler("xyz", np.column_stack((np.pi + 0 * s, 0.3 * s, 0.5 * s))).as_quat(scalar_first=True)
    positions = np.column_stack((0.2 + 0 * s, 0.3 * s - 0.15, 0.04 + 0.03 * np.sin(2 * np.pi * s)))
    made = move(np.column_stack((positions, turned)), robot, timing="slowed")  # more of a turn than five joints have
    assert made.preflight.passed


def test_what_goes_below_the_base_is_said_with_how_far():
    robot = load("panda")
    u = np.linspace(0, 1, 60)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5

    def lowest(*end):
        made = move(kineme.Trajectory(6 * u[:, 0], robot.rest + s * (end - robot.rest)), robot, space="joints")
        return [check for check in made.preflight.checks if check.what == "lowest point"], made

    assert not lowest(*robot.rest + 0.1)[0]
    (check,), made = lowest(0, 1.7, 0, -0.8, 0, 2.0, 0.785)
    assert check.passed
    assert check.where == "tip"
    assert check.worst == pytest.approx(along(robot, made.trajectory).tip_positions[:, 2].min(), abs=1e-3)

"""Columns that are the joints of an arm by their names: of two arms, of topics, with words of other programs."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from kineme import Trajectory, read_recordings
from kineme.errors import TrajectoryError
from kineme.io.writing.write_movement import write_movement
from kineme.movements.channels.channel import Channel
from kineme.robots import load, move
from kineme.robots.planning.move import request_of
from kineme.robots.planning.roles import axis_order, check_order, joints_among, plane_of, roles_of, space_of

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


def _names(side, end=".pos"):
    return [f"{side}_{name}{end}" for name in (*load("so101").joints, "gripper")]


@pytest.mark.parametrize("before", ["", "observation.state."])
@pytest.mark.parametrize("end", [".pos", "", " [deg]"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_columns_of_one_side_are_the_joints(side, end, before):
    names = [before + name for name in _names(side, end)]
    assert joints_among(names[::-1], load("so101")) == [5, 4, 3, 2, 1]
    channels = tuple(Channel(name, "position", (name,)) for name in names)
    assert space_of(channels, np.zeros((9, 6)), load("so101")) == "joints"


def test_of_both_sides_one_is_to_be_chosen():
    with pytest.raises(TrajectoryError, match=r"those of two, left and right; .*--columns 'left_\*'"):
        joints_among(_names("left") + _names("right"), load("so101"))


def test_of_commands_beside_states_one_is_to_be_chosen():
    """Of an arm of one joint they would be two coordinates of the tip."""
    joints = load("so101").joints
    names = [f"{before}.{joint} [deg]" for before in ("action", "observation.state") for joint in joints]
    with pytest.raises(TrajectoryError, match=r"one column for each joint, got action\..*--columns 'action\.\*'"):
        joints_among(names, load("so101"))
    assert joints_among(names[len(joints) :], load("so101")) == [*range(len(joints))]
    assert joints_among([*names, "x", "y", "z"], load("so101")) is None


def test_joints_without_a_side_come_first_and_a_part_is_no_arm():
    names = [*load("so101").joints]
    assert joints_among([*_names("left"), *names], load("so101")) == [6, 7, 8, 9, 10]
    assert joints_among(_names("left")[1:], load("so101")) is None


UR5E = ("elbow", "shoulder_lift", "shoulder_pan", "wrist_1", "wrist_2", "wrist_3")  # as ROS's joint_states sorts them


@pytest.mark.parametrize(
    "head",
    [
        "ur5e_{}_joint [rad]", "{}_joint_position", "/joint_states/{}_joint/position", "position_{}_joint [deg]", "{}",
        "{}_deg", "actual {} joint", "{}_joint.pos",
    ],
)  # fmt: skip
def test_words_of_programs_beside_the_names_move_no_other_joint(head):
    names = [head.format(name) for name in UR5E]
    assert joints_among(names, load("ur5e")) == [2, 1, 0, 3, 4, 5]
    assert joints_among([*names, "gripper"], load("ur5e")) == (None if "joint" not in head else [2, 1, 0, 3, 4, 5])
    assert joints_among([name.upper() for name in names[1:]] + names[:1], load("ur5e")) == [1, 0, 5, 2, 3, 4]


def test_numbers_are_those_of_the_joints():
    assert joints_among([f"q{k}" for k in (7, 1, 2, 3, 4, 5, 6)], load("panda")) == [1, 2, 3, 4, 5, 6, 0]
    assert joints_among([f"q{k}" for k in range(7)], load("panda")) is None


@pytest.mark.parametrize("head", ["velocity.{}", "{}_vel", "effort/{}"])
def test_velocities_and_efforts_are_no_joints(head):
    robot = load("ur5e")
    rates = [head.format(joint) for joint in robot.joints]
    assert joints_among(rates, robot) is None
    assert joints_among([*rates, *robot.joints], robot) == [6, 7, 8, 9, 10, 11]
    with pytest.raises(TrajectoryError, match=r"expected positions of the joints, got .*shoulder_pan_joint"):
        check_order(rates, robot)


def _moved(folder, names, columns):
    times = np.linspace(0, 3, len(columns))
    heads = ",".join(["time", *names])
    np.savetxt(folder / "arm.csv", np.column_stack((times, columns)), delimiter=",", header=heads, comments="")
    return move(read_recordings(folder / "arm.csv"), load("ur5e")).trajectory.positions[-1]


def test_names_of_other_joints_are_refused_and_no_names_are_said(tmp_path):
    joints = load("ur5e").rest + 0.05 * (1 - np.cos(np.linspace(0, np.pi, 50)))[:, None]
    for names in ((*UR5E[1:], "forearm"), [f"q{k}" for k in range(6)][::-1], [f"arm 1 joint {k}" for k in "143256"]):
        with pytest.raises(TrajectoryError, match=r"in any order, or without names in this|order of their numbers"):
            _moved(tmp_path, [f"{name} [rad]" for name in names], joints)
    with pytest.warns(UserWarning, match="q0, q1, q2, q3, q4, q5 are taken as shoulder_pan_joint, .* one after"):
        assert _moved(tmp_path, [f"q{k}" for k in range(6)], joints) == pytest.approx(joints[-1], abs=1e-6)


def test_axes_are_no_joints_in_their_order():
    robot = load("ur5e")
    for head in ("{}.{}", "{}_angle_{} [rad]"):
        names = [head.format(point, axis) for point in ("hand", "elbow") for axis in "xyz"]
        with pytest.raises(TrajectoryError, match=r"or without axes, got hand.*; choose the place of the tip"):
            roles_of(tuple(Channel(name, "angle", (name,)) for name in names), 6, "joints", robot)


def test_the_joints_of_the_other_arm_are_refused(tmp_path):
    """Without a word the right arm executed what the left one was shown."""
    limit = '<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="50"/><origin xyz="0 0 0.2"/>'
    parts = ["<link name='base'/>"]
    for side in ("left", "right"):
        for k, parent in enumerate(("base", f"{side}_l0", f"{side}_l1", f"{side}_l2")):
            ends = f'<parent link="{parent}"/><child link="{side}_l{k}"/>'
            parts += f'<link name="{side}_l{k}"/>', f'<joint name="{side}_j{k}" type="revolute">{ends}{limit}</joint>'
    (tmp_path / "two.urdf").write_text(f"<robot name='two'>{''.join(parts)}</robot>")
    robot = load(tmp_path / "two.urdf", tip="right_l3")
    names = {side: [f"{side}_j{k}" for k in range(4)] for side in ("left", "right")}
    for head in ("{}", "{} [rad]", "state.{}.pos"):
        columns = [head.format(name) for name in names["left"]]
        with pytest.raises(TrajectoryError, match=r"expected the joints right_j0, .* got left_j0, .*choose the tip"):
            joints_among(columns, robot)
        with pytest.raises(TrajectoryError, match=r"got left_j0, .* which two has besides"):
            check_order(columns[::-1], robot)
        assert joints_among(columns + [head.format(name) for name in names["right"]], robot) == [4, 5, 6, 7]
    assert joints_among([f"j{k}" for k in range(4)], robot) == [0, 1, 2, 3]


def test_words_of_the_other_side_are_refused():
    """Of `r_joint1` or `R1` the side was lost among the words that all columns share."""
    panda = load("panda")
    named = replace(panda, joints=tuple(f"left_joint{k}" for k in range(1, 8)), tip="left_tcp")

    def taken(head, robot):
        names = [head.format(k) for k in range(1, 8)]
        return roles_of(tuple(Channel(name, "angle", (name,)) for name in names), 7, "joints", robot).positions

    heads = ["r_joint{}", "R{}", "right_arm_joint_{}", "rightJoint{} [deg]", "RARM_JOINT{}", "joint_{}_right",
             "/right/joint_states.position_{}", "q_right_{}_l [rad]"]  # fmt: skip
    for robot in (named, replace(panda, tip="left_tcp")):
        for head in heads:
            with pytest.raises(TrajectoryError, match=r"expected a recording of the left arm, as .*choose the tip"):
                taken(head, robot)
        for head in ("l_joint{}", "L{}", "q{}"):
            assert taken(head, robot) == [*range(7)]
    assert taken("r_joint{}", panda) == [*range(7)]


def test_numbered_joints_of_another_arm_are_said():
    robot = load("panda")

    def found(head):
        names = [head.format(k) for k in range(1, 8)]
        return roles_of(tuple(Channel(name, "angle", (name,)) for name in names), 7, "joints", robot).positions

    for head in ("iiwa_joint_{}", "left_arm_joint{} [deg]"):
        with pytest.warns(UserWarning, match=r"joint_?1.* are taken as panda_joint1, .* one after the other"):
            assert found(head) == [*range(7)]
    for head in ("q{}", "joint{} [deg]", "panda_joint{}", "state.panda_joint{}_position"):  # and without a warning
        assert found(head) == [*range(7)]


def _written(folder, kind, times, columns):
    path, table = folder / f"{kind}.{kind if kind in {'npz', 'json'} else 'csv'}", np.column_stack((times, columns))
    match kind:
        case "npz":
            np.savez(path, times=times, positions=columns)
        case "json":
            path.write_text(json.dumps({"times": times.tolist(), "positions": columns.tolist()}))
        case "written":
            write_movement(path, Trajectory(times, columns))
        case heads:
            np.savetxt(path, table, delimiter=",", header="" if heads == "bare" else heads, comments="")
    return path


U = np.linspace(0, 1, 60)
POSES = np.column_stack((U, U**2, 1 - U, np.cos(U), 0.6 * np.sin(U), 0 * U, 0.8 * np.sin(U)))


@pytest.mark.parametrize("columns", [POSES, 1.5 * POSES], ids=["poses", "joints"])
@pytest.mark.parametrize("kind", ["npz", "json", "bare", "written", "t,x1,x2,x3,x4,x5,x6,x7"])
def test_columns_without_names_are_what_the_same_array_is(tmp_path, kind, columns):
    robot = load("wam")
    read = request_of(read_recordings(_written(tmp_path, kind, 3 * U, columns)), robot, "auto")
    array = request_of(Trajectory(3 * U, columns), robot, "auto")
    assert (read.space, array.space) == ("tip" if columns is POSES else "joints",) * 2
    np.testing.assert_allclose(read.positions, array.positions, atol=1e-12)
    assert (read.orientations is None) == (array.orientations is None)


def test_as_many_columns_without_names_as_the_arm_has_joints_are_these_and_a_person_names_them_so(tmp_path):
    arm = load("ur5e")
    turning = (6 * U[:, None] + np.pi) % (2 * np.pi) - np.pi
    for columns in (POSES[:, :6], np.hstack((turning, POSES[:, :5]))):
        path = _written(tmp_path, "npz", 3 * U, columns)
        with pytest.warns(UserWarning, match="x1, x2, x3, x4, x5, x6 are taken as shoulder_pan_joint"):
            assert request_of(read_recordings(path), arm, "auto").space == "joints"
    path = _written(tmp_path, "t,q1,q2,q3,q4,q5,q6,q7", 3 * U, POSES)
    assert request_of(read_recordings(path), load("wam"), "auto").space == "joints"


def test_angles_beside_the_position_of_the_tip_are_refused(tmp_path):
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    with pytest.raises(TrajectoryError, match="the angles roll, pitch, yaw; convert them to columns qw, qx, qy, qz"):
        _moved(tmp_path, names, 0.3 + np.linspace(0, 0.1, 50)[:, None] * np.ones(6))


@pytest.mark.parametrize("head", ["{} [mm]", "tip_{}", "{}_tip", "pose.position.{}"])
def test_the_axes_of_a_tip_are_those_of_its_names(head, tmp_path):
    """In whichever order a file has them, in space and in a plane."""
    robot = load("panda")
    size = 1e3 if "mm" in head else 1.0
    path = np.array([0.31, 0.0, 0.48]) + 0.1 * np.linspace(0, 1, 30)[:, None] * [1.0, 2.0, -1.0]
    for n in (2, 3):
        for order in permutations(range(3), n):
            names = [head.format("xyz"[k]) for k in order]
            rows = np.column_stack((np.linspace(0, 2, 30), size * path[:, order]))
            np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=",".join(("time", *names)), comments="")
            request = request_of(read_recordings(tmp_path / "a.csv"), robot, "auto")
            assert request.space == "tip"
            np.testing.assert_allclose(request.positions, path[:, sorted(order)], atol=1e-12)


def test_a_tip_of_other_names_keeps_their_order_unless_an_axis_is_out_of_place():
    assert axis_order(["z", "x", "y"]) == [1, 2, 0]
    assert axis_order(["x", "y", "height"]) == axis_order(["first", "second", "third"]) == [0, 1, 2]
    for names in (("height", "x", "y"), ("a_x", "b_x", "a_y"), ("width", "x")):
        channels = tuple(Channel(name, "position", (name,)) for name in names)
        with pytest.raises(TrajectoryError, match=r"expected the positions of the tip as x, y, z.*rename them"):
            roles_of(channels, len(names), "tip")


def test_two_columns_lie_in_the_plane_that_their_names_say():
    def plane(names, given=None):
        return plane_of([Channel(name, "position", (name,)) for name in names.split()], given)

    assert [plane("x z"), plane("tip_y tip_z"), plane("x y"), plane("across up"), plane("x y z")] == [
        "xz", "yz", "xy", "xy", "xy",
    ]  # fmt: skip
    assert [plane("x y", "xz"), plane("across up", "yz"), plane("across z", "yz")] == ["xz", "yz", "yz"]  # drawings
    for names, given in (("x z", "xy"), ("y z", "xz"), ("across z", None)):
        with pytest.raises(
            TrajectoryError, match=r"expected a plane with the axes that .* say, got 'x[yz]'; .*--plane"
        ):
            plane(names, given)

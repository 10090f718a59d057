"""What the columns of a recording are: said by the caller, by their heads, by their values."""

import numpy as np
import pytest

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import learned_names
from kineme.movements.channels.detect import find_channels, unit_of

T = 50
U = np.linspace(0, 1, T)


def values(head):
    if head.lower().endswith("w") or head == "d":
        return np.cos(U)
    if head.lower().rstrip("w").endswith(("qx", "n.x", "_x", "n x")) or head == "a":
        return np.sin(U)
    if "gripper" in head:
        return (U > 0.5).astype(float)
    return np.zeros(T) if head.lower()[-1] in "yzbc" and ("q" in head.lower() or "n" in head or head in "bc") else U


def found(*heads, columns=None, **given):
    block = np.column_stack([values(head) for head in heads]) if columns is None else columns
    return find_channels(heads, block, np.array([0, T]), given)


@pytest.mark.parametrize(
    ("heads", "order"),
    [
        (("qx", "qy", "qz", "qw"), "xyzw"),
        (("qw", "qx", "qy", "qz"), "wxyz"),
        (("pose.orientation.x", "pose.orientation.y", "pose.orientation.z", "pose.orientation.w"), "xyzw"),
        (("Rotation X", "Rotation Y", "Rotation Z", "Rotation W"), "xyzw"),
        (("quat_w", "quat_x", "quat_y", "quat_z"), "wxyz"),
    ],
)
def test_four_neighbors_of_one_name_are_a_quaternion_in_the_order_of_the_file(heads, order):
    x, one, last = found("x", *heads, "joint1")
    assert (x.kind, one.kind, one.order, one.columns) == ("position", "orientation", order, heads)
    assert last.kind == "angle"
    assert learned_names((one,)) == tuple(f"{one.name}.r{axis}" for axis in "xyz")


def test_names_without_the_norm_of_a_quaternion_are_positions_unless_they_say_so():
    heads, columns = ("x", "y", "z", "w"), np.column_stack([U, U, U, U])
    assert {one.kind for one in found(*heads, columns=columns)} == {"position"}
    assert [one.kind for one in found("qx", "qy", "qz", "qw", columns=columns)] == ["orientation"]
    unit = columns[:, :4] / np.linalg.norm(columns + 1, axis=1)[:, None]
    unit[:, 3] = np.sqrt(1 - (unit[:, :3] ** 2).sum(axis=1))
    assert [one.kind for one in found(*heads, columns=unit)] == ["orientation"]


def test_a_gripper_is_discrete_as_long_as_it_has_few_values():
    assert [one.kind for one in found("x", "gripper")] == ["position", "discrete"]
    assert [one.kind for one in found("x", "gripper", columns=np.column_stack([U, U]))] == ["position", "position"]


def test_a_recording_of_switches_alone_is_what_moves():
    assert [one.kind for one in found("gripper")] == ["position"]
    assert [one.kind for one in found("gripper", gripper="discrete")] == ["discrete"]


@pytest.mark.parametrize("head", ["panda_joint1", "elbow [deg]", "wrist_yaw", "hip flexion (rad)", "theta"])
def test_heads_of_joints_are_angles(head):
    assert found("x", head)[1].kind == "angle"


def test_a_column_that_wraps_is_an_angle_whatever_its_name():
    wrapped = np.mod(3 + 2 * U + np.pi, 2 * np.pi) - np.pi
    assert [one.kind for one in found("a1", "a2", columns=np.column_stack([wrapped, U]))] == ["angle", "position"]


def test_what_the_caller_says_goes_before_heads_and_values():
    kinds = {"a,b,c,d": "wxyz", "joint1": "position", "x": "angle"}
    channels = find_channels(["a", "b", "c", "d", "joint1", "x"], np.column_stack([U] * 6), np.array([0, T]), kinds)
    assert [(one.kind, one.order) for one in channels] == [("orientation", "wxyz"), ("position", ""), ("angle", "")]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"y": "angle"}, "expected the kind of a column that is read, got 'y'"),
        ({"x": "wrench"}, "to be one of position, angle, discrete"),
        ({"x": "wxyz"}, "for four columns of a quaternion"),
        ({"x": "orientation"}, "wxyz or xyzw"),
    ],
)
def test_a_kind_that_cannot_be_is_refused(given, words):
    with pytest.raises(SpecificationError, match=words):
        found("x", **given)


@pytest.mark.parametrize(("head", "unit"), [("x [mm]", "mm"), ("elbow (deg)", "deg"), ("yaw_rad", "rad"), ("x", None)])
def test_units_in_heads(head, unit):
    assert unit_of(head) == unit

"""What the columns of a recording are: said by the caller, by their heads, by their values."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import learned_names, recorded_names
from kineme.movements.channels.coordinates import canonical, in_order
from kineme.movements.channels.detect import find_channels, point_names, unit_of, units_filled

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
        (("qi", "qj", "qk", "qr"), "xyzw"),
        (("rot_r", "rot_i", "rot_j", "rot_k"), "wxyz"),
    ],
)
def test_four_neighbors_of_one_name_are_a_quaternion_in_the_order_of_the_file(heads, order):
    x, one, last = found("x", *heads, "joint1")
    assert (x.kind, one.kind, one.order, one.columns) == ("position", "orientation", order, heads)
    assert last.kind == "angle"
    assert learned_names((one,)) == tuple(f"{one.name}.r{axis}" for axis in "xyz")


def test_names_without_the_norm_of_a_quaternion_are_positions_unless_they_say_so():
    several, columns = (("x", "y", "z", "w"), ("i", "j", "k", "w"), ("I", "J", "K", "R")), np.column_stack([U, U, U, U])
    for heads in several:
        assert {one.kind for one in found(*heads, columns=columns)} == {"position"}
    assert [one.kind for one in found("qx", "qy", "qz", "qw", columns=columns)] == ["orientation"]
    unit = columns[:, :4] / np.linalg.norm(columns + 1, axis=1)[:, None]
    unit[:, 3] = np.sqrt(1 - (unit[:, :3] ** 2).sum(axis=1))
    for heads in several:
        assert [(one.name, one.kind) for one in found(*heads, columns=unit)] == [("orientation", "orientation")]


def test_a_gripper_is_discrete_as_long_as_it_has_few_values():
    assert [one.kind for one in found("x", "gripper")] == ["position", "discrete"]
    assert [one.kind for one in found("x", "gripper", columns=np.column_stack([U, U]))] == ["position", "position"]


def test_a_recording_of_switches_alone_is_what_moves():
    assert [one.kind for one in found("gripper")] == ["position"]
    assert [one.kind for one in found("gripper", gripper="discrete")] == ["discrete"]
    both = found("gripper 1", "gripper 2", **{"gripper 1,gripper 2": "discrete"})
    assert [one.kind for one in both] == ["discrete", "discrete"]


def test_kinds_are_said_by_heads():
    with pytest.raises(SpecificationError, match=r"kinds by heads of columns, such as .*, got \['x'\]"):
        find_channels(["x"], U[:, None], np.array([0, T]), ["x"])


@pytest.mark.parametrize("head", ["panda_joint1", "elbow [deg]", "wrist_yaw", "hip flexion (rad)", "theta"])
def test_heads_of_joints_are_angles(head):
    assert found("x", head)[1].kind == "angle"


@pytest.mark.parametrize("head", ["joints.hand.{}", "wrist_joint_{}", "JointType_HandRight.{}", "joint_positions.0.{}"])
def test_the_place_of_the_joint_of_a_body_is_no_angle(head):
    channels = found(*(head.format(axis) for axis in "xyz"), *(f"knee_{head.format(axis)}" for axis in "xyz"))
    assert {one.kind for one in channels} == {"position"}
    assert len(point_names(channels)) == 2
    assert found("x", head.format("x [deg]"))[1].kind == "angle"


@pytest.mark.parametrize("form", ["j{}", "J{}", "q_{}", "q[{}]", "actual_q_{}", "left j{}", "joints.{}"])
@pytest.mark.parametrize("first", [0, 1])
def test_columns_that_are_numbered_as_joints_are_angles(form, first):
    heads = [form.format(first + k) for k in range(6)]
    assert [one.kind for one in found("x", *heads, "gripper")] == ["position", *["angle"] * 6, "discrete"]


@pytest.mark.parametrize(
    "heads", [["q1"], ["j2", "j3"], ["q1", "q3"], ["qd1", "qd2"], ["j1 [mm]", "j2 [mm]"], ["j1_torque", "j2_torque"]]
)
def test_numbers_that_do_not_say_that_columns_are_joints(heads):
    assert {one.kind for one in found("x", *heads)} == {"position"}


def test_numbered_columns_beyond_a_turn_are_no_joints():
    ticks = np.column_stack([U, 2048 * U])
    assert {one.kind for one in found("q1", "q2", columns=ticks)} == {"position"}
    assert {one.kind for one in found("q1", "q2", columns=180 * U[:, None] * [0, 1])} == {"angle"}
    assert [one.kind for one in found("q1", "q2", q1="position")] == ["position", "angle"]


def test_a_column_that_wraps_is_an_angle_whatever_its_name():
    wrapped = np.mod(3 + 2 * U + np.pi, 2 * np.pi) - np.pi
    assert [one.kind for one in found("a1", "a2", columns=np.column_stack([wrapped, U]))] == ["angle", "position"]


@pytest.mark.parametrize(
    ("unit", "units"),
    [
        ("mm", ("mm", "cm", "", "", "", "", "", "", "", "")),
        ("deg", ("", "cm", "deg", "deg", "", "", "", "", "deg", "deg")),
        ("%", ("%", "cm", *["%"] * 8)),
    ],
)
def test_a_unit_is_given_to_columns_of_a_kind_that_has_it(unit, units):
    heads = ("x", "y [cm]", "yaw", "psi", "qw", "qx", "qy", "qz", "joint1", "joint2")
    columns = np.column_stack([values(head) for head in heads])
    columns[:, 3] = (6 * U + 1) % 6.283185307179586
    offsets = np.array([0, T])
    assert units_filled(unit, heads, columns, offsets, {}, ()) == units
    assert units_filled(unit, ("x", "gripper"), columns[:, :2], offsets, {}, ())[1] == ("%" if unit == "%" else "")
    assert units_filled(unit, ("a", "b"), columns[:, :2], offsets, {}, ()) == (unit, unit)


POINTING_DOWN = Rotation.from_euler(
    "xyz", np.column_stack([np.pi - 0.2 + 0.4 * U, 0.3 * np.sin(U), 0.3 * U])
).as_rotvec()


@pytest.mark.parametrize(
    ("form", "scale", "kind"),
    [
        ("axis_angle.{}", 1, "position"), ("rotVec_{}", 1, "position"), ("rotation_vector {} [deg]", 180, "position"),
        ("r{}", 1, "position"), ("r{} [rad]", 1, "position"), ("r{} [deg]", 180, "position"),
        ("r{} [rad]", [1, 1, 12], "angle"), ("r{} [rad]", [1, 0, 0], "angle"), ("rotvec_rate_{}", 1, "position"),
    ],
)  # fmt: skip
def test_a_rotation_vector_is_not_three_angles_but_where_it_may_be(form, scale, kind):
    heads = ["x", "y", "z", *(form.format(axis) for axis in "xyz")]
    scale = np.rad2deg(1) if scale == 180 else np.array(scale)
    columns = np.column_stack([np.column_stack([U] * 3), POINTING_DOWN * scale])
    channels = find_channels(heads, columns, np.array([0, T]), {})
    assert [channel.kind for channel in channels][3] == kind
    if kind == "position":
        np.testing.assert_array_equal(canonical(columns, np.array([0, T]), channels), columns)


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


@pytest.mark.parametrize(
    ("head", "unit"), [("x [mm]", "mm"), ("elbow (deg)", "deg"), ("yaw_rad", "rad"), ("x_mm", "mm"), ("x", None)]
)
def test_units_in_heads(head, unit):
    assert unit_of(head) == unit


@pytest.mark.parametrize(
    ("head", "unit"),
    [("yaw [rad/s]", "rad/s"), ("gyro_deg_s", None), ("joint[0]", None), ("rail_joint [mm]", "mm")],
)
def test_what_is_no_unit_of_an_angle(head, unit):
    assert unit_of(head) == unit


@pytest.mark.parametrize(
    "head",
    [
        "linear_joint [mm]",
        "gyro_x [deg/s]",
        "yaw_rate",
        "joint1_torque",
        "joint_1.effort",
        "joint1.velocity",
        "x_deg_s",
        "joint1_current",
        "joint_load [%]",
        "joint_temp",
        "joint1_status",
        "joint_reaction_x",
        "oil_deg_C",
        "yaw current (A)",
    ],
)
def test_jumps_of_what_is_no_angle_are_kept(head):
    assert [one.kind for one in found("x", head)] == ["position", "position"]


@pytest.mark.parametrize(
    "head", ["joint[0]", "joint_1_s", "yaw (filtered)", "current_yaw", "joint1_current_position", "hip [rad]", "a [°]"]
)
def test_angles_whatever_else_their_heads_say(head):
    assert found("x", head)[1].kind == "angle"


def test_the_word_joint_beside_an_unknown_one_takes_away_no_jump_that_is_no_wrap():
    """Without a unit, nothing else says that joint1_pressure is an angle, where its values do not."""
    switched = np.where(U > 0.5, 3.0, -3.0) + 0.1 * np.sin(9 * U)
    wrapped = np.mod(3 + 2 * U + np.pi, 2 * np.pi) - np.pi
    for head, column, kind in (
        ("joint1_pressure", switched, "position"),
        ("joint1_pressure", U, "angle"),
        ("joint1_pressure", wrapped, "angle"),
        ("panda_joint1", switched, "angle"),
        ("joint1_position", switched, "angle"),
    ):
        assert found("x", head, columns=np.column_stack([U, column]))[1].kind == kind


def quaternion(n_odd=0):
    q = np.column_stack([np.sin(U), np.zeros((T, 2)), np.cos(U)])
    q[:n_odd] *= 0.5
    return q


def test_a_few_samples_of_another_norm_do_not_hide_a_quaternion():
    """They cost their movement, with a message; learned as four positions they would cost all movements, without."""
    assert [one.kind for one in found("x", "y", "z", "w", columns=quaternion(2))] == ["orientation"]
    assert {one.kind for one in found("x", "y", "z", "w", columns=quaternion(10))} == {"position"}


@pytest.mark.parametrize("mark", [".1", "1", "_2"])
def test_columns_of_quaternions_with_numbers_behind_them(mark):
    heads = [f"q{part}" for part in "xyzw"]
    channels = found(*heads, *(head + mark for head in heads), columns=np.tile(quaternion(), 2))
    assert [(one.name, one.kind) for one in channels] == [("q", "orientation"), ("q" + mark, "orientation")]
    mixed = found("qx", "qy1", "qz", "qw", columns=quaternion())
    assert {one.kind for one in mixed} == {"position"}


def test_a_quaternion_keeps_the_columns_of_the_file_however_the_caller_lists_them():
    given = {"d,a,b,c": "wxyz"}
    (one,) = find_channels(list("abcd"), quaternion(), np.array([0, T]), given)
    assert (one.columns, one.order) == (("a", "b", "c", "d"), "xyzw")


@pytest.mark.parametrize(
    ("given", "columns", "order"),
    [
        ({"a,b,d,e": "wxyz"}, ("a", "b", "d", "e"), "wxyz"),
        ({"a,c,d,e": "xyzw"}, ("a", "c", "d", "e"), "xyzw"),
        ({"b,a,c,d": "wxyz"}, ("b", "a", "c", "d"), "wxyz"),
        ({"d,c,b,a": "xyzw"}, ("a", "d", "c", "b"), "wxyz"),
    ],
)
def test_the_columns_of_a_quaternion_may_stand_apart_and_in_any_order(given, columns, order):
    (one,) = [one for one in find_channels(list("abcde"), BLOCK, np.array([0, T]), given) if one.kind == "orientation"]
    assert (one.columns, one.order) == (columns, order)


BLOCK = np.column_stack([U] * 5)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"a,b,c,d": "wxyz", "b,c,d,e": "wxyz"}, "several of 'b'"),
        ({"a,b,c,d": "wxyz", "c": "angle"}, "several of 'c'"),
        ({"a,a,b,c": "wxyz"}, "several of 'a'"),
    ],
)
def test_quaternions_that_cannot_be_are_refused(given, words):
    with pytest.raises(SpecificationError, match=words):
        find_channels(list("abcde"), np.column_stack([U] * 5), np.array([0, T]), given)


@pytest.mark.parametrize(("n_levels", "kind"), [(8, "discrete"), (9, "position")])
def test_a_discrete_channel_has_eight_values_at_most(n_levels, kind):
    assert found("x", "gripper", columns=np.column_stack([U, np.arange(T) % n_levels]))[1].kind == kind


HEADS_APART = ["qw", "x", "y", "z", "qx", "qy", "qz", "gripper"]


def test_columns_of_a_quaternion_between_and_around_others():
    """Names say enough: x, y, z, qx, qy, qz, qw, gripper as well as qw, x, y, z, qx, qy, qz."""
    one, *others = found(*HEADS_APART)
    assert (one.columns, one.order) == (("qw", "qx", "qy", "qz"), "wxyz")
    assert [other.name for other in others] == ["x", "y", "z", "gripper"]
    one, other, _ = found(
        "right_qx", "left_qx", "right_qy", "left_qy", "right_qz", "left_qz", "right_qw", "left_qw", "x"
    )
    assert (one.columns, other.name) == (("right_qx", "right_qy", "right_qz", "right_qw"), "left_q")


def test_recorded_columns_are_in_the_order_of_the_channels():
    block = np.column_stack([values(head) for head in HEADS_APART])
    channels = find_channels(HEADS_APART, block, np.array([0, T]), {})
    names = list(recorded_names(channels))
    assert names == ["qw", "qx", "qy", "qz", "x", "y", "z", "gripper"]
    np.testing.assert_array_equal(
        in_order(block, HEADS_APART, channels), block[:, [HEADS_APART.index(n) for n in names]]
    )


def numbered(scalar, sign=1.0):
    """Turning through half a turn, the scalar in this column; with signs such that it never is negative."""
    angle = np.linspace(1.2, 1.9, T)
    q = np.column_stack([np.cos(angle), np.sin(angle), np.zeros((T, 2))])
    q[:, 2] = 0.3
    q[:, :2] *= np.sqrt(1 - 0.09)
    q *= np.where(q[:, :1] < 0, -1, 1) * sign
    return q if scalar == 0 else q[:, [1, 2, 3, 0]]


@pytest.mark.parametrize(
    "heads",
    [
        ["q0", "q1", "q2", "q3"],
        ["q1", "q2", "q3", "q4"],
        [f"quat[{k}]" for k in range(4)],
        [f"joint_orientations.0.{k}" for k in range(4)],
    ],
)
@pytest.mark.parametrize(("scalar", "order"), [(0, "wxyz"), (3, "xyzw")])
def test_the_scalar_of_a_numbered_quaternion_is_where_no_sign_changes(heads, scalar, order):
    (one,) = found(*heads, columns=numbered(scalar))
    assert (one.kind, one.order, one.columns) == ("orientation", order, tuple(heads))


def test_a_numbered_quaternion_whose_scalar_nothing_tells_is_asked_for():
    steady = np.abs(numbered(0))  # no change of sign
    with pytest.raises(SpecificationError, match="in the shell --kind q0,q1,q2,q3=wxyz"):
        found("q0", "q1", "q2", "q3", columns=steady)
    (one,) = found("q0", "q1", "q2", "q3", columns=steady, **{"q0,q1,q2,q3": "xyzw"})
    assert one.order == "xyzw"
    joints = found(*(f"q{k}" for k in range(4)), columns=2 * steady)
    assert {one.kind for one in joints} == {"angle"}
    five = found(*(f"q{k}" for k in range(5)), columns=np.column_stack([steady, U]))
    assert {one.kind for one in five} == {"angle"}


def test_movements_one_after_the_other_do_not_change_the_sign_of_a_quaternion():
    steady = np.abs(numbered(0))
    heads, both = ["q0", "q1", "q2", "q3"], np.concatenate([steady, steady * [1, -1, -1, -1]])
    assert both[T - 1] @ both[T] < 0
    with pytest.raises(SpecificationError, match="expected heads that say"):
        find_channels(heads, both, np.array([0, T, 2 * T]), {})


@pytest.mark.parametrize("given", [{"tool.rot": "xyzw"}, {"tool.rot.0,tool.rot.1,tool.rot.2,tool.rot.3": "xyzw"}])
def test_what_several_heads_begin_with_names_them_all(given):
    heads = ["x", *(f"tool.rot.{k}" for k in range(4))]
    channels = find_channels(heads, np.column_stack([U, np.abs(numbered(0))]), np.array([0, T]), given)
    assert [(one.kind, one.order) for one in channels] == [("position", ""), ("orientation", "xyzw")]
    joints = find_channels(["arm.a", "arm.b", "x"], np.column_stack([U] * 3), np.array([0, T]), {"arm": "angle"})
    assert [one.kind for one in joints] == ["angle", "angle", "position"]


@pytest.mark.parametrize(
    ("largest", "kind"), [(3.0, "angle"), (100.0, "position"), (55.0, "position"), (150.0, "angle")]
)
def test_positions_of_motors_in_percent_are_no_angles(largest, kind):
    """What a driver calls wrist_roll.pos is in degrees, radians or percent of the range; percent do not wrap."""
    values = np.column_stack((np.linspace(-largest, largest, 50), np.linspace(0.0, 1.0, 50)))
    for head in ("wrist_roll.pos", "left_wrist_roll.pos"):
        channels = find_channels((head, "x"), values, np.array([0, 50]), {})
        assert channels[0].kind == kind
    (channel, _) = find_channels(("wrist_roll.pos [deg]", "x"), values, np.array([0, 50]), {})
    assert channel.kind == "angle"

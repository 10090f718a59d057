"""The arms that come with kineme, beside what their makers publish and beside another program's kinematics."""

from __future__ import annotations

import re
import sys
from functools import reduce
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from arm_samples import simulated, standing, tip_in
from kineme.errors import DataError, SpecificationError
from kineme.robots import load
from kineme.robots.models.robot import MODELS

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

H, PI = np.pi / 2, np.pi

# Denavit-Hartenberg parameters (a, alpha, d) of the makers: Barrett (WAM); Universal Robots, "DH Parameters
# for calculations of kinematics and dynamics"; Franka's documentation of its control interface, after Craig, with the
# flange at 0.107 m, the hand turned by -45 degrees, and its tip 0.1034 m before it.
WAM = [(0, -H, 0), (0, H, 0), (0.045, -H, 0.55), (-0.045, H, 0), (0, -H, 0.3), (0, H, 0), (0, 0, 0.06)]
UR5E = [(0, H, 0.1625), (-0.425, 0, 0), (-0.3922, 0, 0), (0, H, 0.1333), (0, -H, 0.0997), (0, 0, 0.0996)]
PANDA = [(0, 0, 0.333), (0, -H, 0), (0, H, 0.316), (0.0825, H, 0), (-0.0825, -H, 0.384), (0, H, 0), (0.088, H, 0)]

# Frames of links, each in the one before it (x, y, z, roll, pitch, yaw), as the makers' descriptions for ROS have them:
# ur_description, franka_description with the hand, SO-ARM100 (so101_new_calib.urdf). Barrett publishes none of the WAM.
OFFICIAL = {
    "ur5e": [
        ("base_link_inertia", (0, 0, 0, 0, 0, PI)),
        ("shoulder_link", (0, 0, 0.1625, 0, 0, 0)),
        ("upper_arm_link", (0, 0, 0, H, 0, 0)),
        ("forearm_link", (-0.425, 0, 0, 0, 0, 0)),
        ("wrist_1_link", (-0.3922, 0, 0.1333, 0, 0, 0)),
        ("wrist_2_link", (0, -0.0997, 0, H, 0, 0)),
        ("wrist_3_link", (0, 0.0996, 0, H, PI, PI)),
        ("flange", (0, 0, 0, 0, -H, -H)),
        ("tool0", (0, 0, 0, H, 0, H)),
    ],
    "panda": [
        ("panda_link1", (0, 0, 0.333, 0, 0, 0)),
        ("panda_link2", (0, 0, 0, -H, 0, 0)),
        ("panda_link3", (0, -0.316, 0, H, 0, 0)),
        ("panda_link4", (0.0825, 0, 0, H, 0, 0)),
        ("panda_link5", (-0.0825, 0.384, 0, -H, 0, 0)),
        ("panda_link6", (0, 0, 0, H, 0, 0)),
        ("panda_link7", (0.088, 0, 0, H, 0, 0)),
        ("panda_hand", (0, 0, 0.107, 0, 0, -PI / 4)),
        ("panda_hand_tcp", (0, 0, 0.1034, 0, 0, 0)),
    ],
    "so101": [
        ("shoulder_link", (0.0388353, 0, 0.0624, PI, 0, -PI)),
        ("upper_arm_link", (-0.0303992, -0.0182778, -0.0542, -H, -H, 0)),
        ("lower_arm_link", (-0.11257, -0.028, 0, 0, 0, H)),
        ("wrist_link", (-0.1349, 0.0052, 0, 0, 0, -H)),
        ("gripper_link", (0, -0.0611, 0.0181, H, 0.0486795, PI)),
        ("gripper_frame_link", (-0.0079, -0.000218121, -0.0981274, 0, PI, 0)),
    ],
}


def random_postures(robot, n=50):
    return np.random.default_rng(1).uniform(robot.lower, robot.upper, (n, robot.n_joints))


def turned(angles, axes="xyz"):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler(axes, angles).as_matrix()
    return pose


def shifted(*position):
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def distal(angle, a, alpha, d):
    return turned(angle, "z") @ shifted(a, 0, d) @ turned(alpha, "x")


def proximal(angle, a, alpha, d):
    return turned(alpha, "x") @ shifted(a, 0, 0) @ turned(angle, "z") @ shifted(0, 0, d)


@pytest.mark.parametrize(
    ("name", "rows", "link", "base", "tool"),
    [
        ("wam", WAM, distal, np.eye(4), np.eye(4)),
        ("ur5e", UR5E, distal, turned(PI, "z"), np.eye(4)),  # the base of the controller, seen from base_link of ROS
        ("panda", PANDA, proximal, np.eye(4), shifted(0, 0, 0.107) @ turned(-PI / 4, "z") @ shifted(0, 0, 0.1034)),
    ],
)
def test_kinematics_are_those_of_the_published_parameters(name, rows, link, base, tool):
    robot = load(name)
    postures = random_postures(robot)
    state = standing(robot, postures)
    for q, position, rotation in zip(postures, state.tip_positions, state.tip_rotations, strict=True):
        pose = reduce(np.matmul, [link(angle, *row) for angle, row in zip(q, rows, strict=True)], base) @ tool
        np.testing.assert_allclose(position, pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(rotation, pose[:3, :3], atol=1e-9)


@pytest.mark.parametrize("name", OFFICIAL)
def test_every_link_is_where_the_makers_description_has_it(name):
    pinocchio = pytest.importorskip("pinocchio")
    robot = load(name)
    data = robot.model.createData()
    links = _moving_links(robot)
    for q in random_postures(robot, 5):
        angles_of = dict(zip(links, q, strict=True))
        pinocchio.framesForwardKinematics(robot.model, data, q)
        pose = np.eye(4)
        for link, (x, y, z, *angles) in OFFICIAL[name]:
            pose = pose @ shifted(x, y, z) @ turned(angles) @ turned(angles_of.get(link, 0.0), "z")
            here = data.oMf[robot.model.getFrameId(link)].homogeneous
            np.testing.assert_allclose(here, pose, atol=2e-6, err_msg=link)  # angles of five digits


def _moving_links(robot):
    """The links that the joints move, by the XML itself."""
    root = ElementTree.parse(robot.source).getroot()
    return [joint.find("child").get("link") for joint in root.iter("joint") if joint.get("type") == "revolute"]


def test_the_ur5e_stands_as_in_ros_and_not_as_in_its_controller():
    robot = load("ur5e")  # at zero it lies along x of base_link: 0.425 + 0.3922 m, and -x of the controller's base
    state = standing(robot, np.zeros(6))
    np.testing.assert_allclose(state.tip_positions[0], [0.8172, 0.2329, 0.0628], atol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_kinematics_are_those_that_mujoco_computes(name):
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    robot = load(name)
    arm = simulated(mujoco, robot)
    data = mujoco.MjData(arm)
    postures = random_postures(robot, 20)
    state = standing(robot, postures)
    for q, position, rotation in zip(postures, state.tip_positions, state.tip_rotations, strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm, data)
        there, turned = tip_in(mujoco, arm, data, robot)
        np.testing.assert_allclose(position, there, atol=1e-6)
        np.testing.assert_allclose(rotation, turned, atol=1e-6)


@pytest.mark.parametrize("name", MODELS)
def test_rest_postures_are_within_the_limits_and_touch_nothing(name):
    robot = load(name)
    assert np.all((robot.rest >= robot.lower) & (robot.rest <= robot.upper))
    assert not standing(robot, robot.rest).contacts


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(SpecificationError, match=r"panda, ur5e, wam, so101 or the path of a \.urdf file, got 'pandas'"):
        load("pandas")


def test_a_tip_that_does_not_exist_is_named():
    with pytest.raises(DataError, match="has no link 'tool' to be the tip; there are 'tool0'"):
        load("ur5e", tip="tool")


ONE_JOINT = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{more}</joint></robot>"""


def test_a_joint_without_limits_is_refused_by_name(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ONE_JOINT.format(kind="revolute", more=""))
    with pytest.raises(DataError, match="joint 'j' has no limits; add <limit"):
        load(path)


def test_a_mimic_joint_is_refused_by_name(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ONE_JOINT.format(kind="revolute", more='<mimic joint="j"/><limit lower="-1" upper="1"/>'))
    with pytest.raises(DataError, match=r"joint 'j' mimics another one, .* choose a tip before it, as 'a'"):
        load(path)


def test_soft_limits_of_a_safety_controller_are_kept(tmp_path):
    path = tmp_path / "arm.urdf"
    limits = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
    for soft, expected in (
        ('soft_lower_limit="-0.5" soft_upper_limit="0.25"', (-0.5, 0.25)),
        ('soft_lower_limit="-3" soft_upper_limit="3"', (-1.0, 1.0)),
        ('soft_upper_limit="0.5"', (-1.0, 0.5)),
    ):
        more = f'{limits}<safety_controller {soft} k_position="10" k_velocity="10"/>'
        path.write_text(ONE_JOINT.format(kind="revolute", more=more))
        robot = load(path)
        assert (robot.lower[0], robot.upper[0]) == expected
        assert (robot.model.lowerPositionLimit[0], robot.model.upperPositionLimit[0]) == expected


def link_of(name, inside=""):
    return f'<link name="{name}">{inside}</link>'


def joint_of(name, parent, child, kind="revolute", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="0.02 0 0.2"/><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{"0 1 0" if name[-1] in "246" else "0 0 1"}"/>'
        f'<limit lower="-2" upper="2" velocity="1" effort="9" acceleration="5"/>{more}</joint>'
    )


def chain_of(n, prefix="", root="base"):
    """Joints and links of an arm of n joints, which ends in prefix + link + n."""
    names = [root, *(f"{prefix}link{i}" for i in range(1, n + 1))]
    return [joint_of(f"{prefix}joint{i}", names[i - 1], names[i]) for i in range(1, n + 1)]


def tree(folder, joints, name="arm.urdf"):
    """A URDF of these joints and of the links that they name."""
    text = "".join(joints)
    links = dict.fromkeys(re.findall(r'<(?:parent|child) link="([^"]+)"', text))
    path = folder / name
    path.write_text(f'<robot name="r">{"".join(map(link_of, links))}{text}</robot>')
    return path


PARALLEL = [joint_of("slide1", "link6", "left", "prismatic"), joint_of("slide2", "link6", "right", "prismatic")]
GRIPPERS = {
    "two that slide": PARALLEL,
    "two that turn": [joint_of("a", "link6", "left"), joint_of("b", "link6", "right")],
    "one that mimics": [joint_of("a", "link6", "left", more='<mimic joint="joint6"/>')],
    "a jaw by its name": [joint_of("gripper", "link6", "moving")],
    "a finger by its link": [joint_of("a", "link6", "finger_link"), joint_of("b", "finger_link", "end")],
}


@pytest.mark.parametrize("kind", GRIPPERS)
def test_grippers_are_found_locked_and_said(tmp_path, kind):
    robot = load(tree(tmp_path, [*chain_of(6), *GRIPPERS[kind]]))
    assert robot.joints == tuple(f"joint{i}" for i in range(1, 7))
    assert robot.tip == "link6"
    gripper = [re.search(r'name="([^"]+)"', joint)[1] for joint in GRIPPERS[kind]]
    belong = "belong" if len(gripper) > 1 else "belongs"
    assert f"{', '.join(gripper)} {belong} to a gripper or a hand: locked, no part of the arm" in robot.assumed


def test_a_tip_that_is_asked_for_behind_a_gripper_moves_with_the_arm_alone(tmp_path):
    robot = load(tree(tmp_path, [*chain_of(6), *PARALLEL]), tip="left")
    assert robot.joints == tuple(f"joint{i}" for i in range(1, 7))


def test_a_joint_that_turns_the_gripper_is_one_of_the_arm(tmp_path):
    turning = joint_of("gripper_roll", "link5", "link6")
    assert load(tree(tmp_path, [*chain_of(5), turning, *PARALLEL])).joints[-1] == "gripper_roll"


@pytest.mark.parametrize(
    ("names", "tip"),
    [
        (("flange", "tool0"), "tool0"),
        (("ee_link", "tool0", "camera_link"), "tool0"),
        (("hand", "hand_tcp"), "hand_tcp"),
        (("camera_optical_frame", "plate"), "plate"),
        (("plate", "adapter"), "link6"),  # neither is an end by its name: what the last joint moves
    ],
)
def test_the_tip_is_the_end_of_the_chain_by_its_name(tmp_path, names, tip):
    fixed = [joint_of(f"fixed{i}", "link6", name, "fixed") for i, name in enumerate(names)]
    base = joint_of("b", "base", "base_tcp", "fixed")
    robot = load(tree(tmp_path, [*chain_of(6), base, *fixed]))
    assert robot.tip == tip
    assert not robot.assumed or "singular" in robot.assumed[0]


def test_the_longest_of_several_chains_is_the_arm_and_the_others_are_said(tmp_path):
    legs = [joint for side in "lr" for joint in chain_of(3, side, "base")]
    robot = load(tree(tmp_path, [*legs, *chain_of(6)]))
    assert robot.tip == "link6"
    assert robot.assumed[0] == (
        "the tip is 'link6' (6 joints), of the longest chain; others are 'llink3' (3 joints), 'rlink3' (3 joints) "
        "(choose with tip=, --tip)"
    )


def test_two_arms_are_asked_about_with_the_ends_of_their_chains(tmp_path):
    arms = [joint for side in ("left_", "right_") for joint in chain_of(5, side, "body")]
    path = tree(tmp_path, [joint_of("lift", "base", "body", "prismatic"), *arms, *chain_of(2, "head_", "body")])
    words = r"3 links: 'left_link5' \(6 joints\), 'right_link5' \(6 joints\), 'head_link2' \(3 joints\); say which"
    with pytest.raises(DataError, match=words):
        load(path)
    with pytest.raises(DataError, match=r"no link 'x' to be the tip; there are 'left_link5' \(6 joints\)"):
        load(path, tip="x")


def test_a_wrist_beside_a_camera_that_turns_is_no_gripper(tmp_path):
    camera = joint_of("pan", "link4", "eye")
    robot = load(tree(tmp_path, [*chain_of(6), camera]))
    assert robot.n_joints == 6


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="most" value="1.5"/>
<link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="${-most}" upper="${most}" velocity="1" effort="1"/></joint></robot>"""


def test_a_xacro_file_is_converted_by_its_package(tmp_path):
    pytest.importorskip("xacro", reason="xacro is not installed")
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    np.testing.assert_allclose([*load(path).lower, *load(path).upper], [-1.5, 1.5])
    path.write_text(XACRO.replace("value=", "value='' other="))
    with pytest.raises(
        DataError, match=r"xacro cannot convert this file: .*; convert it .*: xacro arm\.urdf\.xacro > arm"
    ):
        load(path)


def test_without_its_package_the_command_that_converts_xacro_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    path = tmp_path / "arm.urdf"  # also under the name of a URDF
    path.write_text(XACRO)
    with pytest.raises(DataError, match=r"pip install xacro, or .*: xacro arm\.urdf > arm_converted\.urdf"):
        load(path)


def test_a_joint_without_stops_is_kept_within_one_turn_and_says_so(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ONE_JOINT.format(kind="continuous", more=""))
    robot = load(path)
    np.testing.assert_allclose([robot.lower[0], robot.upper[0]], [-2 * np.pi, 2 * np.pi])
    assert robot.assumed == (
        "j has no stops: it is kept within one turn to each side",
        "the file says no velocity limit for j: 1 1/s is taken",
        "the file says no acceleration limit for j: 5 1/s^2 is taken",
    )


def test_links_without_shapes_are_said_in_one_sentence(tmp_path):
    links = "".join(
        f'<link name="l{i}"><collision><geometry><mesh filename="none{i}.stl"/></geometry></collision></link>'
        for i in range(6)
    )
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" velocity="1" acceleration="1"/></joint>'
        for i in range(5)
    )
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r">{links}{joints}</robot>')
    assert load(path).assumed[0] == "l0, l1, l2 and 3 more each have no shape: its mesh is not there"


def straight_arm(folder, kinds=("revolute",) * 6, names=("hand",)):
    """A URDF of an arm that stands straight in the middle of its limits, where it is singular."""
    axes, end = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1"), len(kinds) - 1
    links = [f"link{i}" for i in range(len(kinds))] + [names[0]]
    joints = [
        f'<joint name="{names[-1] if i == end else f"joint{i}"}" type="{kind}"><origin xyz="0 0 0.2"/>'
        f'<parent link="{links[i]}"/><child link="{links[i + 1]}"/><axis xyz="{axes[i]}"/>'
        '<limit lower="-2.8" upper="2.8" velocity="2" acceleration="10" effort="100"/></joint>'
        for i, kind in enumerate(kinds)
    ]
    path = folder / "straight.urdf"
    path.write_text(f'<robot name="r">{"".join(f"<link name={name!r}/>" for name in links)}{"".join(joints)}</robot>')
    return path


def test_an_arm_that_is_singular_in_the_middle_of_its_limits_rests_bent_and_says_so(tmp_path):
    path = straight_arm(tmp_path)
    robot = load(path)
    found = standing(robot, robot.rest)
    assert found.smallest_singular_values[0] > 0.05
    assert found.tip_positions[0, 2] > 0
    assert np.count_nonzero(robot.rest) <= 3
    assert "in the middle of its limits the arm is singular" in robot.assumed[-1]
    np.testing.assert_array_equal(load(path, rest=np.zeros(6)).rest, np.zeros(6))


def test_an_arm_that_is_not_singular_there_rests_in_the_middle(tmp_path):
    robot = load(straight_arm(tmp_path, ("prismatic",) * 3))
    np.testing.assert_array_equal(robot.rest, np.zeros(3))
    assert not robot.assumed


def test_a_link_may_be_called_like_a_joint(tmp_path):
    path = straight_arm(tmp_path, names=("hand", "hand"))
    robot = load(path)
    assert robot.joints[-1] == "hand"
    assert load(path, tip="hand").tip == robot.tip


def test_units_are_those_of_turning_and_sliding(tmp_path):
    robot = load(straight_arm(tmp_path, ("revolute", "prismatic", "revolute")))
    assert robot.units == ("rad", "m", "rad")


def test_checks_of_a_joint_that_slides_are_in_meters_and_newtons(tmp_path):
    import kineme
    from kineme.robots import move

    path = straight_arm(tmp_path, ("revolute", "prismatic", "revolute"))
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    path.write_text(path.read_text().replace("<link name='hand'/>", f"<link name='hand'>{mass}</link>"))
    u = np.linspace(0, 1, 60)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    made = move(kineme.Trajectory(2 * u[:, 0], s * [0.1, 0.2, 0.3]), load(path), space="joints")
    units = {(check.what, check.where): check.unit for check in made.preflight.checks}
    for joint, expected in (("joint0", ("rad", "rad/s", "rad/s^2", "Nm")), ("joint1", ("m", "m/s", "m/s^2", "N"))):
        found = tuple(units[what, joint] for what in ("position", "velocity", "acceleration", "torque"))
        assert found == expected


def test_a_single_joint_is_moved_too(tmp_path):
    import kineme
    from kineme.robots import move

    u = np.linspace(0, 1, 60)
    movement = kineme.Trajectory(4 * u, (0.5 * (10 * u**3 - 15 * u**4 + 6 * u**5))[:, None])
    assert move(movement, load(straight_arm(tmp_path, ("revolute",))), space="joints").preflight.passed

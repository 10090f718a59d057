"""The arms that come with kineme, beside what their makers publish and beside another program's kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from arm_samples import simulated, standing, tip_in
from kineme.errors import DataError, SpecificationError
from kineme.robots import load
from kineme.robots.models.table import MODELS

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

# Standard Denavit-Hartenberg parameters (a, alpha, d) of the makers.
WAM = [
    (0, -np.pi / 2, 0),
    (0, np.pi / 2, 0),
    (0.045, -np.pi / 2, 0.55),
    (-0.045, np.pi / 2, 0),
    (0, -np.pi / 2, 0.3),
    (0, np.pi / 2, 0),
    (0, 0, 0.06),
]
UR5E = [
    (0, np.pi / 2, 0.1625),
    (-0.425, 0, 0),
    (-0.3922, 0, 0),
    (0, np.pi / 2, 0.1333),
    (0, -np.pi / 2, 0.0997),
    (0, 0, 0.0996),
]


def random_postures(robot, n=50):
    return np.random.default_rng(1).uniform(robot.lower, robot.upper, (n, robot.n_joints))


@pytest.mark.parametrize(("name", "rows"), [("wam", WAM), ("ur5e", UR5E)])
def test_kinematics_are_those_of_the_published_parameters(name, rows):
    robot = load(name)
    postures = random_postures(robot)
    state = standing(robot, postures)
    for q, position, rotation in zip(postures, state.tip_positions, state.tip_rotations, strict=True):
        pose = np.eye(4)
        for angle, (a, alpha, d) in zip(q, rows, strict=True):
            link = np.eye(4)
            link[:3, :3] = (Rotation.from_euler("z", angle) * Rotation.from_euler("x", alpha)).as_matrix()
            link[:3, 3] = [a * np.cos(angle), a * np.sin(angle), d]
            pose = pose @ link
        np.testing.assert_allclose(position, pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(rotation, pose[:3, :3], atol=1e-9)


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

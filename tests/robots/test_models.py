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
    with pytest.raises(DataError, match="joint 'j' mimics another one"):
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

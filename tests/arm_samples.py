"""Movements for arms, and arms in MuJoCo: another program's kinematics and dynamics."""

from __future__ import annotations

import numpy as np

import kineme
from kineme.robots import load
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.execution.preflight import along
from kineme.robots.kinematics.descent import InverseKinematics

_SETTINGS = 'fusestatic="false" balanceinertia="true" boundmass="1e-3" boundinertia="1e-6"'


def stroke(robot, seconds=3.0, size=1.0, n=150):
    """An S in front of the tip at rest, with the velocity of least jerk."""
    u = np.linspace(0, 1, n)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    scale = size * (0.25 if robot.name == "so101" else 1.0)
    shape = np.column_stack((0 * s - 0.05, 0.42 * (s - 0.5), 0.1 * np.sin(2 * np.pi * s)))
    return kineme.Trajectory(times=seconds * u, positions=InverseKinematics(robot).tip_position + scale * shape)


def standing(robot, postures):
    """What the library says of an arm that stands in postures (m, n): tips, torques, contacts."""
    postures = np.atleast_2d(postures)
    still, times = np.zeros_like(postures), np.arange(len(postures), dtype=float)
    return along(robot, JointTrajectory(robot.joints, times, postures, still, still, {}))


def simulated(mujoco, robot):
    """The arm in MuJoCo, from the same URDF."""
    compiler = f"<mujoco><compiler {_SETTINGS}/></mujoco></robot>"
    return mujoco.MjModel.from_xml_string(robot.source.read_text().replace("</robot>", compiler))


def tip_in(mujoco, arm, data, robot):
    """Where MuJoCo has the tip, and how it is turned."""
    body = mujoco.mj_name2id(arm, mujoco.mjtObj.mjOBJ_BODY, robot.tip)
    return data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()


_AXES = ("0 0 1", "0 1 0")


def simple_arm(folder, effort=100.0, kinds=("revolute", "revolute"), mass=1.0, velocity=2.0):
    """Two links with masses, and balls on base and tip: at rest the tip's ball is inside that of the base."""
    ball = '<collision><origin xyz="{} 0 0"/><geometry><sphere radius="0.1"/></geometry></collision>'
    moments = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    inertia = f'<inertial><origin xyz="0.2 0 0"/><mass value="{mass}"/>{moments}</inertial>'
    contents = (ball.format(0.5), inertia, inertia + ball.format(0.5))
    links = "".join(f'<link name="l{i}">{content}</link>' for i, content in enumerate(contents))
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/><axis xyz="{axis}"/>'
        f'<limit lower="-2" upper="2" velocity="{velocity}" effort="{effort}"/></joint>'
        for i, (kind, axis) in enumerate(zip(kinds, _AXES, strict=True), 1)
    )
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="simple">{links}{joints}</robot>')
    return load(path)

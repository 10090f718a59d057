"""How far a simulated Panda strays from what it is sent; part of the subject `arms`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.rows import Row
from kineme import Trajectory
from kineme.robots import Robot, move
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.execution.preflight import along
from kineme.validation import Array

MOST_OFF = 10.0  # mm
POSITION = np.array(
    [3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0]
)  # [Nm/rad], as libfranka's examples set them
EFFORT = np.array([600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0])  # [Nm/rad], of torque control in franka_ros
_DAMPED = 1.4  # damping over the square root of the stiffness: of a unit inertia 0.7 of the critical one
_INERTIAS = '<mujoco><compiler fusestatic="false" balanceinertia="true" boundmass="1e-3" boundinertia="1e-6"/></mujoco>'
_RATE = 1000.0  # samples and steps of the simulation per second


def tracking(movement: Trajectory, robot: Robot) -> Iterator[Row]:
    """Two rows, where MuJoCo is installed: the joints are sent as they are timed by `timing="slowed"`.

    The target is that of position control, which trajectories of joints are sent to; the softer control of torques is
    shown beside it. Neither is told accelerations.
    """
    try:
        import mujoco
    except ImportError:
        print("arms: MuJoCo is not installed, the simulated Panda is left out")
        return
    made = move(movement, robot, timing="slowed", rate=_RATE)
    for control, stiffness in (("position", POSITION), ("effort", EFFORT)):
        off = 1e3 * _tips_off(mujoco, robot, made.trajectory, stiffness)
        details = {"slowed down by": made.factor, "rms": float(np.sqrt(np.mean(off**2)))}
        what = f"{robot.name} in MuJoCo, {control} control: tip off the slowed movement, worst"
        target = ("<=", MOST_OFF) if control == "position" else None
        yield Row(what, "mm", float(off.max()), target=target, details=details)


def _tips_off(mujoco: Any, robot: Robot, trajectory: JointTrajectory, stiffness: Array) -> Array:
    """Distance of the simulated tip from the one that is sent, at each sample [m]."""
    arm = mujoco.MjModel.from_xml_string(robot.source.read_text().replace("</robot>", f"{_INERTIAS}</robot>"))
    arm.opt.timestep = 1.0 / _RATE
    arm.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data, tip = mujoco.MjData(arm), mujoco.mj_name2id(arm, mujoco.mjtObj.mjOBJ_BODY, robot.tip)
    data.qpos[:] = trajectory.positions[0]
    sent, off = along(robot, trajectory).tip_positions, np.empty(len(trajectory))
    for k in range(len(trajectory)):
        mujoco.mj_forward(arm, data)
        off[k] = np.linalg.norm(data.xpos[tip] - sent[k])
        push = stiffness * (trajectory.positions[k] - data.qpos)
        push += _DAMPED * np.sqrt(stiffness) * (trajectory.velocities[k] - data.qvel)
        data.qfrc_applied[:] = np.clip(push + data.qfrc_bias, -robot.effort, robot.effort)
        mujoco.mj_step(arm, data)
    return off

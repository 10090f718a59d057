"""The recordings as movements of an arm: the joint positions of the WAM that writes them."""

from __future__ import annotations

import numpy as np

from kineme.errors import DataError
from kineme.movements.preparation.resample import Resample
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.robots.kinematics.descent import PLANES, InverseKinematics
from kineme.robots.models.robot import Robot, load
from kineme.validation import Array
from kineme_experiments.paper.paper import N_POINTS

ROBOT = "wam"  # the arm of Figure 7
SCALE = 0.004  # meters for a millimeter of the recordings: letters of about 20 cm
PLANE = "xy"  # a table, the tool pointing down


def missing_extra() -> str:
    """What is not installed of that which arms need, as the error says it; empty where all is there."""
    try:
        InverseKinematics(load(ROBOT))
    except DataError as error:
        return str(error)
    return ""


def executed(demos: Demonstrations) -> tuple[Demonstrations, float]:
    """The joint positions of the arm that writes each movement, 150 samples each, and its largest error [m].

    The origin of the recordings, where all of them end, lies below the tip at rest. Each movement is followed from the
    posture next to the rest posture, with the orientation of the tip at rest.

    Raises
    ------
    DataError
        The extra ``robot`` is not installed.
    """
    arm = load(ROBOT)
    ik = InverseKinematics(arm)
    points = np.tile(ik.tip_position, (len(demos), N_POINTS, 1))
    points[..., list(PLANES[PLANE])] += SCALE * Resample(N_POINTS).apply(demos).positions.reshape(-1, N_POINTS, 2)
    rotations = np.broadcast_to(ik.tip_rotation, (N_POINTS, 3, 3))
    joints = np.empty((len(demos), N_POINTS, arm.n_joints))
    for i, path in enumerate(points):
        ik.reset(arm.rest)
        ik.solve(path[0], rotations[0])
        joints[i] = ik.follow(path, rotations)
    error = float(np.abs(tip_positions(arm, joints.reshape(-1, arm.n_joints)) - points.reshape(-1, 3)).max())
    times = [np.linspace(0.0, demos[i].times[-1] - demos[i].times[0], N_POINTS) for i in range(len(demos))]
    return Demonstrations.from_arrays(list(joints), demos.labels, times, demos.names), error


def tip_positions(arm: Robot, joints: Array) -> Array:
    """Where joint positions (T, n) bring the tip, shape (T, 3) [m]."""
    import pinocchio

    data, tip = arm.model.createData(), arm.model.getFrameId(arm.tip)
    found = np.empty((len(joints), 3))
    for t, q in enumerate(joints):
        pinocchio.forwardKinematics(arm.model, data, q)
        found[t] = pinocchio.updateFramePlacement(arm.model, data, tip).translation
    return found

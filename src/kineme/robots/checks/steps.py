"""Whether discrete channels, as of a gripper, change as they did, and while the arm stands where it stood."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.robots.checks.check import Check
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_STANDING = 0.02  # of the fastest instant as generated, or of the limits of velocity


class Steps(NamedTuple):
    """A discrete channel as it was generated, T samples."""

    name: str
    values: Array  # (T,)
    velocities: Array  # (T, n), of the joints


def steps_kept(robot: Robot, trajectory: JointTrajectory, generated: Steps) -> Check:
    """Every value of the channel is there, in the same order, and what changed while the arm stood does so still.

    Too few samples lose a short pulse; the fastest timing leaves out the time in which an arm stands and waits for its
    gripper. What changes in motion as it was generated passes; the fastest of these is said, without a limit.
    """
    name, sent = generated.name, trajectory.steps[generated.name]
    before, now = _changes(generated.values), _changes(sent)
    if not np.array_equal(_order(generated.values, before), _order(sent, now)):
        return Check("steps", name, 0.0, len(now), len(before), "changes", False, math.inf)
    if len(now) == 0:
        return Check("steps", name, 0.0, 0, 0, "changes", True)
    speeds = np.abs(generated.velocities).max(axis=1)
    stood = speeds[before] <= _STANDING * speeds.max()
    shares = (np.abs(trajectory.velocities[now]) / robot.velocity).max(axis=1)
    passed = not np.any(stood & (shares > _STANDING))
    moving = passed and not stood.all()
    worst = int(np.argmax(np.where(stood, 0.0, shares) if moving else np.where(stood, shares, 0.0)))
    limit, unit = (math.nan, "of the velocity limit, moving") if moving else (_STANDING, "of the velocity limit")
    at, slower = float(trajectory.times[now[worst]]), 1.0 if passed else math.inf
    return Check("steps", name, at, float(shares[worst]), limit, unit, passed, slower)


def _changes(values: Array) -> NDArray[np.intp]:
    """Indices of the samples from which another value holds."""
    return np.flatnonzero(np.diff(values)) + 1


def _order(values: Array, changes: NDArray[np.intp]) -> Array:
    return values[np.concatenate(([0], changes))]

"""An arm: its joints, their limits, its kinematics and its shape."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import SpecificationError
from kineme.validation import Array

_ROUNDING = 1e-6  # so far outside a limit a joint still counts as at it [rad, m]


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """An arm, made by `load`. Arrays have one entry for each of its n joints between the root and the tip.

    Attributes
    ----------
    name : str
    joints : tuple of str
    units : tuple of str
        "rad", or "m" of joints that slide.
    tip : str
        The frame that follows the movement.
    lower, upper : ndarray of shape (n,)
        Limits of position [rad, m].
    velocity, acceleration : ndarray of shape (n,)
        Limits, per second and per second squared.
    effort : ndarray of shape (n,)
        Largest torque or force; nan where it is not known.
    rest : ndarray of shape (n,)
        The posture from which movements are approached.
    assumed : tuple of str
        What the file does not say and what is taken instead, one sentence each.
    source : Path
        The URDF file.
    model, geometry : pinocchio.Model, pinocchio.GeometryModel
        Of these joints alone; all others are locked.
    """

    name: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    tip: str
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    effort: Array
    rest: Array
    assumed: tuple[str, ...]
    source: Path
    model: Any
    geometry: Any

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joints)

    def __repr__(self) -> str:
        return f"Robot({self.name!r}: {self.n_joints} joints, tip {self.tip!r})"


def check_robot(robot: object) -> None:
    """Refuse what is not an arm.

    Raises SpecificationError: something else than a `Robot`, as its name.
    """
    if not isinstance(robot, Robot):
        raise SpecificationError(f"expected a robot, as of kineme.robots.load('panda'), got {robot!r:.80}")


def check_start(robot: Robot, q: Array) -> None:
    """Refuse joint positions (n,) outside the limits, where a movement is to start.

    Raises SpecificationError: the first such joint, with its limits.
    """
    inside = (q >= robot.lower - _ROUNDING) & (q <= robot.upper + _ROUNDING)
    if not inside.all():
        i = int(np.argmin(inside))
        raise SpecificationError(
            f"expected {robot.joints[i]} to start within [{robot.lower[i]:.4g}, {robot.upper[i]:.4g}], got {q[i]:.4g}"
        )

"""A movement on an arm: what is sent, what the tip follows, and the checks of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kineme.robots.checks.check import Preflight
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot

_LEAST_CHANGE = 0.005  # of a change of the duration, which is said to three digits


@dataclass(frozen=True, eq=False, repr=False)
class RobotMovement:
    """What `move` made.

    Attributes
    ----------
    robot : Robot
    trajectory : JointTrajectory
        What is sent to the arm: the approach from the posture where it stands, then the movement.
    path : TaskPath or None
        What the tip follows, at the samples of the movement; None of a movement of the joints.
    preflight : Preflight
        All checks of `trajectory`.
    begins : float
        When the approach is over and the movement begins [s].
    factor : float
        How many times as long the movement takes as it was generated.
    """

    robot: Robot
    trajectory: JointTrajectory
    path: TaskPath | None
    preflight: Preflight
    begins: float
    factor: float

    @property
    def first(self) -> int:
        """Number of the sample of `trajectory` at which the movement begins."""
        return int(np.searchsorted(self.trajectory.times, self.begins - 1e-9))

    def __repr__(self) -> str:
        return f"RobotMovement({self.robot.name!r}, {duration_in_words(self)})"


def duration_in_words(made: RobotMovement) -> str:
    """How long it takes, with how much of that is approach, and how many times as long as generated, if it is."""
    slower = f", {made.factor:.3g} times as long as generated" if abs(made.factor - 1) > _LEAST_CHANGE else ""
    return f"{made.trajectory.duration:.2f} s, of which {made.begins:.2f} s of approach{slower}"

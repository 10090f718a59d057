"""What an arm under live control does in a step."""

from __future__ import annotations

from enum import Flag, auto
from typing import NamedTuple

from kineme.primitives.control.state import State
from kineme.validation import Array


class ArmStatus(Flag):
    """Whether an arm follows its movement, and what holds it back; members combine. ``ArmStatus(0)``: it follows.

    The limits are those that bound some joint in this step, named while the arm lags. Limits of position, velocity and
    acceleration are kept; a torque is reported and not changed.
    """

    LAGS = auto()
    POSITION_LIMIT = auto()
    VELOCITY_LIMIT = auto()
    ACCELERATION_LIMIT = auto()
    TORQUE_LIMIT = auto()

    @property
    def messages(self) -> tuple[str, ...]:
        """One sentence for each member that is set."""
        return tuple(MESSAGES[member] for member in self)


MESSAGES = {
    ArmStatus.LAGS: "the tip is more than 1 mm or 1 degree from where the movement is",
    ArmStatus.POSITION_LIMIT: "a joint brakes before its stop, or stands at it",
    ArmStatus.VELOCITY_LIMIT: "a joint moves as fast as it may",
    ArmStatus.ACCELERATION_LIMIT: "a joint accelerates or brakes as hard as it may",
    ArmStatus.TORQUE_LIMIT: "a joint would need more torque than it has; the step was not changed",
}


class ArmState(NamedTuple):
    """An arm after one step of live control.

    Attributes
    ----------
    joints : ndarray of shape (n,)
        What to send now [rad, m].
    velocities : ndarray of shape (n,)
        Of the joints during this step, per second: constant in it.
    accelerations : ndarray of shape (n,)
        Change of the velocities since the last step, per second squared.
    torques : ndarray of shape (n,)
        What that takes by the model [Nm, N], without friction and load; nan where it knows no masses.
    distance : float
        Of the tip from where the movement is [m]: above 0 where limits of the joints hold it back.
    status : ArmStatus
        Whether the arm follows, and which limits hold it back.
    movement : State
        Of the movement; see `kineme.control.State`.
    """

    joints: Array
    velocities: Array
    accelerations: Array
    torques: Array
    distance: float
    status: ArmStatus
    movement: State

"""Answer of a controller after each step: where the movement is, and what there is to know about the step."""

from __future__ import annotations

from enum import Flag, auto
from typing import NamedTuple

from kineme.validation import Array


class Status(Flag):
    """Events of a step; members combine. Nothing here is an exception: the motion went on."""

    MOVING = auto()
    SETTLED = auto()
    PAUSED = auto()
    MEASUREMENT_REJECTED = auto()
    GOAL_REJECTED = auto()
    TEMPO_REJECTED = auto()
    DT_REJECTED = auto()
    COUPLING_REJECTED = auto()
    OBSTACLES_REJECTED = auto()
    VELOCITY_LIMIT = auto()
    ACCELERATION_LIMIT = auto()
    STATE_KEPT = auto()
    AMPLITUDE_REJECTED = auto()
    PERIOD_REJECTED = auto()
    VIA_POINT_MISSED = auto()

    @property
    def messages(self) -> tuple[str, ...]:
        """One sentence for each member that is set."""
        return tuple(MESSAGES[member] for member in self)

    @property
    def rejected(self) -> bool:
        """True if something that was passed to the step could not be used."""
        return bool(self & REJECTED)


MESSAGES = {
    Status.MOVING: "the movement is under way",
    Status.SETTLED: "the movement has ended and rests at its goal",
    Status.PAUSED: "tempo is 0, or the tracking error holds the phase: position and phase stand still",
    Status.MEASUREMENT_REJECTED: (
        "expected the measured position and velocity to be d finite numbers; what was not is left out"
    ),
    Status.GOAL_REJECTED: "expected a goal of d finite numbers that the formulation can reach; the last good one stays",
    Status.TEMPO_REJECTED: "expected a tempo of 0 or more, at most one duration per step; the last good tempo stays",
    Status.DT_REJECTED: "expected dt above 0 and at most one duration per step; the controller's own dt was used",
    Status.COUPLING_REJECTED: "expected a coupling of d finite accelerations; none was applied",
    Status.OBSTACLES_REJECTED: (
        "expected obstacles as finite (m, d) positions and velocities, d of at least 2; the last good obstacles stay"
    ),
    Status.VELOCITY_LIMIT: "the velocity is above its limit; it was not changed",
    Status.ACCELERATION_LIMIT: "the acceleration is above its limit; it was not changed",
    Status.STATE_KEPT: "the step led out of the range of numbers; the last good state was kept",
    Status.AMPLITUDE_REJECTED: "expected the amplitude as a finite number; the last good one stays",
    Status.PERIOD_REJECTED: "expected the period in seconds, above 0 and not too short for dt; the last good one stays",
    Status.VIA_POINT_MISSED: (
        "the movement passed a via point farther away than 1 % of its extent; via_missed says how far"
    ),
}

REJECTED = (
    Status.MEASUREMENT_REJECTED
    | Status.GOAL_REJECTED
    | Status.TEMPO_REJECTED
    | Status.DT_REJECTED
    | Status.COUPLING_REJECTED
    | Status.OBSTACLES_REJECTED
    | Status.AMPLITUDE_REJECTED
    | Status.PERIOD_REJECTED
)


class State(NamedTuple):
    """A movement at one moment. The arrays are the caller's own: the controller keeps no reference to them.

    Attributes
    ----------
    time : float
        Since the start [s].
    progress : float
        The phase as normalized time u: 0 at the start, 1 where the demonstration ended, more while settling; of a
        rhythm the periods since the start.
    position, velocity, acceleration : ndarray of shape (d,)
        In the unit of the demonstration, per second and per second squared.
    goal : ndarray of shape (d,)
        The goal in force, of a rhythm the baseline; on the way to a new one where the controller filters goals.
    via_missed : float
        Distance from the via point whose time passed in this step, the largest of several; 0 where none did. Of poses
        that of the positions.
    status : Status
    """

    time: float
    progress: float
    position: Array
    velocity: Array
    acceleration: Array
    goal: Array
    via_missed: float
    status: Status

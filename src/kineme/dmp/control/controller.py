"""One movement under live control, whatever kind of primitive it comes from."""

from __future__ import annotations

import math
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.control.plan import (
    SHORTEST,
    Influences,
    MovingGoal,
    ObstacleAvoidance,
    Options,
    Plan,
    State,
    Status,
    numbers,
    passed,
)
from kineme.dmp.control.stepping import Advance, stepper
from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channels
from kineme.validation import Array, check_number

S = TypeVar("S", bound=State)

_LARGEST = 1e150

_NOTHING = Status(0)
_STANDSTILL = 1e-30  # durations; a step as short as this is none


class Controller(Generic[S]):
    """Moves one primitive step by step, and bends to what happens meanwhile.

    Made by ``controller`` of `Primitives`, `RhythmicPrimitives` and `PosePrimitives`. A step carries the equation of
    the movement over ``du = tempo dt / tau`` exactly: undisturbed, positions, velocities and accelerations are those of
    its rollout, at any dt. What is passed to a step is held over it: goal and coupling as they are, obstacles at rest
    or with their velocities (second order in dt).

    Attributes
    ----------
    state : State
        After the last step; at first the start.
    channels : tuple of Channel or None
        Of the columns of `state`, where they are known.

    Notes
    -----
    Its twin, compiled unless `KINEME_COMPILED=never`, is warmed up when it is made. It belongs to one thread.
    Pickled or copied, it goes on from where it is.
    """

    state: S

    def __init__(self, plan: Plan, dt: float, options: Options, channels: Channels | None = None) -> None:
        if not isinstance(plan, Plan):
            raise SpecificationError(
                f"expected the plan of one movement, got {type(plan).__name__}; write primitives[0].controller(dt)"
            )
        check_number("dt", dt, above=0.0)
        if not SHORTEST * plan.duration <= dt <= plan.longest_step * plan.duration:
            most = "the duration," if plan.longest_step == 1.0 else f"{plan.longest_step:g} periods of"
            raise SpecificationError(f"expected dt of at most {most} {plan.duration:g} s, got {dt!r} s")
        self.dt, self.options, self.channels = float(dt), options, channels
        self._plan, self._n_dims, self._origin = plan, plan.n_dims, plan.origin
        self._set_tau(plan.duration)
        self._limits = Limits(
            _limit("velocity_limit", options.velocity_limit, self._n_dims),
            _limit("acceleration_limit", options.acceleration_limit, self._n_dims),
        )
        self._limited = any(limit is not None for limit in self._limits)
        self._settle = float(options.settle or plan.settle)
        self._advance = self._stepper()
        self._zeros, self._nowhere = np.zeros(self._n_dims), np.zeros((0, plan.n_positions))
        self.reset()

    def _stepper(self) -> Advance:
        return stepper(self._plan, self.options.avoidance or ObstacleAvoidance())

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the compiled code, which every process has of its own."""
        return {name: value for name, value in vars(self).items() if name != "_advance"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._advance = self._stepper()

    def reset(self) -> S:
        """Back to the start, with the first goal; returns the state there."""
        plan = self._plan
        self._goal = MovingGoal(plan, plan.goal, self.options.goal_filter)
        self._clock = Clock(plan.begin, plan.periodic)
        self._set_tau(plan.duration)
        self._tempo, self._rate, self._slowing = 1.0, 1.0 / self._tau, 0.0
        self._obstacles = self._obstacle_velocities = self._nowhere
        self._events, self._via_missed = _NOTHING, 0.0
        influences = Influences(*self._follow(0.0), self._zeros, self._zeros, self._nowhere, self._nowhere)
        self._motion = self._advance(plan.state, plan.begin, 0.0, influences)  # x - origin, dx/du, x''
        self.state = self._report(*self._derivatives())
        return self.state

    def step(  # noqa: PLR0913 - what can happen, a parameter each
        self,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        tempo: float = 1.0,
        coupling: ArrayLike | None = None,
        obstacles: ArrayLike | None = None,
        *,
        goal_velocity: ArrayLike | None = None,
        obstacle_velocities: ArrayLike | None = None,
        dt: float | None = None,
    ) -> S:
        """Move on by dt. Never raises: what cannot be used is left out, and the status says so.

        Parameters
        ----------
        position, velocity : array_like of shape (d,), optional
            Measured now, at the time of `state`; see `feedback`. A velocity is read at the tempo of the last step. With
            feedback="phase", no position does not slow the phase, and one that cannot be used slows it like the last.
        goal : array_like of shape (d,), optional
            A new goal, for this step and all later ones: where it is now.
        goal_velocity : array_like of shape (d,), optional
            Velocity of the goal, per second, which then moves on by itself, until the next goal. It is followed without
            a lag; without a velocity, what moves at v is trailed by ``(D / K) tau v``, that is 0.2 tau v.
        tempo : float, default 1.0
            Speed of the phase during this step. The path does not depend on it; velocities are in proportion to it, so
            change it gradually. 0 is a pause.
        coupling : array_like of shape (d,), optional
            External acceleration during this step, per second squared.
        obstacles, obstacle_velocities : array_like of shape (m, d), optional
            Where obstacles are now, and their velocities per second; by default at rest. Without, there are none.
        dt : float, optional
            Time of this step [s].
        """
        wanted = read_number(tempo)
        if wanted >= 0.0 and wanted * self.dt <= self._longest:
            self._tempo = wanted
        else:
            self._events |= Status.TEMPO_REJECTED
        length = self.dt if dt is None else read_number(dt)
        if dt is not None and not (SHORTEST * self._tau <= length <= self._longest >= length * self._tempo):
            self._events |= Status.DT_REJECTED
            length = self.dt
        last = self._motion
        self._slowing = self._slowing if self.options.phase_stopping is not None and position is not None else 0.0
        if position is not None or velocity is not None:
            self._measure(position, velocity)
        if goal is not None or goal_velocity is not None:
            self._aim(goal, goal_velocity)
        if obstacles is None and obstacle_velocities is None:
            self._obstacles = self._obstacle_velocities = self._nowhere
        elif (points := read_points(obstacles, obstacle_velocities, self._plan.n_positions)) is None:
            self._events |= Status.OBSTACLES_REJECTED
        else:
            self._obstacles, self._obstacle_velocities = points[0] - self._origin[: self._plan.n_positions], points[1]
        push = self._zeros if coupling is None else self._read_rates(coupling, self._motion[0])
        if push is None:
            self._events |= Status.COUPLING_REJECTED
            push = self._zeros
        velocity_before = self._derivatives()[0] if self._limited else self._zeros
        self._rate = self._tempo / (self._tau * (1.0 + self._slowing))
        self._move(length, push, last)
        derivatives = self._derivatives()
        if self._limited:
            self._events |= self._limits.exceeded(velocity_before, *derivatives, length)
        self.state = self._report(*derivatives)
        self._events = _NOTHING
        return self.state

    def _set_tau(self, tau: float) -> None:
        """The duration of u = 1, and with it the longest step."""
        self._tau, self._longest = tau, tau * self._plan.longest_step

    def _measure(self, position: Any, velocity: Any) -> None:
        """Go on from what was measured, or let its distance slow the phase."""
        x = None if position is None else self._read_place(position, self._motion[0])
        v = None if velocity is None else self._read_rates(velocity, self._motion[0] if x is None else x)
        if (x is None and position is not None) or (v is None and velocity is not None):
            self._events |= Status.MEASUREMENT_REJECTED
        if self.options.phase_stopping is not None:
            if x is not None:
                error = x - self._motion[0]
                self._slowing = float(self.options.phase_stopping * error.dot(error))
            return
        motion = self._motion.copy()
        if x is not None:
            motion[0] = x
        if v is not None and self._rate > 0:
            motion[1] = v / self._rate
        self._motion = motion

    def _read_place(self, value: Any, near: Array) -> Array | None:
        """Return a place (d,) relative to the origin, of several that are one the nearest; None if it is none."""
        place = read_vector(value, self._n_dims)
        return None if place is None else place - self._origin

    def _read_rates(self, value: Any, place: Array) -> Array | None:
        """Return rates (d,) at a place relative to the origin, or None where they cannot be used."""
        return read_vector(value, self._n_dims)

    def _aim(self, goal: Any, velocity: Any = None) -> None:
        """Set a goal, or let the one in force move; what cannot be used of one of them spoils both."""
        target = self._goal.target if goal is None else self._read_place(goal, self._goal.target)
        moving = None if velocity is None else self._read_rates(velocity, self._goal.target)
        unread = moving is None and velocity is not None
        remaining = (1.0 - self._clock.u) / (self._rate or 1.0 / self._tau)  # below 0 after the end
        if unread or target is None or not self._goal.aim(target, moving, remaining):
            self._events |= Status.GOAL_REJECTED

    def _move(self, dt: float, push: Array, last: Array) -> None:
        """Advance by one step; if that leads out of the range of numbers, stay with `last`."""
        goal, ratio = self._follow(dt)
        self._via_missed = 0.0
        goal_velocity = self._goal.velocity
        self._clock.add_time(dt)
        du = self._rate * dt
        if du <= _STANDSTILL:
            self._rate = 0.0
            return
        if push is not self._zeros:
            push = push / (self._rate * self._rate)
        velocities = self._obstacle_velocities
        if len(velocities):
            velocities = velocities / self._rate
        goal_rate = self._zeros if goal_velocity is None else goal_velocity / self._rate
        goal = goal if goal_velocity is None else self._goal.ahead(goal, goal_rate)
        influences = Influences(goal, ratio, goal_rate, push, self._obstacles, velocities)
        begin = self._clock.u
        motion = self._advance(self._motion[:2], begin, du, influences)
        if self._usable(motion):
            self._clock.add_phase(du)
            if self._plan.via is not None:
                for ahead, point in passed(self._plan.via, begin, self._clock.u, du, self._plan.periodic):
                    at = self._advance(self._motion[:2], begin, ahead, influences)[0, : len(point)]
                    self._via_missed = max(self._via_missed, float(np.sqrt(np.nansum((at - point) ** 2))))
                if not self._via_missed <= self._plan.via.tolerance:
                    self._events |= Status.VIA_POINT_MISSED
            self._motion = motion
        else:
            self._motion = last
            self._events |= Status.STATE_KEPT

    def _usable(self, motion: Array) -> bool:
        """Tell whether the movement can go on from there."""
        return is_usable(motion)

    def _follow(self, dt: float) -> tuple[Array, Array]:
        """Goal and ratio that act during dt."""
        return self._goal.follow(dt)

    def _derivatives(self) -> tuple[Array, Array]:
        """Velocity and acceleration in time, as the state reports them."""
        return self._motion[1] * self._rate, self._motion[2] * (self._rate * self._rate)

    def _report(self, velocity: Array, acceleration: Array) -> Any:
        x, clock = self._motion[0], self._clock
        status = Status.MOVING
        if self._rate == 0.0:
            status = Status.PAUSED
        elif not self._plan.periodic and clock.u >= 1.0:
            distance = np.abs(x - self._goal.target).max()
            if max(distance, np.abs(self._motion[1]).max()) <= self._settle:
                status = Status.SETTLED
        status = status if self._events is _NOTHING else status | self._events
        place, aim = self._origin + x, self._origin + self._goal.now
        return State(clock.time, clock.progress, place, velocity, acceleration, aim, self._via_missed, status)


class RunningSum:
    """Neumaier's compensated sum (ZAMM 54, 1974): what rounding loses is added back."""

    __slots__ = ("_lost", "_sum")

    def __init__(self, start: float = 0.0) -> None:
        self._sum, self._lost = start, 0.0

    def add(self, step: float) -> None:
        """Add a step of 0 or more."""
        total = self._sum + step
        self._lost += (self._sum - total) + step if self._sum >= step else (step - total) + self._sum
        self._sum = total

    def take_turns(self) -> int:
        """Subtract the integer part, which rounds nothing, and return it."""
        turns = math.floor(self.value)
        self._sum -= turns
        return turns

    @property
    def value(self) -> float:
        """The sum."""
        return self._sum + self._lost


class Clock:
    """Seconds and phase since the start; the phase `u` of a rhythm stays below 1, so that it stays exact."""

    __slots__ = ("_begin", "_periodic", "_phase", "_seconds", "_turns", "progress", "time", "u")

    def __init__(self, begin: float, periodic: bool) -> None:
        self._seconds, self._phase = RunningSum(), RunningSum(begin)
        self._begin, self._periodic, self._turns = begin, periodic, 0
        self.time, self.u, self.progress = 0.0, begin, 0.0

    def add_time(self, dt: float) -> None:
        """Let dt [s] pass."""
        self._seconds.add(dt)
        self.time = self._seconds.value

    def add_phase(self, du: float) -> None:
        """Let the phase go on by du."""
        self._phase.add(du)
        self.u = self.progress = self._phase.value
        if self._periodic:
            if self.u >= 1.0:
                self._turns += self._phase.take_turns()
                self.u = self._phase.value
            self.progress = self._turns + self.u - self._begin


class Limits(NamedTuple):
    """Largest velocity and acceleration (d,) of each component, or None where there is no limit."""

    velocity: Array | None
    acceleration: Array | None

    def exceeded(self, before: Array, velocity: Array, acceleration: Array, dt: float) -> Status:
        """Status of the limits that a step of dt from the velocity `before` exceeds, by the mean change over it too."""
        events = _NOTHING
        if self.velocity is not None and (np.abs(velocity) > self.velocity).any():
            events |= Status.VELOCITY_LIMIT
        if self.acceleration is not None:
            largest = np.maximum(np.abs(acceleration), np.abs(velocity - before) / dt)
            if (largest > self.acceleration).any():
                events |= Status.ACCELERATION_LIMIT
        return events


def _limit(name: str, value: ArrayLike | None, n_dims: int) -> Array | None:
    """A limit as positive (d,), from a number or one per dimension."""
    if value is None:
        return None
    array = numbers(name, value)
    if array.shape not in ((), (n_dims,)) or not (array > 0).all():
        raise SpecificationError(f"expected {name} to be a number above 0, or {n_dims} of them, got {value!r}")
    return np.broadcast_to(array, n_dims)


def read_vector(value: Any, n_dims: int) -> Array | None:
    """`value` as (d,) finite float64, or None; a number serves one dimension."""
    array = _read_array(value)
    if array is not None and array.ndim == 0:
        array = array[None]
    return array if array is not None and array.shape == (n_dims,) else None


def _read_rows(value: Any, n_dims: int) -> Array | None:
    """`value` (m, d), or (d,) for one, as contiguous (m, d) finite float64, or None."""
    array = _read_array(value)
    if array is None or array.ndim not in (1, 2):
        return None
    rows = np.atleast_2d(array) if array.size else np.zeros((0, n_dims))
    return np.ascontiguousarray(rows) if rows.shape[1] == n_dims else None


def read_points(positions: Any, velocities: Any, n_dims: int) -> tuple[Array, Array] | None:
    """Points (m, d) and their velocities, at rest where there are none; None unless d is at least 2."""
    x = _read_rows(positions, n_dims)
    v = _read_rows(velocities, n_dims) if velocities is not None or x is None else np.zeros_like(x)
    if x is None or v is None or x.shape != v.shape or n_dims < 2:
        return None
    return x, v


def read_number(value: Any) -> float:
    """`value` as a float; NaN for what is none."""
    try:
        return float(value)
    except Exception:
        return math.nan


def is_usable(array: Array) -> bool:
    """Tell whether all numbers are finite, and so far from overflow that their squares are finite too."""
    return math.hypot(*array.ravel().tolist()) < _LARGEST  # for a few numbers faster than any of NumPy's reductions


def _read_array(value: Any) -> Array | None:
    try:
        array = np.asarray(value, dtype=np.float64)
    except Exception:  # whatever a driver hands over, the motion goes on
        return None
    return array if is_usable(array) else None

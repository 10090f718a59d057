"""One primitive under live control."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.primitives.control import inputs
from kineme.primitives.control.moving_goal import MovingGoal
from kineme.primitives.control.options import limit, one_movement, options_from
from kineme.primitives.control.plan import Influences, Plan
from kineme.primitives.control.running_sum import RunningSum
from kineme.primitives.control.state import State, Status
from kineme.primitives.control.stepping import stepper
from kineme.primitives.discrete.primitives import Primitives
from kineme.validation import Array, check_number

_SETTLED = 1e-3  # of the demonstration's largest extent
_NOTHING = Status(0)
_SHORTEST = 1e-12  # durations; shorter steps are lost in rounding
_STANDSTILL = 1e-30  # durations; a step as short as this is none


class Controller:
    """Moves one primitive step by step, and bends to what happens meanwhile; see `Primitives.controller`.

    A step carries the equation of the formulation over ``du = tempo dt / tau`` exactly: undisturbed, positions,
    velocities and accelerations are those of `Primitives.rollout`, at any dt. What is passed to a step is held over
    it: goal and coupling as they are, obstacles at rest or with their velocities (second order in dt).

    Parameters
    ----------
    primitives : Primitives
        One, as in ``primitives[0]``.
    dt : float
        Time of a step [s], at most the duration.
    start, goal, duration, velocity
        As in `Primitives.rollout`, for one movement.
    feedback : {"state", "phase"}, default "state"
        What a measured position and velocity do. "state": the movement goes on from there. "phase": they do not touch
        the state; the distance between measured and expected position slows the phase.
    phase_stopping : float, optional
        With feedback="phase": a in ``du/dt = tempo / (tau (1 + a |x_measured - x|^2))``, per squared unit.
    goal_filter : float, optional
        Time constant [s] with which the goal in force approaches a new one; by default it jumps. Over a step its mean
        acts (second order in dt).
    velocity_limit, acceleration_limit : float or array_like of shape (d,), optional
        Reported when exceeded, by `Status.VELOCITY_LIMIT` and `Status.ACCELERATION_LIMIT`; nothing is clamped. The
        acceleration counts at the end of the step and as the velocity's mean change over it.
    avoidance : ObstacleAvoidance, optional
        How to steer around obstacles.
    settle : float, optional
        Distance to the goal, in each dimension, and change per duration within which the movement has settled; by
        default 0.1 % of the demonstration's largest extent.

    Attributes
    ----------
    state : State
        After the last step; at first the start.

    Raises
    ------
    SpecificationError
        More than one primitive, an option out of its range, a start, goal or velocity of the wrong shape.
    DegenerateMovementError
        The original formulation asked to move a closed or flat demonstration to another goal.

    Notes
    -----
    Phase stopping: A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal, "Dynamical Movement Primitives:
    Learning Attractor Models for Motor Behaviors", Neural Computation 25(2), 2013. As there, tau grows in all
    equations, so the path stays the same.

    The twin, compiled unless `KINEME_COMPILED=never`, is chosen and warmed up when the controller is made. A controller
    belongs to one thread.
    """

    def __init__(
        self,
        primitives: Primitives,
        dt: float,
        *,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        velocity: ArrayLike | None = None,
        **options: Any,
    ) -> None:
        self.options = options_from(options)
        movement = one_movement(primitives, start, goal, duration, velocity)
        self._n_dims, self._tau = primitives.n_dims, float(movement.durations[0])
        check_number("dt", dt, above=0.0)
        self.dt = float(dt)
        if not self._fits(self.dt):
            raise SpecificationError(f"expected dt of at most the duration, {self._tau:g} s, got {dt!r} s")
        self._velocity_limit = limit("velocity_limit", self.options.velocity_limit, self._n_dims)
        self._acceleration_limit = limit("acceleration_limit", self.options.acceleration_limit, self._n_dims)
        self._limited = self._velocity_limit is not None or self._acceleration_limit is not None
        self._settle = float(self.options.settle or _SETTLED * primitives.extents.max())
        self._plan = Plan(primitives, self.options.avoidance)
        self._advance = stepper(self._plan)
        self._x0 = movement.starts[0].copy()
        self._first = (movement.goals[0] - self._x0, movement.velocities_at_start[0] * self._tau)
        self._zeros, self._nowhere = np.zeros(self._n_dims), np.zeros((0, self._n_dims))
        self.reset()

    def reset(self) -> State:
        """Back to the start, with the first goal; returns the state there."""
        target, slope = self._first
        self._goal = MovingGoal(self._plan, target, self.options.goal_filter)
        self._time, self._u = RunningSum(), RunningSum()
        self._tempo, self._rate, self._slowing = 1.0, 1.0 / self._tau, 0.0
        self._obstacles = self._obstacle_velocities = self._nowhere
        self._events = _NOTHING
        influences = Influences(*self._goal.follow(0.0), self._zeros, self._nowhere, self._nowhere)
        self._motion = self._advance(np.vstack((self._zeros, slope)), 0.0, 0.0, influences)  # x - x0, dx/du, x''
        self.state = self._report()
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
        obstacle_velocities: ArrayLike | None = None,
        dt: float | None = None,
    ) -> State:
        """Move on by dt. Never raises: what cannot be used is left out, and the status says so.

        Parameters
        ----------
        position, velocity : array_like of shape (d,), optional
            Measured now, at the time of `state`; see `feedback`. A velocity is read at the tempo of the last step. With
            feedback="phase", no position does not slow the phase, and one that cannot be used slows it like the last.
        goal : array_like of shape (d,), optional
            A new goal, for this step and all later ones.
        tempo : float, default 1.0
            Speed of the phase during this step. The path does not depend on it; velocities are in proportion to it, so
            change it gradually. 0 is a pause.
        coupling : array_like of shape (d,), optional
            External acceleration during this step, per second squared.
        obstacles, obstacle_velocities : array_like of shape (m, d), optional
            Where obstacles are now, and their velocities per second; by default at rest. Without, there are none.
        dt : float, optional
            Time of this step [s].

        Returns
        -------
        State
        """
        self._events = _NOTHING
        dt, tempo = self._pace(dt, tempo)
        last = self._motion
        if position is not None or velocity is not None:
            self._measure(position, velocity)
        else:
            self._slowing = 0.0
        if goal is not None:
            self._aim(goal)
        self._sense(obstacles, obstacle_velocities)
        push = self._zeros if coupling is None else self._couple(coupling)
        velocity_before = self._motion[1] * self._rate if self._limited else self._zeros
        self._rate = tempo / (self._tau * (1.0 + self._slowing))
        self._move(dt, push, last)
        if self._limited:
            self._check_limits(velocity_before, dt)
        self.state = self._report()
        return self.state

    def _pace(self, dt: Any, tempo: Any) -> tuple[float, float]:
        """The time and tempo of this step."""
        wanted = inputs.number(tempo)
        if wanted >= 0.0 and wanted * self.dt <= self._tau:
            self._tempo = wanted
        else:
            self._events |= Status.TEMPO_REJECTED
        if dt is None:
            return self.dt, self._tempo
        dt = inputs.number(dt)
        if self._fits(dt) and dt * self._tempo <= self._tau:
            return dt, self._tempo
        self._events |= Status.DT_REJECTED
        return self.dt, self._tempo

    def _fits(self, dt: float) -> bool:
        return _SHORTEST * self._tau <= dt <= self._tau

    def _measure(self, position: Any, velocity: Any) -> None:
        """Go on from what was measured, or let its distance slow the phase."""
        x = None if position is None else inputs.vector(position, self._n_dims)
        v = None if velocity is None else inputs.vector(velocity, self._n_dims)
        if (x is None and position is not None) or (v is None and velocity is not None):
            self._events |= Status.MEASUREMENT_REJECTED
        if self.options.phase_stopping is not None:
            if x is not None:
                error = x - self._x0 - self._motion[0]
                self._slowing = float(self.options.phase_stopping * error.dot(error))
            elif position is None:
                self._slowing = 0.0
            return
        motion = self._motion.copy()
        if x is not None:
            motion[0] = x - self._x0
        if v is not None and self._rate > 0:
            motion[1] = v / self._rate
        self._motion = motion

    def _aim(self, goal: Any) -> None:
        target = inputs.vector(goal, self._n_dims)
        if target is None or not self._goal.aim(target - self._x0):
            self._events |= Status.GOAL_REJECTED

    def _sense(self, obstacles: Any, velocities: Any) -> None:
        """Take over the obstacles, relative to x0; without any there are none."""
        if obstacles is None and velocities is None:
            self._obstacles = self._obstacle_velocities = self._nowhere
            return
        x = inputs.rows(obstacles, self._n_dims)
        v = inputs.rows(velocities, self._n_dims) if velocities is not None or x is None else np.zeros_like(x)
        if x is None or v is None or x.shape != v.shape or self._n_dims < 2:
            self._events |= Status.OBSTACLES_REJECTED
        else:
            self._obstacles, self._obstacle_velocities = x - self._x0, v

    def _couple(self, coupling: Any) -> Array:
        push = inputs.vector(coupling, self._n_dims)
        if push is not None:
            return push
        self._events |= Status.COUPLING_REJECTED
        return self._zeros

    def _move(self, dt: float, push: Array, last: Array) -> None:
        """Advance by one step; if that leads out of the range of numbers, stay with `last`."""
        goal, ratio = self._goal.follow(dt)
        self._time.add(dt)
        du = self._rate * dt
        if du <= _STANDSTILL:
            self._rate = 0.0
            return
        if push is not self._zeros:
            push = push / (self._rate * self._rate)
        velocities = self._obstacle_velocities
        if len(velocities):
            velocities = velocities / self._rate
        influences = Influences(goal, ratio, push, self._obstacles, velocities)
        motion = self._advance(self._motion[:2], self._u.value, du, influences)
        if inputs.usable(motion):
            self._motion = motion
            self._u.add(du)
        else:
            self._motion = last
            self._events |= Status.STATE_KEPT

    def _check_limits(self, velocity_before: Array, dt: float) -> None:
        velocity = self._motion[1] * self._rate
        if self._velocity_limit is not None and (np.abs(velocity) > self._velocity_limit).any():
            self._events |= Status.VELOCITY_LIMIT
        if self._acceleration_limit is not None:
            largest = np.maximum(
                np.abs(self._motion[2]) * (self._rate * self._rate), np.abs(velocity - velocity_before) / dt
            )
            if (largest > self._acceleration_limit).any():
                self._events |= Status.ACCELERATION_LIMIT

    def _report(self) -> State:
        x, slope, bend = self._motion
        rate, u, goal = self._rate, self._u.value, self._goal.now
        status = Status.MOVING
        if rate == 0.0:
            status = Status.PAUSED
        elif u >= 1.0 and self._rests(x - self._goal.target, slope):
            status = Status.SETTLED
        if self._events is not _NOTHING:
            status |= self._events
        return State(self._time.value, u, self._x0 + x, slope * rate, bend * (rate * rate), self._x0 + goal, status)

    def _rests(self, distance: Array, slope: Array) -> bool:
        return bool(max(np.abs(distance).max(), np.abs(slope).max()) <= self._settle)

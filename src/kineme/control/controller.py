"""One primitive under live control."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.control import inputs
from kineme.control.options import Options, limit, wish
from kineme.control.plan import Influences, Plan
from kineme.control.running_sum import RunningSum
from kineme.control.state import State, Status
from kineme.control.stepping import stepper
from kineme.errors import SpecificationError
from kineme.primitives.primitives import Primitives
from kineme.primitives.rollout import rollout
from kineme.validation import Array, check_number

_SETTLED = 1e-3  # of the demonstration's largest extent
_STANDSTILL = 1e-30  # durations; a step as short as this is none
_ARRIVED = 1e-14  # of the new goal's distance when it was set: rounding


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

    The compiled twin is chosen when the controller is made (`KINEME_COMPILED=never` keeps to NumPy), and warmed up. A controller
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
        if len(primitives) != 1:
            raise SpecificationError(
                f"expected one primitive to control, got {len(primitives)}; choose one, as in primitives[0].controller(dt)"
            )
        if duration is not None:
            check_number("duration", duration, above=0.0)
        d = primitives.n_dims
        wishes = (wish("start", start, d), wish("goal", goal, d), duration, wish("velocity", velocity, d))
        movement = rollout(primitives, *wishes)
        self.options = Options(**options)
        self._n_dims, self._tau = d, float(movement.durations[0])
        check_number("dt", dt, above=0.0)
        if dt > self._tau:
            raise SpecificationError(f"expected dt of at most the duration, {self._tau:g} s, got {dt!r}")
        self.dt = float(dt)
        self._velocity_limit = limit("velocity_limit", self.options.velocity_limit, d)
        self._acceleration_limit = limit("acceleration_limit", self.options.acceleration_limit, d)
        settle = self.options.settle
        self._settle = _SETTLED * float(primitives.extents.max()) if settle is None else float(settle)
        self._plan = Plan(primitives, self.options.avoidance)
        self._advance = stepper(self._plan)
        self._x0 = movement.starts[0].copy()
        self._first = (movement.goals[0] - self._x0, movement.velocities_at_start[0] * self._tau)
        self._nothing = np.zeros(d)
        self.reset()

    def reset(self) -> State:
        """Back to the start, with the first goal; returns the state there."""
        goal, slope = self._first
        nothing = np.zeros(self._n_dims)
        self._time, self._u = RunningSum(), RunningSum()
        self._tempo, self._rate, self._error = 1.0, 1.0 / self._tau, 0.0
        self._target, self._ratio = goal, self._plan.ratio(goal)
        self._lag: Array | None = None  # of the goal in force behind the target
        self._obstacles = self._obstacle_velocities = np.zeros((0, self._n_dims))
        self._status = Status.MOVING
        influences = Influences(goal, self._ratio, nothing, self._obstacles, self._obstacles)
        self._motion = self._advance(np.vstack((nothing, slope)), 0.0, 0.0, influences)  # x - x0, dx/du and x''
        self.state = self._report()
        return self.state

    def step(  # noqa: PLR0913, PLR0917 - what can happen, a parameter each
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
            Measured now, at the time of `state`; see `feedback`. A velocity is read at the tempo of the last step.
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
        self._status = Status.MOVING
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            dt, tempo = self._pace(dt, tempo)
            last = self._motion
            self._measure(position, velocity)
            velocity_before = self._motion[1] * self._rate
            if goal is not None:
                self._aim(goal)
            self._sense(obstacles, obstacle_velocities)
            self._rate = tempo / (self._tau * (1.0 + (self.options.phase_stopping or 0.0) * self._error))
            self._time.add(dt)
            self._move(dt, coupling, last)
            self._check_limits(velocity_before, dt)
            self.state = self._report()
        return self.state

    def _pace(self, dt: Any, tempo: Any) -> tuple[float, float]:
        """The time and tempo of this step."""
        wanted = inputs.number(tempo)
        if 0.0 <= wanted and wanted * self.dt <= self._tau:
            self._tempo = wanted
        else:
            self._status |= Status.TEMPO_REJECTED
        if dt is None:
            return self.dt, self._tempo
        dt = inputs.number(dt)
        if 0.0 < dt <= self._tau and dt * self._tempo <= self._tau:
            return dt, self._tempo
        self._status |= Status.DT_REJECTED
        return self.dt, self._tempo

    def _measure(self, position: Any, velocity: Any) -> None:
        """Go on from what was measured, or see how far from it the movement is."""
        x = None if position is None else inputs.vector(position, self._n_dims)
        v = None if velocity is None else inputs.vector(velocity, self._n_dims)
        if (x is None and position is not None) or (v is None and velocity is not None):
            self._status |= Status.MEASUREMENT_REJECTED
        if self.options.feedback == "phase":
            if x is not None:
                difference = x - self._x0 - self._motion[0]
                self._error = float(difference @ difference)
            elif position is None:
                self._error = 0.0
            return
        if x is not None or v is not None:
            self._motion = self._motion.copy()
        if x is not None:
            self._motion[0] = x - self._x0
        if v is not None and self._rate > 0:
            self._motion[1] = v / self._rate

    def _aim(self, goal: Any) -> None:
        """Set the goal to go to, unless it is the same or cannot be reached."""
        target = inputs.vector(goal, self._n_dims)
        if target is None:
            self._status |= Status.GOAL_REJECTED
            return
        target = target - self._x0
        if (target == self._target).all():
            return
        ratio = self._plan.ratio(target)
        if not np.isfinite(ratio).all():
            self._status |= Status.GOAL_REJECTED
            return
        if self.options.goal_filter is not None:
            self._lag = self._target - target + (0.0 if self._lag is None else self._lag)
        self._target, self._ratio = target, ratio

    def _follow(self, dt: float) -> tuple[Array, Array]:
        """The goal that acts during this step, its mean while it moves, and the ratio that belongs to it."""
        if self._lag is None or self.options.goal_filter is None:
            return self._target, self._ratio
        passed = dt / self.options.goal_filter
        mean = self._target + self._lag * (-math.expm1(-passed) / passed if passed > 0 else 1.0)
        self._lag = self._lag * math.exp(-passed)
        if np.abs(self._lag).max() <= _ARRIVED * np.abs(self._target).max():
            self._lag = None
        return mean, self._plan.ratio(mean)

    def _sense(self, obstacles: Any, velocities: Any) -> None:
        """Take over the obstacles, relative to x0; without any there are none."""
        d = self._n_dims
        if obstacles is None and velocities is None:
            if len(self._obstacles):
                self._obstacles = self._obstacle_velocities = np.zeros((0, d))
            return
        x = inputs.rows(obstacles, d)
        v = inputs.rows(velocities, d) if velocities is not None or x is None else np.zeros_like(x)
        if x is None or v is None or x.shape != v.shape or d < 2:
            self._status |= Status.OBSTACLES_REJECTED
        else:
            self._obstacles, self._obstacle_velocities = x - self._x0, v

    def _move(self, dt: float, coupling: Any, last: Array) -> None:
        """Advance by one step; if that leads out of the range of numbers, stay with `last`."""
        goal, ratio = self._follow(dt)
        push = self._nothing
        if coupling is not None:
            given = inputs.vector(coupling, self._n_dims)
            if given is None:
                self._status |= Status.COUPLING_REJECTED
            else:
                push = given / (self._rate * self._rate)
        du = self._rate * dt
        if du <= _STANDSTILL:
            self._rate = 0.0
            self._status = self._status & ~Status.MOVING | Status.PAUSED
            return
        velocities = self._obstacle_velocities / self._rate if len(self._obstacles) else self._obstacle_velocities
        influences = Influences(goal, ratio, push, self._obstacles, velocities)
        motion = self._advance(self._motion[:2], self._u.value, du, influences)
        if math.isfinite(motion.sum()):
            self._motion = motion
            self._u.add(du)
        else:
            self._motion = last
            self._status |= Status.STATE_KEPT

    def _check_limits(self, velocity_before: Array, dt: float) -> None:
        velocity = self._motion[1] * self._rate
        if self._velocity_limit is not None and (np.abs(velocity) > self._velocity_limit).any():
            self._status |= Status.VELOCITY_LIMIT
        if self._acceleration_limit is not None:
            largest = np.maximum(np.abs(self._motion[2]) * self._rate**2, np.abs(velocity - velocity_before) / dt)
            if (largest > self._acceleration_limit).any():
                self._status |= Status.ACCELERATION_LIMIT

    def _report(self) -> State:
        x, slope, bend = self._motion
        rate, u, goal = self._rate, self._u.value, self._target
        if self._lag is not None:
            goal = goal + self._lag
        elif u >= 1.0 and Status.MOVING in self._status:
            if np.abs(x - goal).max() <= self._settle and np.abs(slope).max() <= self._settle:
                self._status = self._status & ~Status.MOVING | Status.SETTLED
        return State(
            self._time.value, u, self._x0 + x, slope * rate, bend * (rate * rate), self._x0 + goal, self._status
        )

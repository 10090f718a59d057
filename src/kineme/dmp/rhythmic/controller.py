"""A limit cycle under live control: what a rhythm has besides what every controlled movement has."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.control.controller import Controller, is_usable, read_number
from kineme.dmp.control.plan import FilteredValue, Options, Plan, State, Status
from kineme.movements.channels.channel import Channels
from kineme.validation import LARGEST_STAMP, SHORTEST_STEP, Array


class RhythmicState(State):
    """A rhythm at one moment: a `State` with three more attributes.

    Attributes
    ----------
    phase : float
        Within the cycle [rad], in [0, 2 pi).
    amplitude : float
        In force; on the way to a new one where the controller filters goals.
    period : float
        In force [s], at tempo 1.
    """

    phase: float
    amplitude: float
    period: float


class RhythmicController(Controller[RhythmicState]):
    """Moves one limit cycle step by step; see `RhythmicPrimitives.controller` and `Controller`.

    The goal is the baseline. After a push, and after a change of baseline, amplitude or period, position and velocity
    go on from where they are, and the movement approaches the new cycle as ``exp(-sqrt(K) t / period)``.
    """

    def __init__(
        self,
        plan: Plan,
        dt: float,
        options: Options,
        learned_amplitude: float,
        gain: float,
        channels: Channels | None = None,
    ) -> None:
        self._learned_amplitude, self._first_gain = learned_amplitude, np.array([gain])
        super().__init__(plan, dt, options, channels)

    def reset(self) -> RhythmicState:
        """Back to the start, with the first baseline, amplitude and period; returns the state there."""
        self._gain = FilteredValue(self._first_gain, self.options.goal_filter)
        return super().reset()

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
        amplitude: float | None = None,
        period: float | None = None,
    ) -> RhythmicState:
        """Move on by dt. Never raises: what cannot be used is left out, and the status says so.

        Parameters
        ----------
        position, velocity, goal, tempo, coupling, obstacles, goal_velocity, obstacle_velocities, dt : optional
            See `Controller.step`; the goal is a new baseline.
        amplitude : float, optional
            A new amplitude, for this step and all later ones.
        period : float, optional
            A new period [s], for this step and all later ones. Unlike `tempo` it does not change the velocity at once:
            the spring acts per period, so the path bends until it is on the limit cycle of the new period.
        """
        if amplitude is not None:
            gain = np.array([read_number(amplitude) / self._learned_amplitude])
            if is_usable(gain):
                self._gain.set(gain)
            else:
                self._events |= Status.AMPLITUDE_REJECTED
        if period is not None:
            new_period = read_number(period)
            if SHORTEST_STEP <= new_period <= LARGEST_STAMP and self.dt <= new_period * self._plan.longest_step:
                motion = self._motion.copy()
                motion[1] *= new_period / self._tau  # the velocity in time stays
                self._motion = motion
                self._rate *= self._tau / new_period
                self._set_tau(new_period)
            else:
                self._events |= Status.PERIOD_REJECTED
        return super().step(
            position, velocity, goal, tempo, coupling, obstacles,
            goal_velocity=goal_velocity, obstacle_velocities=obstacle_velocities, dt=dt,
        )  # fmt: skip

    @property
    def amplitude(self) -> float:
        """The amplitude in force; `step` changes it."""
        return self.state.amplitude

    @property
    def period(self) -> float:
        """The period in force [s]; `step` changes it."""
        return self.state.period

    @property
    def baseline(self) -> Array:
        """The baseline in force; `step` changes it, as the goal."""
        return self.state.goal.copy()

    def _follow(self, dt: float) -> tuple[Array, Array]:
        goal, ratio = super()._follow(dt)
        return goal, ratio * self._gain.mean(dt)

    def _report(self, velocity: Array, acceleration: Array) -> RhythmicState:
        state = RhythmicState(*super()._report(velocity, acceleration))
        state.phase = 2.0 * np.pi * self._clock.u
        state.amplitude = float(self._gain.now[0]) * self._learned_amplitude
        state.period = self._tau
        return state

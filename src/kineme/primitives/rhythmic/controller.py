"""A limit cycle step by step, for what is not known ahead: pushes, and changes of amplitude, baseline and tempo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.primitives.control.inputs import usable
from kineme.primitives.control.state import Status
from kineme.primitives.discrete.response import transition
from kineme.primitives.discrete.rollout import check_durations, per_movement
from kineme.primitives.rhythmic.rhythmic_dmp import RhythmicDMP
from kineme.primitives.rhythmic.rollout import cycle
from kineme.validation import Array, check_number

if TYPE_CHECKING:
    from kineme.primitives.rhythmic.primitives import RhythmicPrimitives

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(4)
_MOST_PERIODS = 1000.0  # in one step: the forcing is followed all the way
_LONGEST_STEP = 0.5  # of the distance between two centers, for one quadrature


class Stepping(NamedTuple):
    """What a step is made of, as long as the periods stay; n_steps of them make one ``dt``."""

    carry: Array  # (n, 2, 2), the state over a step
    impulse: Array  # (n, 4, 2), to the state at the step's end from the forcing at its nodes
    turns: Array  # (n, 5), phase passed at the nodes and at the end [rad]
    n_steps: int


def _stepping(dmp: RhythmicDMP, h: Array) -> Stepping:
    """For steps of h (n,) periods."""
    n_steps = max(1, int(np.ceil(h.max() * dmp.n_basis / _LONGEST_STEP)))
    h = h[:, None] / n_steps
    nodes = 0.5 * h * (_NODES + 1.0)
    # An acceleration at a node reaches the end of the step through the second column.
    impulse = transition(dmp.K, dmp.D, (h - nodes).ravel())[:, :, 1].reshape(*nodes.shape, 2)
    impulse = impulse * (0.5 * h * _NODE_WEIGHTS)[:, :, None]
    return Stepping(transition(dmp.K, dmp.D, h[:, 0]), impulse, 2 * np.pi * np.hstack((nodes, h)), n_steps)


class RhythmicController:
    """Runs n limit cycles of d dimensions, ``dt`` seconds per `step`.

    The spring-damper is carried by its matrix exponential, so no step is too long for it, and the forcing enters by
    Gauss-Legendre quadrature. Between steps every attribute may be set: the acceleration jumps then, position and
    velocity do not, and the movement approaches the new limit cycle as ``e^(-sqrt(K) t / period)`` (critical damping).

    Attributes
    ----------
    positions, velocities : ndarray of shape (n, d)
        The state, velocities per second. Set them to what the robot measures, or to push the movement.
    phases : ndarray of shape (n,)
        [rad], in [0, 2 pi).
    baseline : ndarray of shape (n, d)
    amplitude, period : ndarray of shape (n,)
        A number sets all of them.
    status : kineme.control.Status
        Of the last step: MOVING, and MEASUREMENT_REJECTED where a measurement could not be used.
    """

    def __init__(self, primitives: RhythmicPrimitives, dt: float, phase: ArrayLike = 0.0) -> None:
        check_number("dt", dt, above=0.0)
        self._primitives, self._dt = primitives, float(dt)
        self.status = Status.MOVING
        self.baseline = primitives.baselines
        self.amplitude = primitives.amplitudes
        self.period = primitives.periods
        self._phases: Array = self._numbers(phase, "phase") % (2 * np.pi)
        ratio = np.ones(len(primitives))
        here = [cycle(primitives, ratio, self._phases, np.zeros(1), order)[:, :, 0] for order in (0, 1)]
        self._positions: Array = self._baseline + here[0]
        self._velocities: Array = here[1] / self._period[:, None]

    def step(self, position: Any = None, velocity: Any = None) -> Array:
        """Go on by ``dt``; returns the positions (n, d), a copy. Never raises, whatever a sensor delivers.

        Parameters
        ----------
        position, velocity : array_like of shape (d,) or (n, d), optional
            Measured now, before the step: the movement goes on from there. What cannot be used is left out, and
            `status` says so.
        """
        self.status = Status.MOVING
        self._positions = self._measured(position, self._positions)
        self._velocities = self._measured(velocity, self._velocities)
        carry, impulse, turns, n_steps = self._stepping
        weights = self._primitives.scaled_weights * (self._amplitude / self._primitives.amplitudes)[:, None, None]
        state = np.stack((self._positions - self._baseline, self._velocities * self._period[:, None]), axis=1)
        for _ in range(n_steps):
            design = self._primitives.dmp.basis.design(self._phases[:, None] + turns[:, :-1])  # (n, 4, N)
            forcing = weights @ design.transpose(0, 2, 1)  # (n, d, 4)
            state = carry @ state + (forcing @ impulse).transpose(0, 2, 1)
            self._phases = (self._phases + turns[:, -1]) % (2 * np.pi)
        self._positions = state[:, 0] + self._baseline
        self._velocities = state[:, 1] / self._period[:, None]
        return self.positions

    def _measured(self, value: Any, last: Array) -> Array:
        if value is None:
            return last
        try:
            array = self._vectors(value, "position")
        except Exception:  # whatever a driver hands over, the motion goes on
            array = None
        if array is not None and usable(array):
            return array
        self.status |= Status.MEASUREMENT_REJECTED
        return last

    @property
    def positions(self) -> Array:  # noqa: D102 - documented by the class
        return self._positions.copy()

    @positions.setter
    def positions(self, value: ArrayLike) -> None:
        self._positions = self._vectors(value, "positions")

    @property
    def velocities(self) -> Array:  # noqa: D102
        return self._velocities.copy()

    @velocities.setter
    def velocities(self, value: ArrayLike) -> None:
        self._velocities = self._vectors(value, "velocities")

    @property
    def baseline(self) -> Array:  # noqa: D102
        return self._baseline.copy()

    @baseline.setter
    def baseline(self, value: ArrayLike) -> None:
        self._baseline = self._vectors(value, "baseline")

    @property
    def amplitude(self) -> Array:  # noqa: D102
        return self._amplitude.copy()

    @amplitude.setter
    def amplitude(self, value: ArrayLike) -> None:
        self._amplitude = self._numbers(value, "amplitude")

    @property
    def period(self) -> Array:  # noqa: D102
        return self._period.copy()

    @period.setter
    def period(self, value: ArrayLike) -> None:
        period = self._numbers(value, "period")
        check_durations("period", period)
        if self._dt > _MOST_PERIODS * period.min():
            raise SpecificationError(
                f"expected dt of at most {_MOST_PERIODS:g} periods of {period.min():g} s, got {self._dt:g} s"
            )
        self._period = period
        self._stepping = _stepping(self._primitives.dmp, self._dt / period)

    @property
    def phases(self) -> Array:  # noqa: D102
        return self._phases.copy()

    @phases.setter
    def phases(self, value: ArrayLike) -> None:
        self._phases = self._numbers(value, "phases") % (2 * np.pi)

    def _vectors(self, value: ArrayLike, name: str) -> Array:
        return self._own(per_movement(value, name, self._primitives.n_dims), name, self._primitives.baselines)

    def _numbers(self, value: ArrayLike, name: str) -> Array:
        return self._own(per_movement(value, name, None), name, self._primitives.periods)

    def _own(self, value: Array | None, name: str, like: Array) -> Array:
        if value is None or len(value) not in (1, len(like)):
            got = None if value is None else len(value)
            raise TrajectoryError(f"expected {name} for one or all of the {len(like)} movements, got {got}")
        return np.broadcast_to(value, like.shape).copy()

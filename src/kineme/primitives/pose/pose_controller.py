"""One orientation or pose under live control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.primitives.control.controller import Controller
from kineme.primitives.control.state import State, Status
from kineme.primitives.pose.quaternions import conjugate, normalized, product
from kineme.primitives.pose.rates import angular_acceleration, angular_velocity, rotation_vector_rate
from kineme.primitives.pose.rotation_vectors import exp, log, nearest
from kineme.validation import Array

if TYPE_CHECKING:
    from kineme.primitives.pose.pose_primitives import PosePrimitives


class PoseState(NamedTuple):
    """A movement at one moment; see `kineme.control.State`.

    Attributes
    ----------
    time, progress : float
    pose : ndarray of shape (4,) or (7,)
        As demonstrated: a unit quaternion, for poses after the position.
    velocity, acceleration : ndarray of shape (3,) or (6,)
        Angular in the world frame, for poses after the linear ones.
    goal : ndarray of shape (4,) or (7,)
    status : Status
    """

    time: float
    progress: float
    pose: Array
    velocity: Array
    acceleration: Array
    goal: Array
    status: Status


class PoseController:
    """Moves one pose primitive step by step; see `PosePrimitives.controller`.

    A `Controller` of position and rotation vector, in the chart around the goal that it is made with: undisturbed it is
    the rollout. A goal that turns in flight moves in that chart. A step costs some tenths of a millisecond, most of it
    on the way from rotation vectors to quaternions and angular velocities.

    Attributes
    ----------
    state : PoseState
        After the last step; at first the start.
    """

    def __init__(
        self,
        primitives: PosePrimitives,
        dt: float,
        *,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        velocity: ArrayLike | None = None,
        **options: Any,
    ) -> None:
        starts, goals, references, velocities = primitives.in_tangent(start, goal, velocity)
        if len(starts) != 1:
            raise SpecificationError(
                f"expected one primitive, start and goal to control, got {len(starts)}; choose one: "
                "primitives[0].controller(dt)"
            )
        v = None if velocities is None else velocities[0]
        self._inner = Controller(
            primitives.tangent, dt, start=starts[0], goal=goals[0], duration=duration, velocity=v, **options
        )
        self._reference, self._goal = references[0], goals[0]
        self._n_columns = primitives.n_columns
        self.state = self._as_pose(self._inner.state)

    def step(
        self,
        pose: Any = None,
        velocity: Any = None,
        goal: Any = None,
        tempo: float = 1.0,
        dt: float | None = None,
    ) -> PoseState:
        """Move on by dt. Never raises: what cannot be used is left out, and the status says so.

        Parameters
        ----------
        pose, velocity, goal : array_like, optional
            Measured now, and where to go; in the columns of `PoseState`. Quaternions of either sign.
        tempo, dt : float, optional
            See `Controller.step`.
        """
        now = self._inner.state.position
        x = None if pose is None else self._as_tangent(pose, now)
        v = None if velocity is None else self._as_rates(velocity, now if x is None or np.isnan(x).any() else x)
        g = None if goal is None else self._as_tangent(goal, self._goal)
        state = self._inner.step(position=x, velocity=v, goal=g, tempo=tempo, dt=dt)
        if g is not None and not state.status & Status.GOAL_REJECTED:
            self._goal = g
        self.state = self._as_pose(state)
        return self.state

    def _as_tangent(self, pose: Any, near: Array) -> Array:
        """Position and the rotation vector closest to that of `near`; NaN for what is no pose."""
        try:
            array = np.asarray(pose, dtype=np.float64)
            if array.shape != (self._n_columns,):
                return np.full_like(near, np.nan)
            p = log(product(normalized(array[-4:]), conjugate(self._reference)))
            return np.concatenate((array[:-4], nearest(p, near[-3:])))
        except Exception:  # whatever a driver hands over, the motion goes on
            return np.full_like(near, np.nan)

    def _as_rates(self, velocity: Any, x: Array) -> Array:
        try:
            array = np.asarray(velocity, dtype=np.float64)
            if array.shape != x.shape:
                return np.full_like(x, np.nan)
            return np.concatenate((array[:-3], rotation_vector_rate(x[-3:], array[-3:])))
        except Exception:
            return np.full_like(x, np.nan)

    def _as_pose(self, state: State) -> PoseState:
        p, rate, bend = (array[-3:] for array in (state.position, state.velocity, state.acceleration))
        velocity = np.concatenate((state.velocity[:-3], angular_velocity(p, rate)))
        acceleration = np.concatenate((state.acceleration[:-3], angular_acceleration(p, rate, bend)))
        goal = self._placed(state.goal)
        return PoseState(
            state.time, state.progress, self._placed(state.position), velocity, acceleration, goal, state.status
        )

    def _placed(self, x: Array) -> Array:
        return np.concatenate((x[:-3], product(exp(x[-3:]), self._reference)))

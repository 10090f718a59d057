"""One orientation or pose under live control: what a pose has besides what every controlled movement has."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from kineme.dmp.control.controller import Controller, is_usable, read_vector
from kineme.dmp.control.plan import Options, Plan, State, Status
from kineme.dmp.pose.tangent import Components, acceleration_components, rate_components, velocity_components
from kineme.movements.channels.channel import Channels
from kineme.movements.rotations import conjugate, exp_one, log_one, product_components
from kineme.validation import Array

_MOST_TURNED = 1e6  # rad; quaternions of longer rotation vectors are rounding errors
_FASTEST = 1e50  # rates of rotation vectors; the products in angular accelerations are finite


class PoseState(State):
    """A pose at one moment: a `State` in the columns of the demonstrations.

    ``position`` and ``goal`` have shape (4,), a unit quaternion, or (7,), the position before it; ``velocity`` and
    ``acceleration`` have shape (3,), angular in the world frame, or (6,), the linear ones before them. Of p positions
    and angles and k orientations they have shapes (p + 4 k,) and (p + 3 k,), the orientations last.
    """

    __slots__ = ()

    @property
    def pose(self) -> Array:
        """The same as `position`."""
        return self.position

    @property
    def orientation(self) -> Array:
        """The unit quaternion (4,); of k orientations (4 k,)."""
        return self.position[-4 * (len(self.position) - len(self.velocity)) :]


class PoseController(Controller[PoseState]):
    """Moves one pose primitive step by step; see `PosePrimitives.controller` and `Controller`.

    It steps through position and rotation vector, in the chart around the goal that it is made with: undisturbed it is
    the rollout. A goal that turns in flight moves in that chart. Where a step would turn further than a
    million radians, the orientation stays and is at rest, and the status says so.

    `step` takes what `Controller.step` does, in the columns of `PoseState`: positions and goals of shape (4,) or (7,),
    quaternions of either sign; velocities of shape (3,) or (6,), angular in the world frame [rad/s], for poses after
    the linear ones, and external accelerations (`coupling`) likewise. With a `goal_velocity` the orientation of the
    goal goes on as a rotation vector does. Obstacles are points (m, 3) that the position steers around; orientations
    without a position have none.
    """

    def __init__(
        self,
        plan: Plan,
        dt: float,
        options: Options,
        reference: Array,
        channels: Channels | None = None,
    ) -> None:
        references = reference.reshape(-1, 4)
        self._references = references.tolist()
        self._backwards = conjugate(references).tolist()
        self._linear = plan.n_positions  # columns before the orientations
        super().__init__(plan, dt, options, channels)

    def _read_place(self, value: Any, near: Array) -> Array | None:
        """Return position and the rotation vector closest to that of `near`; None for what is no pose."""
        array = read_vector(value, self._n_dims + len(self._references))
        if array is None:
            return None
        columns, close = array.tolist(), (self._origin + near).tolist()
        tangent = columns[: self._linear]
        for i, backwards in enumerate(self._backwards):
            q, p = self._linear + 4 * i, self._linear + 3 * i
            vector = log_one(product_components(columns[q : q + 4], backwards), close[p : p + 3])
            if vector is None:  # a quaternion that is none: the motion goes on
                return None
            tangent.extend(vector)
        return np.array(tangent) - self._origin

    def _read_rates(self, value: Any, place: Array) -> Array | None:
        """Rates of position and rotation vector, of linear and angular ones; of accelerations the linear part."""
        array = read_vector(value, self._n_dims)
        if array is None:
            return None
        columns, m = array.tolist(), self._linear
        rates = np.array([*columns[:m], *self._of_each(rate_components, (self._origin + place).tolist(), columns)])
        return rates if is_usable(rates) and np.abs(rates[m:]).max() <= _FASTEST else None

    def _move(self, dt: float, push: Array, last: Array) -> None:
        super()._move(dt, push, last)
        if Status.STATE_KEPT in self._events:
            motion = self._motion.copy()
            motion[1:, self._linear :] = 0.0  # else it would be as fast, and kept, in all later steps
            self._motion = motion

    def _usable(self, motion: Array) -> bool:
        turned = np.abs(motion[:, self._linear :]).max(axis=1)
        return super()._usable(motion) and bool(turned[0] <= _MOST_TURNED and turned[1:].max() <= _FASTEST)

    def _derivatives(self) -> tuple[Array, Array]:
        rate, bend = super()._derivatives()
        x, dx, ddx = (self._origin + self._motion[0]).tolist(), rate.tolist(), bend.tolist()
        m = self._linear
        velocity = np.array([*dx[:m], *self._of_each(velocity_components, x, dx)])
        return velocity, np.array([*ddx[:m], *self._of_each(acceleration_components, x, dx, ddx)])

    def _of_each(self, function: Callable[..., Components], *columns: list[float]) -> Iterator[float]:
        """A function of rotation vectors and their rates, for each of the orientations."""
        for at in range(self._linear, self._n_dims, 3):
            yield from function(*(column[at : at + 3] for column in columns))

    def _report(self, velocity: Array, acceleration: Array) -> PoseState:
        state = super()._report(velocity, acceleration)
        return PoseState(*state._replace(position=self._as_pose(state.position), goal=self._as_pose(state.goal)))

    def _as_pose(self, x: Array) -> Array:
        columns, m = x.tolist(), self._linear
        pose = columns[:m]
        for i, reference in enumerate(self._references):
            at = m + 3 * i
            pose.extend(product_components(exp_one(columns[at : at + 3]), reference))
        return np.array(pose)

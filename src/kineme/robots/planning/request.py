"""One movement as an arm is asked for it: samples of the tip or of the joints, in meters and radians."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.coordinates import as_wxyz
from kineme.movements.segmentation.segment import as_recording
from kineme.robots.models.robot import Robot
from kineme.robots.planning.roles import check_plausible, roles_of, scales_of, space_of
from kineme.validation import Array, as_numbers


class Request(NamedTuple):
    """One movement of the tip or of the joints, T samples."""

    times: Array  # (T,) [s], from 0
    space: str  # "tip" or "joints"
    positions: Array  # (T, d) [m] or [rad]
    orientations: Array | None  # (T, 4), w, x, y, z
    steps: dict[str, Array]  # discrete channels, (T,)
    continuous: dict[str, Array]  # channels that move and are no joints, (T,)


def request_of(
    movement: Any, robot: Robot, space: str, steps: Any = None, continuous: Any = None, joint_units: str | None = None
) -> Request:
    """What `move` was given, as one movement; `steps` and `continuous` besides such channels of its own.

    Raises
    ------
    TrajectoryError
        Several movements, several orientations, joints of another number, or steps of another length.
    SpecificationError
        Steps that are no dict.
    """
    if isinstance(movement, Primitives | PosePrimitives):
        movement = movement.rollout()
    one = as_recording(movement)
    columns = np.asarray(one.recorded, dtype=float)
    space = space_of(one.channels, columns, robot) if space == "auto" else space
    roles = roles_of(one.channels, columns.shape[1], space, robot)
    if space == "joints" and len(roles.positions) != robot.n_joints:
        raise TrajectoryError(
            f"expected a movement of the {robot.n_joints} joints of {robot.name}, got {len(roles.positions)} columns; "
            "choose them with columns=, in the shell --columns, or say which are no joints, --kind gripper=discrete"
        )
    scales = scales_of(roles, robot if space == "joints" else None, joint_units)
    positions = columns[:, roles.positions] * scales.size + scales.offset
    if space == "joints":
        check_plausible(positions, robot)
    turned = None if roles.orientation is None else as_wxyz(columns[:, roles.orientation[1]], roles.orientation[0])
    known = sorted(
        {*roles.discrete, *_given(steps), *roles.continuous, *_given(continuous, "continuous")} & set(robot.joints)
    )
    if known:
        raise TrajectoryError(f"expected other channels of other names than the joints have, got {known[0]!r}")
    others = {name: columns[:, k] for name, k in roles.continuous.items()}
    recorded = {name: columns[:, k] for name, k in roles.discrete.items()}
    return Request(
        one.times - one.times[0],
        space,
        positions,
        turned,
        {name: _one_for_each(one.times, values, name) for name, values in {**recorded, **_given(steps)}.items()},
        {
            name: _one_for_each(one.times, values, name)
            for name, values in {**others, **_given(continuous, "continuous")}.items()
        },
    )


def _given(steps: Any, what: str = "steps") -> Mapping[str, Any]:
    if not isinstance(steps, Mapping | None) or not all(isinstance(name, str) for name in steps or {}):
        raise SpecificationError(f"expected {what} as a dict of channels and their values, got {steps!r:.80}")
    return steps or {}


def _one_for_each(times: Array, values: Any, name: str) -> Array:
    values = as_numbers(values, name)
    if values.shape != times.shape:
        raise TrajectoryError(f"expected {len(times)} values of {name}, one for each sample, got {values.shape}")
    return values

"""Generate one movement of one primitive: by the decode matrix, or step by step around obstacles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kineme.errors import SpecificationError
from kineme.files.write_movement import ColumnNames, Columns
from kineme.movements.channels.channel import Channels, is_plain
from kineme.movements.channels.coordinates import as_wxyz, columns_of, from_wxyz
from kineme.movements.rotations.quaternions import continuous
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.primitives.control.state import State, Status
from kineme.primitives.discrete.dmp import Primitives
from kineme.primitives.generation.learned import Learned
from kineme.primitives.pose.pose_primitives import PosePrimitives
from kineme.validation import Array

_ROUNDING = 1e-9  # of a duration: stamps that are equal but for rounding
_LONGEST = 10.0  # durations after which a movement around obstacles is given up


@dataclass(frozen=True, eq=False)
class MovementOptions:
    """What the new movement should be; None leaves it as demonstrated.

    Attributes
    ----------
    start, goal : ndarray of shape (d,), optional
    duration : float, optional
        tau [s].
    rate : float
        Samples per second, at least.
    settle : float, optional
        Continue until within this distance of the goal.
    obstacles : ndarray of shape (m, d), optional
        Points to steer around.
    """

    start: Array | None = None
    goal: Array | None = None
    duration: float | None = None
    rate: float = 100.0
    settle: float | None = None
    obstacles: Array | None = None


class Generated(NamedTuple):
    """A new movement: times (T,), positions (T, d), velocities and accelerations (T, e), and what they are called."""

    columns: Columns
    names: ColumnNames


def generate(learned: Learned, options: MovementOptions) -> Generated:
    """The new movement in the columns of the recording.

    Orientations are quaternions of norm 1, with angular velocities in the world frame; discrete channels step where
    they did, at the same share of the duration.

    Raises
    ------
    SpecificationError
        An option that cannot be met; among them obstacles that keep the movement from its goal, more samples than fit
        into memory, and numbers that are not finite: a robot gets no movement that was not checked.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        plain = replace(options, start=_in_primitive(learned, options.start), goal=_in_primitive(learned, options.goal))
        move = _undisturbed if options.obstacles is None else _around_obstacles
        made = move(learned.primitive, plain)
    for name, column in made.items():
        if not np.isfinite(column).all():
            raise SpecificationError(
                f"expected finite {name} of the new movement, they leave the range of numbers; choose a start, a "
                "goal and a duration nearer to those demonstrated"
            )
    if learned.demonstration is not None and learned.demonstration.channels is not None:
        duration = float(learned.primitive.durations[0]) if options.duration is None else options.duration
        made["positions"] = _as_recorded(made, learned.demonstration, duration)
        of_rates = _in_order_of_rates(learned.demonstration.channels)
        made |= {name: made[name][:, of_rates] for name in ("velocities", "accelerations")}
    return Generated(made, ColumnNames(learned.columns, learned.rates))


def _in_primitive(learned: Learned, point: Array | None) -> Array | None:
    """A start or goal in the columns of the recording, in those of the primitive: an orientation last, w first."""
    one = learned.demonstration
    if point is None or one is None or one.channels is None or is_plain(one.channels):
        return point
    moved = [channel for channel in one.channels if channel.coordinates]
    names = [name for channel in moved for name in channel.columns]
    if point.shape != (len(names),):
        raise SpecificationError(f"expected {len(names)} numbers, {', '.join(names)}, got {point.size}")
    parts = [(channel, point[columns]) for channel, columns in zip(moved, columns_of(tuple(moved)), strict=True)]
    return np.concatenate(
        [part for channel, part in parts if channel.kind != "orientation"]
        + [as_wxyz(part, channel) for channel, part in parts if channel.kind == "orientation"]
    )


def _as_recorded(made: Columns, demonstration: Trajectory, duration: float) -> Array:
    """The new movement (T, columns) in the columns of the recording, with its discrete channels."""
    channels, recorded = demonstration.channels, demonstration.recorded
    assert channels is not None
    elapsed = (demonstration.times - demonstration.times[0]) / demonstration.duration
    now = np.searchsorted(elapsed, made["times"] / duration + _ROUNDING, side="right") - 1
    moved, parts = 0, []
    for one, columns in zip(channels, columns_of(channels), strict=True):
        if one.kind == "orientation":
            parts.append(_signed(from_wxyz(continuous(made["positions"][:, -4:]), one), recorded[0, columns]))
        elif one.kind == "discrete":
            parts.append(recorded[now, columns])
        else:
            parts.append(made["positions"][:, moved : moved + 1])
            moved += 1
    return np.concatenate(parts, axis=1)


def _in_order_of_rates(channels: Channels) -> list[int]:
    """The columns of a primitive's velocities in the order of the channels: those of an orientation it has last."""
    kinds = [one.kind for one in channels for _ in one.coordinates]
    plain = [k for k, kind in enumerate(kinds) if kind != "orientation"]
    last = [k for k, kind in enumerate(kinds) if kind == "orientation"]
    return np.argsort(plain + last).tolist()


def _signed(q: Array, start: Array) -> Array:
    """Quaternions along time with the sign of the recorded start: q and -q are one orientation, but not one column."""
    return -q if q[0] @ start < 0 else q


def _undisturbed(primitive: Primitives | PosePrimitives, options: MovementOptions) -> Columns:
    made = primitive.rollout(options.start, options.goal, options.duration, rate=options.rate, settle=options.settle)
    return {
        "times": made.times[0],
        "positions": made.positions[0],
        "velocities": made.velocities[0],
        "accelerations": made.accelerations[0],
    }


def _around_obstacles(primitive: Primitives | PosePrimitives, options: MovementOptions) -> Columns:
    obstacles = np.asarray(options.obstacles)
    n_dims = primitive.n_dims - 3 if isinstance(primitive, PosePrimitives) else primitive.n_dims
    if obstacles.ndim != 2 or obstacles.shape[1] != n_dims or n_dims < 2:
        raise SpecificationError(
            f"expected obstacles in the {n_dims} dimensions of the movement, two or more, got shape {obstacles.shape}"
        )
    duration = float(primitive.durations[0]) if options.duration is None else options.duration
    steps = primitive.rollout(duration=duration, rate=options.rate).times.shape[1] - 1
    control = primitive.controller(
        duration / steps, start=options.start, goal=options.goal, duration=duration, settle=options.settle
    )
    states = [control.state]
    while not _arrived(states[-1], options) and len(states) <= _LONGEST * steps:
        states.append(control.step(obstacles=obstacles))
    if options.settle is not None and not states[-1].status & Status.SETTLED:
        raise SpecificationError(
            f"expected the movement to come within {options.settle:g} of its goal in {_LONGEST:g} durations, the "
            "obstacles keep it away; move them or the goal"
        )
    return {
        "times": np.array([state.time for state in states]),
        "positions": np.array([state.position for state in states]),
        "velocities": np.array([state.velocity for state in states]),
        "accelerations": np.array([state.acceleration for state in states]),
    }


def _arrived(state: State, options: MovementOptions) -> bool:
    over = state.progress >= 1.0 - 1e-9
    return over if options.settle is None else over and bool(state.status & Status.SETTLED)

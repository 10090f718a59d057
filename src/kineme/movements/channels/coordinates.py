"""Recorded columns become the coordinates that a movement primitive learns; angles lose the jumps where they wrap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channel, Channels, recorded_names
from kineme.movements.rotations import NORM_TOLERANCE, conjugate, log, odd_flips, product
from kineme.units import UNITS, converted, unit_named
from kineme.validation import Array

_TURN = 2.0 * np.pi
#: Where recorded angles lie: between minus and plus half a turn, or from 0 to a whole one.
_RANGES = ((-np.pi, np.pi), (0.0, _TURN), (-180.0, 180.0), (0.0, 360.0))
_SLACK = 1e-3  # of a period, beyond the range
_ROUNDED_TURN = 1e-9  # of a period
_SPARSE = 0.25  # of a period: with longer steps between the jumps no rule could tell
_UNSTEADY = 3.0  # a step through the border is at most so many times the longest other one
_UNEVEN = 0.01  # of a period: by so much an angle that turns evenly steps differently through the border, if rounded
_JUMP = 0.75  # of a period: a step at least this long is a wrap, and no motion

_NEAR = 0.125  # of a period: joints with limits are at places farther apart than this in one turn
_CLEAR = 0.375  # of a period: what begins within this of a mean direction is as far as 1/8 from where turns begin

_LEVER = 0.2
_ROUNDING = 1e-15  # deviation from norm 1 that is that of the last digit


def columns_of(channels: Channels) -> list[slice]:
    """The columns of each channel."""
    ends = np.cumsum([len(channel.columns) for channel in channels]).tolist()
    return [slice(end - len(channel.columns), end) for end, channel in zip(ends, channels, strict=True)]


def columns_of_kinds(channels: Channels, *kinds: str) -> list[int]:
    """Return the columns of channels of these kinds."""
    every = [channel.kind for channel in channels for _ in channel.columns]
    return [k for k, kind in enumerate(every) if kind in kinds]


def in_order(columns: Array, heads: Sequence[str], channels: Channels) -> Array:
    """Columns (total, m) of a file in the order of its channels: those of a quaternion side by side."""
    number = {head: k for k, head in enumerate(heads)}
    order = [number[head] for head in recorded_names(channels)]
    return columns if order == sorted(order) else columns[:, order]


def off_norm(columns: Array, channels: Channels) -> Iterator[tuple[Channel, NDArray[np.intp], Array]]:
    """Each orientation with the rows where it is no unit quaternion, if there are any, and all norms (total,)."""
    for channel, some in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "orientation":
            norms = np.linalg.norm(columns[:, some], axis=1)
            if len(rows := np.flatnonzero(~(np.abs(norms - 1.0) <= NORM_TOLERANCE))):
                yield channel, rows, norms


def canonical(columns: Array, offsets: NDArray[np.intp], channels: Channels) -> Array:
    """Recorded columns (total, m) with angles that do not jump, and checked quaternions whose signs do not either."""
    result = np.array(columns, dtype=np.float64, order="C")
    for channel, rows in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "angle":
            angles = result[:, rows.start]
            result[:, rows.start] = without_wraps(angles, offsets, period_of_channel(channel, angles))
        elif channel.kind == "orientation":
            result[:, rows] = continuous_signs(result[:, rows], offsets)
    return result


def with_periods(channels: Channels, columns: Array) -> Channels:
    """Channels that say what their angles wrap by; where units do not, by the values of recorded columns (total, m)."""
    return tuple(
        channel._replace(period=float(np.nan_to_num(period_of_channel(channel, columns[:, rows.start]), posinf=0.0)))
        if channel.kind == "angle" and period_by_unit(channel.unit) is None
        else channel
        for channel, rows in zip(channels, columns_of(channels), strict=True)
    )


def period_of_channel(channel: Channel, angles: Array) -> float:
    """Return the period of an angle: by its unit, by what its channel says, or else by these values."""
    if channel.period is None or period_by_unit(channel.unit) is not None:
        return period_of(angles, channel.unit)
    return channel.period or np.inf


def learned(columns: Array, offsets: NDArray[np.intp], channels: Channels) -> Array:
    """Coordinates (total, d) of `canonical` columns (total, m).

    An orientation becomes the integral of its angular velocity in the world frame,
    ``r_0 = 0, r_k+1 = r_k + log(q_k+1 conj(q_k))`` [rad], with the rotation vector ``log``. Unlike the rotation vector
    from one reference it has no limit of a full turn, and it does not depend on what came before a movement but for
    an offset. A tool that is mounted differently changes nothing; a scene that is turned turns it as it turns a path.
    Beside positions it is multiplied by `lever_of` them, so that all coordinates are lengths.
    """
    if all(channel.kind == "discrete" for channel in channels):
        raise SpecificationError(
            f"expected a channel that moves, got {', '.join(channel.name for channel in channels)}, all discrete; "
            "read other columns too, or say that one is a position"
        )
    parts, lever = [], lever_of(channels)
    for channel, rows in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "orientation":
            turned = np.concatenate(
                (np.zeros((1, 3)), np.cumsum(rotation_steps(as_wxyz(columns[:, rows], channel)), axis=0))
            )
            parts.append(lever * np.asarray(turned - np.repeat(turned[offsets[:-1]], np.diff(offsets), axis=0)))
        elif channel.coordinates:
            parts.append(columns[:, rows])
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def lever_of(channels: Channels) -> float:
    """Return the length of a radian beside positions: 0.2 m, as of a hand or a tool, in their unit; without, 1."""
    units = [channel.unit for channel in channels if channel.kind == "position"]
    if not units:
        return 1.0
    unit = unit_named(units[0] or "m")
    return float(converted(_LEVER, UNITS["m"], unit)) if unit is not None and unit.quantity == "length" else _LEVER


def lengths_of(channels: Channels) -> Array:
    """Return how long a step of 1 in each coordinate (d,) counts beside the others [m].

    A radian counts as the way of a tool, see `lever_of`, and so does the range of a joint; without a unit a coordinate
    counts as an orientation does: in the unit of the positions.
    """
    known = {"length": 1.0, "angle": _LEVER, "range": _LEVER}
    units = [(unit_named(channel.unit or ""), len(channel.coordinates)) for channel in channels]
    lengths = [
        float(unit.size) * known[unit.quantity] if unit and unit.quantity in known else _LEVER / lever_of(channels)
        for unit, _ in units
    ]
    return np.repeat(lengths, [n for _, n in units])


def as_wxyz(q: Array, channel: Channel) -> Array:
    """Quaternions (..., 4) in the order of a channel's columns as (w, x, y, z)."""
    return q[..., [channel.order.index(part) for part in "wxyz"]]


def continuous_signs(q: Array, offsets: NDArray[np.intp]) -> Array:
    """Quaternions (total, 4) of norm 1; along each movement neighbors lie in one hemisphere, its first stays."""
    odd = odd_flips(q)
    odd ^= np.repeat(odd[offsets[:-1]], np.diff(offsets))
    norms = np.linalg.norm(q, axis=1, keepdims=True)
    norms[np.abs(norms - 1.0) < _ROUNDING] = 1.0  # every bit as recorded
    return np.asarray(np.where(odd[:, None], -q, q) / norms)


def rotation_steps(q: Array) -> Array:
    """Rotation vectors (k - 1, 3) from each of k quaternions (w, x, y, z) to the next one."""
    return log(product(q[1:], conjugate(q[:-1])))


def wrap_period(angles: Array, offsets: NDArray[np.intp]) -> float | None:
    """The period of a column (total,) that shows that it wraps by its range and by jumps through it; else None.

    With these taken away it moves on as it moves elsewhere: a switch between two far values does not, nor does a
    counter that begins anew after something else than a turn, as 0, 1, ..., 6, 0. Whole numbers are no radians.
    """
    signed = _steps(angles, offsets)
    steps = np.abs(signed)
    jump, least, most = float(steps.max(initial=0.0)), float(angles.min(initial=0.0)), float(angles.max(initial=0.0))
    for low, high in _RANGES:
        period = high - low
        if low - _SLACK * period <= least and most <= high + _SLACK * period and jump > 0.9 * period:
            if period == _TURN and np.all(angles == np.round(angles)):
                continue
            jumps = steps > _JUMP * period
            through, other = signed[jumps] - np.sign(signed[jumps]) * period, float(steps[~jumps].max(initial=0.0))
            if 0.0 < other < _SPARSE * period and float(np.abs(through).max()) <= _UNSTEADY * other:
                within = signed[~jumps & (steps > 0.0)]
                room = 2.0 * float(np.ptp(within)) + _UNEVEN * period
                if float(within.min()) - room <= through.min() and through.max() <= float(within.max()) + room:
                    return period
    return None


def period_by_unit(unit: str | None) -> float | None:
    """The period of an angle in a unit; None where it is no unit of an angle."""
    measure = unit_named(unit or "")
    return float(_TURN / measure.size) if measure is not None and measure.quantity == "angle" else None


def period_of(angles: Array, unit: str | None) -> float:
    """The period of an angle: by its unit, or, where that says nothing, by its values.

    These are taken for radians within one turn, else for degrees; beyond a turn of those, and where only whole turns
    move, as a switch between 0 and 360, nothing wraps, and the period is infinite.
    """
    if (period := period_by_unit(unit)) is not None:
        return period
    largest = float(np.abs(angles).max(initial=0.0))
    period = next((period for period in (_TURN, 360.0) if largest <= period * (1 + _SLACK)), np.inf)
    if not np.isfinite(period) or not np.any(angles != angles[:1]):
        return period
    turns = (angles - angles[:1]) / period
    return np.inf if np.all(np.abs(turns - np.round(turns)) < _ROUNDED_TURN) else period


def without_wraps(angles: Array, offsets: NDArray[np.intp], period: float) -> Array:
    """Angles (total,) of movements one after the other, continuous along each; the first of each stays as it is.

    A step of 3/4 of a period or more counts as a wrap. A shorter one is motion: with samples so sparse that a joint
    turns further between two of them, no rule could tell.
    """
    turns = turns_of(_steps(angles, offsets), period)
    if not turns.any():
        return angles
    total = np.concatenate(([0.0], np.cumsum(turns)))
    return np.asarray(angles - period * (total - np.repeat(total[offsets[:-1]], np.diff(offsets))))


def turns_of(steps: Array, period: float) -> Array:
    """Count the turns, with their sign, that are jumps in each of some steps."""
    return np.asarray(np.sign(steps) * np.floor(np.abs(steps) / period + (1.0 - _JUMP)))


def _steps(values: Array, offsets: NDArray[np.intp]) -> Array:
    """Differences of neighbors (total - 1,), 0 from one movement to the next."""
    steps = np.diff(values)
    steps[offsets[1:-1] - 1] = 0.0
    return steps


def turns_beyond(points: Array, near: Array, periods: Array, most: float = _NEAR) -> Array:
    """Return whole turns (n, d) by which points are beyond `near` (d,); 0 where they are farther away than `most`."""
    away = points - near
    with np.errstate(invalid="ignore"):  # infinite periods
        turns = np.where(np.isfinite(periods), periods * np.round(away / periods), 0.0)
    return np.where(np.abs(away - turns) <= most * periods, turns, 0.0)


def in_one_turn(starts: Array, periods: Array) -> Array:
    """Return whole turns (n, d) by which starts are beyond their mean direction, in the turn of their median.

    0 in columns in which some start is farther from it than an eighth of a turn.
    """
    mean, periods = mean_turn(starts, periods, _NEAR)
    return turns_beyond(starts, mean, periods)


def mean_turn(starts: Array, periods: Array, most: float = _CLEAR) -> tuple[Array, Array]:
    """Return mean directions (d,) of starts (n, d), in the turn of their median, and the periods (d,).

    These are infinite in columns in which some start is farther from the mean direction than `most` of a turn.
    """
    with np.errstate(invalid="ignore"):  # infinite periods
        mean = np.angle(np.exp(2j * np.pi * starts / periods).sum(axis=0)) * periods / (2.0 * np.pi)
        mean += periods * np.round((np.median(starts, axis=0) - mean) / periods)
        away = np.abs(starts - turns_beyond(starts, mean, periods, most) - mean)
        return mean, np.where((away > most * periods).any(axis=0), np.inf, periods)

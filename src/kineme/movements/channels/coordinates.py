"""From recorded columns to the coordinates that a movement primitive learns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channel, Channels, recorded_names
from kineme.movements.channels.wraps import period_by_unit, period_of, without_wraps
from kineme.movements.rotations.quaternions import NORM_TOLERANCE, conjugate, product
from kineme.movements.rotations.rotation_vectors import log
from kineme.units import UNITS, converted, unit_named
from kineme.validation import Array

_LEVER = 0.2  # m
_ROUNDING = 1e-15  # deviation from norm 1 that is that of the last digit


def columns_of(channels: Channels) -> list[slice]:
    """The columns of each channel."""
    ends = np.cumsum([len(one.columns) for one in channels]).tolist()
    return [slice(end - len(one.columns), end) for end, one in zip(ends, channels, strict=True)]


def in_order(columns: Array, heads: Sequence[str], channels: Channels) -> Array:
    """Columns (total, m) of a file in the order of its channels: those of a quaternion side by side."""
    number = {head: k for k, head in enumerate(heads)}
    order = [number[head] for head in recorded_names(channels)]
    return columns if order == sorted(order) else columns[:, order]


def off_norm(columns: Array, channels: Channels) -> Iterator[tuple[Channel, NDArray[np.intp], Array]]:
    """Each orientation with the rows where it is no unit quaternion, if there are any, and all norms (total,)."""
    for one, some in zip(channels, columns_of(channels), strict=True):
        if one.kind == "orientation":
            norms = np.linalg.norm(columns[:, some], axis=1)
            if len(rows := np.flatnonzero(~(np.abs(norms - 1.0) <= NORM_TOLERANCE))):
                yield one, rows, norms


def canonical(columns: Array, offsets: NDArray[np.intp], channels: Channels) -> Array:
    """Recorded columns (total, m) with angles that do not jump, and quaternions of norm 1 whose signs do not either.

    Parameters
    ----------
    columns : ndarray of shape (total, m)
        All movements, one after the other; the norms of quaternions have been checked.
    offsets : ndarray of shape (n + 1,)
    channels : Channels
    """
    result = np.array(columns, dtype=np.float64, order="C")
    for one, rows in zip(channels, columns_of(channels), strict=True):
        if one.kind == "angle":
            angles = result[:, rows.start]
            result[:, rows.start] = without_wraps(angles, offsets, period_of_channel(one, angles))
        elif one.kind == "orientation":
            result[:, rows] = continuous_signs(result[:, rows], offsets)
    return result


def with_periods(channels: Channels, columns: Array) -> Channels:
    """Channels that say what their angles wrap by; where units do not, by the values of recorded columns (total, m)."""
    return tuple(
        one._replace(period=_finite(period_of_channel(one, columns[:, rows.start])))
        if one.kind == "angle" and period_by_unit(one.unit) is None
        else one
        for one, rows in zip(channels, columns_of(channels), strict=True)
    )


def period_of_channel(channel: Channel, angles: Array) -> float:
    """What an angle wraps by: by its unit, by what its channel says, or else by these values."""
    if channel.period is None or period_by_unit(channel.unit) is not None:
        return period_of(angles, channel.unit)
    return channel.period or np.inf


def _finite(period: float) -> float:
    return period if np.isfinite(period) else 0.0


def learned(columns: Array, offsets: NDArray[np.intp], channels: Channels) -> Array:
    """Coordinates (total, d) of `canonical` columns (total, m).

    An orientation becomes the integral of its angular velocity in the world frame,
    ``r_0 = 0, r_k+1 = r_k + log(q_k+1 conj(q_k))`` [rad], with the rotation vector ``log``. Unlike the rotation vector
    from one reference it has no limit of a full turn, and it does not depend on what came before a movement but for
    an offset. A tool that is mounted differently changes nothing; a scene that is turned turns it as it turns a path.
    Beside positions it is multiplied by `lever_of` them, so that all coordinates are lengths.

    Raises
    ------
    SpecificationError
        Discrete channels alone: nothing moves.
    """
    if all(one.kind == "discrete" for one in channels):
        raise SpecificationError(
            f"expected a channel that moves, got {', '.join(one.name for one in channels)}, all discrete; "
            "read other columns too, or say that one is a position"
        )
    parts, lever = [], lever_of(channels)
    for one, rows in zip(channels, columns_of(channels), strict=True):
        if one.kind == "orientation":
            parts.append(lever * _integrated(as_wxyz(columns[:, rows], one), offsets))
        elif one.coordinates:
            parts.append(columns[:, rows])
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def lever_of(channels: Channels) -> float:
    """What a radian counts as beside positions: 0.2 m in their unit, meters if it is not known; without positions, 1.

    It is about the length of a hand or a tool: a rotation counts as much as the way of the tip.
    """
    units = [one.unit for one in channels if one.kind == "position"]
    if not units:
        return 1.0
    unit = unit_named(units[0] or "m")
    return float(converted(_LEVER, UNITS["m"], unit)) if unit is not None and unit.quantity == "length" else _LEVER


def as_wxyz(q: Array, channel: Channel) -> Array:
    """Quaternions (..., 4) in the order of a channel's columns as (w, x, y, z)."""
    return q[..., [channel.order.index(part) for part in "wxyz"]]


def from_wxyz(q: Array, channel: Channel) -> Array:
    """The inverse of `as_wxyz`."""
    return q[..., ["wxyz".index(part) for part in channel.order]]


def continuous_signs(q: Array, offsets: NDArray[np.intp]) -> Array:
    """Quaternions (total, 4) of norm 1; along each movement neighbors lie in one hemisphere, its first stays."""
    flips = np.concatenate(([False], (q[1:] * q[:-1]).sum(axis=1) < 0))
    odd = np.logical_xor.accumulate(flips)
    odd ^= np.repeat(odd[offsets[:-1]], np.diff(offsets))
    norms = np.linalg.norm(q, axis=1, keepdims=True)
    norms[np.abs(norms - 1.0) < _ROUNDING] = 1.0  # every bit as recorded
    return np.asarray(np.where(odd[:, None], -q, q) / norms)


def _integrated(q: Array, offsets: NDArray[np.intp]) -> Array:
    turned = np.concatenate((np.zeros((1, 3)), np.cumsum(rotation_steps(q), axis=0)))
    return np.asarray(turned - np.repeat(turned[offsets[:-1]], np.diff(offsets), axis=0))


def rotation_steps(q: Array) -> Array:
    """Rotation vectors (k - 1, 3) from each of k quaternions (w, x, y, z) to the next one."""
    return log(product(q[1:], conjugate(q[:-1])))

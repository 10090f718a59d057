"""Options of generated movements as users write them, checked: one for all or one for each, and via points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.validation import LARGEST, LARGEST_STAMP, SHORTEST_STEP, Array, as_numbers

#: What users write: (time, point) or ((begin, end), points), times as shares of the duration.
ViaLike = Sequence[tuple[float | tuple[float, float], ArrayLike]]

Learned = Callable[[Array, Array], Array]

_SAME_TIME = 1e-9  # durations
_SAME_PLACE = 1e-9  # of the larger number
_FORM = "via=[(time, point), ...] or [((begin, end), points), ...] with times between 0 and 1, shares of the duration"
_BOUNDS = (
    "a time, or a begin and a later end, above 0 and below 1 as shares of the duration, got {}; start, goal and "
    "end_velocity say where the movement begins and ends"
)


class ViaPoints(NamedTuple):
    """k via points of one movement, or of n, in the order of their times."""

    times: Array  # (k,), between 0 and 1
    points: Array  # (1 or n, k, d); NaN where a dimension is free
    stretch: NDArray[np.bool_]  # (k,): whether it belongs to a stretch, which is met in the least squares


class Span(NamedTuple):
    """Unit and bounds of the times of via points."""

    end: float  # below which they lie
    closed: bool  # whether 0 is one of them
    form: str
    where: str  # how the message names one
    bounds: str


SHARES = Span(1.0, False, _FORM, "{:g} of the duration", _BOUNDS)


def via_points(via: ViaLike | ViaPoints, n_dims: int, learned: Learned | None = None, span: Span = SHARES) -> ViaPoints:
    """Check what a user wrote, points of `n_dims` and times of `span`; see `Primitives.rollout`.

    ``learned(times, points)`` gives points (n, k, n_dims) at times (k,) in the coordinates that are learned, if others.
    """
    if isinstance(via, ViaPoints):
        return via
    if isinstance(via, (str, bytes)) or not isinstance(via, (Sequence, np.ndarray)):
        raise SpecificationError(f"expected {span.form}, got {via!r}")
    if len(via) == 2 and _is_time(via[0]):
        raise SpecificationError(f"expected {span.form}, got one pair; put it in a list: via=[{via!r}]")
    parts = [_part(i, pair, n_dims, span) for i, pair in enumerate(via)]
    n = max((len(points) for _, points, _ in parts), default=1)
    for i, (_, points, _) in enumerate(parts):
        if len(points) not in (1, n):
            raise TrajectoryError(f"via[{i}]: expected points of one movement or of {n}, got {len(points)}")
    if not parts:
        none = np.zeros((1, 0, n_dims))
        return ViaPoints(np.zeros(0), none if learned is None else learned(np.zeros(0), none), np.zeros(0, bool))
    times = np.concatenate([times for times, _, _ in parts])
    points = np.concatenate([np.broadcast_to(p, (n, *p.shape[1:])) for _, p, _ in parts], axis=1)
    stretch = np.repeat([is_stretch for _, _, is_stretch in parts], [len(times) for times, _, _ in parts])
    order = np.argsort(times, kind="stable")
    written = ViaPoints(times[order], points[:, order], stretch[order])
    points = written.points if learned is None else learned(written.times, written.points)
    return _merged(written._replace(points=points), written.points, span)


def _is_time(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def _part(i: int, pair: Any, n_dims: int, span: Span) -> tuple[Array, Array, bool]:
    """Times (m,), points (1 or n, m, d), and whether it is a stretch."""
    try:
        when, where = pair
    except (TypeError, ValueError) as error:
        raise SpecificationError(f"expected {span.form}, got {pair!r} as via[{i}]") from error
    points = as_numbers(where, f"via[{i}]")
    stretch = not _is_time(when)
    points = points[..., None] if n_dims == 1 and points.ndim == stretch else points
    fits = points.size and points.ndim in (1 + stretch, 2 + stretch) and points.shape[-1] == n_dims
    if not fits or (stretch and points.shape[-2] < 2):
        shape = f"(m, {n_dims}) or (n, m, {n_dims})" if stretch else f"({n_dims},) or (n, {n_dims})"
        raise TrajectoryError(f"via[{i}]: expected points of shape {shape}, got shape {np.shape(where)}")
    points = points.reshape(-1, points.shape[-2] if stretch else 1, n_dims)
    if np.isinf(points).any() or np.nanmax(np.abs(points), initial=0.0) > LARGEST or np.isnan(points).all(axis=2).any():
        raise TrajectoryError(
            f"via[{i}]: expected numbers up to {LARGEST:g}, NaN only for dimensions that are free, got {where!r}"
        )
    return _times(i, when, points.shape[1], span), points, stretch


def _times(i: int, when: Any, n_points: int, span: Span) -> Array:
    """Even times (m,) from the begin to the end of a stretch, or one."""
    try:
        ends = np.array([when] if _is_time(when) else list(when), dtype=np.float64) / span.end
    except (TypeError, ValueError) as error:
        raise SpecificationError(f"expected {span.form}, got {when!r} as the time of via[{i}]") from error
    inside = ((ends > 0) | (span.closed & (ends == 0))) & (ends < 1)
    if len(ends) != 1 + (not _is_time(when)) or not inside.all() or (np.diff(ends) <= 0).any():
        raise SpecificationError(f"via[{i}]: expected {span.bounds.format(repr(when))}")
    return np.linspace(ends[0], ends[-1], n_points)


def _merged(via: ViaPoints, written: Array, span: Span) -> ViaPoints:
    """One point for each time; what contradicts itself is refused, as it was written."""
    same = np.diff(via.times) <= _SAME_TIME
    if not same.any():
        return via
    points = via.points.copy()
    for j in np.flatnonzero(same):
        point, other = points[:, j], points[:, j + 1]
        apart = np.abs(point - other) > _SAME_PLACE * np.maximum(np.abs(point), np.abs(other))
        if apart.any():
            k = int(np.argmax(apart.any(axis=1)))
            raise SpecificationError(
                f"expected one place at {span.where.format(via.times[j] * span.end)}, got two via points there: "
                f"{_shown(written, k, int(j))} and {_shown(written, k, int(j) + 1)}"
                f"{f' for movement {k}' if len(points) > 1 else ''}"
            )
        points[:, j + 1] = np.where(np.isnan(other), point, other)
    first_of_time = np.append(~same, True)
    stretch = via.stretch.copy()
    stretch[1:] &= ~same | stretch[:-1]  # a point on a stretch is met exactly
    return ViaPoints(via.times[first_of_time], points[:, first_of_time], stretch[first_of_time])


def _shown(written: Array, movement: int, point: int) -> list[float]:
    return list(written[min(movement, len(written) - 1), point].tolist())


def check_durations(name: str, durations: Array) -> None:
    """Refuse durations of 0 seconds or less, and those whose squares leave the range of numbers."""
    usable = (durations >= SHORTEST_STEP) & (durations <= LARGEST_STAMP)
    if usable.all():
        return
    i = int(np.argmin(usable))
    between = "" if durations[i] <= 0 else f" and from {SHORTEST_STEP:g} to {LARGEST_STAMP:g}"
    raise SpecificationError(f"expected {name} above 0 seconds{between}, got {durations[i]:g} for movement {i}")


def per_movement(option: ArrayLike | None, name: str, n_dims: int | None) -> Array | None:
    """An option as (1, d) or (n, d), durations as (1,) or (n,); a number suits a movement of one dimension."""
    if option is None:
        return None
    try:
        value = as_numbers(option, name)
    except TrajectoryError as error:
        raise TrajectoryError(f"expected numbers for {name}, got {option!r}") from error
    if n_dims == 1 and value.ndim == 0:
        value = value[None]
    own = () if n_dims is None else (n_dims,)
    value = value[None] if value.ndim == len(own) else value
    if value.shape[1:] != own:
        shape = "a number or (n,)" if n_dims is None else f"({n_dims},) or (n, {n_dims})"
        raise TrajectoryError(f"expected {name} of shape {shape}, got shape {np.shape(option)}")
    if (bad := ~np.isfinite(value)).any():
        raise TrajectoryError(f"expected finite numbers for {name}, got {_first(value, bad)}")
    if (bad := np.abs(value) > LARGEST).any():
        raise TrajectoryError(
            f"expected numbers up to {LARGEST:g} for {name}, got {_first(value, bad)}; choose another unit"
        )
    return value


def filled(option: Array | None, default: Array, n: int) -> Array:
    """An option of n movements, or of one for all of them, as an option of each; `default` where there is none."""
    value = default if option is None else option
    return np.broadcast_to(value, (n, *value.shape[1:]))


def _first(value: Array, bad: NDArray[np.bool_]) -> str:
    """The first invalid value, with the index of its movement if there are several."""
    k = int(bad.reshape(len(value), -1).any(axis=1).argmax())
    return f"{value[k].tolist()}{f' for movement {k}' if len(value) > 1 else ''}"


def broadcast_length(n: int, options: dict[str, Array | None], what: str = "primitives") -> int:
    """Number of movements from n of `what` and the lengths of all options, which must be 1 or equal."""
    lengths = {what: n} | {name: len(value) for name, value in options.items() if value is not None}
    n = max(lengths.values())
    if any(length not in (1, n) for length in lengths.values()):
        listed = ", ".join(f"{length} {name}" for name, length in lengths.items())
        raise TrajectoryError(f"expected one or equally many of {what}, starts, goals and so on, got {listed}")
    return n

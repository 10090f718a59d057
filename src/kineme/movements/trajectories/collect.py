"""Collect lists of arrays or trajectories into one contiguous block."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import attrgetter
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, learned_names, recorded_names
from kineme.movements.channels.column_match import Columns, columns_like, columns_recorded
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.movements import Movements, Names, of_channels
from kineme.movements.trajectories.trajectory import Trajectory, unchecked
from kineme.validation import (
    MIN_SAMPLES,
    ROUNDED,
    Array,
    as_array,
    as_positions,
    as_times,
    check_extents,
    check_finite,
    check_times,
    describe,
    refuse_lossy,
    too_long_integer,
)

_FLOAT64 = np.dtype(np.float64)

#: What to do with a block (n, d, T), as libraries for time series have it, and with a list of arrays (d, T).
_TIME_LAST = "if time runs along the last axis, as in (n, d, T), pass np.moveaxis(array, 1, 2)"
_EACH = "transpose the array, as by [x.T for x in arrays]"


def collect_trajectories(trajectories: Sequence[Trajectory]) -> Movements:
    """Concatenate trajectories, each of which has been checked already."""
    trajectories = list(trajectories)
    for i, trajectory in enumerate(trajectories):
        if not isinstance(trajectory, Trajectory):
            raise TrajectoryError(
                f"expected a sequence of Trajectory, got {type(trajectory).__name__} at index {i}; "
                "use Demonstrations.from_arrays for arrays"
            )
    trajectories = _in_columns_of_first(trajectories)
    names = tuple(trajectory.name for trajectory in trajectories)
    positions, offsets = _concatenate([trajectory.positions for trajectory in trajectories], names)
    times = np.concatenate([trajectory.times for trajectory in trajectories])
    labels = [trajectory.label for trajectory in trajectories]
    labeled = any(label is not None for label in labels)
    channels, dimensions, recorded = trajectories[0].channels, None, None
    if channels is None or any(trajectory.channels != channels for trajectory in trajectories):
        channels = None
    else:
        dimensions = learned_names(channels)
        if len(dimensions) != positions.shape[1]:  # of movements that are still as recorded
            dimensions = recorded_names(channels)
        if not is_plain(channels):
            recorded = np.concatenate([trajectory.recorded for trajectory in trajectories])
    return Movements(
        positions,
        offsets,
        times[offsets[1:] - 1] - times[offsets[:-1]],
        times,
        label_array(labels, len(labels), names) if labeled else None,
        names if any(names) else None,
        dimensions,
        channels,
        recorded,
    )


def _in_columns_of_first(trajectories: list[Trajectory]) -> list[Trajectory]:
    """Trajectories whose columns have the names of the first one's in its order and units; the others as they are."""
    every = {id(trajectory.channels): trajectory.channels for trajectory in trajectories}
    channels = trajectories[0].channels if trajectories else None
    if len(every) < 2 or channels is None:
        return trajectories
    wanted = columns_recorded(channels)
    ours = {key: columns_recorded(other or ()) for key, other in every.items()}
    other = {key for key, columns in ours.items() if columns != wanted and {*columns.names} == {*wanted.names}}
    return [
        _as_first(trajectory, ours[id(trajectory.channels)], channels, wanted)
        if id(trajectory.channels) in other
        else trajectory
        for trajectory in trajectories
    ]


def _as_first(trajectory: Trajectory, ours: Columns, channels: Channels, wanted: Columns) -> Trajectory:
    columns = np.ascontiguousarray(columns_like(trajectory.recorded, ours, wanted, known_units=False))
    movement = of_channels(
        Movements(columns, np.array([0, len(columns)]), np.array([trajectory.duration]), trajectory.times), channels
    )
    recorded = movement.positions if movement.recorded is None else movement.recorded
    changed = {"positions": movement.positions, "channels": channels, "recorded": recorded}
    return unchecked(**vars(trajectory) | changed)


def collect_arrays(
    arrays: Any,
    labels: ArrayLike | None,
    times: Sequence[ArrayLike] | Array | None,
    names: Sequence[str | None] | None,
    copy: bool,
) -> Movements:
    """Concatenate arrays and check them all at once; see `Demonstrations.from_arrays`."""
    arrays = as_array(arrays)
    is_block = isinstance(arrays, np.ndarray) and arrays.dtype != object
    if names is not None:
        _check_sized(names, "names as a list, one for each movement")
    if not is_block:
        _check_sized(arrays, "movements as a list of (T, d) arrays or one (n, T, d) array")
    positions, offsets = _from_block(arrays, copy) if is_block else _from_list(arrays, names)
    n = len(offsets) - 1
    if names is not None and len(names) != n:
        raise TrajectoryError(f"expected one name for each of the {n} movements, got {len(names)}")
    if times is None:
        way = _TIME_LAST if is_block and arrays.ndim == 3 else "transpose the array" if is_block else _EACH
        # Refuse a movement without time stamps that has more dimensions than samples; stamps say which axis is time.
        n_dims = positions.shape[1]
        lengths = np.diff(offsets)
        if (wide := lengths < n_dims).any():
            i = int(np.argmax(wide))
            raise TrajectoryError(
                f"{describe(i, names)}: expected samples along the first axis and dimensions along the last, got shape "
                f"({lengths[i]}, {n_dims}), more dimensions than samples; {way}, or, if it is right, pass "
                "its time stamps: kineme.Trajectory(times, array), or times= of Demonstrations.from_arrays"
            )
    check_finite(positions, offsets, names, "positions")
    check_extents(positions, offsets, names)
    stamps = None if times is None else _concatenate_times(times, offsets, names)
    durations = np.ones(n) if stamps is None else stamps[offsets[1:] - 1] - stamps[offsets[:-1]]
    return Movements(
        positions,
        offsets,
        durations,
        stamps,
        None if labels is None else label_array(labels, n, names),
        None if names is None else tuple(names),
    )


def _from_block(block: NDArray[Any], copy: bool) -> tuple[Array, NDArray[np.intp]]:
    if block.ndim not in (1, 2, 3):
        raise TrajectoryError(
            f"expected an array of shape (n, T, d), movements by samples by dimensions, or one movement of shape "
            f"(T, d), got shape {block.shape}"
        )
    is_many = block.ndim == 3
    block = block if is_many else block[None] if block.ndim == 2 else block[None, :, None]
    if len(block) == 0:
        raise TrajectoryError("expected at least one movement, got none")
    if block.dtype.kind not in "biuf":
        raise TrajectoryError(f"expected positions to be an array of numbers, got an array of type {block.dtype}")
    refuse_lossy(block, "the block")
    if is_many and block.shape[1] < MIN_SAMPLES <= block.shape[2]:
        raise TrajectoryError(
            f"expected an array of shape (n, T, d), movements by samples by dimensions, got shape {block.shape}; "
            f"{_TIME_LAST}"
        )
    if (integer := too_long_integer(block)) is not None:
        raise TrajectoryError(f"the block: expected positions that floats can hold, got {integer}{ROUNDED}")
    as_positions(block[0], "every movement of the block" if is_many else "the movement")
    n, n_samples, n_dims = block.shape
    flat = np.array(block, dtype=np.float64, order="C", copy=True if copy else None)
    return flat.reshape(-1, n_dims), np.arange(n + 1) * n_samples


def _from_list(given: Sequence[ArrayLike], names: Sequence[str | None] | None) -> tuple[Array, NDArray[np.intp]]:
    arrays: list[Any] = list(given)
    for array in arrays:
        if isinstance(array, (str, PurePath)):
            raise TrajectoryError(f"expected movements as (T, d) arrays, got {array!r}{_instead_of(array)}")
    names_of_arrays = tuple(names) if names is not None and len(names) == len(arrays) else None
    if not _are_plain(arrays, 2) or min(map(len, arrays)) < MIN_SAMPLES or not min(map(attrgetter("size"), arrays)):
        arrays = _check_each(as_positions, (arrays,), names_of_arrays)
    return _concatenate(arrays, names_of_arrays)


def _check_sized(value: Any, expected: str) -> None:
    if (
        not hasattr(value, "__len__")
        or isinstance(value, (str, bytes, dict))
        or hasattr(value, "to_frame")
        or getattr(value, "ndim", 1) == 0
    ):
        raise TrajectoryError(f"expected {expected}, got {type(value).__name__}{_instead_of(value)}")


def _instead_of(value: Any) -> str:
    """Say what to pass instead of something that is no list and no array."""
    if isinstance(value, (str, PurePath)):
        return "; read files with kineme.read_recordings(path)"
    if isinstance(value, dict):
        return "; pass its values as a list, or a table as a data frame"
    if isinstance(value, Iterator):
        return "; pass list(...) of it"
    return "; pass its numbers, series.to_numpy()" if hasattr(value, "to_frame") else ""


def _check_each(check: Callable[..., Array], columns: tuple[Iterable[Any], ...], names: Names) -> list[Array]:
    """Check movement by movement, to name the invalid one; runs only after a check of all has failed."""
    try:
        return list(map(check, *columns))
    except TrajectoryError:
        for i, values in enumerate(zip(*columns, strict=True)):
            check(*values, who=describe(i, names))
        raise


def _concatenate(checked: list[Array], names: Names) -> tuple[Array, NDArray[np.intp]]:
    if not checked:
        raise TrajectoryError("expected at least one movement, got none")
    lengths = np.fromiter(map(len, checked), np.intp, len(checked))
    try:
        return np.concatenate(checked), np.concatenate(([0], np.cumsum(lengths)))
    except ValueError:
        n_dims = checked[0].shape[1]
        odd = next(i for i, x in enumerate(checked) if x.shape[1] != n_dims)
        way = f"; {_EACH}" if len({*lengths.tolist()}) == 1 and lengths[0] < n_dims else ""
        raise TrajectoryError(
            f"{describe(odd, names)}: expected {n_dims} dimensions as in trajectory 0, "
            f"got {checked[odd].shape[1]}; movements of one batch share their dimensions{way}"
        ) from None


def _concatenate_times(
    times: Sequence[ArrayLike] | Array, offsets: NDArray[np.intp], names: Sequence[str | None] | None
) -> Array:
    n, lengths = len(offsets) - 1, np.diff(offsets)
    times = as_array(times, "times")
    if isinstance(times, np.ndarray) and times.dtype != object and times.ndim == 1:
        times = [times] * n
    _check_sized(times, "times as a list of (T,) arrays or one (T,) array")
    if len(times) != n:
        raise TrajectoryError(f"expected times for each of the {n} movements, got {len(times)}")
    own: list[Any] = list(times)
    if not _are_plain(own, 1) or list(map(len, own)) != lengths.tolist():
        own = _check_each(as_times, (own, lengths.tolist()), tuple(names) if names else None)
    stamps = np.concatenate(own)
    check_times(stamps, offsets, names)
    return stamps


def _are_plain(arrays: list[Any], n_axes: int) -> bool:
    """Tell whether there are arrays, and all are float64 with that many axes: a quick check of the usual case."""
    return (
        set(map(type, arrays)) == {np.ndarray}
        and set(map(attrgetter("dtype"), arrays)) == {_FLOAT64}
        and set(map(attrgetter("ndim"), arrays)) == {n_axes}
    )

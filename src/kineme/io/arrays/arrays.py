"""Movements from named arrays of NPZ and JSON: which arrays are times and positions, of one movement or of many."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.arrays.trees import SAY_STEP, STAMP, rate_of, seconds_named
from kineme.movements.tables.columns import column_numbers, is_header_stamp, is_time
from kineme.movements.tables.layout import Block, Detected, Layout, Parsed, distinct, listed
from kineme.movements.tables.table import as_name
from kineme.movements.tables.time_stamps import in_seconds, nanoseconds, unit_by_size, unit_in_head
from kineme.movements.trajectories.movements import axis_names
from kineme.validation import MIN_SAMPLES, ROUNDED, Array, too_long_integer

#: The layout of texts of which each line is a movement.
ROWS = "rows"
#: Entries that name the columns of positions, and those of velocities and accelerations.
COLUMNS, RATES = "columns", "rates"
POSITIONS, TIMES, LABELS = ("positions", "x", "pos"), ("times", "t", "time"), ("labels", "label", "y")

_BESIDE = {*TIMES, *LABELS, COLUMNS, "offsets"}  # arrays that say something of positions
_COMPARED = 1000  # movements of an array whose steps are compared
_RAGGED = (
    "expected times and positions with rows of one length, got rows that differ in length or depth; "
    "name movements of unequal length positions_0, times_0, positions_1, ..."
)


def arrays_movements(arrays: Mapping[str, Any], layout: Layout, kind: str) -> Parsed:
    """Return the movements in named arrays.

    - ``positions`` (T, d) or (T,), ``times`` (T,): one movement.
    - ``positions`` (n, T, d), ``times`` (T,) or (n, T): many of equal length.
    - ``positions`` (total, d), ``times`` (total,), ``offsets`` (n + 1,): many, one after the other, as `Demonstrations`
      holds them.
    - ``positions_0``, ``positions_1``, ... (T_i, d), ``times_0``, ...: many of unequal length. With times of each, the
      numbers may begin elsewhere, and some may be left out.

    ``x`` and ``pos`` mean positions, ``t`` and ``time`` times; ``labels`` or ``y`` (n,) names the actions; ``x``, ``y``
    and ``z`` that are all (T,) are the coordinates of one movement; ``columns`` (d,) names the coordinates.
    Where there are no times, a rate (``fps``, ``dt``, ...) gives them; else movements of ``positions`` (n, T, d) and
    ``positions_0`` are evenly sampled over one second.
    """
    axes = [name for name in "xyz" if name in arrays]
    if axes[:2] == ["x", "y"] and len({np.shape(arrays[name]) for name in axes}) == 1 and np.ndim(arrays["x"]) == 1:
        x = np.column_stack([numbers_of(arrays[name]) for name in axes])
        others = [name for name in arrays if name not in axes and (name in _BESIDE or seconds_named(name) is not None)]
        arrays = {name: arrays[name] for name in others} | {POSITIONS[0]: x}
    key, places = first_named(arrays, POSITIONS), None
    if key is not None:
        xs, ts, how = _of_one(arrays, numbers_of(arrays[key]), layout)
    else:
        xs, ts, how, places = _numbered(arrays)
    if ts is None and not isinstance(layout.units, float | int) and (rate := rate_of(arrays)) is not None:
        check_first_axis([x.shape for x in xs])
        ts, layout = [rate.stamps(len(x)) for x in xs], replace(layout, units="s")
    shape: tuple[int, ...] = () if key is None else np.shape(arrays[key])
    columns = point_names(*shape[1:]) if len(shape) == 3 and len(xs) < shape[0] else None
    names = np.asarray(arrays[COLUMNS]) if COLUMNS in arrays else None
    if names is not None and names.ndim == 1 and names.dtype.kind == "U":
        columns = [str(name) for name in names.tolist()] or columns
    named = Named(_labels(arrays, len(xs)), first_named(arrays, TIMES) or STAMP, places, columns)
    return parsed_arrays(xs, ts, named, layout, (kind, how))


class Named(NamedTuple):
    """Names of movements of arrays: labels, the array of time stamps, the place of each movement, coordinates."""

    labels: Sequence[str | None]
    time: str
    places: list[str] | None = None
    columns: Sequence[str] | None = None


def parsed_arrays(
    xs: Sequence[Array], ts: Sequence[Array] | None, named: Named, layout: Layout, detected: tuple[str, str]
) -> Parsed:
    """Return movements xs (T_i, d) with stamps ts (T_i,) as `Parsed`."""
    labels, time, places, columns = named
    dims = sorted({x.shape[1] for x in xs})
    if len(dims) != 1 or dims == [0]:
        raise DataError(f"expected movements of the same dimensions, at least one, got {dims}")
    if ts is not None and [len(t) for t in ts] != [len(x) for x in xs]:
        odd = next(i for i, (t, x) in enumerate(zip(ts, xs, strict=True)) if len(t) != len(x))
        raise DataError(f"expected one time stamp per sample, got {len(ts[odd])} for {len(xs[odd])} in movement {odd}")
    offsets = np.concatenate(([0], np.cumsum([len(x) for x in xs]))).astype(np.intp)
    units, said_by = layout.units, "given"
    stamps = None
    if ts is not None:
        stamps = np.concatenate(ts)
        if units is None:
            named_in = unit_in_head(time)
            units, said_by = (named_in, "head") if named_in else unit_by_size(stamps, time)
        stamps = in_seconds(stamps, units)
    elif isinstance(units, float | int):
        stamps = np.concatenate([np.arange(len(x)) * float(units) for x in xs])
    else:
        units, said_by = "s", "no times: one second each"
        if detected[1] != ROWS:  # a line says which of its numbers are one sample
            check_first_axis([x.shape for x in xs])
    positions = np.concatenate(xs)
    is_named = columns is not None
    columns = distinct(columns or axis_names(positions.shape[1]))
    if len(columns) != positions.shape[1]:
        raise DataError(f"expected a name for each of the {positions.shape[1]} coordinates, got {listed(columns)}")
    if layout.coordinates is not None:
        chosen = column_numbers(columns, layout.coordinates)
        columns, positions = tuple(columns[k] for k in chosen), positions[:, chosen]
    if places is None:
        places = [""] if detected[1] == "single" else [str(i) for i in range(len(xs))]
    block = Block(positions, stamps, offsets, list(labels), places)
    how = Detected(detected[0], detected[1], columns, None if ts is None else time, units, said_by, named=is_named)
    return Parsed(how, block)


def check_first_axis(shapes: Iterable[tuple[int, ...]]) -> None:
    """Refuse movements (T, d) without stamps of more dimensions than samples: time may run along the last axis."""
    if wide := [shape for shape in shapes if shape[0] < math.prod(shape[1:])]:
        raise DataError(
            f"expected samples along the first axis of each movement, got shape {wide[0]}, more dimensions than "
            "samples; if time runs along the last axis, as in (n, d, T), save np.moveaxis(array, 1, 2), of one "
            "movement array.T; if it is right, say the step between samples with units=, in the shell --units"
        )


def sets_or_points(xs: list[Array], every: int | None) -> list[Array]:
    """Tell n movements (T, d) that are one array (n, T, d) from the T points of one movement, (n, T d).

    Nobody says which axis is time, but places change less from sample to sample than from point to point, and less than
    between movements that are not all but equal. As many samples as `every` says are a movement.
    """
    if len(xs) < MIN_SAMPLES or len({x.shape for x in xs}) > 1 or not 1 < math.prod(xs[0].shape[1:]) <= len(xs[0]):
        return xs
    n, length = len(xs), len(xs[0])
    if every is not None:
        return [np.stack(xs).reshape(n, -1)] if every == n != length else xs
    compared = np.stack(xs[:_COMPARED])
    steps = [float(np.nan_to_num(np.abs(np.diff(compared, axis=axis))).mean()) for axis in (0, 1)]
    if length < MIN_SAMPLES or steps[0] < steps[1]:
        raise DataError(
            f"expected movements (n, T, d), got an array of shape {(n, *xs[0].shape)}, which may be one movement of "
            f"{n} samples of {length} points: it changes less along the first axis than along the second; say every="
            f"{n} if it is, every={length} if these are {n} movements of {length} samples, in the shell --every"
        )
    return xs


def point_names(n_points: int, width: int) -> list[str]:
    """Return names of the coordinates of points without names: 0.x, 0.y, 0.z, 1.x, ..."""
    ends = "xyz"[:width] if width in (2, 3) else range(width)
    return [f"{k}.{end}" for k in range(n_points) for end in ends]


def has_known_names(names: Collection[str]) -> bool:
    """Tell whether arrays have the names of `arrays_movements`, with no times of another name, or none of movements."""
    if not any(name in names or _ends_of(name, names) for name in POSITIONS):
        return all(seconds_named(name) is not None for name in {*names} - {*TIMES, *LABELS, "offsets"})
    has_times = not {*TIMES, "offsets"}.isdisjoint(names)
    return has_times or not any(is_time(name) or is_header_stamp(name) for name in names)


def numbers_of(values: Any, of_time: bool = False) -> Array:
    """Give an array as float64; dates and durations as nanoseconds. Only in stamps, `of_time`, integers are rounded."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise DataError(_RAGGED) from error
    if array.dtype.kind == "c":
        raise DataError(f"expected real numbers, got {array.dtype}; save both parts as columns")
    if array.dtype.kind in "mM":
        return nanoseconds(array)
    if not of_time and (integer := too_long_integer(array)) is not None:
        raise DataError(f"expected positions that floats can hold, got {integer}{ROUNDED}")
    try:
        return array.astype(np.float64, copy=False)
    except (ValueError, TypeError) as error:
        raise DataError(f"expected numbers in times and positions, got {_no_number(array)!r:.80}") from error


def _no_number(array: NDArray[Any]) -> Any:
    for number in array.ravel().tolist():
        try:
            float(np.float64(number))
        except (ValueError, TypeError):
            return number
    return array.dtype.name


def first_named(arrays: Collection[str], names: Sequence[str]) -> str | None:
    """Return the first of some names that an array has, or None."""
    return next((name for name in names if name in arrays), None)


def _of_one(arrays: Mapping[str, Any], x: Array, layout: Layout) -> tuple[list[Array], list[Array] | None, str]:
    key = first_named(arrays, TIMES)
    t = None if key is None else numbers_of(arrays[key], of_time=True)
    t = t.ravel() if t is not None and t.ndim == 2 and t.shape != x.shape[:2] and 1 in t.shape else t
    if x.ndim == 3 and t is None and first_named(arrays, LABELS) is None:
        xs = sets_or_points(list(x), layout.every)
        x = x if len(xs) == len(x) else xs[0]
    elif x.ndim == 3 and t is not None and t.shape == x.shape[:1] != x.shape[1:2]:  # points at each of these times
        x = x.reshape(len(x), -1)
    if x.ndim == 3:
        if t is not None and t.shape not in (x.shape[1:2], x.shape[:2]):
            raise DataError(f"expected times of shape {x.shape[1:2]} or {x.shape[:2]}, got {t.shape}")
        return list(x), None if t is None else list(np.broadcast_to(t, x.shape[:2])), "(n, T, d)"
    x = x[:, None] if x.ndim == 1 else x
    if x.ndim != 2:
        raise DataError(f"expected positions of shape (T, d) or (n, T, d), got {x.shape}")
    if t is None and not isinstance(layout.units, float | int) and rate_of(arrays) is None:
        got = listed(arrays) if len(arrays) > 1 else f"positions of shape {x.shape} alone"
        raise DataError(f"expected times beside the positions, got {got}{SAY_STEP}")
    if t is not None and t.shape != x.shape[:1]:
        raise DataError(f"expected one time stamp for each of the {len(x)} samples, got times of shape {t.shape}")
    if "offsets" not in arrays:
        return [x], None if t is None else [t], "single"
    inner = np.asarray(arrays["offsets"])
    if inner.ndim != 1 or inner.dtype.kind not in "iu" or len(inner) < 2 or (inner[1:] < inner[:-1]).any():
        raise DataError("expected offsets as whole numbers that do not decrease, (n + 1,)")
    if inner[0] != 0 or inner[-1] != len(x):
        raise DataError(f"expected offsets from 0 to {len(x)}, got {inner[0]} to {inner[-1]}")
    cuts = inner[1:-1].astype(np.intp)
    return np.split(x, cuts), None if t is None else np.split(t, cuts), "offsets"


def _ends_of(prefix: str, names: Collection[str]) -> list[str]:
    """Return the numbers behind a prefix in their order, where they count movements: from 0, or with times of each."""
    ends = [match[1] for name in names if (match := re.fullmatch(rf"{prefix}_([0-9]{{1,9}})", name))]
    timed = [
        end for end in ends if first_named(names, [f"{clock}_{end}" for clock in TIMES]) and f"y_{end}" not in names
    ]
    return sorted(ends, key=int) if "0" in ends or timed else []


def _numbered(arrays: Mapping[str, Any]) -> tuple[list[Array], list[Array] | None, str, list[str]]:
    prefix = next((name for name in POSITIONS if _ends_of(name, arrays)), None)
    if prefix is None:
        raise DataError(f"expected arrays times and positions, got no entry 'positions' but {listed(arrays)}")
    ends = _ends_of(prefix, arrays)
    xs = [numbers_of(arrays[f"{prefix}_{end}"]) for end in ends]
    xs = [x[:, None] if x.ndim == 1 else x for x in xs]
    if odd := [x.shape for x in xs if x.ndim != 2]:
        raise DataError(f"expected positions of shape (T, d), got {odd[0]}")
    clock = next((name for name in TIMES if any(f"{name}_{end}" in arrays for end in ends)), None)
    if clock is None:
        return xs, None, "numbered", ends
    try:
        return xs, [numbers_of(arrays[f"{clock}_{end}"], of_time=True).ravel() for end in ends], "numbered", ends
    except KeyError as error:
        raise DataError(f"expected times for each of the {len(ends)} movements, got no entry {error}") from error


def _labels(arrays: Mapping[str, Any], n: int) -> list[str | None]:
    key = first_named(arrays, LABELS)
    if key is None:
        return [None] * n
    given = arrays[key]
    if not isinstance(given, np.ndarray):  # from JSON: NumPy would convert numbers beside texts to texts
        labels = given if isinstance(given, list) else [given]
        given = np.empty(len(labels), dtype=object)
        given[:] = labels
    if np.atleast_1d(given).shape != (n,):
        shape = np.atleast_1d(given).shape
        raise DataError(f"expected one label for each of the {n} movements, got labels of shape {shape}")
    return [_label(i, label) for i, label in enumerate(np.atleast_1d(given).tolist())]


def _label(i: int, value: Any) -> str | None:
    if isinstance(value, (list, dict, tuple)) or value != value:  # noqa: PLR0124 - only NaN differs from itself
        raise DataError(
            f"movement {i}: expected a label that is text or a number, got {value!r}; name the action, or write an "
            "empty text where it has no name"
        )
    return (value.decode("utf-8", "replace") if isinstance(value, bytes) else as_name(value)) or None

"""Validation of user input: the only place that converts it to arrays and refuses what cannot be used.

Inside the library arrays are trusted. No function here writes to an array of the caller.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import DataError, SpecificationError, TrajectoryError

Array = NDArray[np.float64]

MIN_SAMPLES = 4  # a not-a-knot cubic spline needs four
LARGEST = 1e100  # of parameters and options: cubes of larger numbers, or of 1 over them, may overflow
MOST_NUMBERS = 50_000_000  # samples times basis functions of one movement: matrices of gigabytes
#: Range of positions and extents, in the movement's unit: their squares, and accelerations, stay finite.
LARGEST_POSITION, SMALLEST_EXTENT = LARGEST, 1 / LARGEST
SHORTEST_STEP, LARGEST_STAMP = 1e-50, 1e50  # seconds
_SMALL_POSITION = SMALLEST_EXTENT / np.finfo(np.float64).eps  # beyond it, no extent can be too small
_FLOAT64 = np.dtype(np.float64)
_NO_ARRAY = ("demonstrations", "columns", "to_frame")  # of movements, of tables and of their columns


def describe(index: int, names: Sequence[str | None] | None) -> str:
    """Name one movement for error messages: by its index and, where it has one, its name."""
    name = names[index] if names else None
    return f"trajectory {index}" + (f" ({name!r})" if name else "")


def _is_float64(values: Any) -> TypeGuard[Array]:
    """Tell whether this is an array that needs no conversion: the usual case, asked once per movement."""
    return type(values) is np.ndarray and values.dtype is _FLOAT64


ROUNDED = ", which would be rounded; subtract an offset, or leave the column out"
_EXACT_TO = 2**53


def refuse_lossy(values: Any, who: str) -> None:
    """Refuse what NumPy would turn into plain numbers silently: masked samples and imaginary parts would be lost."""
    if type(values) is np.ndarray and values.dtype.kind == "f":
        return
    n_masked = int(values.mask.sum()) if isinstance(values, np.ma.MaskedArray) else 0
    if n_masked:
        raise TrajectoryError(f"{who}: expected an array of numbers, got one with {n_masked} masked; drop the samples")
    if getattr(getattr(values, "dtype", None), "kind", "") == "c":
        raise TrajectoryError(f"{who}: expected real numbers, got {values.dtype}; pass both parts as columns")


def too_long_integer(values: Any) -> int | None:
    """The first integer of an array beyond 2^53, which a number of 64 bits would round; None where there is none."""
    if not (isinstance(values, np.ndarray) and values.dtype.kind in "iu" and values.dtype.itemsize == 8):
        return None
    long = (values > _EXACT_TO) if values.dtype.kind == "u" else (values > _EXACT_TO) | (values < -_EXACT_TO)
    return int(values[long][0]) if long.any() else None


def as_array(values: Any, who: str = "movements") -> Any:
    """An ndarray of an array of any package, as of PyTorch, and of objects that are numbers; all else as it is."""
    if isinstance(values, np.ndarray):
        is_hidden = values.dtype == object and values.size and all(isinstance(item, Real) for item in values.flat)
        return values.astype(np.float64) if is_hidden else values
    if isinstance(values, (list, tuple, np.generic)) or any(hasattr(values, name) for name in _NO_ARRAY):
        return values
    try:
        values = values.detach() if hasattr(values, "detach") else values  # PyTorch does not convert what has gradients
        if hasattr(values, "__array__") or isinstance(values, memoryview):
            return np.asarray(values)
        return np.from_dlpack(values) if hasattr(values, "__dlpack__") else values
    except (TypeError, ValueError, RuntimeError, BufferError) as error:
        raise TrajectoryError(f"{who}: expected an array of numbers, got {error}") from error


def as_numbers(values: ArrayLike, who: str, expected: str = "an array of numbers") -> Array:
    """Anything that NumPy converts to numbers, as float64; complex numbers are refused, also inside lists."""
    if _is_float64(values):
        return values
    values = as_array(values, who)
    refuse_lossy(values, who)
    try:
        array = np.asarray(values)
        hidden = array.dtype.kind == "O" and any(isinstance(item, (complex, np.complexfloating)) for item in array.flat)
        numbers = None if hidden or array.dtype.kind == "c" else array.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise TrajectoryError(f"{who}: expected {expected}, got {error}") from error
    if numbers is None:
        raise TrajectoryError(f"{who}: expected real numbers, got complex ones; pass both parts as columns")
    return numbers


def as_positions(positions: ArrayLike, who: str = "trajectory") -> Array:
    """Check one movement's positions and return them as float64 of shape (T, d).

    A 1-D array is one degree of freedom. Finiteness is checked by `check_finite`, for all movements at once.
    """
    if _is_float64(positions) and positions.ndim == 2 and len(positions) >= MIN_SAMPLES and positions.shape[1]:
        return positions
    positions = as_array(positions, who)
    x = as_numbers(positions, who, "positions to be an array of numbers")
    if x is not positions and (integer := too_long_integer(np.asarray(positions))) is not None:
        raise TrajectoryError(f"{who}: expected positions that floats can hold, got {integer}{ROUNDED}")
    flat = x.ndim == 1
    if flat:
        x = x[:, None]
    if x.ndim != 2 or x.shape[1] == 0:
        raise TrajectoryError(
            f"{who}: expected positions of shape (T, d), samples by dimensions, got shape {x.shape}; "
            "pass many movements as a list of (T, d) arrays or one (n, T, d) array"
        )
    if len(x) < MIN_SAMPLES:
        raise TrajectoryError(
            f"{who}: expected at least {MIN_SAMPLES} samples, got {len(x)}"
            + (
                "; samples run along the first axis: transpose the array"
                if x.shape[1] >= MIN_SAMPLES and len(x)
                else ""
            )
            + ("; pass one movement of several dimensions as [array]" if flat else "")
        )
    return x


def check_finite(values: Array, offsets: NDArray[np.intp], names: Sequence[str | None] | None, what: str) -> None:
    """Refuse NaN, infinity and what is out of range in (total, ...) `values`; name the movement and the sample."""
    largest = LARGEST_STAMP if what == "times" else LARGEST_POSITION
    with np.errstate(invalid="ignore", over="ignore"):
        flat = values.ravel()
        squares = np.einsum("i,i->", flat, flat)  # one quick pass in one thread, without a temporary
    if squares <= largest**2:
        return
    good = np.abs(values) <= largest
    if good.all():
        return
    row = int(np.argmin(good.reshape(len(values), -1).all(axis=1)))
    i = int(np.searchsorted(offsets, row, side="right")) - 1
    if np.isfinite(values[row]).all():
        raise TrajectoryError(
            f"{describe(i, names)}: expected {what} up to {largest:g}, got {values[row].tolist()} at sample "
            f"{row - offsets[i]}; choose a unit in which they are"
        )
    raise TrajectoryError(
        f"{describe(i, names)}: expected finite {what}, got {values[row].tolist()} at sample "
        f"{row - offsets[i]}; remove the sample (its neighbors are interpolated on their time stamps) or repair it"
    )


def check_times(times: Array, offsets: NDArray[np.intp], names: Sequence[str | None] | None) -> None:
    """Refuse concatenated time stamps (total,) that do not strictly increase within each movement."""
    check_finite(times, offsets, names, "times")
    short = np.diff(times) < SHORTEST_STEP
    short[offsets[1:-1] - 1] = False  # from one movement to the next
    if not short.any():
        return
    row = int(np.argmax(short)) + 1
    i = int(np.searchsorted(offsets, row, side="right")) - 1
    k = row - offsets[i]
    if times[row] > times[row - 1]:
        raise TrajectoryError(
            f"{describe(i, names)}: expected at least {SHORTEST_STEP:g} s between stamps, got "
            f"{times[row - 1]:.9g} and {times[row]:.9g} at samples {k - 1} and {k}; times are in seconds"
        )
    problem = "duplicate" if times[row] == times[row - 1] else "decreasing"
    raise TrajectoryError(
        f"{describe(i, names)}: expected strictly increasing times, got {problem} stamps "
        f"{times[row - 1]:.9g} and {times[row]:.9g} at samples {k - 1} and {k}; sort the samples and drop repeated ones"
    )


def stays(starts: Array, extents: Array) -> NDArray[np.bool_]:
    """Tell which movements stay at their starts (n, d), to rounding; extents (n, d)."""
    return np.asarray((extents <= 8 * np.finfo(float).eps * np.abs(starts)).all(axis=1))


def too_small(positions: Array, offsets: NDArray[np.intp]) -> list[tuple[int, float]]:
    """Movements so small that the squares of their positions underflow, with their extents."""
    suspects = np.arange(len(offsets) - 1)
    for probe in (offsets[1:] - 1, offsets[:-1], (offsets[:-1] + offsets[1:]) // 2):
        small = np.abs(positions[probe[suspects]]) < _SMALL_POSITION
        suspects = suspects[small.all(axis=1)] if small.any() else suspects[:0]
        if not len(suspects):
            return []
    own = [(int(i), positions[offsets[i] : offsets[i + 1]]) for i in suspects]
    extents = [(i, float(np.ptp(x, axis=0).max())) for i, x in own]
    return [(i, extent) for i, extent in extents if 0 < extent < SMALLEST_EXTENT]


def check_extents(positions: Array, offsets: NDArray[np.intp], names: Sequence[str | None] | None) -> None:
    """Refuse a movement whose extent is too small; one that does not move at all is handled later."""
    for i, extent in too_small(positions, offsets):
        raise TrajectoryError(
            f"{describe(i, names)}: expected an extent of at least {SMALLEST_EXTENT:g}, got {extent:g}; "
            "choose a unit in which it is"
        )


def as_times(times: ArrayLike, n_samples: int, who: str = "trajectory") -> Array:
    """Check that one movement's time stamps are (n_samples,) numbers."""
    if _is_float64(times) and times.shape == (n_samples,):
        return times
    if getattr(times, "dtype", np.float64) != np.float64 and np.asarray(times).dtype.kind in "Mm":
        raise TrajectoryError(
            f"{who}: expected times in seconds, got {times.dtype}, which counts in a unit of its own; "  # type: ignore[union-attr]
            "pass (times - times[0]) / np.timedelta64(1, 's')"
        )
    t = as_numbers(times, who, "times in seconds")
    if t.shape != (n_samples,):
        raise TrajectoryError(
            f"{who}: expected one time stamp for each of the {n_samples} samples, got times of shape {t.shape}"
        )
    return t


def as_point(name: str, values: ArrayLike, axes: Sequence[str]) -> Array:
    """Return one finite number for each axis, as float64 (n,)."""
    point = as_numbers(values, name)
    if point.shape != (len(axes),) or not np.isfinite(point).all():
        words = f"{len(axes)} finite numbers, {', '.join(axes)}"
        raise SpecificationError(f"expected {name} as {words}, got {np.asarray(values).tolist()!r:.80}")
    return point


def as_path(path: Any, expected: str, instead: str = "") -> Path:
    """A path as `Path`; anything else is refused as not what was `expected`, with what to do `instead`."""
    try:
        return Path(path)
    except TypeError:
        hint = f"; {instead}" if instead else ""
        raise TypeError(f"expected {expected}, got {type(path).__name__}{hint}") from None


def check_form(data: Any, what: str, form: str, version: int, remedy: str = "") -> None:
    """Refuse data read from JSON that is not `what`, a mapping of that format and of that version or an earlier one."""
    name = data.get("format") if isinstance(data, Mapping) else type(data).__name__
    if name != form:
        raise DataError(f"expected a {what}, a mapping with format {form!r}, got {name!r}{remedy and f'; {remedy}'}")
    if not isinstance(data.get("version"), int) or data["version"] > version:
        raise DataError(
            f"expected a {what} of version {version} or earlier, got {data.get('version')!r}; upgrade kineme"
        )


def check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    """Refuse a value that is not in a table's keys; list what is."""
    if not isinstance(value, str) or value not in choices:
        raise SpecificationError(f"expected {name} to be one of {list(choices)}, got {value!r}")


def check_number(  # noqa: PLR0913 - bounds of every kind
    name: str,
    value: Any,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    most: float = LARGEST,
    smallest: float = 1 / LARGEST,
    optional: bool = False,
) -> None:
    """Refuse a parameter that is not a finite number in its range, or too close to 0 to be divided by."""
    if optional and value is None:
        return
    bound = f" above {above:g}" if above is not None else f" of at least {least:g}" if least is not None else ""
    bound += "" if below is None else f" and below {below:g}"
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:  # an integer beyond the range of floats
        number = math.inf
    outside = (above is not None and number <= above) or (least is not None and number < least)
    outside |= below is not None and number >= below
    if not math.isfinite(number) or outside:
        raise SpecificationError(f"expected {name} to be a number{bound}, got {value!r}")
    if not (number == 0 or smallest <= abs(number) <= most):
        raise SpecificationError(f"expected {name} to be a number from {smallest:g} to {most:g}, got {value!r}")


def check_count(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Return a parameter as an int; refuse it unless it is a whole number from `least` to `most`."""
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = least - 1
    if number < least:
        raise SpecificationError(f"expected {name} to be a whole number of at least {least}, got {value!r}")
    if most is not None and number > most:
        raise SpecificationError(f"expected {name} to be at most {most:,}, got {value!r}")
    return number


def check_samples(n_samples: float, n_basis: int, parameter: str) -> int:
    """Return a number of samples; refuse it where the matrix that generates them is too large for memory."""
    most = MOST_NUMBERS // int(n_basis)
    if not n_samples <= most:
        got = f"{n_samples:.3g}" if n_samples < LARGEST else "far more"
        raise SpecificationError(
            f"expected {parameter} to ask for at most {most:,} samples with {n_basis} basis functions, got {got}; "
            "lower it, or generate the movement in parts"
        )
    return math.ceil(n_samples)


def check_seed(name: str, value: Any) -> None:
    """Refuse a seed that is not a whole number from 0, or a sequence of such numbers."""
    several = isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim == 1)
    numbers = value if several and len(value) else [value]
    for number in numbers:
        check_count(name, number, 0)


def check_switch(name: str, value: Any) -> None:
    """Refuse a value that is not a bool."""
    if not isinstance(value, bool | np.bool_):
        raise SpecificationError(f"expected {name} to be True or False, got {value!r}")

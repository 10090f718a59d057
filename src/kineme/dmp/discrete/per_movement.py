"""Options of generated movements, one for all or one for each: what users give, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.validation import LARGEST, LARGEST_STAMP, SHORTEST_STEP, Array, as_numbers


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
    if n_dims is None:
        value = value[None] if value.ndim == 0 else value
        fits = value.ndim == 1
    else:
        value = value[None] if value.ndim == 1 else value
        fits = value.ndim == 2 and value.shape[1] == n_dims
    if not fits:
        shape = "a number or (n,)" if n_dims is None else f"({n_dims},) or (n, {n_dims})"
        raise TrajectoryError(f"expected {name} of shape {shape}, got shape {np.shape(option)}")
    if (bad := ~np.isfinite(value)).any():
        raise TrajectoryError(f"expected finite numbers for {name}, got {_first(value, bad)}")
    if (bad := np.abs(value) > LARGEST).any():
        raise TrajectoryError(
            f"expected numbers up to {LARGEST:g} for {name}, got {_first(value, bad)}; choose another unit"
        )
    return value


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

"""Where a movement is to be, and how fast, at some times: what users write, checked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.validation import LARGEST, Array, as_numbers


class Observations(NamedTuple):
    """The m d values of one kind that may be observed, of which NaN are not."""

    times: Array  # (m,), shares of the duration
    values: Array  # (m, d)
    deviations: Array  # (m, d)


def as_observation_times(t: ArrayLike) -> Array:
    """Times (m,) between 0 and 1."""
    times = np.atleast_1d(as_numbers(t, "t"))
    if times.ndim != 1 or not len(times) or not ((times >= 0.0) & (times <= 1.0)).all():
        raise SpecificationError(f"expected t between 0 and 1, as shares of the duration, got {t!r}")
    return times


def as_observations(name: str, times: Array, values: ArrayLike, std: ArrayLike, n_dims: int) -> Observations:
    """Check values (m, d), with NaN for dimensions that are free, and their standard deviations."""
    m = len(times)
    x = as_numbers(values, name)
    x = x.reshape(m, n_dims) if x.shape in _shapes(m, n_dims) else x
    if x.shape != (m, n_dims):
        shape = f"({n_dims},) or (1, {n_dims})" if m == 1 else f"({m}, {n_dims})"
        raise TrajectoryError(f"expected {name} of shape {shape}, one for each of {m} times, got {np.shape(values)}")
    if (np.abs(x) > LARGEST).any() or np.isnan(x).all():
        raise TrajectoryError(
            f"expected {name} to be numbers up to {LARGEST:g}, with NaN for dimensions that are free, got {values!r}"
        )
    s = as_numbers(std, "std")
    if s.ndim == 1 and len(s) == m and (m > 1 or n_dims == 1):
        s = s[:, None]
    try:
        deviations = np.broadcast_to(s, (m, n_dims))
    except ValueError:
        raise SpecificationError(
            f"expected std to be a number or of shape ({m},) or ({m}, {n_dims}), got {s.shape}"
        ) from None
    if not (deviations >= 0.0).all():
        raise SpecificationError(f"expected std of 0 or more, got {std!r}")
    free = deviations > LARGEST  # infinitely uncertain: not observed
    return Observations(times, np.where(free, np.nan, x), np.where(free, 0.0, deviations))


def _shapes(m: int, n_dims: int) -> tuple[tuple[int, ...], ...]:
    """What stands for (m, d) without doubt."""
    one = ((n_dims,),) if m == 1 else ()
    return (*one, *(((m,),) if n_dims == 1 else ()), *(((),) if m == n_dims == 1 else ()))

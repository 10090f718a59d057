"""Signals over time as pages draw them: thinned to the width of a picture, with every peak."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kineme.studio.server.records import numbers
from kineme.validation import Array

_DIGITS = 5  # of a value: more than any screen shows


def envelope(times: Array, values: Array, width: int) -> tuple[Array, Array]:
    """Reduce signals (T, d) to the least and the greatest value of each of at most `width` stretches of equal count.

    Returns times (n,) and values (n, d) with n at most 2 `width`: two for each stretch, at its first and its last
    sample, in the order in which the extremes occurred. What is no number is passed over; a stretch without numbers is
    NaN. Signals of at most 2 `width` samples are returned as they are.
    """
    n, d = values.shape
    if n <= 2 * width:
        return times, values
    size = -(-n // width)  # samples of a stretch
    starts = np.arange(0, n, size)
    stretches = np.concatenate((values, np.repeat(values[-1:], len(starts) * size - n, axis=0)))
    stretches = stretches.reshape(len(starts), size, d)
    is_number = np.isfinite(stretches)
    least = np.where(is_number, stretches, np.inf).argmin(axis=1)
    greatest = np.where(is_number, stretches, -np.inf).argmax(axis=1)
    order = np.sort(np.stack((least, greatest), axis=1), axis=1)
    pairs = np.take_along_axis(stretches, order, axis=1)
    ends = np.minimum(starts + size, n) - 1
    return np.stack((times[starts], times[ends]), axis=1).ravel(), pairs.reshape(-1, d)


def plot(times: Array, values: Array, names: Sequence[str], width: int) -> dict[str, Any]:
    """Return columns (T, d) over seconds since the first sample as a page draws them, at most 2 `width` of each."""
    if not len(times):
        return {"times": [], "columns": [{"name": name, "values": []} for name in names]}
    shown, thinned = envelope(times - times[0], values, width)
    largest = np.abs(thinned, where=np.isfinite(thinned), out=np.zeros_like(thinned)).max(axis=0)
    steps = 10.0 ** (np.floor(np.log10(np.where(largest > 0, largest, 1.0))) - _DIGITS + 1)
    rounded = [numbers(np.round(thinned[:, k] / step) * step) for k, step in enumerate(steps)]
    columns = [{"name": name, "values": column} for name, column in zip(names, rounded, strict=True)]
    return {"times": numbers(shown), "columns": columns}

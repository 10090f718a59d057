"""What comes from sensors, networks and planners while the robot moves: checked without ever raising."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kineme.validation import Array

_LARGEST = 1e150


def vector(value: Any, n_dims: int) -> Array | None:
    """`value` as (d,) finite float64, or None; a number serves one dimension."""
    array = _array(value)
    if array is not None and array.ndim == 0:
        array = array[None]
    return array if array is not None and array.shape == (n_dims,) else None


def rows(value: Any, n_dims: int) -> Array | None:
    """`value` (m, d), or (d,) for one, as contiguous (m, d) finite float64, or None."""
    array = _array(value)
    if array is not None and array.ndim == 1 and len(array):
        array = array[None]
    if array is None or array.ndim not in (1, 2):
        return None
    if array.size == 0:
        return np.zeros((0, n_dims))
    return np.ascontiguousarray(array) if array.shape[1] == n_dims else None


def moving_points(positions: Any, velocities: Any, n_dims: int) -> tuple[Array, Array] | None:
    """Points (m, d) and their velocities, at rest where there are none; None unless d is at least 2."""
    x = rows(positions, n_dims)
    v = rows(velocities, n_dims) if velocities is not None or x is None else np.zeros_like(x)
    if x is None or v is None or x.shape != v.shape or n_dims < 2:
        return None
    return x, v


def number(value: Any) -> float:
    """`value` as a float; NaN for what is none."""
    try:
        return float(value)
    except Exception:
        return math.nan


def usable(array: Array) -> bool:
    """Whether all numbers are finite, and so far from overflow that their squares are finite too."""
    return math.hypot(*array.ravel().tolist()) < _LARGEST  # for a few numbers faster than any of NumPy's reductions


def _array(value: Any) -> Array | None:
    try:
        array = np.asarray(value, dtype=np.float64)
    except Exception:  # whatever a driver hands over, the motion goes on
        return None
    return array if usable(array) else None

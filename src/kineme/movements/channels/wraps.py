"""Angles that wrap: find the period, and take the jumps away."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.units import unit_named
from kineme.validation import Array

_TURN = 2.0 * np.pi
#: Where recorded angles lie: between minus and plus half a turn, or from 0 to a whole one.
_RANGES = ((-np.pi, np.pi), (0.0, _TURN), (-180.0, 180.0), (0.0, 360.0))
_SLACK = 1e-3  # of a period, beyond the range
_ROUNDING = 1e-9  # of a period
_SPARSE = 0.25  # of a period: with longer steps between the jumps no rule could tell
_UNSTEADY = 3.0  # a step through the border is at most so many times the longest other one
_UNEVEN = 0.01  # of a period: by so much an angle that turns evenly steps differently through the border, if rounded
_JUMP = 0.75  # of a period: a step at least this long is a wrap, and no motion


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

    These are taken for radians within one turn, else for degrees; beyond a turn of those nothing wraps, and the period
    is infinite. So it is where whole turns are all that moves: a switch between 0 and 360.
    """
    if (period := period_by_unit(unit)) is not None:
        return period
    largest = float(np.abs(angles).max(initial=0.0))
    period = next((period for period in (_TURN, 360.0) if largest <= period * (1 + _SLACK)), np.inf)
    if not np.isfinite(period) or not np.any(angles != angles[:1]):
        return period
    turns = (angles - angles[:1]) / period
    return np.inf if np.all(np.abs(turns - np.round(turns)) < _ROUNDING) else period


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
    """How many turns, with their sign, are jumps in each of some steps."""
    return np.asarray(np.sign(steps) * np.floor(np.abs(steps) / period + (1.0 - _JUMP)))


def _steps(values: Array, offsets: NDArray[np.intp]) -> Array:
    """Differences of neighbors (total - 1,), 0 from one movement to the next."""
    steps = np.diff(values)
    steps[offsets[1:-1] - 1] = 0.0
    return steps

"""Checks of the numbers that a kernel's specification holds."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np

from kineme.errors import SpecificationError


def positive(value: object, name: str, otherwise: str) -> float:
    """Return `value` as a float; refuse it unless it is finite and above zero. The message ends with `otherwise`."""
    try:
        number = float(value) if isinstance(value, Real) else math.nan
    except OverflowError:  # an integer beyond the range of floats
        number = math.inf
    if not math.isfinite(number) or number <= 0:
        raise SpecificationError(f"expected a finite {name} > 0, got {value!r}; {otherwise}")
    return number


def check_representable(value: float, name: str, dtype: np.dtype[np.floating]) -> None:
    """Raise SpecificationError if `value` squared leaves the range of `dtype`."""
    limits = np.finfo(dtype)
    if not float(limits.tiny) <= value * value <= float(limits.max):
        raise SpecificationError(
            f"expected {name} squared within the range of {dtype}, got {name} = {value:g}; "
            "rescale the features or pass float64 rows"
        )

"""Checks of the numbers that a kernel's specification holds."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np

from kineme.errors import SpecificationError


def positive(value: object, name: str, otherwise: str) -> float:
    """`value` as a plain float, if it is a finite number above zero; the message ends with `otherwise`."""
    if not isinstance(value, Real) or not math.isfinite(value) or value <= 0:
        raise SpecificationError(f"expected a finite {name} > 0, got {value!r}; {otherwise}")
    return float(value)


def check_representable(value: float, name: str, dtype: np.dtype[np.floating]) -> None:
    """Raise SpecificationError if `value` squared leaves the range of `dtype`."""
    limits = np.finfo(dtype)
    if not float(limits.tiny) <= value * value <= float(limits.max):
        raise SpecificationError(
            f"expected {name} squared within the range of {dtype}, got {name} = {value:g}; "
            "rescale the features or pass float64 rows"
        )

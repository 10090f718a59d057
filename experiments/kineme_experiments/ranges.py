"""Numbers over draws, in words."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean


def mean_and_range(values: Sequence[float]) -> str:
    """Mean and range over draws, as ``0.954 (0.89-1.00)``."""
    return f"{fmean(values):.3f} ({min(values):.2f}-{max(values):.2f})"

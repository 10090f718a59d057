"""Annotations as a label track of Audacity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from kineme.io.annotations.annotation import Annotation
from kineme.reporting.atomic import write_atomically

UNKNOWN = "unknown"  # where a format has but one text for each stretch


def write_audacity(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write ``start TAB end TAB label`` lines, in seconds since the first sample, as File > Import > Labels reads."""
    lines = [f"{one.span[0]:.6f}\t{one.span[1]:.6f}\t{_on_one_line(one.symbol)}\n" for one in annotations]
    return write_atomically(path, "".join(lines).encode("utf-8", "backslashreplace"))


def _on_one_line(symbol: str | None) -> str:
    return UNKNOWN if symbol is None else " ".join(symbol.split())

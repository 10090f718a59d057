"""One look for all figures: colors that color-blind readers tell apart, sizes of a printed column."""

from __future__ import annotations

import io
from typing import Any

from matplotlib.figure import Figure

#: Okabe and Ito's palette, from dark to light.
BLUE, ORANGE, GREEN, PURPLE, GRAY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#777777"
SEQUENCE = (BLUE, ORANGE, GREEN)
LINES = ("-", "--", ":")

_RC: dict[str, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "axes.formatter.limits": (-3, 4),
    "svg.hashsalt": "kineme",
    "svg.fonttype": "path",
}


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of the given size in inches, without any window system."""
    import matplotlib

    matplotlib.rcParams.update(_RC)  # type: ignore[arg-type]
    return Figure(figsize=(width, height), layout="constrained")


def render(figure: Figure, dpi: int) -> dict[str, bytes]:
    """The figure as ``{"png": ..., "svg": ...}``, byte for byte the same at every run."""
    formats: dict[str, dict[str, Any]] = {
        "png": {"dpi": dpi, "metadata": {"Software": None}},
        "svg": {"metadata": {"Date": None}},
    }
    pictures = {}
    for kind, options in formats.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, **options)
        pictures[kind] = buffer.getvalue()
    return pictures

"""The style of all figures: colors that color-blind readers can tell apart, sizes of a printed column."""

from __future__ import annotations

import io
import sys
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from kineme.errors import DataError
from kineme.reporting.atomic import write_atomically
from kineme.reporting.colors import BLUE, GREEN, ORANGE
from kineme.reporting.text import printable_lines
from kineme.validation import Array

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


def new_figure(width: float, height: float, make: Callable[..., Figure] = Figure) -> Figure:
    """An empty figure of the given size in inches, by default without any window system."""
    matplotlib.rcParams.update(_RC)  # type: ignore[arg-type]
    return make(figsize=(width, height), layout="constrained")


class _PyplotFigure(Figure):
    """A figure of pyplot that notebooks show once: not as the value of a cell and at the end of the cell, too."""

    def _ipython_display_(self) -> None:
        if "inline" in matplotlib.get_backend():
            sys.modules["matplotlib.pyplot"].close(self)
        raise NotImplementedError  # IPython goes on as without this method


def figure_to_show(width: float, height: float) -> Figure:
    """Make a figure as `new_figure` does, but of `matplotlib.pyplot` where the caller has imported it, to be shown."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    return new_figure(width, height, partial(pyplot.figure, FigureClass=_PyplotFigure) if pyplot else Figure)


#: What each file format needs to come out the same at every run.
FORMATS: dict[str, dict[str, Any]] = {
    "png": {"metadata": {"Software": None}},
    "svg": {"metadata": {"Date": None}},
    "pdf": {"metadata": {"CreationDate": None}},
}


def encode_figure(figure: Figure, kind: str, dpi: int = 150) -> bytes:
    """The figure as the bytes of a file of `FORMATS`, without control characters, which XML allows nowhere."""
    for text in figure.findobj(Text):
        if (shown := printable_lines(text.get_text())) != text.get_text():
            text.set_text(shown)
    buffer = io.BytesIO()
    with warnings.catch_warnings():  # a character that the font lacks is drawn as a box
        warnings.filterwarnings("ignore", r"Glyph \d+", UserWarning)
        figure.savefig(buffer, format=kind, dpi=dpi, **FORMATS[kind])
    return buffer.getvalue()


def render(figure: Figure, dpi: int) -> dict[str, bytes]:
    """The figure as ``{"png": ..., "svg": ...}``, byte for byte the same at every run."""
    return {kind: encode_figure(figure, kind, dpi) for kind in ("png", "svg")}


def save_figure(figure: Figure, path: Path) -> Path:
    """Write the figure in the format that the file's ending names, atomically."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise DataError(f"expected a picture ending in one of {', '.join(FORMATS)}, got {path.suffix or 'none'!r}")
    return write_atomically(path, encode_figure(figure, kind))


def principal_axes(path: Array) -> Array:
    """Two axes (2, d) of the plane in which a path (d, T) is widest, for movements of three dimensions and more.

    Of the two recorded dimensions that lie most in that plane, the first points right and the second up, as far as both
    can: what was written is not drawn on its side, nor as if seen from behind.
    """
    centered = path - path.mean(axis=1, keepdims=True)
    plane = np.linalg.svd(centered, full_matrices=False)[0].T[:2]
    right, up = np.sort(np.argsort(-np.linalg.norm(plane, axis=0), kind="stable")[:2])
    U, _, Vt = np.linalg.svd(plane[:, [right, up]])
    return np.asarray((U @ Vt).T @ plane)


def flat(paths: Array, like: Array) -> Array:
    """Paths (n, d, T) as drawn, (n, 2, T): over the phase, as they are, or in the principal axes of the path `like`."""
    n, d, T = paths.shape
    if d == 1:
        phase = np.broadcast_to(np.linspace(0.0, 1.0, T), (n, 1, T))
        return np.concatenate((phase, paths), axis=1)
    return paths if d == 2 else np.asarray(principal_axes(like) @ paths)

"""A figure of generated movements."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from kineme.output.figures import BLUE, GREEN, ORANGE, PURPLE, new_figure
from kineme.output.text import drawable
from kineme.validation import Array

_MOST = 50  # movements in one figure; more would be illegible
_ROWS = 8  # dimensions below each other, before a second column begins
_COLORS = (BLUE, ORANGE, GREEN, PURPLE)
_NAMED = 30  # labels in the legend; with more of them all movements have one color
_IN_A_ROW = 6  # labels in one row of the legend


def draw_rollout(times: Array, positions: Array, axis_names: list[str], labels: NDArray[Any] | None) -> Figure:
    """Each dimension over time, and the path where it has two or three dimensions.

    Parameters
    ----------
    times : ndarray of shape (n, T)
    positions : ndarray of shape (n, T, d)
    axis_names : list of d str
    labels : ndarray of shape (n,) or None
        Each label has its color, named in a legend; with more than 30 labels all movements have one color.
    """
    n, _, d = positions.shape
    drawn = np.arange(0, n, math.ceil(n / _MOST))
    distinct = [] if labels is None else list(dict.fromkeys(labels[drawn].tolist()))
    palette = _palette(len(distinct))
    colors = [palette[0 if labels is None else distinct.index(label)] for label in _labels(labels, drawn)]
    n_rows, is_named = min(d, _ROWS), 1 < len(distinct) <= _NAMED
    figure = new_figure(7.2, max(3.2, 1.0 + 0.95 * n_rows) + 0.2 * is_named * (len(distinct) // _IN_A_ROW))
    over_time: Figure | SubFigure = figure
    if d in (2, 3):
        left, over_time = figure.subfigures(1, 2, width_ratios=(1, 1.1))  # type: ignore[misc]
        _draw_paths(left, positions[drawn], axis_names, colors)
    alpha = 1.0 if len(drawn) < 10 else 0.5
    columns = math.ceil(d / n_rows)
    grid = over_time.subplots(n_rows, columns, sharex=True, squeeze=False).T.ravel()
    for k, axes in enumerate(grid[:d]):
        for i, color in zip(drawn, colors, strict=True):
            axes.plot(times[i], positions[i, :, k], color=color, alpha=alpha)
        axes.set_ylabel(axis_names[k])
        axes.margins(x=0.01)
    over_time.align_ylabels()
    for axes in grid[d:]:
        axes.set_visible(False)
    for axes in (grid[n_rows - 1], grid[d - 1]):
        axes.set_xlabel("time [s]")
    if len(drawn) < n:
        figure.suptitle(f"{len(drawn)} of {n:,} movements", fontsize=9)
    if is_named:
        _add_legend(figure, distinct, palette)
    return figure


def _palette(n: int) -> list[Any]:
    """A color for each of n labels, all different, or all the same where the legend has no room for their names."""
    if n <= len(_COLORS):
        return list(_COLORS)
    return [_COLORS[0]] * n if n > _NAMED else list(colormaps["turbo"](np.linspace(0.03, 0.97, n)))


def _labels(labels: NDArray[Any] | None, drawn: NDArray[np.intp]) -> list[Any]:
    return [None] * len(drawn) if labels is None else labels[drawn].tolist()


def _draw_paths(figure: SubFigure, paths: Array, axis_names: list[str], colors: list[Any]) -> None:
    """The paths in the plane or in space: a circle where each starts, a star where it ends."""
    flat = paths.shape[2] == 2
    axes: Any = figure.subplots(subplot_kw=None if flat else {"projection": "3d"})
    for path, color in zip(paths, colors, strict=True):
        axes.plot(*path.T, color=color, alpha=1.0 if len(paths) < 10 else 0.5)
        axes.plot(*path[:1].T, "o", color=color, markersize=4)
        axes.plot(*path[-1:].T, "*", color=color, markersize=8)
    names = dict(zip(("xlabel", "ylabel", "zlabel"), axis_names, strict=False))
    axes.set(**names)
    if flat:
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
    else:
        extents = np.ptp(paths, axis=(0, 1))
        axes.set_box_aspect(np.maximum(extents, 0.2 * extents.max() or 1.0), zoom=0.8)  # also where nothing moves
        axes.locator_params(nbins=4)


def _add_legend(figure: Figure, distinct: list[Any], palette: list[Any]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=color, label=drawable(str(label))) for label, color in zip(distinct, palette, strict=False)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), _IN_A_ROW))

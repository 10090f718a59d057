"""Figures of movements, recorded or generated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.trajectories.movements import Samples
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.figures import figure_to_show
from kineme.reporting.text import drawable
from kineme.validation import Array

_MOST = 50  # movements in one figure; more would be illegible
_ROWS = 8  # dimensions below each other, before a second column begins
_COLORS = (BLUE, ORANGE, GREEN, PURPLE)
_NAMED = 30  # labels in the legend; with more of them all movements have one color
_IN_A_ROW = 6  # entries in one row of the legend
_START, _END = ("o", 4), ("*", 8)  # markers and their sizes


class _Drawn(NamedTuple):
    """The movements that are drawn, and how."""

    times: list[Array]  # k arrays (T_i,)
    positions: list[Array]  # k arrays (T_i, d)
    axis_names: Sequence[str]
    colors: list[Any]
    alpha: float
    key: list[Any]  # entries of the legend that name the colors
    title: str  # empty if all are drawn


def draw_movements(samples: Samples) -> Figure:
    """Each dimension over time, and the path where it has two or three dimensions; each label has its color."""
    with matplotlib.rc_context():  # the style is this figure's, and none of what the caller draws next
        drawn = _choose(samples)
        n_rows, n_entries = min(len(drawn.axis_names), _ROWS), len(_key(drawn))
        figure = figure_to_show(7.2, max(3.2, 1.0 + 0.95 * n_rows) + 0.2 * (n_entries // _IN_A_ROW))
        _draw(figure, drawn)
    return figure


def draw_movements_beside(figure: SubFigure, samples: Samples) -> None:
    """The same as a part of a figure."""
    _draw(figure, _choose(samples))


def _draw(figure: Figure | SubFigure, drawn: _Drawn) -> None:
    d, over_time = len(drawn.axis_names), figure
    if d in (2, 3):
        left, over_time = figure.subfigures(1, 2, width_ratios=(1, 1.1))  # type: ignore[misc]
        path_axes: Any = left.subplots(subplot_kw=None if d == 2 else {"projection": "3d"})
        _draw_paths(path_axes, drawn)
        set_equal_scales(path_axes, np.concatenate(drawn.positions))
    _draw_over_time(over_time, drawn, min(d, _ROWS))
    figure.suptitle(drawn.title, fontsize=9)
    if key := _key(drawn):
        figure.legend(handles=key, loc="outside lower center", ncols=min(len(key), _IN_A_ROW))


def _key(drawn: _Drawn) -> list[Any]:
    ends = (("start", _START), ("end", _END)) if len(drawn.axis_names) in (2, 3) else ()
    return drawn.key + [
        _entry(name, GRAY, marker=marker, markersize=size, linestyle="none") for name, (marker, size) in ends
    ]


def draw_movements_into(axes: Axes, samples: Samples) -> None:
    """The path, or the only dimension over time, in axes of the caller's."""
    d = samples.positions.shape[1]
    if not isinstance(axes, Axes):
        raise SpecificationError(f"expected ax to be an Axes of matplotlib, got {type(axes).__name__}; write plt.gca()")
    if d > 3:
        raise SpecificationError(f"expected movements of at most 3 dimensions for one ax, got {d}; leave ax out")
    if (axes.name == "3d") != (d == 3):
        projection = 'subplot_kw={"projection": "3d"}' if d == 3 else "no projection"
        raise SpecificationError(f"expected ax with {projection} for {d} dimensions, got projection {axes.name!r}")
    drawn = _choose(samples)
    if d == 1:
        _draw_dimension(axes, drawn, 0)
        axes.set_xlabel("time [s]")
    else:
        _draw_paths(axes, drawn)
    if drawn.title:
        axes.set_title(drawn.title)
    if key := _key(drawn):
        axes.legend(handles=key)


def _choose(samples: Samples) -> _Drawn:
    n, labels = len(samples.offsets) - 1, samples.labels
    if n == 0:
        raise TrajectoryError("expected at least one movement to draw, got none; choose some")
    chosen = np.arange(0, n, math.ceil(n / _MOST))
    movements = [slice(samples.offsets[i], samples.offsets[i + 1]) for i in chosen]
    distinct = [] if labels is None else list(dict.fromkeys(labels[chosen].tolist()))
    palette = _palette(len(distinct))
    of_label = dict(zip(distinct, palette, strict=False))
    colors = [palette[0]] * len(chosen) if labels is None else [of_label[label] for label in labels[chosen].tolist()]
    return _Drawn(
        [samples.times[rows] for rows in movements],
        [samples.positions[rows] for rows in movements],
        list(map(drawable, samples.axis_names)),
        colors,
        1.0 if len(chosen) < 10 else 0.5,
        [_entry(drawable(str(label)), color) for label, color in of_label.items() if 1 < len(distinct) <= _NAMED],
        f"{len(chosen)} of {n:,} movements" if len(chosen) < n else "",
    )


def _palette(n: int) -> list[Any]:
    """A color for each of n labels, all different, or all the same where the legend has no room for their names."""
    if n <= len(_COLORS):
        return list(_COLORS)
    return [_COLORS[0]] * n if n > _NAMED else list(colormaps["turbo"](np.linspace(0.03, 0.97, n)))


def _draw_over_time(figure: Figure | SubFigure, drawn: _Drawn, n_rows: int) -> None:
    d = len(drawn.axis_names)
    grid = figure.subplots(n_rows, math.ceil(d / n_rows), sharex=True, squeeze=False).T.ravel()
    for k, axes in enumerate(grid[:d]):
        _draw_dimension(axes, drawn, k)
        axes.margins(x=0.01)
    figure.align_ylabels()
    for axes in grid[d:]:
        axes.set_visible(False)
    for axes in (grid[n_rows - 1], grid[d - 1]):
        axes.set_xlabel("time [s]")


def _draw_dimension(axes: Axes, drawn: _Drawn, k: int) -> None:
    for times, path, color in zip(drawn.times, drawn.positions, drawn.colors, strict=True):
        axes.plot(times, path[:, k], color=color, alpha=drawn.alpha)
    axes.set_ylabel(drawn.axis_names[k])


def _draw_paths(axes: Any, drawn: _Drawn) -> None:
    """The paths in the plane or in space: a circle where each starts, a star where it ends."""
    for path, color in zip(drawn.positions, drawn.colors, strict=True):
        axes.plot(*path.T, color=color, alpha=drawn.alpha)
        for end, (marker, size) in ((path[:1], _START), (path[-1:], _END)):
            axes.plot(*end.T, marker, color=color, markersize=size)
    axes.set(**dict(zip(("xlabel", "ylabel", "zlabel"), drawn.axis_names, strict=False)))


def set_equal_scales(axes: Any, points: Array) -> None:
    """Equal scales of all dimensions, for axes in which points (k, 2) or (k, 3) are drawn."""
    if points.shape[1] == 2:
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        return
    extents = np.ptp(points, axis=0)
    axes.set_box_aspect(np.maximum(extents, 0.2 * extents.max() or 1.0), zoom=0.8)  # also where nothing moves
    axes.locator_params(nbins=4)


def _entry(name: str, color: Any, **how: Any) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=color, label=name, **how)

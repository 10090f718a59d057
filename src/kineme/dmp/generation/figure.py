"""A generated movement beside the recording and its fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from kineme.dmp.generation.generate import Learned, MovementOptions, generate, largest_deviation
from kineme.io.writing.write_movement import Columns
from kineme.movements.trajectories.figure import set_equal_scales
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE
from kineme.reporting.figures import new_figure
from kineme.reporting.text import drawable
from kineme.validation import Array

_LONGEST = 14  # characters of a name beside its axes
_ROWS = 8  # columns of the movement below each other at most; beyond them there are several columns of axes
_WIDTH = 7.2  # inches
_RECORDED: dict[str, Any] = {"color": GRAY, "linewidth": 4, "alpha": 0.45}
_FITTED: dict[str, Any] = {"color": GREEN, "linestyle": "--", "linewidth": 1.2}
_MADE: dict[str, Any] = {"color": BLUE}


def draw_movement(learned: Learned, generated: Columns, obstacles: Array | None) -> Figure:
    """The path, where there is one, and each column over time: the recording, its fit, and the new movement."""
    fitted, paths = generate(learned, MovementOptions()).columns, path_columns(learned)
    n_columns = math.ceil(len(learned.columns) / _ROWS)
    n_rows = math.ceil(len(learned.columns) / n_columns)
    figure = new_figure(_WIDTH if n_columns == 1 or not paths else 1.4 * _WIDTH, max(3.4, 1.2 + 0.95 * n_rows))
    over_time: Figure | SubFigure = figure
    if paths:
        left, over_time = figure.subfigures(1, 2, width_ratios=(1, 0.1 + n_columns))  # type: ignore[misc]
        _draw_paths(left, learned, (fitted["positions"], generated["positions"]), obstacles)
    grid = over_time.subplots(n_rows, n_columns, sharex=True, squeeze=False).T
    _draw_over_time(grid.ravel(), learned, fitted, generated)
    for axes in (grid[0, -1], grid.ravel()[len(learned.columns) - 1]):
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    over_time.align_ylabels()
    figure.legend(handles=_key(learned, bool(paths), obstacles is not None), loc="outside lower center", ncols=3)
    # A first layout, without which the aligned names are cut off.
    figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]
    return figure


def _draw_over_time(grid: NDArray[Any], learned: Learned, fitted: Columns, generated: Columns) -> None:
    """Each column over time into one of the axes; those that are left over are hidden."""
    names, demonstration, about = learned.columns, learned.demonstration, learned.primitive.to_recording
    discrete = set() if about is None else {channel.name for channel in about.channels if channel.kind == "discrete"}
    for k, (name, shown, axes) in enumerate(zip(names, short_names(names), grid, strict=False)):
        how = "steps-post" if name in discrete else "default"
        if demonstration is not None and learned.recorded is not None:
            axes.plot(demonstration.times - demonstration.times[0], learned.recorded[:, k], drawstyle=how, **_RECORDED)
        axes.plot(fitted["times"], fitted["positions"][:, k], drawstyle=how, **_FITTED)
        axes.plot(generated["times"], generated["positions"][:, k], drawstyle=how, **_MADE)
        axes.set_ylabel(drawable(shown), fontsize=8)
    for axes in grid[len(names) :]:
        axes.set_visible(False)


def path_columns(learned: Learned) -> list[list[int]]:
    """The columns of each path: two or three positions, or those of each of several points, as left.x, left.y."""
    about = learned.primitive.to_recording
    if about is None:
        d = learned.primitive.n_dims
        d = d - 3 if len(learned.columns) > len(learned.rates) else d  # of a pose the position
        return [list(range(d))] if d in (2, 3) else []
    kinds = [channel.kind for channel in about.channels for _ in channel.columns]
    positions = [k for k, kind in enumerate(kinds) if kind == "position"]
    if len(positions) in (2, 3):
        return [positions]
    points: dict[str, list[int]] = {}
    for k in positions:
        points.setdefault(learned.columns[k][:-1], []).append(k)
    axes = {"".join(learned.columns[k][-1:] for k in columns).lower() for columns in points.values()}
    return list(points.values()) if len(points) > 1 and axes in ({"xy"}, {"xyz"}) else []


def _draw_paths(figure: SubFigure, learned: Learned, lines: tuple[Array, Array], obstacles: Array | None) -> None:
    paths, (fitted, generated) = path_columns(learned), lines
    n_dims = len(paths[0])
    axes: Any = figure.subplots(subplot_kw=None if n_dims == 2 else {"projection": "3d"})
    shown = []
    for columns in paths:
        if learned.recorded is not None:
            axes.plot(*learned.recorded[:, columns].T, **_RECORDED)
            shown.append(learned.recorded[:, columns])
        shown += [fitted[:, columns], generated[:, columns]]
        axes.plot(*fitted[:, columns].T, **_FITTED)
        axes.plot(*generated[:, columns].T, **_MADE)
        axes.plot(*generated[:1, columns].T, "o", color=BLUE, markersize=5)
        axes.plot(*generated[-1:, columns].T, "*", color=BLUE, markersize=9)
        if len(paths) > 1:
            axes.text(
                *generated[-1, columns], "  " + drawable(learned.columns[columns[0]][:-1].rstrip("._ /")), fontsize=8
            )
    if obstacles is not None and obstacles.shape[1] == n_dims:
        axes.plot(*obstacles.T, "X", color=ORANGE, markersize=8, linestyle="none")
        shown.append(obstacles)
    names = short_names([learned.columns[k] for k in paths[0]]) if len(paths) == 1 else list("xyz")
    axes.set(**dict(zip(("xlabel", "ylabel", "zlabel")[:n_dims], map(drawable, names), strict=False)))
    set_equal_scales(axes, np.concatenate(shown))


def _key(learned: Learned, has_path: bool, has_obstacles: bool) -> list[Any]:
    from matplotlib.lines import Line2D

    off = largest_deviation(learned)
    fit = "fit"
    if off is not None:
        fit += f", off by {off.largest:.3g} at most ({100 * off.share:.2g} %{f', {off.of}' if off.of else ''})"
    lines = [Line2D([], [], label="recording", **_RECORDED)] if learned.recorded is not None else []
    lines += [Line2D([], [], label=fit, **_FITTED), Line2D([], [], label="generated", **_MADE)]
    marks = [("start", "o", 5, BLUE), ("end", "*", 9, BLUE)] if has_path else []
    marks += [("obstacle", "X", 8, ORANGE)] if has_path and has_obstacles else []
    return lines + [
        Line2D([], [], label=name, marker=marker, markersize=size, color=color, linestyle="none")
        for name, marker, size, color in marks
    ]


def short_names(names: Sequence[str]) -> list[str]:
    """The last parts of long names; where these do not tell the columns of one recording apart, the last letters."""
    short = []
    for name in names:
        while len(name) > _LONGEST and "." in name.rstrip("."):
            name = name.partition(".")[2]  # noqa: PLW2901 - the last parts of it
        short.append(name)
    different = len(set(short)) == len(set(names))
    return [name if len(name) <= _LONGEST else "…" + name[1 - _LONGEST :] for name in (short if different else names)]

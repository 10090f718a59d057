"""A generated movement beside the recording and its fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure

from kineme.files.write_movement import Columns
from kineme.output.figures import BLUE, GRAY, GREEN, ORANGE, new_figure
from kineme.output.text import drawable
from kineme.primitives.generation.generate import MovementOptions, generate
from kineme.primitives.generation.learned import Learned, largest_deviation
from kineme.primitives.rollout_figure import set_equal_scales
from kineme.validation import Array

_LONGEST = 14  # characters of a name beside its axes
_ROWS = 8  # columns of the movement below each other, before a second column of axes begins
_RECORDED: dict[str, Any] = {"color": GRAY, "linewidth": 4, "alpha": 0.45}
_FITTED: dict[str, Any] = {"color": GREEN, "linestyle": "--", "linewidth": 1.2}
_MADE: dict[str, Any] = {"color": BLUE}


def draw_movement(learned: Learned, made: Columns, obstacles: Array | None) -> Figure:
    """The path, where it lies in the plane or in space, and each column over time.

    Three lines: the recording, where it is known; the fit, which is the primitive moved as demonstrated; and the new
    movement. The legend says how far the fit is off the recording.
    """
    names, fitted = learned.columns, generate(learned, MovementOptions()).columns
    path = _path_columns(learned)
    shown, n_rows = short_names(names), min(len(names), _ROWS)
    figure = new_figure(7.2, max(3.4, 1.2 + 0.95 * n_rows))
    over_time: Figure | SubFigure = figure
    if path:
        left, over_time = figure.subfigures(1, 2, width_ratios=(1, 1.1))  # type: ignore[misc]
        _draw_path(left, learned, (fitted["positions"][:, path], made["positions"][:, path]), obstacles)
    grid = over_time.subplots(n_rows, math.ceil(len(names) / n_rows), sharex=True, squeeze=False).T.ravel()
    for k, axes in enumerate(grid[: len(names)]):
        if learned.recorded is not None and learned.demonstration is not None:
            axes.plot(learned.demonstration.times - learned.demonstration.times[0], learned.recorded[:, k], **_RECORDED)
        axes.plot(fitted["times"], fitted["positions"][:, k], **_FITTED)
        axes.plot(made["times"], made["positions"][:, k], **_MADE)
        axes.set_ylabel(drawable(shown[k]), fontsize=8)
    for axes in grid[len(names) :]:
        axes.set_visible(False)
    for axes in (grid[n_rows - 1], grid[len(names) - 1]):
        axes.set_xlabel("time [s]")
    over_time.align_ylabels()
    key = _key(learned, bool(path), obstacles is not None)
    figure.legend(handles=key, loc="outside lower center", ncols=3)
    return figure


def _path_columns(learned: Learned) -> list[int]:
    """The columns of the path: two or three positions, if there are no more; else none."""
    one = learned.demonstration
    if one is None or one.channels is None:
        d = learned.primitive.n_dims
        d = d - 3 if len(learned.columns) > len(learned.rates) else d  # of a pose the position
        return list(range(d)) if d in (2, 3) else []
    kinds = [channel.kind for channel in one.channels for _ in channel.columns]
    positions = [k for k, kind in enumerate(kinds) if kind == "position"]
    return positions if len(positions) in (2, 3) else []


def _draw_path(figure: SubFigure, learned: Learned, paths: tuple[Array, Array], obstacles: Array | None) -> None:
    fitted, made = paths
    names = short_names([learned.columns[k] for k in _path_columns(learned)])
    axes: Any = figure.subplots(subplot_kw=None if len(names) == 2 else {"projection": "3d"})
    shown = [fitted, made]
    if learned.recorded is not None:
        recorded = learned.recorded[:, _path_columns(learned)]
        axes.plot(*recorded.T, **_RECORDED)
        shown.append(recorded)
    axes.plot(*fitted.T, **_FITTED)
    axes.plot(*made.T, **_MADE)
    axes.plot(*made[:1].T, "o", color=BLUE, markersize=5)
    axes.plot(*made[-1:].T, "*", color=BLUE, markersize=9)
    if obstacles is not None and obstacles.shape[1] == len(names):
        axes.plot(*obstacles.T, "X", color=ORANGE, markersize=8, linestyle="none")
        shown.append(obstacles)
    axes.set(**dict(zip(("xlabel", "ylabel", "zlabel"), map(drawable, names), strict=False)))
    set_equal_scales(axes, np.concatenate(shown))


def _key(learned: Learned, has_path: bool, has_obstacles: bool) -> list[Any]:
    """Entries of the legend."""
    from matplotlib.lines import Line2D

    off = largest_deviation(learned)
    fit = "fit" if off is None else f"fit, off by {off[0]:.3g} at most ({100 * off[1]:.2g} %)"
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
    short = [_last_parts(name) for name in names]
    different = len(set(short)) == len(set(names))
    return [name if len(name) <= _LONGEST else "…" + name[1 - _LONGEST :] for name in (short if different else names)]


def _last_parts(name: str) -> str:
    while len(name) > _LONGEST and "." in name.rstrip("."):
        name = name.partition(".")[2]
    return name

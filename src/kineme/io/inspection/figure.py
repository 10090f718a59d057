"""A figure of recordings: one panel per label, its movements on top of each other."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from kineme.io.inspection.inspect import labels_in_order
from kineme.io.reading.merge_files import Recordings
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.reporting.colors import BLUE, GRAY, ORANGE
from kineme.reporting.figures import new_figure
from kineme.reporting.text import drawable, shortened
from kineme.sampling import evenly_spaced

_PANELS = 30  # labels that are drawn
_OVERLAID = 25  # movements of a label that are drawn, evenly spaced
_POINTS = 400  # samples of a movement that are drawn
_COLUMNS = 6
_NAME = 22  # letters of a label above its panel, and of a column in the legend
_LETTERS, _BESIDE = 11, 24  # letters of the legend in an inch, and those that start and end take


def draw_recordings(recordings: Recordings, unlike: Collection[int] = ()) -> Figure:
    """Draw small multiples, one per label; movements that are unlike the others of theirs, by their indices, in orange.

    One dimension is drawn over time, two in the plane, of three and more the first three in space. Every panel has a
    scale of its own, the same for its axes; below it stand the sides of the box around what is drawn.
    """
    labels = labels_in_order(recordings.labels)
    shown = labels[:_PANELS]
    n_dims = recordings.demonstrations.n_dims
    columns = min(_COLUMNS, len(shown), math.ceil(math.sqrt(1.5 * len(shown))))
    rows = math.ceil(len(shown) / columns)
    side = (1.6 if n_dims < 3 else 1.9) + 1.6 / columns
    figure = new_figure(max(3.8, side * columns), (side + 0.15 if n_dims < 3 else 0.85 * side) * rows + 0.4)
    space = {"projection": "3d"} if n_dims >= 3 else {}
    panels = figure.subplots(rows, columns, squeeze=False, subplot_kw=space).ravel()
    for axes, label in zip(panels, shown, strict=False):
        _draw_label(axes, recordings, label, set(unlike))
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    names = recordings.detected[0][0].columns[:3] if recordings.detected else axis_names(n_dims)
    first = ", ".join(shortened(name, _NAME) for name in names)
    across = f"{first} over time [s]" if n_dims == 1 else f"{first} of {n_dims} dimensions" if n_dims > 3 else first
    more = f"; the first {_PANELS} of {len(labels)} labels" if len(labels) > _PANELS else ""
    across = drawable(across) + more
    ncols = 3 if len(across) < _LETTERS * figure.get_figwidth() - _BESIDE else 1
    across = across if ncols > 1 else across.replace(", ", ",\n")
    figure.legend(handles=_key(across, bool(unlike)), loc="outside lower center", ncols=ncols, handletextpad=0.3)
    return figure


def _draw_label(axes: Any, recordings: Recordings, label: str | None, unlike: set[int]) -> None:
    chosen = [i for i, other in enumerate(recordings.labels) if other == label]
    odd = [i for i in chosen if i in unlike][:_OVERLAID]
    drawn = [chosen[k] for k in evenly_spaced(len(chosen), _OVERLAID) if chosen[k] not in unlike] + odd
    paths = [_path(recordings.demonstrations[i]) for i in drawn]
    opacity = max(0.25, 0.9 - 0.05 * len(paths))
    for i, path in zip(drawn, paths, strict=True):
        color, strength = (ORANGE, 1.0) if i in unlike else (BLUE, opacity)
        axes.plot(*path.T, color=color, linewidth=0.9, alpha=strength)
    starts, ends = np.array([path[0] for path in paths]), np.array([path[-1] for path in paths])
    axes.plot(*starts.T, "o", color=GRAY, markersize=3, zorder=3)
    axes.plot(*ends.T, "*", color=ORANGE, markersize=5.5, markeredgewidth=0, zorder=4)
    name = "no label" if label is None else label
    name = name if len(name) <= _NAME else name[: _NAME - 1] + "…"
    axes.set_title(f"{drawable(name)} ({len(chosen)})", pad=3)
    if paths[0].shape[1] > 2:
        axes.set_aspect("equal")
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_major_formatter(NullFormatter())  # Matplotlib 3.9 and 3.10.0 reserve space for empty labels
            axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
            axis._axinfo["grid"].update(color="#DDDDDD", linewidth=0.5)
            axis._axinfo["tick"].update(inward_factor=0.0, outward_factor=0.0)
            axis.line.set_color(GRAY)
        points = np.concatenate(paths)
        sides = " × ".join(f"{side:.2g}" for side in np.ptp(points, axis=0))
        axes.text2D(0.5, -0.02, sides, transform=axes.transAxes, ha="center", fontsize=6.5, color=GRAY)
    elif recordings.demonstrations.n_dims == 1:
        axes.tick_params(labelsize=6, length=2)
    else:
        axes.set(xticks=[], yticks=[])
        axes.set_aspect("equal", adjustable="datalim")
        width = np.ptp(np.concatenate(paths)[:, 0])
        axes.set_xlabel(f"{width:.3g} wide", fontsize=6.5, color=GRAY, labelpad=2)


def _path(movement: Trajectory) -> Any:
    """Return the points of a movement that are drawn, (points, 2 or 3)."""
    drawn = evenly_spaced(len(movement), _POINTS)
    x = movement.positions[drawn, :3]
    return x if x.shape[1] > 1 else np.column_stack((movement.times[drawn] - movement.times[0], x))


def _key(across: str, unlike: bool) -> list[Any]:
    odd = [Line2D([], [], color=ORANGE, linewidth=0.9, label="unlike the others")] if unlike else []
    return [
        *odd,
        Line2D([], [], linestyle="none", marker="o", color=GRAY, markersize=4, label="start"),
        Line2D([], [], linestyle="none", marker="*", color=ORANGE, markersize=7, label="end"),
        Line2D([], [], color=BLUE, linewidth=0.9, label=across),
    ]

"""A figure of an answer: how near each class is, what it rests on, and the movement beside the nearest example."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.figure import draw_movements_beside
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.movements import Samples
from kineme.movements.trajectories.trajectory import MovementLike, MovementsLike
from kineme.reporting.colors import BLUE, GRAY
from kineme.reporting.figures import figure_to_show, principal_axes
from kineme.reporting.table import wrapped
from kineme.reporting.text import drawable, shortened
from kineme.validation import Array

_CLASSES = 10  # that are drawn, best first
_NAME = 28  # letters of a name beside its bar
_POINTS, _COLUMNS = 4, 6  # of an explanation, at most


class Shares(NamedTuple):
    """Shares that are drawn as bars: of the classes, best first, and of the representations, by their names."""

    title: str
    classes: Mapping[Label, float]
    label: Label | None  # the class that is answered
    representations: Mapping[str, float]


class Example(NamedTuple):
    """The nearest demonstration: its number, its label, and what maps it onto the movement."""

    number: int
    label: Label
    transform: Any  # a `Transform`


def draw_answer(
    shares: Shares, example: Example, movement: MovementLike | None, demonstrations: MovementsLike | None
) -> Figure:
    """Draw the bars, and beside them the example among the demonstrations on the movement; see `Answer.plot`."""
    if (movement is None) != (demonstrations is None):
        raise SpecificationError(
            "expected the movement and the demonstrations, got one of them; write "
            "answer.plot(movement, recognizer.demonstrations_)"
        )
    paths = None
    if movement is not None and demonstrations is not None:
        paths = _beside(example, Demonstrations.of(movement), Demonstrations.of(demonstrations))
    ranked, parts = [*shares.classes][:_CLASSES], shares.representations
    height = 1.6 + 0.2 * (len(ranked) + len(parts))
    with matplotlib.rc_context():
        figure = figure_to_show(3.6, height) if paths is None else figure_to_show(9.6, max(height, 3.4))
        bars: Any = figure
        if paths is not None:
            left, bars = figure.subfigures(1, 2, width_ratios=(2, 1))  # type: ignore[misc]
            draw_movements_beside(left, paths)
        rows = bars.subplots(2, 1, height_ratios=(len(ranked), len(parts)))
        colors = [BLUE if label == shares.label else GRAY for label in ranked]
        _draw_bars(rows[0], [str(label) for label in ranked], [shares.classes[label] for label in ranked], colors)
        _draw_bars(rows[1], [*parts], [*parts.values()], GRAY)
        rows[0].set(xlabel="probability, if it is known", title=drawable(shortened(shares.title, 2 * _NAME)))
        rows[1].set_xlabel("share in the similarity")
    return figure


def _draw_bars(axes: Any, names: list[str], values: list[float], color: Any) -> None:
    axes.barh(np.arange(len(names)), values, color=color)
    axes.set_yticks(np.arange(len(names)), [drawable(shortened(name, _NAME)) for name in names])
    axes.set_xlim(0, 1)
    axes.invert_yaxis()


def _beside(example: Example, movement: Demonstrations, demonstrations: Demonstrations) -> Samples:
    """Return the movement, and the nearest demonstration mapped onto it, begun with it."""
    i, shown, transform = example
    n_dims = len(transform.shift)
    if len(movement) != 1 or {movement.n_dims, demonstrations.n_dims} != {n_dims}:
        raise SpecificationError(
            f"expected one movement and demonstrations of {n_dims} dimensions, got {movement!r} and {demonstrations!r}"
        )
    labels = demonstrations.labels
    if i >= len(demonstrations) or (labels is not None and labels[i] != shown):
        raise SpecificationError(
            f"expected the demonstrations of the recognizer, whose number {i} shows {shown}, got {demonstrations!r}; "
            "pass its demonstrations_"
        )
    nearest = demonstrations[i]
    times = movement.times[0] + transform.duration_ratio * (nearest.times - nearest.times[0])
    positions = np.concatenate((movement.positions, transform.apply(nearest.positions)))
    offsets = np.array([0, len(movement.positions), len(positions)])
    names = np.array(["movement", f"{shortened(str(shown), _NAME)}, mapped onto it"], dtype=object)
    times, axes = np.concatenate((movement.times, times)), movement._samples.axis_names
    return Samples(times, offsets, positions, axes, positions, axes, names)


class Panel(NamedTuple):
    """An example that is laid over a movement: its path (T, d), and distances (P, T) from the movement in each part."""

    title: Sequence[str]  # lines
    path: Array
    differences: Array


class View(NamedTuple):
    """A part of a movement as it is drawn: paths (T, d) times `axes` (2, d), or over their phase where that is None."""

    columns: tuple[int, ...]
    axes: Array | None
    names: tuple[str, str]

    def points(self, path: Array) -> Array:
        """Return the points (T, 2) of a path (T, d)."""
        part = path[:, self.columns]
        return np.column_stack((np.linspace(0.0, 1.0, len(path)), part)) if self.axes is None else part @ self.axes.T


def draw_explanation(
    title: Sequence[str], path: Array, columns: Sequence[str], parts: Sequence[Any], overlays: Sequence[Panel]
) -> Figure:
    """Draw a movement (T, d) over each of the examples, part by part, below lines of a title."""
    largest = np.max([overlay.differences.max(axis=1) for overlay in overlays], axis=0)
    most, noun = (_POINTS, "points") if len(parts[0].columns) > 1 else (_COLUMNS, "columns")
    rows = np.sort(np.argsort(-largest, kind="stable")[:most]).tolist()
    views = [_view(path, parts[r].columns, columns) for r in rows]
    if len(rows) < len(parts):
        title = [*title, f"{len(rows)} of {len(parts)} {noun}: those that differ most"]
    heights = [1.6 if view.axes is None and parts[1:] else 3.0 for view in views]
    with matplotlib.rc_context():
        figure = figure_to_show(4.0 * len(overlays) + 0.6, 1.3 + sum(heights))
        panels = figure.subplots(len(rows), len(overlays), squeeze=False)
        for r, view, row in zip(rows, views, panels, strict=True):
            for panel, overlay in zip(row, overlays, strict=True):
                shown = view.points(path), view.points(overlay.path)
                colored = _draw_overlay(panel, *shown, overlay.differences[r], max(float(largest.max()), 1e-9))
                panel.set(xlabel=drawable(view.names[0]), ylabel=drawable(view.names[1]))
                lines = [*overlay.title] * bool(r == rows[0]) + [parts[r].name] * (len(view.columns) > 1 < len(parts))
                panel.set_title("\n".join(drawable(shortened(line, 40)) for line in lines))
        _set_equal_limits(panels, views, [path, *(overlay.path for overlay in overlays)])
        panels[0, 0].plot([], [], color=GRAY, linewidth=4, alpha=0.45, label="example, laid over it")
        panels[0, 0].plot([], [], "o", color=BLUE, markersize=5, label="start of the movement")
        figure.legend(loc="outside lower center", ncols=2)
        figure.colorbar(colored, ax=panels, label="distance from it, in sizes of the movement", shrink=0.8)
        lines = [part for line in title for part in wrapped(shortened(line, 160), 42 * len(overlays))]
        figure.suptitle("\n".join(map(drawable, lines)))
    return figure


def _view(path: Array, columns: tuple[int, ...], names: Sequence[str]) -> View:
    """Return the view of a column over the phase, of two in their plane, of three in the plane where they are widest.

    The axes of that plane have the names of the columns that they are nearest to.
    """
    if len(columns) == 1:
        return View(columns, None, (f"share of the {'time' if path.shape[1] == 1 else 'path'}", names[columns[0]]))
    axes = np.eye(2) if len(columns) == 2 else principal_axes(path[:, columns].T)
    x, y = (names[columns[k]] for k in np.abs(axes).argmax(axis=1))
    return View(columns, axes, (x, y) if len(columns) == 2 else (f"mostly {x}", f"mostly {y}"))


def _set_equal_limits(panels: Any, views: Sequence[View], paths: Sequence[Array]) -> None:
    """Give the panels of a part the same limits, and all points the same scale."""
    shown = [np.concatenate([view.points(path) for path in paths]) for view in views]
    halves = [0.54 * np.ptp(points, axis=0) for points in shown]
    widest = np.max(halves, axis=0)
    widest = np.maximum(widest, 0.2 * widest.max() or 1.0)  # so that a straight movement has some room
    for row, view, points, half in zip(panels, views, shown, halves, strict=True):
        center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        (x, y), (width, height) = center, widest if view.axes is not None else (half[0], half[1] or 1.0)
        for panel in row:
            panel.set(xlim=(x - width, x + width), ylim=(y - height, y + height))
            if view.axes is not None:
                panel.set_aspect("equal")


def _draw_overlay(panel: Any, movement: Array, example: Array, differences: Array, highest: float) -> Any:
    """Draw the example in gray and the movement over it, colored by their distance; return what has the colors."""
    panel.plot(*example.T, color=GRAY, linewidth=4, alpha=0.45, solid_capstyle="round")
    pieces = np.stack((movement[:-1], movement[1:]), axis=1)
    between = 0.5 * (differences[:-1] + differences[1:])
    colored = LineCollection(list(pieces), array=between, cmap="plasma", linewidth=2)
    colored.set_clim(0.0, highest)
    panel.add_collection(colored)
    panel.plot(*movement[0], "o", color=BLUE, markersize=5)
    return colored


def draw_distances(measured: Array, threshold: float) -> Figure:
    """Draw the distances of an execution, rows (k, 2) of phase and distance, over the phase, with the threshold."""
    with matplotlib.rc_context():
        figure = figure_to_show(4.8, 2.6)
        axes = figure.subplots()
        axes.axhline(threshold, color=GRAY, linestyle="--", label="threshold")
        axes.plot(*measured.T, color=BLUE, label="execution")
        axes.set(xlim=(0, 1), xlabel="phase", ylabel="standard deviations")
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper left")
    return figure

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
from kineme.reporting.text import drawable, shortened
from kineme.validation import Array

_CLASSES = 10  # that are drawn, best first
_NAME = 28  # letters of a name beside its bar


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
    """An example that is laid over a movement: its path (T, d), and its distance (T,) from the movement."""

    title: str
    path: Array
    differences: Array


def draw_explanation(title: str, path: Array, overlays: Sequence[Panel]) -> Figure:
    """Draw a movement (T, d) over each of the examples; see `Explanation.plot`."""
    highest = max(float(overlay.differences.max()) for overlay in overlays)
    with matplotlib.rc_context():
        figure = figure_to_show(4.0 * len(overlays) + 0.6, 4.2)
        panels = figure.subplots(1, len(overlays), squeeze=False)[0]
        axes, names = _drawing_axes(path)
        for panel, overlay in zip(panels, overlays, strict=True):
            colored = _draw_overlay(panel, path, overlay, axes, max(highest, 1e-9))
            panel.set_title(drawable(shortened(overlay.title, 40)))
            panel.set(xlabel=names[0], ylabel=names[1])
        panels[0].plot([], [], color=GRAY, linewidth=4, alpha=0.45, label="example, laid over it")
        panels[0].plot([], [], "o", color=BLUE, markersize=5, label="start of the movement")
        panels[0].legend(loc="best")
        figure.colorbar(colored, ax=list(panels), label="distance from it, in sizes of the movement", shrink=0.8)
        figure.suptitle(drawable(shortened(title, 60)))
    return figure


def _drawing_axes(path: Array) -> tuple[Array | None, tuple[str, str]]:
    """Return the two directions that a path (T, d) is drawn along, with their names; None for its columns over time."""
    d = path.shape[1]
    if d == 2:
        return np.eye(2), ("x", "y")
    if d == 3:
        return principal_axes(path.T), ("in the plane where it is widest", "")
    return None, ("share of the path", "coordinates")


def _draw_overlay(panel: Any, path: Array, overlay: Panel, axes: Array | None, highest: float) -> Any:
    """Draw the example in gray and the movement over it, colored by their distance; return what has the colors."""
    if axes is None:
        share = np.linspace(0.0, 1.0, len(path))
        curves = [
            (np.column_stack((share, x)), np.column_stack((share, y)))
            for x, y in zip(path.T, overlay.path.T, strict=True)
        ]
    else:
        curves = [(path @ axes.T, overlay.path @ axes.T)]
    for _, example in curves:
        panel.plot(*example.T, color=GRAY, linewidth=4, alpha=0.45, solid_capstyle="round")
    for movement, _ in curves:
        pieces = np.stack((movement[:-1], movement[1:]), axis=1)
        between = 0.5 * (overlay.differences[:-1] + overlay.differences[1:])
        colored = LineCollection(list(pieces), array=between, cmap="plasma", linewidth=2)
        colored.set_clim(0.0, highest)
        panel.add_collection(colored)
        panel.plot(*movement[0], "o", color=BLUE, markersize=5)
    panel.autoscale_view()
    if axes is not None:
        panel.set_aspect("equal", adjustable="datalim")
    return colored

"""A figure of an answer: how near each class is, what it rests on, and the movement beside the nearest example."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.figure import Paths, draw_movements_beside
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.trajectory import MovementLike, MovementsLike
from kineme.reporting.colors import BLUE, GRAY
from kineme.reporting.figures import figure_to_show
from kineme.reporting.text import drawable, shortened

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


def _beside(example: Example, movement: Demonstrations, demonstrations: Demonstrations) -> Paths:
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
    return Paths(np.concatenate((movement.times, times)), positions, offsets, movement._samples.position_names, names)

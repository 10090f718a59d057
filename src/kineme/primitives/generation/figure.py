"""A generated movement beside the demonstrated one."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure, SubFigure

from kineme.files.write_movement import Columns
from kineme.movements.trajectories.movements import axis_names
from kineme.output.figures import BLUE, GRAY, ORANGE, new_figure
from kineme.primitives.discrete.dmp import Primitives
from kineme.validation import Array

_DEMONSTRATED: dict[str, Any] = {"color": GRAY, "linewidth": 4, "alpha": 0.5, "label": "as demonstrated"}
_GENERATED: dict[str, Any] = {"color": BLUE, "label": "generated"}


def draw_movement(primitive: Primitives, made: Columns, obstacles: Array | None) -> Figure:
    """The path in the plane, if it has one, and each dimension over time, with one legend for both."""
    replay = primitive.rollout()
    d = primitive.n_dims
    axes_names = axis_names(d)
    figure = new_figure(7.2, 1.2 + 1.1 * d if d > 2 else 3.4)
    over_time: Figure | SubFigure = figure
    if d == 2:
        flat, over_time = figure.subfigures(1, 2, width_ratios=(1, 1.1))  # type: ignore[misc]
        _draw_path(flat, replay.positions[0], made["positions"], obstacles)
    rows = over_time.subplots(d, 1, sharex=True, squeeze=False)[:, 0]
    for k, axes in enumerate(rows):
        axes.plot(replay.times[0], replay.positions[0, :, k], **_DEMONSTRATED)
        axes.plot(made["times"], made["positions"][:, k], **_GENERATED)
        axes.set_ylabel(axes_names[k])
    rows[-1].set_xlabel("time [s]")
    if d != 2:
        figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _draw_path(figure: SubFigure, demonstrated: Array, generated: Array, obstacles: Array | None) -> None:
    axes = figure.subplots()
    axes.plot(*demonstrated.T, **_DEMONSTRATED)
    axes.plot(*generated.T, **_GENERATED)
    axes.plot(*generated[0], "o", color=BLUE, markersize=5, label="start")
    axes.plot(*generated[-1], "*", color=BLUE, markersize=9, label="end")
    if obstacles is not None:
        axes.plot(*obstacles.T, "X", color=ORANGE, markersize=8, linestyle="none", label="obstacle")
    axes.set(xlabel="x", ylabel="y")
    axes.set_aspect("equal", adjustable="datalim")  # no empty space between the legend and a flat movement
    axes.margins(0.1)
    figure.legend(loc="outside upper center", ncols=2)

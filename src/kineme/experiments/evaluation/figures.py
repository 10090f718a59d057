"""Figures of an evaluation: one panel per perturbation, one line per method."""

from __future__ import annotations

import math

from kineme.experiments.evaluation.conditions import Condition
from kineme.experiments.evaluation.methods import METHODS, OURS
from kineme.experiments.evaluation.results import Results
from kineme.output.figures import BLUE, GRAY, GREEN, ORANGE, PURPLE, encode_figure, new_figure

_BLACK = "#222222"
_AXES = {
    "shots": "movements per class",
    "shift": "shift [extents]",
    "scale": "scale [doublings]",
    "rotation": "rotation within ± [°]",
    "warp": "warp [std of log speed]",
    "noise": "noise [% of extent]",
    "together": "all together [level]",
    "path": "path seen [%]",
}
_STYLES = dict(
    zip(
        METHODS,
        [(BLUE, "-"), (PURPLE, "-"), (PURPLE, "--"), (GRAY, "-"), (ORANGE, "-"), (ORANGE, ":"), (ORANGE, "--"),
         (GREEN, "-"), (GREEN, "--"), (_BLACK, "-"), (_BLACK, "--"), (GRAY, "--")],
        strict=True,
    )
)  # fmt: skip


def draw_protocol(protocol: str, results: Results) -> bytes | None:
    """SVG of accuracy over strength; None for protocols without several strengths."""
    panels: dict[str, list[Condition]] = {}
    for condition in results.conditions(protocol):
        panels.setdefault(condition.varied, []).append(condition)
    panels = {name: conditions for name, conditions in panels.items() if name in _AXES and len(conditions) > 1}
    if not panels or protocol.startswith("open-set"):
        return None
    columns = min(3, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = new_figure(2.6 * columns + 1.8, 2.1 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for k, (name, conditions) in enumerate(panels.items()):
        _draw_panel(axes.flat[k], protocol, results, conditions)
        axes.flat[k].set(xlabel=_AXES[name], ylim=(0, 1.03))
        if name == "shots":  # no half movements
            axes.flat[k].set_xticks([one.strength for one in conditions])
    for row in axes:
        row[0].set_ylabel("accuracy")
    for empty in axes.flat[len(panels) :]:
        empty.set_visible(False)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside right upper")
    return encode_figure(figure, "svg")


def _draw_panel(axes, protocol: str, results: Results, conditions: list[Condition]) -> None:  # type: ignore[no-untyped-def]
    for method in results.outcomes[protocol]:
        points = [(one.strength, results.mean(protocol, method, one, "accuracy")) for one in conditions]
        measured = [(x, y) for x, y in points if y is not None]
        color, line = _STYLES[method]
        label = METHODS[method].title
        width, front = (2.2, 3) if method == OURS else (1.1, 2)
        x, y = [x for x, _ in measured], [y for _, y in measured]
        axes.plot(x, y, line, color=color, label=label, linewidth=width, marker="o", markersize=2.5, zorder=front)

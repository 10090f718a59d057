"""The diagram of mean ranks and critical difference (Demsar, JMLR 2006, figure 1)."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from kineme.reporting.colors import BLUE
from kineme.reporting.figures import new_figure
from kineme_experiments.evaluation.methods import METHODS, OURS
from kineme_experiments.evaluation.ranks import Ranks

_LINE, _TOP, _BAR = 0.22, 0.55, 0.11  # heights [inch]: of a line of text, above the axis, of a bar
_SIDE, _AXIS = 2.1, 4.0  # widths [inch]: of the names on either side, of the axis


def draw_ranks(ranks: Ranks) -> Figure:
    """Mean ranks on one axis, the best at the right; thick bars connect methods that do not differ."""
    k, groups = len(ranks.methods), ranks.alike()
    n_left = k // 2  # the worse half is named on the left
    bars = _BAR * len(groups) + 0.14
    below = bars + _LINE * (k - n_left) + 0.1
    width, height = _AXIS + 2 * _SIDE, _TOP + below
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(0, width), ylim=(-below, _TOP))

    def at(rank: float) -> float:
        return _SIDE + _AXIS * (k - rank) / (k - 1)

    _draw_axis(axes, ranks, at)
    for row, (first, last) in enumerate(groups):
        y = -0.14 - _BAR * row
        ends = at(ranks.mean_ranks[first]) + 0.05, at(ranks.mean_ranks[last]) - 0.05
        axes.plot(ends, (y, y), color="black", linewidth=3.2, solid_capstyle="round", zorder=3)
    for i, (method, mean) in enumerate(zip(ranks.methods, ranks.mean_ranks, strict=True)):
        right = i < k - n_left
        row = i if right else k - 1 - i
        _draw_method(axes, (method, mean), (at(mean), -bars - _LINE * (row + 0.5)), right)
    return figure


def _draw_axis(axes: Any, ranks: Ranks, at: Any) -> None:
    k = len(ranks.methods)
    axes.plot((at(k), at(1)), (0, 0), color="black", linewidth=0.9)
    for tick in range(1, k + 1):
        axes.plot((at(tick), at(tick)), (0, 0.07), color="black", linewidth=0.9)
        axes.text(at(tick), 0.1, str(tick), ha="center", va="bottom", fontsize=8)
    for half in range(1, k):
        axes.plot((at(half + 0.5), at(half + 0.5)), (0, 0.04), color="black", linewidth=0.7)
    left, right = at(k), at(k) + _AXIS * min(ranks.critical_difference, k - 1) / (k - 1)
    axes.plot((left, right), (0.37, 0.37), color="black", linewidth=1.2)
    for end in (left, right):
        axes.plot((end, end), (0.34, 0.40), color="black", linewidth=1.2)
    axes.text(right + 0.07, 0.37, f"CD = {ranks.critical_difference:.2f}", ha="left", va="center", fontsize=8)


def _draw_method(axes: Any, method: tuple[str, float], corner: tuple[float, float], right: bool) -> None:
    name, mean = method
    ours = name == OURS
    color, width = (BLUE, 1.6) if ours else ("#444444", 0.8)
    x, y = corner
    end = _SIDE + _AXIS + 0.12 if right else _SIDE - 0.12
    axes.plot(
        (x, x, end),
        (0, y, y),
        color=color,
        linewidth=width,
        solid_joinstyle="miter",
        solid_capstyle="butt",
        zorder=2 + ours,
    )
    title = METHODS[name].title
    text, gap, side = (f"{title}  {mean:.2f}", 0.06, "left") if right else (f"{mean:.2f}  {title}", -0.06, "right")
    weight = "bold" if ours else "normal"
    axes.text(end + gap, y, text, ha=side, va="center", fontsize=8, color=color, weight=weight)

"""A picture of styles: what was demonstrated, what lies between, and where it lies."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.styles.model import StyleModel, learn_styles
from kineme.reporting.colors import BLUE, GRAY, ORANGE
from kineme.reporting.figures import new_figure
from kineme.reporting.text import drawable
from kineme.validation import Array


def draw_morph(primitives: Primitives, steps: int = 9, unit: str = "mm") -> Figure:
    """Demonstrations of two styles under one name, the morph between the styles' centers, and the style plane.

    The two styles are told apart at the widest gap of the first style parameter.

    Parameters
    ----------
    primitives : Primitives
        At least three demonstrations of one name, two-dimensional.
    steps : int, default 9
        Movements of the morph, both ends included.
    unit : str, default "mm"
        Of the positions, for the axes.
    """
    model = learn_styles(primitives, 2)
    second = above_widest_gap(model.styles[:, 0])
    route = np.linspace(model.styles[~second].mean(axis=0), model.styles[second].mean(axis=0), steps)
    shown = (primitives.rollout().positions, model.primitive(route).rollout().positions)
    colors = _between(np.linspace(0, 1, steps))
    figure = new_figure(6.9, 2.7)
    left, middle, right = figure.subplots(1, 3)
    _paths(left, shown[0], [ORANGE if is_second else BLUE for is_second in second])
    _paths(middle, shown[1], colors)
    corners = np.concatenate([x.reshape(-1, 2) for x in shown])
    for axes, title in ((left, "(a) demonstrated"), (middle, "(b) from one style to the other")):
        axes.update_datalim(corners)  # the same scale in both
        axes.set(title=title, xlabel=f"x [{drawable(unit)}]", ylabel=f"y [{drawable(unit)}]")
        axes.set_aspect("equal", adjustable="datalim")
    _plane(right, model, second, route, colors)
    figure.legend(handles=_key(), loc="outside lower center", ncols=4)
    return figure


def above_widest_gap(values: Array) -> NDArray[np.bool_]:
    """Tell whether each number (n,) lies above the widest gap between neighbors."""
    ordered = np.sort(values)
    k = int(np.argmax(np.diff(ordered)))
    return np.asarray(values > 0.5 * (ordered[k] + ordered[k + 1]))


def _between(shares: Array) -> list[Any]:
    """Colors from one style's to the other's."""
    from matplotlib.colors import LinearSegmentedColormap

    return list(LinearSegmentedColormap.from_list("styles", (BLUE, "#B8B8B8", ORANGE))(shares))


def _paths(axes: Any, paths: Array, colors: list[Any]) -> None:
    for path, color in zip(paths, colors, strict=True):
        axes.plot(*path.T, color=color, linewidth=1.2)
        axes.plot(*path[0], "o", color=color, markersize=3.5)
        axes.plot(*path[-1], "*", color="black", markersize=7, zorder=3)


def _plane(axes: Any, model: StyleModel, second: NDArray[np.bool_], route: Array, colors: list[Any]) -> None:
    """Styles of the demonstrations and the way that the morph takes between them."""
    axes.plot(*route.T, color=GRAY, linewidth=0.8, zorder=1)
    axes.scatter(*route.T, c=colors, s=14, zorder=2)
    for is_second, color, marker in ((False, BLUE, "o"), (True, ORANGE, "s")):
        styles = model.styles[second == is_second]
        axes.scatter(*styles.T, facecolors="none", edgecolors=color, marker=marker, s=36, linewidths=1.2, zorder=3)
    share = 100 * model.explained_variance
    axes.set(title="(c) style space", xlabel=f"style 1 ({share[0]:.1f} %)", ylabel=f"style 2 ({share[1]:.1f} %)")
    axes.margins(0.12)


def _key() -> list[Any]:
    """Return the entries of the legend."""
    from matplotlib.lines import Line2D

    def marker(shape: str, label: str, size: float, **how: Any) -> Line2D:
        return Line2D([], [], linestyle="none", marker=shape, label=label, markersize=size, **how)

    return [
        marker("o", "start, or generated style", 4, color=GRAY),
        marker("*", "goal", 7, color="black"),
        marker("o", "demonstrated, first style", 6, color=BLUE, markerfacecolor="none"),
        marker("s", "demonstrated, second style", 6, color=ORANGE, markerfacecolor="none"),
    ]

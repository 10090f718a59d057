"""The first lines and the first picture of the report: the paper's accuracies among ours."""

from __future__ import annotations

from statistics import fmean
from typing import NamedTuple

from matplotlib.figure import Figure

from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE
from kineme.reporting.figures import new_figure
from kineme_experiments.paper import paper
from kineme_experiments.paper.columns import CLOSEST, COLUMNS, DEFAULT, KERNELS, PRINTED, Draws, columns_of
from kineme_experiments.paper.conclusions import inside
from kineme_experiments.paper.tables import conventions

CAPTION = (
    "The paper's accuracies on nine letters (crosses), and ours: mean and range over random draws, as the paper's "
    "distances suggest and by kineme's default. Gray: the range of all conventions that the paper leaves open."
)


class Accuracy(NamedTuple):
    """One accuracy of Tables 2 and 4: the paper's, ours in each reading, and those under every convention."""

    name: str
    printed: float
    closest: list[float]
    default: list[float]
    conventions: dict[str, list[float]]


def accuracies(draws: Draws) -> list[Accuracy]:
    """Return the twelve accuracies, of 1-NN, of the SVM with RBF and of the SVM with the truncated kernel."""
    kinds = [("1-NN", paper.NEAREST_NEIGHBOR, "nearest", "", "")]
    kinds += [
        (f"SVM, {kernel}", PRINTED[name], "svm", f"/{name}/paper", f"/{name}/median")
        for name, kernel in KERNELS.items()
    ]
    return [
        Accuracy(
            f"{method}: {column}",
            printed[cell],
            columns_of(draws, kind, CLOSEST, widths)[column],
            columns_of(draws, kind, DEFAULT, medians)[column],
            conventions(draws, kind, cell, widths),
        )
        for method, printed, kind, widths, medians in kinds
        for column, cell in zip(COLUMNS, paper.CELLS, strict=True)
    ]


def verdict(draws: Draws) -> list[str]:
    """Say how many of the paper's accuracies ours contain, which feature is ahead, and which kernel."""
    compared = accuracies(draws)
    held = sum(any(inside(one.printed, values) for values in one.conventions.values()) for one in compared)
    nearest = columns_of(draws, "nearest", DEFAULT)
    lines = [
        f"{held} of the paper's {len(compared)} accuracies lie within the range of our {len(draws)} draws, under at "
        "least one of the conventions that it leaves open."
    ]
    for formulation in ("original", "bio-inspired"):
        shape, weights = (fmean(nearest[f"{quantity}, {formulation}"]) for quantity in ("f(t)", "weights"))
        order = (
            "as good as" if f"{shape:.3f}" == f"{weights:.3f}" else "better than" if shape > weights else "worse than"
        )
        lines.append(
            f"In the {formulation} formulation the nearest neighbor by the shape-attractor is {order} that by the "
            f"weights: {shape:.3f} against {weights:.3f}, by kineme's default."
        )
    rbf, truncated = (
        [fmean(one.closest) for one in compared if one.name.startswith(f"SVM, {k}:")] for k in ("RBF", "TrE")
    )
    ahead = sum(a > b for a, b in zip(truncated, rbf, strict=True))
    printed = sum(paper.SVM_TRE[cell] > paper.SVM_RBF[cell] for cell in paper.CELLS)
    lines.append(
        f"With the paper's widths the truncated kernel is ahead of the RBF kernel in {ahead} of {len(rbf)} columns; in "
        f"the paper it is in {printed}."
    )
    return lines


def draw_overview(draws: Draws) -> Figure:
    """Draw a line for each of the twelve accuracies."""
    compared = accuracies(draws)
    figure = new_figure(7.2, 3.6)
    axes = figure.subplots()
    for y, one in enumerate(compared):
        every = [value for values in one.conventions.values() for value in values]
        axes.plot((min(every), max(every)), (y, y), color=GRAY, alpha=0.25, linewidth=9, solid_capstyle="butt")
        for values, color, shift in ((one.closest, BLUE, -0.16), (one.default, GREEN, 0.16)):
            at = y + shift
            axes.plot((min(values), max(values)), (at, at), color=color, linewidth=2)
            axes.plot(fmean(values), at, "o", color=color, markersize=4.5)
        axes.plot(one.printed, y, "x", color=ORANGE, markersize=7, markeredgewidth=2, zorder=4)
    axes.set_yticks(range(len(compared)), [one.name for one in compared])
    axes.set(xlabel="accuracy", xlim=(0, 1.02), ylim=(len(compared) - 0.5, -0.5))
    for between in (3.5, 7.5):
        axes.axhline(between, color=GRAY, linewidth=0.5)
    marks = {"the paper": (ORANGE, "x"), f"ours, {CLOSEST}": (BLUE, "o"), f"ours, {DEFAULT}": (GREEN, "o")}
    for label, (color, mark) in marks.items():
        axes.plot([], [], mark, color=color, label=label, markeredgewidth=2 if mark == "x" else 1)
    figure.legend(loc="outside upper center", ncols=3)
    return figure

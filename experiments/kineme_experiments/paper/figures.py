"""Counterparts of the paper's Figures 1 to 11, from today's recordings."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from kineme.datasets.lasa import PAPER_LETTERS, load_lasa
from kineme.dmp.discrete.dmp import Primitives
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.colors import GRAY
from kineme.reporting.figures import LINES, SEQUENCE, new_figure
from kineme.validation import Array
from kineme_experiments.paper import paper
from kineme_experiments.paper.protocol import draw
from kineme_experiments.paper.representations import READINGS, REPRESENTATIONS, specification


class Drawing(NamedTuple):
    """One figure: its caption, and the function that draws it for a seed."""

    caption: str
    draw: Callable[[int], Figure]


@lru_cache(maxsize=1)
def _letters() -> Demonstrations:
    return load_lasa(PAPER_LETTERS)


def _examples(letter: str, seed: int, count: int) -> Demonstrations:
    demos = _letters()
    assert demos.labels is not None
    return demos[np.random.default_rng(seed).permutation(np.flatnonzero(demos.labels == letter))[:count]]


def one_c(seed: int) -> Demonstrations:
    """The C of Figure 7, alone."""
    return _examples("CShape", seed, 1)


def _terms(primitives: Primitives) -> tuple[Array, Array]:
    """Weights (n, N, d) and shape-attractor (n, S, d)."""
    return primitives.weights, primitives.shape_attractor(paper.N_SAMPLES)


_UNITS = {"original": ("1", "mm"), "bio-inspired": ("mm", "mm")}  # of w and of the term, in normalized time


def _panels(formulation: str) -> tuple[Figure, Any, Any]:
    figure = new_figure(6.6, 2.4)
    left, right = figure.subplots(1, 2)
    unit_w, unit_f = _UNITS[formulation]
    left.set(xlabel="basis function i", ylabel=f"weight $w_i$ [{unit_w}]", xlim=(0, paper.N_BASIS - 1))
    right.set(xlabel="normalized time t / τ", ylabel=f"shape-attractor [{unit_f}]", xlim=(0, 1))
    for axes in (left, right):
        axes.axhline(0, color=GRAY, linewidth=0.6)
    return figure, left, right


def _plot_terms(formulation: str, curves: list[tuple[str, Demonstrations, int]]) -> Figure:
    """Weights and shape-attractor of one dimension of several movements: (name, movements, dimension)."""
    figure, left, right = _panels(formulation)
    time = np.linspace(0, 1, paper.N_SAMPLES)
    for k, (name, demos, dimension) in enumerate(curves):
        w, term = _terms(specification(formulation).learn(demos))
        for i in range(len(demos)):
            style = {"color": SEQUENCE[k + i], "linestyle": LINES[k + i]}
            label = name if len(demos) == 1 else f"{name} {i + 1}"
            left.plot(w[i, :, dimension], label=label, **style)
            right.plot(time, term[i, :, dimension], label=label, **style)
    right.legend(loc="best")
    return figure


def _one_c(formulation: str, seed: int) -> Figure:
    one = _examples("CShape", seed, 1)
    return _plot_terms(formulation, [("x", one, 0), ("y", one, 1)])


def _three_c(formulation: str, seed: int) -> Figure:
    return _plot_terms(formulation, [("C", _examples("CShape", seed, 3), 1)])


def _c_and_n(formulation: str, seed: int) -> Figure:
    return _plot_terms(formulation, [("C", _examples("CShape", seed, 1), 1), ("N", _examples("NShape", seed, 1), 1)])


def _movement(seed: int) -> Figure:
    """A movement and its reproduction from w, in both formulations, and their distance."""
    figure = new_figure(6.6, 2.7)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.3))
    one = one_c(seed)
    x = one[0].positions
    left.plot(*x.T, color=GRAY, linewidth=4, alpha=0.5, label="demonstrated")
    left.plot(*x[0], "o", color=GRAY, markersize=6)
    left.plot(*x[-1], "*", color="black", markersize=9)
    for formulation, color, line in zip(("original", "bio-inspired"), SEQUENCE, LINES, strict=False):
        y = specification(formulation).learn(one).rollout(n_samples=len(x)).positions[0]
        left.plot(*y.T, color=color, linestyle=line, label=f"from w, {formulation}")
        distance = np.linalg.norm(y - x, axis=1)
        right.plot(one[0].times, distance, color=color, linestyle=line, label=formulation)
    left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    left.margins(0.12)
    right.set(xlabel="time [s]", ylabel="distance from it [mm]", ylim=(0, None))
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def _similarities(formulation: str, quantity: str, seed: int) -> Figure:
    """Gram matrices of RBF and TrE with the paper's parameters on one draw of 27 movements."""
    demos = _letters()
    assert demos.labels is not None
    chosen = demos[draw(demos.labels, paper.PER_CLASS, seed, 0)]
    cell = (formulation, quantity)
    key = READINGS["closest in distances"][paper.CELLS.index(cell)]
    X = REPRESENTATIONS[key].rows(chosen)
    rbf, truncated = paper.KERNELS[cell]
    grams = {
        f"(a) RBF, σ = {rbf.sigma:g}": rbf(X),
        f"(b) TrE, m = {truncated.m:g}, divided by m": truncated(X) / truncated(X[:1]),
    }
    figure = new_figure(6.6, 3.2)
    ticks = np.arange(len(chosen) // paper.PER_CLASS) * paper.PER_CLASS + (paper.PER_CLASS - 1) / 2
    for axes, (title, gram) in zip(figure.subplots(1, 2), grams.items(), strict=True):
        image = axes.imshow(gram, cmap="cividis", vmin=0, vmax=1, interpolation="nearest")
        letters = [str(label)[0] for label in chosen.labels[:: paper.PER_CLASS]]  # type: ignore[index]
        axes.set(title=title, xticks=ticks, yticks=ticks, xticklabels=letters, yticklabels=letters)
        axes.set(xlabel="movement, by letter", ylabel="movement, by letter")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        for edge in np.arange(paper.PER_CLASS, len(chosen), paper.PER_CLASS) - 0.5:
            axes.axhline(edge, color="white", linewidth=0.4)
            axes.axvline(edge, color="white", linewidth=0.4)
    figure.colorbar(image, ax=figure.axes, label="similarity", shrink=0.8)
    return figure


def _for(function: Callable[..., Figure], *arguments: str) -> Callable[[int], Figure]:
    return lambda seed: function(*arguments, seed)


#: File name -> drawing, in the order of the paper.
DRAWINGS = {
    "figure-01": Drawing("Learned w and shape-attractor of a C, original formulation.", _for(_one_c, "original")),
    "figure-02": Drawing("Learned w and shape-attractor of a C, bio-inspired.", _for(_one_c, "bio-inspired")),
    "figure-03": Drawing("Dimension y of three Cs, original formulation.", _for(_three_c, "original")),
    "figure-04": Drawing("Dimension y of a C and an N, original formulation.", _for(_c_and_n, "original")),
    "figure-05": Drawing("Dimension y of three Cs, bio-inspired.", _for(_three_c, "bio-inspired")),
    "figure-06": Drawing("Dimension y of a C and an N, bio-inspired.", _for(_c_and_n, "bio-inspired")),
    "figure-07": Drawing("(a) A movement, from circle to star, and its reproduction from w.", _movement),
    "figure-08": Drawing("Similarity of w, original formulation.", _for(_similarities, "original", "weights")),
    "figure-09": Drawing("Similarity of the shape-attractor, original.", _for(_similarities, "original", "f(t)")),
    "figure-10": Drawing(
        "Similarity of w, bio-inspired, divided by s.", _for(_similarities, "bio-inspired", "weights")
    ),
    "figure-11": Drawing("Similarity of f / s, bio-inspired.", _for(_similarities, "bio-inspired", "f(t)")),
}

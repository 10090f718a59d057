"""A map of the symbols: near each other on paper if near in the conceptual space, each drawn as its prototype."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kineme.anchoring.figures.drawing import bare, flat, mark_start, plot_paths
from kineme.anchoring.grounding.space import ConceptualSpace
from kineme.dmp.discrete.dmp import Primitives
from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.reporting.figures import BLUE, GRAY, ORANGE, new_figure
from kineme.reporting.text import drawable
from kineme.similarity.alignment import paths_of
from kineme.validation import Array

_INCHES = 6.9  # width of a map
_HEIGHTS = (3.0, 8.0)  # of a map, at least and at most, in inches


def classical_scaling(distances: Array) -> tuple[Array, float]:
    """Positions (s, 2) in the plane whose distances are close to those given, and the share of their squares kept.

    Classical multidimensional scaling: the two leading eigenvectors of ``-J D^2 J / 2``, J taking out the mean.

    Source: W. S. Torgerson, "Multidimensional scaling: I. Theory and method", Psychometrika 17, 1952.
    """
    squares = distances**2
    centered = squares - squares.mean(axis=0)
    B = -0.5 * (centered - centered.mean(axis=1, keepdims=True))
    values, vectors = np.linalg.eigh(0.5 * (B + B.T))
    positive = np.maximum(values[::-1], 0.0)
    positions = np.zeros((len(distances), 2))
    k = min(2, len(distances))
    leading = vectors[:, ::-1][:, :k]
    sign = np.sign(leading[np.abs(leading).argmax(axis=0), np.arange(k)])  # an eigenvector has no sign of its own
    positions[:, :k] = leading * np.where(sign == 0, 1.0, sign) * np.sqrt(positive[:k])
    total = float(positive.sum())
    return positions, float(positive[:2].sum() / total) if total > 0 else 1.0


def draw_map(space: ConceptualSpace, prototypes: Primitives | MovementsLike) -> Figure:
    """Symbols by classical scaling of their distances, each as a little drawing of its prototype.

    Parameters
    ----------
    space : ConceptualSpace
    prototypes : Primitives or movements
        One for each symbol, in the order of the space.

    Raises
    ------
    SpecificationError
        Another number of prototypes than of symbols.
    """
    demos = prototypes if isinstance(prototypes, Primitives) else Demonstrations.of(prototypes)
    if len(demos) != len(space.symbols):
        raise SpecificationError(f"expected {len(space.symbols)} prototypes, one per symbol, got {len(demos)}")
    positions, kept = classical_scaling(space.distances)
    half = _half_size(len(positions))
    positions = apart(positions / (float(np.ptp(positions, axis=0).max()) or 1.0), 3.0 * half)
    figure = new_figure(_INCHES, _height(positions, half))
    axes = figure.subplots()
    for name, position, path in zip(space.symbols, positions, paths_of(demos), strict=True):
        drawn = _fitted(flat(path[None], path)[0], half) + position[:, None]
        plot_paths(axes, drawn[None], BLUE, linewidth=1.3)
        mark_start(axes, drawn[None], ORANGE, 3.5)
        axes.annotate(
            drawable(name), (position[0], drawn[1].min()), (0, -4), textcoords="offset points",
            ha="center", va="top", fontsize=6.5, color=GRAY, annotation_clip=False,
        )  # fmt: skip
    bare(axes, 2)
    axes.set_title(f"{len(positions)} symbols; the plane holds {100 * kept:.0f} % of their squared distances")
    return figure


def _half_size(n: int) -> float:
    """Half the largest size of a drawing, in widths of the map: what n drawings have room for."""
    return min(0.08, 0.21 / np.sqrt(n))


def _height(positions: Array, half: float) -> float:
    """Inches, so that the map is as high as its symbols need."""
    width, height = np.ptp(positions, axis=0) + 2.5 * half
    return float(np.clip(_INCHES * height / width + 0.4, *_HEIGHTS))


def _fitted(drawn: Array, half: float) -> Array:
    """A path (2, T) about the origin, as large as a drawing on the map may be."""
    size = np.ptp(drawn, axis=1, keepdims=True)
    centered = drawn - drawn.min(axis=1, keepdims=True) - 0.5 * size
    return np.asarray(2.0 * half * centered / (float(size.max()) or 1.0))


def apart(positions: Array, least: float, rounds: int = 200) -> Array:
    """Positions (s, 2) pushed away from each other until none are closer than `least`, or the rounds are over."""
    positions = positions.copy()
    # Symbols at the same position have no direction to part in: each gets a tiny one, the same in every call.
    positions += 1e-6 * np.random.default_rng(0).normal(size=positions.shape)
    for _ in range(rounds):
        away = positions[:, None] - positions[None]
        d = np.linalg.norm(away, axis=2)
        np.fill_diagonal(d, np.inf)
        push = np.maximum(least - d, 0.0)
        if not push.any():
            break
        positions += 0.25 * np.einsum("ij,ijk->ik", push / d, away)
    return positions

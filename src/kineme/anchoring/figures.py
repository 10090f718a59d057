"""Pictures of proposals and of symbols: movements in the plane as they are, in space in their widest view."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kineme.anchoring.proposals import Proposal, Proposals, check_members
from kineme.anchoring.space import ConceptualSpace, classical_scaling
from kineme.dmp.discrete.dmp import Primitives
from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.reporting.colors import BLUE, GRAY, ORANGE
from kineme.reporting.figures import flat, new_figure
from kineme.reporting.text import counted, drawable
from kineme.similarity.describe import maps_onto, paths_of
from kineme.similarity.specification import Compares
from kineme.validation import Array

_INCHES = 6.9  # width of a map
_HEIGHTS = (3.0, 8.0)  # of a map, at least and at most, in inches

_CELL = 1.35  # inches
_LEFT_OVER = 24  # of those left over, drawn at most

_SHOWN = 60  # members drawn at most, evenly spread; more would hide each other

_ABOUT = {1: "position over the share of the duration", 2: ""}


def plot_paths(axes: Any, drawn: Array, color: str, dot: float = 0.0, **style: Any) -> None:
    """Lines of paths (n, 2, T), with a dot of that size where each starts."""
    axes.plot(*drawn.transpose(1, 2, 0), color=color, **style)
    if dot:
        axes.plot(drawn[:, 0, 0], drawn[:, 1, 0], "o", color=ORANGE, markersize=dot, linestyle="none", zorder=4)


def bare(axes: Any, n_dims: int) -> None:
    """No ticks, no frame, and one scale for both directions where both are lengths."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    if n_dims > 1:
        axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)


def draw_proposal(movements: MovementsLike, proposal: Proposal, like: Compares | None = None) -> Figure:
    """Members laid onto the medoid, the medoid bold, a dot at the start; inset, as they were recorded.

    Parameters
    ----------
    movements : movements
        Those that the proposal was made from.
    proposal : Proposal
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take out.

    Raises
    ------
    SpecificationError
        Fewer movements than the proposal was made from.
    """
    demos = Demonstrations.of(movements)
    check_members(proposal, len(demos))
    recorded, medoid = shown_paths(demos, proposal, like)
    figure = new_figure(4.2, 3.4)
    axes = figure.subplots()
    overlay(axes, recorded, medoid, like)
    # Up to 60 members lie anywhere, so the inset lies beside the drawing.
    inset = axes.inset_axes((1.03, 0.66, 0.32, 0.32))
    plot_paths(inset, flat(recorded, medoid[0]), GRAY, 2.0, linewidth=0.6)
    bare(inset, demos.n_dims)
    inset.set_title("as recorded", fontsize=7, color=GRAY)
    axes.set_title(words(proposal))
    axes.set_xlabel(_ABOUT.get(demos.n_dims, "widest view of the medoid"))
    return figure


def words(proposal: Proposal) -> str:
    """Size, cohesion and stability."""
    return f"{len(proposal)} movements, cohesion {proposal.cohesion:.2f}, stability {proposal.stability:.2f}"


def shown_paths(demos: Demonstrations, proposal: Proposal, like: Compares | None) -> tuple[Array, Array]:
    """Paths of the members that are shown (m, d, T), and the medoid's (1, d, T)."""
    step = -(-len(proposal) // _SHOWN)
    return paths_of(demos[proposal.members[::step]], like), paths_of(demos[[proposal.medoid]], like)


def overlay(axes: Any, recorded: Array, medoid: Array, like: Compares | None, thin: float = 0.9) -> None:
    """Members (m, d, T) laid onto the medoid (1, d, T)."""
    laid = flat(maps_onto(recorded, medoid[0], like).move(recorded), medoid[0])
    plot_paths(axes, laid, BLUE, linewidth=thin, alpha=0.45)
    plot_paths(axes, flat(medoid, medoid[0]), "black", 6.0 * thin, linewidth=2.4 * thin, zorder=3)
    bare(axes, medoid.shape[1])


def draw_proposals(movements: MovementsLike, proposals: Proposals, like: Compares | None = None) -> Figure:
    """One small drawing for each proposal, with its number, size and stability; last, what is left over.

    Number k is ``proposals[k - 1]``; members, medoid and start are drawn as by `draw_proposal`.

    Parameters
    ----------
    movements : movements
        Those that the proposals were made from.
    proposals : Proposals
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take out.

    Raises
    ------
    SpecificationError
        No proposal and nothing left over, or fewer movements than the proposals were made from.
    """
    demos = Demonstrations.of(movements)
    alone = proposals.left_over
    n = len(proposals) + bool(len(alone))
    if n == 0 or len(proposals.clusters) != len(demos):
        raise SpecificationError(
            f"expected the {len(proposals.clusters)} movements that the proposals were made from, got {len(demos)}"
        )
    columns = min(n, max(3, int(np.ceil(np.sqrt(1.4 * n)))))
    rows = -(-n // columns)
    figure = new_figure(_CELL * max(columns, 2), (_CELL + 0.12) * rows + 0.5)
    cells = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    for k, proposal in enumerate(proposals.proposals):
        check_members(proposal, len(demos))
        overlay(cells[k], *shown_paths(demos, proposal, like), like, thin=0.6)
        cells[k].set_title(f"{k + 1}:  {len(proposal)} ×, stable {proposal.stability:.2f}", fontsize=7, pad=2)
    if len(alone):
        _side_by_side(cells[n - 1], paths_of(demos[alone[:_LEFT_OVER]], like))
        cells[n - 1].set_title(f"left over: {len(alone)}", fontsize=7, color=GRAY, pad=2)
    for empty in cells[n:]:
        empty.set_axis_off()
    head = f"{counted(len(proposals), 'cluster')} among {counted(len(demos), 'movement')}"
    key = ["number: size, stability", "bold: most typical; dot: start"]
    if columns > 4:
        figure.suptitle(f"{head} ({'; '.join(key)})", fontsize=8)
    else:  # a line holds less
        figure.suptitle("\n".join((head, *(("; ".join(key),) if columns == 4 else key))), fontsize=7)
    return figure


def _side_by_side(axes: Any, paths: Array) -> None:
    """Movements that have nothing in common, side by side."""
    columns = int(np.ceil(np.sqrt(len(paths))))
    for k, path in enumerate(paths):
        drawn = flat(path[None], path)[0]
        low = drawn.min(axis=1, keepdims=True)
        size = np.ptp(drawn, axis=1, keepdims=True)
        drawn = (drawn - low) / (size.max() if len(path) > 1 else np.where(size > 0, size, 1.0))
        drawn = drawn * 0.8 + np.array([[k % columns], [-(k // columns)]])
        plot_paths(axes, drawn[None], GRAY, 2.0, linewidth=0.7)
    bare(axes, 2)


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
    positions, share = classical_scaling(space.distances)
    half = min(0.08, 0.21 / np.sqrt(len(positions)))  # of the largest size of a drawing, in widths of the map
    positions = apart(positions / (float(np.ptp(positions, axis=0).max()) or 1.0), 3.0 * half)
    width, height = np.ptp(positions, axis=0) + 2.5 * half
    figure = new_figure(_INCHES, float(np.clip(_INCHES * height / width + 0.4, *_HEIGHTS)))
    axes = figure.subplots()
    for name, position, path in zip(space.symbols, positions, paths_of(demos), strict=True):
        drawn = _fitted(flat(path[None], path)[0], half) + position[:, None]
        plot_paths(axes, drawn[None], BLUE, 3.5, linewidth=1.3)
        axes.annotate(
            drawable(name), (position[0], drawn[1].min()), (0, -4), textcoords="offset points",
            ha="center", va="top", fontsize=6.5, color=GRAY, annotation_clip=False,
        )  # fmt: skip
    bare(axes, 2)
    axes.set_title(f"{len(positions)} symbols; the plane holds {100 * share:.0f} % of their squared distances")
    return figure


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

"""A picture of one proposal: its members overlaid, so that a person can say what it is."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from kineme.anchoring.figures.drawing import bare, flat, mark_start, plot_paths
from kineme.anchoring.proposals.proposals import Proposal, check_members
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.reporting.figures import BLUE, GRAY, ORANGE, new_figure
from kineme.reporting.text import drawable
from kineme.similarity.alignment import maps_onto, paths_of
from kineme.similarity.specification import Compares
from kineme.validation import Array

_SHOWN = 60  # members drawn at most, evenly spread; more would hide each other


def draw_proposal(
    movements: MovementsLike, proposal: Proposal, title: str = "", like: Compares | None = None
) -> Figure:
    """Members laid onto the medoid, the medoid bold, a dot at the start; inset, as they were recorded.

    Parameters
    ----------
    movements : movements
        Those that the proposal was made from.
    proposal : Proposal
    title : str, optional
        By default its size, cohesion and stability.
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
    drawn = flat(recorded, medoid[0])
    plot_paths(inset, drawn, GRAY, linewidth=0.6)
    mark_start(inset, drawn, ORANGE, 2.0)
    bare(inset, demos.n_dims)
    inset.set_title("as recorded", fontsize=7, color=GRAY)
    axes.set_title(drawable(title) or words(proposal))
    axes.set_xlabel(_ABOUT.get(demos.n_dims, "widest view of the medoid"))
    return figure


_ABOUT = {1: "position over the share of the duration", 2: ""}


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
    typical = flat(medoid, medoid[0])
    plot_paths(axes, laid, BLUE, linewidth=thin, alpha=0.45)
    plot_paths(axes, typical, "black", linewidth=2.4 * thin, zorder=3)
    mark_start(axes, typical, ORANGE, 6.0 * thin)
    bare(axes, medoid.shape[1])

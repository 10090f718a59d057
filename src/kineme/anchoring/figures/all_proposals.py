"""All proposals in one figure, numbered, for a person to name."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kineme.anchoring.figures.drawing import bare, flat, mark_start, plot_paths
from kineme.anchoring.figures.proposal import overlay, shown_paths
from kineme.anchoring.proposals.proposals import Proposals, check_members
from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.reporting.figures import GRAY, ORANGE, new_figure
from kineme.similarity.alignment import paths_of
from kineme.similarity.specification import Compares
from kineme.validation import Array

_CELL = 1.35  # inches
_LEFT_OVER = 24  # of those left over, drawn at most


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
    head = f"{len(proposals)} clusters among {len(demos)} movements"
    key = ["number: size, stability", "bold: most typical; dot: start"]
    if columns > 4:
        figure.suptitle(f"{head} ({'; '.join(key)})", fontsize=8)
    else:  # a line holds less
        figure.suptitle("\n".join((head, *(("; ".join(key),) if columns == 4 else key))), fontsize=7)
    return figure


def _side_by_side(axes: Any, paths: Array) -> None:
    """Movements that have nothing in common, side by side."""
    n = len(paths)
    columns = int(np.ceil(np.sqrt(n)))
    for k, path in enumerate(paths):
        drawn = flat(path[None], path)[0]
        low = drawn.min(axis=1, keepdims=True)
        size = np.ptp(drawn, axis=1, keepdims=True)
        drawn = (drawn - low) / (size.max() if len(path) > 1 else np.where(size > 0, size, 1.0))
        drawn = drawn * 0.8 + np.array([[k % columns], [-(k // columns)]])
        plot_paths(axes, drawn[None], GRAY, linewidth=0.7)
        mark_start(axes, drawn[None], ORANGE, 2.0)
    bare(axes, 2)

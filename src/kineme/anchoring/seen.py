"""Movements as the recognizer sees them, without labels: what everything in this layer compares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.describe import view
from kineme.comparison.normalization import Normalization
from kineme.comparison.representation import DEFAULT_REPRESENTATIONS, Representation, check_representations
from kineme.errors import TrajectoryError
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.recognizer import Recognizer


@dataclass(frozen=True, eq=False)
class Seen:
    """n movements in each of R representations, ready for comparison.

    Made by `see` from movements, or by `see_rows` from feature rows that were stored.
    """

    procrustes: Procrustes
    views: tuple[Prepared, ...]
    mean: str = "arithmetic"

    def __len__(self) -> int:
        return len(self.views[0].rows)

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return self.procrustes.n_dims

    def take(self, chosen: Any) -> Seen:
        """The chosen movements."""
        return Seen(self.procrustes, tuple(one.take(chosen) for one in self.views), self.mean)


def see(movements: Any, like: Recognizer | None = None) -> Seen:
    """Look at movements.

    Parameters
    ----------
    movements : Seen, or movements as `Demonstrations.of` accepts them
    like : Recognizer, optional
        Whose representations, invariances, smoothing and mean to take; it need not be fitted.
    """
    if isinstance(movements, Seen):
        return movements
    like = like or Recognizer()
    demos = Demonstrations.of(movements)
    blocks = view(demos, looks_of(like), Normalization(like.translation, like.scale), like.cutoff)
    return _prepared(list(blocks), demos.n_dims, like)


def see_rows(rows: NDArray[Any], n_dims: int, like: Recognizer | None = None) -> Seen:
    """Feature rows of n movements, the representations one after the other, as `recognition.views.view` gives them.

    Parameters
    ----------
    rows : array_like of shape (n, sum_r d S_r)
    n_dims : int
        Dimensions d of the movements.
    like : Recognizer, optional
        The one that the rows were made for.

    Raises
    ------
    TrajectoryError
        Rows of another width than the representations make.
    """
    like = like or Recognizer()
    rows = np.asarray(rows)
    widths = [n_dims * one.n_points for one in looks_of(like)]
    if rows.ndim != 2 or rows.shape[1] != sum(widths) or not len(rows):
        raise TrajectoryError(
            f"expected feature rows of shape (n, {sum(widths)}) for {n_dims} dimensions and {len(widths)} "
            f"representations, got shape {rows.shape}; pass n_dims and the recognizer that the rows were made for"
        )
    return _prepared(np.split(rows, np.cumsum(widths)[:-1], axis=1), n_dims, like)


def looks_of(recognizer: Recognizer) -> tuple[Representation, ...]:
    """The representations that a recognizer was made with."""
    given = recognizer.representations
    return DEFAULT_REPRESENTATIONS if given is None else check_representations(given)


def _prepared(blocks: list[NDArray[Any]], n_dims: int, like: Recognizer) -> Seen:
    procrustes = Procrustes(n_dims, like._angle(n_dims))
    # Single precision as in the recognizer, so that stored rows and movements give the same answer.
    views = tuple(procrustes.prepare(np.ascontiguousarray(block, dtype=np.float32)) for block in blocks)
    return Seen(procrustes, views, like.mean)

"""References that do not fit in memory: reduced features, and functions that read everything else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.bounds import ReducedFeatures, Single, log_bounds
from kineme.comparison.describe import Described
from kineme.comparison.similarity import AveragedSimilarity
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array

Rows = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class StoredReferences:
    """Movements of C classes that are not held in memory.

    Attributes
    ----------
    bases : tuple of R ndarrays (S, k)
    reduced : tuple of tuples of R ReducedFeatures
        One or several blocks, one after the other.
    members : ndarray of shape (m,)
        Rows of the reduced features that belong to a class, ordered by class.
    first : ndarray of shape (C,)
        Where in `members` each class begins.
    features : callable
        From rows of the reduced features to their feature rows per representation, see `describe.feature_rows`.
    movements : callable
        From rows of the reduced features to `Demonstrations`.
    """

    bases: tuple[Array, ...]
    reduced: tuple[tuple[ReducedFeatures, ...], ...]
    members: Rows
    first: Rows
    features: Callable[[Rows], tuple[NDArray[Any], ...]]
    movements: Callable[[Rows], Demonstrations]

    @cached_property
    def counts(self) -> Rows:
        """Members of each class, (C,)."""
        return np.diff(self.first, append=len(self.members))

    def bounds(self, similarity: AveragedSimilarity, asked: tuple[ReducedFeatures, ...]) -> Single:
        """Bounds (n, m) of the log similarity to every member."""
        every = [log_bounds(similarity, asked, block) for block in self.reduced]
        return np.asarray(np.concatenate(every, axis=1)[:, self.members])

    def reduced_at(self, rows: Rows) -> tuple[ReducedFeatures, ...]:
        """Reduced features of some rows, in their order."""
        ends = np.cumsum([len(block[0].values) for block in self.reduced])
        which = np.searchsorted(ends, rows, side="right")
        order = np.argsort(np.argsort(which, kind="stable"))
        parts = [
            tuple(one.take(rows[which == b] - (ends[b - 1] if b else 0)) for one in block)
            for b, block in enumerate(self.reduced)
        ]
        return tuple(
            ReducedFeatures(*(np.concatenate(fields)[order] for fields in zip(*same, strict=True)))
            for same in zip(*parts, strict=True)
        )

    def described(self, similarity: AveragedSimilarity, rows: Rows) -> Described:
        """The movements of some rows, ready for comparison."""
        blocks = tuple(map(similarity.procrustes.prepare, self.features(rows)))
        return Described(blocks, similarity.procrustes, similarity.mean)


@dataclass(frozen=True, eq=False)
class OnDemand:
    """Movements at some rows, without names, that are read when indexed."""

    rows: Rows
    movements: Callable[[Rows], Demonstrations]
    names: None = None

    def __getitem__(self, chosen: Rows) -> Demonstrations:
        return self.movements(self.rows[chosen])

    def __len__(self) -> int:
        return len(self.rows)

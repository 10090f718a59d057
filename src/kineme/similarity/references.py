"""The stored movements that others are compared with, in memory or, where they do not fit, read by functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.bounds import ReducedFeatures, Single, log_bounds
from kineme.similarity.describe import prepare
from kineme.similarity.described import Described
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from kineme.validation import Array

Rows = NDArray[np.intp]

_HELD = 8192  # references that are held described, at most: some 50 MB in space


class IndexedMovements(Protocol):
    """Movements by their indices: `Demonstrations`, or what reads them when asked."""

    @property
    def names(self) -> Sequence[str | None] | None:
        """Origin of each movement."""
        ...

    def __getitem__(self, index: NDArray[np.intp], /) -> Demonstrations: ...


@dataclass(frozen=True, eq=False)
class References:
    """Stored movements of C classes, ordered by class."""

    demonstrations: IndexedMovements
    described: Described  # their rows, ready for comparison
    labels: NDArray[Any]  # (m,), the class of each, sorted
    classes: NDArray[Any]  # (C,), the labels, each once, sorted
    first: NDArray[np.intp]  # (C,), index of the first movement of each class

    @classmethod
    def of(cls, demonstrations: IndexedMovements, described: Described, labels: NDArray[Any]) -> References:
        """Return movements whose labels are sorted."""
        classes, first = np.unique(labels, return_index=True)
        return cls(demonstrations, described, labels, classes, first)

    def __len__(self) -> int:
        return len(self.labels)

    def all_movements(self) -> Demonstrations:
        """Return the movements as `Demonstrations`; read, if they are not held in memory."""
        held = self.demonstrations
        return held if isinstance(held, Demonstrations) else held[np.arange(len(self))]

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """Movements of each class, (C,)."""
        return np.diff(self.first, append=len(self.labels))

    def slices(self) -> Iterator[slice]:
        """Return the slice of the movements of each class."""
        return (slice(int(start), int(start + count)) for start, count in zip(self.first, self.counts, strict=True))


@dataclass(frozen=True, eq=False)
class StoredReferences:
    """Movements of C classes that are not held in memory.

    `features`: from rows of the reduced features to their feature rows per representation, see `describe.feature_rows`.
    """

    bases: tuple[Array, ...]  # R of shape (S, k)
    reduced: tuple[tuple[ReducedFeatures, ...], ...]  # one or several blocks, one after the other
    members: Rows  # (m,), rows of the reduced features that belong to a class, ordered by class
    first: Rows  # (C,), where in `members` each class begins
    specification: ComparisonSpecification  # how the features are described
    features: Callable[[Rows], tuple[NDArray[Any], ...]]
    movements: Callable[[Rows], Demonstrations]  # from rows of the reduced features to `Demonstrations`

    @cached_property
    def counts(self) -> Rows:
        """Members of each class, (C,)."""
        return np.diff(self.first, append=len(self.members))

    def bounds(self, similarity: AveragedSimilarity, queries: tuple[ReducedFeatures, ...]) -> Single:
        """Return bounds (n, m) of the log similarity to every member."""
        every = [log_bounds(similarity, queries, block) for block in self.reduced]
        return np.asarray(np.concatenate(every, axis=1)[:, self.members])

    def reduced_at(self, rows: Rows) -> tuple[ReducedFeatures, ...]:
        """Return reduced features of some rows, in their order."""
        ends = np.cumsum([len(block[0].values) for block in self.reduced])
        which = np.searchsorted(ends, rows, side="right")
        order = np.argsort(np.argsort(which, kind="stable"))
        parts = [
            tuple(features.take(rows[which == b] - (ends[b - 1] if b else 0)) for features in block)
            for b, block in enumerate(self.reduced)
        ]
        return tuple(
            ReducedFeatures(*(np.concatenate(fields)[order] for fields in zip(*same, strict=True)))
            for same in zip(*parts, strict=True)
        )

    def described(self, similarity: AveragedSimilarity, rows: Rows) -> Described:
        """Return the movements of some rows, ready for comparison."""
        return prepare(self.features(rows), self.specification, similarity.procrustes)


class HeldReferences:
    """Stored references that are described once: movements asked about together are compared with many of the same."""

    def __init__(self, stored: StoredReferences, similarity: AveragedSimilarity) -> None:
        self._stored, self._similarity = stored, similarity
        self.n_rows = sum(len(block[0].values) for block in stored.reduced)
        self._at = np.zeros(self.n_rows, dtype=np.int32)  # 1 + where a row is held, 0 if it is not
        self._held: Described | None = None
        self._n_held = 0

    def described(self, rows: Rows) -> Described:
        """Return the movements of some rows, ready for comparison; those not held are read, all at once."""
        missing = np.unique(rows[self._at[rows] == 0])
        if self._n_held + len(missing) > _HELD:
            self._at[:], self._n_held, missing = 0, 0, np.unique(rows)
        if len(missing) > _HELD:
            return self._stored.described(self._similarity, rows)
        if len(missing):
            self._hold(missing)
        assert self._held is not None
        return self._held.take(self._at[rows] - 1)

    def _hold(self, missing: Rows) -> None:
        new = self._stored.described(self._similarity, missing)
        if self._held is None:
            self._held = new.empty(_HELD)
        self._held.put(self._n_held, new)
        self._at[missing] = np.arange(self._n_held, self._n_held + len(missing)) + 1
        self._n_held += len(missing)


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

"""The stored movements that others are compared with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.described import Described


class IndexedMovements(Protocol):
    """Movements by their indices: `Demonstrations`, or what reads them when asked."""

    @property
    def names(self) -> Sequence[str | None] | None:
        """Where each movement comes from."""
        ...

    def __getitem__(self, index: NDArray[np.intp], /) -> Demonstrations: ...


@dataclass(frozen=True, eq=False)
class References:
    """Stored movements of C classes, ordered by class.

    Attributes
    ----------
    demonstrations : Demonstrations, or what gives them when indexed by an array
    described : Described
        Their rows, ready for comparison.
    labels : ndarray of shape (m,)
        The class of each, sorted.
    classes : ndarray of shape (C,)
        The labels, each once, sorted.
    first : ndarray of shape (C,)
        Index of the first movement of each class.
    """

    demonstrations: IndexedMovements
    described: Described
    labels: NDArray[Any]
    classes: NDArray[Any]
    first: NDArray[np.intp]

    @classmethod
    def of(cls, demonstrations: IndexedMovements, described: Described, labels: NDArray[Any]) -> References:
        """Movements whose labels are sorted."""
        classes, first = np.unique(labels, return_index=True)
        return cls(demonstrations, described, labels, classes, first)

    def __len__(self) -> int:
        return len(self.labels)

    def all_movements(self) -> Demonstrations:
        """The movements as `Demonstrations`; read, if they are not held in memory."""
        held = self.demonstrations
        return held if isinstance(held, Demonstrations) else held[np.arange(len(self))]

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """Movements of each class, (C,)."""
        return np.diff(self.first, append=len(self.labels))

    def slices(self) -> Iterator[slice]:
        """Where the movements of each class are."""
        return (slice(int(start), int(start + count)) for start, count in zip(self.first, self.counts, strict=True))

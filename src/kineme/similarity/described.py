"""Described movements: one block of rows per representation, what is compared pair by pair, and squared distances."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.pair_distances import pair_distances
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.kernels.shapes import Shapes
from kineme.validation import Array

_TILE_PAIRS = 100_000  # at a time: a pair's rotation in space has nine numbers


@dataclass(frozen=True, eq=False)
class Pairs:
    """Shapes of n movements that are compared pair by pair."""

    positions: Prepared  # positions over arc length, which give the rotation of a pair
    shapes: Shapes
    measures: tuple[int, ...]  # which of the distances that `kineme.kernels.pair_distances` gives, in order


@dataclass(frozen=True, eq=False)
class Described:
    """n movements in each of R representations, ready for comparison."""

    blocks: tuple[Prepared, ...]  # one block of n rows for each representation that is compared sample by sample
    procrustes: Procrustes  # the distance between rows
    mean: str = "arithmetic"  # the A-average over representations
    pairs: Pairs | None = None  # for the representations after those, which are compared pair by pair
    own_weights: tuple[float, ...] | None = None  # the weights of the representations themselves; equal if None

    def __len__(self) -> int:
        return len((self.blocks[0] if self.pairs is None else self.pairs.positions).rows)

    @property
    def n_representations(self) -> int:
        """R."""
        return len(self.blocks) + (0 if self.pairs is None else len(self.pairs.measures))

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return self.procrustes.n_dims

    def take(self, chosen: Any) -> Described:
        """Return the chosen movements: a slice, a mask or indices."""
        return self._changed(lambda arrays: arrays.take(chosen))

    def empty(self, n: int) -> Described:
        """Make room for n movements that are described in the same way."""
        return self._changed(lambda arrays: arrays.empty(n))

    def put(self, start: int, others: Described) -> None:
        """Write other movements over those from `start` on."""
        rows = slice(start, start + len(others))
        blocks = list(zip(self.blocks, others.blocks, strict=True))
        if self.pairs is not None and others.pairs is not None:
            if not any(block is self.pairs.positions for block in self.blocks):
                blocks.append((self.pairs.positions, others.pairs.positions))
            self.pairs.shapes.put(start, others.pairs.shapes)
        for ours, theirs in blocks:
            ours.rows[rows], ours.squares[rows] = theirs

    def select(self, representations: Iterable[int]) -> Described:
        """Return the same movements in some of the representations."""
        chosen, n = list(representations), len(self.blocks)
        measures = tuple(self.pairs.measures[r - n] for r in chosen if r >= n) if self.pairs is not None else ()
        return replace(
            self,
            blocks=tuple(self.blocks[r] for r in chosen if r < n),
            pairs=replace(self.pairs, measures=measures) if self.pairs is not None and measures else None,
            own_weights=None if self.own_weights is None else tuple(self.own_weights[r] for r in chosen),
        )

    def _changed(self, change: Callable[[Any], Any]) -> Described:
        """Change all arrays alike; positions that are a block as well stay one object, which is compared once."""
        blocks = tuple(map(change, self.blocks))
        if self.pairs is None:
            return replace(self, blocks=blocks)
        old = self.pairs.positions
        same = [new for block, new in zip(self.blocks, blocks, strict=True) if block is old]
        positions = same[0] if same else change(old)
        return replace(
            self, blocks=blocks, pairs=replace(self.pairs, positions=positions, shapes=change(self.pairs.shapes))
        )

    def sizes(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return typical sizes in each representation, (R,): median norms of rows, or distances of opposite tangents.

        Movements that do not move have no size, and do not count; of such alone the norm is 0.
        """
        moving = [block.squares[block.squares > 0] for block in self.blocks]
        by_rows = [float(np.sqrt(np.median(squares))) if len(squares) else 0.0 for squares in moving]
        return np.array(by_rows + [2.0] * (self.n_representations - len(by_rows)))


def squared_distances(A: Described, B: Described) -> Array:
    """Return squared distances (R, n, m).

    Sample by sample they are Procrustes distances, each after a rotation of its own; pair by pair all are measured
    after the rotation that brings the positions over arc length closest.
    """
    squares = np.empty((A.n_representations, len(A), len(B)))
    step = max(1, _TILE_PAIRS // max(1, len(B)))
    for start in range(0, len(A), step):
        rows = slice(start, start + step)
        _fill(A if len(A) <= step else A.take(rows), B, squares[:, rows])
    return squares


def _fill(A: Described, B: Described, squares: Array) -> None:
    n_blocks = len(A.blocks)
    rotations = fill_by_rows(A, B, squares[:n_blocks])
    if A.pairs is not None and B.pairs is not None:
        measured = pair_distances(A.pairs.shapes, B.pairs.shapes, rotations)
        squares[n_blocks:] = measured[list(A.pairs.measures)]


def fill_by_rows(A: Described, B: Described, squares: Array) -> NDArray[np.float32] | None:
    """Write the squared distances (R', n, m) of what is compared sample by sample; the rotations of pairs, if needed.

    See `Procrustes.align` for these.
    """
    rotations = aligned = None
    if A.pairs is not None and B.pairs is not None:
        alignment, rotations = A.procrustes.align(A.pairs.positions, B.pairs.positions)
        aligned = A.pairs.positions
    for r, (a, b) in enumerate(zip(A.blocks, B.blocks, strict=True)):
        if aligned is not None and a is aligned:
            squares[r] = np.maximum(a.squares[:, None] + b.squares - 2.0 * alignment, 0.0)
        else:
            squares[r] = A.procrustes.squared_distances(a, b)
    return rotations

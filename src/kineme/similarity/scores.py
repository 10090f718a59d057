"""Described movements compared with the references: similarities and scores, computed once and only if needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.runtime.parallel import for_tiles
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import Tile, for_described
from kineme.similarity.described import Described
from kineme.similarity.references import References
from kineme.similarity.specification import LOG_MEANS, SHARES
from kineme.validation import Array

_TILE_PAIRS = 1_000_000  # similarities at a time: memory stays linear in the stored movements


@dataclass(frozen=True, eq=False)
class Compared:
    """n described movements, compared with m references of C classes."""

    comparison: Comparison
    references: References
    described: Described

    def __len__(self) -> int:
        return len(self.described)

    def with_squares(self, squares: Array) -> Compared:
        """Return the same with `squares` that were computed before."""
        same = replace(self)
        vars(same)["squares"] = squares
        return same

    @cached_property
    def squares(self) -> Array:
        """Squared distances in each representation, (R, n, m)."""
        return self.comparison.similarity.squared_distances(self.described, self.references.described)

    @cached_property
    def logs(self) -> Array:
        """Logarithms of each representation's kernel times R times its weight, (R, n, m)."""
        return self.comparison.similarity.logs_at(self.squares)

    @cached_property
    def log_average(self) -> Array:
        """Logarithms of the averaged kernel, (n, m)."""
        return LOG_MEANS[self.comparison.mean](self.logs)

    @cached_property
    def nearest(self) -> Array:
        """Log similarity to the nearest reference of each class, (n, C)."""
        return np.asarray(np.maximum.reduceat(self.log_average, self.references.first, axis=1))

    @cached_property
    def nearest_each(self) -> Array:
        """Log similarity to each class, in each representation to its own nearest reference of the class, (n, C)."""
        each = np.maximum.reduceat(self.logs, self.references.first, axis=2)
        return LOG_MEANS[self.comparison.mean](each)

    def shares(self, chosen: NDArray[np.intp]) -> Array:
        """Return the share of each representation in the similarity to one chosen (n,) reference each, (R, n)."""
        return SHARES[self.comparison.mean](self.logs[:, np.arange(len(self)), chosen])


Score = Callable[[Compared], Array]


def nearest(compared: Compared) -> Array:
    """Return log similarity to the nearest reference of each class, (n, C)."""
    return compared.nearest


def nearest_each(compared: Compared) -> Array:
    """Return log similarity to each class, in each representation to its own nearest reference of the class, (n, C)."""
    return compared.nearest_each


def score(
    comparison: Comparison, references: References, movements: Demonstrations | Described, *scores: Score
) -> tuple[Array, ...]:
    """Return scores (n, C), one array for each of the functions, of movements that are described once, tile by tile."""
    arrays = tuple(np.empty((len(movements), len(references.classes))) for _ in scores)

    def fill(start: int, compared: Compared) -> None:
        for array, by in zip(arrays, scores, strict=True):
            array[start : start + len(compared)] = by(compared)

    if isinstance(movements, Described):
        described = movements
        for_tiles(
            lambda a, b: fill(a, Compared(comparison, references, described.take(slice(a, b)))),
            len(described),
            tile_rows(references),
        )
    else:
        for_compared(comparison, references, movements, lambda tile, compared: fill(tile.start, compared))
    return arrays


def best_classes(
    comparison: Comparison,
    references: References,
    movements: Demonstrations,
    best: Callable[[Compared], NDArray[np.intp]],
) -> NDArray[np.intp]:
    """Return the index (n,) of the class of each movement, as the function finds them tile by tile."""
    classes = np.empty(len(movements), np.intp)

    def fill(tile: Tile, compared: Compared) -> None:
        classes[tile.start : tile.stop] = best(compared)

    for_compared(comparison, references, movements, fill)
    return classes


def for_compared(
    comparison: Comparison, references: References, demos: Demonstrations, work: Callable[[Tile, Compared], None]
) -> None:
    """Describe movements tile by tile, in threads, and hand each tile on with its comparison."""
    for_described(
        demos,
        comparison,
        comparison.procrustes,
        lambda tile: work(tile, Compared(comparison, references, tile.described)),
        tile_rows(references),
    )


def tile_rows(references: References) -> int:
    """Return movements to compare at a time."""
    return max(1, _TILE_PAIRS // len(references))

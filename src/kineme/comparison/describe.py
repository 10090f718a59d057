"""Movements as a recognizer sees them: smooth paths, then one block of rows per representation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kineme.comparison.normalization import Normalization
from kineme.comparison.representation import Representation
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.preparation.smooth import smooth_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array

_TILE_SAMPLES = 200_000  # numbers in one tile of paths: smaller ones make two threads wait for each other in Python
N_POINTS = 199  # even samples between the recording and the phases; every second is one of 100


def view(
    movements: Any, representations: Sequence[Representation], normalization: Normalization, cutoff: float | None
) -> tuple[Array, ...]:
    """Smooth movements below `cutoff` cycles each, and describe them: rows (n, d * S) per representation."""
    demos = Demonstrations.of(movements)
    rows = tuple(np.empty((len(demos), demos.n_dims * one.n_points)) for one in representations)

    def fill(start: int, stop: int) -> None:
        seen = view_tile(demos, start, stop, representations, normalization, cutoff)
        for block, tile in zip(rows, seen, strict=True):
            block[start:stop] = tile

    for_tiles(fill, len(demos), tile_movements(demos.n_dims))
    return rows


def view_tile(
    demos: Demonstrations,
    start: int,
    stop: int,
    representations: Sequence[Representation],
    normalization: Normalization,
    cutoff: float | None,
) -> tuple[Array, ...]:
    """The rows of movements start:stop."""
    paths = even_paths(demos, start, stop, cutoff)
    if not normalization.translation:
        paths = paths + demos.positions[demos.offsets[start:stop]][:, :, None]
    normalized: dict[tuple[float, int], Array] = {}  # representations share their phases
    seen = []
    for one in representations:
        phase = (one.arc_share, one.n_points)
        if phase not in normalized:
            normalized[phase] = normalization.apply(one.along(paths))
        seen.append(one.describe(normalized[phase], normalization.translation))
    return tuple(seen)


def even_paths(demos: Demonstrations, start: int, stop: int, cutoff: float | None) -> Array:
    """Movements start:stop, smoothed, at even times, minus their first recorded position, (stop - start, d, T)."""
    if cutoff is None:
        return relative_rows(demos, start, stop, N_POINTS)
    return smooth_rows(demos, start, stop, cutoff, N_POINTS)


def tile_movements(n_dims: int) -> int:
    """Movements of one tile."""
    return max(1, _TILE_SAMPLES // (n_dims * N_POINTS))

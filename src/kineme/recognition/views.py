"""Movements as a recognizer sees them: smoothed once, then one block of rows per representation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kineme.parallel import for_tiles
from kineme.recognition.normalization import Normalization
from kineme.recognition.representation import Representation
from kineme.trajectories.demonstrations import Demonstrations
from kineme.trajectories.preprocess import preprocess
from kineme.trajectories.resample import relative_rows
from kineme.trajectories.smooth import Smooth
from kineme.validation import Array

_TILE_SAMPLES = 100_000  # numbers in one tile of paths
N_POINTS = 200  # even samples between the recording and the phases


def view(
    movements: Any, representations: Sequence[Representation], normalization: Normalization, cutoff: float | None
) -> tuple[Array, ...]:
    """Smooth movements below `cutoff` cycles each, and describe them: rows (n, d * S) per representation."""
    demos = Demonstrations.of(movements)
    if cutoff is not None and demos.lengths.min() > 4:
        demos = preprocess(demos, [Smooth(cutoff)])
    n, d = len(demos), demos.n_dims
    rows = tuple(np.empty((n, d * one.n_points)) for one in representations)

    def see(start: int, stop: int) -> None:
        paths = relative_rows(demos, start, stop, N_POINTS)
        if not normalization.translation:
            paths = paths + demos.positions[demos.offsets[start:stop]][:, :, None]
        along: dict[tuple[float, int], Array] = {}  # representations share their phases
        for one, block in zip(representations, rows, strict=True):
            phase = (one.arc_share, one.n_points)
            if phase not in along:
                along[phase] = one.along(paths)
            block[start:stop] = one.describe(along[phase], normalization)

    for_tiles(see, n, max(1, _TILE_SAMPLES // (d * N_POINTS)))
    return rows

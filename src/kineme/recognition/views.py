"""Movements as a recognizer sees them: smoothed once, then one block of rows per representation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kineme.recognition.normalization import Normalization
from kineme.recognition.representation import Representation
from kineme.trajectories.demonstrations import Demonstrations
from kineme.trajectories.preprocess import preprocess
from kineme.trajectories.resample import relative_rows
from kineme.trajectories.smooth import Smooth
from kineme.validation import Array

N_POINTS = 200  # even samples between the recording and the phases


def view(
    movements: Any, representations: Sequence[Representation], normalization: Normalization, cutoff: float | None
) -> tuple[Array, ...]:
    """Smooth movements below `cutoff` cycles each, and describe them: rows (n, d * S) per representation."""
    demos = Demonstrations.of(movements)
    if cutoff is not None and demos.lengths.min() > 4:
        demos = preprocess(demos, [Smooth(cutoff)])
    paths = relative_rows(demos, 0, len(demos), N_POINTS)
    if not normalization.translation:
        paths = paths + demos.positions[demos.offsets[:-1]][:, :, None]
    return tuple(one.rows(paths, normalization) for one in representations)

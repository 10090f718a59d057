"""The remaining part of a movement, from the stored movement that explains its beginning best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.recognition.early.hypotheses import Hypotheses
from kineme.recognition.early.prefixes import Prefixes
from kineme.validation import Array

N_REMAINING = 20  # samples of the predicted path


class Forecast(NamedTuple):
    """Progress, seconds left, and the remaining path relative to the present position, (20, d)."""

    progress: float
    seconds: float
    path: Array


def forecast(stored: Hypotheses, evidence: Array, label: int, begun: Prefixes, duration: float) -> Forecast:
    """Progress and time left on average over a class's hypotheses, the path from its best one.

    Parameters
    ----------
    evidence : ndarray of shape (m * G,)
        Logarithms, see `log_evidence`.
    label : int
        Index of the class.
    duration : float
        Time since the start [s].

    Notes
    -----
    If `duration` is the share e of the demonstrated time, ``duration (1 - e) / e`` is left. The remaining part of the
    stored path is turned and sized as the beginning was, and put to where the movement is now.
    """
    G = len(stored.progress)
    end = int(stored.first[label + 1]) if label + 1 < len(stored.first) else len(stored.durations)
    own = np.arange(int(stored.first[label]) * G, end * G)
    logs = evidence[own]
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    elapsed = np.maximum(stored.prefixes.elapsed[own], 1e-3)
    best = int(own[logs.argmax()])
    movement = best // G
    path = stored.paths[movement]
    times = np.linspace(0.0, 1.0, path.shape[1])
    remaining_times = np.linspace(stored.prefixes.elapsed[best], 1.0, N_REMAINING)
    remaining = np.stack([np.interp(remaining_times, times, row) for row in path])
    remaining = remaining - remaining[:, :1]
    R = stored.procrustes.rotations(begun.positions, stored.prefixes.positions[best : best + 1])[0]
    size = begun.sizes[0] / stored.prefixes.sizes[best] if stored.prefixes.sizes[best] > 0 else 1.0
    return Forecast(
        float(weights @ np.tile(stored.progress, len(own) // G)),
        float(weights @ ((1.0 - elapsed) / elapsed)) * duration,
        size * (R @ remaining).T,
    )

"""Many movements of which only the beginning has been seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.preparation.arc_length import arc_length_phase
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.early.hypotheses import Early, Hypotheses, as_early, known_hypotheses
from kineme.recognition.early.prefixes import beginnings, smooth_paths
from kineme.recognition.labels import check_labels
from kineme.validation import MIN_SAMPLES, Array

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_TILE = 2_000_000  # hypotheses compared at a time
_N_SAMPLES = 200  # of a whole movement, of which `cut` takes the first


def partial_shares(recognizer: Recognizer, X: Any, early: Early | None = None) -> Array:
    """Share of each class, and, last, of an unknown movement, in the evidence of each beginning: (n, C + 1)."""
    demos = Demonstrations.of(X)
    if demos.n_dims != recognizer.n_dims_:
        raise TrajectoryError(
            f"expected movements of {recognizer.n_dims_} dimensions as in fit, got {demos.n_dims}; "
            "select the dimensions"
        )
    stored = known_hypotheses(recognizer, as_early(early))
    step = max(1, _TILE // len(stored.stored.lengths))
    return np.concatenate(
        [_shares(stored, demos[start : start + step], recognizer.cutoff) for start in range(0, len(demos), step)]
    )


def _shares(stored: Hypotheses, demos: Demonstrations, cutoff: float | None) -> Array:
    seen = beginnings(smooth_paths(demos, cutoff), np.ones(1))
    logs = stored.log_classes(stored.log_evidence(seen, demos.durations))
    shares = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def cut(movements: Any, fraction: float) -> Demonstrations:
    """The beginnings of movements until a share of their path's length, at even times."""
    demos = Demonstrations.of(movements)
    if not 0 < fraction <= 1:
        raise SpecificationError(f"expected a fraction above 0 and at most 1, got {fraction!r}")
    paths = relative_rows(demos, 0, len(demos), _N_SAMPLES)
    ends = np.maximum((arc_length_phase(paths) <= fraction + 1e-12).sum(axis=1), MIN_SAMPLES)
    seconds = demos.durations / (_N_SAMPLES - 1)
    return Demonstrations.from_arrays(
        [path[:, :end].T for path, end in zip(paths, ends, strict=True)],
        demos.labels,
        [step * np.arange(end) for step, end in zip(seconds, ends, strict=True)],
    )


def earliness(
    recognizer: Recognizer, X: Any, y: Any = None, fractions: Sequence[float] = (0.3, 0.5, 0.7, 1.0)
) -> Array:
    """Share of movements recognized after each fraction of their path, shape (len(fractions),)."""
    demos = Demonstrations.of(X)
    labels = check_labels(demos, y)
    return np.array([np.mean(recognizer.predict_partial(cut(demos, fraction)) == labels) for fraction in fractions])

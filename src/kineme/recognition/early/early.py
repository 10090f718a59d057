"""Recognize many movements by their beginnings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError
from kineme.movements.preparation.pauses import without_pauses
from kineme.movements.preparation.resample import arc_length_phase, relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations, check_labels
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.early.evidence import describe_begun, log_evidence
from kineme.recognition.early.hypotheses import Hypotheses
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import even_paths
from kineme.validation import MIN_SAMPLES, Array

_TILE = 2_000_000  # hypotheses compared at a time
_N_SAMPLES = 200  # of a whole movement, of which `cut` takes the first


def partial_shares(comparison: Comparison, stored: Hypotheses, X: MovementsLike) -> Array:
    """Share of each class, and, last, of an unknown movement, in the evidence of each beginning: (n, C + 1)."""
    demos = comparison.checked(X)
    step = max(1, _TILE // len(stored.prefixes.lengths))
    return np.concatenate(
        [_shares(comparison, stored, demos[start : start + step]) for start in range(0, len(demos), step)]
    )


def _shares(comparison: Comparison, stored: Hypotheses, demos: Demonstrations) -> Array:
    demos = without_pauses(demos, 0, len(demos)) or demos
    paths = even_paths(demos, 0, len(demos), comparison.cutoff)
    starts = demos.positions[demos.offsets[:-1]]
    return stored.shares(log_evidence(stored, describe_begun(stored, paths, starts, demos.durations)))


def cut(movements: MovementsLike, fraction: float) -> Demonstrations:
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


class PredictsPartial(Protocol):
    """A recognizer, or whatever else names movements by their beginnings."""

    def predict_partial(self, X: MovementsLike) -> NDArray[Any]:
        """The most likely class of each beginning, shape (n,)."""
        ...


def earliness(
    recognizer: PredictsPartial,
    X: MovementsLike,
    y: ArrayLike | None = None,
    fractions: Sequence[float] = (0.3, 0.5, 0.7, 1.0),
) -> Array:
    """Share of movements recognized after each fraction of their path, shape (len(fractions),)."""
    demos = Demonstrations.of(X)
    labels = check_labels(demos, y)
    return np.array([np.mean(recognizer.predict_partial(cut(demos, fraction)) == labels) for fraction in fractions])

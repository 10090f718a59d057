"""The map from a demonstration onto a movement like it: translation, size, rotation, duration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.alignment import fit_maps
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import even_paths, recorded_paths
from kineme.similarity.references import IndexedMovements
from kineme.similarity.representation import POSITIONS
from kineme.validation import Array


@dataclass(frozen=True, eq=False)
class Transform:
    """``x = matrix @ x_demonstration + shift``, and a time that runs `duration_ratio` as long.

    With sizes of both per dimension, ``matrix = diag(size) R diag(1 / size_demonstration)``; with one size for all
    dimensions, ``matrix = scale R``. What the recognizer does not take out stays 0, or 1, here.
    """

    matrix: Array  # (d, d)
    shift: Array  # (d,)
    scale: Array  # (d,), equal numbers unless sizes are per dimension
    rotation: Array  # (d, d), R
    duration_ratio: float

    @property
    def angle(self) -> float:
        """Angle of the rotation [rad]; with a sign in the plane, counterclockwise positive."""
        if len(self.rotation) == 2:
            return math.atan2(self.rotation[1, 0], self.rotation[0, 0])
        if len(self.rotation) != 3:
            return 0.0
        skew = self.rotation - self.rotation.T
        return math.atan2(float(np.linalg.norm(skew)) / math.sqrt(2.0), float(np.trace(self.rotation)) - 1.0)

    def apply(self, positions: Array) -> Array:
        """Return positions (T, d) of the demonstration, mapped."""
        return np.asarray(positions) @ self.matrix.T + self.shift


def map_onto(
    comparison: Comparison,
    references: IndexedMovements,
    example: NDArray[np.intp],
    demos: Demonstrations,
    paths: Array,
    share: Array,
) -> list[Transform]:
    """Return transforms from the references `example` (n,) onto as many movements.

    Fitted to positions over the phase of the representation with the largest share (R, n), one batch for each phase.

    `demos`: the movements; `paths` (n, d, T): of the movements, where they were recorded.
    """
    # Of two representations that are equally alike, the one with the larger weight has the larger share.
    weights = comparison.similarity.weights
    alike = share if weights is None else share / np.maximum(weights, np.finfo(float).tiny)[:, None]
    phases = np.array([representation.arc_share for representation in comparison.representations])[alike.argmax(axis=0)]
    used, which = np.unique(example, return_inverse=True)  # one example may be that of many
    stored = references[used]
    examples = recorded_paths(stored, even_paths(stored, 0, len(stored), comparison.cutoff))[which]
    ratios = (demos.durations / stored.durations[which]).tolist()
    transforms: dict[int, Transform] = {}
    for phase in np.unique(phases):
        chosen = np.flatnonzero(phases == phase)
        positions = replace(POSITIONS, arc_share=float(phase))
        ours, theirs = positions.along(examples[chosen]), positions.along(paths[chosen])
        maps = fit_maps(ours, theirs, comparison.normalization, comparison.procrustes)
        for i, matrix, shift, rotation, scale in zip(chosen.tolist(), *maps, strict=True):
            transforms[i] = Transform(matrix, shift, scale, rotation, ratios[i])
    return [transforms[i] for i in range(len(demos))]

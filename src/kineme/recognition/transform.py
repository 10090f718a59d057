"""The map from a demonstration onto a movement like it: place, size, direction, duration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.describe import even_paths
from kineme.comparison.normalization import Normalization
from kineme.comparison.representation import Representation
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer


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
        """Positions (T, d) of the demonstration, mapped."""
        return np.asarray(positions) @ self.matrix.T + self.shift


def map_onto(recognizer: Recognizer, example: NDArray[np.intp], demos: Demonstrations, share: Array) -> list[Transform]:
    """Transforms from stored demonstrations `example` (n,) onto as many movements.

    Fitted to positions over the phase of the representation with the largest share, one batch for each phase.
    """
    looks = recognizer.looks()
    phases = np.array([one.arc_share for one in looks])[share.argmax(axis=0)]
    stored = recognizer.demonstrations_[example]
    found: dict[int, Transform] = {}
    for phase in np.unique(phases):
        chosen = np.flatnonzero(phases == phase)
        look = replace(looks[0], quantity="positions", arc_share=float(phase))
        maps = _fitted(recognizer, look, stored[chosen], demos[chosen])
        found |= dict(zip(chosen.tolist(), maps, strict=True))
    return [found[i] for i in range(len(demos))]


def _fitted(recognizer: Recognizer, look: Representation, A: Demonstrations, B: Demonstrations) -> list[Transform]:
    """From each movement of A onto the same one of B."""
    normalization = Normalization(recognizer.translation, recognizer.scale)
    a, b = (look.along(_paths(one, recognizer.cutoff)) for one in (A, B))
    centers, sizes = [normalization.center(x) for x in (a, b)], [normalization.size(x) for x in (a, b)]
    rows = [((x - c) / s).reshape(len(x), -1) for x, c, s in zip((a, b), centers, sizes, strict=True)]
    R = recognizer.procrustes_.rotations(rows[1], rows[0])
    d = recognizer.n_dims_
    size_a, size_b = (np.broadcast_to(s, (len(R), d, 1)) for s in sizes)
    matrix = size_b * R / size_a.transpose(0, 2, 1)
    shift = (centers[1] - matrix @ centers[0])[:, :, 0]
    scale = (size_b / size_a)[:, :, 0]
    ratio = (B.durations / A.durations).tolist()
    return [Transform(matrix[i], shift[i], scale[i], R[i], ratio[i]) for i in range(len(R))]


def _paths(demos: Demonstrations, cutoff: float | None) -> Array:
    """Smooth even paths (n, d, T), in the place where they were recorded."""
    return even_paths(demos, 0, len(demos), cutoff) + demos.positions[demos.offsets[:-1]][:, :, None]

"""Rivals that give each movement the class of the nearest training movement."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from kineme.comparison.normalization import Normalization
from kineme.errors import DegenerateMovementWarning
from kineme.experiments.evaluation.optional import optional_module
from kineme.features.dmp_features import DMPFeatures
from kineme.movements.preparation.arc_length import arc_length_phase, resample_by_phase
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.primitives.discrete.dmp import DMP
from kineme.validation import Array

N_POINTS = 200
_BAND = 0.1  # of the samples: Sakoe and Chiba's band
_CLOUD = 32  # points of $P


def standard_paths(demonstrations: Demonstrations, n_points: int = N_POINTS) -> Array:
    """Positions at even times, centered and scaled as a whole to unit size, shape (n, d, n_points)."""
    paths = relative_rows(demonstrations, 0, len(demonstrations), n_points)
    normalization = Normalization()
    return normalization.apply(paths)


class _Nearest:
    """1-NN classifier; subclasses define `describe` and `distances`."""

    def fit(self, demonstrations: Demonstrations) -> None:
        """Store the training movements."""
        self.labels = require_labels(demonstrations)
        self.stored = self.describe(demonstrations)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class of the nearest movement, and minus its distance."""
        distances = self.distances(self.describe(demonstrations), self.stored)
        return self.labels[distances.argmin(axis=1)], -distances.min(axis=1)

    def describe(self, demonstrations: Demonstrations) -> Any:
        """Movements in the form that `distances` compares."""
        return standard_paths(demonstrations).reshape(len(demonstrations), -1)

    def distances(self, A: Any, B: Any) -> Array:
        """Distances (n, m)."""
        return np.asarray(cdist(A, B))


class EuclideanNeighbor(_Nearest):
    """Euclidean distance of centered, scaled positions at 200 even times."""


class PaperFeatures(_Nearest):
    """The paper's configuration: a DMP feature with the paper's parameters, Euclidean distance."""

    def __init__(self, formulation: str, feature: str) -> None:
        self.features = DMPFeatures(feature, DMP(formulation, fit="forcing", n_basis=80))

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Nearest
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DegenerateMovementWarning)  # small g - x0: part of what is measured
            return np.asarray(self.features.fit_transform(demonstrations))


class DTWNeighbor(_Nearest):
    """Dynamic time warping of dtaidistance in all dimensions at once, 10 % band, on the same positions."""

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Nearest
        return np.ascontiguousarray(standard_paths(demonstrations).transpose(0, 2, 1))

    def distances(self, A: Array, B: Array) -> Array:  # noqa: D102 - see _Nearest
        dtw_ndim = optional_module("dtaidistance.dtw_ndim")
        n, window = len(A), round(_BAND * N_POINTS)
        both, block = np.concatenate((A, B)), ((0, n), (n, n + len(B)))
        whole = dtw_ndim.distance_matrix_fast(both, block=block, window=window, parallel=False)
        return np.asarray(whole)[:n, n:]


class PointCloud(_Nearest):
    """$P of Vatavu, Anthony and Wobbrock (ICMI 2012) as dollarpy has it: 32 points each, in any order."""

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Nearest
        paths = relative_rows(demonstrations, 0, len(demonstrations), N_POINTS)
        along = resample_by_phase(paths, arc_length_phase(paths), _CLOUD)
        return along - along.min(axis=2, keepdims=True)  # it expects no negative coordinates

    def distances(self, A: Array, B: Array) -> Array:  # noqa: D102 - see _Nearest
        return np.array([self._distances_from(one, B) for one in A])

    def _distances_from(self, one: Array, B: Array) -> Array:
        dollarpy = optional_module("dollarpy")
        # A recognizer per pair, and fresh lists: it inserts points into those it is given.
        points = [[dollarpy.Point(x, y) for x, y in path.T.tolist()] for path in (one, *B)]
        distances = []
        for cloud in points[1:]:
            _, score = dollarpy.Recognizer([dollarpy.Template("other", cloud)]).recognize(list(points[0]), _CLOUD)
            distances.append(2.0 - 2.0 * score)
        return np.array(distances)

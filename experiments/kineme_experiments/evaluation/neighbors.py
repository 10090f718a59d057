"""Rivals that give each movement the class of the nearest training movement."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import cdist, squareform

from kineme.dmp.discrete.dmp import DMP
from kineme.errors import DegenerateMovementWarning
from kineme.features.movement_features import DMPFeatures
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.validation import Array
from kineme_experiments.evaluation.optional import optional_module
from kineme_experiments.evaluation.paths import paths_over_length, paths_over_time

_N_POINTS = 100
_BAND = 0.1  # of the samples: Sakoe and Chiba's band


def average_linkage(distances: Array, n_clusters: int) -> NDArray[np.intp]:
    """Cluster of each movement from distances (n, n): average linkage, cut into `n_clusters`."""
    even = 0.5 * (distances + distances.T)
    np.fill_diagonal(even, 0.0)
    return np.asarray(fcluster(linkage(squareform(even, checks=False), "average"), n_clusters, "maxclust"))


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

    def cluster(self, demonstrations: Demonstrations, n_clusters: int | None) -> NDArray[np.intp] | None:
        """Cluster of each movement by average linkage; None where the number is not given."""
        if n_clusters is None:
            return None
        described = self.describe(demonstrations)
        return average_linkage(self.distances(described, described), n_clusters)

    def describe(self, demonstrations: Demonstrations) -> Any:
        """Movements in the form that `distances` compares."""
        return paths_over_length(demonstrations, _N_POINTS).reshape(len(demonstrations), -1)

    def distances(self, A: Any, B: Any) -> Array:
        """Distances (n, m)."""
        return np.asarray(cdist(A, B))


class EuclideanNeighbor(_Nearest):
    """Euclidean distance of centered, scaled positions at 100 even arc lengths."""


class PaperFeatures(_Nearest):
    """The paper's configuration: a DMP feature with the paper's parameters, Euclidean distance."""

    def __init__(self, formulation: str, feature: str) -> None:
        self.features = DMPFeatures(feature, DMP(formulation, fit="forcing", n_basis=80))

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Nearest
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DegenerateMovementWarning)  # small g - x0: part of what is measured
            return np.asarray(self.features.fit_transform(demonstrations))


class DTWNeighbor(_Nearest):
    """Dynamic time warping of dtaidistance in all dimensions at once, 10 % band, on centered, scaled positions.

    They are even in time, or with `along_path` smoothed and even in arc length.
    """

    def __init__(self, along_path: bool = False) -> None:
        self.paths = paths_over_length if along_path else paths_over_time

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Nearest
        return np.ascontiguousarray(self.paths(demonstrations, _N_POINTS).transpose(0, 2, 1))

    def distances(self, A: Array, B: Array) -> Array:  # noqa: D102 - see _Nearest
        dtw_ndim = optional_module("dtaidistance.dtw_ndim")
        n, window = len(A), round(_BAND * _N_POINTS)
        both, block = np.concatenate((A, B)), ((0, n), (n, n + len(B)))
        whole = dtw_ndim.distance_matrix_fast(both, block=block, window=window, parallel=False)
        return np.asarray(whole)[:n, n:]

"""Rivals that compare movements as clouds of points: $P, $P+ and $Q, written from their papers for any dimension."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from kineme.experiments.evaluation.neighbors import average_linkage
from kineme.experiments.evaluation.paths import smooth_paths
from kineme.kernels.point_cloud import matched_sums
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

_IN_PLANE, _IN_SPACE = 32, 16  # points of $P+: those of the paper, and those that do best beyond the plane
_MATCHED = 32  # points of $P and $Q


def clouds(demonstrations: Demonstrations, n_points: int) -> Array:
    """Points of the smoothed path at even arc length, divided by its largest extent, centered: (n, n_points, d)."""
    points = smooth_paths(demonstrations, n_points)
    extent = np.ptp(points, axis=2).max(axis=1)[:, None, None]
    points = points / np.where(extent > 0, extent, 1.0)
    return np.ascontiguousarray((points - points.mean(axis=2, keepdims=True)).transpose(0, 2, 1))


def turning_angles(points: Array) -> Array:
    """Angle between the steps before and after each point, divided by pi; 0 at both ends. (n, N, d) to (n, N)."""
    steps = np.diff(points, axis=1)
    lengths = np.linalg.norm(steps, axis=2)
    products = lengths[:, 1:] * lengths[:, :-1]
    cosines = (steps[:, 1:] * steps[:, :-1]).sum(axis=2) / np.where(products > 0, products, 1.0)
    angles = np.zeros(points.shape[:2])
    angles[:, 1:-1] = np.where(products > 0, np.arccos(np.clip(cosines, -1.0, 1.0)) / np.pi, 0.0)
    return angles


def plus_distances(A: Array, B: Array) -> Array:
    """$P+ distances of clouds with turning angles, (n, N, d + 1) and (m, N, d + 1), shape (n, m)."""
    if use_compiled(4 * A.shape[1] ** 2 * A.shape[2] * len(A) * len(B)):
        distances = np.empty((len(A), len(B)))
        compiled_module("kineme.experiments.evaluation._clouds").fill_plus(A, B, distances)
        return distances
    return np.stack([matched_sums(np.stack([cdist(one, other) for other in B])) for one in A])


def nearest_by_matching(A: Array, B: Array, squared: bool) -> tuple[NDArray[np.intp], Array]:
    """Index of the nearest of the clouds B (m, N, d) to each of A (n, N, d), and its distance; (n,) each.

    With squared distances between points as in $Q, else with plain ones as in $P.
    """
    step = int(np.sqrt(A.shape[1]))
    if use_compiled(A.shape[1] ** 2 * (A.shape[2] + step) * len(A) * len(B)):
        nearest, distances = np.zeros(len(A), dtype=np.intp), np.empty(len(A))
        module = compiled_module("kineme.experiments.evaluation._clouds")
        module.fill_nearest(A, B, step, squared, nearest, distances)
        return nearest, distances
    metric = "sqeuclidean" if squared else "euclidean"
    costs = np.array([[_matched(cdist(one, other, metric), step) for other in B] for one in A])
    return costs.argmin(axis=1), costs.min(axis=1)


def _matched(squares: Array, step: int) -> float:
    """The least cost of all starts in both directions."""
    starts = range(0, len(squares), step)
    return min(_greedy(each, start) for each in (squares, squares.T) for start in starts)


def _greedy(squares: Array, start: int) -> float:
    """Cost of matching point after point to its nearest unmatched one, the first weighing most."""
    free = squares.copy()
    total, size = 0.0, len(squares)
    for k in range(size):
        i = (start + k) % size
        nearest = free[i].argmin()
        total += (size - k) * free[i, nearest]
        free[:, nearest] = np.inf
    return float(total)


class _Cloud:
    """1-NN classifier of clouds of points."""

    def fit(self, demonstrations: Demonstrations) -> None:
        """Store the training movements."""
        self.labels, self.stored = require_labels(demonstrations), self.describe(demonstrations)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class of the nearest movement, and minus its distance."""
        nearest, distances = self.nearest(self.describe(demonstrations))
        return self.labels[nearest], -distances

    def describe(self, demonstrations: Demonstrations) -> Array:
        """Movements as clouds (n, N, d)."""
        return clouds(demonstrations, _MATCHED)

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the nearest stored cloud to each, and its distance."""
        raise NotImplementedError


class PlusCloud(_Cloud):
    """$P+ of Vatavu (CHI 2017): points may be matched several times, and carry their turning angle.

    32 points in the plane, as in the paper, and 16 in other dimensions, where they do better.
    """

    def describe(self, demonstrations: Demonstrations) -> Array:  # noqa: D102 - see _Cloud
        points = clouds(demonstrations, _IN_PLANE if demonstrations.n_dims == 2 else _IN_SPACE)
        return np.concatenate((points, turning_angles(points)[:, :, None]), axis=2)

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:  # noqa: D102 - see _Cloud
        distances = plus_distances(described, self.stored)
        return distances.argmin(axis=1), distances.min(axis=1)

    def cluster(self, demonstrations: Demonstrations, n_clusters: int | None) -> NDArray[np.intp] | None:
        """Cluster of each movement by average linkage; None where the number is not given."""
        if n_clusters is None:
            return None
        described = self.describe(demonstrations)
        return average_linkage(plus_distances(described, described), n_clusters)


class PointCloud(_Cloud):
    """$P of Vatavu, Anthony and Wobbrock (ICMI 2012): greedy matching of 32 points in any order, from several starts.

    It abandons as $Q does, which changes no answer.
    """

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:  # noqa: D102 - see _Cloud
        return nearest_by_matching(described, self.stored, squared=False)


class QuickCloud(_Cloud):
    """$Q of Vatavu, Anthony and Wobbrock (MobileHCI 2018): $P's matching, squared, with bounds and early abandoning.

    The bounds come from exact nearest points instead of a table over a grid, so that they hold in any dimension.
    """

    def nearest(self, described: Array) -> tuple[NDArray[np.intp], Array]:  # noqa: D102 - see _Cloud
        return nearest_by_matching(described, self.stored, squared=True)

"""Each demonstration as if it were new: how far it is from the others of its class, and from the other classes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import TrajectoryError
from kineme.validation import Array

_PRIOR = 4.0  # demonstrations that the common scale counts for beside those of the class
DIMENSIONS = 8  # in which members of a class vary, about: even, for the closed form of the law of distances
MEAN_LENGTH = (
    math.sqrt(2.0) * math.gamma((DIMENSIONS + 1) / 2) / math.gamma(DIMENSIONS / 2)
)  # of normal vectors in these
#: Smallest scale, in kernel widths: rounding of single precision puts copies up to 0.002 apart.
LEAST = 5e-3
ROUNDING = 1e-5  # of log similarities, in single precision
#: Share of the typical distance to another class within which 95 % of members are expected, with one demonstration of
#: each class: of movements by the same people, and by others.
REACH, REACH_OF_OTHERS = 0.75, 1.0
#: Of movements by somebody who showed none, the same share of the typical distance, and of their own distance to the
#: next class, see `Calibration`.
REACH_OF_STRANGERS, REACH_TO_NEXT = 0.9, 2 / 3
#: Distance of movements of other kinds from one movement that is known alone, about: their median on four sets is 3.0
#: to 4.0. At 0.75 of 3.5, 3 to 10 in 100 of them are taken for it, and 0 to 7 of 100 repetitions by the same hand are
#: not. Two sets differ: of LASA's shapes 29 in 100 are taken for another, and of the words of a sign language 40 in 100
#: repetitions are not taken for their own.
FOREIGN = 3.5


def distances(logs: Array) -> Array:
    """Return ``sqrt(-2 log K)``: the distance, in kernel widths, whose Gaussian is the averaged similarity K.

    0 between copies: what rounding makes of them would make some more novel than others.
    """
    return np.sqrt(np.where(logs < -ROUNDING, -2.0 * logs, 0.0))


def broad_law(scores: Array) -> Array:
    """Return ``exp(-pi/4 a^2)``, the share of distances above a times their mean, of vectors in a plane (Rayleigh)."""
    return np.asarray(np.exp(-0.25 * math.pi * scores**2))


def law(scores: Array) -> Array:
    """Return the share of distances above `scores` times their mean, of normal vectors in eight dimensions.

    ``P(chi_8 >= x) = exp(-y) (1 + y + y^2 / 2 + y^3 / 6)`` with ``y = x^2 / 2``; x is the score times the mean of
    chi_8, 2.74. It is 0.05 at 1.44 times the mean; measured were 1.36 to 1.47 times, of people's movements.
    """
    y = 0.5 * (MEAN_LENGTH * scores) ** 2
    terms = sum(y**k / math.factorial(k) for k in range(DIMENSIONS // 2))
    return np.asarray(np.exp(-y) * terms)


def typical_scale(impostors: Array, reach: float = REACH) -> float:
    """Return the scale of classes shown once, from distances of demonstrations to the nearest other class."""
    return reaching(reach * typical_distance(impostors))


def typical_distance(impostors: Array) -> float:
    """Return the median distance to the nearest other class; with one class, and so without any distance, `FOREIGN`."""
    apart = impostors[np.isfinite(impostors)]
    return float(np.median(apart)) if len(apart) else FOREIGN


@overload
def reaching(away: float) -> float: ...
@overload
def reaching(away: Array) -> Array: ...
def reaching(away: float | Array) -> float | Array:
    """Return the scale by which `broad_law` is 0.05 at these distances."""
    return away * math.sqrt(math.pi / 4 / math.log(20))


def check_groups(groups: ArrayLike, n: int) -> NDArray[np.intp]:
    """Return numbers of the groups, one for each of n movements.

    Raises `TrajectoryError`: not one group for each movement, or texts beside numbers.
    """
    given = np.asarray(groups)
    if given.shape != (n,):
        raise TrajectoryError(
            f"expected groups to be one name or number for each of the {n} movements, such as who did it, got an array "
            f"of shape {given.shape}"
        )
    if given.dtype.kind == "f" and np.isnan(given).any():
        raise TrajectoryError(
            "expected a group for each movement, got nan; give a name of its own to whoever is unknown"
        )
    try:
        return np.asarray(np.unique(given, return_inverse=True)[1], dtype=np.intp)
    except TypeError:
        kinds = " and ".join(sorted({type(value).__name__ for value in given.tolist()}))
        raise TrajectoryError(f"expected groups to be all texts or all numbers, got {kinds}") from None


def comparable_groups(groups: NDArray[np.intp] | None) -> NDArray[np.intp] | None:
    """Return the groups; None where there is one alone, in which nothing could be compared: it counts as no groups."""
    return None if groups is None or len(np.unique(groups)) == 1 else groups


@dataclass(frozen=True, eq=False)
class ClassDistances:
    """Distances (k, n) of k calibrating demonstrations, at `indices`, to the n demonstrations of their class.

    Infinite where the two are not to be compared: of a demonstration to itself, or to another of its group. `groups`
    are those of the n demonstrations; None if each is a group of its own.
    """

    distances: Array
    indices: NDArray[np.intp]
    groups: NDArray[np.intp] | None = None

    def nearest(self, size: int) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return distances to the nearest and second nearest of the next `size` others, in a circle, and the index."""
        k, n = self.distances.shape
        circle = (self.indices[:, None] + np.arange(n)) % n
        away = np.take_along_axis(self.distances, circle, axis=1)
        away[np.cumsum(np.isfinite(away), axis=1) > size] = np.inf
        order = np.sort(away, axis=1)
        which = circle[np.arange(k), away.argmin(axis=1)]
        return order[:, 0], order[:, 1] if n > 1 else np.full(k, np.inf), which

    def counted(self, size: int) -> NDArray[np.intp]:
        """Return the number of others that `nearest` compares each with, at most `size`."""
        return np.minimum(np.isfinite(self.distances).sum(axis=1), size)

    def shares(self, size: int) -> Array:
        """Return shares by which distances to the nearest shrink, about, with `size` others, not those `counted`."""
        return np.asarray((np.maximum(self.counted(size), 1) / size) ** (1 / DIMENSIONS))

    def left_out(self, size: int) -> Array:
        """Return distances (k, k) to the nearest, row i as if i and its group did not exist; NaN if there is none."""
        if self.groups is None:
            first, second, which = self.nearest(size)
            without = np.where(which[None, :] == self.indices[:, None], second, first)
            np.fill_diagonal(without, np.inf)
        else:
            own, without = self.groups[self.indices], np.empty((len(self.indices), len(self.indices)))
            for group in np.unique(own):
                remaining = np.where(self.groups == group, np.inf, self.distances)
                nearest = ClassDistances(remaining, self.indices).nearest(size)[0]
                without[own == group] = np.where(own == group, np.inf, nearest)
        return np.where(np.isfinite(without), without, np.nan)


@dataclass(frozen=True, eq=False)
class Scored:
    """Classes compared as if each had `size` demonstrations.

    `scores`: of each class, its calibrating demonstrations' distances to the nearest other of the class, over the scale
    from which they are left out; infinite where there is no other.
    """

    scales: Array  # (C,), of the classes
    scores: tuple[Array, ...]
    shares: tuple[Array, ...]  # by which these shrink, about, if there are `size` others instead of the number at hand

    def pooled(self) -> Array:
        """Return finite scores of all classes."""
        return finite(np.concatenate(self.scores))

    def pooled_novelties(self) -> Array:
        """Return these as they would be with `size` others, as far as they are known without the other classes."""
        return finite(np.concatenate([own * share for own, share in zip(self.scores, self.shares, strict=True)]))


def score_classes(blocks: list[ClassDistances], size: int, typical: float) -> Scored:
    """Return scales of all classes and scores of all demonstrations, each against at most `size` others of its class.

    The nearest of n movements that vary in m dimensions is at a distance that falls as n^(-1/m). With eight dimensions
    a second demonstration brings the nearest 8 % closer; measured were 5 to 13 % (``python -m bench --only open_set``).
    """
    nearest = [block.nearest(size)[0] for block in blocks]
    finite_distances = np.concatenate(nearest)
    finite_distances = finite_distances[np.isfinite(finite_distances)]
    if not finite_distances.size:
        return Scored(np.full(len(blocks), typical), tuple(nearest), tuple(map(np.ones_like, nearest)))
    common, scales, scores = float(finite_distances.mean()), [], []
    for block, own in zip(blocks, nearest, strict=True):
        among = np.where(np.isfinite(own), own, np.nan)[None]
        scales.append(max(_shrunk(among, common)[0], LEAST))
        scores.append(own / np.maximum(_shrunk(block.left_out(size), common), LEAST))
    return Scored(np.array(scales), tuple(scores), tuple(block.shares(size) for block in blocks))


def finite(scores: Array) -> Array:
    """Return scores of what has others to be compared with."""
    return np.asarray(scores[np.isfinite(scores)])


def _shrunk(values: Array, common: float) -> Array:
    """Return means of rows, NaN left out, shrunk towards the common one."""
    return np.asarray((np.nansum(values, axis=1) + _PRIOR * common) / (np.isfinite(values).sum(axis=1) + _PRIOR))

"""The open set: conformal p-values of a movement for each class, calibrated on the demonstrations.

Source: V. Vovk, A. Gammerman, G. Shafer, "Algorithmic Learning in a Random World", Springer 2005, chapters 2 and 4
(conformal and class-conditional, or Mondrian, predictors).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.references import References
from kineme.comparison.similarity import AveragedSimilarity
from kineme.errors import SpecificationError
from kineme.sampling import evenly_spaced
from kineme.validation import Array, check_number

_CALIBRATED = 100  # demonstrations of a class that calibrate it, at most, evenly spaced
_PRIOR = 4.0  # demonstrations that the common scale counts for beside those of the class
_LEAST = 5e-3  # smallest scale, in kernel widths: rounding of single precision puts copies up to 0.002 apart
#: Share of the typical distance to another class within which 95 % of members are expected without calibration.
REACH = 0.6


def check_error_rate(error_rate: float) -> None:
    """Refuse what is not a share between 0 and 1."""
    check_number("error_rate", error_rate, above=0.0)
    if error_rate >= 1:
        raise SpecificationError(f"expected error_rate below 1, got {error_rate!r}; 0.05 is one member in twenty")


def distances(logs: Array) -> Array:
    """``sqrt(-2 log K)``: the distance, in kernel widths, whose Gaussian is the averaged similarity K."""
    return np.sqrt(np.maximum(-2.0 * logs, 0.0))


@dataclass(frozen=True, eq=False)
class Calibration:
    """Distances of members of each class from their nearest demonstration, estimated from the demonstrations.

    With one demonstration of each class they cannot be estimated: p-values are then a guess, see 3. below.

    The nonconformity of a movement to class c is ``a_c = d_c / s_c``: its distance d_c to the nearest demonstration of
    the class, ``d = sqrt(-2 log K)``, over the scale s_c of the class. Each demonstration gets the same score with
    itself left out, and ``p_c = (1 + #{scores >= a_c}) / (number of scores + 1)``. Whatever the distribution,
    p_c <= e then happens to a share of at most about e of the members.

    Which scores count depends on how many there are, for p_c cannot fall below 1 / (number + 1):

    1. Those of the class, where they suffice for the error rate; 19 do for 0.05. The rate holds for each class.
    2. Those of all classes. The rate holds for members of all classes together. Each is scored against as many
       demonstrations of its class as class c has, so that unequal classes compare; and scaled by a mean from which
       it is left out.
    3. None: ``p_c = exp(-pi/4 a_c^2)``, the law (Rayleigh) of a distance in the plane whose mean is s_c. A guess: it
       takes how much members differ from how far the classes are apart. With one demonstration of each class, 0 to
       79 % of true members were rejected at 0.05, the more the more they differed (``python -m bench --only
       one_shot``). `calibrated` tells which classes this is about.

    The scale s_c is the mean left-out distance of the class, shrunk towards that of all classes as if by four more,
    since the mean of two or three is little known. With one demonstration of every class no distance within a class is
    known; s_c is then set so that the law reaches 0.05 at six tenths of the median distance from a demonstration to
    the nearest other class: where a movement is half way to an impostor in two of three representations and
    nowhere near in the third.

    Attributes
    ----------
    scales : ndarray of shape (C,)
        The s_c.
    own : tuple of C ndarrays
        Of each class, the scores of its demonstrations.
    pooled : tuple of C ndarrays
        For each class, the scores of all demonstrations, each scored against as many as the class has.
    """

    scales: Array
    own: tuple[Array, ...]
    pooled: tuple[Array, ...]

    def scores(self, nearest: Array) -> Array:
        """Nonconformity (n, C) of movements whose log similarity to each class's nearest demonstration is given."""
        return distances(nearest) / self.scales

    def p_values(self, nearest: Array, error_rate: float) -> Array:
        """P-values (n, C), from as few classes as suffice to reach `error_rate`."""
        scores = self.scores(nearest)
        result = np.exp(-0.25 * math.pi * scores**2)
        ordered: dict[int, Array] = {}  # classes share what is pooled
        for c, counted in enumerate(self._counted(error_rate)):
            if counted is not None:
                if id(counted) not in ordered:
                    ordered[id(counted)] = np.sort(counted)
                calibrating = ordered[id(counted)]
                above = len(calibrating) - np.searchsorted(calibrating, scores[:, c])
                result[:, c] = (1.0 + above) / (len(calibrating) + 1.0)
        return result

    def calibrated(self, error_rate: float) -> NDArray[np.bool_]:
        """Whether p-values of each class keep `error_rate`, shape (C,); elsewhere they are a guess.

        They keep it where at least ``1 / error_rate - 1`` left-out scores count. One demonstration has none.
        """
        return np.array([counted is not None for counted in self._counted(error_rate)])

    def select(self, classes: NDArray[np.intp]) -> Calibration:
        """The calibration of some of the classes."""
        own, pooled = (tuple(part[c] for c in classes) for part in (self.own, self.pooled))
        return Calibration(self.scales[classes], own, pooled)

    def _counted(self, error_rate: float) -> list[Array | None]:
        """Of each class the scores that count: its own, else those of all, else none."""
        choices = zip(self.own, self.pooled, strict=True)
        return [next((one for one in pair if (len(one) + 1) * error_rate > 1 - 1e-12), None) for pair in choices]


def calibrate(similarity: AveragedSimilarity, references: References) -> Calibration:
    """Score references against the others, at most a hundred of each class."""
    counts, described = references.counts, references.described
    blocks, impostors = [], []
    for own_class, count in zip(references.slices(), counts, strict=True):
        chosen = own_class.start + evenly_spaced(count, _CALIBRATED)
        away = distances(similarity.log_average(described.take(chosen), described))
        away[np.arange(len(chosen)), chosen] = np.inf
        blocks.append(ClassDistances(away[:, own_class].copy(), chosen - own_class.start))
        away[:, own_class] = np.inf
        impostors.append(away.min(axis=1))
    typical = typical_scale(np.concatenate(impostors))
    known = {int(size): score_classes(blocks, int(size), typical) for size in np.unique(counts)}
    scales = np.array([known[int(size)][0][c] for c, size in enumerate(counts)])
    own = tuple(block.nearest(int(size))[0] / s for block, size, s in zip(blocks, counts, scales, strict=True))
    empty = np.empty(0)
    return Calibration(
        scales,
        tuple(one if size > 1 else empty for one, size in zip(own, counts, strict=True)),
        tuple(known[int(size)][1] for size in counts),
    )


def typical_scale(impostors: Array) -> float:
    """The scale of classes shown once, from distances of demonstrations to the nearest other class."""
    return REACH * float(np.median(impostors)) * math.sqrt(math.pi / 4 / math.log(20))


@dataclass(frozen=True, eq=False)
class ClassDistances:
    """Distances (k, n) of k calibrating demonstrations, at `indices`, to the n demonstrations of their class."""

    distances: Array
    indices: NDArray[np.intp]

    def nearest(self, size: int) -> tuple[Array, Array, NDArray[np.intp]]:
        """Distance to the nearest and second nearest of the next `size` others, in a circle, and which is nearest."""
        k, n = self.distances.shape
        later = (np.arange(n) - self.indices[:, None]) % n
        within = np.where(later <= size, self.distances, np.inf)
        order = np.sort(within, axis=1)
        return order[:, 0], order[:, 1] if n > 1 else np.full(k, np.inf), within.argmin(axis=1)

    def left_out(self, size: int) -> Array:
        """Distances (k, k) to the nearest, row i as if demonstration i did not exist; NaN where there is none."""
        first, second, which = self.nearest(size)
        without = np.where(which[None, :] == self.indices[:, None], second, first)
        np.fill_diagonal(without, np.inf)
        return np.where(np.isfinite(without), without, np.nan)


def score_classes(blocks: list[ClassDistances], size: int, typical: float) -> tuple[Array, Array]:
    """Scales of all classes and scores of all demonstrations, each against at most `size` others of its class."""
    several = [block for block in blocks if len(block.distances) > 1]
    if not several:
        return np.full(len(blocks), typical), np.empty(0)
    common = float(np.mean(np.concatenate([block.nearest(size)[0] for block in several])))
    scales, scores = [], []
    for block in blocks:
        if len(block.distances) == 1:
            scales.append(max(common, _LEAST))
            continue
        own, without = block.nearest(size)[0], block.left_out(size)
        scales.append(max(_shrunk(own[None], common)[0], _LEAST))
        scores.append(own / np.maximum(_shrunk(without, common), _LEAST))
    return np.array(scales), np.concatenate(scores)


def _shrunk(values: Array, common: float) -> Array:
    """Means of rows, NaN left out, shrunk towards the common one."""
    return np.asarray((np.nansum(values, axis=1) + _PRIOR * common) / (np.isfinite(values).sum(axis=1) + _PRIOR))

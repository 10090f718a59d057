"""The averaged kernel over representations, in logarithms, and its widths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.sampling import evenly_spaced
from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.validation import Array

_WIDTH = 0.35  # of the median distance to the nearest movement of another class
_LEAST = 0.01  # of the typical size: movements closer than that are the same, as recordings go
_SAME = 1e-3  # of the size: what single precision leaves between a movement and itself is less
_WIDTH_ROWS = 500  # movements that the width is estimated from, at most


def _log_mean_exp(logs: Array) -> Array:
    top = logs.max(axis=0)
    return np.asarray(np.log(np.mean(np.exp(logs - top), axis=0)) + top)


#: Name -> A-average (paper's reference [10]) of kernels given by their logarithms, over the first axis.
LOG_MEANS: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _log_mean_exp,
    "geometric": lambda logs: np.asarray(logs.mean(axis=0)),
    "harmonic": lambda logs: -_log_mean_exp(-logs),
    "quadratic": lambda logs: 0.5 * _log_mean_exp(2.0 * logs),
    "min": lambda logs: np.asarray(logs.min(axis=0)),
}


def _softmax(logs: Array) -> Array:
    weights = np.exp(logs - logs.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


#: Name -> share of each kernel in the average, d log K / d log k_r: none negative, their sum over the first axis 1.
SHARES: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _softmax,
    "geometric": lambda logs: np.full(logs.shape, 1.0 / len(logs)),
    "harmonic": lambda logs: _softmax(-logs),
    "quadratic": lambda logs: _softmax(2.0 * logs),
    "min": lambda logs: (np.arange(len(logs))[:, None] == logs.argmin(axis=0)).astype(float),
}


@dataclass(frozen=True, eq=False)
class AveragedSimilarity:
    """An A-average of one RBF kernel per representation, each on its Procrustes distance.

    ``k_r(a, b) = exp(-d_r(a, b)^2 / (2 sigma_r^2))`` and ``K = mean_r k_r``, or ``sum_r w_r k_r``. A narrow,
    bounded kernel lets each representation say only "this one is close", so one that is misled cannot shout the others
    down, as it does in a sum of distances. Logarithms keep the order of movements that are far in every representation,
    where each k_r has long underflowed.

    The arithmetic mean is positive semi-definite where each k_r is: with ``max_angle = 0``. A Procrustes distance is
    not Euclidean, and no claim is made for it.
    """

    procrustes: Procrustes
    widths: Array  # (R,)
    mean: str = "arithmetic"
    weights: Array | None = None  # (R,), positive, summing to 1; equal if None

    def logs(self, A: tuple[Prepared, ...], B: tuple[Prepared, ...]) -> Array:
        """Logarithms of each representation's kernel times R times its weight, shape (R, n, m)."""
        pairs = zip(A, B, self.widths, strict=True)
        logs = np.stack([-self.procrustes.squared_distances(a, b) / (2.0 * width**2) for a, b, width in pairs])
        if self.weights is not None and (self.weights != self.weights[0]).any():
            logs += np.log(len(logs) * self.weights)[:, None, None]
        return logs

    def widened(self, factor: float) -> AveragedSimilarity:
        """The same average of kernels `factor` times as wide."""
        return replace(self, widths=factor * self.widths)

    def log_average(self, A: tuple[Prepared, ...], B: tuple[Prepared, ...]) -> Array:
        """Logarithms of the averaged kernel, shape (n, m)."""
        return LOG_MEANS[self.mean](self.logs(A, B))


def impostor_widths(procrustes: Procrustes, views: tuple[Prepared, ...], labels: NDArray[Any]) -> Array:
    """Width sigma_r of each representation: a share of the typical distance to the nearest movement of another class.

    At 0.35 of it a movement as far as an impostor counts exp(-4), under two in a hundred: what is closer than the
    nearest impostor decides, the rest does not. Where there is one class, any other movement is the impostor.
    Where classes coincide, as N and Z do under any rotation, the width is at least a hundredth of the movements' size.
    Estimated from at most 500 evenly spaced movements, so that its cost does not grow.

    Returns
    -------
    ndarray of shape (R,)

    Raises
    ------
    SpecificationError
        All movements are the same, or there is only one.
    """
    chosen = evenly_spaced(len(labels), _WIDTH_ROWS)
    own = labels[chosen, None] == labels[None, chosen]
    if own.all():
        own = np.eye(len(chosen), dtype=bool)
    widths = []
    for prepared in views:
        some = prepared.take(chosen)
        squares = procrustes.squared_distances(some, some)
        squares[own] = np.inf
        nearest = np.sqrt(squares.min(axis=1, initial=np.inf))
        size = float(np.sqrt(np.median(some.squares)))
        nearest = nearest[np.isfinite(nearest) & (nearest > _SAME * size)]
        if not len(nearest):
            raise SpecificationError(
                "expected training movements that differ, got one movement or all the same; add demonstrations"
            )
        widths.append(max(_WIDTH * float(np.median(nearest)), _LEAST * size))
    return np.array(widths)

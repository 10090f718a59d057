"""Regression of many numbers on few parameters, as weighted sums of what was demonstrated.

Every smoother here is linear in the demonstrated values y (n,): ``y(c) = w(c) y``, with the same weights for all that a
primitive consists of. With K the covariance of the demonstrations and P their trend, [1, c],

    Q = K^-1 - K^-1 P (P' K^-1 P)^-1 P' K^-1,    w(c) = k(c)' Q + p(c)' (P' K^-1 P)^-1 P' K^-1,

and what the others say about demonstration i is off by ``(Q y)_i / Q_ii`` (O. Dubrule, "Cross Validation of Kriging in
a Unique Neighborhood", Mathematical Geology 15(6), 1983). Least squares is K = I with k(c) = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from kineme.validation import Array

LENGTH_SCALES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
NOISES = (1e-8, 1e-6, 1e-4, 1e-2, 1e-1)


@dataclass(frozen=True)
class Smoother:
    """How numbers follow from parameters.

    Attributes
    ----------
    name : {"average", "linear", "gaussian-process"}
        No dependence; least squares of [1, c]; the same trend and a Gaussian process around it with the covariance
        ``exp(-|c - c'|^2 / (2 l^2))`` of parameters in units of their standard deviation.
    length_scale : float, optional
        l.
    noise : float, optional
        Variance of a demonstration that the parameters do not explain, as a share of the process's.
    """

    name: str
    length_scale: float | None = None
    noise: float | None = None

    def __str__(self) -> str:
        if self.length_scale is None:
            return self.name
        return f"{self.name}, length scale {self.length_scale:g}, noise {self.noise:g}"


def candidates(length_scale: float | None, noise: float | None) -> dict[str, list[Smoother]]:
    """Name -> the smoothers of that name."""
    lengths = LENGTH_SCALES if length_scale is None else (float(length_scale),)
    noises = NOISES if noise is None else (float(noise),)
    processes = [Smoother("gaussian-process", *one) for one in product(lengths, noises)]
    return {"linear": [Smoother("linear")], "gaussian-process": processes}


@dataclass(frozen=True, eq=False)
class Solved:
    """A smoother for n demonstrations of tasks (n, k), parameters in standard deviations."""

    smoother: Smoother
    tasks: Array
    Q: Array  # (n, n)
    trend: Array  # (k + 1 or 1, n), from y to the coefficients of the trend

    def weights(self, tasks: Array) -> Array:
        """w(c), shape (m, n), for tasks (m, k)."""
        return _covariance(self.smoother, tasks, self.tasks) @ self.Q + _trend(self.smoother, tasks) @ self.trend

    def left_out(self, Y: Array) -> Array:
        """How far each row of Y (n, p) is from what the others say, shape (n,)."""
        return np.asarray(np.linalg.norm(self.Q @ Y, axis=1) / np.diag(self.Q))


def solve(smoother: Smoother, tasks: Array) -> Solved:
    """The matrices of a smoother for tasks (n, k), more than [1, c] has columns."""
    P = _trend(smoother, tasks)
    K = _covariance(smoother, tasks, tasks) + (1.0 if smoother.noise is None else smoother.noise) * np.eye(len(tasks))
    factor = cho_factor(K)
    KP = cho_solve(factor, P)
    trend = np.linalg.solve(P.T @ KP, KP.T)
    return Solved(smoother, tasks, cho_solve(factor, np.eye(len(tasks))) - KP @ trend, trend)


def _trend(smoother: Smoother, tasks: Array) -> Array:
    ones = np.ones((len(tasks), 1))
    return ones if smoother.name == "average" else np.hstack((ones, tasks))


def _covariance(smoother: Smoother, A: Array, B: Array) -> Array:
    if smoother.length_scale is None:
        return np.zeros((len(A), len(B)))
    squares = np.sum((A[:, None] - B[None]) ** 2, axis=2)
    return np.exp(-squares / (2.0 * smoother.length_scale**2))

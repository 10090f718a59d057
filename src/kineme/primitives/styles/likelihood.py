"""How likely paths are under an average: a Gaussian of few directions, and independent noise in all others."""

from __future__ import annotations

import numpy as np

from kineme.primitives.discrete.specification import Specification
from kineme.primitives.styles.parameters import map_rows, path_matrix
from kineme.validation import Array


def log_likelihoods(dmp: Specification, deviations: Array, factor: Array, noise: float) -> Array:
    """Log density (n,) of the paths of theta, deviations (n, d, N + 3) from the mean, at T even times.

    With B (r, d T) the path of the factor, ``ln N(e; 0, B' B + noise^2 I)`` from ``B = U diag(s) V'``:

        -1/2 [sum ln(s^2 + noise^2) + (d T - r) ln noise^2 + sum c^2 / (s^2 + noise^2) + (e'e - c'c) / noise^2
              + d T ln 2 pi],    c = V' e,

    so nothing of the size (d T)^2 is formed.
    """
    paths = map_rows(deviations, path_matrix(dmp, dmp.n_points)).reshape(len(deviations), -1)
    spread = map_rows(factor, path_matrix(dmp, dmp.n_points)).reshape(len(factor), paths.shape[1])
    _, s, Vt = np.linalg.svd(spread, full_matrices=False)
    along = paths @ Vt.T
    beside = np.sum((paths - along @ Vt) ** 2, axis=1)
    variances, n_numbers = s**2 + noise**2, paths.shape[1]
    determinant = np.sum(np.log(variances)) + 2.0 * (n_numbers - len(s)) * np.log(noise)
    distances = along**2 @ (1.0 / variances) + beside / noise**2
    return np.asarray(-0.5 * (determinant + distances + n_numbers * np.log(2.0 * np.pi)))


def unexplained_noise(dmp: Specification, deviations: Array) -> float | None:
    """What other demonstrations do not explain, as a standard deviation, from theta (n, d, N + 3) minus their mean.

    Each demonstration is compared with the nearest weighted mean of the others, of any weights with the sum 1. With G
    the products of the centered paths its squared distance is ``1 / (G^+)_ii``, in d T - (n - 2) directions. None where
    there are too few demonstrations, or so many that they explain every path, or where nothing is left.
    """
    n, d, n_numbers = deviations.shape
    if n < 3 or n - 2 >= d * n_numbers:
        return None
    paths = map_rows(deviations, path_matrix(dmp, dmp.n_points)).reshape(n, -1)
    values, vectors = np.linalg.eigh(paths @ paths.T)
    values, vectors = values[1:], vectors[:, 1:]  # without the direction in which all are shifted
    if not values[0] > n * np.finfo(float).eps * values[-1]:
        return None
    squares = 1.0 / np.sum(vectors**2 / values, axis=1)
    return float(np.sqrt(squares.mean() / (paths.shape[1] - (n - 2))))

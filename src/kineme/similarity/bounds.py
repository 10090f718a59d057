"""Reduced features of movements bound the averaged kernel from above: the first stage of a two-stage search.

Source of the idea: C. Faloutsos, M. Ranganathan, Y. Manolopoulos, "Fast subsequence matching in time-series databases",
SIGMOD 1994, lemma 1: a search on features whose distance is never larger than the true one dismisses nothing falsely.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.procrustes import Procrustes
from kineme.runtime.parallel import for_tiles
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import LOG_MEANS
from kineme.validation import Array

Single = NDArray[np.float32]

N_REDUCED = 12  # per representation and dimension: on handwriting, hardly any of 200,000 is then in doubt
_TILE_ROWS = 16_384  # movements at a time: what is computed of them stays in a core's cache
_ROUNDING = 4e-6  # of the squared norms, for single precision: a bound must hold
_NEWTON_STEPS = 6  # each makes the bound in space tighter, and keeps it a bound


class ReducedFeatures(NamedTuple):
    """Feature rows of one representation in k coordinates per dimension, and the norms of their residuals.

    With P (S, k) orthonormal, each dimension of a row is ``x = P y + e``. The same P serves every dimension, so the
    reduced features y turn with the movement.
    """

    values: Single  # (n, d * k), y dimension-major
    squares: Single  # (n,), |x|^2
    residual_norms: Single  # (n,), |e|

    def take(self, chosen: Any) -> ReducedFeatures:
        """Return the chosen movements."""
        return ReducedFeatures(self.values[chosen], self.squares[chosen], self.residual_norms[chosen])


def fit_bases(rows: tuple[NDArray[Any], ...], n_dims: int, n_reduced: int = N_REDUCED) -> tuple[Array, ...]:
    """Fit k functions (S, k) with most of the rows' energy to each representation: uncentered principal components.

    Dimensions are pooled and nothing is centered, so that turned rows have turned reduced features. Bounds hold for any
    orthonormal basis; movements unlike those that it was fitted to only make them less tight.

    `rows`, R of shape (n, d * S): as from `describe.feature_rows`; `n_dims`: dimensions d of the movements;
    `n_reduced`: k, or S where that is smaller. Returns R of shape (S, k): with orthonormal columns, those of most
    energy first.
    """
    bases = []
    for block in rows:
        x = np.asarray(block, dtype=np.float64).reshape(len(block) * n_dims, -1)
        vectors = np.linalg.eigh(x.T @ x)[1]
        bases.append(np.ascontiguousarray(vectors[:, ::-1][:, :n_reduced]))
    return tuple(bases)


def reduce_features(
    bases: tuple[Array, ...], rows: tuple[NDArray[Any], ...], n_dims: int
) -> tuple[ReducedFeatures, ...]:
    """Return reduced features of rows (n, d * S), for each representation."""
    reduced = []
    for P, block in zip(bases, rows, strict=True):
        x = np.asarray(block, dtype=np.float64)
        y = (x.reshape(len(x) * n_dims, -1) @ P).reshape(len(x), -1)
        squares = np.einsum("ij,ij->i", x, x)
        norms = np.sqrt(np.maximum(squares - np.einsum("ij,ij->i", y, y), 0.0))
        single = (part.astype(np.float32) for part in (y, squares, norms))
        reduced.append(ReducedFeatures(*single))
    return tuple(reduced)


def log_bounds(
    similarity: AveragedSimilarity, queries: tuple[ReducedFeatures, ...], stored: tuple[ReducedFeatures, ...]
) -> Single:
    """Return upper bounds (n, m) of the logarithms of the averaged kernel.

    With ``x = P y + e``, and R a rotation that is allowed, ``<x_a, R x_b> <= max_R <y_a, R y_b> + |e_a| |e_b|``; so
    ``d^2 >= |x_a|^2 + |x_b|^2 - 2 (max_R <y_a, R y_b> + |e_a| |e_b|)``, and an A-average grows with each kernel.
    Under a prior, what R costs is subtracted from both products. In space the maximum is taken over all rotations even
    where there is a limit, see `_over_rotations`.

    Of an average with representations that are compared pair by pair, these are bounds of the average over the others
    alone, not of the whole: a pair can be more alike than its bound.

    - `similarity`: of all R representations, those that are compared sample by sample first.
    - `queries`: of n movements, in each of the representations that are compared sample by sample; of the bases of
      `stored`.
    - `stored`: of m movements.

    Returns (n, m): in the precision of `stored`, single or double, and lower by no rounding error.
    """
    n, m = len(queries[0].values), len(stored[0].values)
    similarity, precision = similarity.by_rows(len(stored)), stored[0].values.dtype.type
    bounds = np.empty((n, m), dtype=precision)
    average: Any = LOG_MEANS[similarity.mean]  # Any keeps single precision
    log_weights = similarity.log_weights()
    # Factors that do not depend on the stored movements include 1 / sigma^2.
    scaled = [
        ReducedFeatures(*(np.asarray(part / width**2, dtype=precision) for part in features))
        for features, width in zip(queries, similarity.widths, strict=True)
    ]

    asked = [similarity.procrustes.by_coordinates(features.values) for features in scaled]

    def fill(start: int, stop: int) -> None:
        logs = np.empty((len(stored), stop - start, n), dtype=precision)
        for r, block in enumerate(stored):
            half = precision(0.5 * (1.0 - _ROUNDING) / similarity.widths[r] ** 2)
            # |a| is divided by sigma^2 as a whole, like every other factor of the side that is asked.
            ours = np.asarray(np.sqrt(scaled[r].squares) / similarity.widths[r], dtype=precision)
            norms = np.sqrt(block.squares[start:stop, None]) * ours
            values = similarity.procrustes.by_coordinates(block.values[start:stop])
            most = _alignments(similarity.procrustes, asked[r], values, norms)
            most += block.residual_norms[start:stop, None] * scaled[r].residual_norms
            most -= half * block.squares[start:stop, None]
            most -= precision(0.5 * (1.0 - _ROUNDING)) * scaled[r].squares - precision(log_weights[r])
            np.minimum(most, precision(log_weights[r]), out=logs[r])
        bounds[:, start:stop] = average(logs).T

    for_tiles(fill, m, max(1, _TILE_ROWS // n))
    return bounds


def _alignments(procrustes: Procrustes, A: Single, B: Single, norms: Single) -> Single:
    """Return the largest inner products (m, n) of reduced features after rotation; in space, upper bounds of them.

    `norms` (m, n) are ``|a| |b|`` of the whole rows, on which the costs of rotations depend.
    """
    d, n = procrustes.n_dims, len(A)
    if procrustes.max_angle == 0 or d == 1:
        return np.asarray(B @ A.T)
    if d == 2:
        x, y = np.split(A, 2, axis=1)  # with a = x + i y: real and imaginary part of sum_t a_t conj(b_t)
        re, im = B @ A.T, B @ np.concatenate((y, -x), axis=1).T
        if procrustes.prior is None:
            return _within(re, im, procrustes.max_angle)
        weights = norms.dtype.type(np.trace(procrustes.prior.matrix(2))) * norms
        re += weights
        return np.asarray(np.sqrt(re * re + im * im) - weights)
    k = A.shape[1] // 3
    C = (B.reshape(-1, k) @ A.reshape(-1, k).T).reshape(len(B), 3, n, 3).transpose(1, 3, 0, 2)
    most = np.linalg.norm(A, axis=1) * np.linalg.norm(B, axis=1)[:, None]
    if procrustes.prior is None:
        return _over_rotations(C, most)
    F = procrustes.prior.matrix(3).astype(norms.dtype)
    trace = np.trace(F)
    return _over_rotations(C + F[:, :, None, None] * norms, most + trace * norms) - trace * norms


def _within(re: Single, im: Single, max_angle: float) -> Single:
    """Return the largest real part of ``(re + i im) exp(-i angle)`` within the angle, without an arc tangent."""
    c, s = re.dtype.type(math.cos(max_angle)), re.dtype.type(math.sin(max_angle))
    size = np.sqrt(re * re + im * im)
    inside = re >= c * size
    re *= c
    re += s * np.abs(im)
    np.copyto(re, size, where=inside)
    return re


def _over_rotations(C: NDArray[Any], most: Single) -> Single:
    """Bound ``max_R tr(R^T C)`` over all rotations, for covariances C (3, 3, m, n) and a bound to begin with.

    The maximum is s_1 + s_2 +- s_3, singular values of C, the sign that of det C, and the largest root of
    ``(x^2 - |C|^2)^2 - 8 x det C - 4 |adj C|^2`` (after D. L. Theobald, Acta Crystallographica A61, 2005, who takes
    Horn's quaternions). Right of it the quartic is convex, so Newton steps from above stay above. In double precision,
    since for movements along a line two roots meet.
    """
    C = C.astype(np.float64)
    cofactors = np.cross(C[[1, 2, 0]], C[[2, 0, 1]], axis=1)
    square = np.einsum("ij...,ij...->...", C, C)
    determinant = np.einsum("j...,j...->...", C[0], cofactors[0])
    last = 4.0 * np.einsum("ij...,ij...->...", cofactors, cofactors)
    # With s = |C|^2 and y the sum of products of two singular values, x^2 <= s + 2 y, and y <= sqrt(3) |adj C|.
    x = np.minimum(most, np.sqrt(square + np.sqrt(3.0 * last)))
    for _ in range(_NEWTON_STEPS):
        over = x * x - square
        slope = 4.0 * x * over - 8.0 * determinant
        value = over * over - 8.0 * x * determinant - last
        x = x - np.where(slope > 0, np.maximum(value, 0.0) / np.where(slope > 0, slope, 1.0), 0.0)
    return np.asarray(x, dtype=most.dtype)

"""The matrices of a specification, built once and cached."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kineme.dmp.discrete.fits import (
    differentiation_matrices,
    forcing_target,
    local_regression,
    ridge_regression,
    trajectory_regression,
)
from kineme.dmp.discrete.response import Response, response_between, spring_damper_response
from kineme.dmp.discrete.specification import Specification
from kineme.movements.preparation.spline import spline_matrix
from kineme.validation import Array


class Encoder(NamedTuple):
    """Matrices from positions relative to the start, at T even times, to weights and initial velocity."""

    weights: Array  # (T, N), to W = scale w
    velocity: Array  # (T,), to dx/du at the start


@lru_cache(maxsize=32)
def encoder(dmp: Specification, n_samples: int) -> Encoder:
    """The encode matrix of `dmp` for movements of `n_samples` even samples."""
    u = np.linspace(0.0, 1.0, dmp.n_points)
    if dmp.fit == "trajectory":
        weights, velocity = trajectory_regression(decoder(dmp, dmp.n_points), dmp.K, dmp.ridge_strength)
    else:
        local = dmp.regression == "local"
        regression = (
            local_regression(dmp.basis, u) if local else ridge_regression(dmp.basis.design(u), dmp.ridge_strength)
        )
        weights = regression @ forcing_target(dmp.basis, dmp.system, dmp.K, dmp.D, u)
        velocity = differentiation_matrices(dmp.n_points)[0][0]
    if n_samples != dmp.n_points:
        resample = spline_matrix(n_samples, dmp.n_points)
        weights, velocity = weights @ resample, velocity @ resample
    return Encoder(np.ascontiguousarray(weights.T), velocity)


@lru_cache(maxsize=32)
def decoder(dmp: Specification, n_samples: int, end: float = 1.0) -> Response:
    """The decode matrices of `dmp` at `n_samples` even times from 0 to `end` durations."""
    return spring_damper_response(dmp.basis, dmp.system, dmp.K, dmp.D, np.linspace(0.0, end, n_samples))


@lru_cache(maxsize=32)
def decoder_at(dmp: Specification, times: tuple[float, ...]) -> Response:
    """The decode matrices of `dmp` at any times in [0, 1], in durations."""
    grid = decoder(dmp, max(dmp.n_points, 2 * dmp.n_basis))
    return response_between(grid, dmp.basis, dmp.system, dmp.K, dmp.D, np.array(times))


@lru_cache(maxsize=32)
def smoothness_factor(dmp: Specification) -> Array:
    """Factor S (N, N) of a covariance of the weights under which smooth changes of the path are the likely ones.

    ``S' S = (mean_u Phi''(u)' Phi''(u) + 1e-8 m I)^-1`` with m the mean of the diagonal: the least likely changes are
    those with the largest mean square acceleration, whatever the gating, the fit or the unit of the weights.
    """
    bend = decoder(dmp, dmp.n_points).Phi[2]
    precision = bend.T @ bend / dmp.n_points
    values, vectors = np.linalg.eigh(precision)
    return np.asarray((vectors / np.sqrt(np.maximum(values, 0.0) + 1e-8 * np.trace(precision) / dmp.n_basis)).T)


@lru_cache(maxsize=32)
def forcing_matrix(dmp: Specification, n_samples: int) -> Array:
    """Psi_S (S, N): from weights to f at `n_samples` even times, Eq. (2)."""
    return dmp.basis.design(np.linspace(0.0, 1.0, n_samples))

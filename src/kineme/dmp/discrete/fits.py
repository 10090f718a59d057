"""Two ways to fit the weights, each one matrix from a resampled movement to its weights."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from kineme.dmp.discrete.basis import GaussianBasis
from kineme.dmp.discrete.formulations import Formulation
from kineme.dmp.discrete.response import Response
from kineme.validation import Array

FITS = ("forcing", "trajectory")
REGRESSIONS = ("local", "ridge")


@lru_cache(maxsize=64)
def differentiation_matrices(n_points: int) -> tuple[Array, Array]:
    """First and second differentiation matrices D1, D2 (T, T) in u on T even points of [0, 1].

    D1 is central inside and one-sided at the ends (the summation-by-parts operator, of order 2 inside and 1 at
    the ends), and ``D2 = D1 D1``: second order inside. In the two points next to each end D2 falls short of the
    derivative, by half at the very end, where a sample stands for half a cell.

    That is a choice. Against second-order ends and the compact three-point D2 it lowers the worst reconstruction
    error on LASA (N = 80, ridge) from 1.2 % of the extent to 0.11 %, and 1 % of noise changes f by 1.1 times its
    norm instead of 3.8: one-sided second-order stencils magnify noise where nothing averages it out.
    """
    h = 1.0 / (n_points - 1)
    inner = np.arange(1, n_points - 1)
    D1 = np.zeros((n_points, n_points))
    D1[inner, inner - 1], D1[inner, inner + 1] = -0.5, 0.5
    D1[0, :2] = D1[-1, -2:] = -1.0, 1.0
    D1 /= h
    D2 = D1 @ D1
    D1.setflags(write=False)
    D2.setflags(write=False)
    return D1, D2


def forcing_target(basis: GaussianBasis, formulation: Formulation, stiffness: float, damping: float, u: Array) -> Array:
    """The matrix (T, T) from y = x - x0 to scale * f, the equation of the formulation solved for it.

    ``scale f = (D2 + D D1 + K) y - (K + coupling(s)) (g - x0)``; the last sample of y is g - x0.
    """
    D1, D2 = differentiation_matrices(len(u))
    target = D2 + damping * D1 + stiffness * np.eye(len(u))
    target[:, -1] -= stiffness + formulation.coupling(stiffness, basis.phase(u))
    return target


def local_regression(basis: GaussianBasis, u: Array) -> Array:
    """Locally weighted regression (N, T): each weight fits the target around its own center.

    ``w_i = sum_t psi_i(s_t) q_t y_t / sum_t psi_i(s_t) q_t^2`` with the gate q = 1 or s.
    """
    exponents, gate = basis.exponents(u), basis.gate(u)[:, None]
    psi = np.exp(exponents - exponents.max(axis=0))  # a factor per function cancels; this one prevents underflow
    return np.asarray((psi * gate / (psi * gate**2).sum(axis=0)).T)


def ridge_regression(design: Array, ridge: float) -> Array:
    """Least squares with a penalty on ``||w||^2`` (N, T), relative to the mean square of a design column."""
    n_points, n_basis = design.shape
    penalty = math.sqrt(ridge * np.sum(design**2) / n_basis)
    rows = np.vstack((design, penalty * np.eye(n_basis)))  # not the normal equations, which square the condition number
    return np.asarray(np.linalg.lstsq(rows, np.eye(n_points + n_basis, n_points), rcond=None)[0])


def trajectory_regression(response: Response, stiffness: float, ridge: float) -> tuple[Array, Array]:
    """Least squares of the path itself on the decode matrix, with a penalty on the weights' curvature.

    Minimizes ``mean (y - Phi W - goal (g - x0) - velocity v0)^2 + ridge mean (diff^2 W / K)^2`` over W and v0:
    no numerical derivative of the data occurs.

    Returns
    -------
    weights : ndarray of shape (N, T)
        From y = x - x0 to W.
    velocity : ndarray of shape (T,)
        From y to v0.
    """
    n_points, n_basis = response.Phi[0].shape
    columns, curvature = trajectory_columns(response, stiffness)
    rows = np.vstack((columns, math.sqrt(ridge) * curvature))
    data = np.vstack((np.eye(n_points), np.zeros((n_basis - 2, n_points)))) / np.sqrt(n_points)
    data[:n_points, -1] -= response.goal[0] / np.sqrt(n_points)  # the last sample of y is g - x0
    solution = np.linalg.lstsq(rows, data, rcond=None)[0]
    return solution[:-1] * stiffness, solution[-1]


def trajectory_columns(response: Response, stiffness: float) -> tuple[Array, Array]:
    """What `trajectory_regression` fits a path with, and what it keeps small, both per square root of their rows.

    Returns
    -------
    columns : ndarray of shape (T, N + 1)
        Paths of W / K, comparable to y, and of v0.
    curvature : ndarray of shape (N - 2, N + 1)
        Second differences of W / K; times the square root of the ridge they are rows of the least-squares problem.
    """
    n_points, n_basis = response.Phi[0].shape
    columns = np.column_stack((response.Phi[0] * stiffness, response.velocity[0])) / np.sqrt(n_points)
    return columns, np.diff(np.eye(n_basis, n_basis + 1), n=2, axis=0) / np.sqrt(n_basis - 2)

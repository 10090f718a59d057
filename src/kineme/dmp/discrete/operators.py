"""The matrices of a specification, built once and cached: decoding, encoding, and conditioning of Gaussians.

The decode matrix is the spring-damper's exact response to each part of the forcing term; the encode matrix is one of
two fits of the weights. A covariance is kept as a factor F, ``Sigma = F' F``. With ``B = F A' = Q R``,

    Sigma A' (A Sigma A' + diag(s^2))^-1 e = F' Q R'^-1 e,

s being stacked below B before it is decomposed: its condition number is not squared, and what is observed exactly is
met to rounding. Among all changes that meet e, it has the least Mahalanobis norm.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kineme.dmp.discrete.specification import GaussianBasis, Specification
from kineme.dmp.spring_damper import NODE_WEIGHTS, NODES, transitions
from kineme.errors import SpecificationError
from kineme.movements.preparation.smooth import spline_matrix
from kineme.validation import Array

_DEPENDENT = 1e-11  # of the largest number on the diagonal of R: smaller ones are rounding

_DEPENDENCE = (
    "expected observations of which none follows from the others, got {k} of which {r} can be met independently; leave "
    "some out, move their times apart, or use more basis functions"
)

_NUMBERS_AT_ONCE = 500_000  # of the forcing term at a time; a limit on memory
_STEPS_PER_BASIS = 2  # quadrature intervals between two neighboring centers, at least


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
        weights = regression @ forcing_target(dmp, u)
        velocity = differentiation_matrices(dmp.n_points)[0][0]
    if n_samples != dmp.n_points:
        resample = spline_matrix(n_samples, dmp.n_points)
        weights, velocity = weights @ resample, velocity @ resample
    return Encoder(np.ascontiguousarray(weights.T), velocity)


@lru_cache(maxsize=32)
def decoder(dmp: Specification, n_samples: int, end: float = 1.0) -> Response:
    """The decode matrices of `dmp` at `n_samples` even times from 0 to `end` durations."""
    return spring_damper_response(dmp, np.linspace(0.0, end, n_samples))


@lru_cache(maxsize=32)
def decoder_at(dmp: Specification, times: tuple[float, ...]) -> Response:
    """The same at any times (k,) in [0, 1], each state carried on in one step from the even time before it."""
    u, grid = np.array(times), decoder(dmp, max(dmp.n_points, 2 * dmp.n_basis))
    n_steps = grid.goal.shape[1] - 1
    before = np.minimum(np.floor(u * n_steps).astype(np.intp), n_steps)
    h = np.maximum(u - before / n_steps, 0.0)[:, None]
    carry = transitions(dmp.K, dmp.D, h[:, 0])
    impulse = transitions(dmp.K, dmp.D, (h * (1.0 - NODES)).ravel())[:, :, 1].reshape(len(u), -1, 2)
    nodes = before[:, None] / n_steps + h * NODES
    forcing = _forcing(dmp, nodes.ravel()).reshape(*nodes.shape, -1)
    states = np.empty((len(u), 3, dmp.n_basis + 3))
    there = np.dstack((grid.Phi, grid.goal, grid.moving_goal, grid.velocity))[:2, before].transpose(1, 0, 2)
    states[:, :2] = carry @ there
    states[:, :2, :-1] += np.einsum("kqz,kq,kqf->kzf", impulse, h * NODE_WEIGHTS, forcing)
    return _response(dmp, states, u)


@lru_cache(maxsize=32)
def smoothness_factor(dmp: Specification) -> Array:
    """Factor S (N, N) of a covariance of the weights under which smooth changes of the path are the likely ones.

    ``S' S = (mean_u Phi''(u)' Phi''(u) + 1e-8 m I)^-1`` with m the mean of the diagonal.
    """
    bend = decoder(dmp, dmp.n_points).Phi[2]
    precision = bend.T @ bend / dmp.n_points
    values, vectors = np.linalg.eigh(precision)
    return np.asarray((vectors / np.sqrt(np.maximum(values, 0.0) + 1e-8 * np.trace(precision) / dmp.n_basis)).T)


@lru_cache(maxsize=32)
def forcing_matrix(dmp: Specification, n_samples: int) -> Array:
    """Psi_S (S, N): from weights to f at `n_samples` even times, Eq. (2)."""
    return dmp.basis.design(np.linspace(0.0, 1.0, n_samples))


class Response(NamedTuple):
    """Positions, velocities and accelerations at T normalized times as linear maps of (W, g - x0, v0, g').

    ``x - x0 = Phi[0] W + goal[0] (g - x0) + velocity[0] v0 + moving_goal[0] g'``; indices 1 and 2 give the derivatives
    in u. v0 is dx/du and g the goal at the start, g' its dg/du; what draws is ``g + (u + D / K) g'``, see `MovingGoal`.
    """

    Phi: Array  # (3, T, N)
    goal: Array  # (3, T)
    velocity: Array  # (3, T)
    moving_goal: Array  # (3, T)


def spring_damper_response(dmp: Specification, u: Array) -> Response:
    """Solve ``x'' = K (g - x) - D x' + F(u)`` for every basis function, the goal and v0, at even u (T,) from 0.

    States are propagated by the matrix exponential, exact for any step; the forcing enters by Gauss-Legendre quadrature
    of the convolution integral with 8 nodes per interval, of order 16.
    """
    n_steps = max(1, math.ceil(_STEPS_PER_BASIS * (dmp.n_basis - 1) * (u[1] - u[0])))
    h = (u[1] - u[0]) / n_steps
    nodes = h * NODES
    carry = transitions(dmp.K, dmp.D, np.array([h]))[0]
    # An acceleration at a node reaches the end of the step through the second column.
    impulse = transitions(dmp.K, dmp.D, h - nodes)[:, :, 1] * (h * NODE_WEIGHTS)[:, None]  # (8, 2)
    starts = u[0] + np.arange((len(u) - 1) * n_steps) * h
    driven = np.empty((len(starts), 2, dmp.n_basis + 2))  # the term that each step adds to (x, x')
    for some in np.array_split(np.arange(len(starts)), max(1, len(starts) * dmp.n_basis // _NUMBERS_AT_ONCE)):
        forcing = _forcing(dmp, (starts[some, None] + nodes).ravel())
        driven[some] = np.einsum("qz,kqf->kzf", impulse, forcing.reshape(len(some), len(nodes), -1))
    at_end = np.flatnonzero((starts < 1.0) & (starts + h > 1.0))
    for k in at_end:  # one step at most: an ungated f has a kink at u = 1, where quadrature must be split
        driven[k] = 0.0
        for left, right in ((starts[k], 1.0), (1.0, starts[k] + h)):
            inside = left + (right - left) * NODES
            weighted = transitions(dmp.K, dmp.D, starts[k] + h - inside)[:, :, 1] * NODE_WEIGHTS[:, None]
            driven[k] += (right - left) * weighted.T @ _forcing(dmp, inside)
    states = np.zeros((len(u), 3, dmp.n_basis + 3))
    states[0, 1, -1] = 1.0
    state = states[0, :2]
    for done, added in enumerate(driven, start=1):
        state = carry @ state
        state[:, :-1] += added
        if done % n_steps == 0:
            states[done // n_steps, :2] = state
    return _response(dmp, states, u)


def _response(dmp: Specification, states: Array, u: Array) -> Response:
    """States (T, 3, N + 3), of which the accelerations follow from the rest, as the response."""
    states[:, 2] = -dmp.K * states[:, 0] - dmp.D * states[:, 1]
    states[:, 2, :-1] += _forcing(dmp, u)
    by_part = states.transpose(1, 0, 2)
    goal, moving_goal, velocity = (by_part[:, :, k].copy() for k in (-3, -2, -1))
    return Response(np.ascontiguousarray(by_part[:, :, :-3]), goal, velocity, moving_goal)


def _forcing(dmp: Specification, u: Array) -> Array:
    """Accelerations besides spring and damper, per unit of each W, of g - x0 and of g', shape (T, N + 2)."""
    terms = dmp.terms(u)
    goal = dmp.K + terms[:, -1]
    return np.column_stack((terms[:, :-1], goal, (u + dmp.D / dmp.K) * goal))


@lru_cache(maxsize=64)
def differentiation_matrices(n_points: int) -> tuple[Array, Array]:
    """First and second differentiation matrices D1, D2 (T, T) in u on T even points of [0, 1].

    D1 is central inside and one-sided at the ends (the summation-by-parts operator), and ``D2 = D1 D1``. Next to each
    end D2 falls short of the derivative, by choice: against second-order ends it lowers the worst reconstruction error
    on LASA (N = 80, ridge) from 1.2 % of the extent to 0.11 %, and 1 % of noise changes f by 1.1 of its norm, not 3.8.
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


def forcing_target(dmp: Specification, u: Array) -> Array:
    """From y = x - x0 to ``scale f = (D2 + D D1 + K) y - (K + coupling(s)) (g - x0)`` (T, T); g - x0 ends y."""
    D1, D2 = differentiation_matrices(len(u))
    target = D2 + dmp.D * D1 + dmp.K * np.eye(len(u))
    target[:, -1] -= dmp.K + dmp.terms(u)[:, -1]
    return target


def local_regression(basis: GaussianBasis, u: Array) -> Array:
    """Locally weighted regression (N, T), ``w_i = sum_t psi_i q y / sum_t psi_i q^2`` with the gate q = 1 or s."""
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
    """Matrices from y = x - x0 to W (T, N) and v0 (T,): least squares of the path on the decode matrix.

    Minimizes ``mean (y - Phi W - goal (g - x0) - velocity v0)^2 + ridge mean (diff^2 W / K)^2``.
    """
    n_points, n_basis = response.Phi[0].shape
    columns, curvature = trajectory_columns(response, stiffness)
    rows = np.vstack((columns, math.sqrt(ridge) * curvature))
    data = np.vstack((np.eye(n_points), np.zeros((n_basis - 2, n_points)))) / np.sqrt(n_points)
    data[:n_points, -1] -= response.goal[0] / np.sqrt(n_points)  # the last sample of y is g - x0
    solution = np.linalg.lstsq(rows, data, rcond=None)[0]
    return solution[:-1] * stiffness, solution[-1]


def trajectory_columns(response: Response, stiffness: float) -> tuple[Array, Array]:
    """Columns (T, N + 1) of W / K and v0 that a path is fitted with, and second differences (N - 2, N + 1) of W / K.

    Both are per square root of their rows; the differences count times the square root of the ridge.
    """
    n_points, n_basis = response.Phi[0].shape
    columns = np.column_stack((response.Phi[0] * stiffness, response.velocity[0])) / np.sqrt(n_points)
    return columns, np.diff(np.eye(n_basis, n_basis + 1), n=2, axis=0) / np.sqrt(n_basis - 2)


class Conditioned(NamedTuple):
    """Distribution of p numbers after k linear functions of them were observed."""

    gain: Array  # (k, p): the mean changes by e @ gain, with e (k,) or (n, k) observed minus expected
    factor: Array  # (r, p) of the covariance that remains


def condition(factor: Array, observed: Array, deviation: float | Array = 0.0) -> Conditioned:
    """Condition a Gaussian, by its factor (r, p), on ``observed @ numbers`` (k,), each with a deviation; 0 is exact."""
    from scipy.linalg import qr  # a larger import than all of learning

    whitened = factor @ observed.T  # B (r, k)
    r, k = whitened.shape
    if not k:
        return Conditioned(np.zeros_like(observed), factor)
    s = np.broadcast_to(np.asarray(deviation, dtype=float), (k,))
    stacked = np.vstack((whitened, np.diag(s))) if s.any() else whitened
    unit = np.linalg.norm(stacked, axis=0)  # rows in different units: a position, an acceleration
    if len(stacked) < k or not unit.all():
        raise SpecificationError(_DEPENDENCE.format(k=k, r=min(r, int(np.count_nonzero(unit)))))
    Q, R = qr(stacked / unit, mode="economic")
    diagonal = np.abs(np.diag(R))
    if (diagonal <= _DEPENDENT * diagonal.max()).any():
        raise SpecificationError(_DEPENDENCE.format(k=k, r=int((diagonal > _DEPENDENT * diagonal.max()).sum())))
    Q = Q[:r]
    along = Q.T @ factor
    # R has nothing below its diagonal, so this is back substitution; SciPy's own waits for threads, milliseconds long.
    return Conditioned(np.linalg.solve(R, along) / unit[:, None], factor - _shrink(Q) @ along)


def _shrink(Q: Array) -> Array:
    """S (r, k) with ``(I - S Q')' (I - S Q') = I - Q Q'``: the symmetric square root, from the thin decomposition."""
    U, singular, Vt = np.linalg.svd(Q, full_matrices=False)
    cosine = np.sqrt(np.maximum(0.0, 1.0 - singular**2))
    share = (1.0 - cosine) / np.where(singular > 0, singular, 1.0)
    return np.asarray((U * share) @ Vt)

"""Each fit against a direct, independent solution of the problem that its docstring states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from sklearn.linear_model import Ridge

from kineme import DMP
from kineme.dmp.discrete.operators import decoder, local_regression, ridge_regression, trajectory_regression

U = np.linspace(0, 1, 70)

any_target = given(
    seed=st.integers(0, 10**6),
    gating=st.sampled_from(["none", "phase"]),
    overlap=st.floats(0.05, 0.9),
    n=st.integers(3, 40),
)


@any_target
def test_each_weight_of_the_local_regression_minimizes_its_own_weighted_squares(seed, gating, overlap, n):
    basis = DMP(n_basis=n, overlap=overlap, gating=gating).basis
    y = np.random.default_rng(seed).normal(size=len(U))
    w = local_regression(basis, U) @ y
    s = basis.phase(U)
    q = s if gating == "phase" else np.ones_like(s)
    i = seed % n
    psi = np.exp(-basis.widths[i] * (s - basis.centers[i]) ** 2)
    best = minimize_scalar(lambda one: np.sum(psi * (y - q * one) ** 2), bracket=(w[i] - 1, w[i] + 1), tol=1e-12).x
    assert w[i] == pytest.approx(best, rel=1e-5, abs=1e-5)


def test_the_local_regression_has_weights_for_more_narrow_functions_than_points():
    basis = DMP(n_basis=500, overlap=1e-6).basis
    operator = local_regression(basis, np.linspace(0, 1, 10))
    np.testing.assert_allclose(operator.sum(axis=1), 1, rtol=1e-12)


@any_target
def test_the_ridge_regression_is_that_of_scikit_learn(agree, seed, gating, overlap, n):
    design = DMP(n_basis=n, overlap=overlap, gating=gating).basis.design(U)
    y = np.random.default_rng(seed).normal(size=len(U))
    alpha = 1e-4 * np.mean(np.sum(design**2, axis=0))
    agree(ridge_regression(design, 1e-4) @ y, Ridge(alpha, fit_intercept=False, solver="svd").fit(design, y).coef_)


@any_target
def test_without_a_penalty_the_ridge_regression_is_least_squares(agree, seed, gating, overlap, n):
    del overlap
    design = DMP(n_basis=n, gating=gating).basis.design(U)
    y = np.random.default_rng(seed).normal(size=len(U))
    agree(ridge_regression(design, 0.0) @ y, np.linalg.lstsq(design, y)[0])


@any_target
def test_the_trajectory_regression_is_the_minimum_that_it_states(agree, seed, gating, overlap, n):
    """The normal equations of the cost in the docstring, on a random path."""
    dmp = DMP(n_basis=n, overlap=overlap, gating=gating, n_points=len(U))
    response, ridge = decoder(dmp, len(U)), 1e-3
    y = np.append(0, np.random.default_rng(seed).normal(size=len(U) - 1))
    solve, solve_velocity = trajectory_regression(response, dmp.K, ridge)
    w, velocity = solve @ y, solve_velocity @ y

    def cost(w, velocity):
        rest = y - response.Phi[0] @ w - response.goal[0] * y[-1] - response.velocity[0] * velocity
        return np.mean(rest**2) + ridge * np.mean(np.diff(w / dmp.K, n=2) ** 2)

    least = cost(w, velocity)
    for step in 1e-3 * np.random.default_rng(seed).normal(size=(20, n + 1)):
        change = cost(w + step[:-1] * dmp.K, velocity + step[-1]) - least
        opposite = cost(w - step[:-1] * dmp.K, velocity - step[-1]) - least
        assert change > 0
        assert change == pytest.approx(opposite, rel=1e-4)  # the slope is zero


@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_the_trajectory_fit_finds_the_weights_and_the_velocity_that_made_a_path(make_movement, agree, formulation):
    dmp = DMP(formulation, 10, fit="trajectory", ridge=0.0, phase_end=0.1)
    learned = dmp.learn([make_movement(2)[1]])
    path = learned.rollout(n_samples=dmp.n_points).positions
    again = replace(dmp, n_points=120).learn(path)
    agree(again.rollout(n_samples=200).positions, path, 1e-6)
    agree(again.velocities, learned.velocities, 1e-4)


@pytest.mark.parametrize("regression", ["local", "ridge"])
def test_constant_forcing_is_fitted_exactly_by_equal_weights(regression):
    basis = DMP(n_basis=20).basis
    operator = local_regression(basis, U) if regression == "local" else ridge_regression(basis.design(U), 0.0)
    np.testing.assert_allclose(operator @ np.full(len(U), 3.0), 3.0, rtol=1e-9)

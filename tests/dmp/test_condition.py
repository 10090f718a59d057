"""Conditioning against the Gaussian formula written out."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.dmp.discrete.operators import condition
from kineme.errors import SpecificationError


@pytest.mark.parametrize("deviation", [0.0, 0.3, np.array([0.0, 0.1, 2.0])])
@pytest.mark.parametrize("rank", [4, 9, 20])
def test_mean_and_covariance_are_those_of_the_formula(deviation, rank):
    rng = np.random.default_rng(rank)
    factor, rows, e = rng.normal(size=(rank, 9)), rng.normal(size=(3, 9)), rng.normal(size=(5, 3))
    Sigma = factor.T @ factor
    S = rows @ Sigma @ rows.T + np.diag(np.broadcast_to(deviation, 3) ** 2)
    gain = Sigma @ rows.T @ np.linalg.inv(S)
    result = condition(factor, rows, deviation)
    np.testing.assert_allclose(e @ result.gain, e @ gain.T, rtol=1e-9, atol=1e-9)
    remaining = Sigma - gain @ rows @ Sigma
    np.testing.assert_allclose(result.factor.T @ result.factor, remaining, rtol=1e-9, atol=1e-9 * np.trace(Sigma))


def test_rows_in_any_units_are_met():
    rng = np.random.default_rng(0)
    factor, rows = rng.normal(size=(12, 12)), rng.normal(size=(4, 12)) * np.array([[1e-9], [1.0], [1e6], [1.0]])
    e = np.array([1e-9, 2.0, -1e6, 3.0])
    np.testing.assert_allclose(rows @ (e @ condition(factor, rows).gain), e, rtol=1e-10)


def test_close_observations_are_met_to_rounding():
    u = np.array([0.5, 0.5 + 1e-4, 0.9])
    rows = np.exp(-((u[:, None] - np.linspace(0, 1, 15)) ** 2) * 60)
    change = np.array([1.0, 1.01, 0.0]) @ condition(np.eye(15), rows).gain
    np.testing.assert_allclose(rows @ change, [1.0, 1.01, 0.0], atol=1e-10)


def test_no_observation_changes_nothing():
    factor = np.random.default_rng(0).normal(size=(3, 5))
    result = condition(factor, np.zeros((0, 5)))
    assert result.gain.shape == (0, 5)
    np.testing.assert_allclose(result.factor, factor)


@pytest.mark.parametrize("rows", [[[1.0, 0, 0], [2.0, 0, 0]], [[0.0, 0, 1.0]], np.eye(3)])
def test_dependent_exact_observations_are_refused(rows):
    with pytest.raises(SpecificationError, match="can be met independently"):
        condition(np.array([[1.0, 0, 0], [0, 1.0, 0]]), np.array(rows))

"""Observed orders of convergence: a wrong coefficient lowers them where a tolerance would not notice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kineme import DMP
from kineme.dmp.discrete import operators
from kineme.dmp.discrete.operators import differentiation_matrices


def _orders(errors):
    errors = np.array(errors)
    return np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize(("matrix", "inside"), [(0, slice(1, -1)), (1, slice(2, -2))], ids=["D1", "D2"])
def test_differentiation_is_of_second_order_inside(matrix, inside):
    errors = []
    for n_points in (51, 101, 201):
        u = np.linspace(0, 1, n_points)
        exact = (3 * np.cos(3 * u), -9 * np.sin(3 * u))[matrix]
        errors.append(np.abs(differentiation_matrices(n_points)[matrix] @ np.sin(3 * u) - exact)[inside].max())
    np.testing.assert_allclose(_orders(errors), 2, atol=0.1)


def test_differentiation_is_exact_for_straight_lines_up_to_the_ends():
    """A gesture that is cut off, or hits, ends at speed: no acceleration is made up there."""
    D1, D2 = differentiation_matrices(30)
    np.testing.assert_allclose(D1 @ np.linspace(2, 5, 30), 3, rtol=1e-12)
    np.testing.assert_allclose(D2 @ np.linspace(2, 5, 30), 0, atol=1e-9)


@pytest.mark.parametrize("n_nodes", [1, 2])
def test_the_response_converges_with_twice_the_nodes(monkeypatch, n_nodes):
    """With 8 nodes rounding hides the order, so it is seen with fewer."""
    dmp = DMP("bio-inspired", 6, gating="phase")

    def solve(steps_per_basis, nodes):
        monkeypatch.setattr(operators, "_STEPS_PER_BASIS", steps_per_basis)
        on_both_sides, weights = np.polynomial.legendre.leggauss(nodes)
        monkeypatch.setattr(operators, "NODES", 0.5 * (on_both_sides + 1.0))
        monkeypatch.setattr(operators, "NODE_WEIGHTS", 0.5 * weights)
        u = np.linspace(0, 1, 3)
        return operators.spring_damper_response(dmp, u)

    exact = solve(200, 8)
    responses = [solve(steps, n_nodes) for steps in (20, 40, 80)]
    for part in ("Phi", "goal"):
        errors = [np.abs(getattr(one, part) - getattr(exact, part))[:2].max() for one in responses]
        np.testing.assert_allclose(_orders(errors), 2 * n_nodes, atol=0.2)


def test_the_chosen_quadrature_has_converged():
    """Twice the steps change nothing: the 16th order is at rounding level for any basis."""
    dmp = DMP("bio-inspired", 80)
    coarse, fine = (operators.spring_damper_response(dmp, np.linspace(0, 1, n)) for n in (80, 800))
    np.testing.assert_allclose(coarse.Phi[:, -1], fine.Phi[:, -1], atol=1e-12)


@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_learning_a_generated_path_converges_with_the_points(make_movement, formulation):
    """The path is one of the basis, so what is left is the differences': first order, from the ends."""
    dmp = DMP(formulation, 8, phase_end=0.2, fit="forcing", regression="ridge", ridge=0.0)
    path = dmp.learn([make_movement(3)[1]]).rollout(n_samples=3201).positions
    errors = []
    for n_points in (201, 401, 801):
        again = replace(dmp, n_points=n_points).learn(path[:, :: 3200 // (n_points - 1)])
        errors.append(np.abs(again.rollout(n_samples=3201).positions - path).max())
    assert (_orders(errors) > 0.9).all(), errors

"""A foreign witness: the equations as printed, integrated by SciPy or evaluated point by point."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from kineme import DMP, Trajectory
from kineme.dmp.discrete.operators import forcing_target, spring_damper_response
from kineme.dmp.discrete.specification import FORMULATIONS
from soaking import combined

SPRINGS = {"critical": (100.0, None), "underdamped": (100.0, 3.0), "overdamped": (50.0, 40.0)}


def eq_3(basis, s):
    return np.exp(-basis.widths * (s - basis.centers) ** 2)


def eq_2(dmp, w, s):
    """f(s), one number per dimension, from weights (N, d); times s where the specification gates it."""
    psi = eq_3(dmp.basis, s)
    return psi @ w / psi.sum() * (s if dmp.gating == "phase" else 1.0)


def eq_1(dmp, x, v, s, f, x0, g):
    return dmp.K * (g - x) + (g - x0) * f - dmp.D * v


def eq_4(dmp, x, v, s, f, x0, g):
    return s * dmp.K * (f / s + x0 - x) + (1 - s) * dmp.K * (g - x) - dmp.D * v


def decoupled(dmp, x, v, s, f, x0, g):
    w_s = 1.008 * s**3 / (s**3 + 0.008)
    return w_s * dmp.K * (f / w_s + x0 - x) + (1 - w_s) * dmp.K * (g - x) - dmp.D * v


# "amplitude-scaled" is Eq. (4) with f times the ratio of distances, new over learned: see the second test.
PRINTED = {"original": eq_1, "bio-inspired": eq_4, "amplitude-scaled": eq_4, "decoupled": decoupled}


def test_every_formulation_has_its_equation_here():
    assert PRINTED.keys() == FORMULATIONS.keys()


def integrate(dmp, w, x0, g, v0, tau, times):
    """tau v' = ..., tau x' = v, tau s' = -alpha s from 0 to tau; returns x, dx/dt and d2x/dt2 at `times`."""
    d = len(x0)

    def right_side(t, state):
        x, v, s = state[:d], state[d:-1], state[-1]
        acceleration = PRINTED[dmp.formulation](dmp, x, v, s, eq_2(dmp, w, s), x0, g)
        return np.concatenate((v, acceleration, [-dmp.basis.phase.alpha * s])) / tau

    start = np.concatenate((x0, tau * v0, [1.0]))
    state = solve_ivp(right_side, (0, tau), start, method="DOP853", t_eval=times, rtol=1e-11, atol=1e-12).y
    derivatives = np.array([right_side(t, one) for t, one in zip(times, state.T, strict=True)])
    return state[:d].T, state[d:-1].T / tau, derivatives[:, d:-1] / tau


@pytest.mark.parametrize(("formulation", "spring", "gating"), combined(PRINTED, SPRINGS, ["none", "phase"]))
def test_the_decode_matrix_solves_the_printed_equations(make_movement, agree, formulation, spring, gating):
    stiffness, damping = SPRINGS[spring]
    dmp = DMP(formulation, 8, stiffness, damping, gating, fit="trajectory", n_points=80)
    t, x = make_movement(11)
    learned = dmp.learn(Trajectory(t, x))
    path = learned.rollout(n_samples=40)
    start, velocity = learned.starts[0], learned.velocities[0]
    solved = integrate(dmp, learned.weights[0], start, learned.goals[0], velocity, 2.0, path.times[0].clip(max=2.0))
    agree(path.positions[0], solved[0], 1e-9)
    agree(path.velocities[0], solved[1], 1e-9)
    agree(path.accelerations[0], solved[2], 1e-8)


@pytest.mark.parametrize("formulation", PRINTED)
def test_another_start_goal_velocity_and_duration_solve_the_printed_equations(make_movement, agree, formulation):
    dmp = DMP(formulation, 10, fit="trajectory", n_points=80)
    learned = dmp.learn(Trajectory(*make_movement(12)))
    start, goal, velocity, tau = np.array([5.0, -1.0]), np.array([3.0, 4.0]), np.array([0.5, -2.0]), 3.3
    path = learned.rollout(start, goal, tau, velocity=velocity, n_samples=40)
    ratio = np.linalg.norm(goal - start) / np.linalg.norm(learned.goals - learned.starts)
    w = learned.weights[0] * (ratio if formulation == "amplitude-scaled" else 1.0)
    solved = integrate(dmp, w, start, goal, velocity, tau, path.times[0].clip(max=tau))
    agree(path.positions[0], solved[0], 1e-9)
    agree(path.velocities[0], solved[1], 1e-9)


@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_the_forcing_target_is_the_printed_equation_solved_for_f(formulation):
    """x = 1 + sin(2u) + u^3 has known derivatives; inside, the error falls with the square of the step."""
    dmp = DMP(formulation, stiffness=30.0, damping=7.0)
    errors = []
    for n_points in (101, 201):
        u = np.linspace(0, 1, n_points)
        x, v, a = 1 + np.sin(2 * u) + u**3, 2 * np.cos(2 * u) + 3 * u**2, -4 * np.sin(2 * u) + 6 * u
        x0, g, s = x[0], x[-1], np.exp(np.log(0.01) * u)
        if formulation == "original":
            scale, f = g - x0, (a + dmp.D * v - dmp.K * (g - x)) / (g - x0)
        else:
            scale, f = dmp.K, s * ((a + dmp.D * v - (1 - s) * dmp.K * (g - x)) / (s * dmp.K) - x0 + x)
        target = forcing_target(dmp, u) @ (x - x0) / scale
        errors.append(np.abs(target - f)[2:-2].max() / np.abs(f).max())
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) > 1.9


def test_the_shape_attractor_is_the_term_of_eq_1(make_movement, agree):
    learned = DMP("original", 20).learn([make_movement(13)[1]])
    agree(learned.shape_attractor(), (learned.goals - learned.starts)[:, None] * learned.forcing(), 1e-12)


def test_the_shape_attractor_is_the_term_of_eq_4(make_movement, agree):
    learned = DMP("bio-inspired", 20).learn([make_movement(13)[1]])
    s = 0.01 ** np.linspace(0, 1, 100)[:, None]
    x, x0 = learned.rollout(n_samples=100).positions, learned.starts[:, None]
    agree(learned.shape_attractor(100), s * 100.0 * (learned.forcing(100) / s + x0 - x), 1e-9)


@pytest.mark.parametrize("n_basis", [10, 40])
@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_the_kink_at_the_end_of_the_demonstration_falls_into_no_quadrature(formulation, n_basis, agree):
    """Past u = 1 an ungated f fades: steps that end at u = 1 and steps that straddle it give the same."""
    dmp = DMP(formulation, n_basis=n_basis)
    straddling, ending = (spring_damper_response(dmp, np.linspace(0.0, 1.36, n)) for n in (9, 137))
    agree(straddling.Phi, ending.Phi[:, ::17], 1e-12)
    agree(straddling.goal, ending.goal[:, ::17], 1e-12)

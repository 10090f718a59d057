"""The generated movement: against the literal equation, against another way to the steady state, and what attracts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp
from scipy.linalg import expm

from kineme import RhythmicDMP
from kineme.dmp.rhythmic.operators import as_real, limit_cycle, waves
from kineme.dmp.spring_damper import transitions

SPECS = [
    RhythmicDMP(),
    RhythmicDMP(n_basis=11, overlap=0.1, stiffness=400.0, damping=15.0, fit="forcing"),
    RhythmicDMP(n_basis=3, overlap=1e-4),
]
ids = ["default", "underdamped", "narrow"]


@pytest.fixture(scope="module", params=SPECS, ids=ids)
def learned(request, make_rhythm):
    return request.param.learn([make_rhythm(3), make_rhythm(4, period=0.7)])


def _literal(learned, i, k, baseline, amplitude, period):
    """The equations of Ijspeert et al. (2013) in time t: one second-order equation and ``tau phi' = 1``."""
    dmp, w = learned.dmp, learned.weights[i, :, k]
    n = dmp.n_basis
    centers = np.arange(n) * 2 * np.pi / n
    h = -np.log(dmp.overlap) / (1 - np.cos(2 * np.pi / n))

    def slope(t, state):
        x, v, phi = state
        psi = np.exp(h * (np.cos(phi - centers) - 1))
        pull = dmp.K * (baseline - x) - dmp.D * v * period + amplitude * (psi @ w) / psi.sum()
        return v, pull / period**2, 2 * np.pi / period

    return slope


@pytest.mark.parametrize(("i", "k"), [(0, 0), (1, 1)])
def test_a_rollout_solves_the_literal_equation(learned, agree, i, k):
    baseline, amplitude, period, phase = 0.3, 1.7, 0.9, 2.0
    moved = learned[i].rollout(
        2.4, period=period, amplitude=amplitude, baseline=[baseline] * 2, start=[5.0, -4.0], velocity=[3.0, 9.0],
        phase=phase, n_samples=60,
    )  # fmt: skip
    slope = _literal(learned, i, k, baseline, amplitude, period)
    begin = ([5.0, -4.0][k], [3.0, 9.0][k], phase)
    witness = solve_ivp(slope, (0, 2.4 * period), begin, "DOP853", moved.times[0], rtol=1e-10, atol=1e-11)
    agree(moved.positions[0, :, k], witness.y[0], 1e-8)
    agree(moved.velocities[0, :, k], witness.y[1], 1e-8)
    agree(moved.accelerations[0, :, k], [slope(0, state)[1] for state in witness.y.T], 1e-8)


@pytest.mark.parametrize("damping", [0.3, 19.0, 20.0 - 1e-9, 20.0, 20.0 + 1e-9, 27.0, 1e4])
def test_the_state_is_carried_by_the_matrix_exponential(damping, agree):
    steps = np.array([0.0, 1e-6, 0.03, 1.0, 7.0])
    expected = np.array([expm(np.array([[0.0, 1.0], [-100.0, -damping]]) * h) for h in steps])
    for one, witness in zip(transitions(100.0, damping, steps), expected, strict=True):
        agree(one, witness, 1e-8)


@pytest.mark.parametrize("dmp", SPECS, ids=ids)
def test_the_steady_state_returns_to_itself_after_a_period(dmp, agree):
    """Convolution in time and ``(I - e^A) z0 = driven part`` give what division by the impedance gives."""
    A = np.array([[0.0, 1.0], [-dmp.K, -dmp.D]])

    def pushed(v):
        return expm(A * (1 - v))[:, 1:] * dmp.basis.design(np.array([2 * np.pi * v]))

    driven = quad_vec(pushed, 0, 1, epsabs=1e-13, epsrel=1e-12)[0]
    expected = np.linalg.solve(np.eye(2) - expm(A), driven)
    response = limit_cycle(dmp)
    h = np.arange(response.shape[1])
    here = waves(np.zeros(1), h[-1])
    agree(as_real(response) @ here[0], expected[0], 1e-9)
    agree(as_real(response * 2j * np.pi * h) @ here[0], expected[1], 1e-9)


def test_on_the_cycle_it_repeats_exactly_from_any_phase(learned, agree):
    moved = learned.rollout(3.0, phase=[0.4, 5.9], n_samples=301)
    agree(moved.positions[:, 100:], moved.positions[:, :-100], 1e-12)
    agree(moved.positions[:, 0], learned.rollout(0.5, phase=[0.4, 5.9], n_samples=2).positions[:, 0], 1e-12)


@pytest.mark.parametrize("distance", [0.0, 30.0])
def test_the_cycle_attracts_from_inside_and_from_outside(learned, distance):
    """Free motion decays with the slowest eigenvalue of the spring-damper; three periods leave next to nothing."""
    start = learned.baselines + distance
    moved = learned.rollout(6.0, start=start, velocity=[0, 0], n_samples=1201)
    apart = np.abs(moved.positions - learned.rollout(6.0, n_samples=1201).positions).max(axis=2)
    assert (apart[:, 0] > 0.1).all()
    for begin, end in ((0, 300), (300, 600), (600, 900)):
        assert (apart[:, end : end + 200].max(axis=1) < 2e-2 * apart[:, begin : begin + 200].max(axis=1) + 1e-12).all()
    assert (apart[:, -1] < 1e-9 * (1 + distance)).all()


def test_parts_of_the_cycle_add_up(learned, agree):
    """A fractional rollout ends where the next one, begun at that phase, starts."""
    whole = learned.rollout(1.75, n_samples=176).positions
    rest = learned.rollout(0.75, phase=2 * np.pi, n_samples=76).positions
    agree(whole[:, 100:], rest, 1e-12)


def test_derivatives_are_derivatives(learned, agree):
    moved = learned.rollout(1.0, start=[9.0, 9.0], n_samples=8_001)
    dt = moved.times[:, 1] - moved.times[:, 0]
    for value, slope in ((moved.positions, moved.velocities), (moved.velocities, moved.accelerations)):
        agree((value[:, 2:] - value[:, :-2]) / (2 * dt[:, None, None]), slope[:, 1:-1], 1e-4)


def test_samples_follow_the_rate_or_the_number(learned):
    assert learned.rollout(2.5).positions.shape == (2, 2.5 * 200 + 1, 2)
    by_rate = learned.rollout(2.0, rate=100.0)
    np.testing.assert_allclose(by_rate.times[:, -1], 2 * learned.periods)
    assert (np.diff(by_rate.times) <= 0.01 + 1e-12).all()


def test_one_primitive_goes_with_many_wishes_and_the_result_is_trajectories(learned, agree):
    many = learned[0].rollout(1.0, amplitude=[1.0, 2.0, 3.0], n_samples=50)
    shape = many.positions - many.baselines[:, None]
    agree(shape[2], 3 * shape[0], 1e-12)
    demos = many.trajectories
    assert len(demos) == 3
    np.testing.assert_array_equal(demos.positions, many.positions.reshape(-1, 2))

"""Controllers of every formulation and gating, in both twins; and the printed equations as a foreign witness."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from kineme import DMP
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from soaking import SOAK

TWINS = ("always", "never")


@pytest.fixture(params=TWINS)
def twin(request, monkeypatch):
    """Run a test with the compiled code and with plain NumPy."""
    monkeypatch.setenv("KINEME_COMPILED", request.param)
    return request.param


#: Each formulation with one of the gatings; `make soak` tries all pairs.
PAIRS = [pair for k, pair in enumerate(product(FORMULATIONS, GATINGS)) if SOAK or k % 2 == k // 2 % 2]


@pytest.fixture(params=PAIRS, ids="-".join)
def primitive(request, make_movement):
    """One primitive of 3 dimensions and 2 s, for each formulation and gating."""
    return _primitive(make_movement, *request.param)


@pytest.fixture
def bio(make_movement):
    """One bio-inspired primitive of 3 dimensions."""
    return _primitive(make_movement)


@pytest.fixture
def learn(make_movement):
    """Make a primitive of a wanted formulation, gating and number of dimensions."""

    def of(formulation="bio-inspired", gating="none", n_dims=3, **options):
        return _primitive(make_movement, formulation, gating, n_dims, **options)

    return of


def _primitive(make_movement, formulation="bio-inspired", gating="none", n_dims=3, **options):
    dmp = DMP(formulation, n_basis=15, n_points=60, gating=gating, **options)
    times, positions = make_movement(7, n_dims)
    from kineme import Trajectory

    return dmp.learn([Trajectory(times, positions)])[0]


@pytest.fixture
def straight():
    """A straight movement of 1 s from 0 to 1 along the first axis, in d dimensions."""

    def of(n_dims, axis=0):
        u = np.linspace(0, 1, 100)
        positions = np.zeros((100, n_dims))
        positions[:, axis] = u**3 * (10 - 15 * u + 6 * u**2)
        return DMP(n_basis=20, n_points=100).learn([positions])[0]

    return of


@pytest.fixture
def witness():
    """Eq. (1) or (4) as printed, integrated by SciPy in seconds, with an acceleration added per second squared."""

    def integrate(primitive, times, *, goal, added=None, state=None, u=0.0, duration=None):
        dmp, x0 = primitive.dmp, primitive.starts[0]
        tau = primitive.durations[0] if duration is None else duration
        w = primitive.scaled_weights[0] / dmp.K if dmp.formulation == "bio-inspired" else primitive.weights[0].T
        goal_at = goal if callable(goal) else (lambda t: goal)

        def right_side(t, both):
            x, v = both.reshape(2, -1)  # v = tau dx/dt
            g, now = goal_at(t), np.array([u + t / tau])
            f, s = (dmp.basis.design(now) @ w.T)[0], dmp.basis.phase(now)[0]
            if dmp.formulation == "bio-inspired":
                bend = s * dmp.K * (f / s + x0 - x) + (1 - s) * dmp.K * (g - x) - dmp.D * v
            else:
                bend = dmp.K * (g - x) + (g - x0) * f - dmp.D * v
            if added is not None:
                bend = bend + tau**2 * added(t, x, v / tau)
            return np.concatenate((v, bend)) / tau

        x, v = (x0, primitive.velocities[0]) if state is None else state
        start = np.concatenate((x, tau * v))
        solution = solve_ivp(right_side, (0, times[-1]), start, "DOP853", times, rtol=1e-11, atol=1e-12).y
        positions, slopes = np.split(solution.T, 2, axis=1)
        return positions, slopes / tau

    return integrate


@pytest.fixture
def steps():
    """Take n steps and stack what they report, the state before them first."""

    def take(controller, n, **passed):
        states = [controller.state] + [controller.step(**passed) for _ in range(n)]
        return tuple(np.array([getattr(state, name) for state in states]) for name in DERIVATIVES)

    return take


DERIVATIVES = ("position", "velocity", "acceleration")

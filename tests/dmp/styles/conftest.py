"""Properties of averages and styles are stated once and run over every formulation."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, Demonstrations
from kineme.dmp.discrete.specification import FORMULATIONS


def pytest_generate_tests(metafunc):
    if "dmp" in metafunc.fixturenames:
        dmps = [DMP(formulation, n_basis=15, n_points=60) for formulation in FORMULATIONS]
        metafunc.parametrize("dmp", dmps, ids=list(FORMULATIONS))


@pytest.fixture(scope="session")
def demonstrate(make_movement):
    """n demonstrations of unrelated shapes, sizes, places and durations (0.5 to 4 s)."""

    def demonstrations(n, seed=0, n_dims=2, labels=None):
        rng = np.random.default_rng(seed)
        shown = [make_movement(seed + i, n_dims, 50 + i) for i in range(n)]
        times = [rng.uniform(0.25, 2.0) * t for t, _ in shown]
        return Demonstrations.from_arrays([x for _, x in shown], labels, times)

    return demonstrations


@pytest.fixture(scope="session")
def two_styles():
    """n demonstrations that differ in two known ways: x = mean + a bow + b wave, with a, b returned as (n, 2)."""

    def demonstrations(n, seed=0, noise=0.0):
        rng = np.random.default_rng(seed)
        u = np.linspace(0, 1, 200)[:, None]
        line = np.hstack((3 * u, u + 0.2 * np.sin(np.pi * u)))
        bow = np.hstack((0 * u, 1 - np.cos(2 * np.pi * u)))
        wave = np.hstack((0.4 * (1 - np.cos(4 * np.pi * u)), 0 * u))
        amounts = rng.uniform(-1, 1, (n, 2))
        x = line + amounts[:, :1, None] * bow + amounts[:, 1:, None] * wave
        return x + noise * rng.normal(size=x.shape), amounts

    return demonstrations

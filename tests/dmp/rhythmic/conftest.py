"""Made-up rhythms: a few harmonics, any part of the cycle first, any number of periods."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Trajectory


def _make_rhythm(seed, cycles=3.0, period=1.3, start=0.0, n_samples=240, even=True, noise=0.0):
    """A 2-D recording of four harmonics that fall as 1 / h^2, and the noise in units of its deviation."""
    shape, rng = np.random.default_rng(seed), np.random.default_rng(seed + 1000)
    h = np.arange(1, 5)
    c = np.exp(2j * np.pi * shape.uniform(size=(2, 4))) * shape.uniform(0.5, 1, (2, 4)) / h**2
    u = np.linspace(0, 1, n_samples) if even else np.append(0, np.cumsum(rng.uniform(0.4, 1.6, n_samples - 1)))
    u = cycles * u / u[-1]
    x = (np.exp(1j * (2 * np.pi * u[:, None] + start) * h) @ c.T).real * [2, 1] + shape.normal(size=2)
    x = x + noise * x.std() * rng.normal(size=x.shape)
    return Trajectory(5.0 + period * u, x)


@pytest.fixture(scope="session")
def make_rhythm():
    return _make_rhythm

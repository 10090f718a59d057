"""Made-up movements: smooth, two-dimensional, reproducible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SEED = 20240501
N_WAVES = 5

Array = NDArray[np.float64]


def even_movements(n: int, n_samples: int, n_dims: int = 2) -> Array:
    """Movements of equal length and even sampling, shape (n, T, d)."""
    random = np.random.default_rng(SEED)
    return _positions(np.linspace(0.0, 1.0, n_samples), *_coefficients(random, n, n_dims))


def ragged_movements(n: int, shortest: int, longest: int, n_dims: int = 2) -> tuple[list[Array], list[Array]]:
    """Lists of (T_i, d) positions and (T_i,) irregular stamps over 0.5 to 3 seconds."""
    random = np.random.default_rng(SEED)
    goals, waves = _coefficients(random, n, n_dims)
    arrays, times = [], []
    for i, n_samples in enumerate(random.integers(shortest, longest + 1, n)):
        u = np.concatenate(([0.0], np.cumsum(random.uniform(0.5, 1.5, n_samples - 1))))
        u /= u[-1]
        arrays.append(_positions(u, goals[i : i + 1], waves[i : i + 1])[0])
        times.append(u * random.uniform(0.5, 3.0))
    return arrays, times


def _coefficients(random: np.random.Generator, n: int, n_dims: int) -> tuple[Array, Array]:
    waves = random.normal(size=(n, N_WAVES, n_dims)) / np.arange(1, N_WAVES + 1)[:, None] ** 2
    return random.normal(size=(n, n_dims)), waves


def _positions(u: Array, goals: Array, waves: Array) -> Array:
    """A minimum-jerk reach plus a few sine waves that vanish at both ends."""
    reach = u**3 * (10 - 15 * u + 6 * u**2)
    sines = np.sin(np.pi * u[:, None] * np.arange(1, N_WAVES + 1))
    return np.ascontiguousarray(reach[:, None] * goals[:, None] + sines @ waves)

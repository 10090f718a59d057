"""Recordings whose movements and rests are known, because they were put together here."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from kineme import Trajectory


class Known(NamedTuple):
    recording: Trajectory
    truth: np.ndarray  # (n, 2) [s]
    durations: np.ndarray


def _minimum_jerk(u):
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10 - 15 * u + 6 * u**2)


def _make_recording(seed, n=None, n_dims=2, noise=0.0, rate=100.0, even=True):
    """Minimum-jerk reaches between random places, 0.8 to 2 s long, with rests of 0.4 to 1 s around each."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7)) if n is None else n
    durations, rests = rng.uniform(0.8, 2.0, n), rng.uniform(0.4, 1.0, n + 1)
    starts = np.cumsum(rests[:-1]) + np.append(0.0, np.cumsum(durations[:-1]))
    end = starts[-1] + durations[-1] + rests[-1]
    t = np.arange(0.0, end, 1.0 / rate)
    if not even:
        t = np.sort(t + rng.uniform(-0.4, 0.4, len(t)) / rate)
    steps = rng.normal(size=(n, n_dims))
    steps *= rng.uniform(0.7, 1.4, (n, 1)) / np.linalg.norm(steps, axis=1, keepdims=True)
    x = sum(
        _minimum_jerk((t - start) / tau)[:, None] * step
        for start, tau, step in zip(starts, durations, steps, strict=True)
    )
    x = x + noise * rng.normal(size=x.shape)
    return Known(Trajectory(t, x, name="take"), np.column_stack((starts, starts + durations)), durations)


@pytest.fixture(scope="session")
def make_recording():
    return _make_recording


@pytest.fixture(scope="session")
def minimum_jerk():
    return _minimum_jerk

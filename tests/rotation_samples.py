"""Orientations and movements that the tests of this folder share."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kineme.orientation import exp, product

seeds = st.integers(0, 10_000)


def random_quaternions(seed, *shape):
    """Unit quaternions (*shape, 4), either sign."""
    q = np.random.default_rng(seed).normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def as_rotation(q):
    return Rotation.from_quat(q, scalar_first=True)


def minimum_jerk(n_samples):
    u = np.linspace(0, 1, n_samples)
    return u**3 * (10 - 15 * u + 6 * u**2)


def turn(angle, seed=0, n_samples=201):
    """Turn by `angle` about one axis in minimum-jerk time, (T, 4), and the axis."""
    axis = np.random.default_rng(seed).normal(size=3)
    axis /= np.linalg.norm(axis)
    p = minimum_jerk(n_samples)[:, None] * angle * axis
    return product(exp(p), random_quaternions(seed)), axis


def tumble(seed, n_samples=101, size=0.5):
    """Turn about a changing axis, starting and ending at rest, (T, 4)."""
    rng = np.random.default_rng(seed)
    s = minimum_jerk(n_samples)[:, None]
    p = size * (s * rng.normal(size=3) + np.sin(np.pi * s) * rng.normal(size=3))
    return product(exp(p + size * np.sin(2 * np.pi * s) / 4 * rng.normal(size=3)), random_quaternions(seed))


def carry(seed, n_samples=101):
    """Pose (T, 7): a position along the way of `tumble`."""
    rng = np.random.default_rng(seed + 1)
    s = minimum_jerk(n_samples)[:, None]
    x = rng.normal(size=3) + s * rng.normal(size=3) + np.sin(np.pi * s) * rng.normal(size=3)
    return np.concatenate((x, tumble(seed, n_samples)), axis=1)

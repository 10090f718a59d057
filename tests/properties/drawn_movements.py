"""Batches that hypothesis draws: lengths, extents, stamps, rates and order of each movement by itself."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from kineme import Demonstrations
from kineme.orientation import exp, product

STAMPS = ("even", "jitter", "random", "coincident")

#: Of one movement: samples, power of ten of its extent, stamps, power of ten of its duration, seed of the rest.
one_movement = st.tuples(
    st.integers(4, 120),
    st.integers(-6, 6),
    st.sampled_from(STAMPS),
    st.integers(-2, 3),
    st.integers(0, 10**6),
)
#: More rows than a block of 32 lanes holds, whatever the number of dimensions.
many_movements = st.lists(one_movement, min_size=36, max_size=44)


def any_movements(seed, n=40):
    """A batch as hypothesis may draw it, in which each kind of stamps and nearly each power of ten occurs."""
    rng = np.random.default_rng(seed)
    drawn = rng.integers((4, -6, 0, -2, 0), (121, 7, len(STAMPS), 4, 10**6), (n, 5)).tolist()
    return [(length, size, STAMPS[kind], tempo, own) for length, size, kind, tempo, own in drawn]


def _stamps(kind, length, rng):
    """Stamps (T,) from 0 to 1."""
    gaps = np.ones(length - 1)
    if kind == "jitter":
        gaps = rng.uniform(0.4, 1.6, length - 1)
    elif kind == "random":
        gaps = rng.exponential(size=length - 1) + 1e-3
    elif kind == "coincident":
        gaps[rng.random(length - 1) < 0.2] = 1e-3
    t = np.append(0.0, np.cumsum(gaps))
    return t / t[-1]


def _batch(drawn, path, shortest=4):
    arrays, times = [], []
    for i, (length, size, stamps, tempo, seed) in enumerate(drawn):
        rng = np.random.default_rng([seed, i])
        u = _stamps(stamps, max(length, shortest), rng)
        arrays.append(path(u, 10.0**size, rng))
        times.append(rng.choice([0.0, 1e3]) + 10.0**tempo * u)
    return Demonstrations.from_arrays(arrays, times=times, labels=[f"{i}" for i in range(len(drawn))])


def reaches(drawn):
    """From a start to another place, with waves and noise: g - x0 is about as large as the movement."""

    def path(u, size, rng):
        waves = np.sin(np.pi * u[:, None] * np.arange(1, 5)) @ (0.3 * rng.normal(size=(4, 2)))
        line = rng.choice([-1, 1], 2) * rng.uniform(1, 2, 2)
        return size * (10 * rng.normal(size=2) + u[:, None] * line + waves + 1e-3 * rng.normal(size=(len(u), 2)))

    return _batch(drawn, path)


def rhythms(drawn):
    """Two and a third to five periods of two harmonics."""

    def path(u, size, rng):
        phase = 2 * np.pi * rng.uniform(2.3, 5.0) * u[:, None] + rng.uniform(0, 6, 2)
        return size * (3 * rng.normal(size=2) + np.cos(phase) * [1.0, 0.6] + 0.3 * np.sin(2 * phase))

    return _batch(drawn, path, shortest=50)


def poses(drawn):
    """A position of any extent and an orientation that turns by up to 2 rad, quaternions of either sign."""

    def path(u, size, rng):
        s = u[:, None]
        x = size * (s * rng.normal(size=3) + np.sin(np.pi * s) * rng.normal(size=3))
        p = s * rng.normal(size=3) + 0.3 * np.sin(np.pi * s) * rng.normal(size=3)
        goal = rng.normal(size=4)
        q = product(exp(p), goal / np.linalg.norm(goal)) * rng.choice([-1, 1], (len(u), 1))
        return np.concatenate((x, q), axis=1)

    return _batch(drawn, path)


def rows(drawn):
    """Feature rows (n, 12) of any size, as a batch of one matrix."""
    return np.array([10.0**size * np.random.default_rng(seed).normal(size=12) for _, size, _, _, seed in drawn])

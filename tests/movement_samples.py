"""Kinds of movements to recognize: smooth shapes, each shown several times with small variations."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kineme import Demonstrations


def _waves(rng, n, d, decay):
    k = np.arange(1, 6)
    return rng.normal(size=(n, d, 5)) / k**decay


def draw_shapes(counts, d=2, seed=0, spread=0.1, n_samples=80):
    """Demonstrations: counts[c] movements of kind c, around a random shape that it has alone."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, n_samples)
    sines = np.sin(np.pi * u * np.arange(1, 6)[:, None])
    kinds = _waves(rng, len(counts), d, 0.5)
    line = rng.normal(size=(len(counts), d, 1)) * u
    which = np.repeat(np.arange(len(counts)), counts)
    paths = line[which] + (kinds[which] + spread * _waves(rng, len(which), d, 0.5)) @ sines
    labels = np.array([f"kind {c:02d}" for c in which])
    return Demonstrations.from_arrays(paths.transpose(0, 2, 1), labels, names=[f"no {i}" for i in range(len(which))])


def turn(angle, d, seed=0):
    """A rotation matrix by that angle; in space, about a random axis."""
    if d == 2:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    axis = np.random.default_rng(seed).normal(size=3)
    return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()


def interrupted(demos, seconds, at_rest, noise=0.0, seed=0):
    """Each movement with a pause somewhere: samples at rest, or no samples."""
    arrays, times = [], []
    for i, one in enumerate(demos):
        rng, t = np.random.default_rng([seed, i]), np.asarray(one.times)
        at = int(rng.uniform(0.05, 0.95) * (len(t) - 1)) + 1
        n_rest = max(1, int(seconds / np.median(np.diff(t)))) if at_rest else 0
        rest = t[at - 1] + seconds / max(1, n_rest) * np.arange(1, n_rest + 1)
        x = one.positions
        still = x[at - 1] + noise * np.ptp(x, axis=0).max() * rng.uniform(-1, 1, (n_rest, x.shape[1]))
        times.append(np.concatenate((t[:at], rest, t[at:] + seconds)))
        arrays.append(np.concatenate((x[:at], still, x[at:])))
    return Demonstrations.from_arrays(arrays, demos.labels, times)


def stepped(steps):
    """A movement to and fro between 0 and 32: n steps of 1, or of another length, or -n at rest, of so many seconds."""
    moved = [length for n, _, *own in steps for length in abs(n) * (own or [float(n > 0)])]
    elapsed = [seconds for n, seconds, *_ in steps for _ in range(abs(n))]
    x, times = (np.append(0.0, np.cumsum(one)) for one in (moved, elapsed))
    return Demonstrations.from_arrays([np.abs((x[:, None] + 32) % 64 - 32)], times=[times])

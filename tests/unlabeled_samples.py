"""Movements of several kinds, perturbed, and how well proposals recover the kinds."""

from __future__ import annotations

import math

import numpy as np
from sklearn.metrics import adjusted_rand_score

from kineme import Demonstrations
from kineme.movements.preparation.perturbations import Perturbation

ALL_TOGETHER = Perturbation(shift=1.0, scale=1.0, rotation=math.radians(20), warp=0.35, noise=0.01)


def draw_kinds(counts, d=2, seed=0, spread=0.06, n_samples=60):
    """counts[c] movements around a random smooth shape of their own, labeled "kind c"."""
    rng = np.random.default_rng([seed, d])
    u = np.linspace(0, 1, n_samples)
    sines = np.sin(np.pi * u * np.arange(1, 6)[:, None])
    which = np.repeat(np.arange(len(counts)), counts)
    decay = np.arange(1, 6) ** 0.5
    kinds = rng.normal(size=(len(counts), d, 5)) / decay
    line = rng.normal(size=(len(counts), d, 1)) * u
    own = spread * rng.normal(size=(len(which), d, 5)) / decay
    paths = line[which] + (kinds[which] + own) @ sines
    return Demonstrations.from_arrays(paths.transpose(0, 2, 1), [f"kind {c:02d}" for c in which])


def recovered(labels, proposals):
    """Adjusted Rand index; each movement left over counts as a kind of its own."""
    clusters = proposals.clusters.copy()
    alone = proposals.left_over
    clusters[alone] = len(proposals) + np.arange(len(alone))
    return adjusted_rand_score(labels, clusters)


def partition(proposals):
    """The proposals as sets, whatever their order."""
    return {frozenset(one.members.tolist()) for one in proposals.proposals}

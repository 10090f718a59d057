"""Very many movements like real ones: handwriting, bent into as many kinds as wanted, and copies of each."""

from __future__ import annotations

from typing import Any

import numpy as np

import kineme
from bench.movements import Array
from kineme.movements.preparation.perturbations import Perturbation

N_SAMPLES = 200
SHOWN = Perturbation(shift=1.0, scale=1.0, rotation=np.radians(20), warp=0.2, noise=0.002)
ASKED = Perturbation(shift=1.0, scale=1.0, rotation=np.radians(20), warp=0.35, noise=0.01)
_BENT, _VARIED = 0.08, 0.015  # of the extent: how far kinds, and copies of one kind, are apart


def kinds(n_kinds: int, n_dims: int) -> Array:
    """Paths (n, d, 200) of extent one: LASA recordings, in space two of them combined, bent by a few waves."""
    lasa = kineme.preprocess(kineme.load_lasa(), [kineme.Resample(N_SAMPLES)])
    paths = lasa.positions.reshape(len(lasa), N_SAMPLES, 2).transpose(0, 2, 1)
    random = np.random.default_rng(0)
    chosen = paths[np.arange(n_kinds) % len(lasa)]
    if n_dims == 3:
        chosen = np.concatenate((chosen, paths[random.permutation(n_kinds) % len(lasa), :1]), axis=1)
    chosen = chosen - chosen[:, :, :1]
    extents = np.linalg.norm(np.ptp(chosen, axis=2), axis=1)[:, None, None]
    return np.asarray(chosen / extents + _waves(random, n_kinds, n_dims, _BENT))


def copies(paths: Array, which: Any, seed: int, perturbation: Perturbation) -> Any:
    """Movements of the kinds `which`, each varied and perturbed in a way of its own, labeled."""
    varied = paths[which] + _waves(np.random.default_rng([seed, 1]), len(which), paths.shape[1], _VARIED)
    labels = np.array([f"kind {k:05d}" for k in which])
    demos = kineme.Demonstrations.from_arrays(np.ascontiguousarray(varied.transpose(0, 2, 1)), labels)
    return perturbation.apply(demos, seed)


def _waves(random: np.random.Generator, n: int, n_dims: int, strength: float) -> Array:
    k = np.arange(1, 6)
    u = np.linspace(0.0, 1.0, N_SAMPLES)
    return np.asarray((strength * random.normal(size=(n, n_dims, 5)) / np.sqrt(k)) @ np.sin(np.pi * u * k[:, None]))

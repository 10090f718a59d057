"""A library of a few classes of movements, an archive of others like them, and its shards."""

from __future__ import annotations

import numpy as np

import kineme
from kineme.io.reading.merge_files import Recordings, Source
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.pieces.shards import fit_reduction, write_reduction, write_shard

N_SAMPLES = 40


def movements(n, n_dims=2, seed=0, n_classes=4):
    """Arrays (n, T, d) of waves of a few classes, varied, turned and moved; and the class of each."""
    random = np.random.default_rng(seed)
    u = np.linspace(0, 1, N_SAMPLES)[:, None]
    k = np.arange(1, 5)
    waves = np.random.default_rng(99).normal(size=(n_classes, 4, n_dims)) / k[:, None]
    which = random.integers(0, n_classes, n)
    own = waves[which] + 0.15 * random.normal(size=(n, 4, n_dims)) / k[:, None]
    line = np.eye(n_dims)[0] * u * 2
    paths = line + np.sin(np.pi * u * k) @ own
    angle = random.normal(scale=0.2, size=n)
    if n_dims > 1:
        turned = paths.copy()
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        turned[:, :, 0], turned[:, :, 1] = (
            c * paths[:, :, 0] - s * paths[:, :, 1],
            s * paths[:, :, 0] + c * paths[:, :, 1],
        )
        paths = turned
    return paths + random.normal(size=(n, 1, n_dims)), np.array([f"class {c}" for c in which])


def library(folder, n_dims=2, n=60, **recognizer):
    """A library of labeled movements, whose folder it returns."""
    paths, labels = movements(n, n_dims, seed=1)
    how = kineme.Recognizer(**recognizer) if recognizer else None
    with kineme.ActionLibrary(folder, create=True, recognizer=how) as made:
        made.learn(paths, labels)
    return folder


def reduction_of(folder):
    with kineme.ActionLibrary(folder, read_only=True) as opened:
        return fit_reduction(opened.store)


def recordings(paths, first=0, labels=None):
    """Movements as what was read of files, three in each."""
    n = len(paths)
    times = [np.linspace(i, i + 1.5, paths.shape[1]) for i in range(first, first + n)]
    numbers = range(first, first + n)
    sources = tuple(
        Source(f"file {i // 3:04d}.csv", "0" * 64, 1, 0.0, str(i % 3), label, None, 0, 0.0, 0.0)
        for i, label in zip(numbers, [None] * n if labels is None else map(str, labels), strict=True)
    )  # fmt: skip
    return Recordings(Demonstrations.from_arrays(list(paths), times=times), sources, (), ())


def shards(folder, reduction, paths, n_shards=3, order=None, labels=None):
    """Write movements as so many shards, whose names say their `order`; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_reduction(folder, reduction)
    cuts = np.linspace(0, len(paths), n_shards + 1).astype(int)
    for k in range(n_shards):
        rows = slice(cuts[k], cuts[k + 1])
        part = recordings(paths[rows], int(cuts[k]), None if labels is None else labels[rows])
        number = k if order is None else order[k]
        write_shard(folder / f"part-{number:04d}.arrow", [reduction.table(part)])
    return folder

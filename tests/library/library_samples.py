"""Movements to fill libraries with, and a look past the library at its tables."""

from __future__ import annotations

import sqlite3
from contextlib import closing

import numpy as np

from kineme import Demonstrations
from kineme.library.storage.connection import FILE
from kineme.library.storage.schema import COLUMNS


def draw_movements(n, d=2, seed=0, ragged=False, labels=None, n_samples=40):
    """Random smooth movements; ragged ones differ in length and have uneven stamps from any origin on."""
    rng = np.random.default_rng(seed)
    arrays, times = [], []
    for _ in range(n):
        length = int(rng.integers(5, 2 * n_samples)) if ragged else n_samples
        u = np.linspace(0, 1, length)
        waves = np.sin(np.pi * u[:, None] * np.arange(1, 5)) @ rng.normal(size=(4, d))
        arrays.append(10 * rng.normal(size=d) + u[:, None] * rng.normal(size=d) + waves)
        times.append(rng.uniform(-5, 1e4) + np.cumsum(rng.uniform(0.01, 0.1, length)))
    return Demonstrations.from_arrays(arrays, labels, times if ragged else None, [f"no {i}" for i in range(n)])


def tables(folder):
    """Every row of every table, with its checksum."""
    with closing(sqlite3.connect(folder / FILE)) as connection:
        return {table: connection.execute(f"SELECT * FROM {table} ORDER BY 1").fetchall() for table in COLUMNS}


def contents(library):
    """All that can be read of a library, as plain comparable data."""
    ids = library.ids()
    if not len(ids):
        return library.version, [], repr(library.symbols())
    back, primitives = library.movements(ids=ids), library.primitives(ids=ids)
    symbols = [
        (
            symbol.id,
            symbol.name,
            symbol.description,
            symbol.members.tolist(),
            symbol.prototype,
            symbol.threshold,
            symbol.parents,
        )
        for symbol in library.symbols()
    ]
    arrays = (back.positions, back.offsets, back.times, library.features(ids), primitives.scaled_weights)
    ends = (primitives.starts, primitives.goals, primitives.velocities, primitives.extents, primitives.durations)
    labels = None if back.labels is None else back.labels.tolist()
    return (
        library.version,
        ids.tolist(),
        library.unlabeled().tolist(),
        [array.tobytes() for array in (*arrays, *ends)],
        (labels, back.names),
        symbols,
        [(version.id, version.action, version.detail) for version in library.history()],
    )

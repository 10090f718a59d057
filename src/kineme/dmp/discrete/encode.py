"""Learn a batch of movements: resample, subtract the start, multiply by the encode matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from kineme.dmp.discrete.operators import encoder
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.recorded_as import recorded_as
from kineme.errors import TrajectoryError
from kineme.movements.preparation.resample import even_rows, extents_of, relative_rows
from kineme.movements.preparation.trim import preprocess
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, describe

_TILE_SAMPLES = 200_000  # in one tile: larger ones do not fit the cache, with smaller ones threads wait for each other


def encode(dmp: Specification, movements: MovementsLike) -> dict[str, Any]:
    """Learn one primitive per movement; see `DMP.learn`."""
    recorded = Demonstrations.of(movements)
    demos = preprocess(recorded, dmp.preprocessing)
    n, n_dims = len(demos), demos.n_dims
    n_samples = demos.even_length or dmp.n_points
    operator = encoder(dmp, n_samples)
    weights = np.empty((n, n_dims, dmp.n_basis))
    velocities, extents = np.empty((n, n_dims)), np.empty((n, n_dims))

    def learn_tile(start: int, stop: int) -> None:
        # Evenly sampled movements are multiplied directly: their matrix contains the resampling.
        rows = even_rows(demos, start, stop) if demos.even_length else relative_rows(demos, start, stop, n_samples)
        flat = rows.reshape(-1, n_samples)  # one product; a stack of matrices would be as many small products
        np.matmul(flat, operator.weights, out=weights[start:stop].reshape(len(flat), -1))
        np.matmul(flat, operator.velocity, out=velocities[start:stop].reshape(-1))
        extents[start:stop] = extents_of(demos, start, stop)

    for_tiles(learn_tile, n, max(1, _TILE_SAMPLES // (n_dims * n_samples)))
    starts = demos.positions[demos.offsets[:-1]]
    check_movement(demos, starts, extents)
    return {
        "scaled_weights": weights,
        "starts": starts,
        "goals": demos.positions[demos.offsets[1:] - 1],
        "velocities": velocities / demos.durations[:, None],
        "durations": demos.durations,
        "extents": extents,
        "labels": demos.labels,
        "names": demos.names,
        "recorded_as": recorded_as(recorded, dmp.preprocessing),
    }


def check_movement(demos: Demonstrations, starts: Array, extents: Array) -> None:
    """Refuse a movement that does not move."""
    still = (extents <= 8 * np.finfo(float).eps * np.abs(starts)).all(axis=1)
    if still.any():
        i = int(np.argmax(still))
        raise TrajectoryError(
            f"{describe(i, demos.names)}: expected a movement, got {demos.lengths[i]} samples "
            f"at the same place ({still.sum()} of {len(demos)} movements do not move); leave them out"
        )

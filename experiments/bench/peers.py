"""The peers behind one small interface, with settings that serve them at least as well as their defaults."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.movements import Array

# Tried on LASA: stiffer than the defaults (25, 6.25) cut its worst error by six; a faster phase than 1 helps pydmps.
STIFF = {"alpha_y": 100.0, "beta_y": 25.0}
PYDMPS_PHASE_RATE = 2.0


def movement_primitive(times: Array, n_dims: int, n_basis: int, bio_inspired: bool = False) -> Any:
    """An untrained DMP of movement_primitives for a movement with these (T,) stamps, which start at zero.

    `smooth_scaling` is its name for the bio-inspired formulation.
    """
    from movement_primitives.dmp import DMP

    return DMP(
        n_dims,
        execution_time=float(times[-1]),
        dt=float(times[-1]) / (len(times) - 1),
        n_weights_per_dim=n_basis,
        smooth_scaling=bio_inspired,
        **STIFF,
    )


def pydmps_primitive(n_steps: int, n_dims: int, n_basis: int) -> Any:
    """An untrained DMP of pydmps, which takes every movement as one second long."""
    from pydmps.dmp_discrete import DMPs_discrete

    return DMPs_discrete(n_dmps=n_dims, n_bfs=n_basis, dt=1.0 / n_steps, ax=PYDMPS_PHASE_RATE)


def replay_movement_primitives(times: Array, positions: Array, n_basis: int, bio_inspired: bool) -> tuple[Array, Array]:
    """Learn and replay one even movement: phases in [0, 1] and positions."""
    dmp = movement_primitive(times, positions.shape[1], n_basis, bio_inspired)
    dmp.imitate(times, positions)
    t, path = dmp.open_loop()
    n = len(times)  # its time axis sometimes has one step more
    return t[:n] / times[-1], path[:n]


def replay_pydmps(_times: Array, positions: Array, n_basis: int) -> tuple[Array, Array]:
    """Learn and replay one even movement: phases in [0, 1] and positions."""
    n_steps = len(positions)
    dmp = pydmps_primitive(n_steps, positions.shape[1], n_basis)
    dmp.imitate_path(positions.T)
    path, _, _ = dmp.rollout()
    return np.arange(1, len(path) + 1) / n_steps, path  # its first sample is the state after one step


def dtw_nearest(asked: Array, stored: Array, window: int) -> Any:
    """Index (n,) of the nearest of the stored paths (m, T, d) for each asked one (n, T, d), on all cores."""
    from dtaidistance import dtw_ndim

    n = len(asked)
    both, block = np.concatenate((asked, stored)), ((0, n), (n, n + len(stored)))
    return dtw_ndim.distance_matrix_fast(both, block=block, window=window, parallel=True)[:n, n:].argmin(axis=1)

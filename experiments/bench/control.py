"""One step of live control: alone, with a measured state, around obstacles; against one step of a peer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bench.movements import even_movements
from bench.peers import movement_primitive
from bench.rows import Row
from bench.timing import medians
from kineme import DMP
from kineme.dmp.discrete.dmp import Primitives

N_SAMPLES, N_BASIS, DT = 200, 80, 0.002
MOST = 20e-6  # seconds


def measure(quick: bool) -> list[Row]:
    n, repeats = (400, 5) if quick else (500, 40)  # to the end of the movement
    rows = []
    for n_dims, obstacles in ((7, 0), (3, 1), (2, 1)):
        seconds = _seconds(n_dims, obstacles, n, repeats)
        details = {"n": n, "repeats": repeats, "n_basis": N_BASIS, "dt": DT, "seconds": seconds}
        what = f"step, {n_dims} dimensions" + (", 1 obstacle" if obstacles else "")
        ours, peer = 1e6 * seconds["step"], 1e6 * seconds["peer"]
        rows.append(Row(what, "µs", ours, peer, "movement_primitives step", peer / ours, (">=", 1.0), details))
        if not obstacles:
            rows.append(Row(what, "µs", ours, target=("<=", 1e6 * MOST)))
            rows.append(Row(f"{what}, measured state", "µs", 1e6 * seconds["measured"]))
    return rows


def _seconds(n_dims: int, n_obstacles: int, n: int, repeats: int) -> dict[str, float]:
    movement = even_movements(1, N_SAMPLES, n_dims)
    primitive = DMP(n_basis=N_BASIS, n_points=N_SAMPLES).learn(movement)[0]
    obstacle = movement[0, N_SAMPLES // 2] + 0.1
    work = {
        "step": _steps(primitive, n, obstacles=obstacle[None] if n_obstacles else None),
        "measured": _feedback(primitive, n),
        "peer": _peer(movement[0], n, obstacle if n_obstacles else None),
    }
    return {name: value / n for name, value in medians(work, repeats).items()}


def _steps(primitive: Primitives, n: int, **told: Any) -> Callable[[], object]:
    controller = primitive.controller(DT)

    def run() -> None:
        controller.reset()
        for _ in range(n):
            controller.step(**told)

    return run


def _feedback(primitive: Primitives, n: int) -> Callable[[], object]:
    controller = primitive.controller(DT)

    def run() -> None:
        state = controller.reset()
        for _ in range(n):
            state = controller.step(state.position, state.velocity)

    return run


def _peer(positions: np.ndarray, n: int, obstacle: np.ndarray | None) -> Callable[[], object]:
    """Its fastest integrator (Cython), its own obstacle term; it has none for more than three dimensions."""
    from movement_primitives.dmp import CouplingTermObstacleAvoidance2D, CouplingTermObstacleAvoidance3D

    n_dims = positions.shape[1]
    dmp = movement_primitive(np.linspace(0.0, 1.0, N_SAMPLES), n_dims, N_BASIS)
    dmp.imitate(np.linspace(0.0, 1.0, N_SAMPLES), positions)
    dmp.dt_ = DT
    term = {2: CouplingTermObstacleAvoidance2D, 3: CouplingTermObstacleAvoidance3D}
    coupling = None if obstacle is None else term[n_dims](obstacle)

    def run() -> None:
        dmp.reset()
        x, v = dmp.start_y, dmp.start_yd
        for _ in range(n):
            x, v = dmp.step(x, v, coupling_term=coupling)

    return run

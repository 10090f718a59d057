"""Learn and replay a block of even movements: all at once, and against one at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.movements import SEED, even_movements
from bench.peers import movement_primitive
from bench.rows import Row
from bench.timing import alone, medians
from kineme import DMP

N_SAMPLES, N_BASIS, N_DIMS = 200, 80, 2


def measure(quick: bool) -> list[Row]:
    n, n_peer, repeats = (2_000, 50, 5) if quick else (10_000, 200, 15)
    block = even_movements(n, N_SAMPLES, N_DIMS)
    dmp = DMP(n_basis=N_BASIS, n_points=N_SAMPLES)
    rows = np.ascontiguousarray(block.transpose(0, 2, 1)).reshape(-1, N_SAMPLES)
    matrix = np.random.default_rng(SEED).normal(size=(N_SAMPLES, N_BASIS))
    learned = dmp.learn(block)
    times = np.linspace(0.0, 1.0, N_SAMPLES)
    peers = [movement_primitive(times, N_DIMS, N_BASIS) for _ in range(n_peer)]
    seconds = medians(
        {
            "learn": lambda: dmp.learn(block),
            "product": lambda: rows @ matrix,
            "generate": lambda: learned.rollout(n_samples=N_SAMPLES).positions,
            "imitate": alone(lambda: [peer.imitate(times, one) for peer, one in zip(peers, block, strict=False)]),
            "open_loop": alone(lambda: [peer.open_loop() for peer in peers[:50]]),
        },
        repeats,
    )
    ours, bare, generated = n / seconds["learn"], n / seconds["product"], n / seconds["generate"]
    imitated, replayed = n_peer / seconds["imitate"], min(50, n_peer) / seconds["open_loop"]
    details: dict[str, Any] = {"n": n, "n_peer": n_peer, "n_samples": N_SAMPLES, "n_basis": N_BASIS, "n_dims": N_DIMS}
    details |= {"repeats": repeats, "seed": SEED, "seconds": seconds, "dmp": repr(dmp)}
    what, mp = f"{n:,} even movements", "movement_primitives"
    return [
        Row(f"learn {what}", "/s", ours, imitated, f"{mp} imitate", ours / imitated, (">=", 1000.0), details),
        Row(f"learn {what}", "/s", ours, bare, "bare matrix product", ours / bare, (">=", 0.5)),
        Row(f"generate {what}", "/s", generated, replayed, f"{mp} open_loop", generated / replayed, (">=", 1000.0)),
    ]

"""Learn a Python list of movements of unequal length and irregular stamps, and where the time goes."""

from __future__ import annotations

from typing import Any

from bench.movements import SEED, ragged_movements
from bench.peers import movement_primitive
from bench.rows import Row
from bench.timing import alone, medians
from kineme import DMP, Demonstrations
from kineme.movements.preparation.resample import relative_rows
from kineme.runtime.parallel import for_tiles
from kineme.validation import check_finite, check_times

N_POINTS, N_BASIS, N_DIMS = 200, 80, 2
SHORTEST, LONGEST = 150, 250
_TILE = 250  # movements resampled at a time, as in learning


def measure(quick: bool) -> list[Row]:
    n, n_peer, repeats = (2_000, 50, 5) if quick else (10_000, 200, 15)
    arrays, times = ragged_movements(n, SHORTEST, LONGEST, N_DIMS)
    dmp = DMP(n_basis=N_BASIS, n_points=N_POINTS)
    demos = Demonstrations.from_arrays(arrays, times=times)
    peers = [movement_primitive(t, N_DIMS, N_BASIS) for t in times[:n_peer]]

    def check() -> None:
        check_finite(demos.positions, demos.offsets, None, "positions")
        check_times(demos.times, demos.offsets, None)

    seconds = medians(
        {
            "learn": lambda: dmp.learn(Demonstrations.from_arrays(arrays, times=times)),
            "collect and check": lambda: Demonstrations.from_arrays(arrays, times=times),
            "check": check,
            "learn collected": lambda: dmp.learn(demos),
            "resample": lambda: for_tiles(lambda i, j: relative_rows(demos, i, j, N_POINTS), n, _TILE),
            "imitate": alone(lambda: [peer.imitate(t, x) for peer, t, x in zip(peers, times, arrays, strict=False)]),
        },
        repeats,
    )
    stages = {
        "collect": seconds["collect and check"] - seconds["check"],
        "check": seconds["check"],
        "resample": seconds["resample"],
        "multiply and the rest": seconds["learn collected"] - seconds["resample"],
    }
    ours, imitated = n / seconds["learn"], n_peer / seconds["imitate"]
    details: dict[str, Any] = {
        "n": n,
        "n_peer": n_peer,
        "lengths": [SHORTEST, LONGEST],
        "n_points": N_POINTS,
        "n_basis": N_BASIS,
    }
    details |= {"n_dims": N_DIMS, "repeats": repeats, "seed": SEED, "seconds": seconds, "dmp": repr(dmp)}
    peer = "movement_primitives imitate"
    return [
        Row(f"learn {n:,} ragged movements", "/s", ours, imitated, peer, ours / imitated, (">=", 300.0), details),
        *(Row(f"  of which {stage}", "ms", 1000 * spent) for stage, spent in stages.items()),
    ]

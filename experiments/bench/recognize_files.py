"""``kineme recognize`` on a folder of thousands of recordings: the processor time of the whole command."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import kineme
from bench.movements import SEED
from bench.rows import Row
from bench.space import lifted
from kineme.movements.preparation.perturbations import Perturbation

SHORTEST, LONGEST = 200, 1000
_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=np.radians(20), warp=0.35, noise=0.01)


def measure(quick: bool) -> list[Row]:
    n = 300 if quick else 3_000
    lasa = kineme.load_lasa()
    rows = []
    for n_dims, words in ((2, "the plane"), (3, "space")):
        shown = lasa if n_dims == 2 else lifted(lasa)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _write(shown, n, folder / "recordings")
            for n_known in (len(lasa),) if quick else (len(lasa), 2_000):
                library = folder / f"library-{n_known}"
                with kineme.ActionLibrary(library, create=True) as actions:
                    actions.learn(shown if n_known == len(lasa) else _perturbed(shown, n_known, SEED + 1))
                what = f"{n:,} files in {words}, 26 symbols of {n_known:,} movements"
                seconds = _processor_seconds(folder / "recordings", library)
                details = {"samples": [SHORTEST, LONGEST], "perturbation": repr(_PERTURBATION), "seed": SEED}
                rows.append(Row(what, "s", seconds, target=("<=", 10.0), details=details))
    return rows


def _perturbed(demos: kineme.Demonstrations, n: int, seed: int) -> kineme.Demonstrations:
    return _PERTURBATION.apply(demos[np.random.default_rng(seed).integers(len(demos), size=n)], seed)


def _write(demos: kineme.Demonstrations, n: int, folder: Path) -> None:
    """One CSV file for each of n perturbed movements, each of another length."""
    folder.mkdir()
    lengths = np.random.default_rng(SEED).integers(SHORTEST, LONGEST + 1, n)
    head = ",".join(("t", "x", "y", "z")[: 1 + demos.n_dims])
    for i, (one, length) in enumerate(zip(_perturbed(demos, n, SEED), lengths, strict=True)):
        times = np.linspace(one.times[0], one.times[-1], length)
        columns = [times, *(np.interp(times, one.times, x) for x in one.positions.T)]
        np.savetxt(folder / f"{i:05d}.csv", np.column_stack(columns), "%.6f", ",", header=head, comments="")


def _processor_seconds(recordings: Path, library: Path) -> float:
    """Of the second call: the first one fills caches, as of compiled code."""
    command = [sys.executable, "-m", "kineme", "recognize", str(recordings), "--library", str(library)]
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

"""``kineme annotate`` on a long recording of a robot with seven joints: the time of the whole command."""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.movements import SEED
from bench.rows import Row

RATE, N_DIMS, N_SYMBOLS, SHOWN = 100.0, 7, 20, 4
_NEW = 0.2  # share of the movements that are of no symbol
_NOISE = 0.002


def measure(quick: bool) -> list[Row]:
    minutes = 3 if quick else 60
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with kineme.ActionLibrary(folder / "library", create=True) as library:
            library.learn(demonstrations())
        truth = _write(folder / "long.csv", 60.0 * minutes)
        command = [sys.executable, "-m", "kineme", "annotate", str(folder / "long.csv")]
        command += ["--library", str(folder / "library"), "-o", str(folder / "long-labels.csv")]
        subprocess.run([*command, "--force"], check=True, stdout=subprocess.DEVNULL)  # fills caches of compiled code
        begin = perf_counter()
        subprocess.run([*command, "--force"], check=True, stdout=subprocess.DEVNULL)
        seconds = perf_counter() - begin
        found = found_in(folder / "long-labels.csv")
    what = f"{minutes} min at {RATE:g} Hz, {N_DIMS} channels, {N_SYMBOLS} symbols of {SHOWN} movements"
    details = {"seed": SEED, "movements": len(truth), "new": _NEW}
    return [
        Row(what, "s", seconds, target=("<=", 60.0), details=details),
        Row(f"{what}: named right, of those shown", "share", _right(truth, found), details=details),
    ]


def demonstrations() -> kineme.Demonstrations:
    """Some of each symbol, each a little different."""
    rng = np.random.default_rng(SEED)
    paths, labels, times = [], [], []
    for symbol in range(N_SYMBOLS):
        for _ in range(SHOWN):
            path = _movement(symbol, rng)
            paths.append(path)
            labels.append(f"symbol {symbol}")
            times.append(np.arange(len(path)) / RATE)
    return kineme.Demonstrations.from_arrays(paths, labels, times)


def _movement(symbol: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """A movement of a symbol: some sines in each joint between rests, of varied size, duration and timing."""
    fixed = np.random.default_rng((SEED, symbol))
    amplitudes, phases = fixed.normal(size=(N_DIMS, 3)), fixed.uniform(0.0, 2.0 * np.pi, (N_DIMS, 3))
    duration = fixed.uniform(0.8, 2.0) * rng.uniform(0.8, 1.25)
    s = np.linspace(0.0, 1.0, round(duration * RATE))
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)  # from rest to rest
    s = s + 0.1 * rng.uniform(-1.0, 1.0) * np.sin(np.pi * s) ** 2
    amplitudes = amplitudes * rng.uniform(0.85, 1.15) * (1.0 + 0.05 * rng.normal(size=amplitudes.shape))
    waves = np.sin(np.pi * np.arange(1, 4) * s[:, None, None] + phases) / np.arange(1, 4)
    path = 0.3 * (amplitudes * waves).sum(axis=2)
    return np.asarray(path - path[0])


def recording(seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[float, float, int]]]:
    """Stamps (T,), joints (T, 7), and the movements in it as start, end and symbol, -1 where it is of none."""
    rng = np.random.default_rng(SEED + 1)
    at, parts, truth, n = np.zeros(N_DIMS), [], [], 0
    while n < seconds * RATE:
        symbol = int(rng.integers(N_SYMBOLS))
        new = rng.random() < _NEW
        path = at + _movement(N_SYMBOLS + int(rng.integers(1_000)) if new else symbol, rng)
        rest = np.repeat(path[-1:], round(rng.uniform(0.0, 0.6) * RATE) + 1, axis=0)
        truth.append((n / RATE, (n + len(path) - 1) / RATE, -1 if new else symbol))
        parts += [path, rest]
        n += len(path) + len(rest)
        at = 0.8 * rest[-1]
        parts[-1] = np.concatenate((rest, _return(rest[-1], at)))
        n += len(parts[-1]) - len(rest)
    joints = np.concatenate(parts)[: round(seconds * RATE)]
    joints = joints + rng.normal(scale=_NOISE, size=joints.shape)
    return np.arange(len(joints)) / RATE, joints, [one for one in truth if one[1] < seconds]


def _return(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """A slow way back towards the middle of the joints."""
    s = np.linspace(0.0, 1.0, round(0.5 * RATE))[:, None]
    return np.asarray(start + (end - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def _write(path: Path, seconds: float) -> list[tuple[float, float, int]]:
    times, joints, truth = recording(seconds)
    head = ",".join(("time", *(f"joint{k}" for k in range(1, N_DIMS + 1))))
    np.savetxt(path, np.column_stack((times, joints)), "%.6f", ",", header=head, comments="")
    return truth


def found_in(path: Path) -> list[tuple[float, float, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return [(float(row["start"]), float(row["end"]), row["symbol"]) for row in csv.DictReader(file)]


def _right(truth: list[tuple[float, float, int]], found: list[tuple[float, float, str]]) -> float:
    """Share of the movements of symbols whose middle lies in a stretch that is annotated with the symbol."""
    shown = [one for one in truth if one[2] >= 0]
    right = 0
    for start, end, symbol in shown:
        middle = 0.5 * (start + end)
        right += any(a <= middle <= b and name == f"symbol {symbol}" for a, b, name in found)
    return right / len(shown)

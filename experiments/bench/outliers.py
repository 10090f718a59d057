"""Movements unlike the others of their label: planted ones found, and false alarms among what is found.

The recordings are those of `by_person`; a million frames are those of `lerobot`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.by_person import FOLDER
from bench.lerobot import write_data_set
from bench.movements import SEED
from bench.rows import Row
from kineme_experiments.evaluation.data import load_data

_SHARES = (0.0, 0.02, 0.1)
_SETS = ((20, 50), (10, 50), (2, 50), (10, 10), (3, 10))  # labels, movements of each


def measure(quick: bool) -> list[Row]:
    rows = _large(quick)
    path = FOLDER / "gestures3d.npz"
    if not path.is_file():
        print(f"outliers: no {path.name} in {FOLDER}; name the folder in KINEME_RECORDINGS")
        return rows
    demos = load_data(str(path)).demonstrations
    for n_labels, of_each in _SETS:
        for share in _SHARES:
            rows += _planted(demos, n_labels, of_each, share, 4 if quick else max(8, 4000 // (n_labels * of_each)))
    return [*rows, *_foreign(demos, 4 if quick else 20), *_single(demos, 4 if quick else 40)]


def _planted(demos: kineme.Demonstrations, n_labels: int, of_each: int, share: float, repeats: int) -> list[Row]:
    """Wrong labels among some movements of some labels."""
    labels, rng = np.asarray(demos.labels, dtype=str), np.random.default_rng(SEED)
    counts = []
    for _ in range(repeats):
        classes = rng.permutation(np.unique(labels))[:n_labels]
        some = np.concatenate([rng.permutation(np.flatnonzero(labels == c))[:of_each] for c in classes])
        given = labels[some]
        wrong = rng.choice(len(some), round(share * len(some)), replace=False)
        for i in wrong:
            given[i] = rng.choice(classes[classes != given[i]])
        counts.append(_counts(demos[some], given.tolist(), wrong))
    what = f"{n_labels} labels of {of_each}, {100 * share:.0f} % wrong"
    return _rows(what, counts, (">=", 0.85) if (n_labels, share) == (20, 0.02) else None)


def _foreign(demos: kineme.Demonstrations, repeats: int) -> list[Row]:
    """Movements of classes that have no label, among ten labels of fifty."""
    labels, rng = np.asarray(demos.labels, dtype=str), np.random.default_rng(SEED)
    counts = []
    for _ in range(repeats):
        classes = rng.permutation(np.unique(labels))
        own = np.flatnonzero(np.isin(labels, classes[:10]))
        others = rng.choice(np.flatnonzero(~np.isin(labels, classes[:10])), 20, replace=False)
        given = [*labels[own], *rng.choice(classes[:10], 20)]
        counts.append(_counts(demos[np.concatenate((own, others))], given, len(own) + np.arange(20)))
    return _rows("10 labels of 50, 20 movements of none of them", counts)


def _single(demos: kineme.Demonstrations, repeats: int) -> list[Row]:
    """Two movements of another class among fifty of the only label."""
    labels, rng = np.asarray(demos.labels, dtype=str), np.random.default_rng(SEED)
    counts = []
    for _ in range(repeats):
        one, other = rng.permutation(np.unique(labels))[:2]
        foreign = rng.choice(np.flatnonzero(labels == other), 2, replace=False)
        some = np.concatenate((np.flatnonzero(labels == one), foreign))
        counts.append(_counts(demos[some], ["a"] * len(some), len(some) - 1 - np.arange(2)))
    return _rows("1 label of 50, 2 movements of another class", counts)


def _counts(demos: kineme.Demonstrations, labels: list[str], planted: NDArray[np.intp]) -> tuple[int, int, int, int]:
    """Planted, found of these, found of the others, movements."""
    found = {one.index for one in kineme.find_outliers(demos, labels).outliers}
    right = len(found & set(planted.tolist()))
    return len(planted), right, len(found) - right, len(demos)


def _rows(what: str, counts: list[tuple[int, int, int, int]], target: tuple[str, float] | None = None) -> list[Row]:
    planted, right, others, movements = np.sum(counts, axis=0).tolist()
    false = float(np.mean([wrong / max(1, hit + wrong) for _, hit, wrong, _ in counts]))
    rows = [Row(f"{what}: found", "of 1", right / planted, target=target)] if planted else []
    return [
        *rows,
        Row(
            f"{'  ' if planted else what + ': '}false among what is found", "of 1", false,
            details={"sets": len(counts), "false_of_all_movements": others / (movements - planted)},
        ),
    ]  # fmt: skip


def _large(quick: bool) -> list[Row]:
    """A LeRobot data set of a million frames, 14 channels, 20 tasks."""
    episodes = 500 if quick else 10_000
    with tempfile.TemporaryDirectory() as name:
        write_data_set(Path(name) / "set", episodes, 100)
        read = kineme.read_recordings(Path(name) / "set")
    begin = process_time()
    kineme.find_outliers(read)
    seconds = process_time() - begin
    return [Row(f"{100 * episodes:,} frames, 14 channels", "s of processor time", seconds, target=("<=", 30.0))]

"""Archives of small recordings, and functions over their pieces that other processes find by their names."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from kineme.errors import DataError


def write_archive(folder, n_files=40, n_samples=60, seed=0):
    """Write CSV recordings in folders of their labels."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, n_samples)
    for k in range(n_files):
        label = ("arc", "line", "wave")[k % 3]
        (folder / label).mkdir(parents=True, exist_ok=True)
        y = {"arc": t**2, "line": t, "wave": np.sin(6 * t)}[label] + 0.01 * rng.normal(size=n_samples).cumsum()
        lines = [f"{a:.4f},{b:.5f},{c:.5f}" for a, b, c in zip(t, t, y, strict=True)]
        (folder / label / f"{k:04d}.csv").write_text("t,x,y\n" + "\n".join(lines) + "\n")
    return folder


def write_rows(path, counts, group=100, names=None, **more):
    """Write movements of so many samples one after the other, in groups of so many rows."""
    keys = range(len(counts)) if names is None else names
    t = np.concatenate([np.arange(n) / 50 for n in counts])
    rows = {"episode": np.repeat(np.array(keys), counts), "t": t, "x": np.sin(t), "y": np.arange(len(t)) % 7 * 0.1}
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(pa.table(rows | more), path, row_group_size=group)
    return path


def lengths(recordings):
    """Return a row for each movement."""
    demos = recordings.demonstrations
    return {
        "path": [source.path for source in recordings.sources], "label": list(recordings.labels),
        "samples": demos.lengths, "reach": [float(movement.positions[-1, 0]) for movement in demos],
    }  # fmt: skip


def slowly(recordings):
    time.sleep(0.02)
    return lengths(recordings)


def poisoned(recordings):
    """Raise for the recordings of one label."""
    if "wave" in recordings.labels:
        raise ValueError("these cannot be done")
    return lengths(recordings)


def deadly(recordings):
    """End the process with -9 at one file, as the system does where memory is short."""
    if any(source.path.endswith("0005.csv") for source in recordings.sources):
        os.kill(os.getpid(), signal.SIGKILL)
    return lengths(recordings)


def deadly_once(recordings):
    """End the process at one file the first time that it is read."""
    mark = Path(os.environ["KINEME_TEST_MARK"])
    if any(source.path.endswith("0005.csv") for source in recordings.sources) and not mark.exists():
        mark.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    return lengths(recordings)


def touching(recordings):
    """Change a file while it is read."""
    for source in recordings.sources:
        if source.path.endswith("0005.csv"):
            path = Path(os.environ["KINEME_TEST_MARK"]) / source.path
            path.write_text(path.read_text() + "1.1,1,1\n")
    return lengths(recordings)


def hanging(recordings):
    """Write down which process works, and never end."""
    Path(os.environ["KINEME_TEST_MARK"]).write_text(str(os.getpid()))
    time.sleep(600)


def stuck(recordings):
    """Never end at one file, in foreign code that lets nothing else in its process run."""
    if any(source.path.endswith("0005.csv") for source in recordings.sources):
        ctypes.PyDLL(None).sleep(600)
    return lengths(recordings)


def refusing(recordings):
    raise DataError("expected something else")


def parts_of(folder):
    """Return name of a part -> its bytes."""
    return {path.name: path.read_bytes() for path in sorted(Path(folder).glob("part-*"))}


def environment(recordings):
    """Return what libraries are told of threads and compiling."""
    return {name: [os.environ.get(name, "")] for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "KINEME_COMPILED")}

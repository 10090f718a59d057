"""What an evaluation runs on: a packaged data set, or a folder of recordings."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kineme.datasets.lasa import LASA_26, PAPER_LETTERS, load_lasa
from kineme.errors import DataError
from kineme.files.recordings import read_recordings
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import label_array

#: Name -> shapes.
PACKAGED = {"lasa": LASA_26, "lasa-letters": PAPER_LETTERS}


class DataSet(NamedTuple):
    """Labeled movements, and the files that were left out: file -> reason."""

    name: str
    demonstrations: Demonstrations
    left_out: dict[str, str]


def load_data(data: str) -> DataSet:
    """A packaged data set by its name, or recordings with labels: a folder per label, or a column of a table.

    What cannot be read, a movement of other dimensions than most, a movement without a label, and the only movement of
    a class are left out, and the reason is kept.

    Raises
    ------
    DataError
        No such folder, or fewer than two classes of at least two movements.
    """
    if data in PACKAGED:
        return DataSet(data, load_lasa(PACKAGED[data]), {})
    if not Path(data).exists():
        raise DataError(f"expected {', '.join(PACKAGED)} or a folder, found no folder {data!r}")
    read = read_recordings(data)
    left_out: dict[str, str] = {}
    for problem in read.problems:
        before = left_out.get(problem.file)
        left_out[problem.file] = f"{before}; {problem.what}" if before else problem.what
    sizes = Counter(label for label in read.labels if label is not None)
    kept = [label is not None and sizes[label] > 1 for label in read.labels]
    for name, label, keep in zip(read.demonstrations.names or (), read.labels, kept, strict=True):
        if not keep:
            left_out[str(name)] = "no label: not in a folder of its own" if label is None else _only(label)
    classes = {label for label, size in sizes.items() if size > 1}
    if len(classes) < 2:
        raise DataError(
            f"expected at least two folders of at least two recordings each in {data}, found "
            f"{dict(sizes) or 'no labels'}{_reasons(left_out)}"
        )
    labels = label_array([label for label, keep in zip(read.labels, kept, strict=True) if keep])
    chosen = read.demonstrations[np.flatnonzero(kept)].movements
    return DataSet(Path(data).resolve().name, Demonstrations.of_movements(replace(chosen, labels=labels)), left_out)


def _only(label: str) -> str:
    return f"the only movement labeled {label!r}"


def _reasons(left_out: dict[str, str]) -> str:
    if not left_out:
        return ""
    name, reason = next(iter(left_out.items()))
    return f"; {len(left_out)} left out, the first {name}: {reason}"

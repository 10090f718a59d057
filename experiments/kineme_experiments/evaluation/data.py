"""What an evaluation runs on: a packaged data set, or recordings, with the people who made them where that is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.datasets.lasa import LASA_26, PAPER_LETTERS, load_lasa
from kineme.errors import DataError
from kineme.io.reading.merge_files import Recordings, each_person
from kineme.io.reading.recordings import read_recordings
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import label_array

#: Name -> shapes.
PACKAGED = {"lasa": LASA_26, "lasa-letters": PAPER_LETTERS}


class DataSet(NamedTuple):
    """Labeled movements.

    Attributes
    ----------
    name : str
    demonstrations : Demonstrations
    left_out : dict
        File -> why it was left out.
    people : ndarray of shape (n,), optional
        Who made each movement.
    """

    name: str
    demonstrations: Demonstrations
    left_out: dict[str, str]
    people: NDArray[Any] | None = None


def load_data(data: str, read_path: Callable[[Path], Recordings] = read_recordings) -> DataSet:
    """A packaged data set by its name, or recordings with labels: a folder per label, a column, or an array of labels.

    People are read as `kineme.io.reading.merge_files` says. What cannot be read, a movement of other dimensions
    than most, a movement without a label, and the only movement of a class are left out, and the reason is kept.
    `read_path` reads the recordings.

    Raises
    ------
    DataError
        No such folder, or fewer than two classes of at least two movements.
    """
    if data in PACKAGED:
        return DataSet(data, load_lasa(PACKAGED[data]), {})
    path = Path(data)
    if not path.exists():
        raise DataError(f"expected {', '.join(PACKAGED)}, a folder or a file, found nothing at {data!r}")
    read = read_path(path)
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
    shown_by = each_person(path, [source for source, keep in zip(read.sources, kept, strict=True) if keep])
    people: NDArray[Any] | None = None  # where any is unknown, or all are the same person
    if None not in shown_by and len(set(shown_by)) > 1:
        people = np.empty(len(shown_by), dtype=object)
        people[:] = shown_by
    name = path.resolve().name if path.is_dir() else path.stem
    return DataSet(name, Demonstrations.of_movements(replace(chosen, labels=labels)), left_out, people)


def _only(label: str) -> str:
    return f"the only movement labeled {label!r}"


def _reasons(left_out: dict[str, str]) -> str:
    if not left_out:
        return ""
    name, reason = next(iter(left_out.items()))
    return f"; {len(left_out)} left out, the first {name}: {reason}"

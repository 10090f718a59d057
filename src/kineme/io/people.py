"""Who made each movement: from an array beside the labels, or from the folder above that of the label."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.arrays.npz import Npz
from kineme.io.merge_files import Source

#: Names of an array (n,) of people in an npz archive, one for each of its n movements.
NAMES = ("people", "person", "subjects", "subject")
_DEPTH = 3  # person/label/recording


def people_of(path: Path, sources: Sequence[Source]) -> NDArray[Any] | None:
    """As `each_person`, shape (n,); None where any is unknown, or all are one, so that nothing tells people apart."""
    people = each_person(path, sources)
    if None in people or len(set(people)) < 2:
        return None
    named = np.empty(len(people), dtype=object)
    named[:] = people
    return named


def each_person(path: Path, sources: Sequence[Source]) -> list[str | None]:
    """The person of each movement, or None where it is unknown.

    Where a column or a label pattern names the person, that one. In an npz archive, an array named as in `NAMES`, one
    entry for each movement. Else the folder above that of the label: ``person/label/recording``.

    Parameters
    ----------
    path : Path
        The folder or file that was read.
    sources : sequence of Source
        Of the movements.

    Raises
    ------
    DataError
        Not one person for each movement of a file.
    """
    of_file = cache(lambda name: _people_in(path / name if path.is_dir() else path))
    return [source.person or _person(source, of_file(source.path)) for source in sources]


def _person(source: Source, listed: list[str] | None) -> str | None:
    if listed is None:
        folders = PurePosixPath(source.path).parts
        return folders[-_DEPTH] if len(folders) >= _DEPTH else None
    index = int(source.place or 0)
    if index >= len(listed):
        raise DataError(f"expected a person for each movement in {source.path}, got {len(listed)}; add the others")
    return listed[index]


def _people_in(file: Path) -> list[str] | None:
    """The people named in a file, or None."""
    if file.suffix.lower() != ".npz":
        return None
    arrays = Npz(file.read_bytes(), file)
    name = next((one for one in NAMES if one in arrays), None)
    return None if name is None else [str(one) for one in np.atleast_1d(arrays[name]).tolist()]

"""The files to read among several files, folders and patterns."""

from __future__ import annotations

from collections.abc import Sequence
from glob import glob, has_magic
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError
from kineme.io.folders import as_text, files_under
from kineme.io.formats import data_set_of
from kineme.io.merge_files import Recordings
from kineme.io.problem import Problem
from kineme.reporting.text import first_names

_NAMED = 3  # paths that a message names


class Entry(NamedTuple):
    """A file, or a folder that is one data set.

    Attributes
    ----------
    path : Path
    relative : Path
        In the folder that was given; the name alone of what was given itself.
    name : str
        In the result: with the path that was given, where several were.
    """

    path: Path
    relative: Path
    name: str


def entries_of(paths: Sequence[Path], follow_links: bool = False) -> tuple[list[Entry], list[Problem]]:
    """All files of files, folders and patterns such as ``optitrack/*.csv``, each once, and problems.

    Raises
    ------
    DataError
        One path alone is given, and nothing is there.
    """
    entries: dict[Path, Entry] = {}
    problems: list[Problem] = []
    alone = is_alone(paths)
    for path in (one for given in paths for one in expanded(given)):
        if _is_folder_of_files(path):
            files, odd = files_under(path, follow_links)
            new = [(one, one.relative_to(path)) for one in files]
            problems += odd if alone else [one._replace(file=as_text(path / one.file)) for one in odd]
        elif path.exists() or path.is_symlink():
            new = [(path, name_of(path))]
        elif len(paths) == 1:
            raise DataError(f"expected a file or folder of recordings, found nothing at {str(path)!r}")
        else:
            problems.append(Problem(as_text(path), None, "expected a file or folder of recordings, found nothing"))
            continue
        for one, relative in new:
            entries.setdefault(one, Entry(one, relative, as_text(relative if alone else one)))
    return list(entries.values()), problems


def expanded(path: Path) -> list[Path]:
    """What a pattern matches, sorted, or itself; a file that has the name of a pattern is meant itself."""
    if not has_magic(str(path)) or path.exists() or path.is_symlink():
        return [path]
    return [Path(one) for one in sorted(glob(str(path), recursive=True))] or [path]


def is_alone(paths: Sequence[Path]) -> bool:
    """Whether one file or folder is given, so that names are those in it."""
    return len(paths) == 1 and expanded(paths[0]) == [paths[0]]


def root_of(*paths: Path) -> Path:
    """The folder that the names of sources are relative to: a folder of files itself, else the one around a file.

    Of several paths it is the working folder: their names are as they were given.
    """
    if not is_alone(paths):
        return Path()
    return paths[0] if _is_folder_of_files(paths[0]) else paths[0].parent


def paths_of(paths: Sequence[Path], recordings: Recordings) -> list[Path]:
    """The files and data sets that recordings were read from at these paths; for the standard input there is none."""
    root = root_of(*(path for path in paths if str(path) != "-"))
    return [root / name for name in dict.fromkeys(one.path for one in recordings.sources)]


def name_of(path: Path) -> Path:
    """The name of a file or a data set; of the current folder too."""
    return Path(path.name or path.resolve().name)


def in_words(paths: Sequence[Path]) -> str:
    """The paths for a message."""
    return first_names(paths, _NAMED)


def _is_folder_of_files(path: Path) -> bool:
    return path.is_dir() and data_set_of(path) is None

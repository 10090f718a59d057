"""The files to read among several files, folders and patterns, in an order that no file system changes."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Sequence
from glob import glob, has_magic
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError
from kineme.io.reading.formats import data_set_of
from kineme.io.records import Problem
from kineme.reporting.text import first_names

OUTSIDE = "a link that leads out of the folder; to read it, say follow_links=True, in the shell --follow-links"

_NAMED = 3  # paths that a message names


class Entry(NamedTuple):
    """A file, or a folder that is one data set."""

    path: Path
    relative: Path  # in the folder that was given; the name alone of what was given itself
    name: str  # in the result: with the path that was given, where several were


def entries_of(paths: Sequence[Path], follow_links: bool = False) -> tuple[list[Entry], list[Problem]]:
    """All files of files, folders and patterns such as ``optitrack/*.csv``, each once, and problems."""
    entries: dict[Path, Entry] = {}
    problems: list[Problem] = []
    alone = is_alone(paths)
    for path in (path for given in paths for path in expanded(given)):
        if _is_folder_of_files(path):
            files, odd = files_under(path, follow_links)
            new = [(file, file.relative_to(path)) for file in files]
            problems += odd if alone else [problem._replace(file=as_text(path / problem.file)) for problem in odd]
        elif path.exists() or path.is_symlink():
            new = [(path, name_of(path))]
        elif len(paths) == 1:
            raise DataError(f"expected a file or folder of recordings, found nothing at {str(path)!r}")
        else:
            problems.append(Problem(as_text(path), None, "expected a file or folder of recordings, found nothing"))
            continue
        for file, relative in new:
            entries.setdefault(file, Entry(file, relative, as_text(relative if alone else file)))
    return list(entries.values()), problems


def expanded(path: Path) -> list[Path]:
    """List the matches of a pattern, sorted, or itself; a file that has the name of a pattern is meant itself."""
    if not has_magic(str(path)) or path.exists() or path.is_symlink():
        return [path]
    return [Path(match) for match in sorted(glob(str(path), recursive=True))] or [path]


def is_alone(paths: Sequence[Path]) -> bool:
    """Tell whether one file or folder is given, so that names are those in it."""
    return len(paths) == 1 and expanded(paths[0]) == [paths[0]]


def root_of(*paths: Path) -> Path:
    """The folder that the names of sources are relative to: a folder of files itself, else the one around a file.

    Of several paths it is the working folder: their names are as they were given.
    """
    if not is_alone(paths):
        return Path()
    return paths[0] if _is_folder_of_files(paths[0]) else paths[0].parent


def name_of(path: Path) -> Path:
    """The name of a file or a data set; of the current folder too."""
    return Path(path.name or path.resolve().name)


def in_words(paths: Sequence[Path]) -> str:
    """The paths for a message."""
    return first_names(paths, _NAMED)


def _is_folder_of_files(path: Path) -> bool:
    return path.is_dir() and data_set_of(path) is None


def files_under(folder: Path, follow_links: bool = False) -> tuple[list[Path], list[Problem]]:
    """All files that are not hidden, sorted, and the problems with links and folders.

    A folder that is one data set (`kineme.io.reading.formats.DATA_SETS`) stands for all of its files.
    Names that begin with a dot are skipped. Links to folders are followed last, and no folder is entered twice. A link
    that leads out of the folder is a problem, and followed only with `follow_links`: a folder from elsewhere must not
    make the program read other files of this machine.
    """
    files: list[Path] = []
    problems: list[Problem] = []
    visited: set[tuple[int, int]] = set()
    folders, links = deque([folder]), deque[Path]()
    while folders or links:
        here = folders.popleft() if folders else links.popleft()
        try:
            status = here.stat()
            if (status.st_dev, status.st_ino) in visited:
                continue
            visited.add((status.st_dev, status.st_ino))
            if here != folder and data_set_of(here) is not None:
                files.append(here)
                continue
            entries = sorted(
                (entry for entry in os.scandir(here) if not entry.name.startswith(".")), key=lambda e: e.name
            )
        except OSError as error:
            problems.append(Problem(as_text(here.relative_to(folder)), None, f"the folder cannot be listed, {error}"))
            continue
        for entry in entries:
            path = here / entry.name
            if entry.is_symlink() and not follow_links and leads_out(path, folder):
                problems.append(Problem(as_text(path.relative_to(folder)), None, OUTSIDE))
            elif not _is_folder(entry):
                files.append(path)
            else:
                (links if entry.is_symlink() else folders).append(path)
    return sorted(files, key=lambda path: path.relative_to(folder).parts), problems


def leads_out(link: Path, folder: Path) -> bool:
    """Tell whether the target of a link exists and lies outside the folder."""
    target, top = os.path.realpath(link), os.path.realpath(folder)
    return os.path.exists(target) and os.path.commonpath([target, top]) != top


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Tell whether a path is a folder; False if unknown, as for a link to itself: reading it as a file reports why."""
    try:
        return entry.is_dir()
    except OSError:
        return False


def as_text(path: Path | str) -> str:
    r"""A path with forward slashes; bytes that are not UTF-8 are escaped as ``\xff``, so that it can be stored."""
    plain = path.as_posix() if isinstance(path, Path) else path
    return plain.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")

"""The files under a folder, in an order that does not depend on the file system."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path

from kineme.io.formats import data_set_of
from kineme.io.problem import Problem

OUTSIDE = "a link that leads out of the folder; to read it, say follow_links=True, in the shell --follow-links"


def files_under(folder: Path, follow_links: bool = False) -> tuple[list[Path], list[Problem]]:
    """All files that are not hidden, sorted, and the problems with links and folders.

    A folder that is one data set (`kineme.io.formats.DATA_SETS`) stands for all of its files.
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
            known = here.stat()
            if (known.st_dev, known.st_ino) in visited:
                continue
            visited.add((known.st_dev, known.st_ino))
            if here != folder and data_set_of(here) is not None:
                files.append(here)
                continue
            entries = sorted((one for one in os.scandir(here) if not one.name.startswith(".")), key=lambda e: e.name)
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
    """Whether the target of a link exists and lies outside the folder."""
    target, top = os.path.realpath(link), os.path.realpath(folder)
    return os.path.exists(target) and os.path.commonpath([target, top]) != top


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Whether a path is a folder; False if unknown, as for a link to itself: reading it as a file reports why."""
    try:
        return entry.is_dir()
    except OSError:
        return False


def as_text(path: Path | str) -> str:
    r"""A path with forward slashes; bytes that are not UTF-8 are escaped as ``\xff``, so that it can be stored."""
    plain = path.as_posix() if isinstance(path, Path) else path
    return plain.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")

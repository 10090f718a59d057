"""The files under a folder, in an order that does not depend on the file system."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path

from kineme.io.found import Problem


def files_under(folder: Path) -> tuple[list[Path], list[Problem]]:
    """All files that are not hidden, sorted, and the folders that could not be listed.

    Names that begin with a dot are passed over. Links to folders are followed after everything else, and no folder is
    entered twice, so that links may lead anywhere.
    """
    files: list[Path] = []
    problems: list[Problem] = []
    seen: set[tuple[int, int]] = set()
    folders, links = deque([folder]), deque[Path]()
    while folders or links:
        here = folders.popleft() if folders else links.popleft()
        try:
            known = here.stat()
            if (known.st_dev, known.st_ino) in seen:
                continue
            seen.add((known.st_dev, known.st_ino))
            entries = sorted((one for one in os.scandir(here) if not one.name.startswith(".")), key=lambda e: e.name)
        except OSError as error:
            problems.append(Problem(as_text(here.relative_to(folder)), None, f"the folder cannot be listed, {error}"))
            continue
        for entry in entries:
            path = here / entry.name
            if not entry.is_dir():
                files.append(path)
            else:
                (links if entry.is_symlink() else folders).append(path)
    return sorted(files, key=lambda path: path.relative_to(folder).parts), problems


def as_text(path: Path | str) -> str:
    r"""A path with forward slashes; bytes that are no text are written as ``\xff``, so that it can be stored."""
    plain = path.as_posix() if isinstance(path, Path) else path
    return plain.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")

"""Several paths read one by one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from kineme.cli.reading import read


def read_each(paths: tuple[Path, ...], options: dict[str, Any]) -> tuple[list[Any], list[str]]:
    """The recordings at each path, and problems; an error if nothing could be read.

    The sources of several paths are named by the paths as they are given.
    """
    from kineme.errors import DataError

    parsed: list[Any] = []
    problems: list[str] = []
    first: DataError | None = None
    for path in paths:
        try:
            one = read(path, options)
        except DataError as error:
            first = first or error
            problems.append(str(error))
        else:
            parsed.append(_named(one, path) if len(paths) > 1 else one)
            problems += map(str, one.problems)
    if not parsed and first is not None:
        raise first
    return parsed, problems


def _named(recordings: Any, path: Path) -> Any:
    """The same recordings with the paths of their sources as the user can open them."""
    if str(path) == "-":
        return recordings
    sources = tuple(
        one._replace(path=path.as_posix() if one.path == path.name else (path / one.path).as_posix())
        for one in recordings.sources
    )
    return replace(recordings, sources=sources)

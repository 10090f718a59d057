"""Names of files that are written for the movements of recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath

#: A movement by the path of its recording, and its place in it; see `kineme.io.merge_files.Source`.
Movement = tuple[str, str]


def distinct_stems(movements: Sequence[Movement]) -> list[str]:
    """A name for each movement, without ending, such as ``long`` or ``session-3``; none twice, whatever the case.

    Characters that are neither letters nor digits become underscores, so that a name is never a path.
    """
    stems: list[str] = []
    taken: set[str] = set()
    for recording, place in movements:
        path = PurePosixPath(recording)
        parts = [*(part for part in path.parts[:-1] if part not in {"/", "..", "."}), path.stem, place]
        stem = "-".join(_plain(part) for part in parts if part).strip(".") or "recording"
        name, k = stem, 1
        while name.lower() in taken:
            k += 1
            name = f"{stem}-{k}"
        taken.add(name.lower())
        stems.append(name)
    return stems


def _plain(part: str) -> str:
    return "".join(mark if mark.isalnum() or mark in "-_." else "_" for mark in part)

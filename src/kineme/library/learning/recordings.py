"""Learn from files; the source file of every movement is stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Any

from kineme.io.merge_files import Recordings
from kineme.io.merge_files import Source as File
from kineme.library.learning.learn import LearnReport, Progress, learn
from kineme.library.storage.source import Source
from kineme.library.storage.store import Store


def learn_recordings(  # noqa: PLR0913, PLR0917 - those of `ActionLibrary.learn`
    store: Store,
    recordings: Recordings,
    options: Mapping[str, Any] | None = None,
    labels: Sequence[str | None] | None = None,
    progress: Progress | None = None,
    root: str | PurePath = "",
    groups: Sequence[str | None] | None = None,
) -> LearnReport:
    """Store the recordings of `kineme.io.recordings.read_recordings`.

    Parameters
    ----------
    store : Store
        The library, ``ActionLibrary.store``.
    recordings : Recordings
    options : mapping, optional
        Options of the reader. The same file read with other options is another source.
    labels : sequence of n str or None, optional
        Names of symbols; by default each movement's own label.
    progress : callable, optional
        As for `ActionLibrary.learn`.
    root : str or Path, optional
        Folder that was read; stored before the names of the files.
    groups : sequence of n str or None, optional
        As for `ActionLibrary.learn`.
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    told = {name: value for name, value in (options or {}).items() if value is not None}
    files = {one.path: _source(one, PurePath(root) / one.path, told, now) for one in recordings.sources}
    return learn(
        store,
        recordings.demonstrations,
        list(recordings.labels) if labels is None else labels,
        [files[one.path] for one in recordings.sources],
        places=[one.place for one in recordings.sources],
        progress=progress,
        groups=groups,
    )


def _source(one: File, path: PurePath, told: Mapping[str, Any], now: str) -> Source:
    return Source(path.as_posix(), one.sha256, one.size, path.suffix.lower().lstrip("."), told, now)

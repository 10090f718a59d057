"""Recordings piece by piece: some episodes of a data set at a time, other files one by one; memory holds one piece."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from kineme.errors import KinemeError
from kineme.io.lerobot.info import MARKER
from kineme.io.reading.formats import Entry, Format, data_set_of, entries_of, read_parquet
from kineme.io.reading.merge_files import Recordings, merge_files
from kineme.io.reading.read_file import parsed_file
from kineme.io.reading.recordings import TASK, HowToRead, check_asked, heads_of, read_entries, trimmed
from kineme.io.records import Problem, needs
from kineme.movements.episodes import number_at


def is_episodic(path: Path) -> bool:
    """Tell whether a path is a data set whose episodes are read some at a time."""
    data_set = data_set_of(path) if path.is_dir() else None
    return data_set is not None and data_set.marker == MARKER


def read_pieces(
    paths: Sequence[Path], how: HowToRead, places: Collection[str] | None = None
) -> Iterator[Recordings | Problem]:
    """Yield recordings of files, folders and patterns, as `read_paths` reads them, or the problem with a file.

    Each piece has the channels of its own samples. A data set that is read some episodes at a time has no checksum; of
    it only the episodes at these `places` are read, all at once, if there are any.
    """
    entries, problems = entries_of(paths, how.follow_links)
    yield from problems
    numbers = None if places is None else {number for place in places if (number := number_at(place)) is not None}
    for entry in entries:
        yield from read_entry(entry, how, numbers)


def read_entry(entry: Entry, how: HowToRead, numbers: Collection[int] | None = None) -> Iterator[Recordings | Problem]:
    """Yield the recordings of a file or data set, of the latter some episodes at a time, or the problem with it.

    Of a data set, the episodes with these `numbers` are read, all at once unless they are a range. Of a file of
    Parquet, it is a range of groups of rows: the movements that begin in them are read, without a checksum.
    """
    try:
        if isinstance(numbers, range) or is_episodic(entry.path):
            yield from _in_parts(entry, how, numbers)
        else:
            recordings = read_entries([entry], how._replace(join=False))
            check_asked(how.layout, heads_of(recordings), recordings.people is not None, entry.name)
            yield recordings
    except (KinemeError, OSError) as error:
        reason = str(error).removeprefix(f"{entry.path}: ").removeprefix(f"{entry.name}: ")
        yield Problem(entry.name, None, reason, type(error) if isinstance(error, KinemeError) else KinemeError)


def _in_parts(entry: Entry, how: HowToRead, numbers: Collection[int] | None) -> Iterator[Recordings | Problem]:
    """Yield the whole episodes of a data set, and why others are not; or the movements of some groups of rows."""
    with needs("pyarrow", "read Parquet", "parquet"):
        from kineme.io.lerobot.read import lerobot_parts
    layout, rule = how.layout, how.rule
    learned = layout.reference.columns if layout.reference is not None and layout.coordinates is None else ()
    layouts = [replace(layout, columns=learned), layout] if learned else [layout]
    parts: Iterable[Any] = ()
    if is_episodic(entry.path):
        parts = lerobot_parts(entry.path, layouts, numbers)
    elif isinstance(numbers, range):
        parts = [partial(read_parquet, entry.path, part=numbers)]
    relative = Path(entry.relative.name) if rule.label_by == TASK else entry.relative
    for parse in parts:
        file = rule.apply(parsed_file(parse, Format(), relative, layout), entry.path).renamed(entry.name)
        if not file.block.labels:
            yield from file.problems
            continue
        recordings = merge_files([file], entry.name, layout)
        yield trimmed(recordings) if how.trim else recordings

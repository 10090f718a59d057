"""Pieces of an archive: what one process reads at a time, told from names, sizes and times alone.

Every process that plans the same archive gets the same pieces in the same order, so that shards need no coordinator.
Where files are added, few pieces change: bundles of files end at files whose names say so.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from kineme.errors import DataError, SpecificationError
from kineme.io.lerobot.info import MARKER, read_episodes, read_info, read_tasks
from kineme.io.reading.recordings import how_to_read
from kineme.io.records import Problem, needs
from kineme.movements.tables.layout import Layout
from kineme.pieces.archive import File, Unit, local_copy, opened, units_of

PIECE_BYTES = 16 * 2**20  # of a piece, about: one is some minutes of work for `annotate`

_MOST_FILES = 4096  # in one piece
_ENDS = 16  # one in so many names ends a bundle that is large enough
_CUT = 2.0  # sizes of a piece beyond which one file of episodes, or of rows, is divided


@dataclass(frozen=True)
class Piece:
    """A part of an archive: some files, some episodes of a data set, or some groups of the rows of a file of Parquet.

    - `uri`: the archive, as it was given.
    - `first`, `last`: names of the first and the last file, or numbers of the first and the last episode, or group of
      rows, both included. A movement is of the group in which it begins.
    - `units`: what is read; of a data set with episodes, with the files that hold these.
    - `begun`: the name of a file whose beginning is in a piece before, if there is one.
    """

    uri: str
    first: str | int
    last: str | int
    units: tuple[Unit, ...]
    begun: str = ""

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(file.size for unit in self.units for file in unit.files)

    @property
    def numbers(self) -> range | None:
        """Numbers of its episodes or groups of rows; None of files."""
        return range(self.first, self.last + 1) if isinstance(self.first, int) and isinstance(self.last, int) else None

    @property
    def key(self) -> str:
        """Sixteen hexadecimal digits that name it: of what it is, not of where the archive lies if it is alone."""
        names = [[unit.shown, self.first, self.last] for unit in self.units[:1]]
        return hashlib.blake2b(json.dumps(names).encode(), digest_size=8).hexdigest()

    @property
    def sources(self) -> str:
        """A checksum of the names, sizes and times of its files: another one means that a file has changed."""
        lines = [[unit.name, *file] for unit in self.units for file in unit.files]
        return hashlib.blake2b(json.dumps(lines).encode(), digest_size=16).hexdigest()

    def __str__(self) -> str:
        """Return what it is in a message."""
        if self.numbers is not None:
            what = "episodes" if self.units[0].marker else "row groups"
            return f"{self.units[0].shown}, {what} {self.first} to {self.last}"
        return str(self.first) if self.first == self.last else f"{self.first} to {self.last}"


@dataclass(frozen=True)
class Plan:
    """All pieces of an archive, in the order of its names, and what is in none: it cannot be listed."""

    pieces: tuple[Piece, ...]
    problems: tuple[Problem, ...]

    def shard(self, rank: int, count: int) -> Plan:
        """Return every count-th piece, the first one at `rank`, from 1; problems are those of the first shard."""
        if not 1 <= rank <= count:
            raise SpecificationError(f"expected a shard from 1/{count} to {count}/{count}, got {rank}/{count}")
        return Plan(self.pieces[rank - 1 :: count], self.problems if rank == 1 else ())


def plan(archive: str | Sequence[str], size: int = PIECE_BYTES, **reading: Any) -> Plan:
    """Divide archives into pieces of about `size` bytes, from their listings and the metadata of large files alone.

    An archive is a folder, a file, a data set, or the URI of one of these in a store that pyarrow or fsspec opens:
    ``s3://``, ``gs://``, ``abfs://``, ``hf://``, ... A piece is a bundle of small files, one large file, one bag, one
    data set, some episodes of a data set of LeRobot, or some groups of the rows of a file of Parquet, in which a column
    tells movements apart and never decreases, as its metadata say. Larger ones than a piece are not divided otherwise.
    Options of `reading`, those of `kineme.read_recordings`, say which column it is, and whether links are followed.

    Raises `DataError`: nothing there, or a listing that fails.
    """
    if size < 1:
        raise SpecificationError(f"expected a size of pieces of at least one byte, got {size}")
    archives = [archive] if isinstance(archive, str) else list(archive)
    how = how_to_read(reading)
    units, problems = units_of(archives, how.follow_links)
    pieces: list[Piece] = []
    bundle: list[Unit] = []
    n_bytes = 0
    for unit in [*units, None]:
        of_rows = [] if unit is None else _of_rows(unit, size, how.layout)
        is_new = unit is None or unit.marker or of_rows or (bundle and bundle[-1].archive != unit.archive)
        if bundle and (is_new or _is_complete(bundle, n_bytes, size)):
            pieces.append(Piece(bundle[0].archive, bundle[0].shown, bundle[-1].shown, tuple(bundle)))
            bundle, n_bytes = [], 0
        if unit is None:
            break
        if unit.marker == MARKER:
            try:
                pieces += _of_episodes(unit, size, problems)
            except DataError as error:
                problems.append(Problem(unit.shown, None, str(error)))
        elif of_rows:
            pieces += of_rows
        elif unit.marker:
            pieces.append(Piece(unit.archive, unit.shown, unit.shown, (unit,)))
        else:
            bundle.append(unit)
            n_bytes += unit.files[0].size
    if not pieces:
        raise DataError(f"expected recordings in {', '.join(archives)}, found none; the first problem: {problems[0]}")
    return Plan(tuple(pieces), tuple(problems))


def _is_complete(bundle: Sequence[Unit], n_bytes: int, size: int) -> bool:
    """Tell whether a bundle ends here: it is large, or its last file is, or large enough and its last name says so."""
    if n_bytes >= 2 * size or len(bundle) >= _MOST_FILES or 2 * bundle[-1].files[0].size >= size:
        return True
    ends = zlib.crc32(bundle[-1].shown.encode()) % _ENDS == 0
    return ends and (2 * n_bytes >= size or 2 * len(bundle) >= _MOST_FILES)


def _of_rows(unit: Unit, size: int, layout: Layout) -> list[Piece]:
    """Return pieces of consecutive groups of rows of a large file of Parquet; none if it is not divided."""
    if unit.marker or unit.files[0].size <= _CUT * size or not unit.name.lower().endswith(".parquet"):
        return []
    with needs("pyarrow", "read Parquet", "parquet"):
        from kineme.io.tables.parquet import row_groups
    groups = None
    with suppress(DataError, OSError):  # who reads it says so
        groups = row_groups(opened(unit), layout)
    if groups is None:
        return []
    firsts, n_bytes = [0], 0
    for group, of_group in enumerate(groups.sizes):
        if n_bytes >= size and groups.highs[group] > groups.highs[group - 1]:  # a movement begins in it
            firsts, n_bytes = [*firsts, group], 0
        n_bytes += of_group
    parts = zip(firsts, [*firsts[1:], len(groups.sizes)], strict=True)
    begun = unit.files[0].name
    return [Piece(unit.archive, first, end - 1, (unit,), begun if first else "") for first, end in parts]


def _of_episodes(unit: Unit, size: int, problems: list[Problem]) -> Iterator[Piece]:
    """Yield pieces of consecutive episodes: files of frames, unless one is large; problems of meta/ are added."""
    meta, frames = _apart(unit)
    with local_copy(unit._replace(files=tuple(meta))) as folder:
        info = read_info(folder / unit.name)
        declared, (_, unsaid) = read_episodes(folder / unit.name, info), read_tasks(folder / unit.name)
    prefix = "" if unit.is_archive else f"{unit.name}/"
    files: dict[str, list[File]] = {}
    for file in frames:
        name = file.name.removeprefix(prefix)
        files.setdefault(info.data_path if name.startswith(f"{info.data_path}/") else name, []).append(file)
    others = files.keys() - {*declared.shards}
    undeclared = [f"expected episodes in {name}, the meta folder names none" for name in sorted(others)]
    problems += [Problem(unit.shown, None, reason) for reason in (*declared.problems, *unsaid, *undeclared)]
    sizes = {shard: sum(file.size for file in of_shard) for shard, of_shard in files.items()}
    n_frames: dict[str, int] = {}
    for shard, length in zip(declared.shards, declared.lengths.tolist(), strict=True):
        n_frames[shard] = n_frames.get(shard, 0) + length
    first, shards, n_bytes, numbers, begun = 0, dict[str, None](), 0.0, declared.numbers.tolist(), ""

    def piece(last: int) -> Piece:
        read = (*meta, *(file for name in shards for file in files.get(name, ())))
        return Piece(unit.archive, numbers[first], numbers[last], (unit._replace(files=read),), begun)

    for k, (shard, length) in enumerate(zip(declared.shards, declared.lengths.tolist(), strict=True)):
        other = bool(shards) and shard not in shards
        if ((other and n_bytes >= size) or n_bytes >= _CUT * size) and numbers[k] != numbers[k - 1]:
            yield piece(k - 1)
            begun = files[shard][0].name if shard in shards and files.get(shard) else ""
            first, shards, n_bytes = k, {}, 0.0
        shards[shard] = None
        n_bytes += sizes.get(shard, 0) * length / max(1, n_frames[shard])
    yield piece(len(numbers) - 1)


def _apart(unit: Unit) -> tuple[list[File], list[File]]:
    """Return the files of the meta folder of a data set, and the others."""
    folder = "meta/" if unit.is_archive else f"{unit.name}/meta/"
    meta = [file for file in unit.files if file.name.startswith(folder)]
    return meta, [file for file in unit.files if not file.name.startswith(folder)]

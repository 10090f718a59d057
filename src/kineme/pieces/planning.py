"""Pieces of an archive: what one process reads at a time, told from names, sizes and times alone.

Every process that plans the same archive gets the same pieces in the same order, so that shards need no coordinator.
Where files are added, few pieces change: bundles of files end at files whose names say so.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from kineme.errors import DataError, SpecificationError
from kineme.io.lerobot.info import MARKER, read_episodes, read_info
from kineme.io.records import Problem
from kineme.pieces.archive import File, Unit, local_copy, units_of

PIECE_BYTES = 16 * 2**20  # of a piece, about: one is some minutes of work for `annotate`

_MOST_FILES = 4096  # in one piece
_ENDS = 16  # one in so many names ends a bundle that is large enough
_CUT = 4.0  # sizes of a piece beyond which one file of episodes is divided


@dataclass(frozen=True)
class Piece:
    """A part of an archive: some files, or some episodes of a data set.

    - `uri`: the archive, as it was given.
    - `first`, `last`: names of the first and the last file, or numbers of the first and the last episode, both
      included.
    - `units`: what is read; of a data set with episodes, with the files that hold these.
    """

    uri: str
    first: str | int
    last: str | int
    units: tuple[Unit, ...]

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(file.size for unit in self.units for file in unit.files)

    @property
    def numbers(self) -> range | None:
        """Numbers of its episodes; None of files."""
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
            return f"{self.units[0].shown}, episodes {self.first} to {self.last}"
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


def plan(archive: str | Sequence[str], size: int = PIECE_BYTES, *, follow_links: bool = False) -> Plan:
    """Divide archives into pieces of about `size` bytes, from their listings and the meta folders of data sets.

    An archive is a folder, a file, a data set, or the URI of one of these in a store that pyarrow or fsspec opens:
    ``s3://``, ``gs://``, ``abfs://``, ``hf://``, ... A piece is a bundle of small files, one large file, one bag, one
    data set, or some episodes of a data set of LeRobot; larger ones than a piece are not divided otherwise.

    Raises `DataError`: nothing there, or a listing that fails.
    """
    if size < 1:
        raise SpecificationError(f"expected a size of pieces of at least one byte, got {size}")
    archives = [archive] if isinstance(archive, str) else list(archive)
    units, problems = units_of(archives, follow_links)
    pieces: list[Piece] = []
    bundle: list[Unit] = []
    n_bytes = 0
    for unit in [*units, None]:
        is_new = unit is None or unit.marker or (bundle and bundle[-1].archive != unit.archive)
        if bundle and (is_new or _is_complete(bundle, n_bytes, size)):
            pieces.append(Piece(bundle[0].archive, bundle[0].shown, bundle[-1].shown, tuple(bundle)))
            bundle, n_bytes = [], 0
        if unit is None:
            break
        if unit.marker == MARKER:
            try:
                pieces += _of_episodes(unit, size)
            except DataError as error:
                problems.append(Problem(unit.shown, None, str(error)))
        elif unit.marker:
            pieces.append(Piece(unit.archive, unit.shown, unit.shown, (unit,)))
        else:
            bundle.append(unit)
            n_bytes += unit.files[0].size
    if not pieces:
        raise DataError(f"expected recordings in {', '.join(archives)}, found none; the first problem: {problems[0]}")
    return Plan(tuple(pieces), tuple(problems))


def _is_complete(bundle: Sequence[Unit], n_bytes: int, size: int) -> bool:
    """Tell whether a bundle ends here: it is large, or large enough and its last name says so."""
    if n_bytes >= 2 * size or len(bundle) >= _MOST_FILES:
        return True
    ends = zlib.crc32(bundle[-1].shown.encode()) % _ENDS == 0
    return ends and (2 * n_bytes >= size or 2 * len(bundle) >= _MOST_FILES)


def _of_episodes(unit: Unit, size: int) -> Iterator[Piece]:
    """Yield pieces of consecutive episodes: whole files of frames, unless one is much larger than a piece."""
    meta, frames = _apart(unit)
    with local_copy(unit._replace(files=tuple(meta))) as folder:
        info = read_info(folder / unit.name)
        declared = read_episodes(folder / unit.name, info)
    prefix = "" if unit.is_archive else f"{unit.name}/"
    files: dict[str, list[File]] = {}
    for file in frames:
        name = file.name.removeprefix(prefix)
        files.setdefault(info.data_path if name.startswith(f"{info.data_path}/") else name, []).append(file)
    sizes = {shard: sum(file.size for file in of_shard) for shard, of_shard in files.items()}
    n_frames: dict[str, int] = {}
    for shard, length in zip(declared.shards, declared.lengths.tolist(), strict=True):
        n_frames[shard] = n_frames.get(shard, 0) + length
    first, shards, n_bytes, numbers = 0, dict[str, None](), 0.0, declared.numbers.tolist()
    for k, (shard, length) in enumerate(zip(declared.shards, declared.lengths.tolist(), strict=True)):
        other = bool(shards) and shard not in shards
        if (other and n_bytes >= size) or n_bytes >= _CUT * size:
            yield _piece(unit, numbers[first], numbers[k - 1], meta, [files.get(name, []) for name in shards])
            first, shards, n_bytes = k, {}, 0.0
        shards[shard] = None
        n_bytes += sizes.get(shard, 0) * length / max(1, n_frames[shard])
    yield _piece(unit, numbers[first], numbers[-1], meta, [files.get(name, []) for name in shards])


def _piece(unit: Unit, first: int, last: int, meta: Sequence[File], frames: Sequence[Sequence[File]]) -> Piece:
    files = (*meta, *(file for of_shard in frames for file in of_shard))
    return Piece(unit.archive, first, last, (unit._replace(files=files),))


def _apart(unit: Unit) -> tuple[list[File], list[File]]:
    """Return the files of the meta folder of a data set, and the others."""
    folder = "meta/" if unit.is_archive else f"{unit.name}/meta/"
    meta = [file for file in unit.files if file.name.startswith(folder)]
    return meta, [file for file in unit.files if not file.name.startswith(folder)]

"""Indexes of shards: rows of some shards together, in the order in which they are searched, in files beside them.

An index is made when shards are opened for the first time, and again when they are others: its name says which they
are. Where nothing can be written beside the shards, it is held in memory. Its arrays are mapped: processes share them.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.pieces.scan import BLOCK, Index, Plan, Rows, Single
from kineme.pieces.shards import Reduction, Shard
from kineme.reporting.atomic import whole_folder

FOLDER = "search-"  # and a checksum
_FORMAT = 1
MOST = 2**20  # rows of an index, unless one shard has more
_WRONG = 1e-4  # of a square: reduced features and residual are farther from it than rounding


class Group(NamedTuple):
    """Some shards that are searched together."""

    rows: Index
    shards: NDArray[np.int32]  # (n,), number of the shard of each row
    places: Rows  # (n,), row in the shard


def groups_of(shards: Sequence[Shard], most: int) -> list[range]:
    """Return numbers of the shards of each group: neighbors, of at most so many rows or one shard."""
    groups, first, total = list[range](), 0, 0
    for number, shard in enumerate(shards):
        if total and total + len(shard) > most:
            groups, first, total = [*groups, range(first, number)], number, 0
        total += len(shard)
    return [*groups, range(first, len(shards))] if total else groups


def open_group(folder: Path, plan: Plan, chosen: list[int], reduction: Reduction, shards: Sequence[Shard]) -> Group:
    """Return the index of shards, from its files or made; shards are numbered from 0, `chosen` are representations."""
    path = folder / f"{FOLDER}{_key(plan, chosen, reduction, shards)}"
    names = (*Index._fields, *Group._fields[1:])
    with suppress(OSError, ValueError, EOFError):  # none there, or damaged: it is made
        arrays = [np.load(path / f"{name}.npy", mmap_mode="r") for name in names]
        group = Group(Index(*arrays[:4]), *arrays[4:])
        if _fits(group, plan, shards):
            return group
    group = _made(plan, chosen, reduction, shards)
    with suppress(OSError):
        if path.is_dir():
            shutil.rmtree(path)
        with whole_folder(path) as beside:
            arrays = [*group.rows, group.shards, group.places]
            for name, array in zip(names, arrays, strict=True):
                np.save(beside / f"{name}.npy", array)
        arrays = [np.load(path / f"{name}.npy", mmap_mode="r") for name in names]
        return Group(Index(*arrays[:4]), *arrays[4:])
    return group


def remove_others(
    folder: Path, plan: Plan, chosen: list[int], reduction: Reduction, groups: Sequence[Sequence[Shard]]
) -> None:
    """Remove indexes of shards that are there no more, or that are in other groups now."""
    used = {_key(plan, chosen, reduction, shards) for shards in groups}
    for path in folder.glob(f"{FOLDER}*"):
        if path.name.removeprefix(FOLDER) not in used:
            shutil.rmtree(path, ignore_errors=True)


def _key(plan: Plan, chosen: list[int], reduction: Reduction, shards: Sequence[Shard]) -> str:
    files = [(shard.path.name, shard.path.stat()) for shard in shards]
    states = [(name, status.st_size, status.st_mtime_ns) for name, status in files]
    said = repr((_FORMAT, BLOCK, reduction.digest, chosen, plan.kind, plan.n_marks, states))
    return hashlib.sha256(said.encode()).hexdigest()[:24]


def _fits(group: Group, plan: Plan, shards: Sequence[Shard]) -> bool:
    """Tell whether arrays are of the right shapes, and point to rows that are there."""
    n, width, n_marks = sum(map(len, shards)), int(plan.begins[-1]), sum(plan.n_marks)
    blocks = -(-n // BLOCK)
    shapes = [(blocks, n_marks, BLOCK), (blocks, n_marks), (blocks, n_marks), (n, width), (n,), (n,)]
    arrays = (*group.rows, *group[1:])
    if [array.shape for array in arrays] != shapes or any(array.dtype != np.float32 for array in group.rows):
        return False
    lengths = np.array([len(shard) for shard in shards])
    inside = (group.shards >= 0) & (group.shards < len(shards)) & (group.places >= 0)
    return bool(inside.all() and (group.places < lengths[group.shards]).all())


def _made(plan: Plan, chosen: list[int], reduction: Reduction, shards: Sequence[Shard]) -> Group:
    columns = [reduction.columns()[r] for r in chosen]
    lengths = [len(shard) for shard in shards]
    reduced = np.empty((sum(lengths), plan.begins[-1]), dtype=np.float32)
    done = 0
    for shard in shards:
        shard.advise("SEQUENTIAL")
        for block in shard.numbers["reduced"]:
            _check(block, reduction, shard.path)
            part = reduced[done : done + len(block)]
            part[:] = np.concatenate([arranged(plan, block[:, column]) for column in columns], axis=1)
            done += len(block)
        shard.advise("RANDOM")
    index, order = plan.index(reduced)
    owners = np.repeat(np.arange(len(shards), dtype=np.int32), lengths)
    rows = np.concatenate([np.arange(length) for length in lengths])
    return Group(index, owners[order], rows[order])


def arranged(plan: Plan, reduced: Single) -> Single:
    """Return reduced features of a representation (n, d k + 2) with the x of all points first."""
    if plan.procrustes.n_points == 1:
        return reduced
    return np.column_stack((plan.procrustes.by_coordinates(reduced[:, :-2]), reduced[:, -2:]))


def _check(block: Single, reduction: Reduction, path: Path) -> None:
    """Refuse reduced features that are not finite, or whose squares are not those of their parts."""
    for column in reduction.columns():
        part = block[:, column].astype(np.float64)
        squares = np.einsum("ij,ij->i", part[:, :-2], part[:, :-2]) + part[:, -1] ** 2
        wrong = ~(np.abs(part[:, -2] - squares) <= _WRONG * np.maximum(part[:, -2], squares)) | (part[:, -1] < 0)
        if wrong.any():
            raise DataError(
                f"expected reduced features in {path}, got damaged ones in {int(wrong.sum()):,} of {len(block):,} "
                "rows; remove the shard, and write it again by kineme features"
            )

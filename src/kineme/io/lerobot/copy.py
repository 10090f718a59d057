"""Copy a data set of LeRobot with texts about the movements of its episodes."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from kineme.errors import DataError
from kineme.io.lerobot.episodes import read_episodes
from kineme.io.lerobot.info import MARKER, read_info, read_json
from kineme.io.lerobot.motions import Motion
from kineme.io.lerobot.write_shard import COLUMNS, Column, write_shard

_OWN = ("meta", "data")  # folders whose files other programs write over; other ones hold videos


def copy_with_motions(source: Path, target: Path, motions: Mapping[int, Sequence[Motion]]) -> None:
    """Copy a data set into a folder, with texts about the movements of its episodes on each of their frames.

    They stand in the column that `COLUMNS` has for the version: `language_persistent` of version 3, whose programs know
    it, and `annotation.motion` of version 2, whose programs read texts but fail on lists of rows. Shards are written
    anew, each with the column; meta/info.json gets an entry for it if it has none. All else is copied; videos and
    pictures are hard links where the file system has them.

    Parameters
    ----------
    source, target : Path
        Folders; the second exists and is empty.
    motions : mapping of int to sequence of Motion
        Number of an episode -> its texts.

    Raises
    ------
    DataError
        An episode that is not there, or a damaged shard; the message names it.
    """
    info = read_info(source)
    column = COLUMNS[info.version]
    declared = read_episodes(source, info)
    if declared.problems:
        raise DataError(f"expected a whole data set to copy: {declared.problems[0]}")
    if unknown := set(motions) - set(declared.numbers.tolist()):
        raise DataError(f"expected an episode of the data set, got {min(unknown)}")
    shards = [one for one in dict.fromkeys(declared.shards) if (source / one).is_file()]
    changed = {(source / one) for one in (*shards, MARKER)}
    shutil.copytree(
        source, target, dirs_exist_ok=True, copy_function=lambda old, new: _take(source, Path(old), Path(new), changed)
    )
    for shard in shards:
        write_shard(source / shard, target / shard, motions, column)
    _declare(source / MARKER, target / MARKER, column)


def _take(source: Path, old: Path, new: Path, changed: set[Path]) -> None:
    """Copy or link a file, unless it will be written."""
    if old in changed:
        return
    if old.relative_to(source).parts[0] not in _OWN:
        try:
            os.link(old.resolve(), new)
        except OSError:
            pass
        else:
            return
    shutil.copy2(old, new)


def _declare(source: Path, target: Path, column: Column) -> None:
    known = read_json(source, MARKER)
    if column.name in known["features"]:
        shutil.copy2(source, target)
        return
    known["features"][column.name] = column.feature
    target.write_text(json.dumps(known, indent=4, ensure_ascii=False), encoding="utf-8")

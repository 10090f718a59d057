"""Episodes of a data set of LeRobot as they are stored, one after the other: raw stamps, and what is wrong with each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np

from kineme.errors import DataError
from kineme.io.lerobot.info import read_episodes, read_info, read_tasks
from kineme.io.lerobot.read import read_shard
from kineme.movements.episodes import Episode


def episodes(
    folder: Path, features: Sequence[str] | None = None, numbers: Collection[int] | None = None
) -> Iterator[Episode]:
    """Yield the episodes in the order of storage, with all features of numbers, or some, and all episodes, or some."""
    info = read_info(folder)
    names = list(info.heads) if features is None else list(features)
    if unknown := [name for name in names if name not in info.heads]:
        raise DataError(f"expected features of numbers {', '.join(info.heads)}, got {unknown[0]!r}")
    widths = {name: len(info.heads[name]) for name in names}
    entries = {name: info.heads[name] for name in names}
    declared, (tasks, _) = read_episodes(folder, info), read_tasks(folder)
    for shard in dict.fromkeys(declared.shards):
        parts = read_shard(folder, shard, widths, 0)
        for number in np.unique(np.concatenate([part.episodes for part in parts])).tolist():
            if numbers is not None and number not in numbers:
                continue
            rows = [part.episodes == number for part in parts]
            values = np.concatenate([part.values[mask] for part, mask in zip(parts, rows, strict=True)])
            stamps = np.concatenate([part.stamps[mask] for part, mask in zip(parts, rows, strict=True)])
            of_task = np.concatenate([part.tasks[mask] for part, mask in zip(parts, rows, strict=True)])
            columns = np.split(values, np.cumsum(list(widths.values()))[:-1], axis=1)
            signals = dict(zip(widths, columns, strict=True))
            task = tasks.get(int(of_task[0]))
            yield Episode(number, stamps, signals, entries, task, info.fps, (), f"episode {number}")

"""Episodes of a data set of LeRobot as they are stored, one after the other, and what is wrong with each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np

from kineme.errors import DataError
from kineme.io.lerobot.frames import Frames, contradictions, runs, shard_frames, task_texts
from kineme.io.lerobot.info import read_episodes, read_info, read_tasks, read_videos
from kineme.movements.episodes import Episode

_SHOWN = 5  # frames of an episode whose faults are named


def episodes(
    folder: Path, features: Sequence[str] | None = None, numbers: Collection[int] | None = None
) -> Iterator[Episode]:
    """Yield the episodes of a data set, with all features of numbers, or those named, and all episodes, or some.

    They come in the order of storage, a batch of rows is in memory at a time, and nothing is mended: frames that are
    missing or in another order, doubled episodes and other lengths than declared are `Episode.problems`. An episode
    whose frames cannot be read has none (T = 0). What could not be read of the meta folder comes first, as an episode
    of number -1 without frames; frames without a number belong to -1, too.

    Raises a `DataError` if meta/info.json or all of meta/episodes cannot be read, or a feature is not there.
    """
    folder = Path(folder)
    info = read_info(folder)
    names = list(info.heads) if features is None else list(dict.fromkeys(features))
    if not names or (unknown := [name for name in names if name not in info.heads]):
        there, got = ", ".join(info.heads) or "there are none", repr(unknown[0]) if names else "none"
        raise DataError(f"expected features of numbers ({there}), got {got}")
    widths = {name: len(info.heads[name]) for name in names}
    declared, (tasks, unsaid) = read_episodes(folder, info), read_tasks(folder)
    wanted = None if numbers is None else {int(number) for number in numbers}
    if wanted is not None and (absent := wanted - {*declared.numbers.tolist()}):
        raise DataError(f"expected numbers of episodes of the data set, got {min(absent)}")
    videos = read_videos(folder, info)
    entries = {name: info.heads[name] for name in names}

    def episode(frames: Frames, number: int, place: str, problems: Sequence[str], task: str | None = None) -> Episode:
        columns = np.split(frames.values, np.cumsum(list(widths.values()))[:-1], axis=1)
        signals = dict(zip(names, columns, strict=True))
        files = {camera: video.file for camera, video in videos.get(number, {}).items()}
        return Episode(number, frames.stamps, signals, entries, task, info.fps, tuple(problems), place, files)

    if wanted is None and (problems := (*declared.problems, *unsaid)):
        yield episode(_no_frames(sum(widths.values())), -1, "meta", problems)
    declared_in: dict[str, list[int]] = {}
    for number, shard in zip(declared.numbers.tolist(), declared.shards, strict=True):
        if wanted is None or number in wanted:
            declared_in.setdefault(shard, []).append(number)
    done: set[int] = set()
    for shard, expected in declared_in.items():
        broken: list[str] = []
        parts = shard_frames(folder, info, shard, widths, None if wanted is None else expected)
        for frames in runs(parts, broken):
            number = int(frames.episodes[0])
            if wanted is not None and number not in wanted:
                continue
            offsets = np.array([0, len(frames.values)], dtype=np.intp)
            reasons = [reason for reasons in contradictions(frames, offsets, declared) for reason in reasons.values()]
            reasons += [f"frame {row}: {reason}" for row, reason in list(frames.faults.items())[:_SHOWN]]
            if number in done:
                reasons.append("expected its frames in one place, got more of them behind other episodes")
            (task,) = task_texts(frames, offsets, tasks)
            done.add(number)
            # Only an episode that was cut off is touched by the damage: those before it were read.
            reasons += broken if reasons else []
            place = f"episode {number}" if number >= 0 else "frames without an episode"
            yield episode(frames, number, place, reasons, task)
        for number in expected:
            if number not in done:
                reasons = broken or [f"expected frames in {shard}, got none"]
                yield episode(_no_frames(sum(widths.values())), number, f"episode {number}", reasons)
                done.add(number)


def _no_frames(width: int) -> Frames:
    integers = np.empty(0, dtype=np.int64)
    return Frames(np.empty((0, width)), integers, integers, integers, np.empty(0), {})

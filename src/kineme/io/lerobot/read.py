"""A data set of LeRobot as movements: one for each episode, named by its task. Frames are read some rows at a time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.lerobot.episodes import (
    Frames,
    check_storage,
    contradictions,
    episodes,
    joined,
    of_several_tasks,
    shard_frames,
    task_texts,
)
from kineme.io.lerobot.info import Episodes, Info, read_episodes, read_info, read_tasks
from kineme.io.limits import check_expanded
from kineme.movements.episodes import STAMP_TOLERANCE, STATE, Episode, default_features, even_stamps, head_of, place_of
from kineme.movements.tables.columns import choose_roles, column_numbers
from kineme.movements.tables.layout import Column, Layout, Parsed, listed, no_lines
from kineme.movements.tables.table import Segments, Table, table_movements
from kineme.reporting.text import first_names
from kineme.validation import Array

_SHOWN = 5  # numbers of episodes in one message
_NUMBERS = 2**22  # of the episodes of a part, at least, unless it is the last one

_STAMP = "timestamp [s]"


def lerobot_movements(folder: Path, layout: Layout) -> Parsed:
    """Read a data set of LeRobot, version 2 or 3: ``observation.state``, or what ``columns`` names, of each episode."""
    _check_declared(layout)
    info = read_info(folder)
    check_storage(info)
    chosen = _chosen(info, layout)
    declared, (tasks, unsaid) = read_episodes(folder, info), read_tasks(folder)
    frames, unread = _all_frames(folder, info, declared, chosen.features)
    frames, offsets, wrong = whole_episodes(frames, declared, unread)
    left_out = [*declared.problems, *unsaid, *unread.values(), *wrong]
    if len(offsets) < 2:
        raise DataError(f"expected episodes in a LeRobot data set, got none that is whole; the first: {left_out[0]}")
    places = [place_of(k) for k in frames.episodes[offsets[:-1]].tolist()]
    segments = Segments(offsets, places, task_texts(frames, offsets, tasks))
    several = of_several_tasks(frames, offsets) | np.isin(frames.episodes[offsets[:-1]], [*declared.several])
    if several.any():
        of_several = [places[k] for k in np.flatnonzero(several).tolist()]
        left_out.append(
            f"{first_names(of_several, _SHOWN)}: expected one task, got several; labeled by that of most frames"
        )
    stamps = _stamps(frames, offsets, info.fps)
    parsed = _in_columns(info, layout, chosen, (stamps, frames.values), segments, frames.faults)
    return parsed._replace(left_out=tuple(left_out))


def lerobot_parts(
    folder: Path, layouts: Sequence[Layout], numbers: Collection[int] | None = None
) -> Iterator[Callable[[Layout], Parsed]]:
    """Yield parts of a data set, some whole episodes each, as functions from one of `layouts` to its movements.

    A batch of frames and one part are in memory at a time; episodes with these `numbers` are one part, unless they are
    a range. The features are those of the layouts that the data set can fill. A part whose episodes all are damaged
    says why in `Parsed.left_out`.
    """
    info = read_info(folder)
    features: dict[str, int] = {}
    for layout in layouts:
        _check_declared(layout)
        with suppress(DataError):
            features |= _chosen(info, layout).features
    if not features:
        _chosen(info, layouts[-1])  # says why
    part: list[Episode] = []
    in_parts = numbers is None or isinstance(numbers, range)
    for episode in episodes(folder, list(features), numbers):
        part.append(episode)
        if in_parts and sum(map(len, part)) * sum(features.values()) >= _NUMBERS:
            yield partial(_of_episodes, info, part)
            part = []
    if part:
        yield partial(_of_episodes, info, part)


def _of_episodes(info: Info, part: Sequence[Episode], layout: Layout) -> Parsed:
    """Return the movements of some episodes in the columns of a layout; those with problems are left out."""
    chosen = _chosen(info, layout)
    intact = [episode for episode in part if len(episode) and not episode.problems]
    left_out = [
        f"{place_of(episode.number)}: {reason}" if episode.number >= 0 else reason
        for episode in part
        for reason in episode.problems
    ]
    offsets = np.concatenate(([0], np.cumsum([len(episode) for episode in intact]))).astype(np.intp)
    values = [np.concatenate([episode.signals[name] for name in chosen.features], axis=1) for episode in intact]
    stamps = [even_stamps(episode.times, info.fps) for episode in intact]
    frames = np.concatenate([np.empty((0, sum(chosen.features.values()))), *values])
    segments = Segments(offsets, [place_of(episode.number) for episode in intact], [each.task for each in intact])
    parsed = _in_columns(info, layout, chosen, (np.concatenate([np.empty(0), *stamps]), frames), segments, {})
    return parsed._replace(left_out=tuple(left_out))


def _check_declared(layout: Layout) -> None:
    """Refuse a choice of times, movements or labels that the data set has already made otherwise."""
    named = {"label": (layout.label, ("task", "task_index")), "time": (layout.time, ("timestamp",))}
    for what, (given, names) in named.items():
        if given is not None and given not in names:
            raise DataError(f"expected {names[0]!r} as {what} of a LeRobot data set, which declares it, got {given!r}")
    if layout.keys is not None and not set(layout.keys) <= {"episode_index", "episode"}:
        raise DataError(
            f"expected 'episode_index' as movement of a LeRobot data set, got {listed(map(str, layout.keys))}"
        )


class _Chosen(NamedTuple):
    """Columns of features that are read."""

    features: dict[str, int]  # with their widths
    heads: tuple[str, ...]  # of the coordinates
    columns: list[int]  # of these among the features, side by side


def _in_columns(
    info: Info,
    layout: Layout,
    chosen: _Chosen,
    samples: tuple[Array, Array],
    segments: Segments,
    faults: dict[int, str],
) -> Parsed:
    """Return movements by stamps (T,) and features (T, d)."""
    stamps, values = samples
    columns = [stamps, *(values[:, k] for k in chosen.columns)]
    table = Table((_STAMP, *chosen.heads), columns, len(values), no_lines, faults, segments=segments, maker="LeRobot")
    plain = Layout(time=0, columns=range(1, len(columns)), skip=layout.skip)
    roles = choose_roles(table.heads, ("number",) * len(table.heads), plain)
    parsed = table_movements(table, roles, plain, f"v{info.version}")
    ignored = (*(name for name in info.heads if name not in chosen.features), *info.others)
    return parsed._replace(detected=parsed.detected._replace(ignored=ignored))


def _chosen(info: Info, layout: Layout) -> _Chosen:
    """Return the columns that a layout names, else those of the feature that is read by default."""
    if not info.heads:
        only = f"only {listed(info.others)}" if info.others else "none"
        raise DataError(f"expected features of numbers in a LeRobot data set, got {only}")
    owners = [name for name, entries in info.heads.items() for _ in entries]
    entries = [entry for entries_of_head in info.heads.values() for entry in entries_of_head]
    full = [head_of(name, entry) for name, entry in zip(owners, entries, strict=True)]
    vectors = {name: len(entries) for name, entries in info.heads.items() if entries != ("",)}
    usual = default_features({name: len(entries) for name, entries in info.heads.items()})
    name = usual[0] if len(usual) == 1 else None
    if layout.coordinates is not None:
        short = [entry if owner == name else head for owner, entry, head in zip(owners, entries, full, strict=True)]
        numbers: Sequence[int] = _numbers_of(full, short, layout.coordinates)
    elif usual:
        numbers = [k for k, owner in enumerate(owners) if owner in usual]
    else:
        got = listed(f"{name} ({width})" for name, width in (vectors or dict.fromkeys(info.heads, 1)).items())
        raise DataError(f"expected the feature {STATE!r}, got {got}; say which with columns=, in the shell --columns")
    features = {name: len(info.heads[name]) for name in dict.fromkeys(owners[k] for k in numbers)}
    starts = dict(zip(features, np.cumsum([0, *features.values()]).tolist(), strict=False))
    columns = [starts[owners[k]] + k - owners.index(owners[k]) for k in numbers]
    reference = () if layout.reference is None else layout.reference.columns
    alone = len(features) == 1 and not {full[k] for k in numbers} <= {*reference}  # else as a library names its columns
    heads = tuple(entries[k] if alone and entries[k] and not entries[k].isdecimal() else full[k] for k in numbers)
    return _Chosen(features, heads, columns)


def _numbers_of(full: Sequence[str], short: Sequence[str], columns: Sequence[Column]) -> list[int]:
    """Find columns that are called by feature and entry or, of the feature read by default, by entry alone."""
    numbers: list[int] = []
    for column in columns:
        try:
            numbers += column_numbers(full, [column])
        except DataError:
            of_entry: tuple[int, ...] = ()
            if isinstance(column, str) and not column.isdecimal():
                with suppress(DataError):
                    of_entry = column_numbers(short, [column])
            if not of_entry:
                raise
            numbers += of_entry
    return numbers


def _all_frames(
    folder: Path, info: Info, declared: Episodes, features: dict[str, int]
) -> tuple[Frames, dict[str, str]]:
    """Return the frames of all shards in the order of their episodes; shard -> why it could not be read."""
    parts: list[Frames] = []
    unread: dict[str, str] = {}
    taken, width = 0, sum(features.values())
    for shard, numbers in declared.by_shard().items():
        n_before, n_bytes = len(parts), taken
        try:
            for frames in shard_frames(folder, info, shard, features):
                parts.append(frames)
                n_bytes += 8 * (width + 4) * len(frames.values)
                check_expanded(n_bytes, f"a data set with the shard {shard}")
        except DataError as error:
            unread[shard] = f"{error}; left out {episode_names(numbers)}"
            del parts[n_before:]
            continue
        taken = n_bytes
    if not parts:
        raise DataError(
            f"expected shards that can be read, got none; the first: {next(iter(unread.values()), 'without frames')}"
        )
    return joined(parts), unread


def _stamps(frames: Frames, offsets: NDArray[np.intp], fps: float) -> Array:
    """Give seconds since the beginning of each episode: of its frames at the declared rate, else as they are stored."""
    even = frames.frames / fps
    others = np.add.reduceat(~(np.abs(frames.stamps - even) <= STAMP_TOLERANCE), offsets[:-1]) > 0
    return np.where(np.repeat(others, np.diff(offsets)), frames.stamps, even)


def whole_episodes(
    frames: Frames, declared: Episodes, unread: Collection[str]
) -> tuple[Frames, NDArray[np.intp], list[str]]:
    """Return the frames of the whole episodes, where each begins and ends, and what is wrong with the others."""
    n = len(frames.values)
    offsets = np.concatenate(([0], np.flatnonzero(np.diff(frames.episodes)) + 1, [n])).astype(np.intp)[: n + 1]
    numbers, lengths = frames.episodes[offsets[:-1]], np.diff(offsets)
    wrong: dict[int, str] = {}
    for reasons in contradictions(frames, offsets, declared):
        wrong |= reasons
    bad = np.isin(numbers, list(wrong))
    left_out = [
        f"{f'episode {k}' if k >= 0 else 'frames without an episode_index'}: {reason}"
        for k, reason in sorted(wrong.items())
    ]
    absent = set(np.setdiff1d(declared.numbers, numbers).tolist())
    places = zip(declared.numbers.tolist(), declared.shards, strict=True) if absent else ()
    left_out += [
        f"{place_of(k)}: expected frames in {shard}, got none"
        for k, shard in places
        if k in absent and shard not in unread
    ]
    left_out += [
        f"episode {after}: its frames stand behind those of episode {before}; it is read all the same"
        for before, after in pairwise(numbers[~bad].tolist())
        if after < before
    ]
    if bad.any():
        frames = _taken(frames, np.repeat(~bad, lengths))
        offsets = np.concatenate(([0], np.cumsum(lengths[~bad]))).astype(np.intp)
    return frames, offsets, left_out


def episode_names(numbers: Sequence[int]) -> str:
    """Return numbers of episodes for a message; the first and the last of many in a row."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"episodes {numbers[0]} to {numbers[-1]}"
    return f"{'episode' if len(numbers) == 1 else 'episodes'} {first_names(numbers, _SHOWN)}"


def _taken(frames: Frames, mask: NDArray[np.bool_]) -> Frames:
    """Return the kept frames; what is wrong with them keeps its rows."""
    row = np.cumsum(mask) - 1
    faults = {int(row[k]): reason for k, reason in frames.faults.items() if mask[k]}
    return Frames._make([*(column[mask] for column in frames[:5]), faults])

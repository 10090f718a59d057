"""Which episodes of a data set of LeRobot are whole: all their frames, in order, and as many as declared."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kineme.files.lerobot.episodes import Episodes
from kineme.files.lerobot.shards import Frames
from kineme.output.text import counted, first_names

_SHOWN = 5  # numbers of episodes in one message


def whole_episodes(
    frames: Frames, declared: Episodes, unread: Collection[str]
) -> tuple[Frames, NDArray[np.intp], list[str]]:
    """The frames of the whole episodes, where each begins and ends, and what is wrong with the others.

    An episode that stands behind a later one is kept, and named among the problems; those of shards that could not be
    read (`unread`) are not.
    """
    n = len(frames.values)
    offsets = np.concatenate(([0], np.flatnonzero(np.diff(frames.episodes)) + 1, [n])).astype(np.intp)[: n + 1]
    numbers, lengths = frames.episodes[offsets[:-1]], np.diff(offsets)
    wrong = _miscounted(numbers, lengths, declared) | _disordered(frames, offsets, numbers) | _divided(numbers)
    bad = np.isin(numbers, list(wrong))
    left_out = [
        f"{f'episode {k}' if k >= 0 else 'frames without an episode_index'}: {reason}"
        for k, reason in sorted(wrong.items())
    ]
    left_out += _absent(numbers, declared, unread)
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
    """Numbers of episodes for a message; the first and the last of many in a row."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"episodes {numbers[0]} to {numbers[-1]}"
    return f"{'episode' if len(numbers) == 1 else 'episodes'} {first_names(numbers, _SHOWN)}"


def _divided(numbers: NDArray[np.int64]) -> dict[int, str]:
    """Episodes whose frames stand in several places."""
    known, counts = np.unique(numbers, return_counts=True)
    several = counts > 1
    return {
        k: f"expected its frames in one place, got them in {count} places"
        for k, count in zip(known[several].tolist(), counts[several].tolist(), strict=True)
    }


def _disordered(frames: Frames, offsets: NDArray[np.intp], numbers: NDArray[np.int64]) -> dict[int, str]:
    """Episodes whose frames do not count from 0 in steps of 1."""
    expected = np.arange(len(frames.frames)) - np.repeat(offsets[:-1], np.diff(offsets))
    odd = np.flatnonzero(frames.frames != expected)
    runs, firsts = np.unique(np.searchsorted(offsets, odd, side="right") - 1, return_index=True)
    return {
        int(numbers[run]): f"expected frame {expected[k]} next, got frame {frames.frames[k]}"
        for run, k in zip(runs.tolist(), odd[firsts].tolist(), strict=True)
    }


def _miscounted(numbers: NDArray[np.int64], lengths: NDArray[np.intp], declared: Episodes) -> dict[int, str]:
    """Episodes that are not declared, or with another length."""
    where = np.searchsorted(declared.numbers, numbers).clip(max=len(declared.numbers) - 1)
    known = declared.numbers[where] == numbers
    wrong = dict.fromkeys(numbers[~known].tolist(), "expected an episode that the meta folder declares")
    odd = known & (declared.lengths[where] != lengths)
    return wrong | {
        int(numbers[i]): f"expected {counted(int(declared.lengths[where[i]]), 'frame')} as declared, got {lengths[i]}"
        for i in np.flatnonzero(odd).tolist()
    }


def _absent(found: NDArray[np.int64], declared: Episodes, unread: Collection[str]) -> list[str]:
    """Episodes without frames in shards that were read."""
    absent = set(np.setdiff1d(declared.numbers, found).tolist())
    places = zip(declared.numbers.tolist(), declared.shards, strict=True) if absent else ()
    return [
        f"episode {k}: expected frames in {shard}, got none"
        for k, shard in places
        if k in absent and shard not in unread
    ]


def _taken(frames: Frames, kept: NDArray[np.bool_]) -> Frames:
    """The kept frames; what is wrong with them keeps its rows."""
    row = np.cumsum(kept) - 1
    faults = {int(row[k]): reason for k, reason in frames.faults.items() if kept[k]}
    values, episodes, numbers, tasks, stamps, _ = frames
    return Frames(values[kept], episodes[kept], numbers[kept], tasks[kept], stamps[kept], faults)

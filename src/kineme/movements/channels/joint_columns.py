"""Which columns of a recording are joints that are numbered: j1, j2, j3 or q0, q1, q2."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kineme.movements.channels.wraps import period_of
from kineme.movements.tables.time_stamps import words_of
from kineme.validation import Array

_LETTERS = ("j", "q")  # robots count their joints so; textbooks write q for a joint's angle
_DIGITS = 3  # of a number, at most
_UNIT = re.compile(r"[\[(][^\[\]()\d]*[\])]\s*$")  # that of q[1] is a number


def find_numbered_joints(heads: Sequence[str], free: Sequence[int], columns: Array) -> set[int]:
    """Those of the columns `free` whose numbers say that they are joints.

    One alone, as q1, could be anything. Several that count from 0 or 1, each within a turn, are joints.
    """
    groups: dict[tuple[str, ...], dict[int, int]] = {}
    for k in free:
        *stem, number = words_of(_UNIT.sub("", heads[k])) or ("",)
        if number.isdecimal() and len(number) <= _DIGITS and stem and stem[-1] in _LETTERS:
            groups.setdefault(tuple(stem), {})[int(number)] = k
    return {k for group in groups.values() if _count_joints(group, columns) for k in group.values()}


def _count_joints(group: dict[int, int], columns: Array) -> bool:
    """Whether the numbers of a group, and the values in its columns, are those of joints."""
    numbers = sorted(group)
    counts = len(numbers) > 1 and numbers[0] in (0, 1) and numbers[-1] - numbers[0] == len(numbers) - 1
    return counts and all(np.isfinite(period_of(columns[:, k], None)) for k in group.values())

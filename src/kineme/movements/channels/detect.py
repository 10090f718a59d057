"""Find the channels of recordings: by what the caller says, by the heads of their columns, and by their values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, SpecificationError
from kineme.movements.channels.channel import KINDS, ORDERS, Channel, Channels
from kineme.movements.channels.coordinates import in_order, with_periods
from kineme.movements.channels.quaternion_columns import Quaternion, find_quaternions, quaternion_of, shared_name
from kineme.movements.channels.wraps import period_of, wrap_period
from kineme.movements.tables.columns import column_numbers
from kineme.movements.tables.parsed import listed
from kineme.movements.tables.time_stamps import words_of
from kineme.units import UNITS, split_head, unit_named
from kineme.validation import Array

_LETTERS = ("j", "q")  # robots count their joints so; textbooks write q for a joint's angle
_DIGITS = 3  # of a number, at most
_UNIT = re.compile(r"[\[(][^\[\]()\d]*[\])]\s*$")  # that of q[1] is a number

#: What the caller says of columns: heads separated by commas -> their kind; four of a quaternion -> its order.
Given = Mapping[str, str]

ANGLE_WORDS = frozenset(
    {
        "joint", "joints", "angle", "angles", "theta", "yaw", "pitch", "roll", "heading", "azimuth", "elevation",
        "euler", "rotation", "flexion", "abduction", "rad", "radian", "radians", "deg", "degree", "degrees",
    }
)  # fmt: skip
DISCRETE_WORDS = frozenset(
    {
        "gripper", "button", "buttons", "switch", "trigger", "flag", "contact", "mode", "grasp", "grasped",
        "open", "closed", "digital", "event", "done", "success",
        "suction", "vacuum",
    }
)  # fmt: skip
#: A column that has one of them is no angle, whatever else its head says: ``joint1_torque``, ``yaw rate``.
_OTHER_QUANTITIES = frozenset(
    {
        "velocity", "velocities", "vel", "speed", "rate", "acceleration", "accelerations", "acc", "accel", "jerk",
        "torque", "torques", "tau", "effort", "efforts", "force", "forces", "voltage", "power", "temperature", "gyro",
        "omega",
    }
)  # fmt: skip
_PER_TIME = frozenset({"s", "sec", "second", "seconds", "per"})
_LEVELS = 8  # different values of a discrete channel, at most
#: Words of heads that are units: ``x_mm``, ``yaw_deg``. Others, as in and turn, are too often something else there.
_UNIT_WORDS = {
    name: unit.symbol
    for name, unit in UNITS.items()
    if (unit.quantity == "angle" and unit.symbol in {"deg", "rad", "mrad"})
    or (unit.quantity == "length" and (name in {"mm", "cm"} or (len(name) > 5 and name.endswith("s"))))
}


#: A coordinate in meters, ``hand_x_m``; an m elsewhere is too often something else.
_IN_METERS = re.compile(r"(?:.*[\W_])?[xyz][_ ]m", re.IGNORECASE)
_UNIT_WORD = re.compile(rf"[\W_]*(?<![a-z])({'|'.join(_UNIT_WORDS)})(?![a-z])", re.IGNORECASE)


def find_channels(
    heads: Sequence[str], columns: Array, offsets: NDArray[np.intp], given: Given, units: Sequence[str] = ()
) -> Channels:
    """The channels of movements that have the same columns.

    The columns of a quaternion need not be side by side in the file; those of a channel are, see `in_order`.

    Parameters
    ----------
    heads : sequence of m str
    columns : ndarray of shape (total, m)
        All movements, one after the other.
    offsets : ndarray of shape (n + 1,)
        Where each movement begins.
    given : mapping
        Heads, separated by commas, -> their kind, or of four the order of a quaternion. What several begin with before
        a dot stands for all of them.
    units : sequence of m str, optional
        Units of the columns, empty where the file does not say; by default those in the heads.

    Raises
    ------
    SpecificationError
        A head that is not there, a kind that is none, or a quaternion whose heads are numbers, which do not say which
        one is its scalar.
    """
    kinds, orientations = _given(heads, given)
    free = [k for k in range(len(heads)) if k not in kinds and not any(k in one.columns for one in orientations)]
    orientations += find_quaternions(heads, free, columns, offsets)
    first = {min(one.columns): one for one in orientations}
    inside = {k for one in orientations for k in one.columns}
    numbered = find_numbered_joints(heads, [k for k in range(len(heads)) if k not in inside], columns)
    channels: list[Channel] = []
    for k, head in enumerate(heads):
        if k in first:
            four, order = first[k]
            name = shared_name([heads[i] for i in four])
            channels.append(Channel(name, "orientation", tuple(heads[i] for i in four), None, order))
        elif k not in inside:
            unit = (units[k] if units else "") or unit_of(head)
            kind = kinds.get(k) or _kind(head, unit, columns[:, k], offsets, k in numbered)
            channels.append(Channel(head, kind, (head,), unit))
    if all(one.kind == "discrete" for one in channels):  # then they are what moves
        return tuple(one if k in kinds else one._replace(kind="position") for k, one in enumerate(channels))
    return with_periods(tuple(channels), in_order(columns, heads, tuple(channels)))


@lru_cache(maxsize=4096)  # the recordings of a folder have the same heads
def unit_of(head: str) -> str | None:
    """The unit in the head of a column: the text in brackets that it ends in, or a word for an angle or a length."""
    _, bracketed = split_head(head)
    if bracketed is not None:
        return bracketed
    words = words_of(head)
    if _IN_METERS.fullmatch(head):
        return "m"
    return None if _PER_TIME & {*words} else next((_UNIT_WORDS[one] for one in words if one in _UNIT_WORDS), None)


def name_of(head: str) -> str:
    """The head of a column without its unit: ``x [mm]`` and ``x_mm`` are x."""
    stem, bracketed = split_head(head)
    if bracketed is not None or unit_of(head) is None:
        return stem.strip()
    if _IN_METERS.fullmatch(head):
        return head[:-2]
    return _UNIT_WORD.sub("", head).strip("_. -") or head


def _given(heads: Sequence[str], given: Given) -> tuple[dict[int, str], list[Quaternion]]:
    """Column -> kind, and the quaternions, as the caller says."""
    if not isinstance(given, Mapping):
        raise SpecificationError(f"expected kinds by heads of columns, such as {{'x': 'position'}}, got {given!r}")
    kinds: dict[int, str] = {}
    orientations: list[Quaternion] = []
    for key, kind in given.items():
        columns = _columns_named(heads, key)
        taken = {*kinds, *(k for one in orientations for k in one.columns)}
        if twice := [heads[k] for k in columns if k in taken or columns.count(k) > 1]:
            raise SpecificationError(f"expected one kind of each column, got several of {twice[0]!r}; say one")
        if kind in ORDERS and len(columns) == len(kind):
            orientations.append(quaternion_of(columns, kind))
        elif kind in KINDS and kind != "orientation":
            kinds.update(dict.fromkeys(columns, kind))
        else:
            raise SpecificationError(
                f"expected the kind of {key!r} to be one of position, angle, discrete, or for four columns of a "
                f"quaternion {' or '.join(ORDERS)}, got {kind!r}"
            )
    return kinds, orientations


def _columns_named(heads: Sequence[str], key: str) -> list[int]:
    """The columns that a key names: a head, several separated by commas, or what several begin with before a dot."""
    if key in heads:
        return [list(heads).index(key)]
    names = [name.strip() for name in key.split(",")]
    bare = [*map(name_of, heads)], [*map(name_of, names)]  # a converted column ends in another unit
    for ours, theirs in ((heads, names), bare):
        with suppress(DataError):
            return [*column_numbers(ours, theirs)]
    raise SpecificationError(f"expected the kind of a column that is read, got {key!r}; read are {listed(heads)}")


def _kind(head: str, unit: str | None, values: Array, offsets: NDArray[np.intp], is_joint: bool) -> str:
    words = set(words_of(head))
    if words & DISCRETE_WORDS and len(np.unique(values)) <= _LEVELS:
        return "discrete"
    measure = unit_named(unit or "")
    rate = "/" in (unit or "") or (words & _PER_TIME and words & set(_UNIT_WORDS))
    if rate or words & _OTHER_QUANTITIES or (measure is not None and measure.quantity != "angle"):
        return "position"
    if is_joint or words & ANGLE_WORDS or measure is not None or wrap_period(values, offsets) is not None:
        return "angle"
    return "position"


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

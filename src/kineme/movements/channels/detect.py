"""Find the channels of recordings: by what the caller says, by the heads of their columns, and by their values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import KINDS, ORDERS, Channel, Channels
from kineme.movements.channels.coordinates import with_periods
from kineme.movements.channels.wraps import wrap_period
from kineme.movements.tables.time_stamps import words_of
from kineme.validation import Array

#: What the caller says of columns: head -> kind; four heads separated by commas -> the order of a quaternion.
Given = Mapping[str, str]

ANGLE_WORDS = frozenset(
    {
        "joint", "angle", "angles", "theta", "yaw", "pitch", "roll", "heading", "azimuth", "elevation", "euler",
        "rotation", "flexion", "abduction", "rad", "radian", "radians", "deg", "degree", "degrees",
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
        "torque", "torques", "effort", "efforts", "force", "forces", "voltage", "power", "temperature", "gyro", "omega",
    }
)  # fmt: skip
_OTHER_UNITS = frozenset(
    {
        "m",
        "mm",
        "cm",
        "dm",
        "km",
        "um",
        "µm",
        "in",
        "ft",
        "px",
        "n",
        "nm",
        "n.m",
        "v",
        "mv",
        "a",
        "ma",
        "w",
        "%",
        "ticks",
    }
)
_PER_TIME = frozenset({"s", "sec", "second", "seconds", "per"})
_MOST = 0.9  # of the samples: columns w, x, y, z without another name are a quaternion if so many are of norm 1
_LEVELS = 8  # different values of a discrete channel, at most
_UNIT = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_COMPONENT = re.compile(r"(.*?)[\W_]*([wxyz])([\W_]?\d+)?", re.IGNORECASE)
_UNITS_IN_WORDS = {"deg": "deg", "degree": "deg", "degrees": "deg", "rad": "rad", "radian": "rad", "radians": "rad"}


def find_channels(
    heads: Sequence[str], columns: Array, offsets: NDArray[np.intp], given: Given, units: Sequence[str] = ()
) -> Channels:
    """The channels of movements that have the same columns.

    Parameters
    ----------
    heads : sequence of m str
    columns : ndarray of shape (total, m)
        All movements, one after the other.
    offsets : ndarray of shape (n + 1,)
        Where each movement begins.
    given : mapping
        Heads -> kind, or for four heads separated by commas the order of a quaternion.
    units : sequence of m str, optional
        Units of the columns, empty where the file does not say; by default those in the heads.

    Raises
    ------
    SpecificationError
        A head that is not there, or a kind that is none.
    """
    kinds, orientations = _given(heads, given)
    free = [k for k in range(len(heads)) if k not in kinds and not any(k in four for four, _ in orientations)]
    orientations += _orientations(heads, free, columns)
    first = {min(four): (four, order) for four, order in orientations}
    inside = {k for four, _ in orientations for k in four}
    channels: list[Channel] = []
    for k, head in enumerate(heads):
        if k in first:
            four, order = first[k]
            name = _shared([heads[i] for i in four])
            channels.append(Channel(name, "orientation", tuple(heads[i] for i in four), None, order))
        elif k not in inside:
            unit = (units[k] if units else "") or unit_of(head)
            kind = kinds.get(k) or _kind(head, unit, columns[:, k], offsets)
            channels.append(Channel(head, kind, (head,), unit))
    if all(one.kind == "discrete" for one in channels):  # then they are what moves
        return tuple(one if one.columns[0] in given else one._replace(kind="position") for one in channels)
    return with_periods(tuple(channels), columns)


def unit_of(head: str) -> str | None:
    """The unit in the head of a column: what it ends in within brackets, or a word for degrees or radians."""
    if (found := _UNIT.search(head)) and not found[1].strip().isdecimal():  # that of joint[0] is no unit
        return found[1].strip() or None
    words = words_of(head)
    return (
        None if _PER_TIME & {*words} else next((_UNITS_IN_WORDS[one] for one in words if one in _UNITS_IN_WORDS), None)
    )


def _given(heads: Sequence[str], given: Given) -> tuple[dict[int, str], list[tuple[list[int], str]]]:
    """Column -> kind, and the columns and orders of quaternions, as the caller says."""
    kinds: dict[int, str] = {}
    orientations: list[tuple[list[int], str]] = []
    for key, kind in given.items():
        names = [key] if key in heads else [name.strip() for name in key.split(",")]
        for name in names:
            if name not in heads:
                raise SpecificationError(
                    f"expected the kind of a column that is read, got {name!r}; read are {[*heads]}"
                )
        columns = [list(heads).index(name) for name in names]
        taken = {*kinds, *(k for four, _ in orientations for k in four)}
        if twice := [name for name, k in zip(names, columns, strict=True) if k in taken or names.count(name) > 1]:
            raise SpecificationError(f"expected one kind of each column, got several of {twice[0]!r}; say one")
        if kind in ORDERS and len(columns) == len(kind):
            orientations.append(_in_order_of_the_file(heads, columns, kind))
        elif kind in KINDS and kind != "orientation":
            kinds.update(dict.fromkeys(columns, kind))
        else:
            raise SpecificationError(
                f"expected the kind of {key!r} to be one of position, angle, discrete, or for four columns of a "
                f"quaternion {' or '.join(ORDERS)}, got {kind!r}"
            )
    return kinds, orientations


def _in_order_of_the_file(heads: Sequence[str], columns: list[int], order: str) -> tuple[list[int], str]:
    """The columns of a quaternion from left to right, and the order of its components there."""
    pairs = sorted(zip(columns, order, strict=True))
    four, found = [k for k, _ in pairs], "".join(part for _, part in pairs)
    if four[-1] - four[0] != len(four) - 1 or found not in ORDERS:
        raise SpecificationError(
            f"expected the columns of a quaternion side by side, in the order {' or '.join(ORDERS)}, got "
            f"{[heads[k] for k in four]} as {found}; choose the columns in such an order, in the shell with --columns"
        )
    return four, found


def _orientations(heads: Sequence[str], free: list[int], columns: Array) -> list[tuple[list[int], str]]:
    """Neighboring columns w, x, y, z of one name, in one of `ORDERS`, that are quaternions of any movement."""
    parts = {k: _COMPONENT.fullmatch(_UNIT.sub("", heads[k]).strip()) for k in free}
    found = []
    for k in free:
        four = [k, k + 1, k + 2, k + 3]
        matches = [parts.get(i) for i in four]
        if not all(matches) or len({(one[1].lower(), one[3]) for one in matches if one}) > 1:
            continue
        order = "".join(one[2].lower() for one in matches if one)
        if order in ORDERS and _quaternion_named(matches[0][1], columns[:, four]):  # type: ignore[index]
            found.append((four, order))
    return found


def _quaternion_named(stem: str, q: Array) -> bool:
    """Whether columns w, x, y, z are a quaternion: by their name, or, without one, by the norms of most samples."""
    return bool(set(words_of(stem)) & {"q", "quat", "quaternion", "orientation", "rotation", "rot"}) or bool(
        (np.abs(np.linalg.norm(q, axis=1) - 1.0) < 0.01).mean() >= _MOST
    )


def _kind(head: str, unit: str | None, values: Array, offsets: NDArray[np.intp]) -> str:
    words = set(words_of(head))
    if words & DISCRETE_WORDS and len(np.unique(values)) <= _LEVELS:
        return "discrete"
    measure = (unit or "").lower()
    rate = "/" in measure or (words & _PER_TIME and words & set(_UNITS_IN_WORDS))
    if rate or words & _OTHER_QUANTITIES or measure in _OTHER_UNITS:
        return "position"
    if words & ANGLE_WORDS or measure in ("deg", "rad", "°") or wrap_period(values, offsets) is not None:
        return "angle"
    return "position"


def _shared(heads: list[str]) -> str:
    """What the heads of a quaternion's columns share: "pose.orientation" of pose.orientation.x and so on."""
    match = _COMPONENT.fullmatch(_UNIT.sub("", heads[0]).strip())
    return ((match[1] if match else "") or "orientation") + ((match[3] or "") if match else "")

"""Find the channels of recordings: by what the caller says, by the heads of their columns, and by their values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import KINDS, ORDERS, Channel, Channels
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
_LEVELS = 8  # different values of a discrete channel, at most
_UNIT = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_COMPONENT = re.compile(r"(.*?)[\W_]*([wxyz])", re.IGNORECASE)
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
    return tuple(channels)


def unit_of(head: str) -> str | None:
    """The unit in the head of a column: what it ends in within brackets, or a word for degrees or radians."""
    if found := _UNIT.search(head):
        return found[1].strip() or None
    return next((_UNITS_IN_WORDS[word] for word in words_of(head) if word in _UNITS_IN_WORDS), None)


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
        if kind in ORDERS and len(columns) == len(kind):
            orientations.append((columns, kind))
        elif kind in KINDS and kind != "orientation":
            kinds.update(dict.fromkeys(columns, kind))
        else:
            raise SpecificationError(
                f"expected the kind of {key!r} to be one of position, angle, discrete, or for four columns of a "
                f"quaternion {' or '.join(ORDERS)}, got {kind!r}"
            )
    return kinds, orientations


def _orientations(heads: Sequence[str], free: list[int], columns: Array) -> list[tuple[list[int], str]]:
    """Neighboring columns w, x, y, z of one name, in one of `ORDERS`, that are quaternions of any movement."""
    parts = {k: _COMPONENT.fullmatch(_UNIT.sub("", heads[k]).strip()) for k in free}
    found = []
    for k in free:
        four = [k, k + 1, k + 2, k + 3]
        matches = [parts.get(i) for i in four]
        if not all(matches) or len({one[1].lower() for one in matches if one}) > 1:
            continue
        order = "".join(one[2].lower() for one in matches if one)
        if order in ORDERS and _quaternion_named(matches[0][1], columns[:, four]):  # type: ignore[index]
            found.append((four, order))
    return found


def _quaternion_named(stem: str, q: Array) -> bool:
    """Whether columns w, x, y, z are a quaternion: by their name, or, without one, by their norms."""
    return bool(set(words_of(stem)) & {"q", "quat", "quaternion", "orientation", "rotation", "rot"}) or bool(
        (np.abs(np.linalg.norm(q, axis=1) - 1.0) < 0.01).all()
    )


def _kind(head: str, unit: str | None, values: Array, offsets: NDArray[np.intp]) -> str:
    words = set(words_of(head))
    if words & DISCRETE_WORDS and len(np.unique(values)) <= _LEVELS:
        return "discrete"
    if words & ANGLE_WORDS or unit in ("deg", "rad", "°") or wrap_period(values, offsets) is not None:
        return "angle"
    return "position"


def _shared(heads: list[str]) -> str:
    """What the heads of a quaternion's columns share: "pose.orientation" of pose.orientation.x and so on."""
    match = _COMPONENT.fullmatch(_UNIT.sub("", heads[0]).strip())
    return (match[1] if match else "") or "orientation"

"""Which columns of a recording are the components of quaternions: by their heads and their norms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import ORDERS
from kineme.movements.tables.time_stamps import words_of
from kineme.validation import Array

_MOST = 0.9  # of the samples: columns w, x, y, z without another name are a quaternion if so many are of norm 1
_NORM = 0.01  # deviation of a norm from 1, at most
_NAMES = frozenset({"q", "quat", "quaternion", "quaternions", "orientation", "ori", "rotation", "rot"})
_UNIT = re.compile(r"[\[(](?![wxyz\d][\])])[^\[\]()]*[\])]\s*$", re.IGNORECASE)  # that of quat[x] is a component
_COMPONENT = re.compile(r"(.*?)[\W_]*([wxyz])[\])]?([\W_]?\d+)?", re.IGNORECASE)
_NUMBERED = re.compile(r"(.*?)[\W_]*([0-4])[\])]?")
_NUMBERINGS = ("0123", "1234")


class Quaternion(NamedTuple):
    """The columns of a quaternion, and the order of its components in them, one of `ORDERS`."""

    columns: tuple[int, ...]
    order: str


def quaternion_of(columns: Sequence[int], order: str) -> Quaternion:
    """A quaternion of columns in any order: in that of the file where it is one of `ORDERS`, else as w, x, y, z."""
    by_part = dict(zip(order, columns, strict=True))
    in_file = "".join(sorted(by_part, key=by_part.__getitem__))
    order = in_file if in_file in ORDERS else ORDERS[0]
    return Quaternion(tuple(by_part[part] for part in order), order)


def find_quaternions(
    heads: Sequence[str], free: Sequence[int], columns: Array, offsets: NDArray[np.intp]
) -> list[Quaternion]:
    """The quaternions in the columns `free`: four w, x, y, z of one name, or four that are numbered.

    Raises
    ------
    SpecificationError
        Numbered ones that may begin or end with the scalar; see `_order_of`.
    """
    found = []
    for (stem, _), parts in _groups(_COMPONENT, heads, free).items():
        if {*parts} == {*"wxyz"} and _is_quaternion(stem, columns[:, [*parts.values()]]):
            found.append(quaternion_of([*parts.values()], "".join(parts)))
    for (stem, _), parts in _groups(_NUMBERED, heads, free).items():
        four = [parts[part] for part in sorted(parts)]
        if "".join(sorted(parts)) in _NUMBERINGS and _NAMES & {*words_of(stem)} and _unit_norms(columns[:, four]):
            found.append(quaternion_of(four, _order_of([heads[k] for k in four], columns[:, four], offsets)))
    return found


def shared_name(heads: Sequence[str]) -> str:
    """What the heads of a quaternion's columns share: "pose.orientation" of pose.orientation.x and so on."""
    head = _plain(heads[0])
    match = _COMPONENT.fullmatch(head) or _NUMBERED.fullmatch(head)
    return ((match[1] if match else "") or "orientation") + ((match[3] or "") if match and match.re.groups > 2 else "")


def _groups(
    pattern: re.Pattern[str], heads: Sequence[str], free: Sequence[int]
) -> Mapping[tuple[str, str], dict[str, int]]:
    """What heads begin and end with -> their components -> the columns."""
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for k in free:
        if match := pattern.fullmatch(_plain(heads[k])):
            end = (match[3] or "") if pattern.groups > 2 else ""
            groups.setdefault((match[1].lower(), end), {})[match[2].lower()] = k
    return groups


def _plain(head: str) -> str:
    return _UNIT.sub("", head).strip()


def _is_quaternion(stem: str, q: Array) -> bool:
    """Whether columns w, x, y, z are a quaternion: by their name, or, without one, by the norms of most samples."""
    return bool(_NAMES & {*words_of(stem)}) or _unit_norms(q)


def _unit_norms(q: Array) -> bool:
    return bool((np.abs(np.linalg.norm(q, axis=1) - 1.0) < _NORM).mean() >= _MOST)


def _order_of(heads: Sequence[str], q: Array, offsets: NDArray[np.intp]) -> str:
    """The order of a numbered quaternion, whose signs change where its scalar would become negative.

    Many programs write quaternions with a scalar that is not negative. Its column then stays so on both sides of
    every change of sign, which the other end of the quaternion does not.

    Raises
    ------
    SpecificationError
        Nothing tells.
    """
    changes = (q[1:] * q[:-1]).sum(axis=1) < 0
    changes[offsets[1:-1] - 1] = False
    beside = np.concatenate((q[:-1][changes], q[1:][changes]))
    scalar_first, scalar_last = ((beside[:, k] >= 0).all() and (beside[:, k] > 0).any() for k in (0, 3))
    if scalar_first != scalar_last:
        return ORDERS[0] if scalar_first else ORDERS[1]
    names = ",".join(heads)
    raise SpecificationError(
        f"expected heads that say which part of the quaternion {names} is its scalar w, got numbers; say "
        f"kinds={{'{names}': 'wxyz'}} if it is the first, 'xyzw' if it is the last, in the shell --kind {names}=wxyz"
    )

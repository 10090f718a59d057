"""Movements in trees of arrays: groups within groups, lists, structures; what JSON, NPZ, MATLAB and HDF5 can hold.

A tree is a mapping of names to trees, a list of trees, an array, or a text. A group of arrays with times is a movement,
and so is one of arrays of one length but of several widths; other arrays are movements themselves; groups hold some.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from kineme.movements.tables.columns import LABEL_WORDS, MOVEMENT_WORDS, is_time
from kineme.movements.tables.time_stamps import words_of

_RATES = frozenset({"fps", "rate", "hz", "frequency", "sampling_rate", "sample_rate", "sampling_frequency"})
_TIMES_OF = re.compile(r"(.+)[_./-](?:t|times?|time_?stamps?)|(?:t|times?|time_?stamps?)[_./-](.+)", re.IGNORECASE)
_WIDEST = 1000  # numbers in a sample; images have more
_DEEPEST = 12  # groups within groups


class Style(NamedTuple):
    """What arrays side by side mean, and what joins the names of groups and arrays within a movement."""

    separator: str
    alike_are_columns: bool  # arrays of one length and one width: columns of one movement, or movements each


NAMES, GROUPS = Style(".", False), Style("/", True)


class Found(NamedTuple):
    """A movement in a tree: its place, its label if known, its arrays by name, empty for a bare one, and its rate."""

    place: str
    label: str | None
    entries: dict[str, Any]
    rate: float | None = None

    @property
    def length(self) -> int:
        """Number of samples: that of the times, else that which most arrays have."""
        of_times = [entry for name, entry in self.entries.items() if is_time(name) and len(entry.shape) == 1]
        counts = Counter(one.shape[0] for one in of_times[:1] or self.entries.values())
        return counts.most_common(1)[0][0]


def movements_in(tree: Any, style: Style = NAMES, place: str = "", label: str | None = None) -> Iterator[Found]:
    """The movements in a tree, in its order.

    Parameters
    ----------
    tree : Mapping, list, array or text
        An array has ``shape`` and ``dtype``, and is converted to one of NumPy only when it is needed.
    style : Style
        `NAMES` where arrays are named, `GROUPS` where they lie in groups.
    """
    if place.count("/") > _DEEPEST:
        return
    if is_array(tree):
        yield from _of_array(tree, place, label)
    elif isinstance(tree, Mapping):
        yield from _of_group(tree, style, place, label)
    elif isinstance(tree, (list, tuple)):
        for k, one in enumerate(tree):
            yield from movements_in(one, style, f"{place}/{k}" if place else str(k), label)


def is_array(tree: Any) -> bool:
    """Whether a tree is an array of numbers with at least two samples' worth of structure, or of dates."""
    return hasattr(tree, "dtype") and hasattr(tree, "shape") and len(tree.shape) > 0 and tree.dtype.kind in "biufmMO"


def _of_array(array: Any, place: str, label: str | None) -> Iterator[Found]:
    if len(array.shape) == 3:
        for k in range(array.shape[0]):
            yield Found(f"{place}/{k}" if place else str(k), label, {"": array[k]})
    elif len(array.shape) in (1, 2):
        yield Found(place, label, {"": array})


def _of_group(tree: Mapping[str, Any], style: Style, place: str, label: str | None) -> Iterator[Found]:
    label = _own_label(tree) or label
    arrays = {name: one for name, one in tree.items() if is_array(one) and one.dtype.kind != "O"}
    groups = {name: one for name, one in tree.items() if isinstance(one, (Mapping, list))}
    times = {match[1] or match[2]: one for name, one in arrays.items() if (match := _TIMES_OF.fullmatch(name))}
    own_times = all(name in times or _is_stamp_of(name, arrays) for name in arrays)
    if arrays and not own_times and (_are_columns(arrays, style) or _continues(arrays, groups)):
        entries = dict(_flat(tree, style.separator))
        yield Found(place, label, {name: one for name, one in entries.items() if _fits(one)}, _rate(tree))
        return
    for name, one in arrays.items():
        if _is_stamp_of(name, arrays):
            continue
        own = f"{place}/{name}" if place else name
        for found in _of_array(one, own, label or label_of(name)):
            stamps = {"time": times[name]} if name in times else {}
            yield found._replace(entries=stamps | found.entries, rate=_rate(tree))
    for name, one in groups.items():
        yield from movements_in(one, style, f"{place}/{name}" if place else name, label or label_of(name))


def _is_stamp_of(name: str, arrays: Mapping[str, Any]) -> bool:
    """Whether an array is the times of another one: ``wave_t`` of ``wave``."""
    match = _TIMES_OF.fullmatch(name)
    return match is not None and (match[1] or match[2]) in arrays


def _are_columns(arrays: Mapping[str, Any], style: Style) -> bool:
    """Whether arrays are the columns of one movement: with times, or of one length but not of one width."""
    if any(is_time(name) and len(one.shape) == 1 for name, one in arrays.items()):
        return True
    flat = [one.shape for one in arrays.values()]
    if len({shape[0] for shape in flat}) > 1:
        return False
    return len(set(flat)) > 1 or all(len(shape) == 1 for shape in flat) or (style.alike_are_columns and len(flat) > 1)


def _continues(arrays: Mapping[str, Any], groups: Mapping[str, Any]) -> bool:
    """Whether the groups beside arrays hold arrays of the same length: further columns of one movement."""
    lengths = {one.shape[0] for one in arrays.values()}
    inner = {one.shape[0] for group in groups.values() if isinstance(group, Mapping) for _, one in _flat(group, "/")}
    return len(lengths) == 1 and lengths <= inner


def _flat(tree: Mapping[str, Any], separator: str, depth: int = 0) -> Iterator[tuple[str, Any]]:
    for name, one in tree.items():
        if is_array(one):
            yield name, one
        elif isinstance(one, Mapping) and depth < _DEEPEST:
            yield from ((f"{name}{separator}{inner}", leaf) for inner, leaf in _flat(one, separator, depth + 1))


def _fits(array: Any) -> bool:
    """Whether an array can be coordinates: no images."""
    width = int(np.prod(array.shape[1:]))
    return 0 < width <= _WIDEST and not (len(array.shape) > 2 and array.dtype == np.uint8)


def _rate(tree: Mapping[str, Any]) -> float | None:
    for name, one in tree.items():
        if name.lower() in _RATES and np.ndim(one) == 0 and getattr(one, "dtype", np.dtype(type(one))).kind in "iuf":
            return float(one) if 0 < float(one) < float("inf") else None
    return None


def _own_label(tree: Mapping[str, Any]) -> str | None:
    for name, one in tree.items():
        if name.lower() in LABEL_WORDS | {"task"} and isinstance(one, str) and one:
            return one
    return None


def has_times(names: Iterable[str]) -> bool:
    """Whether any name means times, the times of another array, or a rate."""
    return any(is_time(name) or name.lower() in _RATES or _TIMES_OF.fullmatch(name) for name in names)


def label_of(name: str) -> str | None:
    """The label in the name of a movement; None if it only counts: ``demo_3``, ``wave_2``, ``7``."""
    words = words_of(name)
    counts = (
        not words or words[-1].isdecimal() or set(words) <= MOVEMENT_WORDS | {"data", "movements", "demos", "trials"}
    )
    return None if counts else name


def listed_shapes(entries: Mapping[str, Any], names: Sequence[str]) -> str:
    """Names of arrays with the width of each, for a message."""
    return ", ".join(f"{name} ({int(np.prod(entries[name].shape[1:]))})" for name in names)

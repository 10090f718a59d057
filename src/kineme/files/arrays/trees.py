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

#: Names of the number of samples per second, and of the seconds between two; numbers alone, (1,) or ().
RATE_NAMES = frozenset(
    {
        "fps", "rate", "hz", "frequency", "sampling_rate", "sample_rate", "sampling_frequency", "frame_rate",
        "framerate", "mocap_framerate", "mocap_frame_rate",
    }
)  # fmt: skip
STEP_NAMES = frozenset({"dt", "timestep", "time_step", "sampling_period", "frame_time"})
#: Head of the times that follow from a rate.
STAMP = "time [s]"
_TIMES_OF = re.compile(r"(.+)[_./-](?:t|times?|time_?stamps?)|(?:t|times?|time_?stamps?)[_./-](.+)", re.IGNORECASE)
_WIDEST = 1000  # numbers in a sample; images have more
_DEEPEST = 12  # groups within groups


class Style(NamedTuple):
    """What arrays side by side mean, and what joins the names of groups and arrays within a movement."""

    separator: str
    alike_are_columns: bool  # arrays of one length and one width: columns of one movement, or movements each


NAMES, GROUPS = Style(".", False), Style("/", True)


class Rate(NamedTuple):
    """How often a file says that it was sampled, and the name under which it says so."""

    name: str
    hertz: float


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
    arrays = {
        name: one for name, one in tree.items() if is_array(one) and one.dtype.kind != "O" and not _is_rate(name, tree)
    }
    groups = {name: one for name, one in tree.items() if isinstance(one, (Mapping, list))}
    times = {match[1] or match[2]: one for name, one in arrays.items() if (match := _TIMES_OF.fullmatch(name))}
    own_times = all(name in times or _is_stamp_of(name, arrays) for name in arrays)
    rate = _rate(tree)
    if arrays and not own_times and (_are_columns(arrays, style, rate) or _continues(arrays, groups)):
        entries = {inner: one for inner, one in _flat(tree, style.separator) if _fits(one)}
        yield Found(place, label, {k: one for k, one in entries.items() if not _is_rate(k, entries)}, rate)
        return
    for name, one in arrays.items():
        if _is_stamp_of(name, arrays):
            continue
        own = f"{place}/{name}" if place else name
        for found in _of_array(one, own, label or label_of(name)):
            stamps = {"time": times[name]} if name in times else {}
            yield found._replace(entries=stamps | found.entries, rate=rate)
    for name, one in groups.items():
        yield from movements_in(one, style, f"{place}/{name}" if place else name, label or label_of(name))


def _is_stamp_of(name: str, arrays: Mapping[str, Any]) -> bool:
    """Whether an array is the times of another one: ``wave_t`` of ``wave``."""
    match = _TIMES_OF.fullmatch(name)
    return match is not None and (match[1] or match[2]) in arrays


def _are_columns(arrays: Mapping[str, Any], style: Style, rate: float | None) -> bool:
    """Whether arrays are the columns of one movement: with times, or of one length but not of one width.

    Where a rate is given, most of them need to be so: the others do not change over time.
    """
    if any(is_time(name) and len(one.shape) == 1 for name, one in arrays.items()):
        return True
    flat = [one.shape for one in arrays.values()]
    lengths = Counter(shape[0] for shape in flat)
    if len(lengths) > 1:
        length, count = lengths.most_common(1)[0]
        return rate is not None and 2 * count > len(flat) and len({shape for shape in flat if shape[0] == length}) > 1
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


def rate_of(tree: Mapping[str, Any]) -> Rate | None:
    """The rate in a group; an array is read only if it has the name of one."""
    for name in tree:
        if not _is_rate(name, tree):
            continue
        value = np.asarray(tree[name])
        if value.dtype.kind in "iuf" and 0 < (number := float(value.item())) < np.inf:
            return Rate(name, 1.0 / number if name.lower() in STEP_NAMES else number)
    return None


def _is_rate(name: str, tree: Mapping[str, Any]) -> bool:
    """Whether an entry is one number with the name of a rate."""
    return name.lower() in RATE_NAMES | STEP_NAMES and np.shape(tree[name]) in ((), (1,))


def _rate(tree: Mapping[str, Any]) -> float | None:
    rate = rate_of(tree)
    return None if rate is None else rate.hertz


def _own_label(tree: Mapping[str, Any]) -> str | None:
    for name, one in tree.items():
        if name.lower() in LABEL_WORDS | {"task"} and isinstance(one, str) and one:
            return one
    return None


def has_times(names: Iterable[str]) -> bool:
    """Whether any name means times, the times of another array, or a rate."""
    return any(is_time(name) or name.lower() in RATE_NAMES | STEP_NAMES or _TIMES_OF.fullmatch(name) for name in names)


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

"""Movements in trees of arrays: groups within groups, lists, structures; what JSON, NPZ, MATLAB and HDF5 can hold.

A tree is a mapping of names to trees, a list of trees, an array, or a text. A group of arrays with times is a movement,
and so is one of arrays of one length but of several widths; other arrays are movements themselves; groups hold some.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.movements.tables.columns import LABEL_WORDS, MOVEMENT_WORDS, is_time
from kineme.movements.tables.time_stamps import PER_SECOND, TIME_UNITS, unit_by_size, words_of
from kineme.units import UNITS

_RATE_WORDS = frozenset(
    {"fps", "hz", "rate", "frequency", "freq", "fs", "sr", "sfreq", "srate", "framerate", "samplerate", "samplingrate"}
)
_STEP_WORDS = frozenset({"dt", "timestep", "interval", "period"})
_STEPS = frozenset({"time_step", "frame_time"})
_BESIDE_RATE = frozenset(
    {"sampling", "sample", "frame", "mocap", "capture", "motion", "video", "camera", "point", "data", "time", "delta"}
)
#: Head of the times that follow from a rate.
STAMP = "time [s]"
#: What to do where nothing says when samples were taken.
SAY_STEP = "; say the seconds between two samples with units=, in the shell --units"
_TIMES_OF = re.compile(r"(.+)[_./-](?:t|times?|time_?stamps?)|(?:t|times?|time_?stamps?)[_./-](.+)", re.IGNORECASE)
#: Words of names that say how a file is built, not which movement it holds.
_STRUCTURAL = frozenset(
    {
        "data", "movements", "demos", "trials", "values", "samples", "points", "frames", "inputs", "payload", "train",
        "test", "valid", "validation", "acquisition", "signal", "signals", "recordings", "table",
        "gestures", "actions", "motions", "strokes", "sequences", "episodes", "trajectories", "items", "results",
        "point", "landmark", "landmarks", "keypoints", "people", "bodies", "templates", "pos", "position", "positions",
        "xy", "xyz", "coords", "coordinates", "joints", "steps",
    }
)  # fmt: skip
_DRAWN = frozenset({"points", "point", "strokes"})
_WIDEST = 1000  # numbers in a sample; images have more
_DEEPEST = 12  # groups within groups


#: What separates names of groups and arrays within a movement. Arrays of one length and one width, side by side, are
#: columns of one movement in groups, else movements each.
NAMES, GROUPS = ".", "/"


class Rate(NamedTuple):
    """The sampling rate that a file states, and the name under which it does."""

    name: str
    hertz: float  # NaN where the file says several that differ, which are named

    def stamps(self, n: int) -> Any:
        """Return the times [s] of n samples."""
        if math.isnan(self.hertz):
            raise DataError(f"expected one rate, got {self.name}{SAY_STEP}")
        return np.arange(n) / self.hertz


@lru_cache(maxsize=4096)  # thousands of groups have the same names
def seconds_named(name: str) -> float | None:
    """Give the seconds of a unit of a step by its name, ``dt``, ``interval_ms``; 0 of a rate, None of another name."""
    words = {*words_of(name)}
    if words <= _RATE_WORDS | _BESIDE_RATE and words & _RATE_WORDS:
        return 0.0
    units = [float(UNITS[word].size) for word in words & TIME_UNITS]
    plain = words - TIME_UNITS
    is_step = plain <= _STEP_WORDS | _BESIDE_RATE and (plain & _STEP_WORDS or name.lower() in _STEPS)
    return (*units, 1.0)[0] if is_step and len(units) < 2 else None


class TreeMovement(NamedTuple):
    """A movement in a tree: its place, the label that is said, its arrays by name ("" of a bare one), and its rate."""

    place: str
    label: str | None
    entries: dict[str, Any]
    rate: Rate | None = None
    name: str | None = None  # the outermost one above it that may be a label

    @property
    def length(self) -> int:
        """Number of samples: that of the times, else that which most arrays have."""
        of_times = [entry for name, entry in self.entries.items() if is_time(name) and len(entry.shape) == 1]
        counts = Counter(entry.shape[0] for entry in of_times[:1] or self.entries.values())
        return counts.most_common(1)[0][0]


def movements_in(
    tree: Any, style: str = NAMES, place: str = "", label: str | None = None, rate: Rate | None = None
) -> Iterator[TreeMovement]:
    """Yield the movements in a tree, at the rate of the group around them where they say none."""
    if place.count("/") > _DEEPEST:
        return
    if is_array(tree):
        for movement in _of_array(tree, place, label):
            yield movement._replace(rate=rate)
    elif isinstance(tree, Mapping):
        yield from _of_group(tree, style, place, label, rate)
    elif isinstance(tree, (list, tuple)):
        for k, branch in enumerate(tree):
            yield from movements_in(branch, style, f"{place}/{k}" if place else str(k), label, rate)


def is_array(tree: Any) -> bool:
    """Tell whether a tree is an array of numbers with at least two samples' worth of structure, of dates, or texts."""
    if not (hasattr(tree, "dtype") and hasattr(tree, "shape") and len(tree.shape) > 0):
        return False
    return tree.dtype.kind in "biufmM" or (is_text(tree) and len(tree.shape) == 1)


def is_text(array: Any) -> bool:
    """Tell whether an array is of texts."""
    return array.dtype.kind in "OSU"


def _of_array(array: Any, place: str, label: str | None, labels: Sequence[str] = ()) -> Iterator[TreeMovement]:
    if len(array.shape) == 3:
        for k in range(array.shape[0]):
            yield TreeMovement(f"{place}/{k}" if place else str(k), labels[k] if labels else label, {"": array[k]})
    elif len(array.shape) in (1, 2):
        yield TreeMovement(place, label, {"": array})


def _of_group(
    tree: Mapping[str, Any], style: str, place: str, label: str | None, rate: Rate | None
) -> Iterator[TreeMovement]:
    tree = dict(tree)  # of an archive, which decodes an array whenever it is asked for
    label = _own_label(tree) or label
    labels = _labels_of_sets(tree)
    stamped = _stamps_of_sets(tree)
    aside = {name for name, _ in (*labels.values(), *stamped.values())}
    arrays = {
        name: branch
        for name, branch in tree.items()
        if is_array(branch) and not is_text(branch) and name not in aside and not _is_rate(name, tree)
    }
    groups = {
        name: branch for name, branch in tree.items() if isinstance(branch, (Mapping, list)) and name not in aside
    }
    said = {array.rate for array in arrays.values() if getattr(array, "rate", None) is not None}
    rate = rate_of(tree) or (said.pop() if len(said) == 1 else rate)
    owners = {name: match[1] or match[2] for name in arrays if (match := _TIMES_OF.fullmatch(name))}
    times = {owner: arrays[name] for name, owner in owners.items()}  # ``wave_t`` of ``wave``
    stamps = {name for name, owner in owners.items() if owner in arrays}
    own_times = all(name in times or name in stamps for name in arrays)
    plain = not own_times and not labels and not stamped
    if arrays and plain and (_are_columns(arrays, style, rate) or _continues(arrays, groups)):
        entries = {inner: entry for inner, entry in flat(tree, style) if _fits(entry)}
        yield TreeMovement(place, label, {k: entry for k, entry in entries.items() if not _is_rate(k, entries)}, rate)
        return
    for name, array in arrays.items():
        if name in stamps:
            continue
        own = f"{place}/{name}" if place else name
        for k, movement in enumerate(_of_array(array, own, label, labels.get(name, ("", ()))[1])):
            timed = {"time": times[name]} if name in times else {}
            if name in stamped:
                timed = {stamped[name][0]: stamped[name][1][k]}
            own_rate = getattr(array, "rate", None) or rate
            yield movement._replace(entries=timed | movement.entries, rate=own_rate, name=label_of(name))
    for name, array in groups.items():
        below = movements_in(array, style, f"{place}/{name}" if place else name, label, rate)
        for k, movement in enumerate(below):
            timed = {stamped[name][0]: stamped[name][1][k]} if name in stamped else {}
            own_label = labels[name][1][k] if name in labels else movement.label
            entries = timed | movement.entries
            yield movement._replace(label=own_label, entries=entries, name=label_of(name) or movement.name)


def _lengths(branch: Any) -> list[int]:
    """Return the numbers of samples in a set of movements, (n, T, d) or a list of arrays; nothing of anything else."""
    if isinstance(branch, list):
        are_arrays = all(is_array(each) and not is_text(each) and len(each.shape) <= 2 for each in branch)
        return [each.shape[0] for each in branch] if are_arrays else []
    is_set = is_array(branch) and len(branch.shape) == 3 and branch.dtype != np.uint8  # else an image
    check_expanded(8 * branch.shape[0] if is_set else 0)  # of HDF5, a set may be declared that was never written
    return [branch.shape[1]] * branch.shape[0] if is_set else []


def _stamps_of_sets(tree: Mapping[str, Any]) -> dict[str, tuple[str, list[Any]]]:
    """Give for sets of movements the array of their times, (T,) or (n, T) or a list, and the times of each movement."""
    clocks = {
        name: branch for name, branch in tree.items() if is_time(name) and (_size(branch) > 1 or _lengths(branch))
    }
    sets = {name: lengths for name, branch in tree.items() if name not in clocks and (lengths := _lengths(branch))}
    if not clocks or not sets:
        return {}
    spans = {clock.shape[0] for clock in clocks.values() if not isinstance(clock, list) and len(clock.shape) == 1}
    for name, branch in tree.items():  # whose samples those of the clock are, unless they are those of movements
        if name not in clocks and is_array(branch) and branch.shape[0] in spans - {*sets.get(name, ())}:
            return {}
    stamped = {}
    for name, lengths in sets.items():
        of_clocks = ((clock, _stamps(branch, lengths)) for clock, branch in clocks.items())
        fitting = next((each for each in of_clocks if each[1]), None)
        if fitting is not None:
            stamped[name] = fitting
        elif rate_of(tree) is None:
            clock, branch = next(iter(clocks.items()))
            got = f"a list of {len(branch)}" if isinstance(branch, list) else f"shape {branch.shape}"
            samples = f"{len(lengths)} movements of {' or '.join(map(str, sorted({*lengths})[:3]))} samples in {name!r}"
            raise DataError(f"expected times of the {samples}, got {clock!r} of {got}; save one for each sample")
    return stamped


def _size(branch: Any) -> int:
    return math.prod(branch.shape) if is_array(branch) and not is_text(branch) else 0


def _stamps(clock: Any, lengths: Sequence[int]) -> list[Any]:
    """Return the times of each movement of so many samples; nothing where they do not fit."""
    if isinstance(clock, list):
        return [np.ravel(each) for each in clock] if [*map(_size, clock)] == [*lengths] else []
    n, length = len(lengths), lengths[0]
    if {*lengths} != {length} or clock.shape not in {(length,), (1, length), (length, 1), (n, length), (length, n)}:
        return []
    times = np.asarray(clock)
    times = times.T if clock.shape == (length, n) != (n, length) else times.reshape(-1, length)
    return [*np.broadcast_to(times, (n, length))]


def _labels_of_sets(tree: Mapping[str, Any]) -> dict[str, tuple[str, list[str]]]:
    """Give for sets of movements the array that labels them, ``y`` of ``X``, ``y_train`` of ``X_train``."""
    labels = {}
    for name, branch in tree.items():
        if not (n := len(_lengths(branch))):
            continue
        ending = words_of(name)[1:]
        for other, values in tree.items():
            if not is_label(other) or words_of(other)[1:] not in {ending, ()} or _lengths(values):
                continue
            shape = np.shape(values)
            if math.prod(shape) == n == max(shape, default=0):
                texts = ["" if text is None else text for text in map(as_label, np.asarray(values).ravel().tolist())]
                labels[name] = (other, texts)
    return labels


def is_label(name: str) -> bool:
    """Tell whether an array may label movements by its name: ``y``, ``labels``, ``y_train``."""
    return {*words_of(name)[:1]} <= LABEL_WORDS | {"y"} and bool(words_of(name))


def as_label(value: Any) -> str | None:
    """Return a label as text; whole numbers without their fraction, None where there is none."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace") or None
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return None if value is None else str(value) or None


def _are_columns(arrays: Mapping[str, Any], style: str, rate: Rate | None) -> bool:
    """Tell whether arrays, or most of them beside a rate, are columns of one movement."""
    if any(is_time(name) and len(array.shape) == 1 for name, array in arrays.items()):
        return True
    flat = [array.shape for array in arrays.values()]
    lengths = Counter(shape[0] for shape in flat)
    if len(lengths) > 1:
        length, count = lengths.most_common(1)[0]
        return rate is not None and 2 * count > len(flat) and len({shape for shape in flat if shape[0] == length}) > 1
    return len(set(flat)) > 1 or all(len(shape) == 1 for shape in flat) or (style == GROUPS and len(flat) > 1)


def _continues(arrays: Mapping[str, Any], groups: Mapping[str, Any]) -> bool:
    """Tell whether the groups beside arrays hold arrays of the same length: further columns of one movement."""
    lengths = {array.shape[0] for array in arrays.values()}
    inner = {array.shape[0] for group in groups.values() if isinstance(group, Mapping) for _, array in flat(group, "/")}
    return len(lengths) == 1 and lengths <= inner


def flat(tree: Mapping[str, Any], separator: str, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield the arrays in a tree with their paths."""
    for name, branch in tree.items():
        if is_array(branch):
            yield name, branch
        elif isinstance(branch, Mapping) and depth < _DEEPEST:
            yield from ((f"{name}{separator}{inner}", leaf) for inner, leaf in flat(branch, separator, depth + 1))


def _fits(array: Any) -> bool:
    """Tell whether an array can be coordinates: no images."""
    width = int(np.prod(array.shape[1:]))
    return 0 < width <= _WIDEST and not (len(array.shape) > 2 and array.dtype == np.uint8)


def rate_of(tree: Mapping[str, Any]) -> Rate | None:
    """Find the rate in a group; only an array with such a name is read. Steps count as `unit_by_size` has it."""
    rates = []
    for name in tree:
        if not _is_rate(name, tree):
            continue
        number, seconds = _number(tree[name]), seconds_named(name)
        if number is None or not 0 < number < np.inf:
            continue
        if seconds == 1.0 and "s" not in words_of(name):
            seconds /= PER_SECOND[unit_by_size(number * np.arange(3.0))[0]]
        rates.append(Rate(name, 1.0 / (number * seconds) if seconds else number))
    if any(not math.isclose(rates[0].hertz, rate.hertz, rel_tol=1e-3) for rate in rates):
        return Rate(", ".join(f"{rate.name} ({rate.hertz:g} Hz)" for rate in rates), math.nan)
    return rates[0] if rates else None


def _number(value: Any) -> float | None:
    try:
        return float(np.asarray(value).item())
    except (TypeError, ValueError):
        return None


def _is_rate(name: str, tree: Mapping[str, Any]) -> bool:
    return seconds_named(name) is not None and np.shape(tree[name]) in ((), (1,), (1, 1))


def _own_label(tree: Mapping[str, Any]) -> str | None:
    """Return the label that a group says; beside points or strokes its name is one, as of the $1 recognizer."""
    drawn = any(name.lower() in _DRAWN and isinstance(branch, (Mapping, list)) for name, branch in tree.items())
    for name, branch in tree.items():
        if not isinstance(branch, str) or not branch:
            continue
        if name.lower() in LABEL_WORDS | {"task"}:
            return branch
        if drawn and name.lower() == "name":
            return label_of(branch)
    return None


def has_times(names: Iterable[str]) -> bool:
    """Tell whether any name means times, the times of another array, or a rate."""
    return any(is_time(name) or seconds_named(name) is not None or _TIMES_OF.fullmatch(name) for name in names)


def label_of(name: str) -> str | None:
    """Return the label in the name of a movement; None if it only counts: ``demo_3``, ``wave_2``, ``7``."""
    words = words_of(name)
    structural = set(words) <= MOVEMENT_WORDS | _STRUCTURAL or (words[:1] == ("x",) and set(words[1:]) <= _STRUCTURAL)
    return None if not words or words[-1].isdecimal() or (structural and words != ("x",)) else name

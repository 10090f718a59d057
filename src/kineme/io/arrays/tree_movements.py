"""The movements of a tree of arrays, with the roles that their columns have."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.arrays import (
    POSITIONS,
    TIMES,
    Named,
    check_first_axis,
    numbers_of,
    parsed_arrays,
    point_names,
    sets_or_points,
)
from kineme.io.arrays.trees import (
    NAMES,
    SAY_STEP,
    STAMP,
    TreeMovement,
    as_label,
    is_array,
    is_label,
    is_text,
    movements_in,
)
from kineme.io.limits import check_expanded
from kineme.io.tables.dialect import is_number
from kineme.movements.tables.columns import choose_roles, counts_samples, is_time
from kineme.movements.tables.layout import Layout, Parsed, listed, no_lines
from kineme.movements.tables.table import Segments, Table, skipping, table_movements
from kineme.movements.tables.time_stamps import seconds_of_dates, words_of
from kineme.movements.trajectories.movements import axis_names

_OF_RATE = "\0rate"  # owner of the times that follow from a rate, which no array is called
_INSTRUCTIONS = frozenset({"language_instruction", "natural_language_instruction", "instruction"})  # in each step
_POINTS = frozenset({"position", "positions", "pos", "translation", "xyz", "point"})


def tree_movements(tree: Any, layout: Layout, kind: str, style: str = NAMES, many: str = "refuse") -> Parsed:
    """Return the movements of a tree, see `kineme.io.arrays.trees`.

    Several arrays of more than one column, of which `layout` chooses none, are refused unless `many` is "take": they
    may mean different things, such as states and commands.
    """
    movements = [movement for movement in movements_in(tree, style) if movement.entries]
    if not movements:
        got = f"no entry 'positions' but {listed(tree)}" if isinstance(tree, Mapping) else "none of numbers"
        raise DataError(f"expected arrays times and positions, got {got}")
    unused = _unused_labels(tree, movements)
    movements = _of_one_array(_of_named_arrays(movements, layout), layout)
    named_alone = len(movements) == 1 and movements[0].label is None
    # Beside others x may be a label, as of letters, but not where it is the only name.
    unnamed = POSITIONS if len({movement.name for movement in movements}) == 1 else ()
    movements = [
        movement._replace(
            label=movement.label or _instruction(movement) or (None if movement.name in unnamed else movement.name)
        )
        for movement in movements
    ]
    stamped = any(len(movement.entries) > 1 or movement.rate is not None for movement in movements)
    if not stamped:
        parsed = _bare(movements, layout, kind)
        return parsed._replace(named_alone=named_alone, left_out=(*parsed.left_out, *unused))
    movements = [_with_seconds(_plainly_named(movement)) for movement in movements]
    reference = Counter(tuple(movement.entries) for movement in movements).most_common(1)[0][0]
    first = next(movement for movement in movements if tuple(movement.entries) == reference)
    names = [name for name, entry in first.entries.items() if entry.shape[0] == first.length]
    if all(map(is_time, names)):
        for name, entry in first.entries.items():
            if len(entry.shape) == 2 and first.rate is None and entry.shape[1] == first.length:
                raise DataError(
                    f"expected samples along the first axis of {name!r}, got shape {tuple(entry.shape)} beside "
                    f"{first.length} times; save {name}.T"
                )
    of_arrays = {name: heads_of_array(name, first.entries[name].shape) for name in names}
    heads = tuple(chain.from_iterable(of_arrays.values()))
    owners = tuple(name for name, several in of_arrays.items() for _ in several)
    if first.rate is not None and not any(map(is_time, names)) and not isinstance(layout.units, float | int):
        check_first_axis([movement.entries[""].shape for movement in movements if "" in movement.entries])
        layout = replace(layout, units=None)  # the rate is in Hz, whatever stamps are in
        heads, owners = (*heads, STAMP), (*owners, _OF_RATE)
    kinds = ["number" if owner == _OF_RATE else _kind(first.entries[owner]) for owner in owners]
    wide = [name for name in names if owners.count(name) > 1]
    if many == "refuse" and layout.coordinates is None and len(wide) > 1:
        shapes = ", ".join(f"{name} ({owners.count(name)})" for name in wide)
        raise DataError(
            f"expected one array of coordinates, got {shapes}; say which with columns=, in the shell --columns"
        )

    def values(k: int) -> Any:  # of the first movement
        entry = first.entries.get(owners[k])
        return None if entry is None else np.asarray(entry).reshape(first.length, -1)[:, k - owners.index(owners[k])]

    roles = choose_roles(heads, kinds, layout, values=values)
    counters = [k for k in roles.ignored if roles.time is None and counts_samples(heads[k], heads)]
    others = [roles.time, roles.nanoseconds, roles.label, *roles.clocks, *roles.apart, *counters]
    needed = {owners[k]: k in roles.positions for k in chain(roles.movement, others, roles.positions) if k is not None}
    parsed = table_movements(_table(movements, first, (heads, owners), needed), roles, layout, kind)
    static = tuple(name for name in first.entries if name not in names)
    detected = parsed.detected._replace(ignored=(*parsed.detected.ignored, *static))
    left_out = (*parsed.left_out, *unused)
    return parsed._replace(detected=detected, named_alone=named_alone and roles.label is None, left_out=left_out)


def _kind(array: Any) -> str:
    return "text" if is_text(array) else "flag" if array.dtype.kind == "b" and len(array.shape) == 1 else "number"


def _instruction(movement: TreeMovement) -> str | None:
    """Return what a robot was told, the same in each step, as RLDS has it."""
    for name, entry in movement.entries.items():
        if name.rpartition(".")[2] in _INSTRUCTIONS and is_text(entry) and len({*_texts(entry)}) == 1:
            return _texts(entry)[0] or None
    return None


def _unused_labels(tree: Any, movements: Sequence[TreeMovement]) -> list[str]:
    """Say which texts that are called labels beside movements are the labels of none."""
    used, columns = {movement.label for movement in movements}, {name for each in movements for name in each.entries}
    return [
        f"{name!r}: expected a label for each movement, got {len(texts)}, which are not used; save one for each"
        for name, texts in (tree.items() if isinstance(tree, Mapping) else ())
        if is_label(name) and len(words_of(name)) == 1 and name not in columns and is_array(texts) and is_text(texts)
        and used.isdisjoint(_texts(texts))
    ]  # fmt: skip


def _of_one_array(movements: list[TreeMovement], layout: Layout) -> list[TreeMovement]:
    """Return movements that may be the points of one, without times, as `sets_or_points` tells; others as they are."""
    names = [*movements[0].entries]
    if any([*movement.entries] != names for movement in movements) or any(map(is_time, names)):
        return movements
    # The places differ in one number alone, that counts them: frames/0/landmarks, frames/1/landmarks.
    places = [movement.place for movement in movements]
    parts = [place.split("/") for place in places]
    differing = [[*column] for column in zip(*parts, strict=False) if len({*column}) > 1]
    if (
        len({len(part) for part in parts}) != 1
        or differing != [[str(k) for k in range(len(places))]]
        or len({movement.label or movement.name for movement in movements}) > 1
    ):
        return movements
    if any(is_text(entry) or (names != [""] and len(entry.shape) > 1) for entry in movements[0].entries.values()):
        return movements
    check_expanded(8 * sum(int(np.prod(entry.shape)) for movement in movements for entry in movement.entries.values()))
    several = [[numbers_of(np.asarray(entry)) for entry in movement.entries.values()] for movement in movements]
    if any(len({len(x) for x in xs}) > 1 for xs in several):
        return movements
    x = sets_or_points([xs[0] if names == [""] else np.column_stack(xs) for xs in several], layout.every)
    if len(x) == len(movements):
        return movements
    n_points, *width = np.shape(several[0][0])
    heads = (
        point_names(n_points, *width) if names == [""] else [f"{k}.{name}" for k in range(n_points) for name in names]
    )
    return [movements[0]._replace(place="", entries=dict(zip(heads, x[0].T, strict=True)))]


def _of_named_arrays(movements: list[TreeMovement], layout: Layout) -> list[TreeMovement]:
    """Return movements that may be points under several names in each sample of one, each name by itself."""
    parts = [movement.place.split("/") for movement in movements]
    differing = [column for column in zip(*parts, strict=False) if len({*column}) > 1]
    if len({*map(len, parts)}) > 1 or len(differing) != 2 or not all(map(str.isdecimal, differing[0])):
        return movements  # not frames/0/left, frames/0/right, frames/1/left
    several: dict[str, list[TreeMovement]] = {}
    for name, movement in zip(differing[1], movements, strict=True):
        several.setdefault(name, []).append(movement)
    ones = {name: _of_one_array(group, layout) for name, group in several.items()}
    if len({*map(len, several.values())}) > 1 or any(len(one) > 1 for one in ones.values()):
        return movements
    entries = {f"{name}.{head}": x for name, (one,) in ones.items() for head, x in one.entries.items()}
    return [movements[0]._replace(place="", label=None, name=None, entries=entries)]


def _bare(movements: Sequence[TreeMovement], layout: Layout, kind: str) -> Parsed:
    if len(movements) == 1 and not isinstance(layout.units, float | int):
        raise DataError(f"expected times beside the positions, got one array alone{SAY_STEP}")
    check_expanded(
        8 * sum(int(np.prod(movement.entries[""].shape)) for movement in movements if "" in movement.entries)
    )
    xs = [numbers_of(np.asarray(next(iter(movement.entries.values())))) for movement in movements]
    xs = [x[:, None] if x.ndim == 1 else x for x in xs]
    width = Counter(x.shape[1] for x in xs).most_common(1)[0][0]
    pairs = [*zip(movements, xs, strict=True)]
    said = f"dimensions where most have {width}"
    odd = tuple(f"movement {movement.place}: {x.shape[1]} {said}" for movement, x in pairs if x.shape[1] != width)
    movements = [movement for movement, x in pairs if x.shape[1] == width]
    xs = [x for x in xs if x.shape[1] == width]
    labels = [movement.label for movement in movements]
    units = {tuple(_units_of(next(iter(movement.entries.values())), width)) for movement in movements}
    if len(units) > 1:
        raise DataError(f"expected movements in one unit, got {sorted(units)}; read them apart")
    parsed = parsed_arrays(
        xs, None, Named(labels, TIMES[0], [movement.place for movement in movements]), layout, (kind, "keyed")
    )
    measured_in = next(iter(units)) if any(next(iter(units))) and layout.coordinates is None else ()
    return parsed._replace(detected=parsed.detected._replace(measured_in=measured_in), left_out=odd)


def _plainly_named(movement: TreeMovement) -> TreeMovement:
    """Take the name from the only array of several columns that means positions: its coordinates are x, y, z."""
    wide = [name for name, entry in movement.entries.items() if len(entry.shape) > 1]
    if len(wide) == 1 and wide[0] in POSITIONS:
        return movement._replace(
            entries={"" if name == wide[0] else name: entry for name, entry in movement.entries.items()}
        )
    return movement


def _with_seconds(movement: TreeMovement) -> TreeMovement:
    """Return times that are texts, if no others are there, as the seconds, which their head then says."""
    times = [name for name in movement.entries if is_time(name)]
    if len(times) != 1 or not is_text(movement.entries[times[0]]):
        return movement
    others = {name: entry for name, entry in movement.entries.items() if name != times[0]}
    if not any(texts := _texts(movement.entries[times[0]])):  # of nulls alone
        return movement._replace(entries=others)
    seconds, odd = seconds_of_dates(texts)
    if odd:
        raise no_stamp(times[0], odd)
    return movement._replace(entries={f"{times[0]} (s)": seconds} | others)


def no_stamp(head: str, odd: Mapping[int, str]) -> DataError:
    """Return the error of texts in a column of times."""
    got = next(iter(odd.values()))
    quoted = "; write numbers without quotes" if is_number(got, False) else ""
    return DataError(f"expected dates or durations in {head!r}, got the text {got!r:.80}{quoted}")


def _texts(array: Any) -> list[str]:
    return [as_label(value) or "" for value in np.asarray(array, dtype=object).tolist()]


def heads_of_array(name: str, shape: Sequence[int]) -> list[str]:
    """Return a head for each column of an array: points by their axes, other columns by their numbers."""
    width = math.prod(shape[1:])
    ends: Sequence[Any] = range(width)
    if len(shape) == 3:
        return [f"{name}.{end}" if name else end for end in point_names(*shape[1:])]
    if not name:
        return [*axis_names(width)]
    if len(shape) == 1:
        return [name]
    if words_of(name)[-1:] and words_of(name)[-1] in _POINTS and width in (2, 3):
        ends = "xyz"[:width]
    return [f"{name}.{end}" for end in ends]


def _units_of(array: Any, width: int) -> list[str]:
    """Return the unit of each of the columns of an array, empty where it says none."""
    unit = getattr(array, "unit", None) or ""
    return [unit] * width if isinstance(unit, str) else unit if len(unit) == width else [""] * width


def _table(
    movements: Sequence[TreeMovement],
    first: TreeMovement,
    columns: tuple[Sequence[str], Sequence[str]],
    needed: Mapping[str, bool],
) -> Table:
    """Give the needed arrays, coordinates unrounded; what a movement lacks is a fault of its first row."""
    heads, owners = columns
    lengths = [movement.length for movement in movements]
    widths = Counter(owners)
    check_expanded(8 * sum(lengths) * sum(widths[name] for name in needed))
    offsets = np.concatenate(([0], np.cumsum(lengths))).astype(np.intp)
    faults: dict[int, str] = {}
    arrays: dict[str, Any] = {}
    for name, is_coordinate in needed.items():
        several = []
        of_texts = name in first.entries and is_text(first.entries[name])
        for movement, length, start in zip(movements, lengths, offsets, strict=False):
            part, fault = _part(movement, name, length, (widths[name], of_texts, not is_coordinate))
            here, there = (_units_of(each.entries.get(name), widths[name]) for each in (movement, first))
            if here != there and not fault:
                fault = f"expected {name!r} in {', '.join(there)}, as in the first movement, got {', '.join(here)}"
            several.append(part)
            if fault:
                faults[int(start)] = fault
        arrays[name] = np.concatenate(several)
    parts = {owner: iter(arrays[owner].T) for owner in arrays}
    filled = [next(parts[owner]) if owner in parts else None for owner in owners]
    segments = Segments(offsets, [movement.place for movement in movements], [movement.label for movement in movements])
    units = [unit for name in dict.fromkeys(owners) for unit in _units_of(first.entries.get(name), widths[name])]
    movement_parts = None if len(movements) == 1 and not movements[0].place and movements[0].label is None else segments
    return Table(tuple(heads), filled, int(offsets[-1]), no_lines, faults, None, units, movement_parts)


def _part(movement: TreeMovement, name: str, length: int, kind: tuple[int, bool, bool]) -> tuple[Any, str]:
    """Return an array of a movement as columns (T, d), of numbers or of texts, and what is wrong with it."""
    width, of_texts, of_time = kind
    if name == _OF_RATE:
        stamps = np.full(length, np.nan) if movement.rate is None else movement.rate.stamps(length)
        counters = [entry for name, entry in movement.entries.items() if counts_samples(name, movement.entries)]
        counted = [skipping(entry, np.array([0, length])) for entry in counters if entry.shape == (length,)]
        if (
            movement.rate is not None
            and (frames := next((each for each in counted if each is not None), None)) is not None
        ):
            stamps = frames / movement.rate.hertz
        return stamps[:, None], "" if movement.rate else "expected a rate as others have, got none"
    entry = movement.entries.get(name)
    if entry is None:
        return np.full((length, width), np.nan), f"expected an array {name!r} as others have, got none"
    if is_text(entry) and not of_texts:  # of nulls alone
        return np.full((length, width), np.nan), f"expected numbers in {name!r}, got none"
    if is_text(entry):
        return np.array([[text] for text in _texts(entry)], dtype=object), ""
    if entry.shape[0] != length or int(np.prod(entry.shape[1:])) != width:
        got = f"expected {name!r} of shape {(length, width)}, got {tuple(entry.shape)}"
        return np.full((length, width), np.nan), got
    return numbers_of(np.asarray(entry), of_time=of_time).reshape(length, width), ""


def nested(arrays: Mapping[str, Any]) -> Any:
    """Return arrays whose names hold slashes as groups within groups."""
    if not any("/" in name for name in arrays):
        return arrays
    tree: dict[str, Any] = {}
    for name in arrays:
        *groups, last = name.split("/")
        here = tree
        for group in groups:
            below = here.setdefault(group, {})
            if not isinstance(below, dict):
                raise DataError(f"expected {group!r} to be an array or a group, got both")
            here = below
        here[last] = arrays[name]
    return tree

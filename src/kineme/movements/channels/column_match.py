"""Columns of one recording beside those of another: the same by their names, whatever their order and their units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kineme.errors import DataError, TrajectoryError
from kineme.movements.channels.channel import Channels, recorded_names
from kineme.movements.channels.detect import Given, name_of, unit_of, units_filled
from kineme.movements.tables.columns import places_of
from kineme.movements.tables.layout import Block, Detected, listed
from kineme.movements.tables.time_stamps import words_of
from kineme.units import Unit, converted, unit_named
from kineme.validation import Array

#: What is converted, also over time. Percents of ranges are not: drivers take each joint in its own.
_QUANTITIES = frozenset({"length", "angle"})

#: What programs call columns that have no name, before their number.
_NAMELESS = re.compile(
    r"(x|q|c|d|v|column|col|dim|dimension|coordinate|channel|feature|value|var|unnamed)?[ _:]*\d+", re.I
)

#: A rotation of a joint about an axis, one of three whose order says which is turned first: ``Hips.Zrotation``.
_ROTATION = re.compile(r"(?P<joint>.+)\.(?P<axis>[xyz])rotation", re.I)


class Columns(NamedTuple):
    """The columns of a recording."""

    heads: tuple[str, ...]
    units: tuple[str | None, ...]  # their units as the file says them; None where it does not

    @property
    def names(self) -> tuple[str, ...]:
        """The heads in lower case without the units that they end in, or with them where two would be the same."""
        return _names_of(self.heads)

    @property
    def rotations(self) -> dict[str, str]:
        """Joint -> the axes that it turns about, one after the other: ``hips`` -> ``zxy``."""
        axes: dict[str, str] = {}
        for match in filter(None, map(_ROTATION.fullmatch, self.names)):
            axes[match["joint"]] = axes.get(match["joint"], "") + match["axis"]
        return axes

    @property
    def are_nameless(self) -> bool:
        """True if the heads only count the columns: x1, x2, x3."""
        return all(_NAMELESS.fullmatch(head.strip()) for head in self.heads)


def columns_recorded(channels: Channels) -> Columns:
    """The columns of channels."""
    return Columns(recorded_names(channels), tuple(channel.unit for channel in channels for _ in channel.columns))


def columns_detected(how: Detected) -> Columns:
    """The columns of a file or a data frame as it was read."""
    measured_in = how.measured_in or [""] * len(how.columns)
    return Columns(how.columns, tuple(a or unit_of(head) for a, head in zip(measured_in, how.columns, strict=True)))


def are_unknown(channels: Channels) -> bool:
    """Tell whether nothing is known of columns but their number: heads count them, not as joints, and say no unit."""
    kinds = {channel.unit or channel.kind for channel in channels}
    return {"position"} <= kinds <= {"position", "angle"} and columns_recorded(channels).are_nameless


def may_be(channels: Channels, others: Channels) -> bool:
    """Tell whether channels of other names may be those: x, y, z without any other name may be those of a hand."""
    names = [Columns(tuple(channel.name for channel in several), ()).names for several in (channels, others)]
    kinds = [tuple(channel.kind for channel in several) for several in (channels, others)]
    is_bare = any(all(len(words_of(name)) == 1 for name in each) for each in names)
    return any(columns_recorded(several).are_nameless for several in (channels, others)) or (
        is_bare
        and kinds[0] == kinds[1]
        and all(
            kind == "orientation" or words_of(a)[-1:] == words_of(b)[-1:]
            for kind, a, b in zip(kinds[0], *names, strict=True)
        )
    )


@lru_cache(maxsize=256)  # thousands of files have the same heads
def _names_of(heads: tuple[str, ...]) -> tuple[str, ...]:
    plain = tuple(name_of(head).lower() for head in heads)
    return plain if len({*plain}) == len(plain) else heads


def columns_like(positions: Array, ours: Columns, wanted: Columns, known_units: bool = True) -> Array:
    """Columns (total, m) by their names in the order and in the units of those that are `wanted`, of others no more.

    With `known_units`, columns without a unit beside those with one are refused; else they count as in that unit.
    """
    place = {name: k for k, name in enumerate(ours.names)}
    missing = [head for head, name in zip(wanted.heads, wanted.names, strict=True) if name not in place]
    if missing:
        raise TrajectoryError(f"expected the column {missing[0]!r}, got {', '.join(map(repr, ours.heads))}")
    turned = ours.rotations
    for joint, axes in wanted.rotations.items():
        if (other := "".join(axis for axis in turned[joint] if axis in axes)) != axes:
            raise TrajectoryError(
                f"expected the rotations of {joint!r} in the order {axes}, as the others have them, got {other}, which "
                "are other angles of the same turns; export all in one order, or read these apart"
            )
    order = [place[name] for name in wanted.names]
    result = positions if order == list(range(positions.shape[1])) else positions[:, order]
    for k, (from_k, unit) in enumerate(zip(order, wanted.units, strict=True)):
        sizes = conversion(ours.heads[from_k], ours.units[from_k], unit, known_units)
        if sizes is not None:
            result = np.array(result) if result is positions else result
            result[:, k] = converted(result[:, k], *sizes)
    return result


def numbers_by_name(heads: Sequence[str], names: Sequence[str]) -> list[int | None]:
    """The column of each name, with or without its unit, whatever that is; None where none or several have it."""
    exact, bare = places_of(heads), places_of(name_of(head).lower() for head in heads)
    same = [exact.get(name) or bare.get(name_of(name).lower(), []) for name in names]
    return [several[0] if len(several) == 1 else None for several in same]


def conversion(head: str, ours: str | None, wanted: str | None, known_units: bool) -> tuple[Unit, Unit] | None:
    """The units to convert from and to; None where they are the same, or where one is not known and need not be."""
    if (ours or "").strip().lower() == (wanted or "").strip().lower() or (None in (ours, wanted) and not known_units):
        return None
    here, there = unit_named(ours or ""), unit_named(wanted or "")
    if here is None or there is None or here.quantity != there.quantity:
        raise TrajectoryError(
            f"expected {head!r} in {wanted!r}, as the others have it, got "
            f"{f'{ours!r}, which cannot be converted' if ours else f'no unit; name the column {head} [{wanted}]'}"
            if wanted
            else f"expected {head!r} without a unit, as the others have it, got {ours!r}; say the unit in all heads"
        )
    return None if here == there else (here, there)


def with_unit(detected: Detected, block: Block, unit: str, given: Given) -> Detected:
    """Columns of which the file says no unit with this one where it fits their kind, see `units_filled`."""
    present = np.isfinite(block.positions).all(axis=1)
    rows = block.positions[present], np.append(0, np.cumsum(present))[block.offsets]
    return detected._replace(measured_in=units_filled(unit, detected.columns, *rows, given, detected.measured_in))


def in_one_unit(detected: Detected, block: Block) -> tuple[Detected, Block]:
    """Lengths in one unit and angles in one unit: that of most columns, of two equally frequent the first.

    A column that is converted is named with its new unit, ``y [mm]``; `Detected.converted` says what it was. Columns
    without a unit stay as they are.
    """
    wanted = _conversions(detected.columns, detected.measured_in)
    if not wanted:
        return detected, block
    positions, heads = np.array(block.positions), [*detected.columns]
    units = list(detected.measured_in or [""] * len(heads))
    said = []
    for k, (ours, unit) in wanted.items():
        positions[:, k] = converted(positions[:, k], ours, unit)
        said.append(f"{heads[k]}{f' [{units[k]}]' if units[k] else ''} as {name_of(heads[k])} [{unit.symbol}]")
        heads[k] = heads[k] if unit_of(heads[k]) is None else f"{name_of(heads[k])} [{unit.symbol}]"
        units[k] = unit.symbol if units[k] else ""
    names = [(name_of(head).lower(), _unit(head, unit)) for head, unit in zip(heads, units, strict=True)]
    for k in wanted:
        if names.count(names[k]) > 1:
            same = [head for head, name in zip(detected.columns, names, strict=True) if name == names[k]]
            raise DataError(
                f"expected each column once, got {listed(same)}, which are one in several units; leave all but one "
                "aside with exclude=, in the shell --exclude"
            )
    detected = detected._replace(
        columns=tuple(heads), measured_in=tuple(units) if any(units) else (), converted=(*detected.converted, *said)
    )
    return detected, replace(block, positions=positions)


@lru_cache(maxsize=256)  # thousands of files have the same heads
def _conversions(heads: Sequence[str], measured_in: Sequence[str]) -> dict[int, tuple[Unit, Unit]]:
    """Columns that are not in the unit of most -> their unit, and that of most."""
    units = [_unit(head, said) for head, said in zip(heads, measured_in or [""] * len(heads), strict=True)]
    counts: dict[str, Counter[Unit]] = {}
    for unit in units:
        if unit is not None and unit.quantity.partition("/")[0] in _QUANTITIES:
            counts.setdefault(unit.quantity, Counter())[unit] += 1
    most = {quantity: several.most_common(1)[0][0] for quantity, several in counts.items()}
    return {
        k: (unit, most[unit.quantity])
        for k, unit in enumerate(units)
        if unit is not None and most.get(unit.quantity, unit) != unit
    }


def _unit(head: str, said: str) -> Unit | None:
    """The unit of a column, as the file says it or as its head ends in it."""
    return unit_named(said or unit_of(head) or "")

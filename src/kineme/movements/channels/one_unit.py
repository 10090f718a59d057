"""Columns of one file in several units of one quantity, ``x_mm`` beside ``y_m``, in the unit of most of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from kineme.errors import DataError
from kineme.movements.channels.detect import name_of, unit_of
from kineme.movements.tables.parsed import Block, Detected, listed
from kineme.units import Unit, converted, unit_named

#: What is converted, also over time. Percents of ranges are not: drivers take each joint in its own.
_QUANTITIES = frozenset({"length", "angle"})


def in_one_unit(detected: Detected, block: Block) -> tuple[Detected, Block]:
    """Lengths in one unit and angles in one unit: that of most columns, of two equally frequent the first.

    A column that is converted is named with its new unit, ``y [mm]``; `Detected.converted` says what it was. Columns
    without a unit stay as they are.

    Raises
    ------
    DataError
        One quantity twice in two units, as ``x_mm`` and ``x_m``.
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

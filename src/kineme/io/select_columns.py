"""The coordinates of a file that are kept: those of a library, but for those that are excluded or hold nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.movements.channels.column_match import numbers_by_name
from kineme.movements.channels.detect import unit_of
from kineme.movements.tables.columns import excluded_numbers
from kineme.movements.tables.layout import Known, Layout
from kineme.movements.tables.parsed import Parsed, listed


def select_columns(parse: Callable[[Layout], Parsed], layout: Layout) -> Parsed:
    """Parse a file, and keep the columns that are asked for.

    Where nobody chooses columns, those of the movements to compare with are read, if the file has all of them; and a
    column without any value is left aside. Columns that are chosen by their numbers are those in that order, whatever
    their names.

    Raises
    ------
    DataError
        Some columns of the movements to compare with are there, others are not; or no column is left.
    """
    names = layout.known.columns if layout.known is not None and layout.coordinates is None else ()
    if names and not any(name.isdecimal() for name in names):
        try:
            return _kept(parse(replace(layout, columns=names)), layout)
        except KinemeError:
            pass  # it has other columns, which may be compared in their order
    parsed = parse(layout)
    if layout.known is not None and layout.by_number:
        return _named_as(_kept(parsed, layout), layout.known)
    heads = parsed.detected.columns
    places = numbers_by_name(heads, names)
    lost = [name for name, place in zip(names, places, strict=True) if place is None]
    if names and not lost and len(names) < len(heads):  # in other units, which their heads end in
        chosen = tuple(heads[place] for place in places if place is not None)
        return _kept(parse(replace(layout, columns=chosen)), layout)
    if 0 < len(lost) < len(names) != len(heads):
        raise DataError(
            f"expected the columns of the library, got none of {listed(lost)} but {listed(heads)}; record them too, or "
            "choose as many others with columns=, in the shell --columns"
        )
    return _kept(parsed, layout)


def _kept(parsed: Parsed, layout: Layout) -> Parsed:
    """A file without the columns that are excluded or, unless they were chosen, hold nothing."""
    detected, block = parsed.detected, parsed.block
    heads = detected.columns
    dropped = excluded_numbers(heads, layout.excluded)
    if layout.coordinates is None and len(block.positions):
        nothing = np.flatnonzero(np.isnan(block.positions[0]))
        dropped |= {*nothing[np.isnan(block.positions[:, nothing]).all(axis=0)].tolist()}
    if not dropped:
        return parsed
    kept = [k for k in range(len(heads)) if k not in dropped]
    if not kept:
        raise DataError(
            f"expected columns with numbers besides those that are excluded, got {listed(heads)}; exclude fewer"
            if layout.excluded
            else f"expected numbers in the columns {listed(heads)}, got none"
        )
    detected = detected._replace(
        columns=_at(heads, kept),
        measured_in=detected.measured_in and _at(detected.measured_in, kept),
        ignored=(*detected.ignored, *(heads[k] for k in sorted(dropped))),
    )
    return parsed._replace(detected=detected, block=replace(block, positions=block.positions[:, kept]))


def _named_as(parsed: Parsed, known: Known) -> Parsed:
    """A file with the names of as many columns of the movements to compare with, in its own units."""
    detected = parsed.detected
    names = next((heads for heads in (known.columns, known.moving) if len(heads) == len(detected.columns)), None)
    if names is None:
        return parsed
    units = detected.measured_in or tuple(unit_of(head) or "" for head in detected.columns)
    return parsed._replace(detected=detected._replace(columns=names, measured_in=units))


def _at(texts: Sequence[str], numbers: Sequence[int]) -> tuple[str, ...]:
    return tuple(texts[k] for k in numbers)

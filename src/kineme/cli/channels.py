"""Say aloud how the channels of recordings differ from those of a library."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

_NAMED = 6  # channels that a sentence names


def differences(learned: Any, asked: Any) -> list[str]:
    """A sentence for each way in which recordings that are compared with a library have other channels than it.

    Other kinds are refused elsewhere; what differs here are names, units, and whether channels are known.
    """
    from kineme.movements.channels.detect import name_of

    if learned is None or not any(one.coordinates for one in learned):
        return []
    if asked is None:
        return [
            "The recordings do not agree in the names of their columns, which are taken in their order as those of the "
            f"library: {_some([one.name for one in learned])}"
        ]
    moving = [[one for one in channels if one.coordinates] for channels in (asked, learned)]
    by_name = {name_of(one.name).lower(): one for one in moving[0]}
    if all(name_of(one.name).lower() in by_name for one in moving[1]):
        moving[0] = [by_name[name_of(one.name).lower()] for one in moving[1]]
    pairs = list(zip(*moving, strict=False))
    sentences = []
    if other := [pair for pair in pairs if name_of(pair[0].name).lower() != name_of(pair[1].name).lower()]:
        here, there = (_some([pair[k].name for pair in other]) for k in (0, 1))
        sentences.append(f"Columns are compared in their order: {here} of the recordings with {there} of the library")
    if units := [pair for pair in pairs if None not in (pair[0].unit, pair[1].unit) and pair[0].unit != pair[1].unit]:
        here, there = (_some([f"{pair[k].name} in {pair[k].unit}" for pair in units]) for k in (0, 1))
        sentences.append(f"Units are converted: {here} in the recordings, {there} in the library")
    if silent := [pair[0].name for pair in pairs if pair[0].unit is None and pair[1].unit is not None]:
        sentences.append(
            f"The recordings do not say the unit of {_some(silent)}, which is taken for that of the library"
        )
    return sentences


def _some(names: Sequence[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")

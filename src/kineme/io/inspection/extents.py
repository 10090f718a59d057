"""How far coordinates reach, and a note on columns beside which the others hardly count in what is learned."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.text import first_names
from kineme.validation import Array

_MORE = 10.0  # times the extent of all others
_LARGER = 30.0  # times the extent of the smallest movement of a label: a degree and a radian are 57 apart
_NAMED = 6  # columns that the sentence names
_END = re.compile(r"[\W\d_]*([\[(][^\[\]()]*[\])]\s*)?$")  # number and unit


def extents_of(demos: Demonstrations) -> Array:
    """The sides (n, d) of the box around each movement."""
    x, starts = demos.positions, demos.offsets[:-1]
    return np.asarray(np.maximum.reduceat(x, starts, axis=0) - np.minimum.reduceat(x, starts, axis=0))


def notes_on_extents(demos: Demonstrations) -> list[str]:
    """A sentence if some columns reach much further than all others, as a gripper in mm beside joints in radians.

    Columns that belong together are one group: one axis or one joint may move alone. Rotations are left aside, they
    are brought to the size of positions.
    """
    greatest = extents_of(demos).max(axis=0, initial=0.0)
    groups: dict[str, dict[str, float]] = {}
    at = 0
    for one in demos.channels or ():
        if one.kind in ("position", "angle"):
            groups.setdefault(_group(one), {})[one.name] = float(greatest[at])
        at += len(one.coordinates)
    if len(groups) < 2:
        return []
    *_, second, widest = sorted(groups.values(), key=lambda group: max(group.values()))
    here, there = max(widest.values()), max(second.values())
    return [_note([*widest], here, there)] if there > 0 and here >= _MORE * there else []


def notes_on_sizes(demos: Demonstrations) -> list[str]:
    """A sentence if movements of one label differ in size as millimeters and meters do, whose unit no file says."""
    extents = extents_of(demos).max(axis=1, initial=0.0)
    labels = np.full(len(demos), None) if demos.labels is None else demos.labels
    for label in dict.fromkeys(labels.tolist()):
        chosen = np.flatnonzero((labels == label) & (extents > 0.0))
        if not len(chosen):
            continue
        small, large = (int(chosen[k]) for k in (extents[chosen].argmin(), extents[chosen].argmax()))
        if extents[large] >= _LARGER * extents[small]:
            of_label = "" if label is None else f" of {label}"
            names = demos.names or [f"movement {k}" for k in range(len(demos))]
            return [
                f"movements{of_label} extend from {extents[small]:.3g}, {names[small]}, to {extents[large]:.3g}, "
                f"{names[large]}; if these are two units, as of mm and m or degrees and radians, say them in the heads"
            ]
    return []


def _group(one: Channel) -> str:
    """The same of columns that count in one unit: it is known, or their names are those of axes or joints."""
    if one.unit or one.kind == "angle":
        return one.unit or "an angle"
    stem = _END.sub("", one.name).lower()
    return "an axis" if stem.endswith(("x", "y", "z")) else stem


def _note(names: Sequence[str], here: float, there: float) -> str:
    spans, steps = ("spans", f", or say --kind {names[0]}=discrete") if len(names) == 1 else ("span", "")
    return (
        f"{first_names(names, _NAMED)} {spans} up to {here:.3g}, the other columns up to {there:.3g}, which hardly "
        f"count in what is learned: bring all to similar sizes, or choose some with --columns{steps}"
    )

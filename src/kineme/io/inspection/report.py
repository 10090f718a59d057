"""An inspection as text for people, and as plain data for programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kineme.io.inspection.inspect import Inspection, LabelSummary, Range
from kineme.io.problem import Problem
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.channels.coordinates import lever_of
from kineme.movements.tables.parsed import Detected
from kineme.reporting.table import Table, to_text
from kineme.reporting.text import counted, first_names, printable

_SHOWN = 20  # lines of a list; the rest is counted
_COLUMNS, _CHANNELS, _FILES = 24, 12, 3  # names in a line


def as_data(inspection: Inspection) -> dict[str, Any]:
    """Nested lists and dictionaries; units as the fields of `Inspection` and `LabelSummary` say."""
    return {
        "movements": inspection.movements,
        "files": inspection.files,
        "dimensions": inspection.dimensions,
        "labels": [
            {name: value._asdict() if isinstance(value, Range) else value for name, value in one._asdict().items()}
            for one in inspection.labels
        ],
        "detected": [{**how._asdict(), "files": n} for how, n in inspection.detected],
        "channels": [one._asdict() for one in inspection.channels or ()],
        "duplicates": [list(group) for group in inspection.duplicates],
        "problems": [{"file": one.file, "line": one.line, "reason": one.reason} for one in inspection.problems],
        "notes": list(inspection.notes),
    }


def as_words(inspection: Inspection) -> str:
    """A table of labels, how files were read, duplicates, and what could not be read."""
    rows = [_row(one) for one in inspection.labels]
    title = (
        f"{counted(inspection.movements, 'movement')} of {counted(inspection.dimensions, 'dimension')} "
        f"in {counted(inspection.files, 'file')}"
    )
    heads = ("label", "movements", "samples", "duration [s]", "rate [Hz]", "jitter", "gaps", "extent")
    parts = [to_text(Table(title, heads, rows))]
    parts += _listed("read as", [f"{_understood(how)} ({counted(n, 'file')})" for how, n in inspection.detected])
    channels = inspection.channels or ()
    parts += _listed("kinds", _kinds(channels))
    parts += _listed("the same movement more than once", [" = ".join(group) for group in inspection.duplicates])
    parts += _listed("not read", _once([one for one in inspection.problems if not one.samples]))
    parts += _listed("read but for samples", _once([one for one in inspection.problems if one.samples]))
    parts += _listed("note", list(inspection.notes))
    return "\n\n".join(parts)


def _listed(head: str, lines: list[str]) -> list[str]:
    if not lines:
        return []
    more = [f"  and {len(lines) - _SHOWN} more"] if len(lines) > _SHOWN else []
    return ["\n".join([f"{head}:", *(f"  {printable(line)}" for line in lines[:_SHOWN]), *more])]


def _once(problems: Sequence[Problem]) -> list[str]:
    """A line for each reason, with the files that share it."""
    files: dict[str, dict[str, None]] = {}
    for problem in problems:
        files.setdefault(problem.what, {})[problem.file] = None
    return [
        f"{first_names([*names], _FILES)}{', ' if what.startswith('line ') else ': '}{what}"
        for what, names in files.items()
    ]


def _row(one: LabelSummary) -> tuple[str, ...]:
    gaps = f"{one.gaps} (to {one.longest_gap:.3g} s)" if one.gaps else "-"
    jitter = f"{100 * one.jitter:.2g} %" if one.jitter >= 1e-6 else "-"
    ranges = [_range(values) for values in (one.samples, one.duration, one.rate)]
    label = "(no label)" if one.label is None else printable(one.label)
    return (label, f"{one.movements}", *ranges, jitter, gaps, _range(one.extent))


def _range(values: Range) -> str:
    """The median alone if minimum and maximum are equal, else all three."""
    least, median, greatest = (f"{value:.4g}" if value < 1e6 else f"{value:.3g}" for value in values)
    return median if least == greatest else f"{median} ({least} to {greatest})"


def _kinds(channels: Channels) -> list[str]:
    """A line for each channel that is no position; of many, a line for each kind."""
    lever = lever_of(channels)
    others = [(one, _kind(one, lever)) for one in channels if one.kind != "position"]
    if len(others) <= _CHANNELS:
        return [f"{', '.join(one.columns)}: {kind}" for one, kind in others]
    names: dict[str, list[str]] = {}
    for one, kind in others:
        names.setdefault(kind, []).append(one.name)
    return [f"{first_names(alike, _CHANNELS)}: {kind}" for kind, alike in names.items()]


def _kind(channel: Channel, lever: float) -> str:
    what = {
        "angle": f"angle{f' in {channel.unit}' if channel.unit else ''}; wraps are taken away",
        "orientation": f"orientation, a quaternion {', '.join(channel.order)}; learned as its integrated rotation"
        + ("" if lever == 1 else f", a radian as {lever:g}"),
        "discrete": "discrete; kept as it is, not learned",
    }
    return what[channel.kind]


def _understood(how: Detected) -> str:
    times = "no times" if how.time is None else f"time {how.time!r} in {how.units} ({how.units_from})"
    parts = [f"{how.format}, {how.layout}: {times}", f"coordinates {_coordinates(how)}"]
    for what, columns in (
        ("movement", [one for one in how.movement if one not in how.person]),
        ("label", how.label),
        ("person", how.person),
        ("left aside", how.ignored),
    ):
        if named := [column for column in columns if column]:
            parts.append(f"{what} {first_names(named, _COLUMNS)}")
    return "; ".join(parts)


def _coordinates(how: Detected) -> str:
    """The coordinates with their units, once if they have the same."""
    known = set(how.measured_in)
    if len(known) == 1:
        return f"{first_names(how.columns, _COLUMNS)} in {known.pop()}"
    named = zip(how.columns, how.measured_in or [""] * len(how.columns), strict=True)
    return first_names([f"{name} [{unit}]" if unit else name for name, unit in named], _COLUMNS)

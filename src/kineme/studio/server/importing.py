"""Tables that do not say how they are read: their first rows, guesses at their columns, the command of the shell."""

from __future__ import annotations

import shlex
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.reading.formats import FORMATS
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.recordings import read_recordings
from kineme.io.tables.dialect import detect_dialect, numbers_in, split
from kineme.io.tables.text_table import export_head, lines_of
from kineme.movements.channels.channel import recorded_names
from kineme.movements.channels.detect import unit_of
from kineme.movements.tables.columns import choose_roles, counts_samples, is_time
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.time_stamps import unit_by_size, unit_in_head
from kineme.movements.trajectories.movements import axis_names
from kineme.validation import MIN_SAMPLES, Array

_BYTES = 2**16  # of a file, from which its table is guessed
_SAMPLES = 200  # from which columns are guessed
_ROWS = 6  # that are shown
_CELL = 24  # letters of a cell
_RATE = 100.0  # samples a second, where nothing says it
_USUAL = (2.0, 4000.0)  # samples a second: other rates are most likely of another unit of time
_EVEN = 3.0  # by how much the steps of times may differ

NO_TIME = "Nothing in this file says when each sample was taken."
_NO_NAMES = "The columns of this file have no names."


def table_preview(path: Path) -> dict[str, Any] | None:
    """Return the first rows of a table of text and guesses at how it is read; None of others, or without samples."""
    form = FORMATS.get(path.suffix.lower())
    if form is None or not form.has_lines:
        return None
    with path.open("rb") as file:
        data = file.read(_BYTES)
    end = data.rfind(b"\n") + 1
    end += end % 2 * (data[:2] in {b"\xff\xfe", b"\xfe\xff"})  # two bytes a letter, as spreadsheets export it
    data = data[:end] or data
    lines = list(lines_of(data))
    if export_head(lines, len(data)) is not None:
        return None
    dialect = detect_dialect(lines)
    heads, kinds = dialect.heads, dialect.kinds
    cells = [split(line, dialect.separator) for line in lines[dialect.first :] if dialect.is_sample(line)]
    samples = [row for row in cells[:_SAMPLES] if len(row) == len(heads)]
    numbers = [k for k, kind in enumerate(kinds) if kind == "number"]
    if len(samples) < MIN_SAMPLES or not numbers:
        return None
    columns = {k: numbers_in([row[k] for row in samples], dialect.decimal_comma) for k in numbers}
    counters = {k for k in numbers if counts_samples(heads[k], heads) or (np.diff(columns[k]) == 1).all()}
    time, positions = None, [k for k in numbers if k not in counters]
    with suppress(DataError):
        roles = choose_roles(heads, kinds, Layout(), dialect.named, columns.get)
        if dialect.named:
            time, positions = roles.time, list(roles.positions)
    if time is None:
        time = next((k for k in numbers if k not in counters and _runs(columns[k])), None)
    units = None
    if time is not None and kinds[time] == "number":
        units = unit_in_head(heads[time])
        with suppress(DataError):
            units = units or unit_by_size(columns[time], heads[time])[0]
    chosen = [heads[k] for k in positions if k != time]
    measured = {dialect.measured_in[k] if dialect.measured_in else unit_of(heads[k]) or "" for k in positions}
    return {
        "heads": list(heads),
        "rows": [[cell[:_CELL] for cell in row] for row in samples[:_ROWS]],
        "numbers": [kind != "text" for kind in kinds],
        "time": None if time is None else heads[time],
        "units": units,
        "rate": _RATE,
        "columns": chosen,
        "measured_in": ", ".join(sorted(measured - {""})) or None,
        "named": dialect.named,
    }


def array_preview(path: Path) -> dict[str, Any] | None:
    """Return the same of a file of arrays that lacks nothing but the times of its samples; None of any other."""
    with suppress(KinemeError):
        read = read_recordings(path, units=1 / _RATE)
        heads = columns_of(read)
        return {
            **{"heads": heads, "columns": heads, "numbers": [True] * len(heads), "named": None},
            "rows": [[f"{value:.6g}" for value in row] for row in read.demonstrations.recorded[:_ROWS]],
            **{"time": None, "units": None, "rate": _RATE, "measured_in": None},
        }
    return None


def columns_of(read: Recordings) -> list[str]:
    """Return the names of the columns, as they were recorded."""
    demos = read.demonstrations
    return list(axis_names(demos.n_dims) if demos.channels is None else recorded_names(demos.channels))


def _runs(values: Array) -> bool:
    """Tell whether numbers grow as times do: always, and in steps of about one size."""
    steps = np.diff(values)
    return bool((steps > 0).all() and steps.max() <= _EVEN * np.median(steps))


def unclear(preview: dict[str, Any] | None, read: Recordings | str) -> str:
    """Say what is not clear about a table that was read or refused with some words; empty where all is."""
    if preview is None:
        return ""
    if preview["named"] is False:
        return _NO_NAMES
    if isinstance(read, str):
        return read.split("; ")[0] + "." if any(map(is_time, preview["heads"])) else NO_TIME
    rates = (np.diff(read.demonstrations.offsets) - 1) / read.demonstrations.durations
    strange = [rate for rate in rates if not _USUAL[0] <= rate <= _USUAL[1]]
    return f"It would have {strange[0]:.3g} samples a second. Is the unit of time right?" if strange else ""


def reader_options(preview: dict[str, Any], choice: dict[str, Any]) -> dict[str, Any]:
    """Return options of `read_recordings` for a file, of choices that are named as the guesses."""
    is_all = preview["named"] is None and choice["columns"] == preview["columns"]
    options: dict[str, Any] = {} if is_all else {"columns": choice["columns"]}
    if choice["time"] is None:
        options["units"] = 1 / (choice["rate"] or _RATE)
        if preview["named"] and (others := [head for head in preview["heads"] if is_time(head)]):
            options["exclude"] = others
        choice = choice | {"time": None, "units": None}
    return options | {name: choice[name] for name in ("time", "units", "measured_in") if choice[name] is not None}


def command(file: str, library: str, options: dict[str, Any]) -> str:
    """Return the command of the shell that finds movements in a file that is read with some options."""
    flags = [
        part
        for name, value in options.items()
        for part in (f"--{name.replace('_', '-')}", ",".join(value) if isinstance(value, list) else f"{value}")
    ]
    return shlex.join(["kineme", "annotate", file, "--library", library, *flags])

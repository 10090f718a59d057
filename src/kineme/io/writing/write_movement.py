"""Write one generated movement to a file: CSV, NPZ, JSON, Parquet; name the files of several."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import DataError, TrajectoryError
from kineme.io.arrays.arrays import COLUMNS, RATES
from kineme.io.records import needs
from kineme.movements.channels.channel import Channels, learned_names, recorded_names
from kineme.movements.segmentation.segment import as_recording
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.presented import with_units
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.reporting.atomic import write_atomically
from kineme.reporting.text import as_cell
from kineme.units import split_head
from kineme.validation import Array, as_numbers, as_path

#: A movement by the path of its recording, and its place in it; see `kineme.io.reading.merge_files.Source`.
Movement = tuple[str, str]

_DERIVATIVES = ("velocities", "accelerations")
_NAMES = ("times", "positions", *_DERIVATIVES)

Columns = dict[str, Array]  # times (T,), positions (T, d), velocities and accelerations (T, e)


class ColumnNames(NamedTuple):
    """Names of the columns of positions, and of those of velocities and accelerations."""

    positions: tuple[str, ...]
    rates: tuple[str, ...]


def encode_movement(columns: Columns, ending: str, names: ColumnNames | None = None) -> bytes:
    """Give the bytes of a file with that ending; see `WRITERS`. Without names the columns are x, y, z or x1, x2, ..."""
    if ending not in WRITERS:
        raise DataError(f"expected a file ending in one of {', '.join(WRITERS)}, got {ending or 'none'!r}")
    return WRITERS[ending](columns, names)


def write_movement(path: str | Path, movement: MovementsLike | Columns, names: ColumnNames | None = None) -> Path:
    """Write one movement to a CSV, NPZ, JSON or Parquet file, whole or not at all.

    Parameters
    ----------
    path : str or Path
        Its ending names the format.
    movement : MovementsLike or dict
        One movement, in any way that `Demonstrations.of` takes it; of a rollout velocities and accelerations are
        written too. Or a dict of ``times`` (T,), ``positions`` and, if you like, ``velocities`` and ``accelerations``
        (T, d).
    names : ColumnNames, optional
        Of the columns of a dict. Movements with `channels` are written under their names, as they were recorded.

    Returns
    -------
    Path
        Where it was written; `read_recording` reads it.

    Raises
    ------
    DataError
        An ending that no writer has, a file that cannot be written, or Parquet without the extra ``parquet``.
    TrajectoryError
        Several movements, or what is none; a dict without times or positions, or with arrays that do not fit them.
    TypeError
        A path that is none, as where the arguments are in the other order.
    """
    path = as_path(path, "the path of a file to write", "write write_movement(path, movement)")
    columns, names = (_checked(movement, names), names) if isinstance(movement, dict) else columns_of(movement)
    return write_atomically(path, encode_movement(columns, path.suffix.lower(), names))


def _checked(columns: Mapping[str, ArrayLike], names: ColumnNames | None) -> Columns:
    if not set(_NAMES[:2]) <= set(columns) <= set(_NAMES):
        raise TrajectoryError(
            f"expected a dict of {', '.join(_NAMES[:2])} and, if you like, {', '.join(_DERIVATIVES)}, got "
            f"{list(columns)}"
        )
    arrays = {name: as_numbers(values, name) for name, values in columns.items()}
    shape = arrays["positions"].shape
    for name, array in arrays.items():
        expected = shape[:1] if name == "times" else shape
        if name in _DERIVATIVES and names is not None:
            expected = (*shape[:1], len(names.rates))
        if len(shape) != 2 or array.shape != expected or (names is not None and len(names.positions) != shape[1]):
            raise TrajectoryError(
                f"expected times of shape (T,) and the others of shape (T, d), got {name} of shape {array.shape} with "
                f"positions of shape {shape}" + ("" if names is None else f" and {names}")
            )
    return arrays


def columns_of(movement: MovementsLike) -> tuple[Columns, ColumnNames | None]:
    """Return the columns of one movement as it was recorded, and their names where it has such."""
    trajectory = as_recording(movement)
    derivatives = {name: np.asarray(getattr(movement, name)[0]) for name in _DERIVATIVES if hasattr(movement, name)}
    rates: Any = getattr(movement, "rate_names", None)  # of rollouts
    if trajectory.channels is not None:
        named = names_of(trajectory.channels, rates)
        return {"times": trajectory.times, "positions": trajectory.recorded, **derivatives}, named
    of_rollout = None if rates is None else ColumnNames(tuple(getattr(movement, "axis_names", ())), tuple(rates))
    return {"times": trajectory.times, "positions": trajectory.positions, **derivatives}, of_rollout


def names_of(channels: Channels, rates: Sequence[str] | None = None) -> ColumnNames:
    """Name the columns of channels and, by default in their order, those of their rates, with the units of both."""
    names = recorded_names(channels), tuple(rates or learned_names(channels))
    return ColumnNames(*(with_units(several, channels) for several in names))


def _heads(columns: Columns, names: ColumnNames | None) -> list[str]:
    """Name the columns of a table: time, the positions, ``v_`` and ``a_`` before names of the others."""
    axes = {name: axis_names(array.shape[-1]) for name, array in columns.items()}
    if names is not None:
        axes |= {"positions": list(names.positions), **{name: list(names.rates) for name in _DERIVATIVES}}
    marks = {"positions": ("", ""), "velocities": ("v_", "/s"), "accelerations": ("a_", "/s^2")}
    heads = ["time"]
    for name in (name for name in columns if name != "times"):
        prefix, per = marks[name]
        for head in axes[name]:
            bare, unit = split_head(head)  # the unit of a rate, if the head says one, is that per second
            heads.append(f"{prefix}{head}" if unit is None or not per else f"{prefix}{bare} [{unit}{per}]")
    return heads


def _table(columns: Columns) -> Array:
    return np.column_stack([columns["times"], *(columns[name] for name in columns if name != "times")])


def _csv(columns: Columns, names: ColumnNames | None) -> bytes:
    table = _table(columns)
    lines = [",".join(map(_cell, _heads(columns, names))), *(",".join(map(repr, row)) for row in table.tolist())]
    return ("\n".join(lines) + "\n").encode()


def _cell(text: str) -> str:
    """Return a head of CSV, quoted where it must be; a line is a sample, so that no head has line breaks."""
    text = as_cell(" ".join(text.splitlines()))
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"') else text


def _npz(columns: Columns, names: ColumnNames | None) -> bytes:
    buffer = io.BytesIO()
    named = {} if names is None else {COLUMNS: np.array(names.positions), RATES: np.array(names.rates)}
    np.savez(buffer, allow_pickle=False, **columns, **named)
    return buffer.getvalue()


def _json(columns: Columns, names: ColumnNames | None) -> bytes:
    named = {} if names is None else {COLUMNS: [*names.positions], RATES: [*names.rates]}
    return (json.dumps({**{name: values.tolist() for name, values in columns.items()}, **named}) + "\n").encode()


def _parquet(columns: Columns, names: ColumnNames | None) -> bytes:
    with needs("pyarrow", "write Parquet", "parquet"):
        import pyarrow as pa
        from pyarrow import parquet
    buffer = io.BytesIO()
    arrays = [np.ascontiguousarray(column) for column in _table(columns).T]
    parquet.write_table(pa.Table.from_arrays([*map(pa.array, arrays)], names=_heads(columns, names)), buffer)
    return buffer.getvalue()


#: File extension -> encoder. All of them keep every bit of the numbers.
WRITERS: dict[str, Callable[[Columns, ColumnNames | None], bytes]] = {
    ".csv": _csv, ".npz": _npz, ".json": _json, ".parquet": _parquet
}  # fmt: skip


def distinct_stems(movements: Sequence[Movement]) -> list[str]:
    """Give a name for each movement, as ``long`` or ``session-3``, never a path; none twice, whatever the case."""
    stems: list[str] = []
    taken: set[str] = set()
    for recording, place in movements:
        path = PurePosixPath(recording)
        parts = [*(part for part in path.parts[:-1] if part not in {"/", "..", "."}), path.stem, place]
        stem = "-".join(re.sub(r"[^\w.-]", "_", part) for part in parts if part).strip(".") or "recording"
        name, k = stem, 1
        while name.lower() in taken:
            k += 1
            name = f"{stem}-{k}"
        taken.add(name.lower())
        stems.append(name)
    return stems

"""Reading one recorded movement from a file: CSV and relatives, NPZ, JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.trajectories.trajectory import Trajectory
from kineme.validation import Array

#: Column names that hold time, in lower case and without a unit in brackets.
TIME_NAMES = ("t", "time", "times", "timestamp", "stamp", "sec", "secs", "seconds", "time_s", "time_sec", "t_s")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.IGNORECASE)


def read_recording(path: str | Path) -> Trajectory:
    """Read one movement.

    - ``.csv``, ``.tsv``, ``.txt``: a sample per line, separated by comma, semicolon, tab or blanks. With a header, the
      column named as in `TIME_NAMES` holds the time [s]; without a header, the first column does. Lines that
      begin with ``#`` are skipped.
    - ``.npz``: arrays ``times`` (T,) and ``positions`` (T, d).
    - ``.json``: an object with lists ``times`` and ``positions``.

    Raises
    ------
    DataError
        The file is not what its name says; the message names the line.
    FileNotFoundError
        There is no such file.
    TrajectoryError
        The numbers are no movement, see `Trajectory`.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise DataError(f"expected {path} to end in one of {', '.join(READERS)}, got {path.suffix or 'no ending'!r}")
    try:
        times, positions = reader(path)
    except (OSError, KinemeError):
        raise
    except (ValueError, KeyError, TypeError, EOFError) as error:
        raise DataError(f"expected {path} to hold times and positions, got {_reason(error)}") from error
    return Trajectory(times, positions, name=path.name)


def _reason(error: Exception) -> str:
    return f"no entry {error}" if isinstance(error, KeyError) else str(error)


def _read_table(path: Path) -> tuple[Array, Array]:
    text = path.read_text(encoding="utf-8-sig", errors="strict")
    lines = [(k + 1, line.strip()) for k, line in enumerate(text.splitlines())]
    lines = [(k, line) for k, line in lines if line and not line.startswith("#")]
    if not lines:
        raise DataError(f"expected samples in {path}, got an empty file")
    separator = next((mark for mark in (",", ";", "\t") if mark in lines[0][1]), None)
    heads = _split(lines[0][1], separator)
    named = not all(_NUMBER.fullmatch(cell) for cell in heads)
    rows = [_numbers(path, number, _split(line, separator), len(heads)) for number, line in lines[named:]]
    table = np.array(rows, dtype=np.float64).reshape(len(rows), len(heads))
    time = _time_column(path, heads) if named else 0
    if table.shape[1] < 2:
        raise DataError(f"expected a column of times and at least one of positions in {path}, got one column")
    return table[:, time], np.delete(table, time, axis=1)


def _split(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _numbers(path: Path, line: int, cells: list[str], expected: int) -> list[float]:
    if len(cells) != expected:
        raise DataError(f"expected {expected} columns in line {line} of {path}, got {len(cells)}")
    bad = next((cell for cell in cells if not _NUMBER.fullmatch(cell)), None)
    if bad is not None:
        raise DataError(f"expected numbers in line {line} of {path}, got {bad!r}")
    return [float(cell) for cell in cells]


def _time_column(path: Path, heads: list[str]) -> int:
    plain = [re.sub(r"[\[(].*?[\])]", "", head).strip().lower() for head in heads]
    found = [k for k, head in enumerate(plain) if head in TIME_NAMES]
    if len(found) != 1:
        raise DataError(
            f"expected one column of times in {path}, named as one of {', '.join(TIME_NAMES)}, got the columns {heads}"
        )
    return found[0]


def _read_npz(path: Path) -> tuple[Array, Array]:
    from kineme.io.container import read_arrays

    arrays = read_arrays(path)
    return arrays["times"], arrays["positions"]


def _read_json(path: Path) -> tuple[Any, Any]:
    data = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(data, dict):
        raise DataError(f"expected {path} to hold an object with times and positions, got a {type(data).__name__}")
    return data["times"], data["positions"]


#: File ending -> reader.
READERS: dict[str, Callable[[Path], tuple[Any, Any]]] = {
    ".csv": _read_table,
    ".tsv": _read_table,
    ".txt": _read_table,
    ".npz": _read_npz,
    ".json": _read_json,
}

"""The file format of learned models: a JSON header and plain arrays in a zip archive, like NumPy's npz.

Nothing in such a file is executed or looked up as a class: the header is data, arrays of objects are refused, and the
meaning of a header is defined by tables in this library. The checksums of the archive detect truncation and damage.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.arrays.npz import Npz
from kineme.io.limits import check_expanded
from kineme.reporting.atomic import write_atomically

FORMAT = "kineme"
VERSION = 1
_HEADER = "header"


def write_container(path: Path, kind: str, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Path:
    """Write a header and arrays to one file, atomically.

    Parameters
    ----------
    kind : str
        Name of the content; `read_container` refuses a file of another one.
    header : dict
        Anything that JSON can hold.
    arrays : dict
        Name -> array of numbers.
    """
    full = {"format": FORMAT, "version": VERSION, "kind": kind, **header}
    encoded = np.frombuffer(json.dumps(full, allow_nan=False).encode(), dtype=np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **{_HEADER: encoded}, **arrays)
    return write_atomically(path, buffer.getvalue())


def kind_of(path: Path) -> str:
    """What a file of `write_container` holds; raises as `read_container`."""
    return str(_read(path)[0].get("kind"))


def read_container(path: Path, kind: str) -> tuple[dict[str, Any], Mapping[str, NDArray[Any]]]:
    """Read a file of `write_container`; each array is read on first use.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    DataError
        The file is foreign, truncated or damaged, of another kind, of a later version, or larger than
        `kineme.io.limits` allows; the message says which.
    """
    header, arrays = _read(path)
    if header.get("kind") != kind:
        raise DataError(f"expected {path} to hold {kind}, got {header.get('kind')!r}")
    return header, arrays


def _read(path: Path) -> tuple[dict[str, Any], Mapping[str, NDArray[Any]]]:
    check_expanded(path.stat().st_size)
    arrays = Npz(path.read_bytes(), path)
    try:
        header = json.loads(arrays[_HEADER].tobytes())
    except (ValueError, KeyError, RecursionError) as error:
        raise DataError(f"expected {path} to be a file saved by kineme, got another program's archive") from error
    _check_header(path, header)
    return header, arrays


def _check_header(path: Path, header: Any) -> None:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise DataError(f"expected {path} to be a file saved by kineme, got another program's archive")
    if not isinstance(header.get("version"), int) or header["version"] > VERSION:
        raise DataError(
            f"expected {path} to have format version {VERSION} or earlier, got {header.get('version')!r}; "
            "upgrade kineme"
        )

"""One file for learned things: a JSON header and plain arrays in a zip archive, as NumPy's npz.

Nothing in such a file is ever executed or looked up as a class: the header is data, arrays of objects are
refused, and what a header means is decided by tables in this library. The archive's checksums make
truncation and damage visible.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.atomic import write_atomically

FORMAT = "kineme"
VERSION = 1
_HEADER = "header"


def write_container(path: Path, kind: str, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Path:
    """Write a header and arrays to one file, atomically.

    Parameters
    ----------
    kind : str
        What the file holds; `read_container` refuses any other.
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


def read_container(path: Path, kind: str) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Read a file of `write_container`.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    DataError
        The file is foreign, truncated or damaged, of another kind, or of a later version; the message says which.
    """
    arrays = read_arrays(path)
    try:
        header = json.loads(arrays.pop(_HEADER).tobytes())
    except (ValueError, KeyError) as error:
        raise DataError(f"expected {path} to be a file saved by kineme, got another program's archive") from error
    _check_header(path, header, kind)
    return header, arrays


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read all arrays of an npz archive; arrays of Python objects are refused, not unpickled."""
    return decode_arrays(path.read_bytes(), path)


def decode_arrays(data: bytes, path: Path) -> dict[str, NDArray[Any]]:
    """The arrays in the bytes of an npz archive; the path is for the message."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except Exception as error:  # the readers of archives and of array headers raise many kinds on damaged files
        raise DataError(
            f"expected {path} to be an archive of arrays, got something foreign, truncated or damaged ({error}); "
            "save it again, or take it from a backup"
        ) from error


def _check_header(path: Path, header: Any, kind: str) -> None:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise DataError(f"expected {path} to be a file saved by kineme, got another program's archive")
    if not isinstance(header.get("version"), int) or header["version"] > VERSION:
        raise DataError(
            f"expected {path} to have format version {VERSION} or earlier, got {header.get('version')!r}; "
            "upgrade kineme"
        )
    if header.get("kind") != kind:
        raise DataError(f"expected {path} to hold {kind}, got {header.get('kind')!r}")

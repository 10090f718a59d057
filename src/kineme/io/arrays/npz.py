"""NumPy archives, and learned models: a JSON header and plain arrays in a zip archive like NumPy's npz.

An array is read on first use, checked before it is decompressed, and never unpickled. Nothing in a learned model is
executed or looked up as a class: the meaning of a header is defined by tables in this library.
"""

from __future__ import annotations

import io
import json
import math
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.records import damaged_as
from kineme.reporting.atomic import write_atomically

FORMAT = "kineme"
VERSION = 1
_HEADER = "header"

_ENDING = ".npy"
_LONGEST_EMPTY = 1024  # rows of an array without columns, at most
_HEADS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


class Npz(Mapping[str, NDArray[Any]]):
    """The arrays in the bytes of an npz archive by name, each decoded on access; `path` is for messages."""

    def __init__(self, data: bytes, path: Path) -> None:
        self._path, self._taken = path, 0
        with self._damaged():
            self._archive = zipfile.ZipFile(io.BytesIO(data))
            listed = [member for member in self._archive.infolist() if member.filename.endswith(_ENDING)]
            self._members = {member.filename.removesuffix(_ENDING): member for member in listed}
            if len(self._members) < len(listed):
                raise ValueError("two entries of one name")

    def __getitem__(self, name: str) -> NDArray[Any]:
        member = self._members[name]
        with self._damaged():
            self._take(member.file_size)
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"an entry {member.filename!r} that is packed in an unusual way")
            with self._archive.open(member) as file:
                content = file.read(member.file_size)  # read() without a size decompresses before it checks
            if len(content) != member.file_size:
                raise ValueError(f"a truncated entry {member.filename!r}")
            return _decoded(content, repr(name), self._path, self._take)

    def __contains__(self, name: object) -> bool:
        return name in self._members

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def _take(self, n_bytes: int) -> None:
        self._taken += n_bytes
        check_expanded(self._taken)

    def _damaged(self) -> AbstractContextManager[None]:
        # zipfile raises many exceptions on damaged files; array headers are Python literals, which can raise more.
        said = f"expected {self._path} to be an archive of arrays, got something foreign, truncated or damaged"
        return damaged_as(said, Exception, remedy="; save it again, or take it from a backup")


def array_of_npy(data: bytes, path: Path) -> NDArray[Any]:
    """Return the array in the bytes of an npy file."""
    damaged = "expected an array saved by numpy.save, got something foreign, truncated or damaged"
    with damaged_as(damaged, Exception):  # headers are Python literals, which can raise much
        return _decoded(data, "it", path, check_expanded)


def _decoded(content: bytes, name: str, path: Path, take: Callable[[int], None]) -> NDArray[Any]:
    """Decode an array; its header must agree with the number of bytes that follow."""
    file = io.BytesIO(content)
    shape, fortran_order, dtype = _HEADS[npy.read_magic(file)](file)
    if dtype.hasobject:
        raise DataError(
            f"expected {path} to hold numbers and texts, got Python objects in {name}. Object arrays "
            "cannot be loaded without executing what they say; save texts as labels.astype(str), and movements "
            "of unequal length as positions_0, positions_1, ..., or each under its own name"
        )
    count = math.prod(shape)
    take(count * max(8 - dtype.itemsize, 0))  # numbers become float64
    at = file.tell()
    if min(shape, default=1) < 0 or not dtype.itemsize or count * dtype.itemsize != len(content) - at:
        raise ValueError(f"{len(content) - at} bytes for {name} of shape {shape} and type {dtype}")
    if not count and max(shape) > _LONGEST_EMPTY:
        raise ValueError(f"{name} of shape {shape}")
    array = np.frombuffer(content, dtype, offset=at)
    if dtype.kind == "U" and (array.view(np.dtype("u4").newbyteorder(dtype.byteorder)) > sys.maxunicode).any():
        raise ValueError(f"texts in {name} that are none")
    array = array.reshape(shape[::-1]).T if fortran_order else array.reshape(shape)
    return np.require(array, requirements="A")


def write_container(path: Path, kind: str, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Path:
    """Write a header, of what JSON can hold, and named arrays of numbers of some kind to one file, atomically."""
    full = {"format": FORMAT, "version": VERSION, "kind": kind, **header}
    encoded = np.frombuffer(json.dumps(full, allow_nan=False).encode(), dtype=np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **{_HEADER: encoded}, **arrays)
    return write_atomically(path, buffer.getvalue())


def kind_of(path: Path) -> str:
    """Return the kind of content of a file of `write_container`; raise as `read_container`."""
    return str(_read(path)[0].get("kind"))


def read_container(path: Path, kind: str) -> tuple[dict[str, Any], Mapping[str, NDArray[Any]]]:
    """Read a file of `write_container` of that kind; each array is read on first use."""
    header, arrays = _read(path)
    if header.get("kind") != kind:
        raise DataError(f"expected {path} to hold {kind}, got {header.get('kind')!r}")
    return header, arrays


def _read(path: Path) -> tuple[dict[str, Any], Mapping[str, NDArray[Any]]]:
    check_expanded(path.stat().st_size)
    arrays = Npz(path.read_bytes(), path)
    header = None
    with suppress(ValueError, KeyError, RecursionError):
        header = json.loads(arrays[_HEADER].tobytes())
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise DataError(f"expected {path} to be a file saved by kineme, got another program's archive")
    if not isinstance(header.get("version"), int) or header["version"] > VERSION:
        raise DataError(
            f"expected {path} to have format version {VERSION} or earlier, got {header.get('version')!r}; "
            "upgrade kineme"
        )
    return header, arrays

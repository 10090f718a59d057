"""Arrays of numbers in Zarr, format 2, in a folder or in a .zip archive: read by rows, checked before unpacking.

The format: zarr-specs, storage specification version 2. Only what the format needs for numbers is done: filters, which
could run code, objects, and codecs of images are refused, and no array that is not asked for is opened.
"""

from __future__ import annotations

import json
import math
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded, check_in_passing
from kineme.io.records import damaged_as, needs

#: What only a store of format 3 has at its top.
FORMAT_3 = "zarr.json"
_META = ".zarray"
_ARRAY = r"[^/]+/[^/]+/\.zarray"
_LONGEST = 2**16  # bytes of the description of an array
_MOST = 2**62  # rows, or numbers in one of them
_ANY_WINDOW = 47  # of zlib: with the head of zlib or of gzip
_DEFLATED = frozenset({"zlib", "gzip"})
_PACKED = frozenset({"blosc", "zstd", "lz4"})  # codecs that unpack into room of a given size, and refuse more
_NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


class _Files(NamedTuple):
    """The files of a folder or of an archive by their paths in it."""

    read: Callable[[str], bytes | None]  # None: it is not there
    has: Callable[[str], bool]
    arrays: list[str]  # group and name of each array, as ``data/action``


class ZarrArray:
    """An array (n, ...) of numbers, whose rows are read when they are asked for; the last chunk stays in memory."""

    def __init__(self, files: _Files, name: str) -> None:
        data = files.read(f"{name}/{_META}")
        if data is None or len(data) > _LONGEST:
            raise DataError(f"expected the array {name} of Zarr, got none; copy the data set again")
        with damaged_as(f"expected the description of the array {name} of Zarr, got", Exception):
            meta = json.loads(data)
            self.shape, self._chunks = (tuple(map(int, meta[key])) for key in ("shape", "chunks"))
            self.dtype = np.dtype(meta["dtype"] if isinstance(meta["dtype"], str) else "O")
            self._order, self._codec = meta["order"], meta["compressor"]
            self._between = str(meta.get("dimension_separator", "."))
            with np.errstate(all="ignore"):  # a number beyond those of the type is another one of it
                self._fill = np.full((), _NOT_FINITE.get(meta["fill_value"], meta["fill_value"] or 0), self.dtype)
            is_sound = len(self.shape) == len(self._chunks) > 0 and min(self.shape) >= 0 < min(self._chunks)
            is_sound = is_sound and max(self.shape + self._chunks) <= _MOST
            codec = None if self._codec is None else str(self._codec["id"])
        if meta.get("filters") or self.dtype.kind not in "biuf" or self._order not in ("C", "F") or not is_sound:
            raise DataError(f"expected numbers without filters in the array {name} of Zarr, got {self.dtype}")
        if codec is not None and codec not in _PACKED | _DEFLATED:
            raise DataError(f"expected the array {name} of Zarr to be packed by blosc or zstd, got {codec!r}")
        self.name, self._files = name, files
        self._last: tuple[tuple[int, ...], NDArray[Any] | None] = ((), None)

    def rows(self, first: int, last: int) -> NDArray[Any]:
        """Return the rows from `first` to before `last`; those of chunks that are not there have the fill value."""
        shape = (last - first, *self.shape[1:])
        check_expanded(math.prod(shape) * max(8, self.dtype.itemsize))
        values, tall = np.full(shape, self._fill, self.dtype), self._chunks[0]
        for place in self._places(first, last):
            if self._last[0] != place:
                data = self._files.read(self._key(place))
                self._last = place, None if data is None else self._unpacked(data)
            chunk = self._last[1]
            if chunk is None:
                continue
            starts = [k * width for k, width in zip(place, self._chunks, strict=True)]
            low, high = max(first, starts[0]), min(last, starts[0] + tall)
            stops = [min(n, start + width) for n, start, width in zip(self.shape, starts, self._chunks, strict=True)]
            inner = [slice(start, stop) for start, stop in zip(starts[1:], stops[1:], strict=True)]
            of_chunk = [slice(stop - start) for start, stop in zip(starts[1:], stops[1:], strict=True)]
            values[(slice(low - first, high - first), *inner)] = chunk[
                (slice(low - starts[0], high - starts[0]), *of_chunk)
            ]
        return values

    def lacks(self, first: int, last: int) -> bool:
        """Tell whether chunks of these rows are not there: lost, or left out since they hold the fill value alone."""
        return not all(self._files.has(self._key(place)) for place in self._places(first, last))

    def _places(self, first: int, last: int) -> Iterator[tuple[int, ...]]:
        along = range(first // self._chunks[0], -(-last // self._chunks[0])) if last > first else range(0)
        beside = (range(-(-n // width)) for n, width in zip(self.shape[1:], self._chunks[1:], strict=True))
        # `itertools.product` would list what it is given, and a description may declare any number of chunks.
        ranges = (along, *beside)
        counts = tuple(map(len, ranges))
        for k in range(math.prod(counts)):
            yield tuple(chunks[i] for chunks, i in zip(ranges, np.unravel_index(k, counts), strict=True))

    def _key(self, place: tuple[int, ...]) -> str:
        return f"{self.name}/{self._between.join(map(str, place))}"

    def _unpacked(self, data: bytes) -> NDArray[Any]:
        n_bytes = math.prod(self._chunks) * self.dtype.itemsize
        check_in_passing(n_bytes, f"a chunk of the array {self.name}")
        with damaged_as(f"expected a chunk of the array {self.name} of Zarr, got a damaged one", Exception):
            if self._codec is None:
                content: Any = data
            elif self._codec["id"] in _DEFLATED:
                content = zlib.decompressobj(_ANY_WINDOW).decompress(data, n_bytes + 1)
            else:
                with needs("zarr", "unpack Zarr", "zarr"):
                    import numcodecs  # of which zarr consists
                content = np.zeros(n_bytes, np.uint8)
                numcodecs.get_codec({"id": self._codec["id"]}).decode(data, out=content)
            if len(content) != n_bytes:
                raise ValueError(f"{len(content)} bytes where {n_bytes} are declared")
            return np.frombuffer(content, self.dtype).reshape(self._chunks, order=self._order)


@contextmanager
def zarr_arrays(path: Path) -> Iterator[dict[str, ZarrArray | DataError]]:
    """Context manager: the arrays in the groups of a folder or a .zip archive by name, or why one is not read."""
    if path.is_dir():
        yield _opened(_of_folder(path))
        return
    with damaged_as(f"expected an archive of Zarr, got a damaged one, {path.name}", zipfile.BadZipFile, OSError):
        archive = zipfile.ZipFile(path)
    with archive:
        yield _opened(_of_archive(archive))


def _opened(files: _Files) -> dict[str, ZarrArray | DataError]:
    if not files.arrays and files.has(FORMAT_3):
        raise DataError("expected Zarr of format 2, got format 3; write it with zarr_format=2")
    arrays: dict[str, ZarrArray | DataError] = {}
    for name in files.arrays:
        try:
            arrays[name] = ZarrArray(files, name)
        except DataError as error:
            arrays[name] = error
    return arrays


def _of_folder(folder: Path) -> _Files:
    top = folder.resolve()

    def read(name: str) -> bytes | None:
        path = folder / name
        if not path.is_file() or not path.resolve().is_relative_to(top):  # a link must not lead to other files
            return None
        check_in_passing(path.stat().st_size, f"a part of {folder.name}")
        return path.read_bytes()

    arrays = sorted(path.parent.relative_to(folder).as_posix() for path in folder.glob(f"*/*/{_META}"))
    return _Files(read, lambda name: (folder / name).is_file(), arrays)


def _of_archive(archive: zipfile.ZipFile) -> _Files:
    members = {member.filename: member for member in archive.infolist()}

    def read(name: str) -> bytes | None:
        if (member := members.get(name)) is None:
            return None
        check_in_passing(member.file_size, f"a part of {Path(archive.filename or '').name}")
        with damaged_as(f"expected {name} in an archive, got a damaged one", Exception), archive.open(member) as file:
            return file.read(member.file_size)  # read() without a size unpacks before it checks

    arrays = sorted(name.removesuffix(f"/{_META}") for name in members if re.fullmatch(_ARRAY, name))
    return _Files(read, members.__contains__, arrays)

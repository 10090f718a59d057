"""HDF5 as a tree of arrays: robomimic, ALOHA and whatever else keeps movements in groups of data sets."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.trees import Rate, rate_of, seconds_named
from kineme.io.limits import check_expanded
from kineme.io.records import damaged_as, needs

#: Errors of h5py on damaged files.
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError)

_SMALL, _CHUNKS = 2**20, 1000  # bytes and chunks that need not be written
_EXPANDED = 1100  # times as many bytes gzip, which packs best, gives at most
_LARGE, _PACKED = 2**26, 200  # bytes from which on packing is looked at; times as many as movements pack to at most
_DEEPEST, _MOST = 12, 1_000_000  # groups within groups; groups and data sets in all
_LETTERS, _LONGEST = 2**20, 256  # of labels in all at most, or on average
_SCALE = frozenset({"conversion", "offset"})  # attributes by which samples are multiplied, and which is added
_UNITS = frozenset({"unit", "units"})  # attributes
_NAMES = frozenset({"label", "task"})  # attributes


@contextmanager
def hdf5_file(path: Path) -> Iterator[Any]:
    """Context manager: an HDF5 file that is read; what h5py raises on damage becomes a `DataError`."""
    with needs("h5py", "read HDF5", "hdf5"):
        import h5py
    damaged = "expected an HDF5 file, got something foreign, truncated or damaged"
    with damaged_as(damaged, *DAMAGE), h5py.File(os.fspath(path), "r") as file:
        yield file


def hdf5_group(group: Any, name: str) -> Any:
    """Return a group within a group, or nothing where there is none, and where it lies in another file."""
    import h5py

    member = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
    return member if isinstance(member, Mapping) else {}


def hdf5_tree(group: Any, counted: list[int] | None = None, depth: int = 0, unit: Any = None) -> dict[str, Any]:
    """Return a file or a group as a mapping of data sets that are not read yet, single values, and groups."""
    import h5py

    tree, counted = dict[str, Any](), counted or [0]  # how many groups and data sets there are before it
    unit = _unit_in(group, group.attrs) or unit
    tree |= _label_and_rate(group, group.attrs)
    for name in group:
        counted[0] += 1
        if counted[0] > _MOST:
            raise DataError(f"expected an HDF5 file of at most {_MOST:,} groups and data sets, got more")
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member = group[name]
        if isinstance(member, Mapping):
            if depth < _DEEPEST:
                tree[name] = hdf5_tree(member, counted, depth + 1, unit)
        # What lies in other files is passed over: a file from elsewhere must not make the program read others.
        elif isinstance(member, h5py.Dataset) and not member.external and not member.is_virtual:
            names = tuple(member.attrs)
            rate = rate_of(_label_and_rate(member, names)) if names else None
            if member.shape == ():
                tree[name] = _single(member[()])
                tree |= {} if rate is None else {"rate": rate.hertz}  # as of NWB's starting_time
            elif member.shape and member.dtype.kind in "biuf":
                tree[name] = _Stored(member, (_unit_in(member, names) if names else None) or unit, rate, names)
            elif member.dtype.names and len(member.shape) == 1:
                check_expanded(member.shape[0] * member.dtype.itemsize)
                heads = member.dtype.names
                numbers = tuple(head for head in heads if member.dtype[head].kind in "biuf")
                records: Any = _Stored(member, None, None)[numbers] if numbers else None
                tree[name] = {head: records[head] if len(numbers) > 1 else records for head in numbers}
                texts = [head for head in heads if h5py.check_string_dtype(member.dtype[head]) is not None]
                tree[name] |= {head: _Texts(member, head) for head in texts}
            elif len(member.shape) == 1 and h5py.check_string_dtype(member.dtype) is not None:
                tree[name] = _Texts(member)
    return tree


def texts_of(stored: Any, head: str | None = None) -> list[str | float | None]:
    """Read the texts of a data set, or of a column of it; of any length one by one: all may be the same large one."""
    dtype = stored.dtype if head is None else stored.dtype[head]
    n_letters, labels = stored.shape[0] * max(1, dtype.itemsize), list[str | float | None]()
    most = max(_LETTERS, _LONGEST * stored.shape[0])
    for k in range(stored.shape[0]):
        if n_letters > most:
            raise DataError(f"expected labels of at most {most:,} letters in all in {stored.name}, got more")
        if dtype.kind == "S":
            return [_single(text) for text in (stored[()] if head is None else stored[head]).tolist()]
        labels.append(_single(stored[k] if head is None else stored[head, k]))
        n_letters += len(str(labels[-1]))
    return labels


class _Texts:
    """The texts of a data set, or of a column of it, that are read when they are needed."""

    dtype = np.dtype(object)

    def __init__(self, stored: Any, head: str | None = None) -> None:
        self._stored, self._head, self.shape = stored, head, stored.shape

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.array(texts_of(self._stored, self._head), dtype=object)


def _label_and_rate(stored: Any, names: Iterable[str]) -> dict[str, Any]:
    named = [name for name in names if name.lower() in _NAMES or seconds_named(name) is not None]
    return {name: value for name in named if (value := _single(stored.attrs[name])) is not None}


def _unit_in(stored: Any, names: Iterable[str]) -> Any:
    """Return the unit in the attributes of a group or of a data set, or one for each of its columns; None without."""
    for name in names:
        if name.lower() in _UNITS:
            value = stored.attrs[name]
            units = [_single(element) for element in np.ravel(value)] if np.ndim(value) else [_single(value)]
            if units and all(isinstance(unit, str) for unit in units):
                return units[0] if len({*units}) == 1 else units
    return None


class _Stored:
    """A data set that is read, or refused, when it is needed: what was never written takes no room, but minutes."""

    def __init__(self, stored: Any, unit: Any, rate: Rate | None, names: Iterable[str] = ()) -> None:
        self._stored, self.shape, self.dtype, self.unit, self.rate = stored, stored.shape, stored.dtype, unit, rate
        scale = {name: _single(stored.attrs[name]) for name in names if name in _SCALE}
        of_numbers = stored.dtype.names is None
        # Of NWB.
        self._scale = {name: value for name, value in scale.items() if of_numbers and isinstance(value, float)}

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.asarray(self[()], dtype)

    def __getitem__(self, rows: Any) -> Any:
        n_bytes, n_stored = math.prod(self.shape) * self.dtype.itemsize, self._stored.id.get_storage_size()
        chunks, n_missing = self._stored.chunks, 0
        if chunks is not None:
            n_chunks = math.prod(-(-n // width) for n, width in zip(self.shape, chunks, strict=True))
            n_missing = n_chunks - self._stored.id.get_num_chunks()
        if n_missing > _CHUNKS or (n_bytes > _SMALL and (n_missing or n_bytes > _EXPANDED * n_stored)):
            raise DataError(
                f"expected {n_bytes:,} bytes of samples in the data set {self._stored.name}, got {n_stored:,} in the "
                "file: the others were never written; write a data set of what was recorded"
            )
        if n_bytes > _LARGE and n_bytes > _PACKED * n_stored:
            raise DataError(
                f"expected samples that move in the data set {self._stored.name}, got {n_bytes:,} bytes from "
                f"{n_stored:,} in the file, nearly all of which are alike; write a data set of what was recorded, or a "
                "shorter one"
            )
        values = self._stored[rows]
        return values * self._scale.get("conversion", 1.0) + self._scale.get("offset", 0.0) if self._scale else values


def _single(value: Any) -> str | float | None:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, str):
        return value
    return float(value) if np.ndim(value) == 0 and isinstance(value, (int, float, np.integer, np.floating)) else None

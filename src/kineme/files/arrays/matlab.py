"""MATLAB files in the layout of LASA: a list ``demos`` of structures with ``pos`` (d, T) and ``t`` (1, T)."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

from kineme.errors import DataError
from kineme.files.arrays.mat_elements import (
    CELL,
    STRUCT,
    Element,
    Matrix,
    as_matrix,
    byte_order,
    elements,
    matrices,
    numbers,
    text,
)
from kineme.files.limits import check_expanded
from kineme.validation import Array

_FIELDS = ("t", "pos")


class Demos(NamedTuple):
    """Times (T,) and positions (T, d) of each demonstration, and the name in the file, if any."""

    times: list[Array]
    positions: list[Array]
    name: str | None


def read_demos(data: bytes) -> Demos:
    """Read all demonstrations of a MATLAB file of version 5 to 7.2.

    ``demos`` is a structure, an array of structures or a cell array of them. Other variables are ignored.

    Raises
    ------
    DataError
        Not such a file, or damaged, or without ``demos``.
    """
    if data[:8] == b"\x89HDF\r\n\x1a\n" or data[:10] == b"MATLAB 7.3":
        raise DataError("expected a MATLAB file of version 7.2 or earlier, got 7.3; save it with -v7")
    try:
        order = byte_order(data)
        variables = matrices(data, order, ("demos", "name"))
        if "demos" not in variables:
            raise ValueError("none of that name")
        pairs = list(_pairs(variables["demos"], order))
        if not pairs:
            raise ValueError("none in it")
        check_expanded(sum(8 * math.prod(one.dims) for pair in pairs for one in pair))
        demos = [_arrays(numbers(t, order), numbers(x, order)) for t, x in pairs]
        name = text(variables["name"], order) if "name" in variables else None
    except (ValueError, struct.error, zlib.error) as error:
        raise DataError(f"expected a MATLAB file with 'demos', got {error}") from error
    return Demos([t for t, _ in demos], [x for _, x in demos], name or None)


def _pairs(demos: Matrix, order: str) -> Iterator[tuple[Matrix, Matrix]]:
    """Fields ``t`` and ``pos`` of every structure."""
    if demos.kind == CELL:
        children = elements(demos.content, order)
        for _ in range(math.prod(demos.dims)):
            yield from _of_structures(_next(children, order), order)
    else:
        yield from _of_structures(demos, order)


def _of_structures(demos: Matrix, order: str) -> Iterator[tuple[Matrix, Matrix]]:
    if demos.kind != STRUCT:
        raise ValueError("something else than structures in it")
    parts = elements(demos.content, order)
    width, names = next(parts, None), next(parts, None)
    size = int.from_bytes(width.data, "little" if order == "<" else "big") if width else 0
    if names is None or size < 1 or len(names.data) % size:
        raise ValueError("damaged names of fields")
    plain = bytes(names.data)
    fields = [plain[k : k + size].partition(b"\0")[0].decode("latin-1") for k in range(0, len(plain), size)]
    if missing := [field for field in _FIELDS if field not in fields]:
        raise ValueError(f"structures without {missing[0]!r}, but with {fields}")
    for _ in range(math.prod(demos.dims)):
        values = [_next(parts, order) for _ in fields]
        yield values[fields.index("t")], values[fields.index("pos")]


def _next(parts: Iterator[Element], order: str) -> Matrix:
    one = next(parts, None)
    if one is None:
        raise ValueError("fewer elements than it says")
    return as_matrix(one, order)


def _arrays(t: Array, x: Array) -> tuple[Array, Array]:
    x = x[:, None] if x.ndim == 1 else x.T
    if t.ndim != 1 or x.ndim != 2 or len(t) != len(x):
        raise ValueError(f"t of shape {t.shape} and pos of shape {x.T.shape}")
    return t, x

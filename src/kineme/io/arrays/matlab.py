"""MATLAB files: LASA's, a list ``demos`` of structures with ``pos`` (d, T) and ``t`` (1, T), and any other layout."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Container, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.arrays import Named, parsed_arrays
from kineme.io.arrays.mat_elements import (
    CELL,
    NUMBERS,
    STRUCT,
    TEXT,
    Element,
    Matrix,
    as_matrix,
    byte_order,
    elements,
    field_names,
    matrices,
    numbers,
    text,
)
from kineme.io.arrays.tree_movements import tree_movements
from kineme.io.arrays.trees import has_times
from kineme.io.limits import check_expanded
from kineme.movements.tables.columns import is_time
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed, listed
from kineme.validation import Array

_DEEPEST = 12  # cells within cells

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
    next(parts, None), next(parts, None)  # the width of the names and the names
    fields = field_names(demos, order)
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


def mat_movements(data: bytes, layout: Layout) -> Parsed:
    """The movements in a MATLAB file: those of ``demos``, see `read_demos`, else of all its variables.

    Structures with times hold one movement; cells and arrays of structures hold many. Matrices among the variables
    count only beside times or a rate, or where the caller gives the step between samples.

    Raises
    ------
    DataError
        Not such a file, damaged, without movements, or with several arrays of coordinates of which none is chosen.
    """
    variables = _variables(data)
    if "demos" in variables or not variables:
        demos = read_demos(data)
        named = Named([demos.name] * len(demos.times), "t")
        return parsed_arrays(demos.positions, demos.times, named, layout, ("MATLAB", "demos"))
    try:
        tree = as_tree(variables, byte_order(data))
    except (ValueError, struct.error) as error:
        raise DataError(f"expected a MATLAB file of arrays, got {error}") from error
    if not has_times(tree) and not isinstance(layout.units, float | int):  # matrices on their own may be anything
        tree = {name: one for name, one in tree.items() if isinstance(one, (dict, list))}
    if not tree:
        got = listed(variables)
        raise DataError(
            f"expected a MATLAB file with 'demos', got none of that name, nor cells, structures, times: {got}; say the "
            "seconds between two samples with units=, in the shell --units"
        )
    return tree_movements(tree, layout, "MATLAB")


def _variables(data: bytes) -> dict[str, Matrix]:
    """All variables; none of what is no file of version 5 to 7.2, which `read_demos` says."""
    try:
        return matrices(data, byte_order(data), _EVERYTHING)
    except (ValueError, struct.error, zlib.error):
        return {}


class _Everything(Container[str]):
    def __contains__(self, name: object) -> bool:
        return True


_EVERYTHING = _Everything()


def as_tree(variables: Mapping[str, Matrix], order: str) -> dict[str, Any]:
    """Variables as a tree, in which every array has its samples along the first axis."""
    return _upright({name: _node(matrix, order, [0]) for name, matrix in variables.items()})


def _node(matrix: Matrix, order: str, taken: list[int], depth: int = 0) -> Any:
    if depth > _DEEPEST:
        return None
    if matrix.kind in NUMBERS and not matrix.is_complex:
        taken[0] += 8 * math.prod(matrix.dims)
        check_expanded(taken[0])
        return numbers(matrix, order)
    if matrix.kind == TEXT:
        return text(matrix, order)
    if matrix.kind == CELL:
        return [_node(one, order, taken, depth + 1) for one in _children(matrix, order, math.prod(matrix.dims), 0)]
    if matrix.kind == STRUCT:
        fields = field_names(matrix, order)
        values = _children(matrix, order, math.prod(matrix.dims) * len(fields), 2)
        nodes = [_node(one, order, taken, depth + 1) for one in values]
        rows = [dict(zip(fields, nodes[k : k + len(fields)], strict=True)) for k in range(0, len(nodes), len(fields))]
        return rows[0] if len(rows) == 1 else rows
    return None


def _children(matrix: Matrix, order: str, count: int, skipped: int) -> Iterator[Matrix]:
    """The matrices in a cell array or a structure, behind what describes its fields."""
    parts = elements(matrix.content, order)
    for _ in range(skipped):
        next(parts, None)
    for _ in range(count):
        if (one := next(parts, None)) is None:
            raise ValueError("fewer elements than it says")
        yield as_matrix(one, order)


def _upright(tree: Any) -> Any:
    """Matrices with their samples along the first axis: as many as there are times, else the longer axis."""
    if isinstance(tree, list):
        return [_upright(one) for one in tree if one is not None]
    if not isinstance(tree, dict):
        return _turned(tree, None) if isinstance(tree, np.ndarray) else tree
    stamps = [one for name, one in tree.items() if is_time(name) and isinstance(one, np.ndarray) and one.ndim == 1]
    length = len(stamps[0]) if stamps else None
    return {
        name: _turned(one, length) if isinstance(one, np.ndarray) else _upright(one)
        for name, one in tree.items()
        if one is not None
    }


def _turned(array: Any, length: int | None) -> Any:
    if array.ndim != 2:
        return array
    rows, columns = array.shape
    turned = rows != length == columns if length is not None else columns > rows
    return array.T if turned else array

"""MATLAB files: LASA's, a list ``demos`` of structures with ``pos`` (d, T) and ``t`` (1, T), and any other layout."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Container, Iterator
from typing import NamedTuple

from kineme.errors import DataError
from kineme.files.arrays.arrays import Named, parsed_arrays
from kineme.files.arrays.mat_elements import (
    CELL,
    STRUCT,
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
from kineme.files.arrays.mat_trees import as_tree
from kineme.files.arrays.tree_movements import tree_movements
from kineme.files.arrays.trees import has_times
from kineme.files.limits import check_expanded
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed, listed
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

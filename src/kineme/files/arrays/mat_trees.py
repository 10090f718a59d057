"""Any MATLAB file of version 5 to 7.2 as a tree of arrays: structures, cells, matrices of numbers, texts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from kineme.files.arrays.mat_elements import (
    CELL,
    NUMBERS,
    STRUCT,
    TEXT,
    Matrix,
    as_matrix,
    elements,
    field_names,
    numbers,
    text,
)
from kineme.files.limits import check_expanded
from kineme.movements.tables.columns import is_time

_DEEPEST = 12  # cells within cells


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

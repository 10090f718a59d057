"""MATLAB files: LASA's, a list ``demos`` of structures with ``pos`` (d, T) and ``t`` (1, T), and any other layout.

Source: The MathWorks, "MAT-File Format", version 5. A file is a header and elements, each a tag (type, number of bytes)
and its data; a matrix is an element of elements: flags, dimensions, name, content. No size in the file is trusted.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Container, Iterator
from contextlib import suppress
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.arrays.arrays import Named, parsed_arrays
from kineme.io.arrays.tree_movements import tree_movements
from kineme.io.arrays.trees import SAY_STEP, has_times
from kineme.io.limits import check_expanded
from kineme.movements.tables.columns import is_time
from kineme.movements.tables.layout import Layout, Parsed, listed
from kineme.validation import Array

HEADER = 128  # bytes
CELL, STRUCT, TEXT, NUMBERS = 1, 2, 4, range(6, 16)  # classes of matrices

_MATRIX, _COMPRESSED = 14, 15  # types of elements
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_OPAQUE = 17  # class of MATLAB's strings, tables and other objects
_PEEK = 4096  # bytes of a compressed matrix that hold its name
_MAX_DIMS = 32

_DEEPEST = 12  # cells within cells

_FIELDS = ("t", "pos")


class Demos(NamedTuple):
    """Times (T,) and positions (T, d) of each demonstration, and the name in the file, if any."""

    times: list[Array]
    positions: list[Array]
    name: str | None


def read_demos(data: bytes) -> Demos:
    """Read ``demos`` of a MATLAB file of version 5 to 7.2: a structure, or an array or a cell array of them."""
    if data[:8] == b"\x89HDF\r\n\x1a\n" or data[:10] == b"MATLAB 7.3":
        raise DataError("expected a MATLAB file of version 7.2 or earlier, got 7.3; save it with -v7")
    try:
        order = byte_order(data)
        variables = matrices(data, order, ("demos", "name"))
        if "demos" not in variables:
            raise ValueError("none of that name")
        node = _node(variables["demos"], order, [0], wanted=_FIELDS)
        demos = []
        for cell in node if isinstance(node, list) else [node]:
            demos += [_of_structure(record) for record in (cell if isinstance(cell, list) else [cell])]
        if not demos:
            raise ValueError("none in it")
        name = text(variables["name"], order) if "name" in variables else None
    except (ValueError, struct.error, zlib.error) as error:
        raise DataError(f"expected a MATLAB file with 'demos', got {error}") from error
    return Demos([t for t, _ in demos], [x for _, x in demos], name or None)


def _of_structure(record: Any) -> tuple[Array, Array]:
    if not isinstance(record, dict):
        raise ValueError("something else than structures in it")
    if missing := [field for field in _FIELDS if field not in record]:
        raise ValueError(f"structures without {missing[0]!r}, but with {list(record)}")
    t, x = (record[field] for field in _FIELDS)
    if not (isinstance(t, np.ndarray) and isinstance(x, np.ndarray)):
        raise ValueError("something else than numbers")
    x = x[:, None] if x.ndim == 1 else x.T
    if t.ndim != 1 or x.ndim != 2 or len(t) != len(x):
        raise ValueError(f"t of shape {t.shape} and pos of shape {x.T.shape}")
    return t, x


def mat_movements(data: bytes, layout: Layout) -> Parsed:
    """Return the movements in a MATLAB file: those of ``demos``, see `read_demos`, else of all its variables."""
    variables: dict[str, Matrix] = {}
    with suppress(ValueError, struct.error, zlib.error):  # no file of version 5 to 7.2, which `read_demos` says
        variables = matrices(data, byte_order(data))
    if "demos" in variables or not variables:
        demos = read_demos(data)
        named = Named([demos.name] * len(demos.times), "t")
        return parsed_arrays(demos.positions, demos.times, named, layout, ("MATLAB", "demos"))
    try:
        order = byte_order(data)
        tree = _upright({name: _node(matrix, order, [0]) for name, matrix in variables.items()})
    except (ValueError, struct.error) as error:
        raise DataError(f"expected a MATLAB file of arrays, got {error}") from error
    if not has_times(tree) and not isinstance(layout.units, float | int):  # matrices on their own may be anything
        tree = {name: node for name, node in tree.items() if isinstance(node, (dict, list))}
    if not tree:
        got = listed(variables)
        raise DataError(
            f"expected a MATLAB file with 'demos', got none of that name, nor cells, structures, times: {got}{SAY_STEP}"
        )
    return tree_movements(tree, layout, "MATLAB")


def _node(matrix: Matrix, order: str, taken: list[int], depth: int = 0, wanted: Container[str] | None = None) -> Any:
    """Read a matrix as a branch of a tree; of structures only the wanted fields, which have to be real numbers."""
    if depth > _DEEPEST:
        return None
    if matrix.kind in NUMBERS and not (matrix.is_complex and wanted is None):
        taken[0] += 8 * math.prod(matrix.dims)
        check_expanded(taken[0])
        return numbers(matrix, order)
    if matrix.kind == TEXT:
        return _lines(matrix, order) if matrix.dims[0] > 1 else text(matrix, order)
    if matrix.kind == CELL:
        cells = _children(matrix, order, math.prod(matrix.dims), 0)
        nodes = [_node(cell, order, taken, depth + 1, wanted) for cell in cells]
        of_texts = len(nodes) > 1 and {*map(type, nodes)} - {type(None)} == {str}  # of an empty one there is nothing
        return np.array([text or "" for text in nodes], dtype=object) if of_texts else nodes
    if matrix.kind == STRUCT:
        fields = field_names(matrix, order)
        values = _children(matrix, order, math.prod(matrix.dims) * len(fields), 2)
        nodes = [
            _node(value, order, taken, depth + 1, wanted) if wanted is None or field in wanted else None
            for field, value in zip(cycle(fields), values, strict=False)
        ]
        rows = [dict(zip(fields, nodes[k : k + len(fields)], strict=True)) for k in range(0, len(nodes), len(fields))]
        return rows[0] if len(rows) == 1 else rows
    return None


def _children(matrix: Matrix, order: str, count: int, skipped: int) -> Iterator[Matrix]:
    parts = elements(matrix.content, order)
    for _ in range(skipped):
        next(parts, None)
    for _ in range(count):
        if (part := next(parts, None)) is None:
            raise ValueError("fewer elements than it says")
        yield as_matrix(part, order)


def _upright(tree: Any) -> Any:
    """Return matrices with their samples along the first axis: as many as there are times, else the longer axis."""
    if isinstance(tree, list):
        return [_upright(node) for node in tree if node is not None]
    if not isinstance(tree, dict):
        return _turned(tree, None) if isinstance(tree, np.ndarray) else tree
    stamps = [node for name, node in tree.items() if is_time(name) and isinstance(node, np.ndarray) and node.ndim == 1]
    length = len(stamps[0]) if stamps else None
    return {
        name: _turned(node, length) if isinstance(node, np.ndarray) else _upright(node)
        for name, node in tree.items()
        if node is not None
    }


def _turned(array: Any, length: int | None) -> Any:
    if array.ndim != 2:
        return array
    rows, columns = array.shape
    turned = rows != length == columns if length is not None else columns > rows
    return array.T if turned else array


class Element(NamedTuple):
    """Type and data of an element, and the offset of the next one."""

    type: int
    data: memoryview
    end: int


class Matrix(NamedTuple):
    """Header of a matrix, and the elements of its content."""

    kind: int  # its class
    is_complex: bool
    dims: tuple[int, ...]
    name: str
    content: memoryview


def byte_order(data: bytes) -> str:
    """Return the byte order ``"<"`` or ``">"`` of the header; a `ValueError` if this is not a file of version 5."""
    order = {b"\0\1IM": "<", b"\1\0MI": ">"}.get(data[HEADER - 4 : HEADER])
    if order is None:
        raise ValueError("something foreign or truncated")
    return order


def elements(data: memoryview, order: str) -> Iterator[Element]:
    """Yield consecutive elements; a `ValueError` if one ends beyond the data."""
    at = 0
    while at < len(data):
        if len(data) - at < 8:
            raise ValueError("a truncated tag")
        kind, size = struct.unpack_from(f"{order}II", data, at)
        start, end = at + 8, at + 8 + size
        if kind >> 16:  # a small element: up to four bytes of data within the tag
            kind, size = kind & 0xFFFF, kind >> 16
            start, end = at + 4, at + 4 + size
            if size > 4:
                raise ValueError("a damaged tag")
        if end > len(data):
            raise ValueError("a truncated or damaged element")
        at = end if kind == _COMPRESSED else end + (-end) % 8
        yield Element(kind, data[start:end], at)


def matrices(data: bytes, order: str, wanted: Container[str] | None = None) -> dict[str, Matrix]:
    """Return the variables with these names, by default all; others are neither decompressed nor read."""
    variables, taken = {}, 0
    for element in elements(memoryview(data)[HEADER:], order):
        if element.type == _COMPRESSED:
            matrix = _expanded(element.data, order, wanted)
        elif element.type == _MATRIX:
            matrix = as_matrix(element, order)
        else:
            raise ValueError(f"an element of type {element.type} in place of a variable")
        if wanted is None or matrix.name in wanted:
            taken += len(matrix.content)
            check_expanded(taken)
            variables[matrix.name] = matrix
    return variables


def _expanded(packed: memoryview, order: str, wanted: Container[str] | None) -> Matrix:
    """Return the matrix in a compressed element; only its header if its name is not wanted."""
    stream = zlib.decompressobj()
    head = stream.decompress(packed, _PEEK)
    if len(head) < 8:
        raise ValueError("a truncated compressed variable")
    kind, size = struct.unpack_from(f"{order}II", head)
    if kind != _MATRIX:
        raise ValueError(f"a compressed element of type {kind} in place of a variable")
    matrix = _matrix(memoryview(head)[8 : 8 + size], order)
    if wanted is not None and matrix.name not in wanted:
        return matrix
    check_expanded(size)
    content = head + stream.decompress(stream.unconsumed_tail, max(1, 8 + size + 1 - len(head)))
    if len(content) != 8 + size or not stream.eof:
        raise ValueError("a truncated or damaged compressed variable")
    return _matrix(memoryview(content)[8:], order)


def as_matrix(element: Element, order: str) -> Matrix:
    """Return an element as a matrix; an element without data is an empty matrix."""
    if element.type != _MATRIX:
        raise ValueError(f"an element of type {element.type} in place of a matrix")
    return _matrix(element.data, order) if len(element.data) else Matrix(6, False, (0, 0), "", element.data)


def _matrix(data: memoryview, order: str) -> Matrix:
    parts = elements(data, order)
    flags, second, third = (next(parts, None) for _ in range(3))
    if flags is None or flags.type != 6 or len(flags.data) != 8 or second is None:
        raise ValueError("a damaged head of a matrix")
    bits = struct.unpack_from(f"{order}I", flags.data)[0]
    if bits & 0xFF == _OPAQUE:  # opaque objects have no dimensions and are not read
        return Matrix(_OPAQUE, False, (), bytes(second.data).decode("latin-1"), data[len(data) :])
    if second.type != 5 or len(second.data) % 4 or not 2 <= len(second.data) // 4 <= _MAX_DIMS:
        raise ValueError("damaged dimensions of a matrix")
    sizes = struct.unpack(f"{order}{len(second.data) // 4}i", second.data)
    if third is None or third.type not in (1, 2) or min(sizes) < 0:
        raise ValueError(f"a damaged head of a matrix of shape {sizes}")
    return Matrix(bits & 0xFF, bool(bits & 0x800), sizes, bytes(third.data).decode("latin-1"), data[third.end :])


def field_names(matrix: Matrix, order: str) -> list[str]:
    """Return the names of a structure's fields, which the first two elements of its content tell."""
    parts = elements(matrix.content, order)
    width, names = next(parts, None), next(parts, None)
    size = int.from_bytes(width.data, "little" if order == "<" else "big") if width else 0
    if names is None or size < 1 or len(names.data) % size:
        raise ValueError("damaged names of fields")
    plain = bytes(names.data)
    return [plain[k : k + size].partition(b"\0")[0].decode("latin-1") for k in range(0, len(plain), size)]


def numbers(matrix: Matrix, order: str) -> Array:
    """Return the content of a matrix of real numbers, squeezed."""
    if matrix.kind not in NUMBERS or matrix.is_complex:
        raise ValueError("complex numbers" if matrix.is_complex else "something else than numbers")
    content = next(elements(matrix.content, order), None)
    if content is None or content.type not in _TYPES:
        raise ValueError("numbers of an unknown type" if content else "a matrix without its numbers")
    dtype = np.dtype(order + _TYPES[content.type])
    if len(content.data) != math.prod(matrix.dims) * dtype.itemsize:
        raise ValueError(f"{len(content.data)} bytes for a matrix of shape {matrix.dims}")
    values = np.frombuffer(content.data, dtype).astype(np.float64)
    return values.reshape(matrix.dims, order="F").squeeze()


def text(matrix: Matrix, order: str) -> str | None:
    """Return the content of a matrix that is one line of text, else None."""
    return _characters(matrix, order) if matrix.kind == TEXT and matrix.dims[0] == 1 else None


def _lines(matrix: Matrix, order: str) -> NDArray[np.object_] | None:
    """Return the lines of a matrix of characters, as `char` makes it, without the blanks behind them."""
    characters, n_lines = _characters(matrix, order), matrix.dims[0]
    if characters is None or len(characters) != math.prod(matrix.dims):
        return None
    return np.array([characters[k::n_lines].rstrip() for k in range(n_lines)], dtype=object)


def _characters(matrix: Matrix, order: str) -> str | None:
    content = next(elements(matrix.content, order), None)
    if content is None or content.type not in _ENCODINGS or len(matrix.dims) != 2:
        return None
    encoding = _ENCODINGS[content.type]
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if order == "<" else "-be"
    return bytes(content.data).decode(encoding)

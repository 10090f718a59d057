"""The structure of MATLAB files of version 5 to 7.2: tags, elements, matrices. Every size is checked before use.

Source: The MathWorks, "MAT-File Format", version 5. A file is a header of 128 bytes and elements, each a tag (type,
number of bytes) and its data; a matrix is an element of elements: flags, dimensions, name, and the content of its
class. Only the requested variables are read, and no size in the file is trusted.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Container, Iterator
from typing import NamedTuple

import numpy as np

from kineme.io.limits import check_expanded
from kineme.validation import Array

HEADER = 128  # bytes
CELL, STRUCT, TEXT, NUMBERS = 1, 2, 4, range(6, 16)  # classes of matrices

_MATRIX, _COMPRESSED = 14, 15  # types of elements
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_OPAQUE = 17  # class of MATLAB's strings, tables and other objects
_PEEK = 4096  # bytes of a compressed matrix that hold its name
_MAX_DIMS = 32


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
    """The byte order ``"<"`` or ``">"`` of the header; a `ValueError` if this is not a file of version 5."""
    order = {b"\0\1IM": "<", b"\1\0MI": ">"}.get(data[HEADER - 4 : HEADER])
    if order is None:
        raise ValueError("something foreign or truncated")
    return order


def elements(data: memoryview, order: str) -> Iterator[Element]:
    """Consecutive elements; a `ValueError` if one ends beyond the data."""
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


def matrices(data: bytes, order: str, wanted: Container[str]) -> dict[str, Matrix]:
    """The variables with these names; others are neither decompressed nor read."""
    variables, taken = {}, 0
    for element in elements(memoryview(data)[HEADER:], order):
        if element.type == _COMPRESSED:
            matrix = _expanded(element.data, order, wanted)
        elif element.type == _MATRIX:
            matrix = as_matrix(element, order)
        else:
            raise ValueError(f"an element of type {element.type} in place of a variable")
        if matrix.name in wanted:
            taken += len(matrix.content)
            check_expanded(taken)
            variables[matrix.name] = matrix
    return variables


def _expanded(packed: memoryview, order: str, wanted: Container[str]) -> Matrix:
    """The matrix in a compressed element; only its header if its name is not wanted."""
    stream = zlib.decompressobj()
    head = stream.decompress(packed, _PEEK)
    if len(head) < 8:
        raise ValueError("a truncated compressed variable")
    kind, size = struct.unpack_from(f"{order}II", head)
    if kind != _MATRIX:
        raise ValueError(f"a compressed element of type {kind} in place of a variable")
    matrix = _matrix(memoryview(head)[8 : 8 + size], order)
    if matrix.name not in wanted:
        return matrix
    check_expanded(size)
    whole = head + stream.decompress(stream.unconsumed_tail, max(1, 8 + size + 1 - len(head)))
    if len(whole) != 8 + size or not stream.eof:
        raise ValueError("a truncated or damaged compressed variable")
    return _matrix(memoryview(whole)[8:], order)


def as_matrix(element: Element, order: str) -> Matrix:
    """An element as a matrix; an element without data is an empty matrix."""
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
    """The names of a structure's fields, which the first two elements of its content tell."""
    parts = elements(matrix.content, order)
    width, names = next(parts, None), next(parts, None)
    size = int.from_bytes(width.data, "little" if order == "<" else "big") if width else 0
    if names is None or size < 1 or len(names.data) % size:
        raise ValueError("damaged names of fields")
    plain = bytes(names.data)
    return [plain[k : k + size].partition(b"\0")[0].decode("latin-1") for k in range(0, len(plain), size)]


def numbers(matrix: Matrix, order: str) -> Array:
    """The content of a matrix of real numbers, squeezed."""
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
    """The content of a matrix that is one line of text, else None."""
    content = next(elements(matrix.content, order), None) if matrix.kind == TEXT else None
    if content is None or content.type not in _ENCODINGS or len(matrix.dims) != 2 or matrix.dims[0] != 1:
        return None
    encoding = _ENCODINGS[content.type]
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if order == "<" else "-be"
    return bytes(content.data).decode(encoding)

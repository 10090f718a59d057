"""Vectors of 16 numbers for compiled functions, one number for each of 16 pairs.

A compiled function that works on such a vector as if it were one number processes 16 pairs at once. The processor's
vectors may be shorter: LLVM then uses several of them. Every pair goes through the same operations, so its result
depends neither on its lane nor on the pairs beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic, models, register_model

from kineme.runtime.compiled import jit

LANES = 16

_FLOAT, _INT = ir.VectorType(ir.FloatType(), LANES), ir.VectorType(ir.IntType(32), LANES)


class _Lanes(types.Type):
    def __init__(self, name: str, vector: ir.VectorType) -> None:
        super().__init__(name=name)
        self.vector = vector


class _Integers(_Lanes):
    pass


_floats, _integers = _Lanes("16 x float32", _FLOAT), _Integers("16 x int32", _INT)


class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, lanes: _Lanes) -> None:
        super().__init__(manager, lanes, lanes.vector)  # type: ignore[no-untyped-call]


register_model(_Lanes)(_Model)
register_model(_Integers)(_Model)


_operation: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic


def _constant(value: float | int, vector: ir.VectorType) -> ir.Constant:
    return ir.Constant(vector, [value] * LANES)


def _splat(builder: Any, value: Any, vector: ir.VectorType) -> Any:
    lanes = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(lanes, lanes, _constant(0, _INT))


def _row(context: Any, builder: Any, array: Any, row: Any) -> Any:
    """Return where row `row` of an array (n, 16) begins, as the address of a vector."""
    kind, value = array
    data = context.make_array(kind)(context, builder, value).data
    first = builder.gep(data, [builder.mul(row, ir.Constant(row.type, LANES))])
    return builder.bitcast(first, (_FLOAT if kind.dtype == types.float32 else _INT).as_pointer())


@_operation
def load(_context, array, row):  # type: ignore[no-untyped-def]
    """Row `row` of a C-contiguous array (n, 16), float32 or int32."""

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        place = _row(context, builder, (signature.args[0], values[0]), values[1])
        return builder.load(place, align=4)

    lanes = _floats if array.dtype == types.float32 else _integers
    return lanes(array, types.intp), code


@_operation
def store(_context, array, row, lanes):  # type: ignore[no-untyped-def]
    """Write `lanes` to row `row` of a C-contiguous array (n, 16)."""

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        builder.store(values[2], _row(context, builder, (signature.args[0], values[0]), values[1]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), code


@_operation
def transpose(_context, rows, chosen, column, factor, array, row):  # type: ignore[no-untyped-def]
    """``array[row + k, lane] = factor rows[chosen[lane], column + k]`` for 16 k and 16 lanes.

    `rows` (n, length) is C-contiguous, float32, `chosen` an array of 16 indices.
    """

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        source = context.make_array(signature.args[0])(context, builder, values[0])
        picked = context.make_array(signature.args[1])(context, builder, values[1]).data
        length = builder.extract_value(source.shape, 1)
        lanes = []
        for lane in range(LANES):
            index = builder.load(builder.gep(picked, [ir.Constant(ir.IntType(64), lane)]))
            at = builder.gep(source.data, [builder.add(builder.mul(index, length), values[2])])
            lanes.append(builder.load(builder.bitcast(at, _FLOAT.as_pointer()), align=4))
        first = _row(context, builder, (signature.args[4], values[4]), values[5])
        each = _splat(builder, values[3], _FLOAT)
        for k, vector in enumerate(_transposed(builder, lanes)):
            at = builder.gep(first, [ir.Constant(ir.IntType(64), k)])
            builder.store(builder.fmul(vector, each), at, align=4)
        return context.get_dummy_value()

    return types.void(rows, chosen, types.intp, types.float32, array, types.intp), code


def _transposed(builder: Any, vectors: list[Any]) -> list[Any]:
    """Blocks of 1, 2, 4, 8 lanes change places with those of the vector so many further on."""
    vectors = list(vectors)
    for size in (1, 2, 4, 8):
        low = [lane if not lane & size else LANES + lane - size for lane in range(LANES)]
        high = [lane + size if not lane & size else LANES + lane for lane in range(LANES)]
        masks = [ir.Constant(_INT, mask) for mask in (low, high)]
        for i in range(LANES):
            if not i & size:
                pair = vectors[i], vectors[i + size]
                vectors[i], vectors[i + size] = (builder.shuffle_vector(*pair, mask) for mask in masks)
    return vectors


@_operation
def load_vector(_context, array, row, dims):  # type: ignore[no-untyped-def]
    """Load as many rows of an array (n, 16), from `row` on, as the tuple `dims` is long, as a tuple."""
    return _load_tuple(array, dims, len(dims))


@_operation
def load_matrix(_context, array, row, dims):  # type: ignore[no-untyped-def]
    """Load as many rows as the square of that."""
    return _load_tuple(array, dims, len(dims) ** 2)


def _load_tuple(array: Any, dims: Any, n: int) -> Any:
    vector = types.UniTuple(_floats, n)  # type: ignore[no-untyped-call]

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        first = _row(context, builder, (signature.args[0], values[0]), values[1])
        return context.make_tuple(builder, vector, _following(builder, first, n))

    return vector(array, types.intp, dims), code


@_operation
def store_vector(_context, array, row, vector):  # type: ignore[no-untyped-def]
    """Write the members of a tuple to an array (n, 16), from `row` on."""

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        first = _row(context, builder, (signature.args[0], values[0]), values[1])
        for k in range(len(vector)):
            at = builder.gep(first, [ir.Constant(ir.IntType(64), k)])
            builder.store(builder.extract_value(values[2], k), at, align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, vector), code


@_operation
def plus_squares(_context, total, vector, array, row):  # type: ignore[no-untyped-def]
    """``total + sum_k (vector[k] - array[row + k])^2``."""

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        first = _row(context, builder, (signature.args[2], values[2]), values[3])
        result = values[0]
        for k, other in enumerate(_following(builder, first, len(vector))):
            difference = builder.fsub(builder.extract_value(values[1], k), other)
            result = builder.fadd(result, builder.fmul(difference, difference))
        return result

    return _floats(total, vector, array, types.intp), code


@_operation
def product(_context, vector, array, row):  # type: ignore[no-untyped-def]
    """``sum_k vector[k] array[row + k]``."""

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        first = _row(context, builder, (signature.args[1], values[1]), values[2])
        members = [builder.extract_value(values[0], k) for k in range(len(vector))]
        return _sum_of_products(builder, members, _following(builder, first, len(vector)))

    return _floats(vector, array, types.intp), code


@_operation
def rotated(_context, matrix, vector):  # type: ignore[no-untyped-def]
    """``sum_h matrix[k d + h] vector[h]`` for each k, as a tuple."""

    def code(context, builder, signature, values):  # type: ignore[no-untyped-def]
        d = len(vector)
        entries = [builder.extract_value(values[0], k) for k in range(d * d)]
        members = [builder.extract_value(values[1], k) for k in range(d)]
        sums = [_sum_of_products(builder, entries[k * d : k * d + d], members) for k in range(d)]
        return context.make_tuple(builder, signature.return_type, sums)

    return vector(matrix, vector), code


def _following(builder: Any, first: Any, n: int) -> list[Any]:
    """The n vectors from an address on."""
    places = [builder.gep(first, [ir.Constant(ir.IntType(64), k)]) for k in range(n)]
    return [builder.load(at, align=4) for at in places]


def _sum_of_products(builder: Any, a: list[Any], b: list[Any]) -> Any:
    result = builder.fmul(a[0], b[0])
    for x, y in zip(a[1:], b[1:], strict=True):
        result = builder.fadd(result, builder.fmul(x, y))
    return result


@_operation
def every(_context, value):  # type: ignore[no-untyped-def]
    """One float32 in every lane."""

    def code(_context, builder, _signature, values):  # type: ignore[no-untyped-def]
        return _splat(builder, values[0], _FLOAT)

    return _floats(types.float32), code


@_operation
def bit(_context, position):  # type: ignore[no-untyped-def]
    """The integer with only bit `position` set, in every lane."""

    def code(_context, builder, _signature, values):  # type: ignore[no-untyped-def]
        shift = builder.trunc(values[0], ir.IntType(32))
        return _splat(builder, builder.shl(ir.Constant(ir.IntType(32), 1), shift), _INT)

    return _integers(types.intp), code


def _of_two(write: Callable[[Any, Any, Any], Any]) -> Callable[..., Any]:
    """An operation on two vectors of floats, which ``write(builder, a, b)`` builds."""

    @_operation
    def operation(_context, a, b):  # type: ignore[no-untyped-def]
        return _floats(a, b), lambda _c, builder, _s, values: write(builder, *values)

    return operation


plus = _of_two(lambda builder, a, b: builder.fadd(a, b))
minus = _of_two(lambda builder, a, b: builder.fsub(a, b))
times = _of_two(lambda builder, a, b: builder.fmul(a, b))
least = _of_two(lambda builder, a, b: builder.select(builder.fcmp_ordered("<", a, b), a, b))
largest = _of_two(lambda builder, a, b: builder.select(builder.fcmp_ordered(">", a, b), a, b))


@_operation
def root(_context, a):  # type: ignore[no-untyped-def]
    """Square root."""

    def code(_context, builder, _signature, v):  # type: ignore[no-untyped-def]
        kind = ir.FunctionType(_FLOAT, [_FLOAT])
        function = builder.module.declare_intrinsic(f"llvm.sqrt.v{LANES}f32", fnty=kind)
        return builder.call(function, [v[0]])

    return _floats(a), code


@_operation
def if_less(_context, a, b, yes, no):  # type: ignore[no-untyped-def]
    """`yes` where a < b, else `no`: integers."""

    def code(_context, builder, _signature, v):  # type: ignore[no-untyped-def]
        return builder.select(builder.fcmp_ordered("<", v[0], v[1]), v[2], v[3])

    return _integers(a, b, yes, no), code


@_operation
def union(_context, a, b):  # type: ignore[no-untyped-def]
    """Bits that are set in either integer."""
    return _integers(a, b), lambda _c, builder, _s, v: builder.or_(v[0], v[1])


@_operation
def unless(_context, bits, mask, value):  # type: ignore[no-untyped-def]
    """`value` where `bits` and `mask` share no bit, else 0."""

    def code(_context, builder, _signature, v):  # type: ignore[no-untyped-def]
        free = builder.icmp_signed("==", builder.and_(v[0], v[1]), _constant(0, _INT))
        return builder.select(free, v[2], _constant(0.0, _FLOAT))

    return _floats(bits, mask, value), code


@jit
def aligned(n_rows):  # type: ignore[no-untyped-def]
    """An array (n_rows, 16) of float32 in which every row is a cache line."""
    block = np.empty((n_rows + 1) * LANES, np.float32)
    first = (-block.ctypes.data // 4) % LANES
    return block[first : first + n_rows * LANES].reshape(n_rows, LANES)

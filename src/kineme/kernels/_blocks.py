"""Blocks of 16 movements for compiled distances of pairs: one movement in each lane. Importing this imports Numba.

The rows of a block are the numbers of a movement's shape, one array after the other, as `begins_of` says, each times
the root of its weight. The tuple `dims` is as long as a movement has dimensions: its type tells the compiler that
number.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kineme.kernels._lanes import (
    LANES,
    aligned,
    every,
    load_matrix,
    load_vector,
    product,
    rotated,
    store,
    store_vector,
    times,
    transpose,
)
from kineme.runtime.compiled import jit

_jit = partial(jit, reorder=False)


class Work(NamedTuple):
    """Blocks and rows of vectors that one call uses again and again."""

    a: Any  # block of the one movements
    b: Any  # and of the others
    turned: Any  # the others, rotated
    rotation: Any  # (d^2, 16)
    elastic: Any  # (n_segments + 1, 16): the row of the elastic distance's table
    turning: Any  # the same of turning alone
    rows: Any  # (n_points, 16): distance of each point of a to its nearest
    columns: Any  # and of b
    nearest: Any  # (n_points, 16), integers: the bit of the point of a that is nearest to each of b
    squares: Any  # (3, 16): the result


@_jit
def new_work(dims, sizes):  # type: ignore[no-untyped-def]
    d = len(dims)
    n_segments, _, n_points = sizes
    n_rows = n_segments * (2 * d + 1) + n_points * (2 * d + 2)
    return Work(
        aligned(n_rows),
        aligned(n_rows),
        aligned(n_rows),
        aligned(d * d),
        aligned(n_segments + 1),
        aligned(n_segments + 1),
        aligned(n_points),
        aligned(n_points),
        np.zeros((n_points, LANES), np.int32),
        aligned(3),
    )


@_jit
def begins_of(dims, sizes):  # type: ignore[no-untyped-def]
    """First rows of tangents, midpoints, turning angles; points, their tangents, turning angles, half squared lengths.

    The length is that of the weighted tangent of a point.
    """
    n_segments, _, n_points = sizes
    t, points = n_segments * len(dims), n_segments * (2 * len(dims) + 1)
    x = n_points * len(dims)
    return 0, t, 2 * t, points, points + x, points + 2 * x, points + 2 * x + n_points


@_jit
def pack(dims, shapes, chosen, numbers, block):  # type: ignore[no-untyped-def]
    """Put the movement ``chosen[lane]`` into each lane of a block."""
    weights, sizes = numbers
    begins = begins_of(dims, sizes)
    for part in range(6):
        rows, weight, begin = shapes[part], weights[part], begins[part]
        length = rows.shape[1]
        if length < LANES:
            for lane in range(LANES):
                for k in range(length):
                    block[begin + k, lane] = rows[chosen[lane], k] * weight
        else:
            for k in range(0, length - LANES, LANES):
                transpose(rows, chosen, k, weight, block, begin + k)
            transpose(rows, chosen, length - LANES, weight, block, begin + length - LANES)
    _add_halves(dims, numbers, block)


@_jit
def pack_everywhere(dims, shapes, i, numbers, block):  # type: ignore[no-untyped-def]
    """Put movement i into every lane of a block."""
    weights, sizes = numbers
    begins = begins_of(dims, sizes)
    for part in range(6):
        row = shapes[part][i]
        for k in range(len(row)):
            store(block, begins[part] + k, every(row[k] * weights[part]))
    _add_halves(dims, numbers, block)


@_jit
def _add_halves(dims, numbers, block):  # type: ignore[no-untyped-def]
    weights, sizes = numbers
    begins = begins_of(dims, sizes)
    factor = every(np.float32(0.5) * weights[4] * weights[4])
    for p in range(sizes[2]):
        row = begins[4] + p * len(dims)
        squared = product(load_vector(block, row, dims), block, row)
        store(block, begins[6] + p, times(factor, squared))


@_jit
def take_rotation(dims, rotations, i, j, block, lane):  # type: ignore[no-untyped-def]
    d = len(dims)
    if rotations.shape[2] == 0:
        for k in range(d * d):
            block[k, lane] = k % (d + 1) == 0
    elif rotations.shape[2] == d * d:
        for k in range(d * d):
            block[k, lane] = rotations[i, j, k]
    else:
        c, s = rotations[i, j, 0], rotations[i, j, 1]
        block[0, lane], block[1, lane] = c, -s
        block[2, lane], block[3, lane] = s, c


@_jit
def rotate(dims, sizes, work):  # type: ignore[no-untyped-def]
    """Rotate the tangents, midpoints and points of b; nothing else is written to `turned`."""
    begins = begins_of(dims, sizes)
    matrix, b, turned = load_matrix(work.rotation, 0, dims), work.b, work.turned
    for first, end in ((begins[0], begins[2]), (begins[3], begins[5])):
        for row in range(first, end, len(dims)):
            store_vector(turned, row, rotated(matrix, load_vector(b, row, dims)))

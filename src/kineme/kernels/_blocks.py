"""Blocks of 16 movements for compiled distances of pairs: one movement in each lane. Importing this imports Numba.

The rows of a block are, for each segment, tangent, midpoint and turning angle, and for each point, position, turning
angle, tangent and half its squared length, each times the root of its weight. The tuple `dims` is as long as a movement
has dimensions: its type tells the compiler that number.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kineme.kernels._lanes import LANES, aligned, every, load, load_matrix, load_vector, rotated, store, store_vector
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
def pack(dims, shapes, i, weights, block, lane):  # type: ignore[no-untyped-def]
    """Put movement i into a lane of a block."""
    tangents, midpoints, turning, points, point_tangents, point_turning = shapes
    position, turn, cloud_turn, line = weights
    d, row = len(dims), 0
    for p in range(tangents.shape[1]):
        for k in range(d):
            block[row + k, lane] = tangents[i, p, k]
            block[row + d + k, lane] = midpoints[i, p, k] * position
        block[row + 2 * d, lane] = turning[i, p] * turn
        row += 2 * d + 1
    for p in range(points.shape[1]):
        half = np.float32(0)
        for k in range(d):
            block[row + k, lane] = points[i, p, k]
            t = point_tangents[i, p, k] * line
            block[row + d + 1 + k, lane] = t
            half += t * t
        block[row + d, lane] = point_turning[i, p] * cloud_turn
        block[row + 2 * d + 1, lane] = np.float32(0.5) * line * line * half
        row += 2 * d + 2


@_jit
def pack_everywhere(dims, shapes, i, weights, block):  # type: ignore[no-untyped-def]
    """Put movement i into every lane of a block."""
    pack(dims, shapes, i, weights, block, 0)
    for row in range(len(block)):
        store(block, row, every(block[row, 0]))


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
def rotate(dims, n_segments, n_points, work):  # type: ignore[no-untyped-def]
    d, row = len(dims), 0
    matrix, b, turned = load_matrix(work.rotation, 0, dims), work.b, work.turned
    for _ in range(n_segments):
        store_vector(turned, row, rotated(matrix, load_vector(b, row, dims)))
        store_vector(turned, row + d, rotated(matrix, load_vector(b, row + d, dims)))
        store(turned, row + 2 * d, load(b, row + 2 * d))
        row += 2 * d + 1
    for _ in range(n_points):
        store_vector(turned, row, rotated(matrix, load_vector(b, row, dims)))
        store_vector(turned, row + d + 1, rotated(matrix, load_vector(b, row + d + 1, dims)))
        store(turned, row + d, load(b, row + d))
        store(turned, row + 2 * d + 1, load(b, row + 2 * d + 1))
        row += 2 * d + 2

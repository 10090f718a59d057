"""Compiled distances of pairs, twins of those in ``pair_distances.py``: 16 at once.

A block holds 16 movements, one in each lane. Its rows are the numbers of a movement's shape, one array after the other,
as `Work` says, each times the root of its weight. The tuple `dims` is as long as a movement has dimensions: its
type tells the compiler that number.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kineme.kernels._lanes import (
    LANES,
    aligned,
    bit,
    every,
    if_less,
    largest,
    least,
    load,
    load_matrix,
    load_vector,
    minus,
    plus,
    plus_squares,
    product,
    root,
    rotated,
    store,
    store_vector,
    times,
    transpose,
    union,
    unless,
)
from kineme.runtime.compiled import jit

_FAR = np.float32(3e38)
_jit = partial(jit, reorder=False)


@_jit
def fill_grid(dims, sides, by_rows, numbers, rotations, squares):  # type: ignore[no-untyped-def]
    """``squares[:, i, j]``, the three squared distances of every movement of A with every one of B.

    `sides` are (B, A), of which 16 movements of B are compared at once, or with `by_rows` (A, B) and 16 of A, which is
    the same to the last bit. Each has its tangents, midpoints, turning angles, points, their tangents and turning
    angles, a movement's numbers in one row; `numbers` are the roots of their weights, and the sizes: segments, band and
    points; `rotations` (n, m, r) the entries of matrices, r = d^2, or cosine and sine, r = 2, or nothing, r = 0.
    """
    (many, few), (_, sizes) = sides, numbers
    n, m = squares.shape[1], squares.shape[2]
    n_many, n_few = (n, m) if by_rows else (m, n)
    work, chosen = new_work(np.intp(len(dims)), sizes), np.zeros(LANES, np.intp)
    packed, repeated = (work.a, work.b) if by_rows else (work.b, work.a)
    for start in range(0, n_many, LANES):
        width = _choose(start, n_many, chosen)
        pack(work.begins, many, chosen, numbers, packed)
        _add_halves(dims, work.begins, numbers, packed)
        for k in range(n_few):
            if n_few > 1 or start == 0:
                pack_everywhere(work.begins, few, k, numbers, repeated)
                _add_halves(dims, work.begins, numbers, repeated)
            for lane in range(LANES):
                i, j = (chosen[lane], k) if by_rows else (k, chosen[lane])
                take_rotation(rotations[i, j], work.d, work.rotation, lane)
            _compare(dims, sizes, work)
            for part in range(3):
                for lane in range(width):
                    i, j = (start + lane, k) if by_rows else (k, start + lane)
                    squares[part, i, j] = work.squares[part, lane]


@_jit
def fill_listed(dims, sides, pairs, numbers, rotations, squares):  # type: ignore[no-untyped-def]
    """``squares[:, k]`` of listed pairs, two arrays of indices; rotations (n_pairs, 1, r)."""
    (A, B), (_, sizes) = sides, numbers
    n_pairs = len(pairs[0])
    work, first, second = new_work(np.intp(len(dims)), sizes), np.zeros(LANES, np.intp), np.zeros(LANES, np.intp)
    for start in range(0, n_pairs, LANES):
        width = min(LANES, n_pairs - start)
        for lane in range(LANES):
            k = start + min(lane, width - 1)
            first[lane], second[lane] = pairs[0][k], pairs[1][k]
            take_rotation(rotations[k, 0], work.d, work.rotation, lane)
        pack(work.begins, A, first, numbers, work.a)
        _add_halves(dims, work.begins, numbers, work.a)
        pack(work.begins, B, second, numbers, work.b)
        _add_halves(dims, work.begins, numbers, work.b)
        _compare(dims, sizes, work)
        for k in range(3):
            for lane in range(width):
                squares[k, start + lane] = work.squares[k, lane]


@_jit
def fill_bounds(dims, sides, numbers, rotations, every_segment, squares):  # type: ignore[no-untyped-def]
    """``squares[:2, i, j]`` as `elastic_bounds`, ``squares[2, i, j]`` of clouds if there is room; 16 of A at once."""
    (A, B), (_, sizes) = sides, numbers
    n, m = squares.shape[1], squares.shape[2]
    work, first = new_work(np.intp(len(dims)), sizes), np.zeros(LANES, np.intp)
    for start in range(0, n, LANES):
        width = _choose(start, n, first)
        pack(work.begins, A, first, numbers, work.a)
        _add_halves(dims, work.begins, numbers, work.a)
        for j in range(m):
            for lane in range(LANES):
                take_rotation(rotations[first[lane], j], work.d, work.rotation, lane)
            _bound(dims, B, j, numbers, every_segment, work)
            if len(squares) == 3:
                pack_everywhere(work.begins, B, j, numbers, work.b)
                _add_halves(dims, work.begins, numbers, work.b)
                rotate(dims, sizes, work)
                _match(dims, sizes, work)
            for k in range(len(squares)):
                for lane in range(width):
                    squares[k, start + lane, j] = work.squares[k, lane]


@_jit
def _choose(start, n, chosen):  # type: ignore[no-untyped-def]
    """The next 16 of n movements, the last one again where fewer remain; return how many there are."""
    width = min(LANES, n - start)
    for lane in range(LANES):
        chosen[lane] = start + min(lane, width - 1)
    return width


@_jit
def _bound(dims, shapes, j, numbers, every_segment, work):  # type: ignore[no-untyped-def]
    """Sums of the least costs of some segments of movement j."""
    weights, sizes = numbers
    (n_segments, band, _), d, a, other = sizes, len(dims), work.a, work.b
    _, midpoints, angles = work.begins[:3]
    matrix = load_matrix(work.rotation, 0, dims)
    elastic, turning = every(np.float32(0)), every(np.float32(0))
    for q in range(every_segment // 2, n_segments, every_segment):
        for k in range(d):
            store(other, k, every(shapes[0][j, q * d + k] * weights[0]))
            store(other, d + k, every(shapes[1][j, q * d + k] * weights[1]))
        tangent, midpoint = rotated(matrix, load_vector(other, 0, dims)), rotated(matrix, load_vector(other, d, dims))
        turn = every(shapes[2][j, q] * weights[2])
        smallest, smallest_turning = every(_FAR), every(_FAR)
        for p in range(max(0, q - band), min(n_segments, q + band + 1)):
            difference = minus(turn, load(a, angles + p))
            cost = times(difference, difference)
            smallest_turning = least(cost, smallest_turning)
            cost = plus_squares(plus_squares(cost, tangent, a, p * d), midpoint, a, midpoints + p * d)
            smallest = least(cost, smallest)
        elastic, turning = plus(elastic, smallest), plus(turning, smallest_turning)
    share = every(np.float32(1) / np.float32(n_segments))
    store(work.squares, 0, times(share, elastic))
    store(work.squares, 1, times(share, turning))


@_jit
def _compare(dims, sizes, work):  # type: ignore[no-untyped-def]
    rotate(dims, sizes, work)
    _warp(dims, sizes, work)
    _match(dims, sizes, work)


@_jit
def _warp(dims, sizes, work):  # type: ignore[no-untyped-def]
    """Dynamic time warping of both costs, row by row of their tables; column q is kept in row q + 1 of an array."""
    a, b, turned, elastic, turning = work.a, work.b, work.turned, work.elastic, work.turning
    (n_segments, band, _), d, far = sizes, len(dims), every(_FAR)
    _, midpoints, angles = work.begins[:3]
    for q in range(n_segments + 1):
        store(elastic, q, far)
        store(turning, q, far)
    store(elastic, 0, every(np.float32(0)))
    store(turning, 0, every(np.float32(0)))
    for p in range(n_segments):
        tangent, midpoint = load_vector(a, p * d, dims), load_vector(a, midpoints + p * d, dims)
        turn = load(a, angles + p)
        first, end = max(0, p - band), min(n_segments, p + band + 1)
        corner, corner_turning = load(elastic, first), load(turning, first)
        left, left_turning = far, far
        store(elastic, first, far)
        store(turning, first, far)
        for q in range(first, end):
            difference = minus(turn, load(b, angles + q))
            cost = times(difference, difference)
            above, above_turning = load(elastic, q + 1), load(turning, q + 1)
            left_turning = plus(cost, least(least(above_turning, corner_turning), left_turning))
            cost = plus_squares(plus_squares(cost, tangent, turned, q * d), midpoint, turned, midpoints + q * d)
            left = plus(cost, least(least(above, corner), left))
            store(elastic, q + 1, left)
            store(turning, q + 1, left_turning)
            corner, corner_turning = above, above_turning
    share = every(np.float32(1) / np.float32(n_segments))
    store(work.squares, 0, times(share, load(elastic, n_segments)))
    store(work.squares, 1, times(share, load(turning, n_segments)))


@_jit
def _match(dims, sizes, work):  # type: ignore[no-untyped-def]
    """Distances of the points of each movement to their nearest, and of those that nobody matched."""
    a, b, turned, columns, nearest = work.a, work.b, work.turned, work.columns, work.nearest
    n_points, d, zero, far = sizes[2], len(dims), every(np.float32(0)), every(_FAR)
    points, tangents, angles, halves = work.begins[3:]
    for q in range(n_points):
        store(columns, q, far)
    matched = bit(0)
    for p in range(n_points):
        point, tangent = load_vector(a, points + p * d, dims), load_vector(a, tangents + p * d, dims)
        turn, half = load(a, angles + p), load(a, halves + p)
        smallest, at, own = far, bit(0), bit(p)
        for q in range(n_points):
            difference = minus(turn, load(b, angles + q))
            both = product(tangent, turned, tangents + q * d)
            cost = plus_squares(plus(half, load(b, halves + q)), point, turned, points + q * d)
            cost = minus(plus(cost, times(difference, difference)), times(both, both))
            at = if_less(cost, smallest, bit(q), at)
            smallest = least(cost, smallest)
            column = load(columns, q)
            store(nearest, q, if_less(cost, column, own, load(nearest, q)))
            store(columns, q, least(cost, column))
        matched = union(matched, at) if p > 0 else at
        store(work.rows, p, root(largest(smallest, zero)))
    _sum_up(n_points, matched, work)


@_jit
def _sum_up(n_points, matched, work):  # type: ignore[no-untyped-def]
    """The smaller of the two directed sums: of all points of one movement, and the other's that these left out."""
    forth, back, matched_back = every(np.float32(0)), every(np.float32(0)), load(work.nearest, 0)
    for q in range(n_points):
        distance = root(largest(load(work.columns, q), every(np.float32(0))))
        back = plus(back, distance)
        forth = plus(forth, unless(matched, bit(q), distance))
        matched_back = union(matched_back, load(work.nearest, q))
    for p in range(n_points):
        distance = load(work.rows, p)
        forth = plus(forth, distance)
        back = plus(back, unless(matched_back, bit(p), distance))
    mean = times(least(forth, back), every(np.float32(1) / np.float32(n_points)))
    store(work.squares, 2, times(mean, mean))


class Work(NamedTuple):
    """Blocks and rows of vectors that one call uses again and again.

    What needs the number of dimensions as a number only takes it from here: it is compiled once, not for each number.
    """

    d: Any  # dimensions
    begins: Any  # first rows in a block: tangents, midpoints, angles; points, weighted tangents, angles, half squares
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
def new_work(d, sizes):  # type: ignore[no-untyped-def]
    n_segments, _, n_points = sizes
    t, points, x = n_segments * d, n_segments * (2 * d + 1), n_points * d
    n_rows = points + n_points * (2 * d + 2)
    return Work(
        d,
        (0, t, 2 * t, points, points + x, points + 2 * x, points + 2 * x + n_points),
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
def pack(begins, shapes, chosen, numbers, block):  # type: ignore[no-untyped-def]
    """Put the movement ``chosen[lane]`` into each lane of a block."""
    weights = numbers[0]
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


@_jit
def pack_everywhere(begins, shapes, i, numbers, block):  # type: ignore[no-untyped-def]
    """Put movement i into every lane of a block."""
    weights = numbers[0]
    for part in range(6):
        row = shapes[part][i]
        for k in range(len(row)):
            store(block, begins[part] + k, every(row[k] * weights[part]))


@_jit
def _add_halves(dims, begins, numbers, block):  # type: ignore[no-untyped-def]
    weights, sizes = numbers
    factor = every(np.float32(0.5) * weights[4] * weights[4])
    for p in range(sizes[2]):
        row = begins[4] + p * len(dims)
        squared = product(load_vector(block, row, dims), block, row)
        store(block, begins[6] + p, times(factor, squared))


@_jit
def take_rotation(rotation, d, block, lane):  # type: ignore[no-untyped-def]
    r = len(rotation)
    if r == 0:
        for k in range(d * d):
            block[k, lane] = k % (d + 1) == 0
    elif r == d * d:
        for k in range(d * d):
            block[k, lane] = rotation[k]
    else:  # of one point of several, which lie along the diagonal
        p = 3 if r == 9 else 2
        for k in range(d * d):
            block[k, lane] = 0
        for first in range(0, d, p):
            at = first * (d + 1)
            if r == 2:
                c, s = rotation[0], rotation[1]
                block[at, lane], block[at + 1, lane] = c, -s
                block[at + d, lane], block[at + d + 1, lane] = s, c
            else:
                for k in range(p):
                    for h in range(p):
                        block[at + k * d + h, lane] = rotation[k * p + h]


@_jit
def rotate(dims, sizes, work):  # type: ignore[no-untyped-def]
    """Rotate the tangents, midpoints and points of b; nothing else is written to `turned`."""
    begins = work.begins
    matrix, b, turned = load_matrix(work.rotation, 0, dims), work.b, work.turned
    for first, end in ((begins[0], begins[2]), (begins[3], begins[5])):
        for row in range(first, end, len(dims)):
            store_vector(turned, row, rotated(matrix, load_vector(b, row, dims)))

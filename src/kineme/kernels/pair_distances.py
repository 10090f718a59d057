"""Elastic, turning and point-cloud distances of many pairs of movements, each after the rotation of its pair.

`kineme.kernels.shapes` and `kineme.kernels.shapes` define them. Movements are described once, by
`kineme.kernels.shapes.shapes_of`. A pair's distances do not depend on the pairs beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.shapes import CloudSpec, ElasticSpec, Floats, Shapes, cloud_squares, elastic_bounds, elastic_squares
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array

Tile = tuple[slice, slice]  # movements of A and of B
Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]  # indices into A and into B
#: Writes to squares (3, n, m) of a tile, whose rotations have the entries (n, m, r).
Filler = Callable[[Shapes, Shapes, Tile, Floats, Floats], None]

_TILE_ROWS, _TILE_PAIRS = 32, 4096  # the columns are packed once for so many rows; a tile takes about a millisecond
_TILE_BOUNDS = 32_768
_LANES = 16  # pairs that the compiled loops compare at once
_LISTED = 1.2  # time of 16 pairs taken from a list, by that of 16 of one movement with others
_TWIN_PAIRS = 1000
_BOUND_EVERY = (
    3  # of how many segments one is compared for a bound: of handwriting as recorded, that leaves one pair in ten
)
_PAIR_OPERATIONS = 10_000  # elementary operations of the plain twins per pair


def pair_distances(A: Shapes, B: Shapes, rotations: NDArray[Any] | None = None) -> Floats:
    """Squared distances (3, n, m) of every movement of A with every one of B: elastic, turning, point cloud.

    - `A`, `B`: n and m movements with the same dimensions d and specifications.
    - `rotations` (n, m, d, d) or, in the plane, (n, m, 2): matrices R, or cosines and sines, that rotate B's movement
      onto A's, float32 fastest. By default nothing is rotated.

    In units of the movements' squared size. The turning distance does not depend on the rotation.
    Raises `SpecificationError`: dimensions, specifications or the shape of the rotations do not fit.
    """
    return _grid(A, B, rotations, (_fill_compiled, _fill_plain), _TILE_PAIRS)


def pair_bounds(A: Shapes, B: Shapes, rotations: NDArray[Any] | None = None) -> Floats:
    """Lower bounds (3, n, m) of what `pair_distances` gives, up to rounding.

    For 16 movements of A or more they take a seventh of its time. See `kineme.kernels.shapes.elastic_bounds`; that of
    the point cloud is 0.
    """
    return _grid(A, B, rotations, (_bound_compiled, _bound_plain), _TILE_BOUNDS)


def listed_distances(
    A: Shapes, B: Shapes, first: NDArray[np.intp], second: NDArray[np.intp], rotations: NDArray[Any] | None = None
) -> Floats:
    """Of k pairs, A's movement ``first[i]`` and B's ``second[i]``, what `pair_distances` gives: (3, k).

    Rotations are (k, d, d) or, in the plane, (k, 2).
    """
    _check(A, B)
    k = len(first)
    entries = np.empty((k, 1, 0), np.float32)
    if rotations is not None:
        _check_rotations(rotations, (k,), A.n_dims)
        entries = np.ascontiguousarray(rotations, np.float32).reshape(k, 1, math.prod(rotations.shape[1:]))
    squares = np.empty((3, k), np.float32)
    if use_compiled(k * _PAIR_OPERATIONS):
        sides, numbers = (_arrays(A, slice(None)), _arrays(B, slice(None))), _numbers(A.elastic, A.cloud)
        pairs = (np.ascontiguousarray(first), np.ascontiguousarray(second))
        compiled_module("kineme.kernels._pairs").fill_listed((0,) * A.n_dims, sides, pairs, numbers, entries, squares)
    else:
        _fill_listed_plain(A, B, (first, second), entries, squares)
    return squares


def _grid(
    A: Shapes, B: Shapes, rotations: NDArray[Any] | None, fillers: tuple[Filler, Filler], tile_pairs: int
) -> Floats:
    """Fill the distances of all pairs by a filler, compiled or plain, tile by tile, in threads."""
    _check(A, B)
    n, m, d = len(A), len(B), A.n_dims
    squares = np.empty((3, n, m), np.float32)
    if n == 0 or m == 0:
        return squares
    compiled = use_compiled(n * m * _PAIR_OPERATIONS)
    fill = fillers[0] if compiled else fillers[1]
    rows = min(n, max(_TILE_ROWS, tile_pairs // m // _LANES * _LANES))
    columns = m if rows * m <= tile_pairs else max(_LANES, tile_pairs // rows // _LANES * _LANES)
    tiles = [
        (slice(i, min(i + rows, n)), slice(j, min(j + columns, m)))
        for i in range(0, n, rows)
        for j in range(0, m, columns)
    ]
    if rotations is not None:
        _check_rotations(rotations, (n, m), d)

    def work(first: int, last: int) -> None:
        for i, j in tiles[first:last]:
            shape = (i.stop - i.start, j.stop - j.start)
            part = np.empty((*shape, 0)) if rotations is None else rotations[i, j].reshape(*shape, -1)
            fill(A, B, (i, j), np.ascontiguousarray(part, np.float32), squares[:, i, j])

    if compiled and len(tiles) == 1:
        work(0, 1)  # one thread, and no BLAS whose threads would have to be held back
    else:
        for_tiles(work, len(tiles), 1)
    return squares


def _check(A: Shapes, B: Shapes) -> None:
    if A.n_dims != B.n_dims:
        raise SpecificationError(
            f"expected movements with the same number of dimensions, got {A.n_dims} and {B.n_dims}; "
            "compare movements in the plane with such, and those in space with such"
        )
    if (A.elastic, A.cloud) != (B.elastic, B.cloud):
        raise SpecificationError(
            f"expected shapes of the same specifications, got {A.elastic}, {A.cloud} and {B.elastic}, {B.cloud}; "
            "make both by shapes_of with the same ones"
        )


def _check_rotations(rotations: NDArray[Any], shape: tuple[int, ...], d: int) -> None:
    if rotations.shape != (*shape, d, d) and (d != 2 or rotations.shape != (*shape, 2)):
        wanted = f"{(*shape, d, d)}" + f" or {(*shape, 2)}" * (d == 2)
        raise SpecificationError(f"expected rotations of shape {wanted}, got {rotations.shape}; pass one for each pair")


def _fill_compiled(A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats) -> None:
    """Write the squared distances (3, n, m) of a tile of pairs, with entries (n, m, r) of their rotations.

    r is d^2, or 2 for cosine and sine, or 0 for no rotation.
    """
    n, m = squares.shape[1:]
    module, numbers = compiled_module("kineme.kernels._pairs"), _numbers(A.elastic, A.cloud)
    sides = (_arrays(A, tile[0]), _arrays(B, tile[1]))
    # Always contiguous, so that one version is compiled.
    result = squares if squares.flags.c_contiguous else np.empty(squares.shape, np.float32)
    by_columns, by_rows, listed = n * -(-m // _LANES), m * -(-n // _LANES), _LISTED * -(-n * m // _LANES)
    if by_columns <= min(by_rows, listed):
        module.fill_grid((0,) * A.n_dims, sides, numbers, entries, result)
    elif by_rows <= listed:
        module.fill_by_rows((0,) * A.n_dims, sides, numbers, entries, result)
    else:
        pairs = np.divmod(np.arange(n * m), m)
        entries = entries.reshape(n * m, 1, -1) if entries.size else np.empty((n * m, 1, 0), np.float32)
        module.fill_listed((0,) * A.n_dims, sides, pairs, numbers, entries, result.reshape(3, -1))
    if result is not squares:
        squares[:] = result


def _fill_plain(A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats) -> None:
    """The same by the plain definitions."""
    pairs, entries = _listed(tile, entries)
    result = np.empty((3, len(pairs[0])), np.float32)
    _fill_listed_plain(A, B, pairs, entries, result)
    squares[:] = result.reshape(squares.shape)


def _listed(tile: Tile, entries: Floats) -> tuple[Pairs, Floats]:
    """The pairs of a tile one by one, and the entries (k, 1, r) of their rotations."""
    n, m = entries.shape[:2]
    first, second = np.divmod(np.arange(n * m), m)
    return (first + tile[0].start, second + tile[1].start), entries.reshape(n * m, 1, entries.shape[2])


def _fill_listed_plain(A: Shapes, B: Shapes, pairs: Pairs, entries: Floats, squares: Floats) -> None:
    """Write the squared distances (3, k) of listed pairs."""
    for part, R in _parts(entries, A.n_dims):
        chosen = (pairs[0][part], pairs[1][part])
        squares[:2, part] = elastic_squares(A, B, *chosen, R)
        squares[2, part] = cloud_squares(A, B, *chosen, R)


def _parts(entries: Floats, d: int) -> Iterator[tuple[slice, Array | None]]:
    """Slices of the pairs, as many as are compared at once, with their matrices."""
    matrices = _matrices(entries, d)
    for start in range(0, len(entries), _TWIN_PAIRS):
        part = slice(start, start + _TWIN_PAIRS)
        yield part, None if matrices is None else matrices[part]


def _bound_compiled(A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats) -> None:
    """Write lower bounds of the squared distances (3, n, m) of a tile of pairs."""
    module, sides = compiled_module("kineme.kernels._pairs"), (_arrays(A, tile[0]), _arrays(B, tile[1]))
    result = np.empty((2, *squares.shape[1:]), np.float32)
    module.fill_bounds((0,) * A.n_dims, sides, _numbers(A.elastic, A.cloud), entries, _BOUND_EVERY, result)
    squares[:2], squares[2] = result, 0


def _bound_plain(A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats) -> None:
    """The same by the plain definition."""
    shape, (pairs, entries) = squares.shape[1:], _listed(tile, entries)
    result = np.zeros((3, len(entries)), np.float32)
    for part, R in _parts(entries, A.n_dims):
        result[:2, part] = elastic_bounds(A, B, pairs[0][part], pairs[1][part], R, _BOUND_EVERY)
    squares[:] = result.reshape(3, *shape)


def _matrices(entries: Floats, d: int) -> Array | None:
    """Rotations (k, d, d) of their entries (k, 1, r)."""
    if entries.shape[2] == 0:
        return None
    if entries.shape[2] == d * d:
        return entries.reshape(-1, d, d).astype(float)
    c, s = entries.reshape(-1, 2).T.astype(float)
    return np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2)


def _arrays(shapes: Shapes, chosen: slice) -> tuple[Floats, ...]:
    """Return what the compiled loops read of some movements: the numbers of each in one row."""
    s, segments, points = shapes, shapes.elastic.n_segments * shapes.n_dims, shapes.cloud.n_points * shapes.n_dims
    return (
        s.tangents[chosen].reshape(-1, segments),
        s.midpoints[chosen].reshape(-1, segments),
        s.turning[chosen],
        s.points[chosen].reshape(-1, points),
        s.point_tangents[chosen].reshape(-1, points),
        s.point_turning[chosen],
    )


@lru_cache(maxsize=64)
def _numbers(elastic: ElasticSpec, cloud: CloudSpec) -> tuple[tuple[np.float32, ...], tuple[int, int, int]]:
    """Roots of the weights of those arrays, and the numbers of segments, band and points."""
    weights = (1.0, elastic.position_weight, elastic.turning_weight, 1.0, cloud.line_weight**0.5, cloud.turning_weight)
    return tuple(np.float32(weight**0.5) for weight in weights), (elastic.n_segments, elastic.band, cloud.n_points)

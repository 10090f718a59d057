"""Elastic, turning and point-cloud distances of many pairs of movements, each after the rotation of its pair.

`kineme.kernels.elastic` and `kineme.kernels.point_cloud` define them. Movements are described once, by
`kineme.kernels.shapes.shapes_of`. A pair's distances do not depend on the pairs beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.elastic import Indices, elastic_squares
from kineme.kernels.point_cloud import cloud_squares
from kineme.kernels.shapes import Floats, Shapes
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array

#: The rotations of a tile of pairs, called with the slices of its rows and columns; in several threads at once.
RotationsOfTile = Callable[[slice, slice], NDArray[Any]]

_TILE_ROWS, _TILE_PAIRS = 32, 4096  # the columns are packed once for so many rows; a tile takes about a millisecond
_FEW_COLUMNS = 8  # with so few, most lanes of a row would be idle: its pairs are taken as a list
_TWIN_PAIRS = 1000
_PAIR_OPERATIONS = 10_000  # elementary operations of the plain twins per pair


def pair_distances(A: Shapes, B: Shapes, rotations: NDArray[Any] | RotationsOfTile | None = None) -> Floats:
    """Squared distances (3, n, m) of every movement of A with every one of B: elastic, turning, point cloud.

    Parameters
    ----------
    A, B : Shapes
        n and m movements with the same dimensions d and specifications.
    rotations : array (n, m, d, d) or, in the plane, (n, m, 2), optional
        Matrices R, or cosines and sines, that rotate B's movement onto A's, float32 fastest; or a function that returns
        them for the slices of rows and columns of a tile of pairs, so that they never are in memory all at once. By
        default nothing is rotated.

    Returns
    -------
    array (3, n, m) of float32
        In units of the movements' squared size. The turning distance does not depend on the rotation.

    Raises
    ------
    SpecificationError
        Dimensions, specifications or the shape of the rotations do not fit.
    """
    _check(A, B)
    n, m, d = len(A), len(B), A.n_dims
    squares = np.empty((3, n, m), np.float32)
    if n == 0 or m == 0:
        return squares
    fill = _filler(A, B, n * m)
    rows = min(n, max(_TILE_ROWS, _TILE_PAIRS // m))
    columns = max(16, _TILE_PAIRS // rows // 16 * 16)
    tiles = [
        (slice(i, min(i + rows, n)), slice(j, min(j + columns, m)))
        for i in range(0, n, rows)
        for j in range(0, m, columns)
    ]
    if rotations is not None and not callable(rotations):
        _as_entries(rotations, (n, m), d)

    def work(first: int, last: int) -> None:
        for i, j in tiles[first:last]:
            shape = (i.stop - i.start, j.stop - j.start)
            if rotations is None:
                part = np.empty((*shape, 0), np.float32)
            else:
                part = _as_entries(rotations(i, j) if callable(rotations) else rotations[i, j], shape, d)
            fill(i, j, part, squares[:, i, j])

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


def _as_entries(rotations: NDArray[Any], shape: tuple[int, ...], d: int) -> Floats:
    """Rotations as C-contiguous arrays (..., d * d), or (..., 2) for cosine and sine."""
    accepted = [(*shape, d, d)] + [(*shape, 2)] * (d == 2)
    if rotations.shape not in accepted:
        wanted = " or ".join(str(one) for one in accepted)
        raise SpecificationError(f"expected rotations of shape {wanted}, got {rotations.shape}; pass one for each pair")
    return np.ascontiguousarray(rotations, np.float32).reshape(*shape, -1)


def _filler(A: Shapes, B: Shapes, n_pairs: int) -> Callable[[slice, slice, Floats, Floats], None]:
    """The function that writes the distances of a tile, from its slices and the entries of its rotations."""
    compiled = use_compiled(n_pairs * _PAIR_OPERATIONS)

    def fill(rows: slice, columns: slice, entries: Floats, squares: Floats) -> None:
        n, m = squares.shape[1:]
        if compiled and (m > _FEW_COLUMNS or n == 1):
            sides = (_arrays(A, rows), _arrays(B, columns))
            loop = compiled_module("kineme.kernels._pairs").fill_grid
            found = np.empty(squares.shape, np.float32)  # always contiguous, so that one version is compiled
            loop((0,) * A.n_dims, sides, _numbers(A), entries, found)
            squares[:] = found
            return
        first, second = np.divmod(np.arange(n * m), m)
        step = n * m if compiled else _TWIN_PAIRS
        flat, found = entries.reshape(n * m, -1), np.empty((3, n * m), np.float32)
        for start in range(0, n * m, step):
            part = slice(start, start + step)
            chosen = (first[part] + rows.start, second[part] + columns.start, flat[part])
            (_listed_compiled if compiled else _listed_plain)(A, B, *chosen, found[:, part])
        squares[:] = found.reshape(3, n, m)

    return fill


def _listed_compiled(A: Shapes, B: Shapes, first: Indices, second: Indices, entries: Floats, squares: Floats) -> None:
    loop = compiled_module("kineme.kernels._pairs").fill_listed
    sides = (_arrays(A, slice(None)), _arrays(B, slice(None)))
    found = np.empty(squares.shape, np.float32)
    loop((0,) * A.n_dims, sides, (first, second), _numbers(A), entries[:, None], found)
    squares[:] = found


def _listed_plain(A: Shapes, B: Shapes, first: Indices, second: Indices, entries: Floats, squares: Floats) -> None:
    matrices = _matrices(entries, A.n_dims)
    squares[:2] = elastic_squares(A, B, first, second, matrices)
    squares[2] = cloud_squares(A, B, first, second, matrices)


def _matrices(entries: Floats, d: int) -> Array | None:
    if entries.shape[1] == 0:
        return None
    if entries.shape[1] == d * d:
        return entries.reshape(-1, d, d).astype(float)
    c, s = entries.T.astype(float)
    return np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2)


def _arrays(shapes: Shapes, chosen: slice) -> tuple[Floats, ...]:
    """What the compiled loops read, of some movements: the numbers of each in one row."""
    s = shapes
    arrays = (s.tangents, s.midpoints, s.turning, s.points, s.point_tangents, s.point_turning)
    return tuple(one[chosen].reshape(-1, one[0].size if len(one) else 1) for one in arrays)


def _numbers(shapes: Shapes) -> tuple[tuple[np.float32, ...], tuple[int, int, int]]:
    """Roots of the weights of those arrays, and the numbers of segments, band and points."""
    elastic, cloud = shapes.elastic, shapes.cloud
    weights = (1.0, elastic.position_weight, elastic.turning_weight, 1.0, cloud.line_weight**0.5, cloud.turning_weight)
    return tuple(np.float32(one**0.5) for one in weights), (elastic.n_segments, elastic.band, cloud.n_points)

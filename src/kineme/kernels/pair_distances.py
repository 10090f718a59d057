"""Elastic, turning and point-cloud distances of many pairs of movements, each after the rotation of its pair.

Movements are described once, by `shapes_of`: as segments and points of their paths. A pair's distances do not depend on
the pairs beside it.

A *path* (d, S) holds positions at even steps along arc length, centered at their mean, with a root mean square distance
of 1 from it. Its *segments* are the pieces between ``n_segments + 1`` even values along it; its *points* are
``n_points`` even values. Values between two positions are interpolated linearly.

For movements a and b and a rotation R that brings b onto a, two segments p, q cost

    c(p, q) = |t_p - R t_q|^2 + w_x |x_p - R x_q|^2 + w_theta (theta_p - theta_q)^2

with tangents t, midpoints x and turning angles theta (divided by pi). The squared elastic distance is the least sum of
costs over warping paths from (0, 0) to (K - 1, K - 1) with steps (1, 0), (0, 1), (1, 1) and ``|p - q| <= band``
(H. Sakoe and S. Chiba, "Dynamic programming algorithm optimization for spoken word recognition", IEEE TASSP 26(1),
1978), divided by the number K of segments. The squared turning distance is the same with the last term alone, so it
needs no rotation and is never larger. A warping path visits every segment of b, so that the costs of some of them, each
with whichever segment of a within the band costs least, bound both from below. Both are symmetric, with the transposed
rotation, non-negative, and zero for equal movements; neither satisfies the triangle inequality.

$P+ (R.-D. Vatavu, "Improving gesture recognition accuracy on touch screens for users with low vision", CHI 2017)
compares points by position and turning angle, whatever their order. Here they have also the line of their tangent,
without its direction, and the second movement is rotated first:

    D(p, q)^2 = |x_p - R x_q|^2 + w_theta (theta_p - theta_q)^2 + w_l ((|t_p|^2 + |t_q|^2) / 2 - (t_p . R t_q)^2)

The last term is the squared sine of the angle between two tangents; a point without a tangent, t = 0, differs from one
with a tangent by a half and not at all from another without. Each point of one movement is matched with the nearest of
the other, the first of equally near ones, and then each point of the other that nobody matched with its nearest. The
distance is the sum of D over these pairs divided by the number of points, in the direction in which it is smaller. It
is symmetric, with the transposed rotation, non-negative, and zero for equal movements; it does not satisfy the
triangle inequality.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.rotation import blocks
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array

Indices = NDArray[np.intp]

Floats = NDArray[np.float32]

_PATH_OPERATIONS, _CALL_OPERATIONS = 800, 12_000  # elementary operations of the plain definition per path and call
MOST_POINTS = 32  # of a cloud: the matched ones are bits of an integer

_NO_LENGTH = 1e-6  # of a movement of size 1: a shorter vector is the rounding error of positions in single precision


@dataclass(frozen=True)
class ElasticSpec:
    """Options of comparing segments by dynamic time warping; see the module."""

    n_segments: int = 33  # segments of a path, at least 3
    band: int = 6  # a segment is matched with segments at most so many numbers away (Sakoe & Chiba 1978)
    position_weight: float = 0.5  # of squared differences of midpoints; that of tangents is 1
    turning_weight: float = 8.0  # of turning angles / pi

    def __post_init__(self) -> None:
        for name, least in (("n_segments", 3), ("band", 0), ("position_weight", 0), ("turning_weight", 0)):
            _at_least(name, getattr(self, name), least)


@dataclass(frozen=True)
class CloudSpec:
    """Options of comparing points as a cloud; see the module."""

    n_points: int = 20  # points of a path, 3 to 32
    turning_weight: float = 16.0  # of squared differences of turning angles / pi; that of positions is 1
    line_weight: float = 0.75  # of the squared sine between the tangents' lines

    def __post_init__(self) -> None:
        _at_least("n_points", self.n_points, 3)
        if self.n_points > MOST_POINTS:
            raise SpecificationError(f"expected n_points of at most {MOST_POINTS}, got {self.n_points}; take fewer")
        _at_least("turning_weight", self.turning_weight, 0)
        _at_least("line_weight", self.line_weight, 0)


def _at_least(name: str, value: float, least: int) -> None:
    if not least <= value < np.inf:
        raise SpecificationError(f"expected {name} of at least {least}, got {value!r}")


_ARRAYS = ("tangents", "midpoints", "turning", "points", "point_tangents", "point_turning")


@dataclass(frozen=True)
class Shapes:
    """n movements in d dimensions as segments and points: C-contiguous arrays of float32, made by `shapes_of`.

    - `tangents`, `midpoints` (n, n_segments, d): unit vectors along the segments, zero for a segment of length zero,
      and their midpoints.
    - `turning` (n, n_segments): angle between the tangents before and after a segment, divided by pi; 0 at both ends,
      and wherever one of the three has no direction.
    - `points`, `point_tangents` (n, n_points, d): points, and unit vectors along the central differences there
      (one-sided at the ends), zero for a difference of zero.
    - `point_turning` (n, n_points): angle between the steps to and from a point, divided by pi; 0 at both ends, and
      where one has length zero.
    """

    tangents: Floats
    midpoints: Floats
    turning: Floats
    points: Floats
    point_tangents: Floats
    point_turning: Floats
    elastic: ElasticSpec
    cloud: CloudSpec

    def __len__(self) -> int:
        return len(self.turning)

    @property
    def n_dims(self) -> int:
        """Dimensions d of the movements."""
        return int(self.tangents.shape[2])

    def take(self, chosen: NDArray[np.integer] | NDArray[np.bool_] | slice) -> Shapes:
        """The movements that an index array, a mask or a slice chooses, in its order."""
        arrays: dict[str, Any] = {name: np.ascontiguousarray(array[chosen]) for name, array in self.arrays().items()}
        return replace(self, **arrays)

    def empty(self, n: int) -> Shapes:
        """Uninitialized arrays for n movements with the same dimensions and specifications, to be filled."""
        rooms: dict[str, Any] = {name: np.empty((n, *x.shape[1:]), np.float32) for name, x in self.arrays().items()}
        return replace(self, **rooms)

    def put(self, start: int, others: Shapes) -> None:
        """Write other movements over those from `start` on."""
        theirs = others.arrays()
        for name, array in self.arrays().items():
            array[start : start + len(others)] = theirs[name]

    def arrays(self) -> dict[str, Floats]:
        """The arrays by name."""
        return {name: getattr(self, name) for name in _ARRAYS}


def shapes_of(
    paths: NDArray[Any], elastic: ElasticSpec | None = None, cloud: CloudSpec | None = None, slopes: bool = False
) -> Shapes:
    """Segments and points of paths (n, d, S), computed in double precision.

    `paths` (n, d, S): positions at even steps along arc length, centered, with a root mean square distance of 1 from
    the mean; zeros for a movement without extent. At least two positions. With `slopes` they are signals (n, 1, S) at
    even times: tangents are then the differences from end to end of the segments, with a root mean square of 1, and
    turning angles 0, so that the elastic distance is dynamic time warping of values and of slopes.
    """
    n, d, n_positions = paths.shape
    elastic, cloud = elastic or ElasticSpec(), cloud or CloudSpec()
    segments, points = (
        (np.empty((n, k, d), np.float32), np.empty((n, k, d), np.float32), np.empty((n, k), np.float32))
        for k in (elastic.n_segments, cloud.n_points)
    )
    shapes = Shapes(*segments, *points, elastic, cloud)
    if use_compiled(_CALL_OPERATIONS + n * _PATH_OPERATIONS):
        ends, even = _between(n_positions, shapes.elastic.n_segments + 1), _between(n_positions, shapes.cloud.n_points)
        fill = compiled_module("kineme.kernels._shapes").fill_shapes
        fill(np.ascontiguousarray(paths), _NO_LENGTH, (ends, even), segments, points)
    else:
        _fill_shapes(paths, shapes)
    if slopes:
        steps = np.diff(_even(paths, shapes.elastic.n_segments + 1), axis=1)
        sizes = np.sqrt((steps**2).mean(axis=(1, 2), keepdims=True))
        shapes.tangents[:] = steps / np.where(sizes > 0, sizes, 1.0)
        shapes.turning[:] = 0
    return shapes


def _fill_shapes(paths: Array, shapes: Shapes) -> None:
    """The plain definition."""
    ends, points = _even(paths, shapes.elastic.n_segments + 1), _even(paths, shapes.cloud.n_points)
    tangents, steps = _unit(np.diff(ends, axis=1)), _unit(np.diff(points, axis=1))
    shapes.tangents[:] = tangents
    shapes.midpoints[:] = 0.5 * (ends[:, 1:] + ends[:, :-1])
    shapes.turning[:, [0, -1]] = 0
    shapes.turning[:, 1:-1] = _angles(tangents[:, :-2], tangents[:, 2:]) * (tangents[:, 1:-1] != 0).any(axis=2)
    shapes.points[:] = points
    shapes.point_tangents[:] = _unit(np.gradient(points, axis=1))
    shapes.point_turning[:, [0, -1]] = 0
    shapes.point_turning[:, 1:-1] = _angles(steps[:, :-1], steps[:, 1:])


def _even(paths: Array, n: int) -> Array:
    """Positions (N, n, d) at n even values along paths (N, d, S), interpolated linearly."""
    before, share = _between(paths.shape[2], n)
    x = paths.transpose(0, 2, 1)
    return np.asarray(x[:, before] * (1 - share)[:, None] + x[:, before + 1] * share[:, None])


def _between(n_positions: int, n: int) -> tuple[NDArray[np.intp], Array]:
    """The positions before n even values along a path, and the shares of the next positions in them."""
    last = n_positions - 1
    at = np.arange(n) * last / (n - 1)
    before = np.minimum(at.astype(np.intp), last - 1)
    return before, at - before


def _unit(vectors: Array) -> Array:
    """Vectors (..., d) divided by their lengths; zero where they have none."""
    lengths = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return np.where(lengths > _NO_LENGTH, vectors / np.where(lengths > _NO_LENGTH, lengths, 1.0), 0.0)


def _angles(a: Array, b: Array) -> Array:
    """Angles between unit vectors (..., d), divided by pi; 0 where one of them is zero."""
    both = (a != 0).any(axis=-1) & (b != 0).any(axis=-1)
    return np.where(both, np.arccos(np.clip((a * b).sum(axis=-1), -1.0, 1.0)) / np.pi, 0.0)


def elastic_squares(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None) -> Array:
    """Squared elastic and turning distances (2, k) of k pairs: A's movement ``first[i]`` and B's ``second[i]``."""
    sums = [_warped(costs, A.elastic.band) for costs in _costs(A, B, first, second, rotations)]
    return np.stack(sums) / A.elastic.n_segments


def elastic_bounds(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None, every: int) -> Array:
    """Lower bounds (2, k) of the same: the costs of each `every`-th segment of b with the one of a that costs least."""
    n = A.elastic.n_segments
    far = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) > A.elastic.band
    some = slice(every // 2, None, every)
    costs = (np.where(far, np.inf, each)[:, :, some] for each in _costs(A, B, first, second, rotations))
    return np.stack([each.min(axis=1).sum(axis=1) for each in costs]) / n


def _costs(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None) -> tuple[Array, Array]:
    """Costs (k, n, n) of segments with segments: all of c, and its last term."""
    angles = A.turning[first, :, None].astype(np.float64) - B.turning[second, None, :]
    turning: Array = A.elastic.turning_weight * angles**2
    costs = turning.copy()
    for weight, name in ((1.0, "tangents"), (A.elastic.position_weight, "midpoints")):
        a, b = getattr(A, name)[first].astype(float), rotated(getattr(B, name)[second], rotations)
        for k in range(A.n_dims):
            costs += weight * (a[:, :, None, k] - b[:, None, :, k]) ** 2
    return costs, turning


def rotated(vectors: Floats, rotations: Array | None) -> Array:
    """Vectors (k, n, d), each pair's by its own rotation (k, d, d)."""
    double = vectors.astype(np.float64)
    return double if rotations is None else np.asarray(double @ rotations.transpose(0, 2, 1))


def _warped(costs: Array, band: int) -> Array:
    """Least sums (k,) over warping paths through costs (k, n, n)."""
    n = costs.shape[1]
    table = np.full((n + 1, n + 1, len(costs)), np.inf)
    table[0, 0] = 0
    for p in range(n):
        for q in range(max(0, p - band), min(n, p + band + 1)):
            before = np.minimum(np.minimum(table[p, q + 1], table[p + 1, q]), table[p, q])
            table[p + 1, q + 1] = costs[:, p, q] + before
    return table[n, n]


def cloud_squares(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None) -> Array:
    """Squared distances (k,) of the point clouds of k pairs, as `elastic_squares`."""
    x, y = A.points[first].astype(float), rotated(B.points[second], rotations)
    t, u = A.point_tangents[first].astype(float), rotated(B.point_tangents[second], rotations)
    angles = A.point_turning[first, :, None].astype(float) - B.point_turning[second, None, :]
    halves = 0.5 * ((t * t).sum(axis=2)[:, :, None] + (u * u).sum(axis=2)[:, None, :])
    squares = A.cloud.turning_weight * angles**2
    squares += A.cloud.line_weight * (halves - (t @ u.transpose(0, 2, 1)) ** 2)
    for k in range(A.n_dims):
        squares += (x[:, :, None, k] - y[:, None, :, k]) ** 2
    return np.asarray((matched_sums(np.sqrt(np.maximum(squares, 0))) / A.cloud.n_points) ** 2)


def matched_sums(D: Array) -> Array:
    """Sums (k,) of the distances of matched points, of distances (k, n, n): those of the better direction."""
    return np.minimum(_directed(D), _directed(D.transpose(0, 2, 1)))


def _directed(D: Array) -> Array:
    """Sums (k,) of distances (k, n, n) to the nearest, by rows, and by columns where no row's nearest is."""
    matched = np.zeros(D.shape[::2], dtype=bool)
    np.put_along_axis(matched, D.argmin(axis=2), True, axis=1)
    return np.asarray(D.min(axis=2).sum(axis=1) + np.where(matched, 0, D.min(axis=1)).sum(axis=1))


Tile = tuple[slice, slice]  # movements of A and of B
Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]  # indices into A and into B
#: Writes to squares (3, n, m) of a tile, whose rotations have the entries (n, m, r).
Filler = Callable[[Shapes, Shapes, Tile, Floats, Floats], None]

_TILE_ROWS, _TILE_PAIRS = 32, 4096  # the columns are packed once for so many rows; a tile takes about a millisecond
_TILE_BOUNDS = 32_768
_LANES = 16  # pairs that the compiled loops compare at once
_LISTED = 1.2  # time of 16 pairs taken from a list, by that of 16 of one movement with others
_TWIN_PAIRS = 1000
_BOUND_EVERY = 3  # of so many segments one is compared for a bound: of handwriting, that leaves one pair in ten
_PAIR_OPERATIONS = 10_000  # elementary operations of the plain twins per pair


def pair_distances(A: Shapes, B: Shapes, rotations: NDArray[Any] | None = None) -> Floats:
    """Squared distances (3, n, m) of every movement of A with every one of B: elastic, turning, point cloud.

    `rotations` (n, m, d, d) or, in the plane, (n, m, 2): matrices R, or cosines and sines, that rotate B's movement
    onto A's, float32 fastest; of points in the plane or in space, J after each other, those of one, which rotate all.
    By default nothing is rotated. Distances are in units of the movements' squared size.
    """
    return _grid(A, B, rotations, (_fill_compiled, _fill_plain), _TILE_PAIRS)


def pair_bounds(A: Shapes, B: Shapes, rotations: NDArray[Any] | None = None, *, clouds: bool = True) -> Floats:
    """Lower bounds (3, n, m) of what `pair_distances` gives, up to rounding: see `elastic_bounds`.

    That of the point cloud is the distance itself, or 0 without `clouds`: then all take a quarter of the time.
    """
    fillers = (partial(_bound_compiled, clouds=clouds), partial(_fill_plain, clouds=clouds))
    return _grid(A, B, rotations, fillers, _TILE_BOUNDS)


def listed_distances(
    A: Shapes, B: Shapes, first: NDArray[np.intp], second: NDArray[np.intp], rotations: NDArray[Any] | None = None
) -> Floats:
    """Distances (3, k) as `pair_distances` of k pairs, A's ``first[i]`` and B's ``second[i]``, rotations (k, ...)."""
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
    sizes = {(*shape, p, p) for p in (2, 3, d) if d % p == 0} | ({(*shape, 2)} if d % 2 == 0 else set())
    if rotations.shape not in sizes:
        wanted = f"{(*shape, d, d)}" + f" or {(*shape, 2)}" * (d == 2)
        raise SpecificationError(f"expected rotations of shape {wanted}, got {rotations.shape}; pass one for each pair")


def _fill_compiled(A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats) -> None:
    """Write the squared distances (3, n, m) of a tile of pairs, with entries (n, m, r) of rotations; r 0 for none."""
    n, m = squares.shape[1:]
    module, numbers = compiled_module("kineme.kernels._pairs"), _numbers(A.elastic, A.cloud)
    a, b = _arrays(A, tile[0]), _arrays(B, tile[1])
    # Always contiguous, so that one version is compiled.
    result = squares if squares.flags.c_contiguous else np.empty(squares.shape, np.float32)
    by_columns, by_rows, listed = n * -(-m // _LANES), m * -(-n // _LANES), _LISTED * -(-n * m // _LANES)
    if min(by_columns, by_rows) <= listed:
        rows_first = by_rows < by_columns
        module.fill_grid((0,) * A.n_dims, (a, b) if rows_first else (b, a), rows_first, numbers, entries, result)
    else:
        pairs = np.divmod(np.arange(n * m), m)
        entries = entries.reshape(n * m, 1, -1) if entries.size else np.empty((n * m, 1, 0), np.float32)
        module.fill_listed((0,) * A.n_dims, (a, b), pairs, numbers, entries, result.reshape(3, -1))
    if result is not squares:
        squares[:] = result


def _fill_plain(
    A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats, *, clouds: bool | None = None
) -> None:
    """The same by the plain definitions; bounds where it is said whether those of clouds are among them."""
    n, m, r = entries.shape
    first, second = np.divmod(np.arange(n * m), m)
    pairs, result = (first + tile[0].start, second + tile[1].start), np.empty((3, n * m), np.float32)
    _fill_listed_plain(A, B, pairs, entries.reshape(n * m, 1, r), result, clouds)
    squares[:] = result.reshape(squares.shape)


def _fill_listed_plain(
    A: Shapes, B: Shapes, pairs: Pairs, entries: Floats, squares: Floats, clouds: bool | None = None
) -> None:
    """Write the squared distances (3, k) of listed pairs, or their bounds."""
    matrices = _matrices(entries, A.n_dims)
    for start in range(0, len(entries), _TWIN_PAIRS):
        part = slice(start, start + _TWIN_PAIRS)
        listed = (A, B, pairs[0][part], pairs[1][part], None if matrices is None else matrices[part])
        squares[:2, part] = elastic_squares(*listed) if clouds is None else elastic_bounds(*listed, _BOUND_EVERY)
        squares[2, part] = 0.0 if clouds is False else cloud_squares(*listed)


def _bound_compiled(A: Shapes, B: Shapes, tile: Tile, entries: Floats, squares: Floats, *, clouds: bool) -> None:
    """Write lower bounds of the squared distances (3, n, m) of a tile of pairs."""
    module, sides = compiled_module("kineme.kernels._pairs"), (_arrays(A, tile[0]), _arrays(B, tile[1]))
    result = np.empty((2 + clouds, *squares.shape[1:]), np.float32)
    module.fill_bounds((0,) * A.n_dims, sides, _numbers(A.elastic, A.cloud), entries, _BOUND_EVERY, result)
    squares[2] = 0
    squares[: len(result)] = result


def _matrices(entries: Floats, d: int) -> Array | None:
    """Rotations (k, d, d) of their entries (k, 1, r)."""
    if entries.shape[2] == 0:
        return None
    if entries.shape[2] != 2:
        p = math.isqrt(entries.shape[2])
        return blocks(entries.reshape(-1, p, p).astype(float), d // p)
    c, s = entries.reshape(-1, 2).T.astype(float)
    return blocks(np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2), d // 2)


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

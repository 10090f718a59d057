"""What two movements are compared by pair by pair: segments and points of their paths along arc length.

A *path* (d, S) holds positions at even steps along arc length, centered at their mean, with a root mean square distance
of 1 from it. Its *segments* are the pieces between ``n_segments + 1`` even values along it; its *points* are
``n_points`` even values. Values between two positions are interpolated linearly.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

Floats = NDArray[np.float32]

_PATH_OPERATIONS, _CALL_OPERATIONS = 800, 12_000  # elementary operations of the plain definition per path and call
MOST_POINTS = 32  # of a cloud: the matched ones are bits of an integer


@dataclass(frozen=True)
class ElasticSpec:
    """How segments are compared by dynamic time warping; see `kineme.kernels.elastic`.

    Attributes
    ----------
    n_segments : int
        Segments of a path, at least 3.
    band : int
        A segment is matched with segments at most so many numbers away (Sakoe & Chiba 1978).
    position_weight, turning_weight : float
        Weights of the squared differences of midpoints and of turning angles / pi; that of tangents is 1.
    """

    n_segments: int = 33
    band: int = 6
    position_weight: float = 0.5
    turning_weight: float = 8.0

    def __post_init__(self) -> None:
        _at_least("n_segments", self.n_segments, 3)
        _at_least("band", self.band, 0)
        _at_least("position_weight", self.position_weight, 0)
        _at_least("turning_weight", self.turning_weight, 0)


@dataclass(frozen=True)
class CloudSpec:
    """How points are compared as a cloud; see `kineme.kernels.point_cloud`.

    Attributes
    ----------
    n_points : int
        Points of a path, 3 to 32.
    turning_weight, line_weight : float
        Weights of the squared difference of turning angles / pi and of the squared sine between the tangents' lines;
        that of positions is 1.
    """

    n_points: int = 20
    turning_weight: float = 16.0
    line_weight: float = 0.75

    def __post_init__(self) -> None:
        _at_least("n_points", self.n_points, 3)
        if self.n_points > MOST_POINTS:
            raise SpecificationError(f"expected n_points of at most {MOST_POINTS}, got {self.n_points}; take fewer")
        _at_least("turning_weight", self.turning_weight, 0)
        _at_least("line_weight", self.line_weight, 0)


def _at_least(name: str, value: float, least: int) -> None:
    if not least <= value < np.inf:
        raise SpecificationError(f"expected {name} of at least {least}, got {value!r}")


@dataclass(frozen=True)
class Shapes:
    """n movements in d dimensions as segments and points: C-contiguous arrays of float32, made by `shapes_of`.

    Attributes
    ----------
    tangents, midpoints : arrays (n, n_segments, d)
        Unit vectors along the segments, zero for a segment of length zero, and their midpoints.
    turning : array (n, n_segments)
        Angle between the tangents before and after a segment, divided by pi; 0 at both ends, and wherever one of the
        three has no direction.
    points, point_tangents : arrays (n, n_points, d)
        Points, and unit vectors along the central differences there (one-sided at the ends), zero for a difference of
        zero.
    point_turning : array (n, n_points)
        Angle between the steps to and from a point, divided by pi; 0 at both ends, and where one has length zero.
    elastic : ElasticSpec
    cloud : CloudSpec
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
        return Shapes(
            **{name: np.ascontiguousarray(array[chosen]) for name, array in self.arrays().items()},
            elastic=self.elastic,
            cloud=self.cloud,
        )

    def empty(self, n: int) -> Shapes:
        """Uninitialized arrays for n movements with the same dimensions and specifications, to be filled."""
        return Shapes(
            **{name: np.empty((n, *array.shape[1:]), np.float32) for name, array in self.arrays().items()},
            elastic=self.elastic,
            cloud=self.cloud,
        )

    def put(self, start: int, others: Shapes) -> None:
        """Write other movements over those from `start` on."""
        theirs = others.arrays()
        for name, array in self.arrays().items():
            array[start : start + len(others)] = theirs[name]

    def arrays(self) -> dict[str, Floats]:
        """The arrays by name."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name not in ("elastic", "cloud")}


def shapes_of(paths: NDArray[Any], elastic: ElasticSpec | None = None, cloud: CloudSpec | None = None) -> Shapes:
    """Segments and points of paths (n, d, S), computed in double precision.

    Parameters
    ----------
    paths : array (n, d, S)
        Positions at even steps along arc length, centered, with a root mean square distance of 1 from the mean; zeros
        for a movement without extent. At least two positions.
    elastic : ElasticSpec, optional
    cloud : CloudSpec, optional
    """
    n, d, n_positions = paths.shape
    shapes = _room(n, d, elastic or ElasticSpec(), cloud or CloudSpec())
    if use_compiled(_CALL_OPERATIONS + n * _PATH_OPERATIONS):
        ends, even = _between(n_positions, shapes.elastic.n_segments + 1), _between(n_positions, shapes.cloud.n_points)
        segments = (shapes.tangents, shapes.midpoints, shapes.turning)
        points = (shapes.points, shapes.point_tangents, shapes.point_turning)
        fill = compiled_module("kineme.kernels._shapes").fill_shapes
        fill(np.ascontiguousarray(paths), _NO_LENGTH, (ends, even), segments, points)
    else:
        _fill_shapes(paths, shapes)
    return shapes


def _room(n: int, d: int, elastic: ElasticSpec, cloud: CloudSpec) -> Shapes:
    segments, points = (n, elastic.n_segments), (n, cloud.n_points)
    return Shapes(
        tangents=np.empty((*segments, d), np.float32),
        midpoints=np.empty((*segments, d), np.float32),
        turning=np.empty(segments, np.float32),
        points=np.empty((*points, d), np.float32),
        point_tangents=np.empty((*points, d), np.float32),
        point_turning=np.empty(points, np.float32),
        elastic=elastic,
        cloud=cloud,
    )


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


_NO_LENGTH = 1e-6  # of a movement of size 1: a shorter vector is the rounding error of positions in single precision


def _unit(vectors: Array) -> Array:
    """Vectors (..., d) divided by their lengths; zero where they have none."""
    lengths = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return np.where(lengths > _NO_LENGTH, vectors / np.where(lengths > _NO_LENGTH, lengths, 1.0), 0.0)


def _angles(a: Array, b: Array) -> Array:
    """Angles between unit vectors (..., d), divided by pi; 0 where one of them is zero."""
    both = (a != 0).any(axis=-1) & (b != 0).any(axis=-1)
    return np.where(both, np.arccos(np.clip((a * b).sum(axis=-1), -1.0, 1.0)) / np.pi, 0.0)

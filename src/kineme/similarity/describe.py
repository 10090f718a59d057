"""Describe movements: smooth them, and compute one block of rows per representation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.styles.parameters import from_numbers, shared_label, to_numbers
from kineme.errors import TrajectoryError
from kineme.kernels.pair_distances import Shapes, pair_distances, shapes_of
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.movements.channels.channel import Channels
from kineme.movements.preparation.glitches import without_glitches
from kineme.movements.preparation.pauses import uninterrupted
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.preparation.smooth import smooth_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import for_tiles
from kineme.sampling import evenly_spaced
from kineme.similarity.specification import (
    DETAILED_CLOUD,
    DETAILED_ELASTIC,
    PAIR_QUANTITIES,
    POSITIONS,
    SIGNAL_ELASTIC,
    Compares,
    ComparisonSpecification,
    Normalization,
    rotating,
    specification_of,
)
from kineme.validation import Array

_TILE_PAIRS = 100_000  # at a time: a pair's rotation in space has nine numbers

_TILE_SAMPLES = 200_000  # numbers in one tile of paths: with smaller ones, threads wait for each other
_MOST_MIXED = 4  # points that are compared pair by pair; of columns that are no points, three times as many
_MIXED_FROM = 500  # movements that tell which
N_MEANS, _VALUE_SAMPLES = 8, 64  # of `recorded_values`
N_POINTS = 199  # even samples from which the phases are computed; every second one is one of 100


def describe(movements: Described | MovementsLike, like: Compares | None = None) -> Described:
    """Describe movements.

    Parameters
    ----------
    movements : Described, or movements as `Demonstrations.of` accepts them
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations, invariances, smoothing and mean to take; it need not be fitted.

    Returns
    -------
    Described
        Movements that are described already are returned as they are.
    """
    if isinstance(movements, Described):
        return movements
    how = specification_of(like)
    demos = Demonstrations.of(movements)
    return describe_as(demos, how, how.with_points(demos.channels).procrustes(demos.n_dims))


def describe_as(demos: Demonstrations, like: Compares, procrustes: Procrustes) -> Described:
    """Describe movements for a distance that is known, with their `recorded_values` where these count."""
    how = like.specification
    return with_values(prepare(feature_rows(demos, how), like, procrustes), demos, 0, len(demos), how)


def with_values(
    described: Described, demos: Demonstrations, start: int, stop: int, how: ComparisonSpecification
) -> Described:
    """Add the values of movements start:stop where they count."""
    if not values_count(described, how):
        return described
    return with_recorded(described, recorded_values(demos, start, stop), demos.channels)


def with_recorded(described: Described, values: Array, channels: Channels | None) -> Described:
    """Add `recorded_values`, and what their columns wrap by."""
    periods = None if channels is None else RecordedAs(channels).periods(values[:, :, 0])
    return replace(described, values=values, periods=periods)


def values_count(described: Described, how: ComparisonSpecification) -> bool:
    """Tell whether recorded values count: of signals and sensors, which are not rotated."""
    return how.detailed and how.normalization.translation and described.procrustes.n_dims not in (2, 3)


def recorded_values(demos: Demonstrations, start: int, stop: int) -> Array:
    """Return the means over each eighth of the time, and the standard deviation, of each column as it was recorded.

    Shape (stop - start, d, 9), of movements start:stop, without their glitches.
    """
    recorded = demos.positions[demos.offsets[start] : demos.offsets[stop]]
    clean = without_glitches(recorded, demos.offsets[start : stop + 1] - demos.offsets[start])
    if clean is not recorded:
        demos = Demonstrations.of_movements(replace(demos[start:stop].movements, positions=clean))
        start, stop = 0, stop - start
    values = recorded_paths(demos, relative_rows(demos, start, stop, _VALUE_SAMPLES), start)
    means = values.reshape(len(values), demos.n_dims, N_MEANS, -1).mean(axis=3)
    return np.concatenate((means, values.std(axis=2, keepdims=True)), axis=2)


def describe_rows(rows: NDArray[Any], n_dims: int, like: Compares | None = None) -> Described:
    """Return feature rows of n movements that were stored, as descriptions.

    Parameters
    ----------
    rows : array_like of shape (n, sum_r d S_r)
        As `feature_rows` gives them, concatenated: those of `ComparisonSpecification.stored_rows`.
    n_dims : int
        Dimensions d of the movements.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        The one that the rows were made for.

    Raises
    ------
    TrajectoryError
        Rows of another width than the representations make.
    """
    how = specification_of(like)
    rows = np.asarray(rows)
    widths = [n_dims * representation.n_points for representation in how.stored_rows]
    if rows.ndim != 2 or rows.shape[1] != sum(widths) or not len(rows):
        raise TrajectoryError(
            f"expected feature rows of shape (n, {sum(widths)}) for {n_dims} dimensions and {len(widths)} "
            f"representations, got shape {rows.shape}; pass n_dims and the recognizer that the rows were made for"
        )
    return prepare(np.split(rows, np.cumsum(widths)[:-1], axis=1), how, how.procrustes(n_dims))


def prepare(rows: Iterable[NDArray[Any]], like: Compares, procrustes: Procrustes) -> Described:
    """Return rows (n, d * S), one block for each of `ComparisonSpecification.stored_rows`, ready for comparison.

    In single precision: comparing with many stored movements is bound by memory, and widths are far above its error.
    What is compared pair by pair is made from the positions over arc length.
    """
    how, d = like.specification, procrustes.n_columns
    singles: tuple[Any, ...] = tuple(np.ascontiguousarray(block, dtype=np.float32) for block in rows)
    blocks = tuple(procrustes.prepare(block) for block in singles[: len(how.by_rows)])
    own = tuple(representation.own_weight(d) for representation in how.representations)
    if not how.by_pairs:
        return Described(blocks, procrustes, how.mean, own_weights=own)
    r = rotating(how.representations)
    paths = [block.reshape(len(block), d, -1) for block in (singles[r], *singles[len(how.by_rows) :])]
    procrustes = with_mixing(procrustes, paths[0])
    paths = [procrustes.mixed(block) for block in paths]
    slopes = how.are_signals(d)
    details = shapes_of(paths[1], DETAILED_ELASTIC, DETAILED_CLOUD, slopes=slopes) if len(paths) == 2 else None
    measures = tuple(representation.measure for representation in how.by_pairs)
    shapes = shapes_of(paths[0], SIGNAL_ELASTIC if slopes else None, slopes=slopes)
    pairs = Pairs(blocks[r], shapes, measures, details, how.upright)
    return Described(blocks, procrustes, how.mean, pairs, own)


def with_mixing(procrustes: Procrustes, paths: NDArray[Any]) -> Procrustes:
    """Return the distance with the points that are compared pair by pair: of many, the principal ones.

    These are the q weighted sums of points that hold most of how all move, whatever their rotation: eigenvectors of
    ``sum x_i x_j^T`` over the paths (n, J d, S). Pairs of segments are compared in 3 q numbers instead of 3 J. Of many
    columns that are no points, which are not rotated, principal ones in the same way.
    """
    J, most = procrustes.n_points, _MOST_MIXED
    if J == 1:
        J, most = procrustes.n_columns, 3 * _MOST_MIXED
    if procrustes.mixing is not None or most >= J:
        return procrustes
    points = paths.reshape(len(paths), J, -1)[evenly_spaced(len(paths), _MIXED_FROM)].astype(np.float64)
    vectors = np.linalg.eigh(np.einsum("nis,njs->ij", points, points))[1][:, : -most - 1 : -1]
    vectors *= np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(most)])  # so that each has one sign
    return replace(procrustes, mixing=tuple(map(tuple, vectors.T.tolist())))


def feature_rows(movements: MovementsLike, specification: ComparisonSpecification) -> tuple[Array, ...]:
    """Smooth movements and describe them, in double precision.

    Rows (n, d * S) for each of `ComparisonSpecification.stored_rows`.
    """
    demos = Demonstrations.of(movements)
    rows = tuple(
        np.empty((len(demos), demos.n_dims * representation.n_points)) for representation in specification.stored_rows
    )

    def fill(start: int, stop: int) -> None:
        for block, tile in zip(rows, _tile_rows(demos, start, stop, specification, np.float64), strict=True):
            block[start:stop] = tile

    for_tiles(fill, len(demos), _tile_movements(demos.n_dims))
    return rows


def for_described(
    demos: Demonstrations,
    like: Compares,
    procrustes: Procrustes,
    work: Callable[[slice, Described], None],
    most: int | None = None,
) -> None:
    """Describe movements tile by tile, in threads, and call `work` with the rows of each, at most `most` movements.

    So that the rows of a movement are compared while they are in the core's cache.
    """
    how = like.specification

    def one_tile(start: int, stop: int) -> None:
        work(slice(start, stop), describe_tile(demos, start, stop, how, procrustes))

    step = _tile_movements(demos.n_dims)
    for_tiles(one_tile, len(demos), step if most is None else min(step, most))


def describe_tile(demos: Demonstrations, start: int, stop: int, like: Compares, procrustes: Procrustes) -> Described:
    """Describe movements start:stop, all at once."""
    how = like.specification
    rows = _tile_rows(demos, start, stop, how, _precision(how))
    return with_values(prepare(rows, like, procrustes), demos, start, stop, how)


def describe_paths(paths: Array, details: Array, like: Compares, procrustes: Procrustes) -> Described:
    """Describe smooth, evenly timed paths (n, d, T): relative ones, or recorded ones where position matters.

    `details` are the same paths smoothed below `ComparisonSpecification.detailed_cutoff` cycles.
    """
    how = like.specification
    return prepare(_path_rows(paths, details, how, _precision(how)), how, procrustes)


def _precision(how: ComparisonSpecification) -> DTypeLike:
    """Return single precision, far finer than the widths; double for paths far from the origin for their size."""
    return np.float32 if how.normalization.translation else np.float64


def even_paths(demos: Demonstrations, start: int, stop: int, cutoff: float | None) -> Array:
    """Return movements start:stop, smoothed, at even times, minus their first recorded position, (stop - start, d, T).

    Glitches are taken out, and pauses cut short first, see `uninterrupted`.
    """
    return smooth_evenly(*_uninterrupted(demos, start, stop), cutoff)


def detailed_paths(demos: Demonstrations, start: int, stop: int, how: ComparisonSpecification) -> tuple[Array, Array]:
    """Return `even_paths` below the cutoff, and in detail; twice the same where nothing is compared in detail.

    Signals keep their rests in detail: a value that is held is part of them, as a corner is part of a path.
    """
    whole = _uninterrupted(demos, start, stop)
    paths = smooth_evenly(*whole, how.cutoff)
    if how.detailed and how.are_signals(demos.n_dims):
        whole = _uninterrupted(demos, start, stop, rests=False)
    elif not how.detailed or how.cutoff is None:
        return paths, paths
    return paths, smooth_evenly(*whole, how.detailed_cutoff)


def _uninterrupted(
    demos: Demonstrations, start: int, stop: int, *, rests: bool = True
) -> tuple[Demonstrations, int, int]:
    """Return movements start:stop without glitches and with their pauses cut short, and where they are."""
    clean = uninterrupted(demos, start, stop, rests=rests)
    return (demos, start, stop) if clean is None else (clean, 0, stop - start)


def smooth_evenly(demos: Demonstrations, start: int, stop: int, cutoff: float | None) -> Array:
    """Return the same of movements whose pauses stay as they are."""
    if cutoff is None:
        return relative_rows(demos, start, stop, N_POINTS)
    return smooth_rows(demos, start, stop, cutoff, N_POINTS)


def recorded_paths(demos: Demonstrations, paths: Array, start: int = 0) -> Array:
    """Move paths (n, d, T) of movements start:start + n, as from `even_paths`, to where they were recorded."""
    return paths + demos.positions[demos.offsets[start : start + len(paths)]][:, :, None]


def _tile_rows(
    demos: Demonstrations, start: int, stop: int, how: ComparisonSpecification, dtype: DTypeLike
) -> tuple[NDArray[Any], ...]:
    """Return feature rows of movements start:stop as `dtype`."""
    paths, details = detailed_paths(demos, start, stop, how)
    if not how.normalization.translation:
        paths, details = (recorded_paths(demos, relative, start) for relative in (paths, details))
    return _path_rows(paths, details, how, dtype)


def _path_rows(
    paths: Array, details: Array, how: ComparisonSpecification, dtype: DTypeLike
) -> tuple[NDArray[Any], ...]:
    """Return feature rows of paths (n, d, T), and of the same paths in detail, as `dtype`."""
    normalized: dict[tuple[float, int, bool], NDArray[Any]] = {}  # representations of equal phase share it
    rows = []
    for representation in how.by_rows:
        phase = (representation.arc_share, representation.n_points, representation.signal)
        if phase not in normalized:
            normalized[phase] = how.normalization.apply(representation.along(paths), dtype)
        rows.append(representation.describe(normalized[phase], how.normalization.translation))
    for representation in how.stored_rows[len(rows) :]:
        rows.append(how.normalization.apply(representation.along(details), dtype).reshape(len(details), -1))
    return tuple(rows)


def _tile_movements(n_dims: int) -> int:
    """Return movements of one tile."""
    return max(1, _TILE_SAMPLES // (n_dims * N_POINTS))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Shapes of n movements that are compared pair by pair."""

    positions: Prepared  # positions over arc length, which give the rotation of a pair
    shapes: Shapes
    # Which of the distances that `kineme.kernels.pair_distances` gives, those of details last:
    measures: tuple[int, ...]
    details: Shapes | None = None  # the shapes in detail
    upright: bool = True  # whether these are not rotated

    @property
    def n_rotated(self) -> int:
        """Measures that are not in detail; they come first."""
        return sum(measure < len(PAIR_QUANTITIES) for measure in self.measures)


@dataclass(frozen=True, eq=False)
class Described:
    """n movements in each of R representations, ready for comparison."""

    blocks: tuple[Prepared, ...]  # one block of n rows for each representation that is compared sample by sample
    procrustes: Procrustes  # the distance between rows
    mean: str = "arithmetic"  # the A-average over representations
    pairs: Pairs | None = None  # for the representations after those, which are compared pair by pair
    own_weights: tuple[float, ...] | None = None  # the weights of the representations themselves; equal if None
    values: Array | None = None  # (n, d, 9), see `recorded_values`, where these count and movements were at hand
    periods: Array | None = None  # (d,), what the columns of values wrap by, infinite of no angle; None if unknown

    def __len__(self) -> int:
        return len((self.blocks[0] if self.pairs is None else self.pairs.positions).rows)

    @property
    def n_representations(self) -> int:
        """R."""
        return len(self.blocks) + (0 if self.pairs is None else len(self.pairs.measures))

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return self.procrustes.n_columns

    def take(self, chosen: Any) -> Described:
        """Return the chosen movements: a slice, a mask or indices."""
        values = None if self.values is None else self.values[chosen]
        return replace(self._changed(lambda arrays: arrays.take(chosen)), values=values)

    def empty(self, n: int) -> Described:
        """Make room for n movements that are described in the same way."""
        return replace(self._changed(lambda arrays: arrays.empty(n)), values=None)

    def put(self, start: int, others: Described) -> None:
        """Write other movements over those from `start` on."""
        rows = slice(start, start + len(others))
        blocks = list(zip(self.blocks, others.blocks, strict=True))
        if self.pairs is not None and others.pairs is not None:
            if not any(block is self.pairs.positions for block in self.blocks):
                blocks.append((self.pairs.positions, others.pairs.positions))
            self.pairs.shapes.put(start, others.pairs.shapes)
            if self.pairs.details is not None and others.pairs.details is not None:
                self.pairs.details.put(start, others.pairs.details)
        for ours, theirs in blocks:
            ours.rows[rows], ours.squares[rows] = theirs

    def select(self, representations: Iterable[int]) -> Described:
        """Return the same movements in some of the representations."""
        chosen, n = list(representations), len(self.blocks)
        measures = tuple(self.pairs.measures[r - n] for r in chosen if r >= n) if self.pairs is not None else ()
        pairs = replace(self.pairs, measures=measures) if self.pairs is not None and measures else None
        if pairs is not None and pairs.n_rotated == len(measures):
            pairs = replace(pairs, details=None)
        return replace(
            self,
            blocks=tuple(self.blocks[r] for r in chosen if r < n),
            pairs=pairs,
            own_weights=None if self.own_weights is None else tuple(self.own_weights[r] for r in chosen),
        )

    def _changed(self, change: Callable[[Any], Any]) -> Described:
        """Change all arrays alike; positions that are a block as well stay one object, which is compared once."""
        blocks = tuple(map(change, self.blocks))
        if self.pairs is None:
            return replace(self, blocks=blocks)
        old = self.pairs.positions
        same = [new for block, new in zip(self.blocks, blocks, strict=True) if block is old]
        positions = same[0] if same else change(old)
        details = None if self.pairs.details is None else change(self.pairs.details)
        shapes = change(self.pairs.shapes)
        return replace(
            self, blocks=blocks, pairs=replace(self.pairs, positions=positions, shapes=shapes, details=details)
        )

    def coarse(self) -> list[int]:
        """Return for each representation, (R,), that of the same quantity which is not in detail, or itself."""
        coarse = list(range(self.n_representations))
        if self.pairs is not None:
            first = len(self.blocks)
            number = {measure: first + k for k, measure in enumerate(self.pairs.measures)}
            for measure, r in number.items():
                coarse[r] = number.get(measure - len(PAIR_QUANTITIES), r)
        return coarse

    def sizes(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return typical sizes in each representation, (R,): median norms of rows, or distances of opposite tangents.

        Movements that do not move have no size, and do not count; of such alone the norm is 0.
        """
        moving = [block.squares[block.squares > 0] for block in self.blocks]
        by_rows = [float(np.sqrt(np.median(squares))) if len(squares) else 0.0 for squares in moving]
        return np.array(by_rows + [2.0] * (self.n_representations - len(by_rows)))


def squared_distances(A: Described, B: Described) -> Array:
    """Return squared distances (R, n, m).

    Sample by sample they are Procrustes distances, each after a rotation of its own; pair by pair all are measured
    after the rotation that brings the positions over arc length closest.
    """
    squares = np.empty((A.n_representations, len(A), len(B)))
    step = max(1, _TILE_PAIRS // max(1, len(B)))
    for start in range(0, len(A), step):
        rows = slice(start, start + step)
        _fill(A if len(A) <= step else A.take(rows), B, squares[:, rows])
    return squares


def _fill(A: Described, B: Described, squares: Array) -> None:
    n_blocks = len(A.blocks)
    rotations = fill_by_rows(A, B, squares[:n_blocks])
    if A.pairs is not None and B.pairs is not None:
        squares[n_blocks:] = measure_pairs(A.pairs, B.pairs, rotations, pair_distances)


def measure_pairs(
    a: Pairs, b: Pairs, rotations: NDArray[Any] | None, measure: Callable[..., NDArray[Any]], *which: NDArray[np.intp]
) -> NDArray[Any]:
    """Return what `measure`, a function of `kineme.kernels.pair_distances`, gives for each of the measures of a."""
    n_coarse, coarse = len(PAIR_QUANTITIES), a.measures[: a.n_rotated]
    parts = []
    if coarse:
        parts.append(measure(a.shapes, b.shapes, *which, rotations)[list(coarse)])
    if a.n_rotated < len(a.measures):
        detailed = measure(a.details, b.details, *which, None if a.upright else rotations)
        parts.append(detailed[[k - n_coarse for k in a.measures[a.n_rotated :]]])
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def fill_by_rows(A: Described, B: Described, squares: Array) -> NDArray[np.float32] | None:
    """Write the squared distances (R', n, m) of what is compared sample by sample; the rotations of pairs, if needed.

    See `Procrustes.align` for these.
    """
    rotations = aligned = None
    if A.pairs is not None and B.pairs is not None:
        alignment, rotations = A.procrustes.align(A.pairs.positions, B.pairs.positions)
        aligned = A.pairs.positions
    for r, (a, b) in enumerate(zip(A.blocks, B.blocks, strict=True)):
        if aligned is not None and a is aligned:
            squares[r] = np.maximum(a.squares[:, None] + b.squares - 2.0 * alignment, 0.0)
        else:
            squares[r] = A.procrustes.squared_distances(a, b)
    return rotations


class Maps(NamedTuple):
    """n affine maps ``x -> matrix x + shift``, each ``matrix = scale R``, or ``diag(size) R diag(1 / own size)``."""

    matrices: Array  # (n, d, d)
    shifts: Array  # (n, d)
    rotations: Array  # (n, d, d), R
    scales: Array  # (n, d), size over own size: equal numbers unless sizes are per dimension

    def move(self, paths: Array) -> Array:
        """Return paths (n, d, T), each by its map."""
        return np.asarray(self.matrices @ paths + self.shifts[:, :, None])


def fit_maps(paths: Array, targets: Array, normalization: Normalization, procrustes: Procrustes) -> Maps:
    """Return maps of each path (n, d, S) onto the target of the same index (n, d, S), or onto the only one (1, d, S).

    Center onto center, size onto size, and the rotation within the limit that brings samples closest (Procrustes).
    Translation and size are mapped only if the normalization removes them.
    """
    n, d = paths.shape[:2]
    centers, sizes = normalization.center(paths), normalization.size(paths)
    center, size = normalization.center(targets), normalization.size(targets)
    rows = ((paths - centers) / sizes).reshape(n, -1)
    R = procrustes.rotations(((targets - center) / size).reshape(len(targets), -1), rows)
    matrices = size * R / sizes.transpose(0, 2, 1)
    shifts = (center - matrices @ centers)[:, :, 0]
    return Maps(matrices, shifts, R, np.broadcast_to((size / sizes)[:, :, 0], (n, d)))


def maps_onto(paths: Array, onto: Array, like: Compares | None = None) -> Maps:
    """Return maps of each path (n, d, T) onto one path (d, T): the best fit over arc length within the invariances.

    See `fit_maps`; it is fitted to positions at even arc lengths.
    """
    how = specification_of(like)
    along, target = POSITIONS.along(paths), POSITIONS.along(onto[None])
    return fit_maps(along, target, how.normalization, how.procrustes(paths.shape[1]))


def paths_of(movements: Demonstrations | Primitives, like: Compares | None = None) -> Array:
    """Return paths at even times (n, d, T) in recorded coordinates; smoothed as for comparison, or rolled out."""
    if isinstance(movements, Primitives):
        return np.ascontiguousarray(movements.rollout(n_samples=N_POINTS).positions.transpose(0, 2, 1))
    return recorded_paths(movements, even_paths(movements, 0, len(movements), specification_of(like).cutoff))


def moved(primitives: Primitives, maps: Maps) -> Primitives:
    """Return primitives whose paths are the mapped paths of the given ones; exact, without learning again.

    A path is linear in theta = [W, x0, g, tau v0], and the coefficients of x0 and g sum to 1 at every phase, so
    ``x -> M x + b`` is ``theta -> M theta``, with b added to x0 and to g.
    """
    theta = maps.matrices @ to_numbers(primitives)
    theta[:, :, -3:-1] += maps.shifts[:, :, None]
    return from_numbers(primitives.dmp, theta, primitives.durations, shared_label(primitives))

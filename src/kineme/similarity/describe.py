"""Describe movements: smooth them, and compute one block of rows per representation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from kineme.errors import TrajectoryError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.shapes import shapes_of
from kineme.movements.preparation.pauses import without_pauses
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.preparation.smooth import smooth_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import for_tiles
from kineme.similarity.described import Described, Pairs
from kineme.similarity.representation import PAIR_QUANTITIES, rotating
from kineme.similarity.specification import Compares, ComparisonSpecification, specification_of
from kineme.validation import Array

_TILE_SAMPLES = 200_000  # numbers in one tile of paths: with smaller ones, threads wait for each other
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
    return prepare(feature_rows(demos, how), how, how.procrustes(demos.n_dims))


def describe_rows(rows: NDArray[Any], n_dims: int, like: Compares | None = None) -> Described:
    """Return feature rows of n movements that were stored, as descriptions.

    Parameters
    ----------
    rows : array_like of shape (n, sum_r d S_r)
        As `feature_rows` gives them, concatenated: of the representations that are compared sample by sample.
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
    widths = [n_dims * representation.n_points for representation in how.by_rows]
    if rows.ndim != 2 or rows.shape[1] != sum(widths) or not len(rows):
        raise TrajectoryError(
            f"expected feature rows of shape (n, {sum(widths)}) for {n_dims} dimensions and {len(widths)} "
            f"representations, got shape {rows.shape}; pass n_dims and the recognizer that the rows were made for"
        )
    return prepare(np.split(rows, np.cumsum(widths)[:-1], axis=1), how, how.procrustes(n_dims))


def prepare(rows: Iterable[NDArray[Any]], like: Compares, procrustes: Procrustes) -> Described:
    """Return rows (n, d * S), one block per representation that is compared sample by sample, ready for comparison.

    In single precision: comparing with many stored movements is bound by memory, and widths are far above its error.
    What is compared pair by pair is made from the positions over arc length.
    """
    how, rows = like.specification, tuple(rows)
    blocks = tuple(procrustes.prepare(np.ascontiguousarray(block, dtype=np.float32)) for block in rows)
    own = tuple(representation.weight for representation in how.representations)
    if not how.by_pairs:
        return Described(blocks, procrustes, how.mean, own_weights=own)
    r = rotating(how.representations)
    single = np.ascontiguousarray(rows[r], dtype=np.float32)  # so that stored rows say the same
    shapes = shapes_of(single.reshape(len(single), procrustes.n_dims, -1))
    measures = tuple(PAIR_QUANTITIES.index(representation.quantity) for representation in how.by_pairs)
    return Described(blocks, procrustes, how.mean, Pairs(blocks[r], shapes, measures), own)


def feature_rows(movements: MovementsLike, specification: ComparisonSpecification) -> tuple[Array, ...]:
    """Smooth movements and describe them, in double precision.

    Rows (n, d * S) for each representation that is compared sample by sample.
    """
    demos = Demonstrations.of(movements)
    rows = tuple(
        np.empty((len(demos), demos.n_dims * representation.n_points)) for representation in specification.by_rows
    )

    def fill(start: int, stop: int) -> None:
        for block, tile in zip(rows, _tile_rows(demos, start, stop, specification, np.float64)[1], strict=True):
            block[start:stop] = tile

    for_tiles(fill, len(demos), _tile_movements(demos.n_dims))
    return rows


class Tile(NamedTuple):
    """Movements start:stop of many, described; `paths` (n, d, T) are as `even_paths` gives them."""

    start: int
    stop: int
    paths: Array
    described: Described


def for_described(
    demos: Demonstrations,
    like: Compares,
    procrustes: Procrustes,
    work: Callable[[Tile], None],
    most: int | None = None,
) -> None:
    """Describe movements tile by tile, in threads, and call `work` with each tile of at most `most` movements.

    So that the rows of a movement are compared while they are in the core's cache.
    """
    how = like.specification

    def one_tile(start: int, stop: int) -> None:
        work(describe_tile(demos, start, stop, how, procrustes))

    step = _tile_movements(demos.n_dims)
    for_tiles(one_tile, len(demos), step if most is None else min(step, most))


def describe_tile(demos: Demonstrations, start: int, stop: int, like: Compares, procrustes: Procrustes) -> Tile:
    """Describe movements start:stop, all at once."""
    how = like.specification
    paths, rows = _tile_rows(demos, start, stop, how, _precision(how))
    return Tile(start, stop, paths, prepare(rows, like, procrustes))


def describe_paths(paths: Array, like: Compares, procrustes: Procrustes) -> Described:
    """Describe smooth, evenly timed paths (n, d, T): relative ones, or recorded ones where position matters."""
    how = like.specification
    return prepare(_path_rows(paths, how, _precision(how)), how, procrustes)


def _precision(how: ComparisonSpecification) -> DTypeLike:
    """Return single precision, far finer than the widths; double for paths far from the origin for their size."""
    return np.float32 if how.normalization.translation else np.float64


def even_paths(demos: Demonstrations, start: int, stop: int, cutoff: float | None) -> Array:
    """Return movements start:stop, smoothed, at even times, minus their first recorded position, (stop - start, d, T).

    Pauses are cut short first, see `cut_pauses`.
    """
    if (shorter := without_pauses(demos, start, stop)) is not None:
        demos, start, stop = shorter, 0, stop - start
    if cutoff is None:
        return relative_rows(demos, start, stop, N_POINTS)
    return smooth_rows(demos, start, stop, cutoff, N_POINTS)


def recorded_paths(demos: Demonstrations, paths: Array, start: int = 0) -> Array:
    """Move paths (n, d, T) of movements start:start + n, as from `even_paths`, to where they were recorded."""
    return paths + demos.positions[demos.offsets[start : start + len(paths)]][:, :, None]


def _tile_rows(
    demos: Demonstrations, start: int, stop: int, how: ComparisonSpecification, dtype: DTypeLike
) -> tuple[Array, tuple[NDArray[Any], ...]]:
    """Return paths of movements start:stop, as `even_paths` gives them, and their feature rows as `dtype`."""
    relative = even_paths(demos, start, stop, how.cutoff)
    paths = relative if how.normalization.translation else recorded_paths(demos, relative, start)
    return relative, _path_rows(paths, how, dtype)


def _path_rows(paths: Array, how: ComparisonSpecification, dtype: DTypeLike) -> tuple[NDArray[Any], ...]:
    """Return feature rows of paths (n, d, T) as `dtype`."""
    normalized: dict[tuple[float, int], NDArray[Any]] = {}  # representations of equal phase share it
    rows = []
    for representation in how.by_rows:
        phase = (representation.arc_share, representation.n_points)
        if phase not in normalized:
            normalized[phase] = how.normalization.apply(representation.along(paths), dtype)
        rows.append(representation.describe(normalized[phase], how.normalization.translation))
    return tuple(rows)


def _tile_movements(n_dims: int) -> int:
    """Return movements of one tile."""
    return max(1, _TILE_SAMPLES // (n_dims * N_POINTS))

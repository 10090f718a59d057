"""Learn a batch of movements: resample, subtract the start, multiply by the encode matrix.

For generalized cross-validation (G. H. Golub, M. Heath and G. Wahba, Technometrics 21(2), 1979, Eq. (1.4), see
`DMP.choose`) the matrices H of all ridges come from one decomposition: with A the columns that the path is fitted with
and B the second differences of the weights, ``[A; B] = [Q1; Q2] R`` and ``Q1 = U C Z'``,
``H = U C^2 (C^2 + ridge S^2)^-1 U'``, where S^2 are the squared lengths of the columns of ``Q2 Z``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from kineme.dmp.discrete.operators import decoder, encoder, trajectory_columns
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.recorded_as import recorded_as
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.preparation.resample import even_rows, extents_of, relative_rows
from kineme.movements.preparation.trim import preprocess
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import for_tiles
from kineme.sampling import evenly_spaced
from kineme.validation import Array, check_count, check_number, describe, stays

S = TypeVar("S", bound=Specification)

N_BASIS = (6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
RIDGES = tuple(float(10.0**k) for k in range(-12, 3))
_FEWEST_POINTS = 20
_FREE = 0.05  # least share of the samples that a fit may leave undetermined; with fewer the score is 0 / 0
_MOST_MOVEMENTS = 2_000  # from which the choice is made

_TILE_SAMPLES = 200_000  # in one tile: larger ones do not fit the cache, with smaller ones threads wait for each other


def encode(dmp: Specification, movements: MovementsLike) -> dict[str, Any]:
    """Learn one primitive per movement; see `DMP.learn`."""
    recorded = Demonstrations.of(movements)
    demos = preprocess(recorded, dmp.preprocessing)
    n, n_dims = len(demos), demos.n_dims
    n_samples = demos.even_length or dmp.n_points
    operator = encoder(dmp, n_samples)
    weights = np.empty((n, n_dims, dmp.n_basis))
    velocities, extents = np.empty((n, n_dims)), np.empty((n, n_dims))

    def learn_tile(start: int, stop: int) -> None:
        # Evenly sampled movements are multiplied directly: their matrix contains the resampling.
        rows = even_rows(demos, start, stop) if demos.even_length else relative_rows(demos, start, stop, n_samples)
        flat = rows.reshape(-1, n_samples)  # one product; a stack of matrices would be as many small products
        np.matmul(flat, operator.weights, out=weights[start:stop].reshape(len(flat), -1))
        # Row by row, with the same last digits whatever movements are beside it: libraries store them.
        np.einsum("ij,j->i", flat, operator.velocity, out=velocities[start:stop].reshape(-1))
        extents[start:stop] = extents_of(demos, start, stop)

    for_tiles(learn_tile, n, max(1, _TILE_SAMPLES // (n_dims * n_samples)))
    starts = demos.positions[demos.offsets[:-1]]
    check_movement(demos, starts, extents)
    return {
        "scaled_weights": weights,
        "starts": starts,
        "goals": demos.positions[demos.offsets[1:] - 1],
        "velocities": velocities / demos.durations[:, None],
        "durations": demos.durations,
        "extents": extents,
        "labels": demos.labels,
        "names": demos.names,
        "recorded_as": recorded_as(recorded, dmp.preprocessing),
    }


def check_movement(demos: Demonstrations, starts: Array, extents: Array) -> None:
    """Refuse a movement that does not move."""
    still = stays(starts, extents)
    if still.any():
        i = int(np.argmax(still))
        raise TrajectoryError(
            f"{describe(i, demos.names)}: expected a movement, got {demos.lengths[i]} samples "
            f"at the same place ({still.sum()} of {len(demos)} movements do not move); leave them out"
        )


@dataclass(frozen=True, eq=False)
class BasisSelection(Generic[S]):
    """Result of `DMP.choose`.

    - `dmp`: the specification with the number of basis functions and the ridge that were chosen.
    - `n_basis` (a,): the numbers of basis functions that were tried.
    - `ridge` (b,): the ridges that were tried.
    - `errors` (a, b): square root of the generalized cross-validation score: the error that is to be expected at
      samples that were not fitted, their own noise included, as a share of a movement's largest extent.
    - `degrees_of_freedom` (a, b): trace(H): how many numbers each dimension of a movement is fitted with.
    """

    dmp: S
    n_basis: Array
    ridge: Array
    errors: Array
    degrees_of_freedom: Array

    @property
    def error(self) -> float:
        """The error of what was chosen."""
        a = int(np.argmax(self.n_basis == self.dmp.n_basis))
        return float(self.errors[a, int(np.argmax(self.ridge == self.dmp.ridge))])

    @property
    def curve(self) -> dict[int, float]:
        """Number of basis functions -> its error with the best ridge."""
        return {int(n): float(error) for n, error in zip(self.n_basis, self.errors.min(axis=1), strict=True)}


def choose(
    dmp: S,
    movements: MovementsLike,
    n_basis: Sequence[int] | None,
    ridge: Sequence[float] | None,
    tolerance: float,
    negligible: float,
) -> BasisSelection[S]:
    """Score every number of basis functions with every ridge; see `DMP.choose`."""
    if dmp.fit != "trajectory":
        raise SpecificationError(
            f'expected fit="trajectory", whose fit and error are of the path, got fit={dmp.fit!r}; '
            'the noise of its target, a second derivative, is not independent: choose with fit="trajectory"'
        )
    check_number("tolerance", tolerance, least=0.0)
    check_number("negligible", negligible, least=0.0)
    rows = relative_paths(dmp, movements)
    counts = _counts(n_basis, rows.shape[1])
    strengths = RIDGES if ridge is None else _listed("ridge", ridge)
    for strength in strengths:
        check_number("ridge", strength, above=0.0)
    ridges = np.array(strengths, dtype=np.float64)
    if not len(counts) or not len(ridges):
        raise SpecificationError(f"expected at least one n_basis and one ridge, got {len(counts)} and {len(ridges)}")
    scores = [score(replace(dmp, n_basis=count), rows, ridges) for count in counts]
    errors, degrees = (np.array(column) for column in zip(*scores, strict=True))
    best = errors.min(axis=1)
    a = int(np.argmax(best <= max((1.0 + tolerance) * best.min(), negligible)))  # the fewest that are good enough
    chosen = replace(dmp, n_basis=counts[a], ridge=float(ridges[errors[a].argmin()]))
    return BasisSelection(chosen, np.array(counts), ridges, errors, degrees)


def relative_paths(dmp: Specification, movements: MovementsLike) -> Array:
    """Paths from the start (n d, T) in units of their extent, T at most the median number of recorded samples."""
    demos = preprocess(Demonstrations.of(movements), dmp.preprocessing)
    demos = demos[evenly_spaced(len(demos), _MOST_MOVEMENTS)]
    extents = extents_of(demos, 0, len(demos))
    check_movement(demos, demos.positions[demos.offsets[:-1]], extents)
    n_points = int(np.clip(np.median(demos.lengths), _FEWEST_POINTS, max(_FEWEST_POINTS, dmp.n_points)))
    rows = relative_rows(demos, 0, len(demos), n_points) / extents.max(axis=1)[:, None, None]
    return np.asarray(rows.reshape(-1, n_points))


def score(dmp: Specification, rows: Array, ridges: Array) -> tuple[Array, Array]:
    """Root of the score of relative paths (m, T), and degrees of freedom, of one number of basis functions."""
    n_points = rows.shape[1]
    response = decoder(dmp, n_points)
    columns, curvature = trajectory_columns(response, dmp.K)
    Q, _ = np.linalg.qr(np.vstack((columns, curvature)))
    U, C, Z = np.linalg.svd(Q[:n_points], full_matrices=False)
    S2 = np.sum((Q[n_points:] @ Z.T) ** 2, axis=0)
    y = rows - rows[:, -1:] * response.goal[0]
    parts = np.sum((y @ U) ** 2, axis=0)
    outside = max(0.0, float(np.sum(y**2) - parts.sum()))  # of what the columns span
    shares = C**2 / (C**2 + ridges[:, None] * S2)
    mean_square = (outside + (1.0 - shares) ** 2 @ parts) / rows.size
    degrees = shares.sum(axis=1)
    free = 1.0 - degrees / n_points
    errors = np.full(len(ridges), np.inf)  # where as many numbers as samples leave nothing to predict
    np.divide(np.sqrt(mean_square), free, out=errors, where=free > _FREE)
    return errors, degrees


def _counts(n_basis: Sequence[int] | None, n_points: int) -> list[int]:
    if n_basis is None:
        return [count for count in N_BASIS if count <= n_points]
    return sorted({check_count("n_basis", count, 3, most=n_points) for count in _listed("n_basis", n_basis)})


def _listed(name: str, values: Any) -> list[Any]:
    try:
        return list(values)
    except TypeError:
        raise SpecificationError(f"expected {name} to be a sequence of what to try, got {values!r}") from None

"""The conceptual space of symbols: how far apart they are, which are near, which lie between.

Source: P. Gärdenfors, "Conceptual Spaces: The Geometry of Thought", MIT Press 2000: quality dimensions with a metric,
betweenness as ``d(a, c) + d(c, b) = d(a, b)``, likeness that falls with distance (chapter 1), concepts as regions
around prototypes (chapter 3).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.styles.parameters import check_primitives, from_numbers, to_numbers
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.similarity.describe import Described, describe, maps_onto, paths_of
from kineme.similarity.similarity import averaged, median_distances
from kineme.similarity.specification import Compares
from kineme.validation import Array, check_count, check_number


class Near(NamedTuple):
    """A symbol and how far it is, in kernel widths."""

    symbol: Any
    distance: float


class Between(NamedTuple):
    """A symbol that lies between two others."""

    symbol: Any
    excess: float  # (d(a, c) + d(c, b)) / d(a, b) - 1: the detour, 0 on the straight way
    share: float  # of the way from a to b, where c's foot on it is, 0 to 1


@dataclass(frozen=True, eq=False)
class ConceptualSpace:
    """Symbols at distances; made by `conceptual_space`.

    - `distances` (s, s).
    """

    symbols: tuple[Any, ...]
    distances: Array

    def nearest(self, symbol: Any, k: int = 3) -> tuple[Near, ...]:
        """The `k` symbols nearest to one, nearest first; all of them where there are fewer."""
        check_count("k", k, 1)
        i = self.index(symbol)
        order = [j for j in np.argsort(self.distances[i], kind="stable").tolist() if j != i][:k]
        return tuple(Near(self.symbols[j], float(self.distances[i, j])) for j in order)

    def between(self, a: Any, b: Any, eps: float = 0.25) -> tuple[Between, ...]:
        """Symbols c with ``d(a, c) + d(c, b) <= (1 + eps) d(a, b)``, the smallest detour first.

        In a space of many dimensions nothing lies exactly between, hence eps; and shapes of one size lie on a sphere,
        where half way along an arc of angle t the detour is ``1 / cos(t / 4) - 1``, 0.08 at a right angle. A symbol
        between is also nearer to each of the two than they are to each other.

        Raises `SpecificationError`: a symbol that is not among `symbols`, twice the same, or `eps` below 0.
        """
        check_number("eps", eps, least=0.0)
        i, j = self.index(a), self.index(b)
        if i == j:
            raise SpecificationError(f"expected two different symbols, got {a!r} twice")
        d, ab = self.distances, self.distances[i, j]
        between_them = []
        for c in range(len(self.symbols)):
            ac, cb = d[i, c], d[c, j]
            if c in (i, j) or ac + cb > (1 + eps) * ab or max(ac, cb) >= ab:
                continue
            share = 0.5 + 0.5 * (ac**2 - cb**2) / ab**2  # law of cosines
            between_them.append(Between(self.symbols[c], float((ac + cb) / ab - 1.0), float(np.clip(share, 0.0, 1.0))))
        return tuple(sorted(between_them, key=lambda symbol: symbol.excess))

    def index(self, symbol: Any) -> int:
        """Index of a symbol among `symbols`.

        Raises `SpecificationError`: it is not among them.
        """
        if symbol not in self.symbols:
            raise SpecificationError(f"expected one of the symbols {list(self.symbols)}, got {symbol!r}")
        return self.symbols.index(symbol)


def conceptual_space(
    symbols: Sequence[Hashable],
    prototypes: Described | MovementsLike,
    like: Compares | None = None,
) -> ConceptualSpace:
    """Distances between symbols, by their prototypes.

    ``d(a, b) = sqrt(-2 log K(a, b)) = sqrt(mean_r d_r(a, b)^2 / sigma_r^2)`` with the *geometric* average of the
    representations' kernels: each representation is a domain whose salience is ``1 / sigma_r``, likeness falls with
    distance as a Gaussian (Gärdenfors, chapter 1), and where no rotation is taken out d is a weighted Euclidean
    metric. The best rotation within a bounded angle may break the triangle inequality. The recognizer's arithmetic mean
    says who is who, but beyond the nearest all are equally far; a space needs distances that go on growing. So only
    representations that are compared sample by sample count: the others are not metrics. The widths sigma_r are the
    median distances of the prototypes, so that all representations matter alike.

    Parameters
    ----------
    symbols : sequence of s symbols, all different
    prototypes : Described, or s movements
        One for each symbol: its medoid, say.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations and invariances to take.

    Raises
    ------
    SpecificationError
        Not one prototype for each symbol, or a symbol twice.
    """
    described = replace(describe(prototypes, like), mean="geometric")
    names = tuple(symbols)
    if len(names) != len(described) or len(set(names)) != len(names):
        raise SpecificationError(
            f"expected one prototype for each of different symbols, got {len(described)} prototypes for "
            f"{len(names)} symbols, {len(set(names))} of them different"
        )
    n_rows = len(described.blocks)
    widths = median_distances(described)[:n_rows]
    described = described.select(range(n_rows))
    similarity = averaged(described, np.where(widths > 0, widths, 1.0))  # 0 where the prototypes do not differ
    d = np.sqrt(np.maximum(-2.0 * similarity.log_average(described, described), 0.0))
    d = 0.5 * (d + d.T)
    np.fill_diagonal(d, 0.0)
    return ConceptualSpace(names, d)


def morph(a: Primitives, b: Primitives, shares: ArrayLike, like: Compares | None = None) -> Primitives:
    """Movements on the way from `a` to `b`, one for each share of the way: 0 is a, 1 is b.

    b is laid onto a, and ``theta = (1 - s) theta_a + s theta_b`` is the mean of their paths at equal phase (see
    `kineme.dmp.styles.parameters`); then position, size (geometrically) and direction (about one axis) go the
    same share of the way back to b's own. So no movement shrinks half way because the two face different ways, as a
    plain mean of paths does.

    Parameters
    ----------
    a, b : Primitives
        Batches of one with the same specification: two prototypes, say.
    shares : array_like of shape (m,)
        From 0 to 1.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take.

    Raises
    ------
    TrajectoryError
        Not one primitive each, or of different dimensions.
    SpecificationError
        Different specifications, or shares that are not between 0 and 1.
    """
    for symbol in (a, b):
        check_primitives(symbol)
        if len(symbol) != 1:
            raise TrajectoryError(f"expected one primitive at each end, got {len(symbol)}; choose one, primitives[0]")
    if a.n_dims != b.n_dims:
        raise TrajectoryError(f"expected primitives of the same dimensions, got {a.n_dims} and {b.n_dims}")
    if a.dmp != b.dmp:
        raise SpecificationError(f"expected primitives of one specification, got {a.dmp} and {b.dmp}; learn them again")
    s = np.atleast_1d(np.asarray(shares, dtype=np.float64))
    if s.ndim != 1 or not ((s >= 0) & (s <= 1)).all():
        raise SpecificationError(f"expected shares of the way from 0 to 1, got {shares!r}")
    paths = np.concatenate((paths_of(a), paths_of(b)))
    back = maps_onto(paths[:1], paths[1], like)  # from a's frame to b's
    theta_a, theta_b = to_numbers(a)[0], to_numbers(b)[0]
    inverse = np.linalg.inv(back.matrices[0])
    laid = inverse @ theta_b
    laid[:, -3:-1] -= (inverse @ back.shifts[0])[:, None]
    theta = theta_a + s[:, None, None] * (laid - theta_a)
    # The share of the way back, about a center that moves evenly to where the map takes it. With sizes per dimension
    # the matrix goes evenly, since it is no rotation and one size.
    center, matrix = paths[0].mean(axis=1), back.matrices[0]
    if np.ptp(back.scales[0]) == 0:
        matrices = (back.scales[0] ** s[:, None])[:, :, None] * _part_rotation(back.rotations[0], s)
    else:
        matrices = np.eye(len(matrix)) + s[:, None, None] * (matrix - np.eye(len(matrix)))
    shifts = center + s[:, None] * (matrix @ center + back.shifts[0] - center) - matrices @ center
    theta = matrices @ theta
    theta[:, :, -3:-1] += shifts[:, :, None]
    return from_numbers(a.dmp, theta, a.durations * (b.durations / a.durations) ** s)


def _part_rotation(R: Array, s: Array) -> Array:
    """Rotations by the share s (m,) of the angle of R, about the same axis."""
    from scipy.spatial.transform import Rotation

    d = len(R)
    if d not in (2, 3):
        return np.tile(np.eye(d), (len(s), 1, 1))
    in_space = np.eye(3)
    in_space[:d, :d] = R
    return np.asarray(
        Rotation.from_rotvec(s[:, None] * Rotation.from_matrix(in_space).as_rotvec()).as_matrix()[:, :d, :d]
    )


def classical_scaling(distances: Array) -> tuple[Array, float]:
    """Positions (s, 2) in the plane whose distances are close to those given, and the share of their squares kept.

    Classical multidimensional scaling: the two leading eigenvectors of ``-J D^2 J / 2``, J taking out the mean.

    Source: W. S. Torgerson, "Multidimensional scaling: I. Theory and method", Psychometrika 17, 1952.
    """
    squares = distances**2
    centered = squares - squares.mean(axis=0)
    B = -0.5 * (centered - centered.mean(axis=1, keepdims=True))
    values, vectors = np.linalg.eigh(0.5 * (B + B.T))
    positive = np.maximum(values[::-1], 0.0)
    positions = np.zeros((len(distances), 2))
    k = min(2, len(distances))
    leading = vectors[:, ::-1][:, :k]
    sign = np.sign(leading[np.abs(leading).argmax(axis=0), np.arange(k)])  # an eigenvector has no sign of its own
    positions[:, :k] = leading * np.where(sign == 0, 1.0, sign) * np.sqrt(positive[:k])
    total = float(positive.sum())
    return positions, float(positive[:2].sum() / total) if total > 0 else 1.0

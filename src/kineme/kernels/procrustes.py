"""Procrustes distances: after the best rotation, by at most a given angle or under a prior."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.rotation import (
    RotationPrior,
    best_products,
    best_rotations,
    blocks,
    half_angle,
    limited,
    soft_products,
    soft_products_in_plane,
    soft_rotations,
)
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles, single_threaded_blas
from kineme.validation import Array, check_number

#: Writes of a block of products (3 n, 3 m), norms (n,), (m,): best products (n, m), and rotations (n, m, 3, 3).
Filler = Callable[[NDArray[Any], Array, Array, Array, NDArray[Any]], None]


class Prepared(NamedTuple):
    """Rows prepared for comparison, complex in two dimensions and real otherwise, with their squared norms."""

    rows: NDArray[Any]
    squares: Array

    def take(self, chosen: Any) -> Prepared:
        """The chosen rows."""
        return Prepared(self.rows[chosen], self.squares[chosen])

    def empty(self, n: int) -> Prepared:
        """Room for n rows."""
        return Prepared(*(np.empty((n, *batch.shape[1:]), batch.dtype) for batch in self))


@dataclass(frozen=True)
class Procrustes:
    """Squared distance of two movements after the best rotation of one of them.

    ``d(A, B)^2 = min_R |A - R B|^2 = |A|^2 + |B|^2 - 2 max_R <A, R B>`` over rotations R (no mirror images) by
    at most `max_angle`. With a `prior`, any rotation is allowed and a large one costs: ``<A, R B>`` is replaced by
    ``<A, R B> + |A| |B| (tr(R^T F) - tr F)``, see `kernels.rotation`. In the plane, with ``z = x + i y``,
    ``<A, R B> = Re(exp(-i angle) sum_t a_t conj(b_t))``: one complex matrix product for all pairs. In space, one real
    matrix product for all pairs, and a small problem for each: a quadratic form of unit quaternions with a limit, see
    `kernels.rotation`, the root of a quartic with a prior. In one dimension, and with ``max_angle = 0``, it is the
    Euclidean distance.

    Of J points that move together, such as two hands or the joints of a body, the rotation is one: sums over t are then
    over all points and times. At a cost linear in J.

    - `n_dims`: dimensions d of the movements, or of each of their points; rows are dimension-major, x_1 ... x_S, y_1
      ... y_S, Eq. (9), one point after the other.
    - `max_angle`: largest rotation [rad], 0 to pi. Choose it as small as the application allows: with pi, N and Z are
      the same, and with more than a right angle, V and caret. Beyond three dimensions only 0 is possible.

    B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", JOSA A 4(4), 1987.
    """

    n_dims: int
    max_angle: float = math.pi / 3
    prior: RotationPrior | None = None  # instead of a limit, with ``max_angle=pi``, in two and three dimensions
    n_points: int = 1  # J, points in the plane or in space
    #: Weights (q, J) by which points, or the columns of what is no points, are added up to the q that are compared pair
    #: by pair; all as they are if None.
    mixing: tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        check_number("max_angle", self.max_angle, least=0.0, smallest=0.0)
        if self.max_angle > math.pi + 1e-12:
            raise SpecificationError(f"expected max_angle of at most pi, got {self.max_angle!r}; angles are in radians")
        if self.n_dims > 3 and self.max_angle > 0:
            raise SpecificationError(
                f"expected max_angle=0 beyond three dimensions, got {self.max_angle!r} with {self.n_dims} dimensions"
            )
        if self.prior is not None:
            if self.n_dims not in (2, 3) or self.max_angle < math.pi - 1e-12:
                raise SpecificationError(
                    "expected a prior with max_angle=pi in two or three dimensions, got one with "
                    f"max_angle={self.max_angle!r} and {self.n_dims} dimensions; leave the prior out"
                )
            self.prior.matrix(self.n_dims)
        if self.n_points > 1 and self.n_dims not in (2, 3):
            raise SpecificationError(
                f"expected points in the plane or in space, got points of {self.n_dims} dimensions"
            )

    @property
    def n_columns(self) -> int:
        """Dimensions of the movements, those of all points."""
        return self.n_dims * self.n_points

    def by_coordinates(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Rows (n, J d S), point after point, with the x of all points first: those of one movement of J S samples."""
        return _exchanged(rows, self.n_points, self.n_dims)

    def by_points(self, rows: NDArray[Any]) -> NDArray[Any]:
        """The inverse of `by_coordinates`."""
        return _exchanged(rows, self.n_dims, self.n_points)

    def mixed(self, paths: NDArray[Any]) -> NDArray[Any]:
        """Paths (n, J d, S) of the q points that are compared pair by pair, (n, q d, S): centered, at size 1."""
        if self.mixing is None:
            return paths
        n, samples = len(paths), paths.shape[2]
        points = paths.reshape(n, len(self.mixing[0]), -1, samples)
        mixture = np.einsum("qj,njds->nqds", np.array(self.mixing, dtype=paths.dtype), points)
        sizes = np.sqrt((mixture**2).sum(axis=(1, 2)).mean(axis=1))
        return np.asarray(mixture.reshape(n, -1, samples) / np.where(sizes > 0, sizes, 1.0)[:, None, None])

    def prepare(self, rows: Array) -> Prepared:
        """Rows (n, d * S) as comparisons need them, in their own precision; so stored movements are converted once."""
        rows = self.by_coordinates(rows)
        in_plane = self.n_dims == 2 and self.max_angle > 0
        return Prepared(as_complex(rows) if in_plane else rows, _squares(rows))

    def squared_distances(self, A: Prepared, B: Prepared) -> Array:
        """Squared distances (n, m) between prepared rows."""
        norms = A.squares[:, None] + B.squares
        return np.maximum(norms - 2.0 * self.alignment(A, B), 0.0)

    def alignment(self, A: Prepared, B: Prepared) -> Array:
        """The largest inner products ``<A, R B>`` (n, m) over the rotations allowed, less what they cost."""
        if self.max_angle == 0 or self.n_dims == 1:
            mixed = np.iscomplexobj(A.rows) != np.iscomplexobj(B.rows)  # one was prepared for rotations
            a, b = (
                as_complex(batch.rows) if mixed and not np.iscomplexobj(batch.rows) else batch.rows for batch in (A, B)
            )
            return np.asarray((a @ b.conj().T).real)
        if self.n_dims == 2:
            if self.prior is None:  # the angle's sign does not matter here
                return _within(_split(_products(A.rows, B.rows), len(B.rows)), self.max_angle)
            return self._soft_in_plane(A, B, rotations=False)[0]
        filler = self._hard_filler if self.prior is None else self._soft_filler
        return _in_space(A, B, filler(len(A.rows) * len(B.rows)))[0]

    def align(self, A: Prepared, B: Prepared) -> tuple[Array, NDArray[np.float32] | None]:
        """The same, and rotations of B onto A: (n, m, 2), cosine and sine, in the plane, (n, m, 3, 3) in space.

        Under a limit in space, these are the best free rotations, turned back to the limit.
        """
        if self.max_angle == 0 or self.n_dims not in (2, 3):
            return self.alignment(A, B), None
        if self.n_dims == 2:
            if self.prior is not None:
                return self._soft_in_plane(A, B, rotations=True)
            re, im = (part.astype(np.float64) for part in _split(_products(A.rows, B.rows), len(B.rows)))
            angle = np.clip(np.arctan2(-im, re), -self.max_angle, self.max_angle)
            c, s = np.cos(angle), np.sin(angle)
            return c * re - s * im, np.stack((c, s), -1).astype(np.float32)
        n_pairs = len(A.rows) * len(B.rows)
        free = self._soft_filler(n_pairs, rotations=True)
        if self.prior is not None:
            return _in_space(A, B, free, rotations=True)
        hard = self._hard_filler(n_pairs)

        def fill(products: NDArray[Any], a: Array, b: Array, best: Array, R: NDArray[Any]) -> None:
            free(products, a, b, best, R)
            R[:] = limited(R, self.max_angle)
            hard(products, a, b, best, R)

        return _in_space(A, B, fill, rotations=True)

    def rotations(self, A: Array, B: Array) -> Array:
        """Rotation matrices (m, d, d) that bring each row of B closest to the same row of A, or to A's only row.

        Of points they are (m, J d, J d), with the rotation of each point along the diagonal.

        Of several rotations that are equally good, as about the axis of a straight movement, the smallest is returned.
        A prior decides how alike two movements are, not how one is best laid onto the other: it has no part here.
        """
        if self.max_angle == 0 or self.n_dims not in (2, 3):
            return np.broadcast_to(np.eye(self.n_columns), (len(B), self.n_columns, self.n_columns)).copy()
        A, B = self.by_coordinates(A), self.by_coordinates(B)
        if self.n_dims == 2:
            product = np.einsum("ij,ij->i", *np.broadcast_arrays(as_complex(A), as_complex(B).conj()))
            angle = np.clip(np.angle(product), -self.max_angle, self.max_angle)
            c, s = np.cos(angle), np.sin(angle)
            return blocks(np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2), self.n_points)
        C = A.reshape(len(A), 3, -1) @ B.reshape(len(B), 3, -1).transpose(0, 2, 1)
        return blocks(best_rotations(C, self.max_angle), self.n_points)

    def _soft_in_plane(self, A: Prepared, B: Prepared, rotations: bool) -> tuple[Array, NDArray[np.float32] | None]:
        """Best products (n, m) under the prior, and cosines and sines (n, m, 2)."""
        assert self.prior is not None
        n, m, parts, trace = len(A.rows), len(B.rows), _products(A.rows, B.rows), self.prior.matrix(2).trace()
        if parts.dtype == np.float32 and use_compiled(n * m * _PLANE_OPERATIONS):
            best, R = np.empty((n, m)), np.empty((n, m, 2) if rotations else (0, 0, 2), np.float32)
            norms = np.sqrt(trace * A.squares), np.sqrt(trace * B.squares)
            compiled_module("kineme.kernels._compiled").fill_soft_in_plane(parts, *norms, best, R)
            return best, R if rotations else None
        re, im = (part.astype(np.float64) for part in _split(parts, m))
        best, c, s = soft_products_in_plane(re, im, trace * np.sqrt(A.squares)[:, None] * np.sqrt(B.squares))
        return best, np.stack((c, -s), -1).astype(np.float32) if rotations else None

    def _hard_filler(self, n_pairs: int) -> Filler:
        """Return the writer of the best products (n, m) of a block of products (3 n, 3 m): compiled or plain."""
        if use_compiled(n_pairs * _PAIR_OPERATIONS):
            fill_best_products = compiled_module("kineme.kernels._rotation").fill_best_products
            return lambda products, a, b, best, R: fill_best_products(products, *half_angle(self.max_angle), best)

        def fill(products: NDArray[Any], a: Array, b: Array, best: Array, R: NDArray[Any]) -> None:
            best[:] = best_products(_covariances(products), self.max_angle).reshape(best.shape)

        return fill

    def _soft_filler(self, n_pairs: int, rotations: bool = False) -> Filler:
        """The same under a prior, or under none, and rotations."""
        F = np.zeros((3, 3)) if self.prior is None else self.prior.matrix(3)
        if use_compiled(_CALL_OPERATIONS + n_pairs * _PAIR_OPERATIONS):
            soft = compiled_module("kineme.kernels._soft_rotation")
            if rotations:
                return lambda products, a, b, best, R: soft.fill_soft_rotations(products, a, b, F, best, R)
            return lambda products, a, b, best, R: soft.fill_soft_products(products, a, b, F, best)

        def fill(products: NDArray[Any], a: Array, b: Array, best: Array, R: NDArray[Any]) -> None:
            norms = (a[:, None] * b).ravel()
            M = np.asarray(_covariances(products) + norms[:, None, None] * F)
            best[:] = (soft_products(M) - norms * np.trace(F)).reshape(best.shape)
            if rotations:
                R[:] = soft_rotations(M).reshape(R.shape)

        return fill


def _exchanged(rows: NDArray[Any], outer: int, inner: int) -> NDArray[Any]:
    """Rows (n, outer inner S) with the inner parts of all outer ones side by side."""
    if 1 in (outer, inner):
        return rows
    parts = rows.reshape(len(rows), outer, inner, -1)
    return np.ascontiguousarray(parts.transpose(0, 2, 1, 3)).reshape(len(rows), -1)


_PLANE_OPERATIONS = 20  # elementary operations of a pair in the plane
_ROWS_AT_ONCE = 256
_MANY = 16  # rows from which on a product by BLAS is faster


def _squares(rows: NDArray[Any]) -> Array:
    """Squared norms (n,), in double precision."""
    squares = np.empty(len(rows))
    for start in range(0, len(rows), _ROWS_AT_ONCE):  # converted rows stay in the cache
        some = rows[start : start + _ROWS_AT_ONCE].astype(np.float64, copy=False)
        np.einsum("ij,ij->i", some, some, out=squares[start : start + _ROWS_AT_ONCE])
    return squares


def as_complex(rows: NDArray[Any]) -> NDArray[Any]:
    """Rows x_1 ... x_S, y_1 ... y_S as complex rows x + i y."""
    half = rows.shape[1] // 2
    pairs = np.empty((len(rows), half), np.result_type(rows, np.complex64))
    if use_compiled(rows.size):
        compiled_module("kineme.kernels._compiled").fill_pairs(rows, _as_real(pairs))
        return pairs
    pairs.real, pairs.imag = rows[:, :half], rows[:, half:]
    return pairs


def _products(A: NDArray[Any], B: NDArray[Any]) -> NDArray[Any]:
    """Real and imaginary part of ``conj(A) @ B.T`` by one real product, faster than a complex one; see `_split`.

    The fewer rows are taken twice, the second time turned by a right angle.
    """
    if len(A) > len(B):
        return np.asarray(_as_real(A) @ _as_real(np.concatenate((B, -1j * B)).astype(B.dtype)).T)
    twice, many = _as_real(np.concatenate((A, 1j * A)).astype(A.dtype)), _as_real(B)
    return _few_products(twice, many) if len(A) < _MANY else np.asarray(twice @ many.T)


def _split(parts: NDArray[Any], m: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Real and imaginary parts (n, m) of such products, which are (n, 2 m) or (2 n, m)."""
    if parts.shape[1] == 2 * m:
        return parts[:, :m], parts[:, m:]
    return parts[: len(parts) // 2], parts[len(parts) // 2 :]


def _as_real(rows: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(rows).view(rows.real.dtype)


def _few_products(few: NDArray[Any], many: NDArray[Any]) -> NDArray[Any]:
    """``few @ many.T``, reading `many` once; NumPy would copy all of it first.

    In one thread: with two, each waits for the other, which on a busy machine takes twenty times as long.
    """
    if use_compiled(few.shape[0] * many.size):
        products = np.empty((len(few), len(many)), few.dtype)
        compiled_module("kineme.kernels._compiled").fill_products(few, many, products)
        return products
    with single_threaded_blas():
        return np.stack([many @ row for row in few])


def _within(parts: tuple[NDArray[Any], NDArray[Any]], max_angle: float) -> Array:
    """Largest real part of ``(re + i im) exp(-i angle)`` within the angle."""
    re, im = (part.astype(np.float64) for part in parts)
    # In double precision the squares of single precision neither overflow nor vanish; others need more care.
    size = np.sqrt(re * re + im * im) if parts[0].dtype == np.float32 else np.hypot(re, im)
    if max_angle >= math.pi:
        return np.asarray(size)
    # It is largest at the angle of the product, or at the end of the range next to it.
    c, s = math.cos(max_angle), math.sin(max_angle)
    at_end = np.abs(im, out=im)
    at_end *= s
    at_end += c * re
    return np.where(re >= c * size, size, at_end)


_PAIRS = 20_000  # covariances at a time: their intermediate results fit the cache of one core
_PAIR_OPERATIONS = 1000  # elementary operations of the plain twin per pair
_CALL_OPERATIONS = 10_000  # the time of a call of it for a few pairs, in such operations


def _in_space(
    A: Prepared, B: Prepared, fill: Filler, rotations: bool = False
) -> tuple[Array, NDArray[np.float32] | None]:
    """Return what `fill` makes of the covariances ``A_i B_j^T`` (n, m), a tile of the longer side at a time."""
    n, m = len(A.rows), len(B.rows)
    a, b = A.rows.reshape(n * 3, -1), B.rows.reshape(m * 3, -1)
    p, q = np.sqrt(A.squares), np.sqrt(B.squares)
    best, R = np.empty((n, m)), np.empty((n, m, 3, 3) if rotations else (n, m, 0, 0), np.float32)

    def rows(start: int, stop: int) -> None:
        some = slice(start, stop)
        fill(a[3 * start : 3 * stop] @ b.T, p[some], q, best[some], R[some])

    def columns(start: int, stop: int) -> None:
        some, part = slice(start, stop), b[3 * start : 3 * stop]
        products = _few_products(a, part) if n < _MANY else a @ part.T
        # Contiguous, as the rows are: for another layout the loops would be compiled once more.
        own, turns = np.empty((n, stop - start)), np.empty((n, stop - start, *R.shape[2:]), np.float32)
        fill(products, p, q[some], own, turns)
        best[:, some], R[:, some] = own, turns

    if n >= m:
        for_tiles(rows, n, max(1, _PAIRS // m))
    else:
        for_tiles(columns, m, max(1, _PAIRS // n))
    return best, R if rotations else None


def _covariances(products: NDArray[Any]) -> NDArray[Any]:
    """A block of products (3 n, 3 m) as covariances (n m, 3, 3)."""
    n, m = products.shape[0] // 3, products.shape[1] // 3
    return products.reshape(n, 3, m, 3).transpose(0, 2, 1, 3).reshape(-1, 3, 3)

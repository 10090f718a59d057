"""Distances after the best rotation within an angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.compiled import compiled_module, use_compiled
from kineme.errors import SpecificationError
from kineme.parallel import single_threaded_blas
from kineme.validation import Array, check_number


class Prepared(NamedTuple):
    """Rows ready for comparison: complex in the plane, as they are elsewhere; and their squared norms."""

    rows: NDArray[Any]
    squares: Array

    def take(self, chosen: Any) -> Prepared:
        """The chosen rows."""
        return Prepared(self.rows[chosen], self.squares[chosen])


@dataclass(frozen=True)
class Procrustes:
    """Squared distance of two movements after the best rotation of one of them by at most `max_angle`.

    ``d(A, B)^2 = min_R |A - R B|^2 = |A|^2 + |B|^2 - 2 max_R <A, R B>`` over rotations R (no mirror images) by
    at most `max_angle`. In the plane, with ``z = x + i y``, ``<A, R B> = Re(exp(-i angle) sum_t a_t conj(b_t))``:
    one complex matrix product for all pairs. In space, a singular value decomposition per pair (Kabsch). In one
    dimension, and with ``max_angle = 0``, it is the Euclidean distance.

    Parameters
    ----------
    n_dims : int
        Dimensions d of the movements; rows are dimension-major, x_1 ... x_S, y_1 ... y_S, Eq. (9).
    max_angle : float
        Largest rotation [rad], 0 to pi. Choose it as small as the application allows: with pi, N and Z are the
        same, and with more than a right angle, V and caret. In space, a best rotation beyond the limit is turned
        back about its own axis, which is close to, but not always, the best one within it. Beyond three dimensions
        only 0 is possible.

    References
    ----------
    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Crystallographica A32, 1976.
    """

    n_dims: int
    max_angle: float = math.pi / 3

    def __post_init__(self) -> None:
        check_number("max_angle", self.max_angle, least=0.0)
        if self.max_angle > math.pi + 1e-12:
            raise SpecificationError(f"expected max_angle of at most pi, got {self.max_angle!r}; angles are in radians")
        if self.n_dims > 3 and self.max_angle > 0:
            raise SpecificationError(
                f"expected max_angle=0 beyond three dimensions, got {self.max_angle!r} with {self.n_dims} dimensions"
            )

    def prepare(self, rows: Array) -> Prepared:
        """Rows (n, d * S) in the form that comparisons need, so that stored movements are converted once.

        The products run in the rows' own precision, float64 or float32; the norms are float64.
        """
        in_plane = self.n_dims == 2 and self.max_angle > 0
        squares = np.einsum("ij,ij->i", rows, rows, dtype=np.float64)
        return Prepared(as_complex(rows) if in_plane else rows, squares)

    def squared_distances(self, A: Prepared, B: Prepared) -> Array:
        """Squared distances (n, m) between prepared rows."""
        norms = A.squares[:, None] + B.squares
        return np.maximum(norms - 2.0 * self.alignment(A, B), 0.0)

    def alignment(self, A: Prepared, B: Prepared) -> Array:
        """The largest inner products ``<A, R B>`` (n, m) over the rotations allowed."""
        if self.max_angle == 0 or self.n_dims == 1:
            return np.asarray(A.rows @ B.rows.T)
        if self.n_dims == 2:
            return _within(_products(A.rows, B.rows), self.max_angle)  # the angle's sign does not matter here
        return _aligned_in_space(A.rows, B.rows, self.max_angle)

    def rotations(self, A: Array, B: Array) -> Array:
        """Rotation matrices (m, d, d) that bring each row of B closest to the same row of A, or to A's only row."""
        d = self.n_dims
        if self.max_angle == 0 or d not in (2, 3):
            return np.broadcast_to(np.eye(d), (len(B), d, d)).copy()
        if d == 2:
            product = np.einsum("ij,ij->i", *np.broadcast_arrays(as_complex(A), as_complex(B).conj()))
            angle = np.clip(np.angle(product), -self.max_angle, self.max_angle)
            c, s = np.cos(angle), np.sin(angle)
            return np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2)
        C = A.reshape(len(A), d, -1) @ B.reshape(len(B), d, -1).transpose(0, 2, 1)
        return _turned_back(_best_rotations(C), self.max_angle)


_MANY = 16  # rows from which on the complex product pays


def as_complex(rows: NDArray[Any]) -> NDArray[Any]:
    """Rows x_1 ... x_S, y_1 ... y_S as complex rows x + i y."""
    half = rows.shape[1] // 2
    return rows[:, :half] + 1j * rows[:, half:]


def _products(A: NDArray[Any], B: NDArray[Any]) -> NDArray[Any]:
    """``conj(A) @ B.T``; for few rows as a real product, many times faster than a complex one."""
    if len(A) >= _MANY:
        return np.asarray(A.conj() @ B.T)
    real = B.real.dtype
    twice = np.concatenate((A, 1j * A)).astype(A.dtype)
    a, b = np.ascontiguousarray(twice).view(real), np.ascontiguousarray(B).view(real)
    parts = _few_products(a, b)
    return np.asarray(parts[: len(A)] + 1j * parts[len(A) :])


def _few_products(few: NDArray[Any], many: NDArray[Any]) -> NDArray[Any]:
    """``few @ many.T``, which would copy all of `many` first, by reading it once.

    In one thread: two that wait for each other take twenty times as long where something else runs on the machine.
    """
    if use_compiled(few.shape[0] * many.size):
        products = np.empty((len(few), len(many)), few.dtype)
        compiled_module("kineme.kernels._compiled").fill_products(few, many, products)
        return products
    with single_threaded_blas():
        return np.stack([many @ row for row in few])


def _within(product: NDArray[np.complex128], max_angle: float) -> Array:
    size = np.abs(product)
    if max_angle >= math.pi:
        return size
    # Re(product exp(-i angle)) is largest at the angle of the product, or at the end of the range next to it.
    c, s = math.cos(max_angle), math.sin(max_angle)
    at_end = c * product.real + s * np.abs(product.imag)
    return np.where(product.real >= c * size, size, at_end)


def _covariances(A: Array, B: Array) -> Array:
    """``C_ij = A_i B_j^T`` (n, m, 3, 3)."""
    n, m = len(A), len(B)
    a, b = A.reshape(n * 3, -1), B.reshape(m * 3, -1)
    return np.ascontiguousarray((a @ b.T).reshape(n, 3, m, 3).transpose(0, 2, 1, 3))


def _best_rotations(C: Array) -> Array:
    """Rotations R maximizing ``tr(R^T C)``, that is <A, R B>."""
    U, _, Vt = np.linalg.svd(C)
    proper = np.sign(np.linalg.det(U @ Vt))
    proper[proper == 0] = 1.0
    U[..., -1] *= proper[..., None]
    return np.asarray(U @ Vt)


def _turned_back(R: Array, max_angle: float) -> Array:
    """Rotations by at most `max_angle`, about the same axes."""
    if max_angle >= math.pi:
        return R
    from scipy.spatial.transform import Rotation

    vectors = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec()
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    factors = np.where(angles > max_angle, max_angle / np.where(angles > 0, angles, 1.0), 1.0)
    return np.asarray(Rotation.from_rotvec(vectors * factors).as_matrix()).reshape(R.shape)


_PAIRS = 100_000  # covariance matrices at a time


def _aligned_in_space(A: Array, B: Array, max_angle: float) -> Array:
    result = np.empty((len(A), len(B)))
    step = max(1, _PAIRS // len(B))
    for start in range(0, len(A), step):
        C = _covariances(A[start : start + step], B)
        R = _turned_back(_best_rotations(C), max_angle)
        result[start : start + step] = np.einsum("ijkl,ijkl->ij", R, C)
    return result

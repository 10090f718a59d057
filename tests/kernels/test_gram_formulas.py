"""Kernels against the paper's equations, numbers worked out by hand, and other libraries."""

import numpy as np
import pytest
from kernel_samples import absolute, capped, rows, square
from sklearn.metrics.pairwise import laplacian_kernel, rbf_kernel

from kineme.kernels import PAPER_WIDTHS, RBF, Canberra, DistanceKernel, Laplacian, TruncatedEuclidean

X = np.array([[0.0, 0.0, 0.0, 0.0]])
Y = np.array([[1.0, -2.0, 0.5, 4.0]])


@pytest.mark.parametrize(
    ("kernel", "expected"),
    [
        # Eq. (6): |x - y|² = 1 + 4 + 0.25 + 16 = 21.25; exp(-21.25 / (2 * 9)) and exp(-21.25 / (2 * 25))
        (RBF(3.0), 0.3071080756015755),
        (RBF(5.0), 0.6537697851298473),
        # Eq. (7), (8) with m = 2: min(2, |x - y|) = 1, 2, 0.5, 2
        (TruncatedEuclidean(2.0, 1.0), (1 + 0 + 1.5 + 0) / 4),
        (TruncatedEuclidean(2.0, 4.0), (1.75 + 1.5 + 1.875 + 1.5) / 4),
        (TruncatedEuclidean(2.0, 0.5), (0 + 0 + 1 + 0) / 4),
        (TruncatedEuclidean(3.0, 1.0), (2 + 1 + 2.5 + 0) / 4),
        # exp(-7.5 / 2.5)
        (Laplacian(2.5), 0.049787068367863944),
        # nothing in common with zero
        (Canberra(), 0.0),
    ],
    ids=repr,
)
def test_values_worked_out_by_hand(kernel, expected):
    assert kernel(X, Y)[0, 0] == pytest.approx(expected, rel=1e-14)


def test_canberra_by_hand():
    x = np.array([[0.0, 1.0, -1.0, 2.0, 0.0]])
    y = np.array([[0.0, 3.0, -3.0, -2.0, 5.0]])
    assert Canberra()(x, y)[0, 0] == pytest.approx((1 + 0.5 + 0.5 + 0 + 0) / 5, rel=1e-15)
    np.testing.assert_array_equal(Canberra()(x), [[1.0]])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("m", "sigma"), [(0.5, 1.0), (1.3, 0.4), (0.9, 7.0)])
def test_truncated_is_its_definition(seed, m, sigma):
    A, B = rows("normal", seed, 31, 9), rows("normal", seed + 100, 12, 9)
    truncated = np.minimum(m, np.abs(A[:, None, :] - B[None, :, :]))
    expected = np.maximum(0, m - truncated / sigma).mean(axis=2)
    np.testing.assert_allclose(TruncatedEuclidean(m, sigma)(A, B), expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_rbf_and_laplacian_are_those_of_scikit_learn(dtype, offset):
    A, B = rows("normal", 1, 40, 20) + offset, rows("normal", 2, 30, 20) + offset
    a, b = A.astype(dtype), B.astype(dtype)
    tolerance = 1e-12 if dtype is np.float64 else 1e-4
    np.testing.assert_allclose(RBF(4.0)(a, b), rbf_kernel(A, B, gamma=1 / 32), rtol=tolerance * 10)
    np.testing.assert_allclose(Laplacian(8.0)(a, b), laplacian_kernel(A, B, gamma=1 / 8), rtol=tolerance)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("compiled", ["always", "never"])
@pytest.mark.parametrize(
    ("built_in", "g", "h"),
    [
        (RBF(1.7), square, lambda sums: np.exp(-sums / (2 * 1.7**2))),
        (TruncatedEuclidean(0.8), capped, lambda sums: 0.8 - sums / 10),
    ],
    ids=["rbf", "truncated"],
)
def test_distance_kernel_reproduces_the_others(compiled, built_in, g, h, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    A, B = rows("normal", 3, 20, 10), rows("normal", 4, 9, 10)
    kernel = DistanceKernel(absolute, g, h)
    np.testing.assert_allclose(kernel(A, B), built_in(A, B), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(kernel(A), built_in(A), rtol=1e-12, atol=1e-14)


def test_distance_kernel_takes_compiled_functions(monkeypatch):
    from numba import njit

    monkeypatch.setenv("KINEME_COMPILED", "always")
    A = rows("normal", 5)
    kernel = DistanceKernel(njit(absolute), njit(lambda z: z / 3.0), lambda sums: np.exp(-sums))
    np.testing.assert_allclose(kernel(A), Laplacian(3.0)(A), rtol=1e-12)


def test_distance_kernel_keeps_an_asymmetric_distance():
    kernel = DistanceKernel(lambda x, y: max(0.0, x - y), lambda z: z, lambda sums: -sums)
    np.testing.assert_array_equal(kernel([[0.0], [2.0]]), [[0.0, 0.0], [-2.0, 0.0]])


@pytest.mark.parametrize(("dtype", "spread", "tolerance"), [(np.float64, 1e6, 1e-9), (np.float32, 1e3, 1e-3)])
def test_rbf_of_close_rows_far_from_all_others(dtype, spread, tolerance):
    """Norms are `spread` times the distances of interest: a matrix product alone would lose these."""
    places = np.round(rows("normal", 0, 10, 8) * spread)
    A = np.concatenate([places, places + np.round(rows("normal", 1, 10, 8) * 64) / 128]).astype(dtype)
    expected = np.exp(-(np.square(A[:10].astype(np.float64) - A[10:]).sum(axis=1)) / 2)
    for gram in (RBF(1.0)(A), RBF(1.0)(A, A.copy())):
        np.testing.assert_allclose(np.diag(gram[:10, 10:]), expected, rtol=tolerance)
        np.testing.assert_array_equal(np.diag(gram), 1)


def test_table_3_of_the_paper():
    assert {
        ("weights", "original"): (RBF(500), TruncatedEuclidean(750, 1)),
        ("weights", "bio-inspired"): (RBF(35_000_000), TruncatedEuclidean(10_000_000, 1)),
        ("forcing", "original"): (RBF(60_000), TruncatedEuclidean(10_000, 1)),
        ("forcing", "bio-inspired"): (RBF(7000), TruncatedEuclidean(350, 1)),
    } == PAPER_WIDTHS

"""Widths chosen from the data."""

import dataclasses

import numpy as np
import pytest
from kernel_samples import rows
from scipy.spatial.distance import pdist

from kineme.kernels import KERNELS, RBF, Laplacian, TruncatedEuclidean


@pytest.mark.parametrize("seed", range(5))
def test_medians(seed):
    X = rows("normal", seed, 40, 8)
    assert RBF().fit(X).sigma == pytest.approx(np.median(pdist(X)), rel=1e-12)
    assert Laplacian().fit(X).sigma == pytest.approx(np.median(pdist(X, "cityblock")), rel=1e-12)
    differences = [np.abs(x - y) for i, x in enumerate(X) for y in X[:i]]
    assert TruncatedEuclidean().fit(X).m == pytest.approx(np.median(differences), rel=1e-12)


def test_copies_of_rows_do_not_count():
    X = np.repeat([[0.0, 0.0], [3.0, 4.0]], 10, axis=0)
    assert RBF().fit(X).sigma == 5
    assert Laplacian().fit(X).sigma == 7
    assert TruncatedEuclidean().fit(X).m == 3.5


def test_fit_keeps_what_is_given_and_changes_nothing():
    X = rows("normal", 0)
    kernel = TruncatedEuclidean(sigma=2.0)
    assert kernel.fit(X).sigma == 2.0
    assert kernel == TruncatedEuclidean(None, 2.0)
    assert RBF(3.0).fit(X) == RBF(3.0)


@pytest.mark.parametrize("name", KERNELS)
def test_a_call_uses_the_widths_of_the_second_argument(name):
    kernel, A, B = KERNELS[name].kernel(), rows("normal", 0), rows("normal", 1) * 5
    assert np.array_equal(kernel(A, B), kernel.fit(B)(A, B))
    assert np.array_equal(kernel(A), kernel.fit(A)(A))


def test_large_sets_are_represented_by_evenly_spaced_rows():
    X = rows("normal", 0, 3000, 50)
    for kernel in (RBF(), Laplacian(), TruncatedEuclidean()):
        fitted, part = kernel.fit(X), kernel.fit(X[::4])
        assert fitted == kernel.fit(X)
        for a, b in zip(dataclasses.astuple(fitted), dataclasses.astuple(part), strict=True):
            assert a == pytest.approx(b, rel=0.02)


@pytest.mark.parametrize("name", [name for name, row in KERNELS.items() if row.widths])
def test_the_unit_of_the_features_does_not_matter(name):
    A = rows("normal", 0)
    kernel = KERNELS[name].kernel()
    a, b = kernel(A), kernel(A * 1024)
    np.testing.assert_allclose(a / a.max(), b / b.max(), rtol=1e-10)


def test_float32_rows_get_widths_of_float64():
    X = rows("normal", 0, dtype=np.float32)
    assert RBF().fit(X) == RBF().fit(X.astype(np.float64))

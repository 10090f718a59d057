"""A-averages of per-dimension similarities."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_samples import CAUCHY, KINDS, NAMED, rows
from scipy import stats

from kineme.errors import SpecificationError
from kineme.kernels import KERNELS, MEANS, RBF, DistanceKernel, Laplacian, TruncatedEuclidean, averaged
from kineme.kernels import table as average
from soaking import combined

SCIPY = {
    "arithmetic": lambda k: np.mean(k, axis=0),
    "geometric": lambda k: stats.gmean(k, axis=0),
    "harmonic": lambda k: stats.hmean(k, axis=0),
    "quadratic": lambda k: stats.pmean(k, 2, axis=0),
    "min": lambda k: np.min(k, axis=0),
}


@pytest.mark.parametrize(
    ("kernel", "n_dims", "mean"),
    combined([RBF(2.0), TruncatedEuclidean(1.5), Laplacian(3.0), CAUCHY], [1, 2, 3], MEANS),
)
def test_means_are_those_of_scipy(mean, n_dims, kernel):
    A, B = rows("normal", 1, 14, 6), rows("normal", 2, 8, 6)
    blocks = [slice(j * 6 // n_dims, (j + 1) * 6 // n_dims) for j in range(n_dims)]
    expected = SCIPY[mean]([kernel(A[:, block], B[:, block]) for block in blocks])
    np.testing.assert_allclose(averaged(kernel, n_dims, mean)(A, B), expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", KERNELS)
@given(kind=st.sampled_from(KINDS), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_order_of_the_means(name, kind, seed):
    A = rows(kind, seed)
    kernel = averaged(NAMED[name], 2).fit(A)
    grams = [
        averaged(kernel.kernel, 2, mean)(A) for mean in ("quadratic", "arithmetic", "geometric", "harmonic", "min")
    ]
    for larger, smaller in pairwise(grams):
        assert np.all(larger >= smaller - 1e-12 * larger.max())


@pytest.mark.parametrize("mean", ["geometric", "harmonic", "min"])
def test_no_similarity_in_one_dimension_is_none_at_all(mean):
    kernel = averaged(TruncatedEuclidean(m=1.0), 2, mean)
    assert kernel([[0.0, 0.0]], [[0.5, 9.0]])[0, 0] == 0


def test_columns_are_dimension_major():
    x, y = np.zeros((1, 4)), np.array([[0.0, 0.0, 9.0, 9.0]])
    assert averaged(TruncatedEuclidean(m=1.0), 2, "min")(x, y)[0, 0] == 0
    assert averaged(TruncatedEuclidean(m=1.0), 2, "arithmetic")(x, y)[0, 0] == 0.5


def test_one_kernel_per_dimension():
    A = rows("normal", 0)
    kernel = averaged((RBF(1.0), Laplacian(2.0)), 2)
    np.testing.assert_allclose(kernel(A), (RBF(1.0)(A[:, :3]) + Laplacian(2.0)(A[:, 3:])) / 2)


def test_widths_are_chosen_per_dimension():
    A = rows("normal", 0)
    A[:, 3:] *= 1000
    x, y = averaged(RBF(), 2).fit(A).kernel
    assert x == RBF().fit(A[:, :3])
    assert y == RBF().fit(A[:, 3:])
    assert y.sigma > 100 * x.sigma


def test_averages_of_averages():
    A = rows("normal", 0, p=8)
    nested = averaged(averaged(RBF(1.0), 2), 2)
    np.testing.assert_allclose(nested(A), averaged(RBF(1.0), 4)(A))


@pytest.mark.parametrize("kernel", [RBF(2.0), TruncatedEuclidean(1.0)], ids=repr)
def test_bands_do_not_show(kernel, monkeypatch):
    A, B = rows("normal", 0, 50), rows("normal", 1, 31)
    kernel = averaged(kernel, 2, "geometric")
    whole, symmetric = kernel(A, B), kernel(A)
    monkeypatch.setattr(average, "_SCRATCH", 2 * 50 * 8 * 7)  # seven rows at a time
    np.testing.assert_allclose(kernel(A, B), whole, rtol=1e-12)
    np.testing.assert_allclose(kernel(A), symmetric, rtol=1e-12)
    assert np.array_equal(kernel(A), kernel(A).T)


def test_negative_similarities_have_no_geometric_mean():
    kernel = averaged(DistanceKernel(lambda x, y: abs(x - y), lambda z: z, lambda s: 1 - s), 2, "geometric")
    with pytest.raises(SpecificationError, match=r"similarities >= 0 for the geometric mean, got -2 .* in dimension 1"):
        kernel([[0.0, 0.0]], [[0.5, 3.0]])

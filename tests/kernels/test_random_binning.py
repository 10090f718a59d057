"""Random binning is an unbiased feature map of the truncated kernel."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.svm import SVC, LinearSVC

import kineme
from kineme.kernels import TruncatedEuclidean
from kineme.kernels.random_binning import RandomBinning


def rows(seed=0, n=20, p=30):
    return np.random.default_rng(seed).normal(scale=2.0, size=(n, p))


def gram(X, **parameters):
    Z = RandomBinning(**parameters).fit_transform(X)
    return (Z @ Z.T).toarray()


@pytest.mark.parametrize("sigma", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("m", [0.7, 3.0])
def test_the_expected_gram_matrix_is_the_truncated_kernel(m, sigma):
    X = rows()
    mean = np.mean([gram(X, m=m, sigma=sigma, n_shifts=20, seed=seed) for seed in range(40)], axis=0)
    np.testing.assert_allclose(mean, TruncatedEuclidean(m, sigma)(X), atol=0.02 * m)


def test_the_error_falls_as_one_over_the_root_of_the_number_of_shifts():
    X, counts = rows(), np.array([4, 16, 64, 256])
    exact = TruncatedEuclidean(2.0)(X)
    errors = [
        np.sqrt(np.mean([(gram(X, m=2.0, n_shifts=P, seed=seed) - exact) ** 2 for seed in range(12)])) for P in counts
    ]
    order = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == pytest.approx(-0.5, abs=0.1)


def test_rows_not_seen_in_fit_are_compared_with_those_that_were():
    X, new = rows(0), rows(1)
    new[0] += 100.0  # beyond every bin
    binning = RandomBinning(m=2.0, n_shifts=2000).fit(X)
    similarity = (binning.transform(new) @ binning.transform(X).T).toarray()
    np.testing.assert_allclose(similarity, TruncatedEuclidean(2.0)(new, X), atol=0.05)
    assert (similarity[0] == 0).all()


def test_the_diagonal_is_exact():
    np.testing.assert_allclose(np.diag(gram(rows(), m=2.0)), 2.0, rtol=1e-12)


def test_the_same_seed_gives_the_same_features():
    assert (RandomBinning(seed=3).fit_transform(rows()) != RandomBinning(seed=3).fit_transform(rows())).nnz == 0
    assert (RandomBinning(m=1.0, seed=3).fit(rows()).shifts_ != RandomBinning(m=1.0, seed=4).fit(rows()).shifts_).any()


def test_width_by_default_is_that_of_the_kernel():
    assert RandomBinning().fit(rows()).m_ == TruncatedEuclidean().fit(rows()).m


def test_a_linear_svm_on_it_is_as_good_as_the_kernel_svm():
    demos = kineme.load_lasa(kineme.datasets.PAPER_LETTERS)
    X, y = kineme.DMPFeatures().fit_transform(demos), demos.labels
    train = np.arange(len(y)) % 7 < 4
    linear = make_pipeline(RandomBinning(n_shifts=4), LinearSVC()).fit(X[train], y[train])
    kernel = SVC(kernel=TruncatedEuclidean()).fit(X[train], y[train])
    assert linear.score(X[~train], y[~train]) >= kernel.score(X[~train], y[~train]) == 1.0


def test_it_is_a_scikit_learn_transformer():
    binning = clone(RandomBinning(m=1.5, n_shifts=2)).fit(rows())
    assert len(binning.get_feature_names_out()) == binning.transform(rows()).shape[1] == binning.n_columns_


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: RandomBinning(m=-1.0).fit(rows()), "m"),
        (lambda: RandomBinning(sigma=0.0).fit(rows()), "sigma to be a number above 0, got 0.0"),
        (lambda: RandomBinning(n_shifts=0).fit(rows()), "n_shifts to be a whole number of at least 1, got 0"),
        (lambda: RandomBinning(m=1e-9).fit(rows()), "is tiny against the"),
        (lambda: RandomBinning().fit(rows()).transform(rows(p=7)), "expected 30 columns as in fit, got 7"),
        (lambda: RandomBinning().fit(np.full((3, 3), np.nan)), "finite rows"),
        (lambda: RandomBinning().fit(np.zeros(3)), r"got shape \(3,\); use kineme.DMPFeatures"),
    ],
)
def test_what_cannot_be_used_is_refused(call, words):
    with pytest.raises(kineme.errors.SpecificationError, match=words):
        call()

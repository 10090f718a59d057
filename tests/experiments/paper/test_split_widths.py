"""Median widths come from the training rows of each split: the row that is tested has no part in them."""

import numpy as np
import pytest

from kineme.kernels import RBF, TruncatedEuclidean
from kineme_experiments.paper import experiments
from kineme_experiments.paper.experiments import fit_by_split


@pytest.fixture(params=["continuous", "with ties and equal rows"])
def rows(request):
    rng = np.random.default_rng(3)
    X = rng.normal(size=(9, 4)) * [1.0, 10.0, 0.1, 3.0]
    return X if request.param == "continuous" else np.vstack([X, X[:2]]).round(0)


@pytest.mark.parametrize("kernel", [RBF(), TruncatedEuclidean()])
def test_each_split_has_the_widths_of_its_training_rows(rows, kernel):
    fitted = fit_by_split(kernel, rows)
    assert len(fitted) == len(rows)
    for i, one in enumerate(fitted):
        alone = kernel.fit(np.delete(rows, i, axis=0))
        assert type(one) is type(alone)
        np.testing.assert_allclose(_width(one), _width(alone), rtol=1e-12)


@pytest.mark.parametrize("kernel", [RBF(), TruncatedEuclidean()])
def test_the_row_that_is_left_out_does_not_change_the_widths_of_its_split(rows, kernel):
    far = rows.copy()
    far[4] += 1e6
    widths, with_outlier = ([_width(one) for one in fit_by_split(kernel, X)] for X in (rows, far))
    assert widths[4] == with_outlier[4]
    assert all(widths[i] != with_outlier[i] for i in (0, 8))


def test_an_svm_with_median_widths_never_sees_the_row_that_it_is_tested_on():
    """The Gram matrix of a split is that of a kernel fitted to its training rows."""
    rng = np.random.default_rng(0)
    y = np.repeat(np.arange(3), 3)
    X = rng.normal(size=(9, 4)) + 3.0 * y[:, None]
    seen = []

    def svm_accuracy(gram, labels, *penalty):
        seen.append(np.array(gram))
        return 0.0

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiments, "svm_accuracy", svm_accuracy)
        experiments.run_svm(dict.fromkeys(experiments.REPRESENTATIONS, X), y, diagnosis=False)
    for kernel, grams in ((RBF(), seen[0]), (TruncatedEuclidean(), seen[1])):
        assert grams.shape == (9, 9, 9)
        for i in range(9):
            np.testing.assert_allclose(grams[i], kernel.fit(np.delete(X, i, axis=0))(X), rtol=1e-9)


def _width(kernel):
    return kernel.sigma if isinstance(kernel, RBF) else kernel.m

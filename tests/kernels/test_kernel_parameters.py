"""Parameters of kernels by name: what scikit-learn's clones and searches need, for every kernel of the table."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernel_samples import ALL, CAUCHY
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from kineme.errors import SpecificationError
from kineme.kernels import KERNELS, MEANS, PAPER_WIDTHS, RBF, Averaged, Laplacian, TruncatedEuclidean, averaged

widths = st.one_of(st.floats(1e-3, 1e3), st.integers(1, 9))


@st.composite
def plain_kernels(draw):
    """A kernel of the table and the widths it was made with."""
    row = KERNELS[draw(st.sampled_from(sorted(KERNELS)))]
    values = {name: draw(widths) for name in row.widths}
    return row.kernel(**values), values


@given(plain_kernels(), plain_kernels())
def test_what_is_set_is_what_the_constructor_takes(one, other):
    (kernel, values), (_, others) = one, other
    assert kernel.get_params() == values
    assert kernel.set_params(**{name: others[name] for name in others if name in values}) is kernel
    assert kernel == type(kernel)(**(values | {name: others[name] for name in others if name in values}))


@given(plain_kernels(), st.sampled_from(sorted(MEANS)), st.integers(1, 4))
def test_kernels_inside_are_reached_by_their_names(drawn, mean, n_dims):
    kernel, values = drawn
    for inside, prefix in ((kernel, "kernel__"), ((kernel,) * n_dims, f"kernel__{n_dims - 1}__")):
        average = averaged(inside, n_dims, mean)
        assert {average.get_params()[prefix + name] for name in values} == set(values.values())
        average.set_params(**{prefix + name: 2 * value for name, value in values.items()})
        doubled = type(kernel)(**{name: 2 * value for name, value in values.items()})
        assert average._kernels()[-1] == doubled
        assert average._kernels()[:-1] == ((doubled if inside is kernel else kernel),) * (n_dims - 1)
    assert kernel.get_params() == values  # others may share it


@pytest.mark.parametrize("kernel", ALL.values(), ids=ALL)
def test_a_clone_is_equal_and_its_own(kernel):
    copy = clone(kernel)
    assert copy == kernel
    assert hash(copy) == hash(kernel)
    assert copy is not kernel
    assert repr(copy) == repr(kernel)


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_pickles_are_equal_and_may_be_set(name):
    kernel = averaged((KERNELS[name].kernel(),), 1)
    hash(kernel)
    copy = pickle.loads(pickle.dumps(kernel))
    assert copy == kernel
    assert copy.set_params(mean="min").mean == "min"


def test_changing_an_estimators_clone_leaves_the_kernel_that_was_given():
    kernel = averaged((RBF(1.0), RBF(2.0)), 2)
    model = clone(SVC(kernel=kernel)).set_params(kernel__kernel__0__sigma=5.0, kernel__mean="min")
    assert model.kernel == Averaged((RBF(5.0), RBF(2.0)), 2, "min")
    assert kernel == Averaged((RBF(1.0), RBF(2.0)), 2)
    assert model.set_params(kernel__kernel=RBF(), kernel__kernel__sigma=3.0).kernel.kernel == RBF(3.0)


def test_a_hashed_kernel_never_changes():
    kernel = RBF(1.0)
    scores = {kernel: 0.9}
    with pytest.raises(SpecificationError, match=r"never hashed, got RBF\(sigma=1.0\).*sklearn.base.clone"):
        kernel.set_params(sigma=2.0)
    assert scores[RBF(1.0)] == 0.9
    assert clone(kernel).set_params(sigma=2.0) == RBF(2.0)


@pytest.mark.parametrize("kernels", PAPER_WIDTHS.values())
def test_the_widths_of_the_paper_never_change(kernels):
    for kernel in kernels:
        with pytest.raises(SpecificationError, match="or a constant"):
            SVC(kernel=kernel).set_params(kernel__sigma=3.0)


@pytest.mark.parametrize(
    ("kernel", "wrong", "message"),
    [
        (RBF(1.0), {"gamma": 1.0}, r"parameters of RBF, \['sigma'\], got 'gamma'"),
        (RBF(1.0), {"sigma": -1.0}, "expected a finite sigma > 0, got -1.0"),
        (RBF(1.0), {"sigma__m": 1.0}, "expected a kernel with the parameter 'm', got 1.0"),
        (TruncatedEuclidean(1.0), {"sigma": 2.0, "m": "wide"}, "expected a finite m > 0, got 'wide'"),
        (averaged(RBF(1.0), 2), {"kernel__m": 1.0}, r"parameters of RBF, \['sigma'\], got 'm'"),
        (averaged((RBF(1.0),), 1), {"kernel__1__sigma": 1.0}, "with the parameter '1__sigma', got"),
        (averaged(RBF(1.0), 2), {"mean": "median"}, "expected mean to be one of"),
        (CAUCHY, {"d": 3}, "expected a function d, got 3"),
    ],
)
def test_what_cannot_be_set_is_refused_and_changes_nothing(kernel, wrong, message):
    kernel, before = clone(kernel), kernel
    with pytest.raises(SpecificationError, match=message):
        kernel.set_params(**wrong)
    assert kernel == before


@pytest.fixture(scope="module")
def two_classes():
    rng = np.random.default_rng(0)
    y = np.repeat([0, 1], 20)
    return rng.normal(size=(40, 6)) + 3 * y[:, None] + 1, y


@pytest.mark.parametrize("n_jobs", [1, 2])
@pytest.mark.parametrize("name", [name for name, row in KERNELS.items() if row.widths])
def test_a_grid_search_over_widths(two_classes, name, n_jobs):
    kernel, width, tried = KERNELS[name].kernel, KERNELS[name].widths[0], [1e-9, 0.7, 4.0]
    given = kernel()
    search = GridSearchCV(SVC(kernel=given), {f"kernel__{width}": tried}, cv=3, n_jobs=n_jobs).fit(*two_classes)
    scores = [cross_val_score(SVC(kernel=kernel(**{width: value})), *two_classes, cv=3).mean() for value in tried]
    assert search.cv_results_["mean_test_score"].tolist() == scores
    assert scores[0] < max(scores)
    assert search.best_estimator_.kernel == kernel(**{width: tried[int(np.argmax(scores))]})
    assert given == kernel()


def test_a_grid_search_over_kernels_and_widths_in_a_pipeline(two_classes):
    model = make_pipeline(StandardScaler(), SVC(kernel=averaged(RBF(), 3)))
    grid = {"svc__kernel__kernel": [RBF(), Laplacian()], "svc__kernel__kernel__sigma": [1e-9, 2.0, None]}
    search = GridSearchCV(model, grid, cv=3, error_score="raise").fit(*two_classes)
    assert len(search.cv_results_["params"]) == 6
    assert search.best_params_["svc__kernel__kernel__sigma"] in (2.0, None)
    assert cross_val_score(search.best_estimator_, *two_classes, cv=3, n_jobs=2).mean() > 0.9


def test_an_estimators_parameters_name_those_of_its_kernel():
    assert SVC(kernel=averaged(RBF(2.0), 3)).get_params()["kernel__kernel__sigma"] == 2.0
    assert "RBF(sigma=2.0)" in repr(SVC(kernel=RBF(2.0)))
    assert "RBF" in SVC(kernel=RBF(2.0))._repr_html_()

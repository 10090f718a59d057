"""Each message says what was expected, what came and what to do."""

import numpy as np
import pytest

from kineme.errors import KinemeError, SpecificationError
from kineme.kernels import RBF, Canberra, DistanceKernel, Laplacian, TruncatedEuclidean, averaged

NAN_ROW = np.ones((4, 3))
NAN_ROW[2, 1] = np.nan
INF_ROW = np.ones((4, 3))
INF_ROW[3, 0] = -np.inf


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: RBF(0.0), r"finite sigma > 0, got 0\.0; leave it out"),
        (lambda: RBF(-2.5), r"finite sigma > 0, got -2\.5"),
        (lambda: RBF(np.nan), "finite sigma > 0, got nan"),
        (lambda: RBF("wide"), "finite sigma > 0, got 'wide'"),
        (lambda: Laplacian(np.inf), "finite sigma > 0, got inf"),
        (lambda: TruncatedEuclidean(m=-1), "finite m > 0, got -1"),
        (lambda: TruncatedEuclidean(m=1.0, sigma=0), "finite sigma > 0, got 0"),
        (lambda: TruncatedEuclidean(m=1.0, sigma=None), "finite sigma > 0, got None; the default is 1.0"),
        (lambda: averaged(RBF(), 0), "n_dims to be a whole number from 1, got 0"),
        (lambda: averaged(RBF(), 2.0), r"n_dims to be a whole number from 1, got 2\.0"),
        (lambda: averaged(RBF(), 2, "median"), r"one of \('arithmetic', 'geometric', .*'min'\), got 'median'"),
        (lambda: averaged(RBF, 2), r"expected a kernel, such as RBF\(\), got <class .*RBF'>; pass an instance"),
        (lambda: averaged((RBF(), RBF()), 3), "one for each of n_dims=3 dimensions, got 2"),
        (lambda: DistanceKernel(1.0, abs, np.exp), r"expected a function d, got 1\.0"),
    ],
)
def test_specifications(build, message):
    with pytest.raises(SpecificationError, match=message):
        build()


@pytest.mark.parametrize("kernel", [RBF(1.0), TruncatedEuclidean(), Canberra(), averaged(RBF(), 3)], ids=repr)
@pytest.mark.parametrize(
    ("A", "B", "message"),
    [
        (NAN_ROW, None, r"finite numbers, got nan in row 2, column 1 of A \(1 such rows\); repair"),
        (np.ones((2, 3)), INF_ROW, "finite numbers, got -inf in row 3, column 0 of B"),
        (np.ones((2, 3)), np.ones((2, 6)), "same number of columns, got 3 and 6"),
        (np.ones(3), None, r"A to be two-dimensional .*, got shape \(3,\); pass a single row x as x\[np\.newaxis\]"),
        (np.ones((2, 3)), np.ones((2, 3, 1)), r"B to be two-dimensional .*, got shape \(2, 3, 1\)"),
        (np.ones((2, 0)), None, r"at least one column, got shape \(2, 0\)"),
        ([["a", "b", "c"]], None, "A to hold real numbers, got dtype <U1"),
        (np.ones((2, 3)) * 1j, None, "A to hold real numbers, got dtype complex128"),
        (np.full((1, 3), 1e200), None, r"values up to 1\.94e\+153 in float64, got 1e\+200 in row 0, column 0 of A"),
        (
            np.full((1, 3), 1e30, np.float32),
            None,
            r"in float32, got .* in row 0, .* rescale the features or pass float64",
        ),
    ],
)
def test_rows(kernel, A, B, message):
    with pytest.raises(SpecificationError, match=message):
        kernel(A, B)


def test_columns_that_the_dimensions_do_not_divide():
    with pytest.raises(SpecificationError, match="n_dims=2 blocks of equal size, got 5 columns; n_dims is"):
        averaged(RBF(1.0), 2)(np.ones((3, 5)))


@pytest.mark.parametrize("kernel", [RBF(), Laplacian(), TruncatedEuclidean()], ids=repr)
@pytest.mark.parametrize("n", [1, 5])
def test_rows_that_do_not_determine_a_width(kernel, n):
    message = rf"training rows that differ, got {n} row\(s\), all equal, .*; pass the widths as numbers"
    with pytest.raises(SpecificationError, match=message):
        kernel(np.ones((3, 2)), np.full((n, 2), 7.0))
    with pytest.raises(SpecificationError, match=message):
        kernel.fit(np.full((n, 2), 7.0))


def test_a_dimension_without_movement_is_named():
    rows = np.random.default_rng(0).normal(size=(5, 6))
    rows[:, 4:] = 0
    with pytest.raises(
        SpecificationError, match=r"in dimension 2 \(columns 4 to 5\): expected training rows that differ"
    ):
        averaged(RBF(), 3)(rows)


def test_a_width_outside_the_range_of_float32():
    with pytest.raises(SpecificationError, match="sigma squared within the range of float32, got sigma = 1e-30"):
        RBF(1e-30)(np.ones((2, 2), np.float32))
    with pytest.raises(SpecificationError, match="m squared within the range of float32, got m = 1e"):
        averaged(TruncatedEuclidean(1e30), 2)(np.ones((2, 2), np.float32))


def test_h_that_does_not_keep_the_shape():
    kernel = DistanceKernel(lambda x, y: abs(x - y), abs, lambda sums: sums.sum())
    with pytest.raises(SpecificationError, match=r"h to map an array of shape \(2, 2\) to that shape, got \(\)"):
        kernel(np.ones((2, 3)))


def test_functions_that_numba_cannot_compile(monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "always")
    kernel = DistanceKernel(lambda x, y: NAN_ROW.tolist()[0], abs, np.exp)
    with pytest.raises(SpecificationError, match=r"d and g that Numba can compile.*KINEME_COMPILED=never"):
        kernel(np.ones((2, 3)))


def test_users_can_catch_them_as_value_errors():
    assert issubclass(SpecificationError, ValueError)
    assert issubclass(SpecificationError, KinemeError)

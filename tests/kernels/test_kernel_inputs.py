"""Arrays as they come, and specifications as scikit-learn and users handle them."""

import copy
import pickle

import numpy as np
import pytest
from kernel_samples import ALL, NAMED, rows

from kineme.kernels import RBF, Averaged, DistanceKernel, TruncatedEuclidean, averaged

every_kernel = pytest.mark.parametrize("kernel", ALL.values(), ids=ALL)


@pytest.mark.soak("combinations")
@every_kernel
@pytest.mark.parametrize("compiled", ["never", "always"])
def test_read_only_rows_are_accepted_and_writable_ones_left_alone(kernel, compiled, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    A, B = rows("normal", 0), rows("normal", 1)
    before = A.copy(), B.copy()
    expected = kernel(A, B)
    kernel(A)
    assert np.array_equal(A, before[0])
    assert np.array_equal(B, before[1])
    assert A.flags.writeable
    A.flags.writeable = B.flags.writeable = False
    assert np.array_equal(kernel(A, B), expected)
    assert expected.flags.writeable


@every_kernel
def test_memory_layout_does_not_matter(kernel):
    A = rows("normal", 0)
    expected = kernel(A)
    for same in (np.asfortranarray(A), np.repeat(A, 2, axis=1)[:, ::2], A[::-1].copy()[::-1], A.tolist()):
        assert np.array_equal(kernel(same), expected)


@every_kernel
def test_float32_stays_and_all_else_becomes_float64(kernel):
    A = rows("integers", 0)
    assert kernel(A.astype(np.float32)).dtype == np.float32
    np.testing.assert_allclose(kernel(A.astype(np.float32)), kernel(A), rtol=2e-3, atol=1e-5)
    for dtype in (np.int64, np.int8, np.float16, np.longdouble):
        assert np.array_equal(kernel(A.astype(dtype)), kernel(A))
    assert kernel(A.astype(np.float32), A).dtype == np.float64


@every_kernel
def test_the_same_object_twice_is_the_symmetric_case(kernel):
    A = rows("normal", 0)
    assert np.array_equal(kernel(A, A), kernel(A))


def test_no_rows_give_no_similarities():
    assert RBF(1.0)(np.empty((0, 3)), np.ones((2, 3))).shape == (0, 2)
    assert averaged(RBF(1.0), 3)(np.ones((2, 3)), np.empty((0, 3))).shape == (2, 0)


@pytest.mark.parametrize("kernel", [*NAMED.values(), averaged(RBF(), 2)], ids=repr)
def test_specifications_are_values(kernel):
    assert copy.deepcopy(kernel) == kernel == pickle.loads(pickle.dumps(kernel))
    assert hash(kernel) == hash(copy.copy(kernel))
    assert eval(repr(kernel), {**{type(k).__name__: type(k) for k in NAMED.values()}, "Averaged": Averaged}) == kernel


def test_repr():
    assert repr(RBF(np.float32(3))) == "RBF(sigma=3.0)"
    assert repr(TruncatedEuclidean()) == "TruncatedEuclidean(m=None, sigma=1.0)"
    assert repr(DistanceKernel(max, abs, np.exp)) == "DistanceKernel(d=max, g=abs, h=exp)"

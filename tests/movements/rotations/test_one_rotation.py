"""One rotation in floats is what arrays of them are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.movements.rotations import (
    exp,
    exp_one,
    log,
    log_one,
    matrix_one,
    nearest,
    product,
    product_components,
)
from rotation_samples import as_rotation, random_quaternions, seeds

SIZES = [0.0, 1e-160, 1e-9, 2e-7, 0.3, 3.1, np.pi, 4.0, 2 * np.pi, 100.0]


@pytest.mark.parametrize("size", SIZES)
@given(seeds)
def test_exp_is_that_of_the_batch(size, seed):
    p = np.random.default_rng(seed).normal(size=3)
    p *= size / np.linalg.norm(p)
    np.testing.assert_allclose(exp_one(p.tolist()), exp(p), rtol=1e-14, atol=1e-14)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("reach", [0.0, 0.5, 3.0, 5.0, 9.0])
@given(seeds, st.booleans())
def test_log_is_that_of_the_batch_nearest_to_the_vector_before(size, reach, seed, negative):
    p, near = np.random.default_rng(seed).normal(size=(2, 3))
    q = exp(p * size / np.linalg.norm(p)) * (-1.003 if negative else 1.002)
    near *= reach / np.linalg.norm(near)
    expected = nearest(log(q / np.linalg.norm(q)), near)
    found = log_one(q.tolist(), near.tolist())
    # Halfway between two turns either is as near.
    if np.linalg.norm(found - expected) > 1e-6:
        assert np.linalg.norm(found - near) == pytest.approx(np.linalg.norm(expected - near), abs=1e-6)
    np.testing.assert_allclose(np.abs(exp(found) @ q), np.linalg.norm(q), rtol=1e-12)


@pytest.mark.parametrize("q", [[0.0, 0, 0, 0], [1.02, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 0]])
def test_what_is_no_unit_quaternion_has_no_logarithm(q):
    assert log_one(q, [0.0, 0.0, 0.0]) is None


@given(seeds)
def test_products_and_matrices_are_those_of_others(seed):
    a, b = random_quaternions(seed, 2)
    np.testing.assert_array_equal(product_components(a.tolist(), b.tolist()), product(a, b))
    np.testing.assert_allclose(matrix_one(a.tolist()), as_rotation(a).as_matrix(), atol=1e-15)

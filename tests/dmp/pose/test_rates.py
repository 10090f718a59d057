"""Angular velocity and acceleration against differences of the quaternions themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.orientation import angular_acceleration, angular_velocity, conjugate, exp, product, rotation_vector_rate
from rotation_samples import random_quaternions, seeds


def polynomial(seed, size):
    """A smooth rotation vector p(t) and its two derivatives, with p(0) of length `size`."""
    c = np.random.default_rng(seed).normal(size=(4, 3))
    c[0] *= size / np.linalg.norm(c[0])

    def at(t, order=0):
        return sum(np.prod(range(k - order + 1, k + 1)) * c[k] * t ** (k - order) for k in range(order, 4))

    return at


def worst_order(error, h=0.04):
    errors = [error(h), error(h / 2), error(h / 4)]
    return min(np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2]))


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.99, 1.01, 3.1, 4.0])
@given(seeds)
def test_angular_velocity_is_the_limit_of_quaternion_differences(size, seed):
    p, r = polynomial(seed, size), random_quaternions(seed)
    omega = angular_velocity(p(0.0), p(0.0, 1))

    def error(h):
        q_rate = (product(exp(p(h)), r) - product(exp(p(-h)), r)) / (2 * h)
        return np.linalg.norm(2 * product(q_rate, conjugate(product(exp(p(0.0)), r)))[1:] - omega)

    assert error(1e-4) < 1e-5 * (1 + np.linalg.norm(p(0.0, 1)) ** 3)
    assert worst_order(error) > 1.8


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.99, 1.01, 3.1, 4.0])
@given(seeds)
def test_angular_acceleration_is_the_derivative_of_angular_velocity(size, seed):
    p = polynomial(seed, size)
    exact = angular_acceleration(p(0.0), p(0.0, 1), p(0.0, 2))

    def error(h):
        ahead, behind = (angular_velocity(p(t), p(t, 1)) for t in (h, -h))
        return np.linalg.norm((ahead - behind) / (2 * h) - exact)

    assert error(1e-4) < 1e-5 * (1 + np.linalg.norm(p(0.0, 1)) ** 3)
    assert worst_order(error) > 1.8


@given(st.floats(0, 1.5), seeds)
def test_series_and_closed_forms_agree_where_they_meet(scale, seed):
    rng = np.random.default_rng(seed)
    axis, rate, acceleration = rng.normal(size=(3, 3))
    axis /= np.linalg.norm(axis)
    for edge in (0.1, 1.0):
        below, above = edge * (1 - 1e-9) * axis, edge * (1 + 1e-9) * axis
        for f in (angular_velocity, rotation_vector_rate):
            np.testing.assert_allclose(f(below, rate), f(above, rate), atol=1e-8)
        ends = [angular_acceleration(p, rate * scale, acceleration) for p in (below, above)]
        np.testing.assert_allclose(*ends, atol=1e-7)


@given(st.floats(-12, np.log10(6.2)), seeds)
def test_rotation_vector_rate_is_the_inverse(exponent, seed):
    rng = np.random.default_rng(seed)
    p, omega = rng.normal(size=(2, 8, 3))
    p *= 10.0**exponent / np.linalg.norm(p, axis=1, keepdims=True)
    np.testing.assert_allclose(angular_velocity(p, rotation_vector_rate(p, omega)), omega, atol=1e-11)


def test_the_rate_of_the_rotation_vector_is_not_the_angular_velocity():
    """What Koutras and Doulgeri correct: the two agree only along p."""
    p = np.array([0.0, 0.0, 1.5])
    np.testing.assert_allclose(angular_velocity(p, 2 * p), 2 * p, atol=1e-15)
    assert np.linalg.norm(angular_velocity(p, [1.0, 0, 0]) - [1.0, 0, 0]) > 0.6


@pytest.mark.parametrize("size", [0.0, 1e-160, 1e-9, 0.09, 0.99, 1.01, 3.1, 4.0, 100.0])
@given(seeds)
def test_one_vector_is_as_in_a_batch(size, seed):
    p, p_rate, p_acceleration = np.random.default_rng(seed).normal(size=(3, 5, 3))
    p *= size / np.linalg.norm(p, axis=1, keepdims=True)
    for f, vectors in (
        (angular_velocity, (p, p_rate)),
        (rotation_vector_rate, (p, p_rate)),
        (angular_acceleration, (p, p_rate, p_acceleration)),
    ):
        alone = [f(*each) for each in zip(*vectors, strict=True)]
        np.testing.assert_allclose(alone, f(*vectors), rtol=1e-13, atol=1e-13)


def test_numbers_beyond_range_are_nan_and_raise_nothing():
    for f in (angular_velocity, rotation_vector_rate):
        assert np.isnan(f([np.inf, 0, 0], [1.0, 2.0, 3.0])).any()
    assert np.isnan(angular_acceleration([1e200, 0, 0], [1.0, 2, 3], [1.0, 2, 3])).any()

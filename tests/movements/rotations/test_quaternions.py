"""Quaternion algebra against SciPy's Rotation, and the log and exp near the angles where they are delicate."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from kineme import orientation
from kineme.errors import KinemeError, TrajectoryError
from kineme.movements.rotations import matrices_of, nearest, quaternion_of, rotated
from kineme.orientation import angle_between, conjugate, continuous, exp, log, normalized, product, slerp
from rotation_samples import as_rotation, random_quaternions, seeds

ANGLES = [0.0, 1e-300, 1e-160, 1e-12, 0.99e-7, 1.01e-7, 2.1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-6, np.pi - 1e-12]


def same_rotation(a, b):
    return float(angle_between(a, b).max()) < 1e-12


@given(seeds)
def test_products_compose_as_scipys(seed):
    a, b = random_quaternions(seed, 5, 3), random_quaternions(seed + 1, 3)
    expected = as_rotation(a.reshape(-1, 4)) * as_rotation(np.broadcast_to(b, a.shape).reshape(-1, 4))
    assert same_rotation(product(a, b).reshape(-1, 4), expected.as_quat(scalar_first=True))
    np.testing.assert_allclose(product(a, conjugate(a)), np.broadcast_to([1, 0, 0, 0], a.shape), atol=1e-15)


@given(seed=seeds)
def test_rotated_vectors_and_matrices_are_scipys(seed):
    q, x = random_quaternions(seed, 3, 5), np.random.default_rng(seed).normal(size=(5, 3))
    expected = as_rotation(q.reshape(-1, 4)).as_matrix().reshape(3, 5, 3, 3)
    np.testing.assert_allclose(matrices_of(q), expected, atol=1e-12)
    np.testing.assert_allclose(rotated(q, x), (expected @ x[..., None])[..., 0], atol=1e-12)
    np.testing.assert_allclose(np.abs(quaternion_of(expected[0, 0]) @ q[0, 0]), 1.0, atol=1e-12)


@given(seeds)
def test_log_and_exp_are_scipys(seed):
    q = random_quaternions(seed, 50)
    np.testing.assert_allclose(log(q), as_rotation(q).as_rotvec(), atol=1e-14)
    p = np.random.default_rng(seed).normal(size=(50, 3)) * 5
    assert same_rotation(exp(p), Rotation.from_rotvec(p).as_quat(scalar_first=True))


@pytest.mark.parametrize("angle", ANGLES)
@given(seeds)
def test_log_undoes_exp_from_tiny_angles_to_half_a_turn(angle, seed):
    axis = log(random_quaternions(seed))
    p = angle * axis / np.linalg.norm(axis)
    np.testing.assert_allclose(log(exp(p)), p, rtol=1e-13, atol=0 if angle < 3 else 1e-14)
    np.testing.assert_allclose(log(-exp(p)), p, rtol=1e-13, atol=0 if angle < 3 else 1e-14)


@given(st.floats(-300, 1.5), seeds)
def test_exp_gives_unit_quaternions(exponent, seed):
    p = np.random.default_rng(seed).normal(size=3) * 10.0**exponent
    assert abs(np.linalg.norm(exp(p)) - 1) < 1e-14


@given(seeds)
def test_log_has_unit_slope_across_its_taylor_branch(seed):
    axis = np.random.default_rng(seed).normal(size=3)
    axis /= np.linalg.norm(axis)
    half = 1e-7 * np.linspace(0.9, 1.1, 21)[:, None]
    q = np.concatenate((np.cos(half), np.sin(half) * axis), axis=1)
    np.testing.assert_allclose(log(q), 2 * half * axis, rtol=1e-14)


@given(seeds)
def test_slerp_is_scipys_and_turns_evenly(seed):
    start, end = random_quaternions(seed, 2)
    share = np.linspace(0, 1, 11)
    ours = slerp(start, end, share)
    scipys = Slerp([0, 1], as_rotation(np.stack((start, end))))(share).as_quat(scalar_first=True)
    assert same_rotation(ours, scipys)
    np.testing.assert_allclose(angle_between(ours[1:], ours[:-1]), angle_between(start, end) / 10, atol=1e-14)


@given(seeds)
def test_continuous_quaternions_stay_in_one_hemisphere(seed):
    walk = np.cumsum(np.random.default_rng(seed).normal(size=(3, 60, 3)) * 0.3, axis=1)
    q = exp(walk)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (3, 60, 1))
    fixed = continuous(q * signs)
    assert ((fixed[:, 1:] * fixed[:, :-1]).sum(axis=-1) >= 0).all()
    np.testing.assert_array_equal(fixed[:, 0], (q * signs)[:, 0])
    np.testing.assert_array_equal(np.abs(fixed), np.abs(q))


@given(seeds)
def test_nearest_is_the_same_rotation_and_no_candidate_is_nearer(seed):
    rng = np.random.default_rng(seed)
    p, target = log(random_quaternions(seed, 20)), rng.normal(size=(20, 3)) * 4
    found = nearest(p, target)
    assert same_rotation(exp(found), exp(p))
    axis = p / np.linalg.norm(p, axis=1, keepdims=True)
    others = p + 2 * np.pi * np.arange(-6, 7)[:, None, None] * axis
    distance = np.linalg.norm(found - target, axis=1)
    np.testing.assert_allclose(distance, np.linalg.norm(others - target, axis=2).min(axis=0), atol=1e-13)
    np.testing.assert_allclose(nearest([0, 0, 0], [0, 0, 6.0]), [0, 0, 2 * np.pi])
    np.testing.assert_array_equal(nearest([0, 0, 0], [0, 0, 0]), [0, 0, 0])


def test_rounded_quaternions_are_normalized_on_a_copy():
    q = np.round(random_quaternions(0, 7, 5), 3)
    q.setflags(write=False)
    np.testing.assert_allclose(np.linalg.norm(normalized(q), axis=-1), 1, atol=1e-15)
    assert normalized(q) is not q


@pytest.mark.parametrize(
    ("q", "message"),
    [
        ([1.0, 0, 0], r"expected quaternions \(w, x, y, z\) of shape \(\.\.\., 4\), got shape \(3,\)"),
        ([1.0, 1.0, 0, 0], r"^quaternion: expected a unit quaternion .* got norm 1\.41421 from \[1\.0, 1\.0, 0\.0"),
        (
            [[1.0, 0, 0, 0], [0, 0, 0, 0.5]],
            r"quaternion at index \[1\]: .* norm 0\.5 .* check the order of the columns",
        ),
        ([np.nan, 0, 0, 0], "got norm nan"),
    ],
)
def test_what_is_no_unit_quaternion_is_refused(q, message):
    with pytest.raises(TrajectoryError, match=message):
        normalized(q)


@pytest.mark.parametrize(
    ("function", "n_arrays", "width"),
    [
        (orientation.product, 2, 4), (orientation.conjugate, 1, 4), (orientation.angle_between, 2, 4),
        (orientation.normalized, 1, 4), (orientation.continuous, 1, 4), (orientation.log, 1, 4),
        (lambda a, b: orientation.slerp(a, b, 0.5), 2, 4), (orientation.exp, 1, 3),
        (orientation.angular_velocity, 2, 3),
        (orientation.angular_acceleration, 3, 3), (orientation.rotation_vector_rate, 2, 3),
    ],
)  # fmt: skip
def test_what_is_no_real_array_of_the_right_shape_is_refused(function, n_arrays, width):
    """An imaginary part would be lost."""
    right = np.full((5, width), 0.5)
    assert np.isfinite(function(*[right] * n_arrays)).all()
    complex_ones = [right + 0j, (right + 0j).astype(object), (right + 0j).tolist()]
    for wrong in (*complex_ones, right[:, 1:], right[0, 0], "x", None, object(), []):
        for k in range(n_arrays):
            arrays = [right] * n_arrays
            arrays[k] = wrong
            with pytest.raises(KinemeError, match=r"expected"):
                function(*arrays)

"""The distance after the best rotation, against SciPy, brute force and its own symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from movement_samples import turn

any_seed = given(seed=st.integers(0, 10**6))


def _rows(seed, n, d):
    return np.random.default_rng(seed).normal(size=(n, d * 20))


def _distances(procrustes, A, B):
    return procrustes.squared_distances(procrustes.prepare(A), procrustes.prepare(B))


@any_seed
def test_in_space_it_is_the_alignment_of_scipy(seed):
    A, B = _rows(seed, 3, 3), _rows(seed + 1, 4, 3)
    procrustes = Procrustes(3, math.pi)
    found = _distances(procrustes, A, B)
    for i, a in enumerate(A):
        R = procrustes.rotations(a[None], B)
        for j, b in enumerate(B):
            best, rssd = Rotation.align_vectors(a.reshape(3, -1).T, b.reshape(3, -1).T)
            assert found[i, j] == pytest.approx(rssd**2, rel=1e-8)
            np.testing.assert_allclose(R[j], best.as_matrix(), atol=1e-7)


@pytest.mark.parametrize("max_angle", [0.0, 0.3, math.pi / 4, 2.0, math.pi])
@any_seed
def test_in_the_plane_it_is_the_best_of_all_angles(max_angle, seed):
    A, B = _rows(seed, 3, 2), _rows(seed + 1, 4, 2)
    tried = np.array([turn(angle, 2) for angle in np.linspace(-max_angle, max_angle, 4001)])
    turned = np.einsum("kab,jbt->kjat", tried, B.reshape(4, 2, -1)).reshape(len(tried), 4, -1)
    brute = ((A[:, None, None] - turned) ** 2).sum(axis=-1).min(axis=1)
    found = _distances(Procrustes(2, max_angle), A, B)
    np.testing.assert_allclose(found, brute, rtol=1e-5)
    assert (found <= brute + 1e-9).all()


@pytest.mark.parametrize("d", [2, 3])
@any_seed
def test_a_turn_within_the_limit_is_taken_out_and_its_inverse_found(d, seed):
    angle = np.random.default_rng(seed).uniform(-0.7, 0.7)
    A = _rows(seed, 4, d)
    B = (turn(angle, d, seed) @ A.reshape(4, d, -1)).reshape(4, -1)
    procrustes = Procrustes(d, math.pi / 4)
    np.testing.assert_allclose(np.diag(_distances(procrustes, A, B)), 0, atol=1e-10)
    np.testing.assert_allclose(procrustes.rotations(A, B), np.tile(turn(-angle, d, seed), (4, 1, 1)), atol=1e-7)


@pytest.mark.parametrize("d", [2, 3])
@any_seed
def test_what_is_turned_further_keeps_a_distance(d, seed):
    A = _rows(seed, 1, d)
    B = (turn(1.5, d, seed) @ A.reshape(d, -1)).reshape(1, -1)
    far, near, free = (_distances(Procrustes(d, limit), A, B)[0, 0] for limit in (0.0, 0.5, math.pi))
    assert far > near > 0.05 * far
    assert free < 1e-10 * far
    angle = Rotation.from_matrix(Procrustes(3, 0.5).rotations(_rows(seed, 1, 3), _rows(seed + 1, 1, 3))[0]).magnitude()
    assert angle <= 0.5 + 1e-9


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("max_angle", [0.0, 0.5, math.pi])
@any_seed
def test_symmetric_and_zero_to_itself(d, max_angle, seed):
    A = _rows(seed, 5, d)
    found = _distances(Procrustes(d, max_angle), A, A)
    np.testing.assert_allclose(found, found.T, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.diag(found), 0, atol=1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_a_mirror_image_is_another_movement(d):
    A = _rows(0, 1, d)
    mirrored = A.reshape(d, -1) * np.array([-1.0] + [1.0] * (d - 1))[:, None]
    assert _distances(Procrustes(d, math.pi), A, mirrored.reshape(1, -1))[0, 0] > 1


@pytest.mark.parametrize("d", [1, 2, 3, 5])
@any_seed
def test_without_rotation_it_is_euclid(d, seed):
    A, B = _rows(seed, 3, d), _rows(seed + 1, 4, d)
    expected = ((A[:, None] - B) ** 2).sum(axis=-1)
    np.testing.assert_allclose(_distances(Procrustes(d, 0.0), A, B), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("d", "angle", "words"),
    [(2, 4.0, "at most pi, got 4.0"), (2, -1.0, "at least 0, got -1.0"), (4, 0.5, "max_angle=0.*got 0.5 with 4")],
)
def test_angles_out_of_range(d, angle, words):
    with pytest.raises(SpecificationError, match=words):
        Procrustes(d, angle)


@any_seed
def test_few_rows_are_compared_as_many_are(seed):
    A, B = _rows(seed, 20, 2), _rows(seed + 1, 7, 2)
    procrustes = Procrustes(2, 0.5)
    many = _distances(procrustes, A, B)
    np.testing.assert_allclose(np.vstack([_distances(procrustes, a[None], B) for a in A]), many, rtol=1e-10)


@pytest.mark.parametrize("choice", ["always", "never"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n", [1, 2, 15, 16, 40])
def test_few_and_many_movements_in_the_plane_are_compared_alike(n, dtype, choice, monkeypatch):
    """By vectors one by one, compiled or not, or by one complex product: the same alignments."""
    monkeypatch.setenv("KINEME_COMPILED", choice)
    rng, procrustes = np.random.default_rng(n), Procrustes(2, np.pi)
    A, B = (rng.normal(size=(m, 60)).astype(dtype) for m in (n, 37))
    a, b = (rows[:, :30] + 1j * rows[:, 30:] for rows in (A.astype(float), B.astype(float)))
    found = procrustes.alignment(procrustes.prepare(A), procrustes.prepare(B))
    np.testing.assert_allclose(found, np.abs(a.conj() @ b.T), rtol=2e-5 if dtype is np.float32 else 1e-12, atol=1e-5)


@any_seed
def test_without_rotation_rows_prepared_for_rotations_are_the_same(seed):
    A, B = _rows(seed, 3, 2), _rows(seed + 1, 4, 2)
    still, turning = Procrustes(2, 0.0), Procrustes(2, math.pi)
    expected = _distances(still, A, B)
    for one, other in ((still, turning), (turning, still), (turning, turning)):
        np.testing.assert_allclose(still.squared_distances(one.prepare(A), other.prepare(B)), expected, atol=1e-9)

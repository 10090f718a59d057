"""The best rotation under a prior: against decompositions, compiled against plain, and where two are equally good."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kineme.errors import SpecificationError
from kineme.kernels import procrustes as module
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import RotationPrior, limited, soft_products, soft_rotations

seeds = given(seed=st.integers(0, 10_000))


def _by_decomposition(M):
    """Largest ``tr(R^T M)`` over rotations, and R, by singular values."""
    U, s, Vt = np.linalg.svd(M)
    sign = np.sign(np.linalg.det(U @ Vt))
    s[:, 2] *= sign
    U[:, :, 2] *= sign[:, None]
    return s.sum(axis=1), U @ Vt


def _hard_cases(rng):
    """Covariances of lines forwards and backwards, of planes, of mirror images, of nothing."""
    a, b = (Rotation.random(1, random_state=rng.integers(1 << 30)).as_matrix()[0][:, :2] for _ in range(2))
    line, plane = np.outer(a[:, 0], b[:, 0]), a @ b.T
    return np.stack((line, -np.outer(a[:, 0], a[:, 0]), plane, -plane, -np.eye(3), np.zeros((3, 3)), 1e-9 * line))


@seeds
def test_the_root_and_the_rotation_are_those_of_a_decomposition(seed):
    M = np.random.default_rng(seed).normal(size=(50, 3, 3))
    best, R = _by_decomposition(M)
    np.testing.assert_allclose(soft_products(M), best, rtol=1e-9)
    np.testing.assert_allclose(np.einsum("nij,nij->n", soft_rotations(M), M), best, rtol=1e-9)
    clear = best - 2 * np.linalg.svd(M)[1][:, 1:].sum(axis=1) > 0.1  # where no other rotation is nearly as good
    np.testing.assert_allclose(soft_rotations(M)[clear], R[clear], atol=1e-7)


@seeds
def test_every_result_is_a_rotation_and_none_is_better(seed):
    rng = np.random.default_rng(seed)
    for M in (_hard_cases(rng), _hard_cases(rng) + 0.03 * np.eye(3)):
        R = soft_rotations(M)
        np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape), atol=1e-6)
        assert (np.linalg.det(R) > 0).all()
        reached = np.einsum("nij,nij->n", R, M)
        np.testing.assert_allclose(reached, soft_products(M), atol=5e-3)  # ties are broken by as much
        np.testing.assert_allclose(soft_products(M), _by_decomposition(M)[0], atol=2e-5)  # of -I three roots meet


@pytest.mark.parametrize("d", [2, 3])
@seeds
def test_movements_are_compared_alike_compiled_and_plain_and_either_way_round(d, seed):
    rng = np.random.default_rng(seed)
    rows = [rng.normal(size=(n, d * 20)).astype(np.float32) for n in (7, 5)]
    rows[0][0] = 0
    procrustes = Procrustes(d, math.pi, RotationPrior(0.05))
    A, B = map(procrustes.prepare, rows)
    found = {}
    for choice in ("always", "never"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KINEME_COMPILED", choice)
            found[choice] = (procrustes.alignment(A, B), *procrustes.align(A, B))
    for ours, theirs in zip(found["always"], found["never"], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=2e-4)
    alignment, same, rotations = found["always"]
    np.testing.assert_allclose(alignment, same, atol=1e-5)
    other, _, turned = (procrustes.alignment(B, A), *procrustes.align(B, A))
    np.testing.assert_allclose(other.T, alignment, atol=1e-4)
    if d == 3:
        np.testing.assert_allclose(turned.transpose(1, 0, 3, 2), rotations, atol=2e-3)
    squares = procrustes.squared_distances(A, A)
    np.testing.assert_allclose(np.diag(squares), 0, atol=1e-4)


def test_what_a_rotation_costs():
    """``2 k (1 - cos t)`` of the norms, about any axis; with a vertical, tilting costs more than turning."""
    x = np.random.default_rng(0).normal(size=(3, 30))
    x -= x.mean(axis=1, keepdims=True)
    x = np.linalg.qr(x.T)[0].T * math.sqrt(10)  # alike in all directions: the best rotation is the one applied
    norm = float((x**2).sum())

    def cost(prior, axis, angle):
        R = Rotation.from_rotvec(angle * np.asarray(axis)).as_matrix()
        procrustes = Procrustes(3, math.pi, prior)
        rows = [procrustes.prepare(one.reshape(1, -1)) for one in (x, R @ x)]
        return float(procrustes.squared_distances(*rows)[0, 0]) / (2 * norm)

    for axis in np.eye(3):  # a strong prior would rotate less than the movement was rotated
        assert cost(RotationPrior(0.001), axis, 0.6) == pytest.approx(2 * 0.001 * (1 - math.cos(0.6)), rel=0.02)
    upright = RotationPrior(0.001, vertical=(0, 0, 2.0), tilt=0.02)
    assert cost(upright, (0, 0, 1), 0.6) == pytest.approx(2 * 0.001 * (1 - math.cos(0.6)), rel=0.02)
    assert cost(upright, (1, 0, 0), 0.6) > 5 * cost(upright, (0, 0, 1), 0.6)


@pytest.mark.parametrize(
    "wrong", [{"concentration": -1.0}, {"vertical": (0, 0, 0)}, {"vertical": (0, 1)}, {"tilt": math.nan}]
)
def test_priors_that_are_none(wrong):
    with pytest.raises(SpecificationError):
        RotationPrior(**wrong)


@pytest.mark.parametrize("vertical", ["z", "up!", 2, (0, 0, "up"), (0, 0, None), (0, 0, math.nan), (0, 0, 10**400)])
def test_what_is_no_vertical_is_refused_in_words_that_say_what_is(vertical):
    with pytest.raises(SpecificationError, match=r"a direction in space, such as \(0, 0, 1\), got"):
        RotationPrior(vertical=vertical)


def test_about_a_vertical_rotations_are_as_likely_as_in_the_plane():
    np.testing.assert_allclose(RotationPrior().matrix(3), 0.1 * np.eye(3))
    np.testing.assert_allclose(RotationPrior(vertical=(0, 3.0, 0)).matrix(3), np.diag([0.03, 0.53, 0.03]))
    np.testing.assert_allclose(RotationPrior(0.2, vertical=(0, 3.0, 0), tilt=0).matrix(3), 0.2 * np.eye(3))


def test_where_a_prior_has_no_place():
    with pytest.raises(SpecificationError, match="a prior with max_angle=pi in two or three dimensions"):
        Procrustes(4, 0.0, RotationPrior())
    with pytest.raises(SpecificationError, match="3 dimensions with vertical"):
        Procrustes(2, math.pi, RotationPrior(vertical=(0, 0, 1)))


@seeds
def test_rotations_beyond_a_limit_are_turned_back_about_their_axes(seed):
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(30, 3))
    angles = np.concatenate((rng.uniform(0.0, math.pi, 28), [0.0, math.pi - 1e-4]))
    vectors *= (angles / np.linalg.norm(vectors, axis=1))[:, None]
    kept = vectors * np.minimum(1.0, 0.8 / np.maximum(angles, 1e-12))[:, None]
    R = limited(Rotation.from_rotvec(vectors).as_matrix(), 0.8)
    np.testing.assert_allclose(R, Rotation.from_rotvec(kept).as_matrix(), atol=3e-3)
    procrustes = Procrustes(3, 0.8)
    A, B = (procrustes.prepare(rng.normal(size=(n, 60))) for n in (4, 5))
    alignment, R = procrustes.align(A, B)
    np.testing.assert_allclose(alignment, procrustes.alignment(A, B))
    angles = np.linalg.norm(Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec(), axis=1)
    assert (angles < 0.8 + 1e-3).all()


@pytest.mark.parametrize("compiled", ["always", "never"])
def test_under_a_limit_the_products_are_computed_once(compiled, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    rng, procrustes = np.random.default_rng(0), Procrustes(3, 0.8)
    A, B = (procrustes.prepare(rng.normal(size=(n, 60))) for n in (4, 25))
    alone, calls, original = procrustes.alignment(A, B), [], module._in_space
    monkeypatch.setattr(module, "_in_space", lambda *given, **more: calls.append(1) or original(*given, **more))
    np.testing.assert_array_equal(procrustes.align(A, B)[0], alone)
    assert len(calls) == 1


@pytest.mark.parametrize("prior", [None, RotationPrior(0.2)])
@pytest.mark.parametrize("compiled", ["always", "never"])
@pytest.mark.parametrize("shape", [(23, 5), (5, 23)])
def test_tiles_take_the_norms_of_their_own_movements(shape, compiled, prior, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    rng = np.random.default_rng(0)
    procrustes = Procrustes(3, 0.8 if prior is None else math.pi, prior)
    A, B = (procrustes.prepare(rng.uniform(0.1, 10, (n, 1)) * rng.normal(size=(n, 60))) for n in shape)
    whole = (procrustes.alignment(A, B), *procrustes.align(A, B))
    monkeypatch.setattr(module, "_PAIRS", 40)
    for one, other in zip((procrustes.alignment(A, B), *procrustes.align(A, B)), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)


def test_what_a_right_angle_costs_by_default():
    """As is documented: 0.06 of the inner product in the plane and about a vertical, 0.2 in space, 0.5 more to tilt."""
    upright, quarter = np.array([0.0, 0.0, 1.0]), Rotation.from_rotvec([0.5 * math.pi, 0, 0]).as_matrix()
    for d, cost in ((2, 0.06), (3, 0.2)):
        F, R = RotationPrior().matrix(d), quarter if d == 3 else quarter[1:, 1:]
        assert np.trace(F) - np.trace(R.T @ F) == pytest.approx(cost)
    F = RotationPrior(vertical=upright).matrix(3)
    assert np.trace(F) - np.trace(quarter.T @ F) == pytest.approx(0.06 + 0.5)
    about = Rotation.from_rotvec(0.5 * math.pi * upright).as_matrix()
    assert np.trace(F) - np.trace(about.T @ F) == pytest.approx(0.06)


@pytest.mark.parametrize("length", [1e-150, -3.0, 1e150])
def test_a_vertical_is_a_direction_of_any_length(length):
    given, unit = RotationPrior(vertical=(0.0, 0.6 * length, 0.8 * length)), RotationPrior(vertical=(0.0, 0.6, 0.8))
    np.testing.assert_allclose(given.matrix(3), unit.matrix(3), atol=1e-12)


@pytest.mark.parametrize("compiled", ["always", "never"])
def test_of_equally_good_rotations_one_is_given(compiled, monkeypatch):
    """Paths along lines, one way and the other, and paths without extent."""
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    rng = np.random.default_rng(0)
    lines = rng.normal(size=(12, 3, 1)) * np.linspace(-1, 1, 20)
    rows = np.concatenate((lines, -lines, np.zeros((1, 3, 20)))).reshape(25, -1)
    procrustes = Procrustes(3, math.pi, RotationPrior(0.0))
    prepared = procrustes.prepare(rows)
    best, R = procrustes.align(prepared, prepared)
    np.testing.assert_allclose(R @ R.transpose(0, 1, 3, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-4)
    assert (np.linalg.det(R) > 0.99).all()
    paths = rows.reshape(25, 3, -1)
    reached = np.einsum("iks,ijkh,jhs->ij", paths, R, paths)
    np.testing.assert_allclose(reached, best, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("max_angle", "prior"), [(math.pi, RotationPrior()), (math.pi, RotationPrior(0.0)), (0.3, None)]
)
def test_rotations_in_the_plane_bring_the_second_closest_to_the_first(max_angle, prior):
    """As `pair_distances` takes cosine and sine: counterclockwise, of the second movement."""
    rows = np.random.default_rng(0).normal(size=(6, 40))
    procrustes = Procrustes(2, max_angle, prior)
    prepared = procrustes.prepare(rows)
    best, entries = procrustes.align(prepared, prepared)
    c, s = np.moveaxis(entries.astype(float), -1, 0)
    R = np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2)
    paths, norms = rows.reshape(6, 2, -1), np.linalg.norm(rows, axis=1)
    reached = np.einsum("iks,ijkh,jhs->ij", paths, R, paths)
    if prior is not None:
        reached += norms[:, None] * norms * np.trace(prior.matrix(2)) * (c - 1.0)
    np.testing.assert_allclose(reached, best, atol=1e-4)
    np.testing.assert_allclose(best, procrustes.alignment(prepared, prepared), atol=1e-9)
    assert (np.abs(np.arctan2(s, c)) <= max_angle + 1e-6).all()

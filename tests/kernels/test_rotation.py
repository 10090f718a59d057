"""The best rotation in space within an angle: against all rotations, and for movements without an axis."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import best_products, best_rotations
from soaking import combined

LIMITS = [0.01, 0.3, math.pi / 3, 2.0, 3.1, math.pi]
LONG = math.prod((3, 20))


def _axes(rng, n):
    x = rng.normal(size=(n, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def _outer(a, b):
    return np.einsum("ni,nj->nij", a, b)


def _covariances(kind, rng, n):
    a, b = _axes(rng, n), _axes(rng, n)
    return {
        "any": lambda: rng.normal(size=(n, 3, 3)),
        "straight": lambda: _outer(a, b),
        "straight, unturned": lambda: _outer(a, a),
        "straight, backwards": lambda: -_outer(a, a),
        "thin": lambda: _outer(a, b) + 0.03 * rng.normal(size=(n, 3, 3)),
        "nearly straight": lambda: _outer(a, b) + 1e-9 * rng.normal(size=(n, 3, 3)),
        "planar": lambda: _outer(a, b) + 0.4 * _outer(np.cross(a, _axes(rng, n)), _axes(rng, n)),
        "mirrored": lambda: np.tile(-np.eye(3), (n, 1, 1)),
        "ball": lambda: Rotation.random(n, random_state=0).as_matrix(),
        "half a turn": lambda: np.tile(np.diag([1.0, -1.0, -1.0]), (n, 1, 1)),
        "nothing": lambda: np.zeros((n, 3, 3)),
    }[kind]()


KINDS = (
    "any", "straight", "straight, unturned", "straight, backwards", "thin", "nearly straight", "planar", "mirrored",
    "ball", "half a turn", "nothing",
)  # fmt: skip


def _product_of(vectors, C):
    return np.einsum("nij,ij->n", Rotation.from_rotvec(vectors).as_matrix(), C)


def _best_of_many(C, max_angle, rng):
    """Rotations all over the ball and its skin, then ever smaller steps from the best ones."""
    angles = max_angle * np.concatenate((rng.uniform(size=1500) ** (1 / 3), np.ones(1500)))
    tried = _axes(rng, 3000) * angles[:, None]
    tried = tried[np.argsort(-_product_of(tried, C))[:12]]
    for size in 0.4 * 0.7 ** np.arange(45):
        near = tried[:, None] + size * np.concatenate((np.zeros((1, 3)), rng.normal(size=(20, 3))))
        angle = np.linalg.norm(near, axis=2, keepdims=True)
        near *= np.minimum(1.0, max_angle / np.maximum(angle, 1e-30))
        found = _product_of(near.reshape(-1, 3), C).reshape(near.shape[:2])
        tried = near[np.arange(len(near)), found.argmax(axis=1)]
    return found.max()


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("max_angle", LIMITS)
@pytest.mark.parametrize("kind", KINDS)
def test_no_rotation_within_the_limit_is_better(kind, max_angle):
    rng = np.random.default_rng(0)
    C = _covariances(kind, rng, 2)
    found = best_products(C, max_angle)
    tried = np.array([_best_of_many(one, max_angle, rng) for one in C])
    assert (found >= tried - 1e-13).all()
    near_pi = max_angle > 2 and kind in ("thin", "any")  # two peaks far apart: the search may climb the lower one
    np.testing.assert_allclose(found, tried, atol=0.05 if near_pi else 1e-6)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("max_angle", [0.0, 1e-300, 1e-9, *LIMITS])
@pytest.mark.parametrize("kind", KINDS)
def test_a_rotation_within_the_limit_attains_it(kind, max_angle):
    C = _covariances(kind, np.random.default_rng(1), 300)
    R = best_rotations(C, max_angle)
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (len(C), 1, 1)), atol=1e-14)
    assert (np.linalg.det(R) > 0).all()
    assert (Rotation.from_matrix(R).magnitude() <= max_angle + 1e-9).all()
    # Straight movements are not turned about themselves: a price of less than one part in a million here.
    price = 1e-6 if "straight" in kind else 1e-13
    np.testing.assert_allclose(np.einsum("nij,nij->n", R, C), best_products(C, max_angle), atol=price)


@pytest.mark.parametrize("kind", KINDS)
def test_the_product_grows_with_the_limit_from_none_to_any_rotation(kind):
    C = _covariances(kind, np.random.default_rng(2), 300)
    found = np.array([best_products(C, limit) for limit in np.linspace(0, math.pi, 40)])
    assert (np.diff(found, axis=0) >= -1e-13).all()
    np.testing.assert_allclose(found[0], np.trace(C, axis1=1, axis2=2), atol=1e-13)
    sizes = np.linalg.svd(C, compute_uv=False)
    sign = np.where(np.linalg.det(C) < 0, -1.0, 1.0)
    np.testing.assert_allclose(found[-1], sizes[:, 0] + sizes[:, 1] + sign * sizes[:, 2], atol=1e-13)


@given(seed=st.integers(0, 10**6), off=st.integers(-18, 0), max_angle=st.floats(0, math.pi))
def test_near_a_line_nothing_breaks(seed, off, max_angle):
    """From there on, the axis is no more than rounding: the value stays between what bounds it."""
    rng = np.random.default_rng(seed)
    a, b = _axes(rng, 50), _axes(rng, 50)
    C = _outer(a, b) + 10.0**off * rng.normal(size=(50, 3, 3))
    angle = np.arccos(np.clip((a * b).sum(axis=1), -1, 1))
    line = np.cos(np.maximum(angle - max_angle, 0.0))  # of the line alone
    np.testing.assert_allclose(best_products(C, max_angle), line, atol=10 * 10.0**off + 1e-13)


@pytest.mark.parametrize(
    ("kind", "dtype", "max_angle"),
    combined(KINDS, [np.float64, np.float32], [0.0, 1e-300, 0.3, math.pi / 3, math.pi], together=1),
)
def test_compiled_plain_batch_and_one_by_one_are_the_same(kind, dtype, max_angle, monkeypatch):
    """Sizes over twelve powers of ten side by side; compared on the size of each pair."""
    rng, sizes = np.random.default_rng(3), 10.0 ** np.arange(-6, 7)
    C = _covariances(kind, rng, len(sizes))
    A = (sizes[:, None, None] * C).reshape(-1, 9).astype(dtype)
    B = np.concatenate((sizes[:, None, None] * C, np.tile(np.eye(3), (30, 1, 1)))).reshape(-1, 9).astype(dtype)
    procrustes, prepare = Procrustes(3, max_angle), Procrustes(3, max_angle).prepare
    found = {}
    for choice in ("never", "always"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        found[choice] = procrustes.alignment(prepare(A), prepare(B))
        found[f"{choice}, one by one"] = [procrustes.alignment(prepare(a[None]), prepare(B))[0] for a in A]
        found[f"{choice}, backwards"] = procrustes.alignment(prepare(A[::-1]), prepare(B[::-1]))[::-1, ::-1]
    scale = np.linalg.norm(A, axis=1, keepdims=True) * np.linalg.norm(B, axis=1) + 1e-30
    for name, products in found.items():
        off = np.abs(products - found["never"]) / scale
        assert off.max() < (1e-6 if dtype is np.float32 else 1e-14), name


def test_threads_and_tiles_change_nothing(monkeypatch):
    rng, procrustes = np.random.default_rng(4), Procrustes(3)
    A, B = (procrustes.prepare(rng.normal(size=(n, LONG))) for n in (70, 700))
    for choice in ("never", "always"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        wide, high = procrustes.alignment(A, B), procrustes.alignment(B, A)
        np.testing.assert_allclose(wide, high.T, rtol=1e-12, atol=1e-12)
        for start in (0, 63, 699):
            alone = procrustes.alignment(A, B.take(slice(start, start + 1)))
            np.testing.assert_allclose(alone[:, 0], wide[:, start], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("choice", ["never", "always"])
def test_what_is_not_finite_spoils_its_own_pairs_only(choice, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", choice)
    rows = np.random.default_rng(5).normal(size=(4, LONG))
    spoiled = rows.copy()
    spoiled[1, 7] = np.nan
    procrustes = Procrustes(3)
    found, expected = (procrustes.alignment(procrustes.prepare(x), procrustes.prepare(rows)) for x in (spoiled, rows))
    assert np.isnan(found[1]).all()
    np.testing.assert_allclose(found[[0, 2, 3]], expected[[0, 2, 3]], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-6, 1e-3])
def test_a_reach_that_was_not_turned_is_not_turned(noise):
    """Noise, or rounding, tells how a straight movement is turned about itself; it is not believed."""
    rng = np.random.default_rng(6)
    u = np.linspace(0, 1, 100)
    reach = (10 * u**3 - 15 * u**4 + 6 * u**5)[:, None] * [0.3, 0.2, 0.1]
    A, B = (reach.T + noise * 0.37 * rng.normal(size=(20, 3, 100)) for _ in range(2))
    A, B = ((x - x.mean(axis=2, keepdims=True)).reshape(20, -1) for x in (A, B))
    angles = np.degrees(Rotation.from_matrix(Procrustes(3).rotations(A, B)).magnitude())
    assert angles.max() < 0.01 + 2e3 * noise

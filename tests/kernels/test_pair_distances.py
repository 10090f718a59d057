"""Elastic, turning and point-cloud distances of pairs: against textbook loops, their twins, and their own claims."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import special_ortho_group

from kineme.errors import SpecificationError
from kineme.kernels.pair_distances import (
    CloudSpec,
    ElasticSpec,
    listed_distances,
    pair_bounds,
    pair_distances,
    shapes_of,
)
from soaking import SOAK, combined, examples

CHOICES = ("never", "always")
#: The last compiles as the first does, for many seconds.
DIMENSIONS = [1, 2, 3, 6] if SOAK else [1, 2, 3]


def paths(n, d, seed=0, n_points=100):
    """Smooth movements, centered, of size 1."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, n_points)
    waves = np.sin(2 * np.pi * (np.arange(1, 4)[:, None] * s * rng.uniform(0.3, 0.9) + rng.uniform(size=(n, d, 3, 1))))
    return sized((rng.normal(size=(n, d, 3, 1)) * waves).sum(axis=2))


def sized(x):
    x = x - x.mean(axis=2, keepdims=True)
    size = np.sqrt((x * x).sum(axis=1).mean(axis=1))[:, None, None]
    return x / np.where(size > 0, size, 1)


def rotations(n, m, d, seed=1):
    if d == 1:
        return np.ones((n, m, 1, 1))
    return special_ortho_group.rvs(d, n * m, random_state=seed).reshape(n, m, d, d)


def unit(v):
    length = np.linalg.norm(v)
    return v / length if length > 1e-9 else np.zeros_like(v)


def angle(a, b):
    return math.acos(np.clip(a @ b, -1, 1)) / math.pi if a.any() and b.any() else 0.0


def even(path, n):
    at = np.arange(n) * (path.shape[1] - 1) / (n - 1)
    return np.stack([np.interp(at, np.arange(path.shape[1]), x) for x in path], axis=1)


def textbook_warping(costs, band):
    n = len(costs)
    table = {(-1, -1): 0.0}
    for p in range(n):
        for q in range(n):
            if abs(p - q) <= band:
                before = [table.get(at, math.inf) for at in ((p - 1, q), (p, q - 1), (p - 1, q - 1))]
                table[p, q] = costs[p][q] + min(before)
    return table[n - 1, n - 1] / n


def textbook_elastic(a, b, R, spec):
    """Squared elastic and turning distances of two paths (d, S)."""
    described = []
    for path in (a, b):
        ends = even(path, spec.n_segments + 1)
        t = [unit(step) for step in np.diff(ends, axis=0)]
        inner = [angle(t[i - 1], t[i + 1]) if t[i].any() else 0.0 for i in range(1, len(t) - 1)]
        described.append((t, (ends[1:] + ends[:-1]) / 2, [0.0, *inner, 0.0]))
    (t, x, theta), (u, y, phi) = described
    n = spec.n_segments
    turning = [[spec.turning_weight * (theta[p] - phi[q]) ** 2 for q in range(n)] for p in range(n)]
    costs = [
        [
            ((t[p] - R @ u[q]) ** 2).sum() + spec.position_weight * ((x[p] - R @ y[q]) ** 2).sum() + turning[p][q]
            for q in range(n)
        ]
        for p in range(n)
    ]
    return textbook_warping(costs, spec.band), textbook_warping(turning, spec.band)


def textbook_cloud(a, b, R, spec):
    """The squared point-cloud distance of two paths (d, S)."""
    described = []
    for path in (a, b):
        x = even(path, spec.n_points)
        steps = [unit(step) for step in np.diff(x, axis=0)]
        theta = [0.0, *[angle(steps[i - 1], steps[i]) for i in range(1, len(steps))], 0.0]
        described.append((x, theta, [unit(v) for v in np.gradient(x, axis=0)]))
    (x, theta, t), (y, phi, u) = described

    def distance(p, q):
        sine = (t[p] @ t[p] + u[q] @ u[q]) / 2 - (t[p] @ R @ u[q]) ** 2
        turn = spec.turning_weight * (theta[p] - phi[q]) ** 2
        return math.sqrt(max(0.0, ((x[p] - R @ y[q]) ** 2).sum() + turn + spec.line_weight * sine))

    def directed(distance):
        total, matched, n = 0.0, set(), spec.n_points
        for p in range(n):
            nearest = min(range(n), key=lambda q: distance(p, q))
            matched.add(nearest)
            total += distance(p, nearest)
        return total + sum(min(distance(p, q) for p in range(n)) for q in range(n) if q not in matched)

    return (min(directed(distance), directed(lambda p, q: distance(q, p))) / spec.n_points) ** 2


@pytest.fixture(params=CHOICES)
def choice(request, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", request.param)
    return request.param


SPECS = [(ElasticSpec(), CloudSpec()), (ElasticSpec(12, 3, 0.2, 5.0), CloudSpec(32, 9.0, 0.3))]


@pytest.mark.parametrize(("d", "specs", "choice"), combined(DIMENSIONS, SPECS, CHOICES), indirect=["choice"])
def test_distances_are_those_of_the_textbooks(d, specs, choice):
    a, b, R = paths(3, d), paths(4, d, seed=1), rotations(3, 4, d)
    found = pair_distances(shapes_of(a, *specs), shapes_of(b, *specs), R)
    for i in range(3):
        for j in range(4):
            elastic, turning = textbook_elastic(a[i], b[j], R[i, j], specs[0])
            expected = (elastic, turning, textbook_cloud(a[i], b[j], R[i, j], specs[1]))
            np.testing.assert_allclose(found[:, i, j], expected, atol=1e-5)


@pytest.mark.parametrize(
    ("d", "sizes"), combined(DIMENSIONS, [(1, 1), (1, 40), (40, 1), (40, 3), (35, 70), (3, 17)], together=1)
)
def test_compiled_equals_plain(d, sizes, monkeypatch):
    n, m = sizes
    A, B, R = shapes_of(paths(n, d)), shapes_of(paths(m, d, seed=1)), rotations(n, m, d)
    found = {}
    for choice in CHOICES:
        monkeypatch.setenv("KINEME_COMPILED", choice)
        found[choice] = pair_distances(A, B, R), pair_distances(A, B), pair_bounds(A, B, R), pair_bounds(A, B)
    for one, other in zip(*found.values(), strict=True):
        assert one.dtype == other.dtype == np.float32
        np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize(("n", "m"), [(1, 40), (40, 3), (35, 37)])
def test_bounds_are_below_the_distances_and_not_idle(d, n, m, choice):
    x = np.concatenate((paths(n, d), degenerate(d)))
    A, B, R = shapes_of(x), shapes_of(paths(m, d, seed=1)), rotations(n + 6, m, d)
    for turned in (None, R, *([R[..., 0]] if d == 2 else [])):
        squares, bounds = pair_distances(A, B, turned), pair_bounds(A, B, turned)
        assert (bounds <= squares * (1 + 1e-5) + 1e-7).all()
        assert d == 1 or np.median(bounds[0, :n] / squares[0, :n]) > 0.05  # on a line, all directions are alike
        assert (bounds[1] <= bounds[0] * (1 + 1e-5)).all()
        np.testing.assert_allclose(bounds[2], squares[2], rtol=1e-5, atol=1e-7)
        assert not pair_bounds(A, B, turned, clouds=False)[2].any()


@pytest.mark.parametrize("d", DIMENSIONS)
def test_listed_pairs_have_the_distances_of_all_pairs(d, choice):
    A, B, R = shapes_of(paths(20, d)), shapes_of(paths(9, d, seed=1)), rotations(20, 9, d)
    i, j = np.random.default_rng(0).integers(0, (20, 9), (50, 2)).T
    exact = {"rtol": 0, "atol": 0 if choice == "always" else 1e-6}
    np.testing.assert_allclose(listed_distances(A, B, i, j, R[i, j]), pair_distances(A, B, R)[:, i, j], **exact)
    np.testing.assert_allclose(listed_distances(A, B, i, j), pair_distances(A, B)[:, i, j], **exact)
    for none in (None, R[i[:0], j[:0]]):
        assert listed_distances(A, B, i[:0], j[:0], none).shape == (3, 0)
    with pytest.raises(SpecificationError, match="expected rotations of shape"):
        listed_distances(A, B, i, j, R[i[:3], j[:3]])


@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_batch_equals_its_members_in_any_order(d, choice):
    n, m = 14, 37
    A, B, R = shapes_of(paths(n, d)), shapes_of(paths(m, d, seed=1)), rotations(n, m, d)
    whole, order = pair_distances(A, B, R), np.random.default_rng(0).permutation(m)
    exact = {"rtol": 0, "atol": 0 if choice == "always" else 1e-6}
    np.testing.assert_allclose(pair_distances(A, B.take(order), R[:, order]), whole[:, :, order], **exact)
    for i, j in ((0, 0), (4, 36), (2, 16)):
        alone = pair_distances(A.take([i]), B.take([j]), R[[i]][:, [j]])
        np.testing.assert_allclose(alone[:, 0, 0], whole[:, i, j], **exact)
    # Of the whole and of the first, 16 of A's movements are compared at once, of others a list of pairs, 16 of B's.
    for i, some in ((14, 7), (5, 7), (5, 16)):
        few = np.random.default_rng(some).permutation(m)[:some]
        found = pair_distances(A.take(slice(0, i)), B.take(few), R[:i, few])
        np.testing.assert_allclose(found, whole[:, :i, few], **exact)


def test_rotations_are_matrices_or_cosines_and_sines(choice, monkeypatch):
    monkeypatch.setattr("kineme.kernels.pair_distances._TILE_PAIRS", 64)
    A, B, R = shapes_of(paths(40, 2)), shapes_of(paths(50, 2, seed=1)), rotations(40, 50, 2)
    expected = pair_distances(A, B, R)
    np.testing.assert_allclose(pair_distances(A, B, R[..., 0]), expected, atol=1e-6)
    few = pair_distances(A, B.take(slice(0, 4)), R[:, :4, :, 0])
    np.testing.assert_allclose(few, expected[:, :, :4], atol=1e-6)
    none = np.broadcast_to(np.eye(2), R.shape)
    np.testing.assert_allclose(pair_distances(A, B), pair_distances(A, B, none), atol=1e-6)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_distances_are_symmetric_with_the_transposed_rotation(d, choice):
    A, B, R = shapes_of(paths(7, d)), shapes_of(paths(20, d, seed=1)), rotations(7, 20, d)
    there, back = pair_distances(A, B, R), pair_distances(B, A, R.transpose(1, 0, 3, 2))
    np.testing.assert_allclose(there, back.transpose(0, 2, 1), atol=1e-5)
    assert (there >= 0).all()


def degenerate(d):
    """Straight lines, there and back, movements without extent, and with a rest in the middle."""
    s, along = np.linspace(-1, 1, 100), np.eye(d)[0][:, None]
    rest = np.clip(np.linspace(-2, 2, 100), -1, 0) + np.clip(np.linspace(-2, 2, 100) - 1, 0, 1)
    return sized(np.stack([along * s, -along * s, along * abs(s), 0 * along * s, along * rest, paths(1, d)[0]]))


@pytest.mark.parametrize("d", DIMENSIONS)
def test_equal_movements_have_a_distance_of_zero(d, choice):
    shapes = shapes_of(np.concatenate((paths(5, d), degenerate(d), paths(5, d))))
    squares = pair_distances(shapes, shapes)
    assert np.isfinite(squares).all()
    np.testing.assert_allclose(np.diagonal(squares, axis1=1, axis2=2), 0, atol=1e-6)
    np.testing.assert_allclose(squares[:, :5, 11:].diagonal(axis1=1, axis2=2), 0, atol=1e-6)  # duplicates
    assert (squares >= 0).all()


def own(squares):
    """Of each movement with the one of the same number."""
    return squares.diagonal(axis1=1, axis2=2)


@pytest.mark.parametrize("d", DIMENSIONS[1:])
def test_a_rotated_movement_is_brought_back_by_its_rotation(d, choice):
    a, b, R = paths(6, d), paths(6, d, seed=1), rotations(1, 6, d)[0]
    each = np.broadcast_to(R, (6, *R.shape))
    back = pair_distances(shapes_of(a), shapes_of(R.transpose(0, 2, 1) @ a), each)
    np.testing.assert_allclose(own(back), 0, atol=2e-6)
    together = pair_distances(shapes_of(R @ a), shapes_of(b), each)
    np.testing.assert_allclose(own(together), own(pair_distances(shapes_of(a), shapes_of(b))), atol=1e-5)


def test_movements_without_direction_have_no_tangents_and_no_turning_angles():
    shapes = shapes_of(np.zeros((1, 3, 100)))
    assert not any(one.any() for one in shapes.arrays().values())
    rest = shapes_of(degenerate(2)[4:5])
    assert not rest.turning.any()
    assert set(np.linalg.norm(rest.tangents[0], axis=1).round(6)) == {0.0, 1.0}


def test_a_reversal_has_no_tangent_whatever_the_rounding_of_its_positions():
    there_and_back = np.abs(np.arange(20) - 10.0)
    noisy = there_and_back + 1e-6 * np.random.default_rng(0).normal(size=(50, 1, 20))
    shapes = shapes_of(sized(noisy).astype(np.float32))
    assert not shapes.point_tangents[:, 10].any()
    assert (np.abs(shapes.point_tangents[:, 9]) == 1).all()


def test_values_of_a_hundred_samples_are_every_third():
    a = paths(2, 3)
    ends = a[:, :, ::3].transpose(0, 2, 1)
    np.testing.assert_array_equal(shapes_of(a).midpoints, (0.5 * (ends[:, 1:] + ends[:, :-1])).astype(np.float32))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize(
    ("specs", "n_samples"), [((), 100), ((ElasticSpec(3), CloudSpec(3)), 2), ((ElasticSpec(40), CloudSpec(32)), 29)]
)
def test_compiled_shapes_equal_plain_ones(d, dtype, specs, n_samples, monkeypatch):
    x = np.concatenate((paths(30, d, n_points=n_samples), degenerate(d)[:, :, :n_samples])).astype(dtype)
    x = x.transpose(2, 0, 1).copy().transpose(1, 2, 0)  # any layout is accepted
    found = {}
    for choice in CHOICES:
        monkeypatch.setenv("KINEME_COMPILED", choice)
        found[choice] = shapes_of(x, *specs).arrays()
        assert all(len(one) == 0 for one in shapes_of(x[:0], *specs).arrays().values())
    for name, plain in found["never"].items():
        assert found["always"][name].shape == plain.shape
        assert found["always"][name].dtype == np.float32
        np.testing.assert_allclose(found["always"][name], plain, rtol=0, atol=1e-6)


def test_turning_angles_are_exact_over_their_whole_range(choice):
    angles = np.concatenate((np.linspace(0, np.pi, 2001), np.geomspace(1e-6, 1e-3, 50)))
    corners = np.zeros((len(angles), 2, 3))
    corners[:, 0] = np.stack((-np.ones_like(angles), 0 * angles, np.cos(angles)), axis=1)
    corners[:, 1, 2] = np.sin(angles)
    turning = shapes_of(corners, cloud=CloudSpec(3)).point_turning[:, 1]
    np.testing.assert_allclose(turning, angles / np.pi, rtol=0, atol=6e-8)


def test_shapes_are_taken_and_filled_and_keep_what_they_are():
    shapes = shapes_of(paths(5, 2), ElasticSpec(10, 2), CloudSpec(8))
    two, room = shapes.take(np.array([3, 1])), shapes.empty(7)
    for name, array in shapes.arrays().items():
        np.testing.assert_array_equal(two.arrays()[name], array[[3, 1]])
        assert room.arrays()[name].shape == (7, *array.shape[1:])
        assert array.flags.c_contiguous
        assert array.dtype == np.float32
    assert (two.elastic, room.cloud, len(room), two.n_dims) == (shapes.elastic, shapes.cloud, 7, 2)


@settings(max_examples=examples(15), deadline=None)
@given(st.integers(1, 3), st.integers(0, 10**6), st.integers(0, 12), st.sampled_from(CHOICES), st.floats(0, 0.3))
def test_turning_distances_are_never_above_elastic_ones(d, seed, band, choice, noise):
    rng = np.random.default_rng(seed)
    x = np.concatenate((paths(6, d, seed), degenerate(d)))
    x = sized(x + noise * rng.normal(size=x.shape))
    shapes = shapes_of(np.concatenate((x, x[:2])), ElasticSpec(band=band))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KINEME_COMPILED", choice)
        squares = pair_distances(shapes, shapes)
    assert (squares >= 0).all()
    assert (squares[1] <= squares[0] * (1 + 1e-5)).all()


def test_no_movements_have_no_distances(choice):
    shapes = shapes_of(paths(3, 2))
    none = shapes.take(slice(0, 0))
    assert pair_distances(shapes, none).shape == (3, 3, 0)
    assert pair_distances(none, shapes).shape == (3, 0, 3)


def test_what_does_not_fit_is_refused():
    flat, space = shapes_of(paths(3, 2)), shapes_of(paths(3, 3))
    with pytest.raises(SpecificationError, match="same number of dimensions, got 2 and 3"):
        pair_distances(flat, space)
    with pytest.raises(SpecificationError, match="same specifications"):
        pair_distances(flat, shapes_of(paths(3, 2), ElasticSpec(band=2)))
    with pytest.raises(SpecificationError, match=r"expected rotations of shape \(3, 3, 3, 3\), got \(3, 3, 2\)"):
        pair_distances(space, space, np.zeros((3, 3, 2)))
    with pytest.raises(SpecificationError, match=r"expected rotations of shape \(3, 3, 2, 2\) or \(3, 3, 2\)"):
        pair_distances(flat, flat, np.zeros((3, 2)))
    for wrong in ({"n_segments": 2}, {"band": -1}, {"turning_weight": math.nan}, {"position_weight": math.inf}):
        with pytest.raises(SpecificationError, match=next(iter(wrong))):
            ElasticSpec(**wrong)
    for wrong in ({"n_points": 2}, {"n_points": 33}, {"line_weight": -1}):
        with pytest.raises(SpecificationError, match=next(iter(wrong))):
            CloudSpec(**wrong)

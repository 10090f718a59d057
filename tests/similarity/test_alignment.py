"""Members are laid onto their medoid exactly where they are copies of it, and means and morphs follow."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import kineme
from kineme.anchoring.grounding import medoid_of, prototype
from kineme.anchoring.space import morph
from kineme.recognition.recognizer import Recognizer
from kineme.similarity.describe import N_POINTS, maps_onto, moved, paths_of
from kineme.similarity.similarity import similarities
from unlabeled_samples import draw_kinds

quick = settings(max_examples=10, deadline=None, derandomize=True)
seeds = st.integers(0, 10_000)
dims = st.sampled_from([1, 2, 3, 4])
FORMULATIONS = ("original", "bio-inspired", "amplitude-scaled", "decoupled")


def _paths(n, d, seed):
    demos = draw_kinds([n], d, seed, spread=0.05)
    return paths_of(demos, Recognizer(cutoff=None))


def _rotation(d, angle, rng):
    if d == 2:
        return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    if d == 3:
        axis = rng.normal(size=3)
        return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return np.eye(d)


@given(seed=seeds, d=dims, angle=st.floats(-1.0, 1.0))
@quick
def test_a_moved_copy_is_brought_back(seed, d, angle):
    rng = np.random.default_rng(seed)
    (path,) = _paths(1, d, seed)
    R, scale, shift = _rotation(d, angle, rng), rng.uniform(0.3, 3.0), rng.normal(size=(d, 1))
    copy = scale * R @ path + shift
    maps = maps_onto(copy[None], path)
    np.testing.assert_allclose(maps.move(copy[None])[0], path, atol=1e-9)
    np.testing.assert_allclose(maps.rotations[0], R.T, atol=1e-9)
    np.testing.assert_allclose(maps.scales[0], 1 / scale)


def test_what_the_recognizer_does_not_take_out_stays():
    (path,) = _paths(1, 2, 0)
    copy = 2.0 * _rotation(2, 0.5, None) @ path + 7.0
    for kept, expected in (
        (Recognizer(max_angle=0.0), {"rotation": np.eye(2)}),
        (Recognizer(scale="none"), {"scale": 1.0}),
        (Recognizer(translation=False), {"shift": 0.0}),
    ):
        maps = maps_onto(copy[None], path, kept)
        found = {"rotation": maps.rotations[0], "scale": maps.scales[0], "shift": maps.shifts[0]}
        for what, value in expected.items():
            np.testing.assert_allclose(found[what], value, atol=1e-12)


@pytest.mark.parametrize("formulation", FORMULATIONS)
@given(seed=seeds, d=st.sampled_from([2, 3]))
@quick
def test_moved_primitives_move_along_moved_paths(formulation, seed, d):
    primitives = kineme.DMP(formulation, n_basis=20).learn(draw_kinds([4], d, seed, spread=0.3))
    paths = paths_of(primitives)
    maps = maps_onto(paths, paths[0])
    np.testing.assert_allclose(paths_of(moved(primitives, maps)), maps.move(paths), atol=1e-8)


@given(seed=seeds, d=dims)
@quick
def test_the_mean_of_copies_is_the_original(seed, d):
    rng = np.random.default_rng(seed)
    original = draw_kinds([1], d, seed)[0].positions
    copies = [
        rng.uniform(0.5, 2) * original @ _rotation(d, rng.uniform(-0.4, 0.4), rng).T + rng.normal(size=d)
        for _ in range(5)
    ]
    primitives = kineme.DMP(n_basis=20).learn(copies)
    found = prototype(primitives)
    np.testing.assert_allclose(paths_of(found.primitive)[0], paths_of(primitives)[found.medoid], atol=1e-6)
    np.testing.assert_allclose(found.average.deviation(), 0.0, atol=1e-6)


def test_the_medoid_is_the_most_typical():
    demos = draw_kinds([6], 2, 4, spread=0.05)
    K = similarities(demos)
    primitives = kineme.DMP().learn(demos)
    typical = K.sum(axis=1)
    assert medoid_of(demos) == typical.argmax()
    assert typical[prototype(primitives).medoid] >= 0.95 * typical.max()  # of replays, whose slow ends count less
    assert prototype(primitives, medoid=2).medoid == 2
    assert medoid_of(demos[[1, 1, 1, 1]]) == medoid_of(demos[:2]) == 0


def test_the_mean_has_the_spread_of_the_members():
    """Against the standard deviation of the aligned paths themselves."""
    primitives = kineme.DMP(n_basis=30).learn(draw_kinds([8], 2, 1, spread=0.1))
    found = prototype(primitives)
    laid = found.maps.move(paths_of(primitives))
    np.testing.assert_allclose(paths_of(found.primitive)[0], laid.mean(axis=0), atol=1e-8)
    np.testing.assert_allclose(found.average.deviation(N_POINTS).T, laid.std(axis=0, ddof=1), atol=1e-8)


@pytest.mark.parametrize("like", [Recognizer(), Recognizer(scale="per-dimension", max_angle=0.0)])
@given(seed=seeds, d=dims)
@quick
def test_a_morph_goes_from_one_to_the_other(like, seed, d):
    primitives = kineme.DMP(n_basis=20).learn(draw_kinds([1, 1], d, seed))
    way = morph(primitives[0], primitives[1], [0.0, 0.5, 1.0], like)
    np.testing.assert_allclose(paths_of(way)[[0, 2]], paths_of(primitives), atol=1e-7)
    np.testing.assert_allclose(way.durations, 1.0)


@given(seed=seeds, d=st.sampled_from([2, 3]), angle=st.floats(0.2, 1.0))
@quick
def test_half_way_to_a_moved_copy_is_the_shape_half_turned(seed, d, angle):
    rng = np.random.default_rng(seed)
    demos, R = draw_kinds([1], d, seed), _rotation(d, angle, rng)
    copy = 4.0 * demos[0].positions @ R.T
    primitives = kineme.DMP(n_basis=20).learn([demos[0].positions, copy])
    (half,) = paths_of(morph(primitives[0], primitives[1], 0.5))
    path = paths_of(primitives)[0]
    step = Rotation.from_matrix(R).as_rotvec() / 2 if d == 3 else angle / 2
    turned = Rotation.from_rotvec(step).as_matrix() if d == 3 else _rotation(2, step, rng)
    expected = 2.0 * turned @ path
    np.testing.assert_allclose(np.diff(half), np.diff(expected), atol=1e-6)


def test_what_cannot_be_aligned():
    primitives = kineme.DMP(n_basis=20).learn(draw_kinds([2, 2]))
    with pytest.raises(kineme.errors.TrajectoryError, match="expected one primitive at each end, got 2"):
        morph(primitives[:2], primitives[0], 0.5)
    with pytest.raises(kineme.errors.SpecificationError, match=r"shares of the way from 0 to 1, got \[0.5, 1.5\]"):
        morph(primitives[0], primitives[1], [0.5, 1.5])
    other = kineme.DMP(n_basis=21).learn(draw_kinds([1]))
    with pytest.raises(kineme.errors.SpecificationError, match="expected primitives of one specification"):
        morph(primitives[0], other, 0.5)
    with pytest.raises(kineme.errors.TrajectoryError, match="same dimensions, got 2 and 3"):
        morph(primitives[0], kineme.DMP(n_basis=20).learn(draw_kinds([1], 3)), 0.5)
    with pytest.raises(kineme.errors.SpecificationError, match="expected medoid to be one of 4 members, got 4"):
        prototype(primitives, medoid=4)

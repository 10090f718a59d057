"""The conceptual space is a space: distances, neighbors, what lies between; and its map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist, squareform

import kineme
from kineme.anchoring.figures import apart
from kineme.anchoring.space import ConceptualSpace, classical_scaling, conceptual_space, morph
from kineme.recognition.recognizer import Recognizer
from kineme.similarity.specification import ComparisonSpecification
from soaking import examples
from unlabeled_samples import draw_kinds

quick = settings(max_examples=examples(4, 8), deadline=None, derandomize=True)
seeds = st.integers(0, 10_000)


@given(seed=seeds, d=st.sampled_from([1, 2, 3]))
@quick
def test_distances_without_rotation_are_a_metric(seed, d):
    space = conceptual_space(range(7), draw_kinds([1] * 7, d, seed), Recognizer(max_angle=0.0))
    D = space.distances
    np.testing.assert_array_equal(D, D.T)
    assert (np.diag(D) == 0).all()
    assert (D[:, None, :] + D.T[None, :, :] >= 0).all()
    through = (D[:, :, None] + D[None, :, :]).min(axis=1)
    assert (through + 1e-5 >= D).all()  # the triangle inequality


@given(seed=seeds)
@quick
def test_the_nearest_are_sorted_and_start_with_the_likest(seed):
    demos = draw_kinds([2, 2, 2, 2], 2, seed)
    space = conceptual_space([f"{k} {i}" for k in range(4) for i in range(2)], demos)
    for k in range(4):
        near = space.nearest(f"{k} 0", 20)
        assert near[0].symbol == f"{k} 1"
        assert len(near) == 7
        assert [one.distance for one in near] == sorted(one.distance for one in near)
        assert space.nearest(f"{k} 0", 2) == near[:2]


@given(seed=seeds, share=st.floats(0.3, 0.7))
@quick
def test_a_morph_lies_between_its_ends(seed, share):
    """And strangers, in a space of hundreds of dimensions and with rotations that are bounded, do not."""
    primitives = kineme.DMP(n_basis=20).learn(draw_kinds([1] * 6, 2, seed))
    way = morph(primitives[0], primitives[1], share)
    movements = np.concatenate((primitives.rollout().positions, way.rollout().positions))
    space = conceptual_space([*"abcdef", "between"], movements, ComparisonSpecification(max_angle=np.pi / 3))
    (first, *_) = space.between("a", "b", eps=0.5)
    assert first.symbol == "between"
    # Shapes of one size lie on a sphere: half way between opposite ones the detour is that of two sides of a square.
    assert first.excess < np.sqrt(2) - 1 + 0.05
    backwards = space.between("b", "a", eps=0.5)
    assert [one.symbol for one in backwards] == [one.symbol for one in space.between("a", "b", eps=0.5)]
    assert backwards[0].share == pytest.approx(1 - first.share)


def test_betweenness_on_a_line():
    places = np.array([0.0, 1.0, 3.0, 4.0, -1.0])
    space = ConceptualSpace(tuple("abcde"), np.abs(places[:, None] - places))
    found = space.between("a", "d", eps=0.0)
    assert {(one.symbol, one.excess, one.share) for one in found} == {("b", 0.0, 0.25), ("c", 0.0, 0.75)}
    assert space.between("a", "b") == ()


def test_questions_that_have_no_answer():
    demos = draw_kinds([1, 1, 1])
    space = conceptual_space("abc", demos)
    with pytest.raises(kineme.errors.SpecificationError, match=r"one of the symbols \['a', 'b', 'c'\], got 'z'"):
        space.nearest("z")
    with pytest.raises(kineme.errors.SpecificationError, match="expected two different symbols, got 'a' twice"):
        space.between("a", "a")
    with pytest.raises(kineme.errors.SpecificationError, match="expected eps to be a number of at least 0, got -1"):
        space.between("a", "b", eps=-1)
    with pytest.raises(kineme.errors.SpecificationError, match="got 3 prototypes for 3 symbols, 2 of them different"):
        conceptual_space("aba", demos)


@given(seed=seeds, n=st.integers(1, 9))
@quick
def test_a_map_of_the_plane_is_exact(seed, n):
    """Classical scaling of points of the plane gives their distances back."""
    points = np.random.default_rng(seed).normal(size=(n, 2))
    places, kept = classical_scaling(squareform(pdist(points)))
    np.testing.assert_allclose(pdist(places), pdist(points), atol=1e-7)
    assert kept == pytest.approx(1.0)


@given(seed=seeds)
@quick
def test_drawings_are_pushed_apart(seed):
    points = 0.1 * np.random.default_rng(seed).normal(size=(8, 2))
    points[1] = points[0]
    moved = apart(points, 0.05, rounds=2000)
    assert pdist(moved).min() >= 0.05 * 0.99
    far = np.array([[0.0, 0.0], [1.0, 0.0]])
    np.testing.assert_allclose(apart(far, 0.5), far, atol=1e-5)

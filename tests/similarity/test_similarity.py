"""The averages over representations: their order, their bounds, what is positive semi-definite."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import Recognizer
from kineme.errors import SpecificationError
from kineme.similarity.specification import LOG_MEANS, SHARES
from movement_samples import draw_shapes

any_seed = given(seed=st.integers(0, 10**6))


def _logs(seed):
    rng = np.random.default_rng(seed)
    return -rng.exponential(size=(3, 50)) * rng.choice([1.0, 30.0, 5000.0], size=(3, 50))


@any_seed
def test_means_keep_their_order_even_where_kernels_underflow(seed):
    logs = _logs(seed)
    names = ["quadratic", "arithmetic", "geometric", "harmonic", "min"]
    values = [LOG_MEANS[name](logs) for name in names]
    for larger, smaller in pairwise(values):
        assert (larger >= smaller - 1e-9).all()
    assert np.isfinite(values).all()
    assert (values[0] <= logs.max(axis=0) + 1e-9).all()


@pytest.mark.parametrize("name", LOG_MEANS)
@any_seed
def test_shares_are_the_derivatives(name, seed):
    logs, h = np.random.default_rng(seed).normal(size=(3, 20)) * 3, 1e-6
    step = np.eye(3)[:, :, None] * h
    expected = [(LOG_MEANS[name](logs + one) - LOG_MEANS[name](logs - one)) / (2 * h) for one in step]
    np.testing.assert_allclose(SHARES[name](logs), expected, atol=1e-6)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
@any_seed
def test_the_arithmetic_average_without_rotation_is_positive_semi_definite(d, seed):
    demos = draw_shapes([3] * 8, d, seed)
    gram = np.exp(Recognizer(max_angle=0.0).fit(demos).log_similarity(demos))
    assert np.linalg.eigvalsh((gram + gram.T) / 2).min() > -1e-4  # rows are held in single precision


def test_widths_need_movements_that_differ():
    with pytest.raises(SpecificationError, match="movements that differ, got one movement or all the same"):
        Recognizer().fit(np.repeat(draw_shapes([1])[0].positions[None], 3, axis=0), ["a", "b", "c"])


@pytest.mark.parametrize("each", [1, 3])
def test_movements_with_two_labels_each_are_refused_with_the_labels(each):
    first, other = [draw_shapes([each], seed=seed) for seed in (1, 2)]
    labels = [label for label in "abcd" for _ in range(each)]
    with pytest.raises(SpecificationError, match="got the same ones with 'a' and 'b'; merge the labels"):
        Recognizer().fit([*first, *first, *other, *other], labels)
    known = Recognizer().fit([*first, *first, *draw_shapes([5], seed=3)], labels[: 2 * each] + ["e"] * 5)
    assert np.isfinite(known.comparison_.similarity.widths).all()


def test_classes_that_coincide_do_not_make_the_kernels_blind():
    """N and Z are one under any rotation; another N, drawn a little differently, is still like both."""
    corners = np.array([[0, 0], [0, 1], [1, 0], [1, 1.0]])
    N = np.column_stack([np.interp(np.linspace(0, 3, 100), range(4), corners[:, k]) for k in (0, 1)])
    Z = N @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + 2e-3 * np.cos(np.linspace(0, 7, 100))[:, None]
    recognizer = Recognizer(max_angle=np.pi).fit([N, Z], ["N", "Z"])
    other = N + 0.003 * np.sin(np.linspace(0, 9, 100))[:, None]
    assert recognizer.log_similarity([other]).min() > -1

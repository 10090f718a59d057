"""What is fitted on a whole set does not depend on the set's order."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_movements import reaches, rhythms, rows
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP, Recognizer, RhythmicFeatures, styles
from kineme.kernels import KERNELS, averaged
from kineme.kernels.random_binning import RandomBinning

DRAWN = [(20 + 3 * i, i % 3 - 1, ("even", "jitter", "random")[i % 3], 0, i) for i in range(18)]
orders = st.permutations(range(18))


@given(order=orders)
def test_an_average_and_its_spread(order):
    primitives = DMP(n_basis=15).learn(reaches(DRAWN))
    one, other = styles.average(primitives), styles.average(primitives[list(order)])
    a, b = one.primitive.rollout().positions, other.primitive.rollout().positions
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-10 * np.ptp(a))
    np.testing.assert_allclose(one.deviation(), other.deviation(), rtol=1e-6)


@given(order=orders)
def test_styles(order):
    movements = reaches(DRAWN)
    dmp = DMP(n_basis=15)
    one, other = (styles.learn_styles(dmp.learn(movements[list(chosen)]), 2) for chosen in (range(18), order))
    np.testing.assert_allclose(one.singular_values[:2], other.singular_values[:2], rtol=1e-9)
    np.testing.assert_allclose(one.styles[list(order)], other.styles, atol=1e-6)


@given(order=orders)
def test_what_a_recognizer_knows(order):
    movements, order = reaches(DRAWN), list(order)
    labels = np.array([f"{i % 3}" for i in range(18)])
    unseen = reaches([(33, 0, "jitter", 0, seed) for seed in range(100, 110)])
    one, other = Recognizer().fit(movements, labels), Recognizer().fit(movements[order], labels[order])
    np.testing.assert_allclose(one.widths_, other.widths_, rtol=1e-5)
    np.testing.assert_allclose(one.predict_proba(unseen), other.predict_proba(unseen), atol=1e-4)
    np.testing.assert_allclose(one.p_values(unseen), other.p_values(unseen), atol=1e-4)


@pytest.mark.parametrize("name", KERNELS)
@given(order=orders)
def test_widths_of_kernels(name, order):
    X, order = rows(DRAWN), list(order)
    for kernel in (KERNELS[name].kernel(), averaged(KERNELS[name].kernel(), 3)):
        one, other = kernel.fit(X), kernel.fit(X[order])
        np.testing.assert_allclose(one(X)[order][:, order], other(X[order]), rtol=1e-9, atol=1e-9)


@given(order=orders)
def test_bins(order):
    X, order = rows(DRAWN), list(order)
    one, other = RandomBinning(seed=3).fit(X), RandomBinning(seed=3).fit(X[order])
    assert one.m_ == pytest.approx(other.m_, rel=1e-12)
    assert one.n_columns_ == other.n_columns_


@given(order=orders)
def test_the_dimension_that_rhythms_are_aligned_on(order):
    movements = rhythms(DRAWN)
    assert (
        RhythmicFeatures().fit(movements).dmp_.align_on == RhythmicFeatures().fit(movements[list(order)]).dmp_.align_on
    )

"""Styles that were not shown, and questions that have no answer."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, RhythmicDMP
from kineme.errors import SpecificationError, TrajectoryError
from kineme.styles import average, average_by_label, learn_styles


@pytest.fixture(scope="module")
def learned(demonstrate):
    return DMP(n_basis=15, n_points=60).learn(demonstrate(5, 30))


@pytest.fixture(scope="module")
def model(learned):
    return learn_styles(learned, 2)


def test_a_style_outside_the_demonstrated_range_is_refused_with_the_range(model):
    wish = np.vstack((model.styles[0], [model.lowest[0], model.highest[1] + 3.0]))
    shown = rf"\[{model.lowest[1]:.3g}, {model.highest[1]:.3g}\], got {model.highest[1] + 3:.3g}"
    message = rf"style 1: expected parameter 1 within the demonstrated range {shown}; .* extrapolate=True"
    with pytest.raises(SpecificationError, match=message):
        model.primitive(wish)
    with pytest.raises(SpecificationError, match=rf"style 0: expected parameter 0 .*got {model.lowest[0] - 2:.3g}"):
        model.primitive([model.lowest[0] - 2.0, 0.0])
    assert len(model.primitive(wish, extrapolate=True)) == 2
    found = model.style_of(model.primitive(wish, extrapolate=True))
    np.testing.assert_array_equal(found.inside, [True, False])
    with pytest.raises(SpecificationError, match=r"style [1-3]: expected parameter 1"):
        model.interpolate(wish[0], wish[1], 4)
    assert len(model.interpolate(wish[0], wish[1], 4, extrapolate=True)) == 4


def test_demonstrated_styles_and_the_edges_are_inside(model):
    for wish in (model.styles, model.lowest, model.highest, [0.0, 0.0]):
        made = model.primitive(wish)
        again = model.style_of(made)
        assert len(made) == len(np.atleast_2d(wish))
        assert again.inside.all()
        np.testing.assert_allclose(again.styles, np.atleast_2d(wish), atol=1e-6 * np.abs(model.highest).max())
        np.testing.assert_array_equal(made.scaled_weights, model.primitive(wish, extrapolate=True).scaled_weights)


def test_styles_of_the_wrong_shape(model):
    with pytest.raises(SpecificationError, match=r"style of shape \(2,\) or \(m, 2\), got shape \(3,\)"):
        model.primitive([1.0, 2.0, 3.0])
    with pytest.raises(SpecificationError, match=r"got shape \(1, 1, 2\)"):
        model.primitive([[[1.0, 2.0]]])
    with pytest.raises(SpecificationError, match=r"style 1: expected finite numbers, got \[nan, 0.0\]"):
        model.primitive([[0.0, 0.0], [np.nan, 0.0]])
    with pytest.raises(SpecificationError, match="expected one style at each end, got 2 and 1"):
        model.interpolate(model.styles[:2], model.styles[0], 3)
    with pytest.raises(SpecificationError, match="n to be a whole number of at least 2, got 1"):
        model.interpolate(model.styles[0], model.styles[1], 1)


def test_how_many_styles_there_can_be(learned):
    with pytest.raises(SpecificationError, match=r"n_styles of at most 4, .* got 5; demonstrate more"):
        learn_styles(learned, 5)
    with pytest.raises(SpecificationError, match="n_styles to be a whole number of at least 1, got 0"):
        learn_styles(learned, 0)
    with pytest.raises(SpecificationError, match=r"either n_styles or variance, got 2 and 0\.9"):
        learn_styles(learned, 2, variance=0.9)
    with pytest.raises(SpecificationError, match="variance to be at most 1, a share, got 95"):
        learn_styles(learned, variance=95)
    with pytest.raises(SpecificationError, match="variance to be a number above 0, got 0"):
        learn_styles(learned, variance=0)
    with pytest.raises(SpecificationError, match=r"metric to be one of \['path', 'forcing'\], got 'cosine'"):
        learn_styles(learned, 2, metric="cosine")


def test_what_has_no_styles(learned):
    with pytest.raises(TrajectoryError, match="at least 2 demonstrations to learn styles from, got 1"):
        learn_styles(learned[0])
    with pytest.raises(TrajectoryError, match="demonstrations that differ in shape, got copies of one movement"):
        learn_styles(learned[[1, 1, 1]])


def test_copies_in_other_places_are_copies(make_movement):
    x = make_movement(31)[1]
    with pytest.raises(TrajectoryError, match="place and tempo are no style"):
        learn_styles(DMP(n_basis=15).learn([x, x + 1000.0, x - 3.0]))


def test_a_new_demonstration_of_another_kind(model, learned, make_movement):
    with pytest.raises(SpecificationError, match=r"own specification, DMP\(.*n_basis=15.*, got DMP\(.*n_basis=16"):
        model.style_of(DMP(n_basis=16, n_points=60).learn([make_movement(1)[1]]))
    with pytest.raises(SpecificationError, match="movements of 2 dimensions, got 3"):
        model.style_of([make_movement(1, 3)[1]])


@pytest.mark.parametrize("function", [average, average_by_label, learn_styles])
def test_rhythms_are_no_demonstrations_of_one_movement(demonstrate, function):
    rhythms = RhythmicDMP(aperiodic="accept").learn(demonstrate(5, 30))
    with pytest.raises(
        TrajectoryError, match=r"expected kineme\.dmp\.Primitives, got RhythmicPrimitives; learn movements"
    ):
        function(rhythms)

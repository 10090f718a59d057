"""RhythmicFeatures as scikit-learn uses it, and as kernels see it."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline

from kineme import Demonstrations, RhythmicDMP, RhythmicFeatures, Trajectory
from kineme.errors import TrajectoryError


def _circle_or_eight(kind, rng):
    """Both dimensions of a circle are equally wide: noise decides which is wider."""
    u = np.linspace(0, rng.uniform(1.6, 4.0), 120) + rng.uniform()
    x = np.column_stack((np.cos(2 * np.pi * u), np.sin(2 * np.pi * u * (2 if kind == "eight" else 1))))
    return Trajectory(rng.uniform(0.5, 2) * u, x + 0.02 * rng.normal(size=x.shape) + rng.normal(size=2), kind)


@pytest.fixture(scope="module")
def demos():
    rng = np.random.default_rng(0)
    return Demonstrations([_circle_or_eight(kind, rng) for kind in ["circle", "eight"] * 8])


@pytest.mark.parametrize("feature", ["shape-attractor", "forcing", "weights"])
def test_rhythms_are_told_apart_wherever_they_begin(demos, feature):
    model = make_pipeline(RhythmicFeatures(feature, n_samples=40), KNeighborsClassifier(1))
    assert cross_val_score(model, demos, demos.labels, cv=4).min() == 1.0


def test_rows_are_the_primitives_features_dimension_after_dimension(demos):
    transformer = RhythmicFeatures("forcing", RhythmicDMP(align_on=0), n_samples=30)
    rows = transformer.fit_transform(demos)
    learned = RhythmicDMP(align_on=0).learn(demos)
    np.testing.assert_array_equal(rows, learned.forcing(30).transpose(0, 2, 1).reshape(len(demos), -1))
    assert transformer.get_feature_names_out()[[0, 30]].tolist() == ["x_1", "y_1"]
    assert len(RhythmicFeatures("weights").fit(demos).get_feature_names_out()) == 2 * 25


def test_dimensions_that_are_alike_do_not_take_turns(demos):
    """Circles alone: each on its own may be aligned on either dimension, all together on one."""
    circles = demos[demos.labels == "circle"]
    assert len(set(RhythmicDMP().learn(circles).aligned_on)) == 2
    rows = RhythmicFeatures("forcing").fit_transform(circles)
    each = RhythmicDMP().learn(circles).forcing().transpose(0, 2, 1).reshape(len(circles), -1)
    apart, each_apart = (np.sqrt(np.mean((x - x.mean(axis=0)) ** 2)) for x in (rows, each))
    assert apart < 0.15 * np.sqrt(np.mean(rows**2)) < 0.5 * each_apart


def test_parameters_are_passed_on_and_cloned(demos):
    choices = {"n_basis": 9, "stiffness": 50.0, "damping": 9.0, "fit": "forcing", "ridge": 1e-3, "n_points": 70}
    choices |= {"overlap": 0.4, "align_on": 1, "aperiodic": "accept", "preprocessing": (), "period": 0.4}
    assert clone(RhythmicFeatures(dmp=RhythmicDMP(**choices))).fit(demos).dmp_ == RhythmicDMP(**choices)
    nested = {f"dmp__{name}": value for name, value in choices.items()}
    assert clone(RhythmicFeatures().set_params(**nested)).fit(demos).dmp_ == RhythmicDMP(**choices)
    with pytest.raises(TypeError, match="no parameter 'period'; those of the primitive are set by"):
        RhythmicFeatures(period=0.4)


def test_other_dimensions_and_types(demos):
    transformer = RhythmicFeatures(dtype="float32").fit(demos)
    assert transformer.transform(demos).dtype == np.float32
    with pytest.raises(TrajectoryError, match="expected movements of 2 dimensions as learned, got 1"):
        transformer.transform([np.sin(np.linspace(0, 20, 90))])

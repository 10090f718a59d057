"""Features of orientations and poses: what leaves them unchanged, what turns them, how radians are weighed."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline

from kineme import DMP, DMPFeatures, Smooth
from kineme.errors import SpecificationError, TrajectoryError
from kineme.orientation import PoseFeatures, product, to_tangent
from rotation_samples import as_rotation, carry, random_quaternions, seeds, tumble


def blocks(rows, n_vectors):
    return rows.reshape(len(rows), n_vectors, 3, -1)


def agree(actual, expected):
    np.testing.assert_allclose(actual, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("feature", ["shape-attractor", "forcing", "weights"])
def test_they_are_the_dmp_features_of_the_rotation_vectors(feature):
    q = [tumble(seed) for seed in range(4)]
    agree(PoseFeatures(DMPFeatures(feature)).fit_transform(q), DMPFeatures(feature).fit_transform(to_tangent(q)[0]))


@given(seeds)
def test_signs_and_the_mounting_of_the_tool_leave_them_unchanged(seed):
    q, c = tumble(seed), random_quaternions(seed)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(q), 1))
    features = PoseFeatures().fit_transform([q, q * signs, product(q, c)])
    agree(features[1:], features[[0, 0]])


@pytest.mark.parametrize("feature", ["shape-attractor", "forcing", "weights"])
@given(seeds)
def test_a_turned_scene_turns_them(feature, seed):
    pose, c = carry(seed), random_quaternions(seed)
    turned = np.concatenate((as_rotation(c).apply(pose[:, :3]), product(c, pose[:, 3:])), axis=1)
    before, after = blocks(PoseFeatures(DMPFeatures(feature)).fit_transform([pose, turned]), 2)
    agree(after, np.einsum("ij,vjs->vis", as_rotation(c).as_matrix(), before))


def test_the_weight_scales_radians_and_millimeters_need_a_thousand_times_it():
    poses = np.stack([carry(seed) for seed in range(3)])
    plain, weighted = (blocks(PoseFeatures(orientation_weight=w).fit_transform(poses), 2) for w in (1.0, 0.3))
    agree(weighted, plain * np.array([1.0, 0.3])[:, None, None])
    in_mm = poses * np.array([1000.0] * 3 + [1.0] * 4)
    agree(PoseFeatures(orientation_weight=200.0).fit_transform(in_mm), 1000 * PoseFeatures().fit_transform(poses))


def test_preprocessing_is_applied_once():
    q, steps = [tumble(0)], (Smooth(8.0),)
    smoothed = DMPFeatures().fit_transform(to_tangent(q, steps)[0])
    agree(PoseFeatures(DMPFeatures(dmp=DMP(preprocessing=steps))).fit_transform(q), smoothed)


def test_they_recognize_orientation_gestures_in_a_pipeline():
    rng = np.random.default_rng(0)
    labels = np.repeat(np.arange(6), 4)
    q = [product(tumble(k, 60 + 5 * i), random_quaternions(rng.integers(100))) for i, k in enumerate(labels)]
    model = clone(make_pipeline(PoseFeatures(DMPFeatures(dmp=DMP(n_basis=30))), KNeighborsClassifier(1)))
    model.set_params(posefeatures__features__n_samples=40)
    assert model.fit(q[::2], labels[::2]).score(q[1::2], labels[1::2]) == 1.0
    names = model[0].get_feature_names_out()
    assert (len(names), names[0], names[-1]) == (120, "rx_1", "rz_40")
    assert PoseFeatures().fit([carry(0)]).get_feature_names_out()[300] == "rx_1"


def test_known_columns_come_in_the_units_of_the_fit():
    x = carry(0)
    columns = {"time": np.arange(len(x)) / 50, **dict(zip(("qw", "qx", "qy", "qz"), x[:, 3:].T, strict=True))}
    millimeters, meters = (
        pd.DataFrame(columns | {f"{axis} [{unit}]": x[:, i] * factor for i, axis in enumerate("xyz")})
        for unit, factor in (("mm", 1000), ("m", 1))
    )
    features = PoseFeatures().fit(millimeters)
    agree(features.transform(meters), features.transform(millimeters))


def test_parameters_of_the_features_are_searched_without_any_given():
    poses = [carry(seed) for seed in range(8)]
    model = make_pipeline(PoseFeatures(), KNeighborsClassifier(1))
    grid = {"posefeatures__features__dmp__n_basis": [7, 9], "posefeatures__features__n_samples": [6]}
    search = GridSearchCV(model, grid, cv=2).fit(poses, [0, 1] * 4)
    found = search.best_estimator_[0].features_
    assert (found.dmp_.n_basis in (7, 9), found.n_samples) == (True, 6)
    parameters = PoseFeatures().get_params()
    assert {"features", "orientation_weight", "features__feature", "features__dmp__n_basis"} <= set(parameters)
    assert clone(PoseFeatures()).features is None
    given = DMPFeatures(n_samples=5)
    PoseFeatures().set_params(features=given, features__n_samples=6)
    assert given.n_samples == 6
    assert PoseFeatures(given).set_params(features=None, features__n_samples=7).features.n_samples == 7
    with pytest.raises(ValueError, match="basis"):
        PoseFeatures().set_params(features__basis=3)


def test_wrong_input_is_refused():
    with pytest.raises(SpecificationError, match="expected orientation_weight to be a number above 0, got -1"):
        PoseFeatures(orientation_weight=-1).fit([carry(0)])
    with pytest.raises(TrajectoryError, match="expected movements of 7 columns as in fit, got 4"):
        PoseFeatures().fit([carry(0)]).transform([tumble(0)])

"""DMPFeatures as scikit-learn's searches, pipelines and cross-validations use it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import Pipeline, make_pipeline

from kineme import DMP, Demonstrations, DMPFeatures, Smooth, TrimRest
from kineme.errors import DegenerateMovementError, KinemeError, SpecificationError, TrajectoryError

FEATURES = ("shape-attractor", "forcing", "weights")


@pytest.fixture(scope="module")
def demos(make_movement):
    """Three classes of five noisy, ragged movements."""
    rng = np.random.default_rng(0)
    arrays, times, labels = [], [], []
    for label in range(3):
        for take in range(5):
            t, x = make_movement(label, n_samples=50, even=False)
            x = x[: 50 - take // 3]
            arrays.append(x * rng.uniform(0.9, 1.1) + rng.normal(size=2))
            times.append(t[: len(x)] * rng.uniform(0.5, 2))
            labels.append("abc"[label])
    return Demonstrations.from_arrays(arrays, labels, times)


@pytest.mark.parametrize("feature", FEATURES)
def test_rows_are_eq_9_dimension_after_dimension(demos, feature):
    rows = DMPFeatures(feature, DMP(n_basis=12), n_samples=20).fit_transform(demos)
    learned = DMP(n_basis=12).learn(demos)
    values = {
        "weights": learned.weights,
        "forcing": learned.forcing(20),
        "shape-attractor": learned.shape_attractor(20),
    }
    for row, by_time in zip(rows, values[feature], strict=True):
        x, y = by_time[:, 0], by_time[:, 1]
        np.testing.assert_array_equal(row, [*x, *y])


CHOICES = {
    "formulation": "original", "n_basis": 9, "stiffness": 50.0, "damping": 9.0, "gating": "phase", "fit": "forcing",
    "regression": "ridge", "ridge": 1e-3, "phase_end": 0.02, "overlap": 0.5, "n_points": 70,
    "preprocessing": (TrimRest(), Smooth(9.0)),
}  # fmt: skip


def test_every_field_of_the_specification_is_a_parameter(demos):
    assert list(CHOICES) == [field.name for field in fields(DMP)]
    features = DMPFeatures().set_params(**{f"dmp__{name}": value for name, value in CHOICES.items()})
    assert features.fit(demos).dmp_ == DMP(**CHOICES)
    assert features.get_params() == {
        "feature": "shape-attractor", "dmp": DMP(**CHOICES), "n_samples": 100, "dtype": "float64",
        **{f"dmp__{name}": value for name, value in CHOICES.items()},
    }  # fmt: skip


def test_setting_a_field_leaves_the_specification_that_was_given():
    dmp = DMP("original")
    first, second = DMPFeatures(dmp=dmp), DMPFeatures(dmp=dmp)
    first.set_params(dmp__n_basis=7)
    assert (first.dmp.n_basis, second.dmp.n_basis, dmp.n_basis) == (7, 40, 40)


def test_names_that_are_no_parameters_are_refused():
    with pytest.raises(TypeError, match="DMPFeatures has no parameter 'basis'"):
        DMPFeatures(basis=9)
    with pytest.raises(ValueError, match="Invalid parameter 'basis'"):
        DMPFeatures().set_params(basis=9)
    with pytest.raises(ValueError, match=r"DMP has no parameter 'basis'; it has \['formulation', 'n_basis'"):
        DMPFeatures().set_params(dmp__basis=9)
    with pytest.raises(SpecificationError, match=r"expected dmp to be a kineme.DMP, got 80; write DMPFeatures"):
        DMPFeatures(dmp=80).fit([np.eye(5)])


def test_rows_come_as_a_data_frame_where_asked(demos):
    pytest.importorskip("pandas")
    frame = DMPFeatures(n_samples=6).set_output(transform="pandas").fit_transform(demos)
    assert frame.shape == (15, 12)
    assert list(frame.columns[[0, 6]]) == ["x_1", "y_1"]


def test_defaults_are_those_of_the_specification(demos):
    assert DMPFeatures().fit(demos).dmp_ == DMP()


def test_cloning_keeps_parameters_and_forgets_the_fit(demos):
    features = DMPFeatures("weights", DMP("original", 7, preprocessing=(TrimRest(0.02),))).fit(demos)
    copy = clone(features)
    assert copy.get_params() == features.get_params()
    assert not hasattr(copy, "dmp_")


def test_parameters_are_set_by_name(demos):
    features = DMPFeatures().set_params(feature="weights", dmp__n_basis=11)
    assert features.fit_transform(demos).shape == (15, 22)


@pytest.mark.soak
def test_a_grid_search_over_features_formulations_and_sizes_runs(demos):
    model = Pipeline([("features", DMPFeatures()), ("classify", KNeighborsClassifier(1))])
    grid = {
        "features__feature": FEATURES,
        "features__dmp__formulation": ["original", "bio-inspired"],
        "features__dmp__n_basis": [8, 16],
    }
    search = GridSearchCV(model, grid, cv=2, error_score="raise").fit(demos, demos.labels)
    assert len(search.cv_results_["params"]) == 12
    assert search.best_score_ == 1.0


def test_demonstrations_and_a_list_of_arrays_cross_validate_alike(demos):
    block = [one.positions for one in demos]
    model = make_pipeline(DMPFeatures(dmp=DMP(n_basis=15)), KNeighborsClassifier(1))
    scores = cross_val_score(model, demos, demos.labels, cv=3, error_score="raise")
    assert scores.tolist() == [1.0, 1.0, 1.0]
    assert cross_val_score(model, block, demos.labels, cv=3, error_score="raise").tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(("n_dims", "axes"), [(1, "x"), (2, "xy"), (3, "xyz"), (4, ["x1", "x2", "x3", "x4"])])
@pytest.mark.parametrize("feature", FEATURES)
def test_names_say_axis_and_number_of_each_column(make_movement, feature, n_dims, axes):
    features = DMPFeatures(feature, DMP(n_basis=5), n_samples=6)
    rows = features.fit_transform([make_movement(0, n_dims)[1]])
    size = 5 if feature == "weights" else 6
    assert features.get_feature_names_out().tolist() == [f"{axis}_{k}" for axis in axes for k in range(1, size + 1)]
    assert rows.shape == (1, n_dims * size)


def test_names_belong_to_the_fit(demos):
    features = DMPFeatures("weights", DMP(n_basis=5)).fit(demos)
    features.set_params(dmp__n_basis=50)
    assert len(features.get_feature_names_out()) == features.transform(demos).shape[1]


@pytest.mark.parametrize("changed", [{"feature": "weights", "dmp__n_basis": 9}, {"n_samples": 7}, {"dtype": "float32"}])
def test_parameters_are_in_force_from_the_next_fit(demos, changed):
    features = DMPFeatures(n_samples=20).fit(demos)
    before, names = features.transform(demos), features.get_feature_names_out()
    features.set_params(**changed)
    np.testing.assert_array_equal(features.transform(demos), before, strict=True)
    assert features.get_feature_names_out().tolist() == names.tolist()
    features.set_params(feature="no feature").transform(demos)


def test_the_default_output_can_be_asked_for(demos):
    features = DMPFeatures(n_samples=6).set_output(transform="default")
    assert isinstance(features.fit_transform(demos), np.ndarray)


def test_fitting_again_forgets(demos, make_movement):
    other = [make_movement(0, 3)[1]]
    features = DMPFeatures(n_samples=6).fit(demos)
    assert features.fit(other).transform(other).shape == (1, 18)


@pytest.mark.parametrize("method", ["transform", "get_feature_names_out"])
def test_an_unfitted_transformer_says_so(demos, method):
    with pytest.raises(NotFittedError, match="DMPFeatures instance is not fitted yet"):
        getattr(DMPFeatures(), method)(*[demos] * (method == "transform"))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_type_of_the_rows_is_chosen(demos, dtype):
    assert DMPFeatures(dtype=dtype).fit_transform(demos).dtype == dtype


def test_single_precision_is_the_rounded_double(demos):
    double = DMPFeatures().fit_transform(demos)
    np.testing.assert_array_equal(DMPFeatures(dtype="float32").fit_transform(demos), double.astype(np.float32))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"feature": "f"}, r"feature to be one of \['shape-attractor', 'forcing', 'weights'\], got 'f'"),
        ({"n_samples": 1}, "n_samples to be a whole number of at least 2, got 1"),
        ({"dtype": "int"}, r"dtype to be one of \['float64', 'float32'\], got 'int'"),
    ],
)
def test_parameters_out_of_range_are_refused_in_fit(demos, parameters, message):
    features = DMPFeatures(**parameters)  # the constructor takes anything, as scikit-learn wants it
    with pytest.raises(SpecificationError, match=message):
        features.fit(demos)


def test_movements_of_other_dimensions_are_refused(demos, make_movement):
    features = DMPFeatures().fit(demos)
    with pytest.raises(TrajectoryError, match="expected movements of 2 dimensions as learned, got 3; select"):
        features.transform([make_movement(0, 3)[1]])


@pytest.mark.parametrize("columns", [{"x [m]": 0.001, "y [m]": 0.001}, {"y [mm]": 1.0, "x [mm]": 1.0}])
def test_known_columns_come_in_the_order_and_units_of_the_fit(make_movement, columns):
    t, x = make_movement(1, 2)
    learned = pd.DataFrame({"t": t, "x [mm]": x[:, 0], "y [mm]": x[:, 1]})
    factor = {"x [m]": x[:, 0], "x [mm]": x[:, 0], "y [m]": x[:, 1], "y [mm]": x[:, 1]}
    other = pd.DataFrame({"t": t} | {name: factor[name] * unit for name, unit in columns.items()})
    features = DMPFeatures().fit(learned)
    np.testing.assert_allclose(features.transform(other), features.transform(learned), rtol=1e-9)


def test_closed_movements_are_refused_where_the_feature_divides(demos):
    u = np.linspace(0, 2 * np.pi, 60)
    loop = [np.column_stack((np.sin(u), np.cos(u)))]
    with pytest.raises(DegenerateMovementError, match=r'trajectory 0: .*use feature "shape-attractor"'):
        DMPFeatures("weights", DMP("original")).fit(demos).transform(loop)
    assert np.isfinite(DMPFeatures("shape-attractor", DMP("original")).fit(demos).transform(loop)).all()


def test_errors_are_those_of_kineme(demos):
    with pytest.raises(KinemeError):
        DMPFeatures().fit(demos).transform([])

"""Movements as a function of the task: what is learned, how it is chosen, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

import kineme
from kineme import DMP, Trajectory
from kineme.dmp import Contextual
from kineme.dmp.contextual import Smoother, solve
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError, TrajectoryError

U = np.linspace(0.0, 1.0, 120)


def lift(height, end=1.0):
    """Over an obstacle of that height; the logarithm of the duration rises with it."""
    bow = height * np.sin(np.pi * U) ** 2
    return Trajectory(np.exp(2.0 * height) * U, np.column_stack((end * U, bow, 0.2 * U**2)))


def curved(angle):
    """Depends on its parameter as sines do."""
    return np.column_stack((np.cos(2.0 * angle) * U, np.sin(3.0 * angle) * np.sin(np.pi * U) ** 2 + U))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_movement_between_two_heights_is_the_one_that_was_meant(formulation):
    heights = np.array([0.1, 0.3, 0.5, 0.9])
    model = Contextual(DMP(formulation)).fit([lift(h) for h in heights], parameters=heights)
    assert model.smoother_.name == "linear"
    primitive = model.primitive(0.37)
    expected = DMP(formulation).learn([lift(0.37)]).rollout().positions
    np.testing.assert_allclose(primitive.rollout().positions, expected, atol=1e-3)
    assert primitive.durations[0] == pytest.approx(np.exp(0.74), rel=1e-6)
    assert model.leave_one_out_error_ < 1e-3 < model.errors_["average"]


def test_several_parameters():
    rng = np.random.default_rng(0)
    tasks = rng.uniform([0.1, 0.5], [0.5, 2.0], size=(8, 2))
    model = Contextual().fit([lift(h, end) for h, end in tasks], tasks)
    asked = tasks[:3].mean(axis=0)
    path = model.primitive(asked).rollout(n_samples=120).positions[0]
    np.testing.assert_allclose(path, lift(*asked).positions, atol=2e-3)
    assert len(model.primitive(tasks)) == 8


def test_the_gaussian_process_is_chosen_where_it_predicts_better():
    angles = np.linspace(0.0, 2.0, 9)
    model = Contextual().fit([curved(a) for a in angles], angles)
    assert model.smoother_.name == "gaussian-process"
    assert model.errors_["gaussian-process"] < 0.1 * model.errors_["linear"]
    path = model.primitive(0.9).rollout(n_samples=120).positions[0]
    np.testing.assert_allclose(path, curved(0.9), atol=0.01)
    forced = Contextual(regression="linear").fit([curved(a) for a in angles], angles)
    assert forced.smoother_ == Smoother("linear")
    assert forced.leave_one_out_error_ == pytest.approx(model.errors_["linear"])


def test_the_leave_one_out_error_is_that_of_learning_again_without_one():
    angles = np.linspace(0.0, 2.0, 7) ** 1.3
    shown = [curved(a) for a in angles]
    for options in ({"regression": "linear"}, {"regression": "gaussian-process", "length_scale": 0.7, "noise": 1e-3}):
        model = Contextual(**options).fit(shown, angles)
        for i in (0, 3, 6):
            rest = np.arange(7) != i
            X = ((angles - model.center_) / model.scale_)[:, None]
            theta = kineme.DMP().learn(shown).rollout().positions
            weights = solve(model.smoother_, X[rest]).weights(X[i : i + 1])[0]
            error = np.tensordot(weights, theta[rest], axes=1) - theta[i]
            expected = np.sqrt(np.mean(np.sum(error**2, axis=1)))
            assert model.leave_one_out_errors_[i] == pytest.approx(expected, rel=1e-4)
        assert model.leave_one_out_error_ == pytest.approx(np.sqrt(np.mean(model.leave_one_out_errors_**2)))


def test_weights_of_the_gaussian_process_are_those_of_the_formula():
    """The mean given the demonstrations, with the trend's coefficients of a prior without bounds."""
    rng = np.random.default_rng(0)
    X, asked, y = rng.normal(size=(9, 2)), rng.normal(size=(4, 2)), rng.normal(size=9)
    found = solve(Smoother("gaussian-process", 1.5, 0.01), X).weights(asked) @ y
    wide = 1e6

    def k(a, b):
        apart = ((a[:, None] - b[None]) ** 2).sum(axis=2)
        return np.exp(-apart / (2 * 1.5**2)) + wide * (1.0 + a @ b.T)

    expected = k(asked, X) @ np.linalg.solve(k(X, X) + 0.01 * np.eye(9), y)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_units_of_parameters_and_order_of_demonstrations_do_not_matter():
    angles = np.linspace(0.0, 2.0, 9)
    model = Contextual().fit([curved(a) for a in angles], angles)
    path = model.primitive(0.7).rollout().positions
    order = np.random.default_rng(0).permutation(9)
    other = Contextual().fit([curved(a) for a in angles[order]], 1000.0 * angles[order] + 5.0)
    np.testing.assert_allclose(other.primitive(705.0).rollout().positions, path, atol=1e-6)


def test_outside_the_demonstrated_range_it_says_how_far():
    heights = np.array([0.1, 0.2, 0.3, 0.4])
    model = Contextual().fit([lift(h) for h in heights], heights)
    message = r"parameters 1: expected parameter 0 within the demonstrated range \[0.1, 0.4\], got 0.55, 0.15 or 50 %"
    with pytest.raises(SpecificationError, match=message):
        model.primitive([0.2, 0.55])
    assert model.primitive([0.2, 0.55], extrapolate=True).rollout().positions[1, :, 1].max() == pytest.approx(
        0.55, rel=0.01
    )
    assert len(model.primitive(heights)) == 4  # the ends are inside


def test_it_is_an_estimator_as_scikit_learn_has_them():
    model = Contextual(DMP(n_basis=12), "linear", noise=0.1)
    assert model.get_params() == {"dmp": DMP(n_basis=12), "regression": "linear", "length_scale": None, "noise": 0.1}
    copy = clone(model).set_params(regression="auto")
    assert (copy.regression, model.regression) == ("auto", "linear")
    heights = np.array([0.1, 0.2, 0.3])
    demos = [lift(h) for h in heights]
    assert model.fit(demos, heights) is model
    learned = DMP(n_basis=12).learn(demos)
    np.testing.assert_array_equal(
        clone(model).fit(learned, heights).primitive(0.2).scaled_weights, model.primitive(0.2).scaled_weights
    )
    with pytest.raises(NotFittedError):
        Contextual().primitive(0.2)


def test_what_cannot_be_is_refused():
    demos, heights = [lift(h) for h in (0.1, 0.2, 0.3)], [0.1, 0.2, 0.3]
    wrong = {
        r"shape \(3,\) or \(3, k\).*got shape \(2,\)": [0.1, 0.2],
        r"parameters 1: expected finite": [0.1, np.nan, 0.3],
        r"at least 4 demonstrations for 2 parameters.*got 3": [[0.1, 1], [0.2, 0], [0.3, 5]],
        r"parameter 0 to differ between demonstrations, got 0.5": [0.5, 0.5, 0.5],
        r"all demonstrations but one.*got demonstration 1 alone": [0.5, 0.6, 0.5],
    }
    for message, parameters in wrong.items():
        with pytest.raises(TrajectoryError, match=message):
            Contextual().fit(demos, parameters)
    with pytest.raises(TrajectoryError, match="none follows from the others"):
        Contextual().fit([lift(h) for h in (0.1, 0.2, 0.3, 0.4)], [[1, 2], [2, 4], [3, 6], [4, 8]])
    with pytest.raises(TrajectoryError, match=r"expected kineme.dmp.Primitives, got RhythmicPrimitives"):
        Contextual().fit(kineme.RhythmicDMP().learn([np.sin(np.linspace(0, 20, 200))]), [1.0])
    with pytest.raises(SpecificationError, match="expected regression to be one of"):
        Contextual(regression="cubic").fit(demos, heights)
    with pytest.raises(SpecificationError, match="expected noise to be a number above 0"):
        Contextual(noise=0.0).fit(demos, heights)
    with pytest.raises(SpecificationError, match="expected primitives of the specification"):
        Contextual(DMP(n_basis=9)).fit(DMP().learn(demos), heights)
    model = Contextual().fit(demos, heights)
    with pytest.raises(TrajectoryError, match=r"expected parameters of shape \(1,\) or \(m, 1\), got shape \(1, 2\)"):
        model.primitive([[0.1, 0.2]])

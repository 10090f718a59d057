"""Closed and flat movements: g = x0 in a dimension."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from kineme import DMP, Trajectory
from kineme.errors import DegenerateMovementError, DegenerateMovementWarning

U = np.linspace(0, 1, 100)
CLOSED = np.column_stack((U, np.sin(2 * np.pi * U)))
FLAT = np.column_stack((np.sin(2 * U), np.full(100, 3.0)))


@pytest.mark.parametrize("path", [CLOSED, FLAT], ids=["closed", "flat"])
def test_closed_and_flat_movements_replay(dmp, path):
    replay = dmp.learn([path]).rollout(n_samples=100).positions[0]
    assert np.abs(replay - path).max() < 0.12  # of a movement of size 2, 15 basis functions


@pytest.mark.parametrize("path", [CLOSED, FLAT], ids=["closed", "flat"])
def test_closed_and_flat_movements_have_a_shape_attractor(dmp, path):
    term = dmp.learn([path]).shape_attractor()[0]
    assert np.isfinite(term).all()
    assert np.abs(term[:, 0]).max() > 1


def test_a_flat_dimension_has_nothing_to_attract(dmp):
    term = dmp.learn([FLAT]).shape_attractor()[0]
    np.testing.assert_allclose(term[:, 1], 0, atol=1e-6 * np.abs(term[:, 0]).max())


@pytest.mark.parametrize("path", [CLOSED, FLAT], ids=["closed", "flat"])
@pytest.mark.parametrize("feature", ["weights", "forcing"])
def test_the_original_formulation_refuses_to_divide_by_nothing(dividing_dmp, path, feature):
    learned = dividing_dmp.learn([Trajectory(U, CLOSED[:, [0, 0]]), Trajectory(U, path, name="loop")])
    message = (
        r"trajectory 1 \('loop'\): expected g != x0 in every dimension, got equal start and goal in dimension 1 "
        rf"\(1 of 2 movements are closed or flat\).*to get {feature}.*\"shape-attractor\".*\"bio-inspired\""
    )
    with pytest.raises(DegenerateMovementError, match=message):
        _ = learned.weights if feature == "weights" else learned.forcing()


def test_features_of_eq_4_exist_for_closed_and_flat_movements(turning_dmp):
    learned = turning_dmp.learn([CLOSED, FLAT])
    assert np.isfinite(learned.weights).all()
    assert np.isfinite(learned.forcing()).all()


@pytest.mark.parametrize("feature", ["weights", "forcing"])
def test_almost_closed_movements_warn_once_with_their_count(feature):
    almost = CLOSED + 0.004 * np.column_stack((U, U))
    learned = DMP("original").learn([CLOSED[:, [0, 0]], almost, almost])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        _ = learned.weights if feature == "weights" else learned.forcing()
    assert [w.category for w in caught] == [DegenerateMovementWarning]
    message = str(caught[0].message)
    assert message.startswith("2 of 3 movements end within 1 % of their extent from where they start")
    assert f"(first: trajectory 1); their {feature} are large" in message
    assert caught[0].filename == __file__


def test_a_movement_of_one_per_cent_and_more_does_not_warn():
    learned = DMP("original").learn([CLOSED + 0.03 * np.column_stack((U, U))])
    assert np.isfinite(learned.weights).all()  # a warning would be an error here

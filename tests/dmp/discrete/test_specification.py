"""Every choice is checked when it is made, and the message lists what there is."""

from __future__ import annotations

import re

import numpy as np
import pytest

from kineme import DMP
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError, TrajectoryError

NAN = float("nan")
OUT_OF_RANGE = [
    ({"formulation": "hoffmann"}, f"formulation to be one of {list(FORMULATIONS)}, got 'hoffmann'"),
    ({"formulation": None}, "formulation to be one of"),
    ({"fit": "lwr"}, "fit to be one of ['forcing', 'trajectory'], got 'lwr'"),
    ({"regression": "lasso"}, "regression to be one of ['local', 'ridge'], got 'lasso'"),
    ({"gating": "s"}, "gating to be one of ['none', 'phase'], got 's'"),
    ({"n_basis": 1, "fit": "forcing"}, "n_basis to be a whole number of at least 2, got 1"),
    ({"n_basis": 8.0}, "n_basis to be a whole number of at least 3, got 8.0"),
    ({"n_basis": "80"}, "n_basis to be a whole number of at least 3, got '80'"),
    ({"n_basis": 2}, "n_basis to be a whole number of at least 3, got 2"),
    ({"stiffness": 0}, "stiffness to be a number above 0, got 0"),
    ({"stiffness": NAN}, "stiffness to be a number above 0, got nan"),
    ({"stiffness": float("inf")}, "stiffness to be a number above 0, got inf"),
    ({"stiffness": "100"}, "stiffness to be a number above 0, got '100'"),
    ({"stiffness": True}, "stiffness to be a number above 0, got True"),
    ({"stiffness": None}, "stiffness to be a number above 0, got None"),
    ({"damping": -1.0}, "damping to be a number above 0, got -1.0"),
    ({"ridge": -1e-9}, "ridge to be a number of at least 0, got -1e-09"),
    ({"phase_end": 0.0}, "phase_end to be a number above 0, got 0.0"),
    ({"phase_end": 1.0}, "phase_end to be between 1e-100 and 0.999, got 1.0"),
    ({"phase_end": 1e-300}, "phase_end to be between 1e-100 and 0.999, got 1e-300"),
    ({"phase_end": "0.01"}, "phase_end to be a number above 0, got '0.01'"),
    ({"overlap": 0.0}, "overlap to be a number above 0 and below 1, got 0.0"),
    ({"overlap": 1.0}, "overlap to be a number above 0 and below 1, got 1.0"),
    ({"n_points": 9}, "n_points to be a whole number of at least 10, got 9"),
]


@pytest.mark.parametrize(("parameters", "message"), OUT_OF_RANGE, ids=[str(case[0]) for case in OUT_OF_RANGE])
def test_a_parameter_out_of_range_is_refused(parameters, message):
    with pytest.raises(SpecificationError, match=re.escape(message)):
        DMP(**parameters)


def test_numbers_of_numpy_are_numbers():
    dmp = DMP(n_basis=np.int64(8), stiffness=np.float32(25.0), damping=np.int32(9))
    assert (dmp.n_basis, dmp.K, dmp.D) == (8, 25.0, 9.0)


def test_the_spring_is_critically_damped_by_default():
    assert pytest.approx(12.0) == DMP(stiffness=36.0).D


def test_specifications_are_values():
    assert DMP("original", 20) == DMP("original", 20, preprocessing=[])
    assert len({DMP(), DMP(), DMP("original")}) == 2
    with pytest.raises(AttributeError):
        DMP().n_basis = 3


@pytest.mark.parametrize("stiffness", [1e-3, 1e3, 1e7])
def test_any_stiffness_replays(make_movement, stiffness):
    """The state is carried by matrix exponentials, so no step is too long for a stiff spring."""
    _, x = make_movement(0, n_samples=200)
    forcing = DMP(stiffness=stiffness, fit="forcing", regression="ridge")
    path = forcing.learn([x]).rollout(n_samples=200).positions[0]
    np.testing.assert_allclose(path, x, atol=0.02 * np.ptp(x))


@pytest.mark.parametrize("stiffness", [1.0, 1e3, 1e7])
def test_the_path_is_fitted_with_any_spring_that_is_not_limp(make_movement, stiffness):
    """Its penalty is on w / K: a spring with K far below 1 can hardly be pulled."""
    _, x = make_movement(0, n_samples=200)
    path = DMP(stiffness=stiffness).learn([x]).rollout(n_samples=200).positions[0]
    np.testing.assert_allclose(path, x, atol=0.02 * np.ptp(x))


BAD_OPTIONS = [
    ({"start": [1.0]}, TrajectoryError, "expected start of shape (2,) or (n, 2), got shape (1,)"),
    ({"goal": np.zeros((3, 3))}, TrajectoryError, "expected goal of shape (2,) or (n, 2), got shape (3, 3)"),
    ({"goal": [0.0, NAN]}, TrajectoryError, "expected finite numbers for goal, got [0.0, nan]"),
    ({"goal": "home"}, TrajectoryError, "expected numbers for goal, got 'home'"),
    ({"velocity": 1.0}, TrajectoryError, "expected velocity of shape (2,) or (n, 2), got shape ()"),
    ({"duration": 0.0}, SpecificationError, "expected duration above 0 seconds, got 0 for movement 0"),
    ({"duration": [1.0, 2.0, 3.0]}, TrajectoryError, "expected one or equally many of primitives"),
    ({"goal": np.zeros((3, 2))}, TrajectoryError, "got 2 primitives, 3 goal"),
    ({"n_samples": 1}, SpecificationError, "expected n_samples to be a whole number of at least 2, got 1"),
    ({"n_samples": 50, "rate": 100.0}, SpecificationError, "expected either rate or n_samples, got both"),
    ({"rate": 3.0}, SpecificationError, "expected a rate of at least 10 Hz to follow the dynamics"),
    ({"rate": -1.0}, SpecificationError, "expected rate to be a number above 0, got -1.0"),
    ({"settle": 0.0}, SpecificationError, "expected settle to be a number above 0, got 0.0"),
    ({"settle": 1e-30}, SpecificationError, "expected the movement to come within 1e-30 of its goal in 10 durations"),
]


@pytest.mark.parametrize(("options", "error", "message"), BAD_OPTIONS, ids=[str(case[0]) for case in BAD_OPTIONS])
def test_a_wish_that_cannot_be_met_is_refused(make_movement, options, error, message):
    t, x = make_movement(0, n_samples=50)
    learned = DMP(n_basis=10).learn([x, x[::-1]])
    slow = type(learned)(**{**learned.__dict__, "durations": np.full(2, t[-1])})
    with pytest.raises(error, match=re.escape(message)):
        slow.rollout(**options)


@pytest.mark.parametrize("feature", ["forcing", "shape_attractor"])
def test_a_feature_needs_two_samples(make_movement, feature):
    learned = DMP(n_basis=10).learn([make_movement(0)[1]])
    with pytest.raises(SpecificationError, match="n_samples to be a whole number of at least 2, got 1"):
        getattr(learned, feature)(1)

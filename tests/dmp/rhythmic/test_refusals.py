"""What cannot be learned or asked for, and in which words."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import RhythmicDMP, Smooth, Trajectory
from kineme.errors import SpecificationError, TrajectoryError

T = np.linspace(0.0, 3.0, 100)
WAVE = Trajectory(T, np.sin(2 * np.pi * T), name="wave")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"n_basis": 2}, "expected n_basis to be a whole number of at least 3, got 2"),
        ({"overlap": 1.0}, "expected overlap to be a number above 0 and below 1, got 1.0"),
        ({"overlap": 0}, "expected overlap to be a number above 0 and below 1, got 0"),
        ({"stiffness": 0}, "expected stiffness to be a number above 0, got 0"),
        ({"damping": -1}, "expected damping to be a number above 0, got -1"),
        ({"period": 0.0}, "expected period to be a number above 0, got 0.0"),
        ({"ridge": -1}, "expected ridge to be a number of at least 0, got -1"),
        ({"align_on": -1}, "expected align_on to be a whole number of at least 0, got -1"),
        ({"n_basis": 30, "n_points": 59}, "expected n_points to be a whole number of at least 60, got 59"),
        ({"fit": "spline"}, "expected fit to be one of .*trajectory.*, got 'spline'"),
        ({"aperiodic": "guess"}, "expected aperiodic to be one of .'raise', 'accept'., got 'guess'"),
    ],
)
def test_specifications(parameters, message):
    with pytest.raises(SpecificationError, match=message):
        RhythmicDMP(**parameters)


@pytest.mark.parametrize(
    ("parameters", "movements", "message"),
    [
        ({"period": 3.5}, [WAVE], r"0 \('wave'\): expected at least one period of 3.5 s, got a recording of 3 s"),
        ({"period": 0.05}, [WAVE], r"0 \('wave'\): expected at least 4 samples per period of 0.05 s, got 1.65"),
        ({"align_on": 1}, [WAVE], "expected movements with a dimension 1 to align on, got 1 dimensions"),
        ({}, [np.ones((50, 2))], "trajectory 0: expected a movement, got 50 samples at the same place"),
        ({}, [np.sin(9 * T), np.append(np.nan, T)], "trajectory 1: expected finite positions, got .nan. at sample 0"),
    ],
)  # fmt: skip
def test_recordings(parameters, movements, message):
    with pytest.raises(TrajectoryError, match=message):
        RhythmicDMP(**parameters).learn(movements)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"n_periods": 0}, SpecificationError, "expected n_periods to be a number above 0, got 0"),
        ({"period": -2.0}, SpecificationError, "expected period above 0 seconds, got -2 for movement 0"),
        ({"rate": 10.0, "n_samples": 9}, SpecificationError, "expected either rate or n_samples, got both"),
        (
            {"rate": 3.0, "period": 0.8},
            SpecificationError,
            "a rate of at least 5 Hz, that is 4 samples per period, got 3",
        ),
        ({"rate": 0}, SpecificationError, "expected rate to be a number above 0, got 0"),
        ({"n_samples": 1}, SpecificationError, "expected n_samples to be a whole number of at least 2, got 1"),
        ({"start": [1.0, 2.0]}, TrajectoryError, r"expected start of shape \(1,\) or \(n, 1\), got shape \(2,\)"),
        ({"phase": np.nan}, TrajectoryError, "expected finite numbers for phase, got nan"),
        ({"phase": [0, 1], "amplitude": [1, 2, 3]}, TrajectoryError, "got 1 primitives, 3 amplitude, 2 phase"),
    ],
)
def test_wishes(options, error, message):
    with pytest.raises(error, match=message):
        RhythmicDMP().learn(WAVE).rollout(**options)


def test_a_step_needs_its_parentheses():
    with pytest.raises(
        SpecificationError, match=r"expected a tuple of steps such as .kineme\.TrimRest\(\), .*Smooth'>"
    ):
        RhythmicDMP(preprocessing=(Smooth,))

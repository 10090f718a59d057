"""Every refusal says what was expected, what came and what to do."""

# ruff: noqa: E501 - one case, one line, the message whole

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

import kineme
from kineme import Trajectory
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.segmentation.table import Rest

T = np.linspace(0, 2, 200)
X = np.column_stack((np.cos(T), np.sin(T)))

BAD_RECORDINGS = {
    "at rest": (Trajectory(T, np.full((200, 2), 3.0), name="desk"), "recording 'desk': expected some movement, got 2 s at rest: the smoothed positions stay within 0, the noise is 0; check the dimensions"),
    "at rest in noise": (Trajectory(T, np.random.default_rng(0).normal(size=(200, 2))), "recording: expected some movement, got 2 s at rest: the smoothed positions stay within"),
    "too short": (Trajectory(T[:7], X[:7]), "recording: expected at least 8 samples to cut, got 7"),
    "three samples": (X[:3], "expected at least 4 samples, got 3"),
    "NaN": (np.where(np.arange(400).reshape(200, 2) == 101, np.nan, X), "expected finite positions, got [0.876"),
    "several": ([X, X], "expected one recording, got 2 movements; pass them one by one"),
    "words": ("take", "expected"),
}  # fmt: skip


@pytest.mark.parametrize(("recording", "message"), BAD_RECORDINGS.values(), ids=BAD_RECORDINGS)
def test_bad_recordings_are_refused(recording, message):
    with pytest.raises(TrajectoryError, match=re.escape(message)):
        kineme.segment(recording)


BAD_PARAMETERS = {
    "unknown method": ({"by": "pause"}, "expected by to be one of ['rest', 'speed', 'change-points'], got 'pause'"),
    "unknown parameter": ({"depth": 0.3}, "expected parameters of by='rest' among ['speed', 'min_rest', 'min_movement'], got 'depth'"),
    "no method": ({"by": 3}, "expected by to be one of ['rest', 'speed', 'change-points'] with its parameters, or a method that has them, got 3"),
    "class": ({"by": Rest}, "or a method that has them, got <class"),
    "method and parameters": ({"by": Rest(), "speed": 0.1}, "and {'speed': 0.1}"),
    "speed 0": ({"speed": 0.0}, "expected speed to be a number above 0 and below 0.5, got 0.0"),
    "speed 0.5": ({"speed": 0.5}, "expected speed to be a number above 0 and below 0.5, got 0.5"),
    "rest": ({"min_rest": -1.0}, "expected min_rest to be a number of at least 0, got -1.0"),
    "movement": ({"min_movement": "long"}, "expected min_movement to be a number of at least 0, got 'long'"),
    "depth": ({"by": "speed", "depth": 1.5}, "expected depth to be a number above 0 and below 1, got 1.5"),
    "span": ({"by": "speed", "span": 0}, "expected span to be a number above 0 and below 1, got 0"),
    "turn": ({"by": "speed", "turn": 90}, "expected turn below pi, got 90; angles are in radians"),
    "apart": ({"by": "speed", "min_movement": -2}, "expected min_movement to be a number of at least 0, got -2"),
    "penalty": ({"by": "change-points", "penalty": 0}, "expected penalty to be a number above 0, got 0"),
    "points": ({"by": "change-points", "n_points": 5}, "expected n_points to be a whole number of at least 10, got 5"),
    "movements": ({"by": "change-points", "n_pieces": 0}, "expected n_pieces to be a whole number of at least 1, got 0"),
    "too many": ({"by": "change-points", "n_pieces": 30, "n_points": 100}, "expected n_points of at least 5 per piece, got 100 for 30 pieces"),
}  # fmt: skip


@pytest.mark.parametrize(("parameters", "message"), BAD_PARAMETERS.values(), ids=BAD_PARAMETERS)
def test_bad_parameters_are_refused(parameters, message):
    with pytest.raises(SpecificationError, match=re.escape(message)):
        kineme.segment(Trajectory(T, X), **parameters)


def test_a_missing_library_is_named_with_the_extra_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ruptures", None)
    with pytest.raises(SpecificationError, match=re.escape('found none; pip install "kineme[segmentation]"')):
        kineme.segment(Trajectory(T, X), "change-points")

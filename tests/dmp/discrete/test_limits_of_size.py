"""What would not fit into memory, or leave the range of numbers, is refused by name before it begins."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, RhythmicDMP, Trajectory
from kineme.control import Status
from kineme.errors import KinemeError, SpecificationError


@pytest.fixture(scope="module")
def primitive(make_movement):
    return DMP(n_basis=10, n_points=50).learn([make_movement(0)[1]])[0]


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (
            {"rate": 1e9},
            r"rate times duration to ask for at most 5,000,000 samples with 10 basis functions, got 1e\+09",
        ),
        ({"rate": 1e12}, "rate times duration"),
        ({"rate": 100.0, "duration": 1e14}, r"rate times duration .* got 1e\+16; lower it, or generate .* in parts"),
        ({"n_samples": 10**9}, "n_samples to ask for at most 5,000,000"),
        ({"duration": 1e60}, r"duration above 0 seconds and from 1e-50 to 1e\+50, got 1e\+60 for movement 0"),
        ({"duration": 1e-320}, "duration above 0 seconds and from 1e-50"),
        ({"goal": [1e308, 0.0]}, r"numbers up to 1e\+100 for goal, got \[1e\+308, 0.0\]; choose another unit"),
        ({"start": [0.0, -1e200]}, "for start"),
        ({"velocity": [1e308, 0.0]}, "for velocity"),
    ],
)
def test_wishes_too_large_are_refused_by_name(primitive, wish, words):
    with pytest.raises(KinemeError, match=words):
        primitive.rollout(**wish)


@pytest.mark.soak
def test_as_many_samples_as_are_allowed_are_the_same_as_few(primitive, agree):
    """Computed in several blocks of steps."""
    many = primitive.rollout(n_samples=100_001)
    few = primitive.rollout(n_samples=101)
    agree(many.positions[:, ::1000], few.positions)
    agree(many.accelerations[:, ::1000], few.accelerations)


def test_specifications_too_large_are_refused_by_name():
    with pytest.raises(SpecificationError, match="n_basis to be at most 2,000, got 100000000"):
        DMP(n_basis=10**8)
    with pytest.raises(SpecificationError, match="n_points to be at most 10,000, got 100000000"):
        DMP(n_points=10**8)
    with pytest.raises(SpecificationError, match="n_basis to be at most 2,000"):
        RhythmicDMP(n_basis=10**8, n_points=10**9)
    with pytest.raises(SpecificationError, match="stiffness to be a number from 1e-100 to 1e\\+100, got 1e-320"):
        DMP(stiffness=1e-320)


def test_features_too_long_are_refused_by_name(primitive):
    for feature in (primitive.forcing, primitive.shape_attractor):
        with pytest.raises(SpecificationError, match="n_samples to ask for at most"):
            feature(10**9)


def test_rhythms_too_long_are_refused_by_name():
    t = np.linspace(0.0, 3.0, 150)
    learned = RhythmicDMP().learn([Trajectory(t, np.column_stack((np.sin(7 * t), np.cos(7 * t))))])
    with pytest.raises(SpecificationError, match="n_periods to ask for at most 2,000,000 samples with 25"):
        learned.rollout(1e9)
    with pytest.raises(SpecificationError, match="rate times periods"):
        learned.rollout(1.0, rate=1e12)
    with pytest.raises(SpecificationError, match="dt of at most 1000 periods of"):
        learned.controller(1e9)
    controller = learned.controller(0.01)
    assert controller.step(period=1e-9).status & Status.PERIOD_REJECTED

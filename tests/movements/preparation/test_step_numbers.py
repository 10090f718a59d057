"""Numbers that the documentation gives for preparing movements: each falls here if it is changed."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Resample, Smooth, Trajectory, TrimRest, preprocess
from kineme.kernels.random_binning import RandomBinning
from kineme.movements.preparation.resample import arc_length_phase


@pytest.mark.parametrize(("cycles", "left"), [(20, 0.5), (10, 16 / 17), (40, 1 / 17)])
def test_twenty_cycles_per_movement_are_halved(cycles, left):
    """``1 / (1 + (nu / 20)^4)``, away from the ends."""
    u = np.linspace(0.0, 1.0, 2001)
    smooth = preprocess([Trajectory(3.0 * u, np.sin(2.0 * np.pi * cycles * u))], [Smooth()])[0].positions[:, 0]
    inside = slice(500, 1500)
    wave = np.sin(2.0 * np.pi * cycles * u)[inside]
    assert smooth[inside] @ wave / (wave @ wave) == pytest.approx(left, abs=0.01)


def test_rest_is_a_hundredth_of_the_extent():
    """A drift to 2 % of the extent, in even steps of which a half is rest; stamps are uneven and start at 5 s."""
    x = np.concatenate((np.linspace(0.0, 0.02, 101), np.linspace(0.03, 1.0, 98), [0.5, 0.0]))
    times = 5.0 + np.cumsum(np.random.default_rng(0).uniform(0.01, 0.02, len(x)))
    (trimmed,) = preprocess([Trajectory(times, x)], [TrimRest()])
    assert len(x) - len(trimmed) == pytest.approx(50, abs=1)
    assert trimmed.times[-1] == times[-1]
    demos = preprocess([Trajectory(times, x)], [TrimRest()])
    assert demos.durations[0] == pytest.approx(trimmed.duration)


def test_the_extent_of_a_rest_is_the_diagonal_of_the_box():
    """Both sides are 1, so rest is what stays within 0.01 sqrt 2 of the start; the drift is along x alone."""
    way = np.linspace(0.05, 1.0, 60)
    x = np.concatenate((np.linspace(0.0, 0.03, 301), way)), np.concatenate((np.zeros(301), way))
    (trimmed,) = preprocess([np.column_stack(x)], [TrimRest()])
    assert trimmed.positions[0, 0] == pytest.approx(0.01 * np.sqrt(2.0), abs=2e-4)


def test_movements_are_resampled_to_two_hundred_points():
    assert len(preprocess([np.random.default_rng(0).normal(size=(37, 2))], [Resample()])[0]) == 200


def test_a_pause_takes_a_thousandth_of_its_time_of_the_arc_length_phase():
    path = np.concatenate((np.linspace(0.0, 0.5, 26), np.full(50, 0.5), np.linspace(0.5, 1.0, 26)[1:]))
    phase = arc_length_phase(path[None, None])[0]
    assert phase[75] - phase[25] == pytest.approx(1e-3 * 50 / (len(path) - 1))


def test_random_binning_draws_four_grids_for_each_coordinate():
    X = np.random.default_rng(0).normal(size=(5, 7))
    assert RandomBinning().fit_transform(X).nnz == 5 * 7 * 4

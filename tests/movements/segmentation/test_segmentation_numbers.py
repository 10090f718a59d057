"""Numbers that the documentation gives for segmentation: each falls here if it is changed."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Trajectory, segment
from kineme.errors import TrajectoryError
from kineme.movements.segmentation.table import Motion, noise_variance, observe, onset_rows


@pytest.mark.parametrize("noise", [0.002, 0.01])
@pytest.mark.parametrize("smooth", [True, False])
def test_what_smoothing_moves_the_ends_outward_is_taken_back_half_way(smooth, noise, minimum_jerk):
    """With cutoff c, a smooth start comes out 0.15 / c late and a sudden one 0.15 / c early: not 0.4 / c."""
    errors = []
    for seed in range(12):
        t = np.arange(0.0, 4.0, 0.01)
        u = np.clip(t - 1.5, 0.0, 1.0)
        x = (minimum_jerk(u) if smooth else u)[:, None] * [1.0, 0.5]
        recording = Trajectory(t, x + noise * np.random.default_rng(seed).normal(size=x.shape))
        (start, end), cutoff = segment(recording).cuts[0], observe(recording, 0.05).cutoff
        errors += [(1.5 - start) * cutoff, (end - 2.5) * cutoff]
    assert np.mean(errors) == pytest.approx(-0.15 if smooth else 0.15, abs=0.08)


def test_the_variance_of_noise_is_found_beside_a_movement_and_jumps():
    t = np.linspace(0.0, 1.0, 20_001)
    x = np.column_stack((np.sin(5.0 * t), t**2)) + np.random.default_rng(0).normal(size=(len(t), 2)) * [0.01, 0.02]
    x[::1000] += 1.0
    assert noise_variance(x) == pytest.approx(0.01**2 + 0.02**2, rel=0.04)


def _with_dips(*dips, share):
    """A straight way at speed 1 that slows down to a share of it around each time."""
    t = np.linspace(0.0, 4.0, 2001)
    speed = np.ones_like(t)
    for dip in dips:
        speed -= (1.0 - share) * np.exp(-0.5 * ((t - dip) / 0.03) ** 2)
    speed *= np.clip(np.minimum(t, 4.0 - t) / 0.2, 0.0, 1.0)
    return Trajectory(t, np.append(0.0, np.cumsum(0.5 * np.diff(t) * (speed[1:] + speed[:-1])))[:, None] * [0.6, 0.8])


@pytest.mark.parametrize(("share", "n"), [(0.25, 2), (0.42, 1)])
def test_a_minimum_counts_below_a_third_of_the_peaks_beside_it(share, n):
    assert len(segment(_with_dips(2.0, share=share), "speed")) == n


@pytest.mark.parametrize(("apart", "n"), [(0.14, 3), (0.5, 4)])
def test_cuts_keep_a_tenth_of_the_typical_piece_apart(apart, n):
    found = segment(_with_dips(2.0 - 0.5 * apart, 2.0 + 0.5 * apart, 3.6, share=0.1), "speed")
    assert len(found) == n


def test_a_bend_is_no_corner():
    """Directions are taken over a fiftieth of the extent; over a fifth, a bend of a tenth would be one."""
    t = np.linspace(0.0, 1.0, 1501)
    s = 2.0 * t  # along a way there, around half a circle of radius 0.1, and back
    arc = np.clip((s - 0.843) / 0.1, 0.0, np.pi)
    x = np.column_stack((np.minimum(s, 0.843) - np.clip(s - 0.843 - 0.1 * np.pi, 0.0, None) + 0.1 * np.sin(arc),
                         0.1 - 0.1 * np.cos(arc)))  # fmt: skip
    assert len(segment(Trajectory(t, x), "speed", turn=1.0)) == 1
    assert len(segment(Trajectory(t, x), "speed", turn=1.0, span=0.2)) > 1


def test_without_noise_a_movement_begins_where_rest_ends():
    """Speed that rises evenly: what is extrapolated from a twentieth of the peak lies before that."""
    t = np.arange(0.0, 4.0, 0.002)
    speed = np.interp(t, [1.0, 2.0, 2.5, 3.0], [0.0, 1.0, 1.0, 0.0])
    x = np.append(0.0, np.cumsum(0.5 * 0.002 * (speed[1:] + speed[:-1])))
    (start, end), cutoff = segment(Trajectory(t, x)).cuts[0], 125.0
    assert start == pytest.approx(1.0, abs=4.0 / cutoff)
    assert end == pytest.approx(3.0, abs=4.0 / cutoff)


@pytest.mark.parametrize("seed", range(10))
def test_noise_alone_rests(seed):
    """Smoothed, it moves less than four of its standard deviations."""
    noise = np.random.default_rng(seed).normal(size=(300, 2))
    with pytest.raises(TrajectoryError, match="at rest"):
        segment(Trajectory(np.linspace(0.0, 3.0, 300), noise))


def test_an_onset_is_extrapolated_by_a_tenth_of_the_movement_at_most():
    """Speed that creeps from a twentieth to a fifth of its peak for four seconds began at most 0.5 s before."""
    t = np.arange(0.0, 10.0, 0.01)
    speed = np.interp(t, [0.0, 4.9, 5.0, 9.0, 9.5, 10.0], [0.04, 0.0499, 0.05, 0.2, 1.0, 1.0])
    motion = Motion(t, t, t[:, None], speed, 1.0, 0.0, 1e6, np.empty((len(t), 0)))
    start = t[onset_rows(motion, np.array([[0, len(t)]]))[0, 0]]
    assert start == pytest.approx(5.0 - 0.1 * (t[-1] - 5.0), abs=0.02)


@pytest.mark.parametrize(("pauses", "n"), [((0.014, 0.03, 0.014), 3), ((0.3, 0.3, 0.3), 12)])
def test_pauses_at_corners_are_no_rests(pauses, n):
    """Four strokes of half a second each: the longest pause counts by the movement that the shorter ones leave."""
    times, positions, now, x = [0.0, 0.5], [0.0, 0.0], 0.5, 0.0
    for pause in 3 * (*pauses, 0.5):
        x += 1.0
        times += [now + 0.5, now + 0.5 + pause]
        positions += [x, x]
        now += 0.5 + pause
    t = np.arange(0.0, now, 0.002)
    x = np.interp(t, times, positions)
    assert len(segment(Trajectory(t, x[:, None] * [0.6, 0.8]))) == n

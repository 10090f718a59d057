"""Cuts do not depend on the unit, the place, the tempo or the origin of time; samples are neither lost nor changed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme import Trajectory
from kineme.movements.segmentation.table import SEGMENTERS

seeds = st.integers(0, 10_000)
methods = pytest.mark.parametrize("by", SEGMENTERS)


@pytest.fixture(autouse=True)
def _library_for(request):
    if getattr(request.node, "callspec", None) and request.node.callspec.params.get("by") == "change-points":
        pytest.importorskip("ruptures", reason="by='change-points' needs pip install kineme[segmentation]")


@methods
@given(
    seed=seeds,
    unit=st.sampled_from([1e-3, 1e3]),
    tempo=st.sampled_from([0.05, 20.0]),
    noise=st.sampled_from([0.0, 0.005]),
)
def test_unit_place_and_tempo_do_not_matter(make_recording, by, seed, unit, tempo, noise):
    one = make_recording(seed, noise=noise).recording
    other = Trajectory(1e3 + tempo * one.times, 7.0 * unit + unit * one.positions)
    np.testing.assert_allclose(kineme.segment(one, by).rows, kineme.segment(other, by).rows, atol=1)  # rounding


@pytest.mark.parametrize("by", ["rest", "speed"])  # change points need samples of each regime
@given(seed=seeds, pause=st.sampled_from([0.6, 60.0, 3600.0]), noise=st.sampled_from([0.0, 0.003]))
def test_a_pause_of_any_length_may_have_no_samples(make_recording, by, seed, pause, noise):
    known = make_recording(seed, n=3, noise=noise)
    t, x = known.recording.times, known.recording.positions
    moving = np.any([(start - 0.05 <= t) & (t <= end + 0.05) for start, end in known.truth], axis=0)
    later = np.where(t > known.truth[0, 1] + 0.2, pause, 0.0)
    found = kineme.segment(Trajectory((t + later)[moving], x[moving]), by)
    expected = np.add(known.truth, [[0.0], [pause], [pause]])
    np.testing.assert_allclose(found.cuts, expected, atol=0.2)


@pytest.mark.parametrize("pause", [0.5, 600.0])
def test_shapes_that_start_slowly_after_a_pause_without_samples_are_apart(pause):
    times, positions, now, place = [], [], 0.0, np.zeros(2)
    for shape in kineme.load_lasa()[[5, 20, 33, 41, 55, 69]]:
        times.append(shape.times[::10] + now)
        positions.append((shape.positions - shape.positions[0])[::10] + place)
        now, place = times[-1][-1] + pause, positions[-1][-1]
    recording = Trajectory(np.concatenate(times), np.concatenate(positions))
    starts, ends = [part[0] for part in times], [part[-1] for part in times]
    np.testing.assert_allclose(kineme.segment(recording).cuts, np.column_stack((starts, ends)), atol=0.3)


def test_a_long_pause_without_samples_leaves_points_to_change_points(make_recording):
    pytest.importorskip("ruptures", reason="by='change-points' needs pip install kineme[segmentation]")
    known = make_recording(3, n=4)
    t, x = known.recording.times, known.recording.positions
    later = np.where(t > known.truth[1, 1] + 0.2, 3600.0, 0.0)
    cuts = kineme.segment(Trajectory(t + later, x), "change-points").cuts
    np.testing.assert_allclose(cuts, known.truth + np.array([[0.0], [0.0], [3600.0], [3600.0]]), atol=0.5)


@pytest.mark.parametrize("by", ["rest", "speed"])
@pytest.mark.parametrize(("n", "step"), [(2, 1e-6), (3, 1e-6), (5, 1e-5), (10, 1e-4)])
def test_samples_may_come_in_bursts(make_recording, by, n, step):
    """Radio links send several samples at once, two sensors are stamped almost alike."""
    known = make_recording(5, n=4).recording
    burst = known.times[(np.arange(len(known)) // n) * n] + step * (np.arange(len(known)) % n)
    even, bursts = (kineme.segment(Trajectory(t, known.positions), by) for t in (known.times, burst))
    assert len(bursts) == len(even)
    np.testing.assert_allclose(bursts.cuts, even.cuts, atol=0.25)


@methods
@given(seed=seeds, noise=st.sampled_from([0.0, 0.01]))
def test_cover_loses_and_duplicates_no_sample(make_recording, by, seed, noise):
    recording = make_recording(seed, noise=noise).recording
    found = kineme.segment(recording, by, cover=True)
    np.testing.assert_array_equal(found.trajectories.positions, recording.positions)
    np.testing.assert_array_equal(found.trajectories.times, recording.times)
    assert found.trajectories.lengths.min() >= 4


@methods
@given(seed=seeds)
def test_movements_are_the_recorded_samples_in_order_without_overlap(make_recording, by, seed):
    recording = make_recording(seed, noise=0.002).recording
    found = kineme.segment(recording, by)
    assert (np.diff(found.rows.ravel()) >= 0).all()
    for (first, stop), (start, end), one in zip(found.rows, found.cuts, found.trajectories, strict=True):
        np.testing.assert_array_equal(one.positions, recording.positions[first:stop])
        assert (one.times[0], one.times[-1]) == (start, end)
        assert one.name.startswith("take[")
        np.testing.assert_allclose([float(t) for t in one.name[5:-3].split("-")], [start, end], atol=6e-5)


@methods
def test_nothing_of_the_caller_is_written_to(make_recording, by):
    recording = make_recording(1).recording
    t, x = recording.times.copy(), recording.positions.copy()
    t.setflags(write=False)
    x.setflags(write=False)
    again = kineme.segment(Trajectory(t, x), by)
    assert (again.rows == kineme.segment(recording, by).rows).all()


def test_the_label_of_the_recording_is_that_of_its_movements(make_recording):
    recording = make_recording(2, n=3).recording
    assert kineme.segment(recording).trajectories.labels is None
    labeled = Trajectory(recording.times, recording.positions, label="wave")
    found = kineme.segment(labeled)
    assert found.trajectories.labels.tolist() == ["wave"] * 3
    assert found.trajectories.names[0].startswith("recording[")


def test_the_record_says_what_was_done(make_recording):
    recording = make_recording(2, n=3).recording
    found = kineme.segment(recording, speed=0.04)
    assert found.recording is recording
    assert len(found) == 3
    assert "3 movements in" in repr(found)
    assert "Rest(speed=0.04, min_rest=None" in repr(found)
    again = kineme.segment([recording], found.method)
    assert (again.rows == found.rows).all()
    assert again.method is found.method


def test_names_stay_exact_where_stamps_count_seconds_since_1970():
    t = 1.7e9 + np.arange(500) / 100
    hill = np.where((t > 1.7e9 + 1.23) & (t < 1.7e9 + 2.5), np.sin(np.pi * (t - 1.7e9 - 1.23) / 1.27) ** 2, 0.0)
    (one,) = kineme.segment(Trajectory(t, hill)).trajectories
    assert one.name in ("recording[1700000001.23-1700000002.5 s]", "recording[1700000001.22-1700000002.51 s]")

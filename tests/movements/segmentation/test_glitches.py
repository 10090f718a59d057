"""Single samples far from everything else, as trackers write them, hide no movement."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme.dmp.generation.generate import learn_one
from kineme.movements import RemoveGlitches
from kineme.movements.preparation.glitches import without_glitches, without_jumps


def _with_glitch(known, at, length, size):
    x = known.recording.positions.copy()
    x[at : at + length] += size
    return kineme.Trajectory(known.recording.times, x)


@pytest.mark.parametrize("by", ["rest", "speed"])
@pytest.mark.parametrize("length", [1, 3])
@pytest.mark.parametrize(("size", "noise"), [(100.0, 0.0), (100.0, 0.002), (-1e4, 0.002)])
def test_a_glitch_hides_no_movement_wherever_it_is(make_recording, by, length, size, noise):
    known = make_recording(3, n=4, noise=noise)
    expected = kineme.segment(known.recording, by).cuts
    assert len(expected) == 4
    for at in (20, 150, 333, *((0, len(known.recording) - 1) if length == 1 else ())):
        found = kineme.segment(_with_glitch(known, at, length, size), by).cuts
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, atol=0.05)


def test_known_movements_are_spotted_beside_a_glitch(make_recording):
    known = make_recording(3, n=4)
    pieces = kineme.segment(known.recording).demonstrations
    recognizer = kineme.Recognizer().fit(pieces, ["a", "b", "c", "d"])
    expected, found = (
        [one.label for one in recognizer.spot(recording)]
        for recording in (known.recording, _with_glitch(known, 20, 1, 100.0))
    )
    assert expected
    assert found == expected


def test_a_robot_follows_no_sample_that_a_tracker_lost(tmp_path):
    """Three samples far away took the primitive there, 0.98 of the extent off its path."""
    seen = kineme.load_lasa(["CShape"])[5]
    x = seen.positions + 300.0
    lost, extent = x.copy(), np.ptp(x, axis=0).max()
    lost[400:403] = -100.0
    path = kineme.DMP().learn(kineme.Trajectory(seen.times, x)).rollout().positions

    def off(primitives):
        return np.abs(primitives.rollout().positions - path).max() / extent

    movement = kineme.Trajectory(seen.times, lost)
    assert off(kineme.DMP().learn(movement)) > 0.5
    assert off(kineme.DMP(preprocessing=(RemoveGlitches(),)).learn(movement)) < 1e-3
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn([movement], ["c"])
        assert off(library.primitives("c")) < 1e-3
    table = tmp_path / "lost.csv"
    np.savetxt(table, np.column_stack([seen.times, lost]), delimiter=",", header="time [s],x,y", comments="")
    recordings = kineme.read_recordings(table)
    assert off(learn_one(recordings.demonstrations[0], kineme.DMP()).primitive) < 1e-3
    assert "1 movement with samples far from the path, the first lost.csv after" in " ".join(recordings.notes)


def whole(x):
    """The positions of one movement without its glitches."""
    return without_glitches(x, np.array([0, len(x)]))


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.01])
@pytest.mark.parametrize("digits", [2, 12])
def test_samples_on_the_path_stay_as_they_are(make_recording, noise, digits):
    for seed in range(20):
        recording = make_recording(seed, noise=noise).recording
        x = recording.positions.round(digits)
        assert whole(x) is x
        assert without_jumps(x, np.diff(recording.times), np.inf) is x


def test_a_step_that_does_not_return_is_no_glitch():
    x = np.repeat([[0.0], [5.0]], 50, axis=0) + np.random.default_rng(0).normal(scale=0.01, size=(100, 1))
    assert whole(x) is x


def test_samples_away_for_longer_than_three_are_a_movement():
    x = np.random.default_rng(0).normal(scale=0.01, size=(100, 1))
    x[40:44] += 5.0
    assert whole(x) is x


@pytest.mark.parametrize("length", [1, 4, 30])
def test_zeros_in_place_of_what_was_not_seen_are_a_line(make_recording, length):
    x = make_recording(2, n=1).recording.positions + 7.0
    lost = x.copy()
    middle = len(x) // 2
    lost[middle : middle + length] = 0.0
    found = whole(lost)
    before, after = x[middle - 1], x[middle + length]
    assert np.abs(found - x)[middle : middle + length].max() <= 2 * np.abs(after - before).max()
    np.testing.assert_array_equal(
        np.delete(found, slice(middle, middle + length), axis=0), np.delete(x, slice(middle, middle + length), axis=0)
    )


@pytest.mark.parametrize("at", [0, 1, 2, 97, 98, 99])
def test_ends_of_a_movement_may_lie_apart(at):
    """A stroke of a pen begins far from where the one before ended, and may have one sample."""
    x = np.linspace(0.0, 1.0, 100)[:, None]
    x[: at + 1 if at < 50 else 0] += 5.0
    x[at if at > 50 else 100 :] += 5.0
    assert whole(x) is x


def test_movements_are_cleaned_one_by_one():
    """Each as it is alone, whoever is beside it."""
    rng = np.random.default_rng(1)
    movements = [np.cumsum(rng.normal(size=(n, 2)), axis=0) for n in (4, 30, 5, 90)]
    for k in (1, 3):
        movements[k][11 : 12 + k // 2] = 1e4
    offsets = np.cumsum([0, *map(len, movements)])
    cleaned = without_glitches(np.concatenate(movements), offsets)
    for movement, start, stop in zip(movements, offsets, offsets[1:], strict=False):
        np.testing.assert_array_equal(cleaned[start:stop], whole(movement))
    assert np.abs(cleaned).max() < 1e3


@pytest.mark.parametrize("length", [4, 20])
@pytest.mark.parametrize("size", [3.0, 1e3])
def test_what_is_lost_for_longer_hides_no_movement(make_recording, length, size):
    """A tracker that writes zeros while it sees nothing, or that finds its origin anew."""
    known = make_recording(3, n=4, noise=0.002)
    expected = kineme.segment(known.recording).cuts
    for last in (150 + length, None):
        x = known.recording.positions + size
        x[150:last] = 0.0 if last else x[150:] + 3.0 * size
        found = kineme.segment(kineme.Trajectory(known.recording.times, x)).cuts
        apart = np.abs(found[:, None] - expected).max(axis=2).min(axis=0)
        assert (apart < 0.1).sum() >= 3  # one is spoiled where the hand was lost in it


def test_a_held_value_is_no_jump(make_recording):
    """A sensor that is ten times slower than the recording jumps at each of its own samples."""
    recording = make_recording(5).recording
    x = np.repeat(recording.positions[::10], 10, axis=0)[: len(recording)]
    assert without_jumps(x, np.diff(recording.times), np.inf) is x


def test_a_jump_over_a_gap_in_time_was_not_seen():
    x = np.linspace(0.0, 1.0, 100)[:, None] + 5.0 * (np.arange(100) > 50)[:, None] * [1.0, -0.1]
    steps = np.where(np.arange(99) == 50, 3.0, 0.01)
    assert without_jumps(x, steps, 0.1) is x
    np.testing.assert_allclose(np.ptp(without_jumps(x, steps, 5.0), axis=0), 1.0, atol=0.02)


def test_a_gripper_that_opens_at_once_is_no_jump():
    x = np.column_stack([np.linspace(0.0, 1.0, 100), np.linspace(1.0, 0.0, 100), 5.0 * (np.arange(100) > 50)])
    assert without_jumps(x, np.full(99, 0.01), np.inf) is x

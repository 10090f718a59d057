"""What an arm holds tells movements of one path apart: levels of a gripper are evidence in long recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kineme import Demonstrations, Recognizer, Trajectory
from kineme.movements.channels.channel import Channel
from kineme.movements.segmentation.table import observe
from kineme.movements.trajectories.movements import of_channels
from kineme.recognition import compared_windows, spotting
from kineme.recognition.levels import gripper_levels, level_scores

RATE = 50.0


def _channels(last="gripper.pos"):
    heads = ("x", "y", "z", last)
    return tuple(Channel(head, "position", (head,)) for head in heads)


def _way(opening, rng, start=(0.0, 0.0, 0.0)):
    """From a place to another one, in an arc, with the fingers open by `opening`."""
    u = np.linspace(0.0, 1.0, 60)
    s = (u**3 * (10.0 - 15.0 * u + 6.0 * u**2))[:, None]
    goal = np.array([0.5, 0.3, 0.0]) + rng.normal(scale=0.02, size=3)
    path = start + goal * s + np.array([0.0, 0.0, 0.2]) * np.sin(np.pi * s)
    return np.column_stack((path, opening + rng.normal(scale=0.01, size=60)))


def _demonstrations(channels):
    rng = np.random.default_rng(0)
    kinds = [("reach", 0.9), ("carry", 0.35)]
    paths = [_way(opening, rng) for _, opening in kinds for _ in range(3)]
    shown = Demonstrations([Trajectory(np.arange(60) / RATE, path) for path in paths])
    labels = [name for name, _ in kinds for _ in range(3)]
    return Demonstrations.of_movements(of_channels(shown.movements, channels)), labels


def _recording(channels, openings):
    rng, parts = np.random.default_rng(1), []
    at = np.zeros(3)
    for opening in openings:
        way = _way(opening, rng, at)
        at = way[-1, :3]
        rest = np.tile(way[-1], (25, 1))
        parts += [np.repeat(way[:1], 25, axis=0), way, rest]
    positions = np.concatenate(parts)
    recording = Demonstrations([Trajectory(np.arange(len(positions)) / RATE, positions)])
    return Demonstrations.of_movements(of_channels(recording.movements, channels))


def test_open_and_closed_fingers_tell_a_reach_from_a_carry():
    channels = _channels()
    demos, labels = _demonstrations(channels)
    recognizer = Recognizer().fit(demos, labels)
    openings = [0.9, 0.35, 0.35, 0.9, 0.9]
    spotted = [one for one in recognizer.spot(_recording(channels, openings)) if one.end - one.start > 0.6]
    assert [one.label for one in spotted] == ["reach" if opening > 0.5 else "carry" for opening in openings]
    assert min(one.confidence for one in spotted) > 0.9  # the path alone leaves it at even odds
    begins = (110 * np.arange(5) + 25) / RATE
    for one, begin in zip(spotted, begins, strict=True):
        assert (one.start, one.end) == pytest.approx((begin, begin + 59 / RATE), abs=one.uncertainty)
        assert 0.0 < one.uncertainty <= 0.2


def test_levels_are_those_of_columns_that_are_called_so():
    demos, labels = _demonstrations(_channels())
    references = Recognizer().fit(demos, labels).references_
    levels = gripper_levels(references, _channels(), 0.04)
    assert levels is not None
    assert levels.columns == (3,)
    assert levels.levels.shape == (6, 3)
    assert gripper_levels(references, _channels("torque"), 0.04) is None
    assert gripper_levels(references, None, 0.04) is None


def test_distances_of_levels_are_small_for_the_same_and_large_for_others():
    demos, labels = _demonstrations(_channels())
    references = Recognizer().fit(demos, labels).references_  # carry, reach
    levels = gripper_levels(references, _channels(), 0.04)
    opened = observe(_recording(_channels(), [0.9])[0], 0.04)
    scores = level_scores(levels, opened, np.array([[25, 84], [40, 70]]))
    assert scores.shape == (2, 2)
    assert (scores[:, 1] < 0.3).all()
    assert scores[:, 0] == pytest.approx(np.sqrt(3.0) / 0.35, rel=0.1)


def _stepped(demos):
    """The same movements, whose gripper is 0 or 1."""
    columns = np.column_stack((demos.positions[:, :3], demos.positions[:, 3] > 0.6))
    channels = (*_channels()[:3], Channel("gripper.pos", "discrete", ("gripper.pos",)))
    raw = replace(demos.movements, positions=columns, channels=None, recorded=None, dimensions=None)
    return Demonstrations.of_movements(of_channels(raw, channels))


def test_a_gripper_that_steps_is_evidence_although_it_is_not_learned():
    """A discrete column is no coordinate; its levels tell movements apart all the same, where a recording has it."""
    demos, labels = _demonstrations(_channels())
    recognizer = Recognizer().fit(_stepped(demos), labels)
    openings = [0.9, 0.35, 0.35, 0.9, 0.9]
    recording = _stepped(_recording(_channels(), openings))
    assert recording.n_dims == recognizer.comparison_.n_dims == 3
    spotted = [one for one in recognizer.spot(recording) if one.end - one.start > 0.6]
    assert [one.label for one in spotted] == ["reach" if opening > 0.5 else "carry" for opening in openings]
    assert min(one.confidence for one in spotted) > 0.9
    for one, begin in zip(spotted, (110 * np.arange(5) + 25) / RATE, strict=True):
        assert (one.start, one.end) == pytest.approx((begin, begin + 59 / RATE), abs=one.uncertainty)
    # One recording in which the gripper stays as it is has no discrete column by itself: it counts by its name.
    rests = _recording((*_channels()[:3], Channel("gripper.pos", "position", ("gripper.pos",))), [0.9, 0.9])
    for opening, label in ((1.0, "reach"), (0.0, "carry")):
        columns = np.column_stack((rests.positions[:, :3], np.full(len(rests.times), opening)))
        spotted = recognizer.spot(Demonstrations.of_movements(replace(rests.movements, positions=columns)))
        assert [one.label for one in spotted if one.label is not None] == [label, label]
    # Without the column the path alone is compared, as closely as where there is no gripper at all.
    alone = Trajectory(recording.times, recording.positions)
    plain = Recognizer().fit([Trajectory(one.times, one.positions) for one in _stepped(demos)], labels)
    for one, expected in zip(recognizer.spot(alone), plain.spot(alone), strict=True):
        assert one.label == expected.label
        assert (*one[:2], *one[3:]) == pytest.approx((*expected[:2], *expected[3:]), abs=1e-4)  # of single precision


def test_a_gripper_that_never_moves_beside_one_that_does_is_no_evidence(monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")  # to compile for five columns takes longer than to compare them
    rng = np.random.default_rng(0)
    paths = [np.column_stack((_way(opening, rng), rng.normal(scale=0.01, size=60))) for opening in (0.9, 0.9, 0.3, 0.3)]
    heads = ("x", "y", "z", "right_gripper.pos", "left_gripper.pos")
    channels = tuple(Channel(head, "position", (head,)) for head in heads)
    shown = Demonstrations([Trajectory(np.arange(60) / RATE, path) for path in paths])
    demos = Demonstrations.of_movements(of_channels(shown.movements, channels))
    references = Recognizer().fit(demos, ["reach", "reach", "carry", "carry"]).references_
    levels = gripper_levels(references, channels, 0.04)
    assert levels is not None
    assert levels.columns == (3,)


@pytest.mark.parametrize("slower", [0.6, 1.0, 2.2])
def test_movements_are_the_same_although_windows_are_not_compared_with_classes_that_cannot_be(monkeypatch, slower):
    """The tempo of the recording is learned while it is searched: windows that matter by it are compared then."""
    channels = _channels()
    demos, labels = _demonstrations(channels)
    recognizer = Recognizer().fit(demos, labels)
    recording = _recording(channels, [0.9, 0.35, 0.35, 0.9])
    recording = Demonstrations.of_movements(
        replace(recording.movements, times=slower * recording.movements.times, durations=slower * recording.durations)
    )
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 64)
    shares, inner = [], compared_windows.nearest_above

    def above(*given):
        shares.append(np.isfinite(given[-1]).mean())
        return inner(*given)

    monkeypatch.setattr(compared_windows, "nearest_above", above)
    spotted = recognizer.spot(recording)
    assert sum(one.label is not None for one in spotted) >= 3
    assert np.mean(shares) < 0.8  # of windows and classes
    shares.clear()
    monkeypatch.setattr(spotting, "most_nonconformity", lambda compared, *_: np.full(compared.scores.shape, np.inf))
    every = recognizer.spot(recording)
    assert [one[:3] for one in every] == [one[:3] for one in spotted]
    np.testing.assert_allclose([one[3:] for one in every], [one[3:] for one in spotted], atol=1e-6)


def test_windows_that_matter_only_by_the_manner_of_the_recording_are_compared_then(monkeypatch):
    channels = _channels()
    demos, labels = _demonstrations(channels)
    recognizer = Recognizer().fit(demos, labels)
    recording = _recording(channels, [0.9, 0.35, 0.35, 0.9])
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 64)
    counts, compare, inner = [0], spotting.compare_windows, spotting.most_nonconformity

    def counted(templates, motion, rows):
        counts[-1] += len(rows)
        return compare(templates, motion, rows)

    monkeypatch.setattr(spotting, "compare_windows", counted)
    spotted = recognizer.spot(recording)
    counts.append(0)

    def none_at_first(compared, typical, around, manner, reach):
        most = inner(compared, typical, around, manner, reach)
        return most if manner.tempo is not None else np.full(most.shape, -1.0)

    monkeypatch.setattr(spotting, "most_nonconformity", none_at_first)
    assert [one[:3] for one in recognizer.spot(recording)] == [one[:3] for one in spotted]
    assert counts[1] > 3 * counts[0]


def test_windows_score_above_zero_up_to_the_most_nonconformity():
    rng = np.random.default_rng(0)
    n, reach = 200, 3.7
    compared = compared_windows.ComparedWindows(
        np.zeros((n, 2), dtype=np.intp), rng.uniform(0.0, reach, (n, 2)), *rng.normal(scale=0.5, size=(2, n)),
        rng.uniform(0.0, 0.5, n),
    )  # fmt: skip
    around = compared_windows.Surroundings(*rng.uniform(0.0, 2.0, (4, n)))
    typical = spotting.Expected(np.array([0.1, -0.2]), np.zeros(2), np.full(2, 0.1))
    for manner in (spotting.Manner(), spotting.Manner(tempo=0.4, size=-0.2)):
        scored = spotting.score_windows(compared, typical, around, manner, reach)
        most = spotting.most_nonconformity(compared, typical, around, manner, reach)
        assert 0.2 < (scored.score > 0).mean() < 0.8
        np.testing.assert_array_equal(scored.score > 0, (compared.scores < most).any(axis=1))


def test_another_pace_costs_more_where_an_arm_is_at_work():
    """People change pace from one movement to the next, arms at work hardly."""
    demos, labels = _demonstrations(_channels())
    recognizer = Recognizer().fit(demos, labels)
    at_work = spotting.expected(recognizer.references_, at_work=True).costs
    assert at_work[0] > 4.0 * spotting.expected(recognizer.references_).costs[0]

"""Recordings that are concatenated from known movements, and what counts as found in them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import kineme
from kineme.recognition.spotting import Spotted
from kineme_experiments.evaluation.spotting import (
    Counts,
    Stretch,
    concatenate,
    concatenate_all,
    count_boundaries,
    count_spotted,
    overlap,
)

SHAPES = ["CShape", "NShape", "Sshape", "WShape"]


def _concatenated(rests, seed=0):
    movements = kineme.load_lasa(SHAPES)[::7]
    labels = ["CShape", None, "Sshape", "WShape"]
    return movements, concatenate(movements, labels, np.random.default_rng(seed), rests=rests)


@pytest.mark.parametrize("rests", [True, False])
def test_the_movements_are_where_the_truth_says(rests):
    movements, (recording, truth, _) = _concatenated(rests)
    assert [one.label for one in truth] == ["CShape", None, "Sshape", "WShape"]
    assert (np.diff(recording.times) > 0).all()
    for one, (start, end, _) in zip(movements, truth, strict=True):
        inside = (recording.times >= start - 1e-9) & (recording.times <= end + 1e-9)
        path = recording.positions[inside]
        np.testing.assert_allclose(path - path[0], one.positions - one.positions[0], atol=1e-9)


def test_rests_last_and_drift_and_transits_lie_between_them():
    _, (recording, truth, transits) = _concatenated(rests=True)
    assert len(transits) == len(truth) - 1
    for (before, after), transit in zip(pairwise(truth), transits, strict=True):
        assert before.end + 0.19 < transit.start < transit.end < after.start + 0.02
        resting = (recording.times > before.end) & (recording.times < transit.start)
        steps = np.linalg.norm(np.diff(recording.positions[resting], axis=0), axis=1)
        assert 0 < steps.max() < 0.1 * np.linalg.norm(np.diff(recording.positions, axis=0), axis=1).max()


def test_without_rests_it_never_stands_still_between_movements():
    _, (recording, truth, transits) = _concatenated(rests=False)
    assert transits == ()
    steps = np.linalg.norm(np.diff(recording.positions, axis=0), axis=1)
    for before, after in pairwise(truth):
        between = (recording.times[1:] > before.end) & (recording.times[1:] < after.start)
        assert between.sum() >= 2
        assert steps[between].min() > 0
        assert steps[between].max() < 4 * steps.max()


def test_the_same_seed_gives_the_same_recording():
    one, other = _concatenated(True)[1].recording, _concatenated(True)[1].recording
    np.testing.assert_array_equal(one.positions, other.positions)


@pytest.mark.parametrize("rests", [True, False])
def test_many_movements_make_several_recordings_in_random_order(rests):
    movements = kineme.load_lasa(SHAPES)
    both = movements[np.tile(np.arange(len(movements)), 2)]
    made = [concatenate_all(both, both.labels.tolist(), seed, rests=rests) for seed in ([0, 1], [0, 1], [0, 2])]
    assert [len(one.truth) for one in made[0]] == [20, 20, 16]
    labels = [[one.label for recording in each for one in recording.truth] for each in made]
    assert labels[0] == labels[1] != labels[2]
    assert sorted(labels[0]) == sorted(labels[2]) == sorted(both.labels)
    assert labels[0] != both.labels.tolist()
    assert bool(made[0][0].transits) is rests
    np.testing.assert_array_equal(made[0][0].recording.positions, made[1][0].recording.positions)


def test_recordings_at_rest_are_linked_too():
    movements = kineme.Demonstrations([kineme.Trajectory(np.arange(12) / 10, np.zeros((12, 2)))] * 3)
    [made] = concatenate_all(movements, [None] * 3, [0], rests=False)
    assert np.isfinite(made.recording.positions).all()


@pytest.mark.parametrize(("a", "b", "share"), [((0, 2), (0, 2), 1), ((0, 2), (1, 3), 1 / 3), ((0, 1), (2, 3), 0)])
def test_overlap_is_intersection_over_union(a, b, share):
    assert overlap(a, b) == overlap(b, a) == pytest.approx(share)


def test_a_spot_is_right_with_its_label_and_half_of_the_union():
    truth = (Stretch(0.0, 1.0, "a"), Stretch(2.0, 3.0, "b"), Stretch(4.0, 5.0, None))
    found = [
        Spotted(0.1, 0.6, "a", 1.0),
        Spotted(2.0, 3.0, "a", 1.0),
        Spotted(4.0, 5.0, "b", 1.0),
        Spotted(5.0, 6.0, None, 1.0),
    ]
    counts = count_spotted(found, truth)
    assert counts == Counts(n_right=1, n_found=3, n_true=2)
    assert (counts + counts).precision == pytest.approx(1 / 3)
    assert counts.recall == 0.5
    assert (Counts().precision, Counts().recall) == (0.0, 1.0)  # finding nothing is not rewarded


def test_a_movement_in_two_halves_is_found_at_most_once():
    truth = (Stretch(0.0, 1.0, "a"),)
    halves = [Spotted(0.0, 0.5, "a", 1.0), Spotted(0.5, 1.0, "a", 1.0)]
    assert count_spotted(halves, truth) == Counts(1, 2, 1)


def test_each_boundary_is_matched_once_and_within_a_share_of_its_movement():
    truth = (Stretch(0.0, 1.0, "a"), Stretch(1.0, 3.0, "b"))
    assert count_boundaries(np.array([[0.1, 1.1], [1.1, 2.8]]), truth) == Counts(3, 3, 4)
    assert count_boundaries(np.array([[0.2, 0.5]]), truth) == Counts(0, 2, 4)

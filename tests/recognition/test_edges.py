"""Edges of an arm's movements lie at its pauses, one boundary where it hardly pauses, each with its uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import Trajectory
from kineme.movements.segmentation.table import observe
from kineme.recognition.edges import pauses, placed, settled, speeds
from kineme.recognition.levels import Levels

RATE = 50.0
FAR = np.array([1.0, -0.6, 0.3])
LEVELS = Levels((3,), np.array([0.8]), np.empty((0, 3)), np.empty(0, dtype=np.intp))


def _motion(*steps, noise=2e-4, unit=1.0):
    """Steps are (seconds, way of the arm, way of the gripper) with least jerk, from rest to rest; return their ends."""
    rng, at, parts, ends = np.random.default_rng(0), np.zeros(4), [np.zeros((1, 4))], [0.0]
    for seconds, way, grip in steps:
        u = np.linspace(0.0, 1.0, round(seconds * RATE) + 1)[1:, None]
        goal = at + np.append(way * FAR, grip)
        parts.append(at + (goal - at) * (u**3 * (10.0 - 15.0 * u + 6.0 * u**2)))
        at = goal
        ends.append(ends[-1] + round(seconds * RATE) / RATE)
    positions = np.concatenate(parts)
    positions = (positions + rng.normal(scale=noise, size=positions.shape)) * [1.0, 1.0, 1.0, unit]
    return observe(Trajectory(np.arange(len(positions)) / RATE, positions), 0.04), np.array(ends)


def _rows(*spans):
    return np.array([(round(start * RATE), round(end * RATE) + 1) for start, end in spans])


def _spans(motion, rows):
    return motion.times[rows - (0, 1)]


def _settled(motion, known, *spans):
    return _settled_rows(motion, _rows(*spans), np.array(known))


def _settled_rows(motion, rows, known):
    arm, grippers = speeds(motion, LEVELS)
    return settled(motion.times, arm, _pauses(motion, np.hypot(arm, grippers)), rows, known)


def _pauses(motion, speed):
    return pauses(motion.times, speed, 0.05, 0.25 / motion.cutoff)


@given(st.floats(0.5, 2.0), st.floats(0.5, 2.0), st.floats(0.2, 1.0))
def test_pauses_are_from_the_end_of_one_movement_to_the_begin_of_the_next(first, second, rest):
    motion, ends = _motion((0.5, 0, 0), (first, 1, 0), (rest, 0, 0), (second, -1, 0), (0.5, 0, 0))
    near = 0.05 + 0.05 * max(first, second)  # beside a fast movement a slow one is seen late
    assert _pauses(motion, motion.speed / motion.peak) == pytest.approx(np.reshape(ends, (3, 2)), abs=near)


def test_edges_move_to_the_pause_that_is_near():
    motion, ends = _motion((0.5, 0, 0), (1.0, 1, 0), (0.8, 0, 0), (1.2, -1, 0), (0.5, 0, 0))
    rows = _settled(motion, [True, True], (0.4, 1.6), (1.9, 3.4))
    assert _spans(motion, rows) == pytest.approx(ends[1:5].reshape(2, 2), abs=0.06)


def test_an_edge_within_a_movement_stays():
    motion, _ = _motion((0.5, 0, 0), (3.0, 1, 0), (0.5, 0, 0))
    rows = _settled(motion, [True, True], (0.5, 2.0), (2.0, 3.5))
    assert _spans(motion, rows)[:, ::-1].ravel()[[0, 3]] == pytest.approx([2.0, 2.0], abs=0.011)


def test_an_edge_does_not_move_beyond_the_middle():
    motion, _ = _motion((0.5, 0, 0), (0.5, 1, 0), (0.8, 0, 0), (1.0, -1, 0), (0.5, 0, 0))
    rows = _settled(motion, [False], (0.9, 1.2))
    assert _spans(motion, rows)[0] == pytest.approx([0.9, 1.2])


def test_movements_that_are_hardly_apart_have_one_boundary_in_the_middle():
    motion, ends = _motion((0.5, 0, 0), (1.0, 1, 0), (0.06, 0, 0), (1.0, -1, 0), (0.5, 0, 0))
    spans = _spans(motion, _settled(motion, [True, True], (0.5, 1.45), (1.5, 2.6)))
    assert spans[0, 1] == spans[1, 0] == pytest.approx(ends[2:4].mean(), abs=0.05)


def test_what_is_left_of_a_movement_belongs_to_it():
    motion, ends = _motion((0.5, 0, 0), (1.5, 1, 0), (0.5, 0, 0))
    rows = _settled(motion, [True, False], (0.8, 2.0), (0.5, 0.8))
    assert _spans(motion, rows[:1])[0] == pytest.approx(ends[1:3], abs=0.06)
    assert rows[1].tolist() == [0, 0]


def test_a_hand_that_opens_at_rest_is_no_part_of_what_comes_next():
    motion, ends = _motion((0.5, 0, 0), (1.0, 1, 0), (0.4, 0, 0.8), (1.0, -1, 0), (0.5, 0, 0))
    rows = _settled(motion, [True, True, False], (0.5, 1.5), (1.9, 2.9), (1.5, 1.9))
    assert _spans(motion, rows)[2] == pytest.approx(ends[2:4], abs=0.08)


def test_an_opening_in_percent_does_not_hide_the_arm():
    steps = (0.5, 0, 0), (1.5, 1, 0), (0.5, 0, 0), (0.5, 0, 0.8), (0.5, 0, 0), (1.5, -1, 0), (0.5, 0, 0)
    motion, ends = _motion(*steps, unit=100.0)
    levels = LEVELS._replace(ranges=np.array([80.0]))
    rows, _ = placed(motion, _rows((0.4, 2.1), (3.5, 5.0)), np.array([True, True]), levels, 2.0)
    assert _spans(motion, rows) == pytest.approx(ends[[1, 2, 5, 6]].reshape(2, 2), abs=0.1)


def test_a_gripper_that_does_not_move_does_not_hide_a_rest():
    motion, ends = _motion((0.5, 0, 0), (1.0, 1, 0), (0.8, 0, 0), (1.2, -1, 0), (0.5, 0, 0), noise=1e-3)
    rows = _settled(motion, [True, True], (0.4, 1.6), (1.9, 3.4))
    assert _spans(motion, rows) == pytest.approx(ends[1:5].reshape(2, 2), abs=0.08)


def test_known_movements_of_few_samples_are_kept():
    t = np.arange(40) / 5.0
    positions = np.repeat(np.sin(0.4 * np.pi * t)[:, None] ** 3, 4, axis=1) * [1.0, 0.5, 0.2, 0.0]
    motion = observe(Trajectory(t, positions), 0.04)
    rows = _settled_rows(motion, np.array([[0, 6], [6, 12]]), np.array([True, False]))
    assert rows.tolist() == [[0, 6], [0, 0]]


STEPS = st.tuples(st.floats(0.2, 1.5), st.sampled_from([-1, 0, 0.02, 1]), st.sampled_from([0, 0.4]))


@given(st.lists(STEPS, max_size=8), st.integers(0, 99))
def test_movements_stay_in_order_and_apart(steps, seed):
    motion, ends = _motion((0.3, 1, 0), *steps, (0.3, -1, 0))
    rng = np.random.default_rng(seed)
    cuts = np.unique(rng.integers(0, len(motion.times), 2 * len(ends)))
    rows = np.column_stack((cuts[:-1], cuts[1:] + 1))
    rows = rows[np.diff(rows, axis=1)[:, 0] >= 8]
    order = rng.permutation(len(rows))
    known = rng.random(len(rows)) < 0.6
    kept, doubts = placed(motion, rows[order], known, LEVELS, 2.0)
    assert len(kept) == len(doubts)
    assert known.sum() <= len(kept) <= len(rows)
    spans = kept[np.argsort(kept[:, 0])]
    assert (spans[:, 1] - spans[:, 0] >= 8).all()
    assert (spans[1:, 0] >= spans[:-1, 1] - 0.2 * RATE - 1).all()  # known ones of too few samples stay where they were
    assert (doubts >= 1.0 / motion.cutoff - 1e-12).all()
    assert (doubts <= max(0.12 * 2.0, 1.0 / motion.cutoff) + 1e-12).all()


def test_an_edge_is_the_less_certain_the_longer_it_is_slow_there():
    doubts = []
    for seconds in (0.8, 4.0):
        motion, ends = _motion((0.5, 0, 0), (seconds, 1, 0), (0.5, 0, 0))
        rows, (doubt,) = placed(motion, _rows(ends[1:3]), np.array([True]), LEVELS, 5.0)
        assert np.abs(_spans(motion, rows) - ends[1:3]).max() < doubt
        doubts.append(doubt)
    assert doubts[1] > 2.0 * doubts[0]
    assert doubts[1] < 0.9 * 0.12 * 4.0  # which it would be if the rest beside it counted


def test_where_nothing_slows_down_the_share_of_windows_counts():
    motion, _ = _motion((0.5, 0, 0), (3.0, 1, 0), (0.5, 0, 0))
    _, doubts = placed(motion, _rows((0.5, 2.0), (2.0, 3.5)), np.array([True, True]), LEVELS, 2.0)
    assert doubts == pytest.approx(0.12 * 1.5, abs=0.01)


def test_without_a_gripper_edges_stay_and_their_uncertainty_is_a_share_of_the_duration():
    motion, _ = _motion((0.5, 0, 0), (1.0, 1, 0), (0.5, 0, 0))
    rows = _rows((0.4, 1.6), (0.0, 2.0))
    same, doubts = placed(motion, rows, np.array([True, False]), None, 1.5)
    assert same is rows
    assert doubts == pytest.approx([0.18 * 1.2, 0.18 * 1.5])
    assert placed(motion, rows, np.array([True, False]), None, None)[1] == pytest.approx([0.18 * 1.2, 0.18 * 2.0])


def test_nothing_is_placed_where_nothing_is_found():
    motion, _ = _motion((0.5, 0, 0), (1.0, 1, 0), (0.5, 0, 0))
    for levels in (None, LEVELS):
        rows, doubts = placed(motion, np.empty((0, 2), dtype=np.intp), np.empty(0, dtype=bool), levels, 1.0)
        assert len(rows) == len(doubts) == 0

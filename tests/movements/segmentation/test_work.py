"""Boundaries of arms at work, from each cue alone and from all of them, against the truth."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme.errors import DataError, SpecificationError
from kineme.movements.segmentation.work import (
    CUES,
    Work,
    _best_subset,
    at_rest,
    boundaries,
    observe_work,
    roles_of,
)
from work_samples import NAMES, work_episodes

T = np.arange(300) / 50.0


def _smooth(t, begin, end):
    u = np.clip((t - begin) / (end - begin), 0.0, 1.0)
    return u**3 * (10 - 15 * u + 6 * u**2)


def _hits(times, true, within=0.25):
    return sum(bool((np.abs(times - t) <= within).any()) for t in true)


def _near(times, true, within=0.1):
    return len(times) == len(true) and np.abs(np.sort(times) - true).max() < within


@pytest.mark.parametrize(("noise", "least"), [(0.0, 0.95), (0.002, 0.9), (0.005, 0.8)])
def test_boundaries_are_those_of_the_truth(noise, least):
    episodes, truth = work_episodes(10, seed=3, noise=noise)
    n_hits = n_cuts = n_true = 0
    for episode, spans in zip(episodes, truth, strict=True):
        cuts = boundaries(episode.times, episode.signals["observation.state"], NAMES)
        true = [start for start, _, _ in spans[1:]]
        n_hits, n_cuts, n_true = n_hits + _hits(cuts.times, true), n_cuts + len(cuts.times), n_true + len(true)
    assert 2 * n_hits / (n_cuts + n_true) >= least


def test_intervals_hold_the_truth_and_confidence_is_a_probability():
    episodes, truth = work_episodes(10, seed=4)
    inside = []
    for episode, spans in zip(episodes, truth, strict=True):
        cuts = boundaries(episode.times, episode.signals["observation.state"], NAMES)
        assert ((cuts.confidence > 0) & (cuts.confidence <= 1)).all()
        assert ((cuts.intervals[:, 0] <= cuts.times) & (cuts.times <= cuts.intervals[:, 1])).all()
        assert cuts.evidence.shape == (len(cuts.times), len(CUES))
        inside += [
            ((cuts.intervals[:, 0] <= start) & (start <= cuts.intervals[:, 1])).any() for start, _, _ in spans[1:]
        ]
    assert np.mean(inside) >= 0.9


def test_a_second_gripper_that_stays_as_it_is_changes_nothing():
    (episode,), _ = work_episodes(1)
    state = episode.signals["observation.state"]
    still = 0.5 + np.random.default_rng(0).normal(scale=1e-3, size=len(state))
    heads = (*NAMES, "left_gripper.pos")
    cuts, beside = (
        boundaries(episode.times, columns, names)
        for columns, names in ((state, NAMES), (np.column_stack((state, still)), heads))
    )
    assert len(cuts.times) >= 3
    for before, after in zip(cuts, beside, strict=True):
        np.testing.assert_array_equal(before, after)
    edges = np.concatenate((episode.times[:1], cuts.times, episode.times[-1:]))
    rests = at_rest(episode.times, state, NAMES, edges)
    assert (at_rest(episode.times, np.column_stack((state, still)), heads, edges) == rests).all()


def test_they_do_not_depend_on_the_clock_nor_on_units():
    (episode,), _ = work_episodes(1)
    state = episode.signals["observation.state"]
    cuts = boundaries(episode.times, state, NAMES)
    assert len(cuts.times) >= 3
    later = boundaries(episode.times + 1e4, np.rad2deg(state), NAMES)
    np.testing.assert_allclose(later.times - 1e4, cuts.times, atol=1e-6)
    np.testing.assert_allclose(later.confidence, cuts.confidence, atol=1e-6)


def test_a_way_there_and_back_is_cut_where_it_turns():
    x = _smooth(T, 0.5, 2.5) - _smooth(T, 2.5, 4.5)
    assert _near(boundaries(T, np.column_stack((x, 2 * x)), ("joint_1", "joint_2")).times, [0.5, 2.5, 4.5], 0.2)


def test_a_corner_that_is_taken_at_full_speed_is_cut():
    x = np.column_stack((np.minimum(T, 3.0), np.maximum(T - 3.0, 0.0)))
    evidence = boundaries(T, x, ("joint_1", "joint_2")).evidence
    cuts = boundaries(T, x, ("joint_1", "joint_2"), Work(penalty=0.5)).times
    assert _near(cuts, [3.0])
    assert evidence.shape[1] == len(CUES)


def test_a_long_rest_has_two_ends():
    x = _smooth(T, 0.0, 2.0) + _smooth(T, 4.0, T[-1])
    cuts = boundaries(T, x[:, None], ("joint_1",))
    edges = np.concatenate(([0.0], cuts.times, [T[-1]]))
    assert _near(cuts.times, [2.0, 4.0], 0.25)
    assert at_rest(T, x[:, None], ("joint_1",), edges).tolist() == [False, True, False]


@pytest.mark.parametrize("name", ["gripper.pos", "left_finger_joint", "contact", "object.x"])
def test_what_a_gripper_a_contact_or_an_object_says_is_a_boundary(name):
    """While the arm goes on at an even speed, which alone has no boundary."""
    arm = np.column_stack((T, 0.5 * T))
    other = (T > 3.0).astype(float) if name == "contact" else _smooth(T, 2.0, 4.0)
    assert len(boundaries(T, arm, ("joint_1", "joint_2")).times) == 0
    cuts = boundaries(T, np.column_stack((arm, other)), ("joint_1", "joint_2", name), Work(penalty=0.5))
    assert _near(cuts.times, [3.0] if name == "contact" else [2.0, 4.0], 0.3)


def test_strokes_there_and_back_are_one_movement():
    wiping = np.where((T > 1.0) & (T < 5.0), np.sin(np.pi * (T - 1.0)) ** 2, 0.0)
    x = np.column_stack((0.8 * wiping, 0.2 * wiping))
    names = ("joint_1", "joint_2")
    assert len(boundaries(T, x, names, Work(strokes=20)).times) >= 7
    assert len(boundaries(T, x, names).times) <= 3


def test_roles_are_told_by_names():
    names = ("joint1.pos", "gripper.pos", "right_finger", "contact", "object0.x", "joint1.vel", "wrist_force", "tip.x")
    roles = {role: [names[k] for k in columns] for role, columns in roles_of(names).items()}
    assert roles == {
        "arm": ["joint1.pos", "tip.x"], "gripper": ["gripper.pos", "right_finger"], "object": ["object0.x"],
        "contact": ["contact", "wrist_force"], "aside": ["joint1.vel"],
    }  # fmt: skip


def test_missing_values_are_interpolated_and_empty_columns_left_aside():
    (episode,), _ = work_episodes(1)
    state = episode.signals["observation.state"]
    cuts = boundaries(episode.times, state, NAMES)
    holed = np.column_stack((state, np.full(len(state), np.nan)))
    holed[40:43, 2] = np.nan
    again = boundaries(episode.times, holed, (*NAMES, "joint_9"))
    np.testing.assert_allclose(again.times, cuts.times, atol=0.1)


def test_what_does_not_move_has_no_boundaries_but_rests():
    still = np.ones((100, 2))
    assert len(boundaries(T[:100], still, ("joint_1", "joint_2")).times) == 0
    assert at_rest(T[:100], still, ("joint_1", "joint_2"), T[[0, 50, 99]]).all()
    assert observe_work(T[:5], np.ones((5, 1)), ("joint_1",)) is None


def test_other_shapes_stamps_and_parameters_are_refused():
    with pytest.raises(DataError, match="a name for each column"):
        boundaries(T, np.ones((300, 2)), ("joint_1",))
    with pytest.raises(DataError, match="times that increase"):
        boundaries(np.zeros(300), np.ones((300, 1)), ("joint_1",))
    for wrong in ({"penalty": np.nan}, {"min_movement": -1.0}, {"strokes": 1}):
        with pytest.raises(SpecificationError):
            Work(**wrong)


@settings(max_examples=40, deadline=None)
@given(
    gaps=st.lists(st.floats(0.05, 1.0), min_size=0, max_size=7),
    odds=st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7),
)
def test_the_best_subset_and_its_probabilities_are_those_of_trying_all(gaps, odds):
    times, odds = np.cumsum(gaps), np.array(odds[: len(gaps)])
    subsets = [
        list(chosen)
        for size in range(len(times) + 1)
        for chosen in combinations(range(len(times)), size)
        if all(times[b] - times[a] >= 0.3 - 1e-9 for a, b in pairwise(chosen))
    ]
    totals = np.array([odds[chosen].sum() for chosen in subsets])
    chosen, probability = _best_subset(times, odds, 0.3)
    assert odds[chosen].sum() == pytest.approx(totals.max(), abs=1e-9)
    shares = np.exp(totals - totals.max()) / np.exp(totals - totals.max()).sum()
    expected = [sum(share for share, own in zip(shares, subsets, strict=True) if k in own) for k in range(len(times))]
    np.testing.assert_allclose(probability, expected, atol=1e-9)

"""Simulated arms at work: truth, faults that are there, and scores that are right on cases done by hand."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from bench.work_faults import FAULTS, plant
from bench.work_rivals import RIVALS
from bench.work_scores import auroc, boundaries_of, edges_within, rate, score_boundaries, score_names
from bench.work_sets import (
    ACTION,
    CONTACT,
    FPS,
    KINDS,
    STATE,
    TIP,
    examples,
    rig,
    work_episodes,
    write_labels,
    write_set,
)


@pytest.fixture(scope="module")
def works():
    return list(work_episodes(5, seed=7))


def test_truth_follows_in_time_and_has_all_kinds(works):
    for work in works:
        times = [time for start, end, _ in work.truth for time in (start, end)]
        assert times == sorted(times)
        assert times[0] >= 0.0
        assert times[-1] <= work.episode.times[-1]
    assert {name for work in works for _, _, name in work.truth} == set(KINDS)


def test_the_same_seed_is_the_same_work_whatever_comes_before(works):
    again = list(work_episodes(2, seed=7))[1]
    assert np.array_equal(again.episode.signals[STATE], works[1].episode.signals[STATE])
    other = next(iter(work_episodes(1, seed=8)))
    assert other.truth != works[0].truth


def test_the_follower_comes_later_by_the_lag_of_the_rig(works):
    state, action = (works[0].episode.signals[key][:, 0] for key in (STATE, ACTION))
    lags = np.arange(15)
    off = [np.var(state[lag:] - action[: len(action) - lag]) for lag in lags]
    assert lags[np.argmin(off)] / FPS == pytest.approx(rig(7).lag, abs=1.5 / FPS)


def test_signals_agree_with_the_names_of_movements(works):
    for work in works:
        for start, end, name in work.truth:
            rows = slice(round(start * FPS), round(end * FPS))
            tip, fingers = work.episode.signals[TIP][rows], work.episode.signals[STATE][rows, 6]
            if name == "press":
                assert tip[:, 2].min() < tip[[0, -1], 2].min() - 0.03
            if name == "carry":
                assert fingers.max() < 0.7
                assert work.episode.signals[CONTACT][rows].mean() > 0.8
            if name == "grasp":
                assert fingers[0] > fingers[-1] + 0.3
            if name == "reach":
                assert np.linalg.norm(tip[-1] - tip[0]) > 0.05


def test_joints_do_not_jump(works):
    for work in works:
        assert np.abs(np.diff(work.episode.signals[ACTION], axis=0)).max() < 0.15


def test_two_arms_have_fourteen_channels_of_which_seven_work():
    episode = next(iter(work_episodes(1, seed=7, arms=2))).episode
    assert episode.signals[STATE].shape[1] == len(episode.names[STATE]) == 14
    moved = np.ptp(episode.signals[STATE], axis=0)
    assert moved[:3].min() > 3.0 * moved[7:].max()


def test_a_gripper_that_steps_is_closed_while_things_are_held(works):
    stepped = next(iter(work_episodes(1, seed=7, steps=True))).episode
    for key in (STATE, ACTION):
        np.testing.assert_array_equal(stepped.signals[key][:, :-1], works[0].episode.signals[key][:, :-1])
        assert set(stepped.signals[key][:, -1]) == {0.0, 1.0}
    held = stepped.signals[CONTACT][:, 0] > 0.5
    assert stepped.signals[ACTION][held, -1].mean() < 0.3
    assert stepped.signals[ACTION][~held, -1].mean() > 0.9


def test_a_set_is_read_back_with_the_examples(works, tmp_path):
    import kineme
    from kineme.io.reading.read_labels import labeled_pieces, read_labels

    write_set(tmp_path / "set", (work.episode for work in works))
    recordings = kineme.read_recordings(tmp_path / "set")
    assert len(recordings) == len(works)
    assert not recordings.problems
    assert list(recordings.labels) == [work.episode.task for work in works]
    rows = examples(works, each=1)
    assert sorted(name for *_, name in rows) == sorted(KINDS)
    write_labels(tmp_path / "labels.csv", rows)
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "labels.csv"))
    assert [source.label for source in pieces.sources] == [name for *_, name in rows]


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_change_what_is_stored_and_leave_the_original(works, fault):
    episode = works[0].episode
    before = {key: values.copy() for key, values in episode.signals.items()}
    damaged = FAULTS[fault](episode, np.random.default_rng(0), 1.0)
    assert damaged.number == episode.number
    assert {len(values) for values in damaged.signals.values()} == {len(damaged.times)}
    same = [np.array_equal(damaged.signals[key], before[key]) for key in before]
    assert not all([*same, np.array_equal(damaged.times, episode.times)])
    assert all(np.array_equal(episode.signals[key], before[key]) for key in before)


def test_faults_are_planted_in_the_share_that_was_asked_for(works):
    planted = list(plant(works, 0.4, seed=0))
    assert sum(one.fault is not None for one in planted) == 2
    assert all(one.episode is work.episode for one, work in zip(planted, works, strict=True) if one.fault is None)


def test_rules_of_others_find_what_they_are_about():
    works = list(work_episodes(12, seed=7, tasks=("press the buttons",)))
    episodes = [work.episode for work in works]
    clean = {name: rule(episodes) for name, rule in RIVALS.items()}
    episodes[3] = FAULTS["dropped"](episodes[3], np.random.default_rng(0), 1.0)
    for name in ("lerobot-doctor's rules", "robot-data-audit's rules"):
        assert RIVALS[name](episodes).flagged[3]
        assert not clean[name].flagged[3]


def test_boundaries_are_matched_one_to_one():
    truth = [[(0.0, 1.0, "a"), (1.05, 2.0, "b")]]
    assert boundaries_of(truth[0]).tolist() == pytest.approx([0.0, 1.025, 2.0])
    score = score_boundaries(truth, [[(0.2, 1.2, "a"), (1.2, 1.9, "b"), (1.95, 2.6, None)]])
    assert (score.hits, score.found, score.true) == (3, 4, 3)
    assert score.f1 == pytest.approx(6 / 7)


def test_names_are_those_of_the_segment_that_shares_most():
    names = score_names([[(0.0, 1.0, "a"), (2.0, 3.0, "b"), (5.0, 6.0, "a")]], [[(0.1, 1.0, "a"), (2.0, 2.4, None)]])
    assert (names.true, names.right, names.matched, names.matched_right) == (3, 1, 1, 1)
    assert names.confused == {("a", "a"): 1, ("b", "unknown"): 1, ("a", "missed"): 1}


def test_rates_and_areas():
    assert auroc([0.0, 1.0, 2.0, 2.0], [False, False, True, True]) == 1.0
    assert auroc([1.0, 1.0], [False, True]) == 0.5
    share, low, high = rate(0, 100)
    assert (share, low) == (0.0, 0.0)
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 100))


def test_edges_within_their_uncertainty_are_counted_of_movements_that_match():
    truth = [[(0.0, 1.0, "a"), (2.0, 3.0, "b")], [(0.0, 1.0, "a")]]
    found = [[(0.1, 1.3, "a"), (2.0, 3.0, None), (2.7, 3.0, "b")], [(0.05, 1.0, "a")]]
    assert edges_within(truth, found, [[0.2, 1.0, 1.0], [0.01]]) == (2, 4)

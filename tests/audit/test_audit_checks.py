"""Planted faults: each is found, by the check that is meant for it, where it is; good episodes stay."""

import numpy as np
import pytest
from audit_samples import CONTRADICTIONS, FAULTS, FPS, episode, episodes, spike, with_state

from kineme.audit.checks import CHECKS
from kineme.audit.motion import features_of, frames_behind, motion_of, path_of
from kineme.audit.run import audit_episodes
from kineme.movements.episodes import Episode

N, BAD = 80, (7, 23, 41, 66)


@pytest.fixture(scope="module")
def clean():
    return episodes(N)


def planted(clean, fault):
    return [fault(each) if each.number in BAD else each for each in clean]


def auroc(scores):
    bad = np.isin(np.arange(N), BAD)
    return np.mean(scores[bad][:, None] > scores[~bad]) + 0.5 * np.mean(scores[bad][:, None] == scores[~bad])


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_planted_fault_is_found_and_named(clean, fault):
    audit = audit_episodes(planted(clean, fault))
    assert auroc(audit.evidence) >= 0.95
    assert audit.flagged[list(BAD)].sum() >= 3
    assert np.delete(audit.flagged, BAD).mean() <= 0.05 * 4 / 3
    for finding in audit.findings:
        if finding.episode in BAD:
            assert {reason.check for reason in finding.reasons} & FAULTS[fault]


@pytest.mark.parametrize("fault", CONTRADICTIONS, ids=lambda fault: fault.__name__)
def test_a_contradiction_is_certain(clean, fault):
    audit = audit_episodes(planted(clean, fault))
    certain = [finding for finding in audit.findings if finding.kind == "contradiction"]
    assert {finding.episode for finding in certain} == set(BAD)
    assert {finding.reasons[0].check for finding in certain} == {CONTRADICTIONS[fault]}
    assert {finding.p_value for finding in certain} == {0.0}


def test_every_check_finds_a_fault():
    """So that no row of the table is without proof; problems are those of the reader, below."""
    proved = set().union(*FAULTS.values(), CONTRADICTIONS.values(), {"problems", "task"})
    assert {check.name for check in CHECKS} == proved


def test_stretches_are_where_the_faults_are(clean):
    audit = audit_episodes(planted(clean, spike))
    for finding in audit.findings:
        for reason in finding.reasons:
            assert 0 <= reason.start <= reason.end <= finding.seconds
            if finding.episode in BAD and reason.check == "spikes":
                assert reason.start <= 200 / FPS <= reason.end + 1 / FPS
                assert reason.channel == "lift.pos"


def test_problems_of_the_reader_and_episodes_without_motion_are_contradictions(clean):
    broken = Episode(N, np.empty(0), {"observation.state": np.empty((0, 5))}, {}, "stack", FPS, ("no shard",))
    short = Episode(N + 1, np.arange(3) / FPS, {"observation.state": np.zeros((3, 5))}, {}, "stack", FPS)
    other = Episode(N + 2, np.arange(50) / FPS, {"observation.state": np.zeros((50, 2))}, {}, "stack", FPS)
    audit = audit_episodes([broken, *clean, short, other])
    words = {finding.episode: finding.reasons[0].words for finding in audit.findings if finding.kind == "contradiction"}
    assert set(words) == {N, N + 1, N + 2}
    assert words[N] == "no shard"
    assert "3 frames" in words[N + 1]
    assert "channels" in words[N + 2]


def test_an_episode_with_the_name_of_another_task_is_found():
    mixed = episodes(80, tasks=("stack", "wipe"))
    wrong = mixed[11]
    mixed[11] = episode(11, 0, "stack")
    mixed[11] = Episode(11, mixed[11].times, mixed[11].signals, mixed[11].names, wrong.task, FPS)
    audit = audit_episodes(mixed)
    finding = next(finding for finding in audit.findings if finding.episode == 11)
    assert finding.kind == "outlying"
    assert "task" in {reason.check for reason in finding.reasons}


@pytest.mark.parametrize("frames", [-7.0, 3.0, 4.5])
def test_the_lag_is_found_between_samples(frames):
    t = np.arange(500) / FPS
    wave = [np.sin(2 * np.pi * rate * t) for rate in (0.31, 0.47, 0.83)]
    late = [np.sin(2 * np.pi * rate * (t - frames / FPS)) for rate in (0.31, 0.47, 0.83)]
    assert frames_behind(np.stack(wave, axis=1), np.stack(late, axis=1), 25) == pytest.approx(frames, abs=0.1)


def test_an_action_that_the_state_does_not_follow_has_no_lag():
    clean = episode(0)
    noise = np.random.default_rng(0).normal(size=clean.signals["action"].shape)
    motion = motion_of(Episode(0, clean.times, {**clean.signals, "action": noise}, clean.names, None, FPS))
    assert np.isnan(motion.late)
    assert all(np.isnan(check.measure(motion).values).all() for check in CHECKS if check.name in {"lag", "offset"})


def test_counters_and_rewards_are_no_motion():
    signals = dict.fromkeys(("observation.state", "action", "next.reward", "frame_index"), np.zeros((9, 1)))
    features = features_of(Episode(0, np.arange(9.0), signals, {}))
    assert features == (("observation.state",), ("action",))


def test_what_is_missing_does_not_spread():
    clean = episode(0)

    def lose(state):
        state[:30, 0], state[90:95, 1], state[:, 2] = np.nan, np.inf, np.nan

    motion = motion_of(with_state(clean, lose))
    assert np.isfinite(motion.state).all()
    assert np.isfinite(path_of(motion)).all()


def test_a_way_does_not_depend_on_tempo():
    clean = episode(0)
    slow = {name: np.repeat(values, 2, axis=0) for name, values in clean.signals.items()}
    motions = [motion_of(each) for each in (clean, Episode(0, np.arange(2 * len(clean)) / FPS, slow, clean.names))]
    way, other = (path_of(motion) for motion in motions)
    assert np.abs(way - other).max() < 0.1

"""The stated share of good episodes that are flagged, whatever their law; ranks, tasks, orders and units."""

import json
from dataclasses import replace

import numpy as np
import pytest
from audit_samples import episodes, shift, slow_clock, spike
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme.audit import calibrate
from kineme.audit import run as run_module
from kineme.audit.page import audit_page
from kineme.audit.report import audit_as_data, audit_as_words
from kineme.audit.run import audit_episodes
from kineme.errors import DataError, SpecificationError
from kineme.movements.episodes import Episode
from soaking import examples as drawn

LAWS = {
    "exponential": lambda rng, size: rng.exponential(size=size),
    "normal": lambda rng, size: rng.normal(size=size),
    "heavy": lambda rng, size: rng.standard_t(2, size=size),
    "counts": lambda rng, size: rng.poisson(0.7, size=size).astype(float),
    "bounded": lambda rng, size: rng.uniform(size=size),
}


def flagged(values, groups, error_rate):
    """Share of episodes that a single check flags."""
    evidence = calibrate.evidence_of(values, groups, 0.1)
    ranking = calibrate.rank(evidence, np.ones(len(values), dtype=bool), error_rate)
    return (ranking.p_values <= error_rate) | ranking.outlying


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("n", [40, 100, 400])
def test_the_stated_rate_holds_for_any_law_and_number_of_checks(law, n):
    """On sets without faults: at most the stated share and a third, by the bound for so many draws."""
    rng = np.random.default_rng(n)
    shares = [flagged(LAWS[law](rng, (n, 8)), [np.arange(n)], 0.05).mean() for _ in range(60)]
    assert np.mean(shares) <= 0.05 * 4 / 3
    if law != "counts":
        assert np.mean(shares) >= 0.05 * 2 / 3


@settings(max_examples=drawn(20), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(20, 90), rate=st.sampled_from([0.05, 0.1, 0.2]))
def test_p_values_are_shares_of_ranks(seed, n, rate):
    rng = np.random.default_rng(seed)
    evidence = rng.exponential(size=(n, 3))
    ranking = calibrate.rank(evidence, np.ones(n, dtype=bool), rate)
    inside = ~ranking.outlying if ranking.outlying.sum() > rate * n else np.ones(n, dtype=bool)
    order = np.argsort(-ranking.evidence[inside])
    assert np.allclose(ranking.p_values[inside][order], np.arange(1, inside.sum() + 1) / inside.sum())
    assert (ranking.p_values[inside] <= rate).sum() == int(rate * inside.sum() + 1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_clean_set_has_the_stated_share(seed):
    audit = audit_episodes(episodes(100, seed))
    assert audit.by_chance == 5
    assert 0.05 * 2 / 3 <= audit.flagged.mean() <= 0.05 * 4 / 3
    assert audit.calibrated


def test_outlying_episodes_do_not_hide_the_others():
    """Of 100 episodes, ten are bad in two ways: all are found, although five is the share that is flagged by chance."""
    mixed = episodes(100)
    for k in range(10):
        mixed[9 * k] = (spike if k % 2 else shift)(mixed[9 * k])
    audit = audit_episodes(mixed)
    assert audit.flagged[np.arange(10) * 9].all()
    assert {finding.kind for finding in audit.findings if finding.episode % 9 == 0 and finding.episode < 90} == {
        "outlying"
    }


def test_too_few_episodes_are_ranked_and_not_flagged():
    few = episodes(12)
    few[3], few[5] = spike(few[3]), slow_clock(few[5])
    audit = audit_episodes(few)
    assert not audit.calibrated
    assert np.flatnonzero(audit.flagged).tolist() == [5]
    assert [finding.kind for finding in audit.findings[:2]] == ["contradiction", "ranked"]
    assert audit.findings[1].episode == 3


def test_one_episode_alone_is_audited_too():
    audit = audit_episodes(episodes(1))
    assert not audit.flagged.any()
    assert audit_episodes([slow_clock(*episodes(1))]).flagged.all()


def test_a_contradiction_of_most_is_one_of_the_set():
    audit = audit_episodes([slow_clock(each) for each in episodes(40)])
    assert audit.of_the_set[0].startswith("rate: in 40 of 40 episodes, frames come at 25 per second")
    assert not any(finding.kind == "contradiction" for finding in audit.findings)


def test_notes_on_the_set_are_no_episode():
    note = replace(episodes(1)[0], number=-1, problems=("expected meta/tasks.parquet, got none",))
    audit = audit_episodes([note, *episodes(25)])
    assert len(audit.numbers) == 25
    assert audit.of_the_set == ("expected meta/tasks.parquet, got none",)


def test_order_and_units_do_not_count():
    mixed = episodes(60)
    mixed[4] = shift(mixed[4])
    audit = audit_episodes(mixed)
    back = audit_episodes(mixed[::-1])
    assert np.allclose(back.evidence[::-1], audit.evidence, rtol=1e-5)
    degrees = [replace(each, signals={name: np.rad2deg(xs) for name, xs in each.signals.items()}) for each in mixed]
    assert np.corrcoef(audit_episodes(degrees).evidence, audit.evidence)[0, 1] > 0.98


def test_tasks_are_compared_with_themselves():
    """Two tasks: what is usual in one is not in the other, and neither is flagged for it."""
    audit = audit_episodes(episodes(120, tasks=("stack", "wipe")))
    assert audit.tasks == 2
    assert audit.flagged.mean() <= 0.05 * 4 / 3
    assert abs(audit.flagged[::2].sum() - audit.flagged[1::2].sum()) <= 2


def test_many_tasks_of_few_are_pooled():
    many = [replace(each, task=f"task {each.number // 4}") for each in episodes(60)]
    many[10] = spike(many[10])
    audit = audit_episodes(many)
    assert audit.calibrated
    assert audit.findings[0].episode == 10


def test_what_is_spooled_to_the_disk_is_the_same(monkeypatch):
    mixed = episodes(30)
    mixed[7] = spike(mixed[7])
    audit = audit_episodes(mixed)
    monkeypatch.setattr(run_module, "_IN_MEMORY", 1)
    spooled = audit_episodes(mixed)
    assert spooled.findings == audit.findings


def test_progress_counts_measuring_and_comparing():
    counts = []
    audit_episodes(episodes(25), progress=counts.append)
    assert sum(counts) == 50


def test_no_episodes_and_no_rate_are_refused():
    with pytest.raises(DataError, match="expected a data set with episodes"):
        audit_episodes([])
    with pytest.raises(SpecificationError, match="error_rate"):
        audit_episodes(episodes(1), error_rate=1.0)


def test_centered_values_of_few_are_about_the_median_of_all():
    values = np.array([[1.0], [2.0], [3.0], [np.nan], [10.0], [11.0], [12.0], [13.0], [14.0]])
    tasks = [np.arange(4), np.arange(4, 9)]
    centered = calibrate.centered(values, tasks)[:, 0]
    assert centered[4:].tolist() == [-2, -1, 0, 1, 2]
    assert centered[0] == 1 - np.nanmedian(values)
    assert np.isnan(centered[3])


def _odd_episode(rng, number):
    """An episode with whatever a data set may hold: constants, huge and missing values, no frames, mad stamps."""
    n, d = int(rng.choice([0, 1, 7, 8, 9, 40, 200])), 3
    kinds = [
        np.zeros((n, d)), rng.normal(size=(n, d)), rng.normal(size=(n, d)) * 1e200, np.full((n, d), np.nan),
        np.where(rng.random((n, d)) < 0.3, np.inf, 1.0), np.cumsum(rng.normal(size=(n, d)), axis=0),
        np.full((n, d), 1e308),
    ]  # fmt: skip
    times = [np.arange(n) / 50, np.full(n, np.nan), np.zeros(n), -np.arange(n) * 1.0, rng.normal(size=n) * 1e300]
    state, action = (kinds[int(rng.integers(len(kinds)))] for _ in range(2))
    stamps = times[int(rng.integers(len(times)))]
    fps = float(rng.choice([50, np.nan, 1e-9]))
    names = {"observation.state": ("a", "b", "c"), "action": ("a", "b", "c")}
    return Episode(number, stamps, {"observation.state": state, "action": action}, names, "odd", fps)


@settings(max_examples=drawn(30), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 40))
def test_whatever_a_set_holds_is_audited_without_a_warning(seed, n):
    rng = np.random.default_rng(seed)
    odd = [_odd_episode(rng, k) for k in range(n)]
    audit = audit_episodes(odd)
    assert np.isfinite(audit.evidence).all()
    assert ((audit.p_values >= 0) & (audit.p_values <= 1)).all()
    audit_as_words(audit)
    json.dumps(audit_as_data(audit), allow_nan=False)
    audit_page(audit, "odd", odd, {})

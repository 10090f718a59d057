"""The open set: members are kept at the rate asked for, strangers are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom
from sklearn.metrics import roc_auc_score

import kineme
from kineme import Recognizer
from kineme.errors import SpecificationError
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition.conformal import calibrate
from kineme.similarity.scores import nearest as nearest_of_each
from movement_samples import draw_shapes

ALL = Perturbation(shift=1, scale=1, rotation=np.deg2rad(20), warp=0.35, noise=0.01)


def _split(counts, d, seed, members=20):
    """A fitted recognizer, and fresh members with the number of their class."""
    counts = np.asarray(counts)
    demos = draw_shapes(counts + members, d, seed, spread=0.25)
    place = np.concatenate([np.arange(count + members) for count in counts])
    train = place < np.repeat(counts, counts + members)
    fresh = demos[~train]
    return Recognizer(classifier="nearest").fit(demos[train]), fresh, np.repeat(np.arange(len(counts)), members)


def _false_unknown(counts, rate, seeds, members=20):
    """Members, and how many of them have a p-value for their own class at or below the rate."""
    misses = total = 0
    for seed in seeds:
        recognizer, fresh, own = _split(counts, 2, seed, members)
        p = recognizer.p_values(fresh, rate)[np.arange(len(own)), own]
        misses, total = misses + int((p <= rate).sum()), total + len(own)
    return misses, total


@pytest.mark.parametrize(
    ("counts", "rate"),
    [
        ([25] * 4, 0.05),  # each class speaks for itself
        ([12] * 4, 0.1),
        ([5] * 10, 0.05),  # pooled
        ([3] * 10, 0.1),
        ([2, 3, 8, 2, 5, 3, 10, 2], 0.1),  # pooled, unequal
    ],
)
def test_members_are_refused_at_no_more_than_the_error_rate(counts, rate):
    """Over fresh demonstrations and members alike; the demonstrations' luck widens the binomial bound."""
    misses, total = _false_unknown(counts, rate, range(5))
    calibrating = 5 * sum(counts)
    slack = 3 * np.sqrt(rate * (1 - rate) / calibrating)
    assert misses <= binom.ppf(0.999, total, rate + slack)


@pytest.mark.parametrize("counts", [[25] * 4, [12] * 4])
def test_the_error_rate_is_used_not_only_kept(counts):
    """With a p-value that never refuses, keeping the rate is no art."""
    misses, total = _false_unknown(counts, 0.2, range(5))
    assert misses >= 0.06 * total


@pytest.mark.parametrize("counts", [[1] * 6, [1, 1, 9], [3] * 4, [25] * 3])
@given(seed=st.integers(0, 10**6))
def test_p_values_are_shares_that_fall_with_strangeness(counts, seed):
    recognizer, fresh, _ = _split(counts, 2, seed, members=5)
    p = recognizer.p_values(fresh)
    assert p.shape == (len(fresh), len(counts))
    assert (p >= 0).all()
    assert (p <= 1).all()
    nearest = recognizer._scores(fresh, nearest_of_each)
    for c in range(len(counts)):
        order = np.argsort(nearest[:, c])
        assert (np.diff(p[order, c]) >= 0).all()


def test_the_formula_with_enough_members_of_the_class():
    """Counted by hand: each demonstration against all others of its class."""
    recognizer, fresh, _ = _split([20, 24], 2, seed=3)
    logs = recognizer.log_similarity(recognizer.demonstrations_)
    np.fill_diagonal(logs, -np.inf)
    seen = recognizer.log_similarity(fresh)
    expected = np.empty((len(fresh), 2))
    for c, rows in enumerate((slice(0, 20), slice(20, 44))):
        left_out, nearest = logs[rows, rows].max(axis=1), seen[:, rows].max(axis=1)
        n = len(left_out)
        expected[:, c] = [(1 + (left_out <= one).sum()) / (n + 1) for one in nearest]
    np.testing.assert_allclose(recognizer.p_values(fresh), expected, atol=1e-12)


def test_strangers_far_away_keep_their_order():
    """Similarities underflow there; their logarithms do not."""
    recognizer, fresh, _ = _split([3] * 5, 2, seed=1)
    factors = np.array([1.0, 4.0, 16.0])
    u = np.linspace(0, 1, 80)
    wild = [np.column_stack((u, f * np.sin(40 * u) * u)) for f in factors]
    novelty = recognizer.novelty(wild)
    assert novelty.min() > recognizer.novelty(fresh).max()
    assert len(np.unique(novelty)) == 3


def test_each_of_unequal_classes_is_calibrated_at_its_own_size():
    """A class shown once is not held to the nearness that forty demonstrations give each other."""
    recognizer = Recognizer(classifier="nearest").fit(draw_shapes([1, 40], seed=2))
    scales = calibrate(recognizer.comparison_.similarity, recognizer.references_).scales
    assert scales[0] > 1.2 * scales[1]


def test_a_demonstration_has_no_say_in_its_own_scale():
    """Two of each class: were it in, no score could exceed (2 + 4) / 2 of its mean."""
    recognizer = Recognizer().fit(draw_shapes([2] * 12, seed=5))
    calibration, left = recognizer.calibration(), recognizer_distances(recognizer)
    np.testing.assert_allclose(calibration.pooled[0], left / left.mean(), rtol=3e-5)  # rows are single precision


def recognizer_distances(recognizer):
    """Distance of each demonstration to the other one of its class, in widths."""
    logs = recognizer.log_similarity(recognizer.demonstrations_)
    i = np.arange(len(logs))
    return np.sqrt(-2 * logs[i, i ^ 1])


def test_thirteen_known_and_thirteen_unknown_shapes_with_everything_perturbed():
    demos = kineme.load_lasa()
    aurocs, rejected, refused = [], [], []
    for draw in range(2):
        random = np.random.default_rng(draw)
        known = random.permutation(np.unique(demos.labels))[:13]
        moved, is_known = ALL.apply(demos, draw), np.isin(demos.labels, known)
        train = is_known & (np.tile(random.permutation(7), 26) < 5)
        recognizer = Recognizer().fit(moved[train])
        members, strangers = moved[is_known & ~train], moved[~is_known]
        a, b = recognizer.novelty(members), recognizer.novelty(strangers)
        aurocs.append(roc_auc_score(np.repeat([0, 1], [len(a), len(b)]), np.append(a, b)))
        rejected.append(np.mean(b > np.quantile(a, 0.95)))
        refused += [one is None for one in recognizer.predict_known(members)]
        by_herself = Recognizer().fit(moved[train], groups=range(int(train.sum())))  # each as if by somebody else
        assert np.mean([one is None for one in by_herself.predict_known(strangers)]) >= 0.95
        assert np.mean([one is None for one in recognizer.predict_known(strangers)]) >= 0.9
    assert min(aurocs) >= 0.99
    assert min(rejected) >= 0.95
    assert sum(refused) <= binom.ppf(0.99, len(refused), 0.05)


def test_one_shot_strangers_are_mostly_refused_and_members_mostly_kept():
    """No rate is guaranteed here, and single draws differ: averages."""
    kept, refused = [], []
    for draw in range(3):
        demos = ALL.apply(kineme.load_lasa(), draw)
        known = np.isin(demos.labels, np.random.default_rng(draw).permutation(np.unique(demos.labels))[:13])
        recognizer = Recognizer().fit(demos[known][::7])
        kept.append(np.mean([one is not None for one in recognizer.predict_known(demos[known])]))
        refused.append(np.mean([one is None for one in recognizer.predict_known(demos[~known])]))
    assert np.mean(kept) >= 0.9
    assert np.mean(refused) >= 0.8


@pytest.mark.parametrize("ask", ["recognize", "p_values", "predict_known"])
@pytest.mark.parametrize(
    ("rate", "words"), [(0.0, "above 0, got 0.0"), (1.0, "below 1, got 1.0"), ("5 %", "got '5 %'")]
)
def test_an_error_rate_is_a_share(ask, rate, words):
    demos = draw_shapes([2, 2])
    with pytest.raises(SpecificationError, match=f"expected error_rate.*{words}"):
        getattr(Recognizer().fit(demos), ask)(demos, rate)


def test_fitting_again_forgets_the_calibration():
    demos, others = draw_shapes([3, 3, 3]), draw_shapes([4, 4], seed=1)
    recognizer = Recognizer().fit(demos)
    recognizer.p_values(demos)
    again = recognizer.fit(others).p_values(others)
    np.testing.assert_array_equal(again, Recognizer().fit(others).p_values(others))


@pytest.mark.parametrize("d", [2, 3])
def test_copies_are_known_where_all_demonstrations_have_copies(d):
    """Distances between copies are rounding errors, of which none is more novel than another."""
    demos = draw_shapes([3] * 4, d)
    twice = demos[np.repeat(np.arange(len(demos)), 2)]
    recognizer = Recognizer().fit(twice)
    assert (recognizer.predict_known(demos) == demos.labels).all()
    assert all(recognizer.recognize(one).label is not None for one in demos)


def repeated(noise, n, rest=0, cut=0, seed=0):
    """Three movements that a machine repeats n times, and stands before and after them for `rest` samples of 10 ms."""
    rng, u = np.random.default_rng(seed), np.linspace(0, 1, 150)
    s, movements, labels = 10 * u**3 - 15 * u**4 + 6 * u**5, [], []
    for c in range(3):
        for _ in range(n):
            path = np.column_stack(
                (0.3 * np.sin((c + 1) * np.pi * s), 0.2 * np.cos((c + 2) * 2 * s), 0.3 * s ** (c + 1))
            )
            whole = np.concatenate((np.repeat(path[:1], rest, axis=0), path, np.repeat(path[-1:], rest, axis=0)))
            shown = whole[cut : len(whole) - cut]
            movements.append(shown + noise * (rng.standard_normal(3) + 0.3 * rng.standard_normal(shown.shape)))
            labels.append("abc"[c])
    return kineme.Demonstrations.from_arrays(movements, labels)


@pytest.mark.parametrize("noise", [0.0002, 0.001, 0.003])
@pytest.mark.parametrize("n", [3, 4])
def test_what_a_machine_repeats_is_known_with_other_first_and_last_samples(noise, n):
    """50 ms of rest at both ends, or 30 ms cut off, differ by more than such repetitions do."""
    recognizer = kineme.Recognizer().fit(repeated(noise, n, seed=3))
    for more in ({}, {"rest": 5}, {"cut": 3}):
        asked = repeated(noise, 4, seed=7, **more)
        answers = recognizer.recognize(asked)
        assert [one.label for one in answers] == asked.labels.tolist()
    u = np.linspace(0, 1, 150)
    foreign = np.column_stack((u**3, 0.2 * np.sin(9 * u), 0.3 * np.cos(7 * u)))
    assert recognizer.recognize([foreign])[0].label is None

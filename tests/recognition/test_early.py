"""Beginnings of movements."""

from __future__ import annotations

import math

import numpy as np
import pytest

import kineme
from kineme.errors import SpecificationError, TrajectoryError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import RotationPrior
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.early import evidence
from kineme.recognition.early.evidence import cut, earliness
from kineme.recognition.early.evidence import partial_shares as shares_of
from kineme.recognition.early.hypotheses import (
    N_PREFIX,
    Early,
    beginning_procrustes,
    beginnings,
    describe_prefixes,
    ending,
    hypotheses,
    smooth_paths,
    smoother,
)
from kineme.similarity.describe import N_POINTS


def partial_shares(recognizer, movements):
    stored = hypotheses(recognizer.comparison_, recognizer.references_, Early())
    return shares_of(recognizer.comparison_, stored, movements)


def _spirals(n_dims, per_class=4, n_classes=4, seed=0):
    """Smooth random curves, a class each, with small differences within a class and a pace of their own."""
    rng, u = np.random.default_rng(seed), np.linspace(0.0, 1.0, 120)
    waves = np.sin(np.pi * np.arange(1, 5)[:, None] * u)
    kinds = rng.normal(size=(n_classes, n_dims, 4))
    arrays, labels, times = [], [], []
    for k in range(n_classes):
        for _ in range(per_class):
            own = kinds[k] + 0.05 * rng.normal(size=(n_dims, 4))
            arrays.append((own @ waves + 2.0 * u * kinds[k, :, :1]).T)
            times.append(u ** rng.uniform(0.9, 1.1) * rng.uniform(0.8, 1.2))
            labels.append(f"kind {k}")
    return Demonstrations.from_arrays(arrays, labels, times)


def _split(demos, per_class=4):
    known = np.arange(len(demos)) % per_class < 2
    return demos[known], demos[~known]


@pytest.mark.parametrize("n_dims", [1, 2, 3, 4])
def test_more_of_the_path_is_at_least_as_good_in_any_dimension(n_dims):
    train, test = _split(_spirals(n_dims))
    recognizer = kineme.Recognizer().fit(train)
    scores = earliness(recognizer, test, fractions=(0.3, 0.6, 1.0))
    assert scores[-1] == 1.0
    assert scores[0] <= scores[1] + 0.2
    assert scores[1] >= 0.85


@pytest.mark.soak
def test_half_of_the_path_of_real_movements():
    demos = kineme.load_lasa()
    demos = demos[[i for i, label in enumerate(demos.labels) if not label.startswith("Multi")]]
    train = np.arange(len(demos)) % 7 < 3
    recognizer = kineme.Recognizer().fit(demos[train])
    half, most = earliness(recognizer, demos[~train], fractions=(0.5, 0.7))
    assert half >= 0.93
    assert most >= 0.97


@pytest.mark.parametrize("seed", [0, 2])
def test_half_of_a_signal_is_recognized_by_its_values_over_time(seed):
    """Along its path a signal is a line, to and fro: of these, less than six in ten were recognized."""
    rng, waves = np.random.default_rng(seed), np.sin(np.pi * np.arange(1, 5)[:, None] * np.linspace(0.0, 1.0, 120))
    kinds = np.repeat(rng.normal(size=(8, 4)), 4, axis=0) + 0.1 * rng.normal(size=(32, 4))
    signals, labels = list((kinds @ waves)[:, :, None]), np.repeat(list("abcdefgh"), 4)
    shown = np.arange(32) % 4 < 2
    recognizer = kineme.Recognizer().fit([signals[i] for i in np.flatnonzero(shown)], labels[shown])
    halves = [signals[i][:60] for i in np.flatnonzero(~shown)]
    assert (recognizer.predict_partial(halves) == labels[~shown]).mean() >= 0.8


@pytest.mark.parametrize("seed", range(5))
def test_beginnings_do_not_see_place_or_size(seed):
    rng = np.random.default_rng(seed)
    paths = np.cumsum(rng.normal(size=(3, 2, 200)), axis=2)
    progress = np.array([0.3, 1.0])
    plain, moved = beginnings(paths, progress), beginnings(5.0 * paths + 3.0, progress)
    np.testing.assert_allclose(moved.positions, plain.positions, atol=1e-9)
    np.testing.assert_allclose(moved.sizes, 5.0 * plain.sizes)
    np.testing.assert_allclose(np.linalg.norm(plain.positions, axis=1), 1.0)
    shapes = [describe_prefixes(one, Procrustes(2)).pairs.shapes.arrays() for one in (plain, moved)]
    for name, array in shapes[0].items():
        np.testing.assert_allclose(shapes[1][name], array, atol=1e-4, err_msg=name)
    np.testing.assert_allclose(np.linalg.norm(shapes[0]["tangents"], axis=2), 1.0, atol=1e-6)


def test_a_straight_line_at_even_speed():
    paths = np.stack([np.linspace(0.0, 2.0, 200), np.zeros(200)])[None]
    seen = beginnings(paths, np.array([0.25, 0.5]))
    np.testing.assert_allclose(seen.lengths, [0.5, 1.0])
    np.testing.assert_allclose(seen.elapsed, [0.25, 0.5])
    np.testing.assert_allclose(seen.end_speeds, 0.0, atol=1e-9)
    np.testing.assert_allclose(seen.timing * np.sqrt(N_PREFIX), np.tile(np.linspace(0, 1, N_PREFIX), (2, 1)), atol=1e-9)


def test_the_smoother_is_the_smoothing_spline():
    x = np.cumsum(np.random.default_rng(1).normal(size=(N_POINTS, 2)), axis=0)
    spline = Smooth(10.0).apply(Demonstrations.from_arrays([x])).positions
    np.testing.assert_allclose(smoother(10.0) @ x, spline, atol=1e-8)
    np.testing.assert_allclose(smooth_paths(Demonstrations.from_arrays([x]), 10.0)[0].T, spline - spline[0], atol=1e-8)


def test_what_resembles_nothing_is_unknown():
    train, test = _split(_spirals(2))
    recognizer = kineme.Recognizer().fit(train)
    t = np.linspace(0.0, 1.0, 200)
    loops = np.stack([np.cos(25.0 * t), np.sin(25.0 * t)], axis=1)
    assert partial_shares(recognizer, [loops])[0, -1] > 0.9
    shares = partial_shares(recognizer, test)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert np.median(shares[:, -1]) < 0.2


def test_a_known_size_tells_a_large_movement_from_a_small_one():
    train, _ = _split(_spirals(2, n_classes=2))
    both = Demonstrations.from_arrays(
        [one.positions * (3.0 if i % 2 else 1.0) for i, one in enumerate(train[:2]) for _ in (0,)] * 2,
        ["small", "large"] * 2,
    )
    recognizer = kineme.Recognizer(scale="none").fit(both)
    np.testing.assert_array_equal(recognizer.predict_partial(cut(both, 0.9)), both.labels)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_progress": 1}, "expected n_progress to be a whole number of at least 2, got 1"),
        ({"size_spread": 0.0}, "expected size_spread to be a number above 0, got 0.0"),
        ({"duration_spread": math.nan}, "expected duration_spread to be a number above 0, got nan"),
    ],
)
def test_wishes_out_of_range_are_refused(options, message):
    with pytest.raises(SpecificationError, match=message):
        Early(**options)


def test_wrong_inputs_are_refused():
    train, test = _split(_spirals(2))
    recognizer = kineme.Recognizer().fit(train)
    with pytest.raises(TrajectoryError, match="expected movements of 2 dimensions as learned, got 3"):
        recognizer.predict_partial(np.zeros((1, 10, 3)))
    with pytest.raises(SpecificationError, match=r"expected a fraction above 0 and at most 1, got 1\.5"):
        cut(test, 1.5)


def test_hypotheses_are_kept_until_others_are_asked_for_or_fitted():
    recognizer = kineme.Recognizer().fit(_spirals(2))
    first = recognizer.stream()._hypotheses
    assert recognizer.stream()._hypotheses is first
    assert recognizer.stream(early=Early(n_progress=10))._hypotheses is not first
    assert recognizer.stream()._hypotheses is not first
    assert recognizer.fit(_spirals(2, n_classes=3)).stream()._hypotheses.prefixes is not first.prefixes


def _fitted_in_space(order=None):
    train, test = _split(_spirals(3, per_class=6, n_classes=5), per_class=6)
    order = np.arange(len(train)) if order is None else order(len(train))
    return kineme.Recognizer().fit(train[order]), test


def test_the_order_of_training_does_not_matter():
    recognizer, test = _fitted_in_space()
    other, _ = _fitted_in_space(lambda n: np.random.default_rng(0).permutation(n))
    for fraction in (0.4, 1.0):
        parts = cut(test, fraction)
        np.testing.assert_allclose(partial_shares(other, parts), partial_shares(recognizer, parts), atol=1e-6)


def test_a_beginning_is_answered_alone_as_among_others():
    recognizer, test = _fitted_in_space()
    parts = cut(test, 0.6)
    together = partial_shares(recognizer, parts)
    alone = np.concatenate([partial_shares(recognizer, parts[[i]]) for i in range(len(parts))])
    np.testing.assert_allclose(alone, together, atol=1e-6)


def _settling(demos):
    """The same movements, slower and slower towards their end."""
    times = [one.times[-1] * (1.0 - np.sqrt(1.0 - np.linspace(0.0, 1.0, len(one.times)))) for one in demos]
    return Demonstrations.from_arrays([one.positions for one in demos], demos.labels, times)


def test_speed_tells_that_a_movement_is_over():
    speeds = smooth_paths(_settling(_spirals(2)), 10.0)
    movements = beginnings(speeds, np.arange(1, 11) / 10).end_speeds.reshape(-1, 10)
    known = ending(movements)
    odds = known.log_odds(movements)
    assert odds[:, -1].min() > 0.0
    assert np.median(odds[:, :-1]) < -3.0
    assert (np.diff(known.log_odds(np.linspace(-9.0, 9.0, 50))) <= 0.0).all()  # the slower, the rather
    assert known.log_odds(np.array([-50.0, 50.0])) == pytest.approx([7.0, -13.0])


def test_speed_tells_nothing_where_movements_were_recorded_at_full_speed_until_their_end():
    rng = np.random.default_rng(0)
    known = ending(rng.normal(0.0, 0.5, (30, 20)))
    np.testing.assert_allclose(known.log_odds(np.linspace(-0.5, 0.5, 9)), -3.0, atol=1.0)


def test_a_movement_that_is_over_is_recognized_as_a_whole(monkeypatch):
    train, test = (_settling(part) for part in _split(_spirals(3, per_class=6, n_classes=5), per_class=6))
    recognizer = kineme.Recognizer().fit(train)

    def log_odds(fraction):
        """Of the own class against the unknown."""
        parts = cut(test, fraction)
        shares = partial_shares(recognizer, parts)
        return np.log(shares[np.arange(len(parts)), np.searchsorted(recognizer.classes_, parts.labels)] / shares[:, -1])

    over, half = log_odds(1.0), log_odds(0.5)
    monkeypatch.setattr(evidence, "NEGLIGIBLE", -np.inf)  # nothing is compared as a whole
    assert np.median(over - log_odds(1.0)) > 0.5
    assert np.abs(half - log_odds(0.5)).max() < 0.05


def test_at_the_end_the_answer_is_that_of_the_recognizer():
    """Also where size and duration, which it leaves out, speak for another class."""
    train, test = (_settling(part) for part in _split(_spirals(2, per_class=6, n_classes=6), per_class=6))
    recognizer = kineme.Recognizer().fit(train)
    rng = np.random.default_rng(1)
    for factor in (0.4, 1.0, 2.5):
        other = Demonstrations.from_arrays(
            [factor * one.positions + 0.15 * np.cumsum(rng.normal(size=one.positions.shape), axis=0) for one in test],
            test.labels,
            [factor * one.times for one in test],
        )
        np.testing.assert_array_equal(recognizer.predict_partial(other), recognizer.predict(other))


def test_few_hypotheses_compared_in_full_say_what_all_of_them_say(monkeypatch):
    recognizer, test = _fitted_in_space()
    parts = cut(test, 0.6)
    few = partial_shares(recognizer, parts)
    monkeypatch.setattr(evidence, "COMPARED", 10**9)
    every = partial_shares(recognizer, parts)
    np.testing.assert_array_equal(few.argmax(axis=1), every.argmax(axis=1))
    np.testing.assert_allclose(few, every, atol=0.05)


@pytest.mark.parametrize(("concentration", "used"), [(None, 0.1), (0.0, 0.0), (0.5, 0.5)])
def test_beginnings_have_a_rotation_prior_of_their_own_unless_one_is_given(concentration, used):
    whole = Procrustes(3, math.pi, RotationPrior(concentration))
    assert beginning_procrustes(whole, None).prior.concentration == used
    assert beginning_procrustes(whole, 0.5) == Procrustes(3, 0.5)
    assert beginning_procrustes(Procrustes(2, 0.3), None) == Procrustes(2, 0.3)

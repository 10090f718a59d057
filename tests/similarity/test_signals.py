"""Movements of one dimension are signals: compared over time, by their values and slopes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme import Demonstrations, Recognizer
from kineme.errors import SpecificationError
from kineme.kernels.pair_distances import ElasticSpec, pair_distances, shapes_of
from kineme.similarity.describe import describe, feature_rows, squared_distances
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, ComparisonSpecification, Representation
from movement_samples import draw_shapes
from soaking import examples

AS_PATHS = tuple(
    Representation(one.quantity, one.arc_share, weight=one.weight, detailed=one.detailed, signal=False)
    for one in DEFAULT_REPRESENTATIONS
)


def _segments(values, n):
    """Middles of n segments of values at even times, and slopes with a root mean square of 1."""
    ends = np.interp(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, len(values)), values)
    slopes = np.diff(ends)
    return (ends[1:] + ends[:-1]) / 2.0, slopes / np.sqrt(np.mean(slopes**2))


def _warped(a, b, band, weight):
    """Dynamic time warping of values and slopes, as in textbooks, per segment; `weight` is that of values."""
    (x, slope_x), (y, slope_y) = a, b
    n = len(x)
    least = np.full((n + 1, n + 1), np.inf)
    least[0, 0] = 0.0
    for p in range(n):
        for q in range(max(0, p - band), min(n, p + band + 1)):
            cost = (slope_x[p] - slope_y[q]) ** 2 + weight * (x[p] - y[q]) ** 2
            least[p + 1, q + 1] = cost + min(least[p, q], least[p, q + 1], least[p + 1, q])
    return least[n, n] / n


@settings(max_examples=examples(3, 20), deadline=None)
@given(seed=st.integers(0, 10**6))
@pytest.mark.parametrize("choice", ["always", "never"])
def test_the_elastic_distance_of_signals_is_dynamic_time_warping_of_values_and_slopes(choice, seed):
    demos = draw_shapes([2] * 3, d=1, seed=seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KINEME_COMPILED", choice)
        described = describe(demos)
        squares = squared_distances(described, described)
        rows = feature_rows(demos, ComparisonSpecification())
    for r, block, n, weight in ((2, rows[0], 33, 2.0), (5, rows[2], 66, 0.5)):
        segments = [_segments(values, n) for values in block]
        expected = [[_warped(a, b, 6, weight) for b in segments] for a in segments]
        np.testing.assert_allclose(squares[r], expected, rtol=1e-4, atol=1e-5)


def test_signals_are_described_over_time_and_paths_over_their_length():
    """Over its length any signal that only rises is a straight line."""
    u = np.linspace(0.0, 1.0, 100)
    rising = u + 0.6 * u**2
    plane = np.column_stack((rising, np.zeros(100)))
    signal, as_path, in_the_plane = (
        feature_rows([x], ComparisonSpecification(how, cutoff=None))[0][0, :100]
        for x, how in ((rising[:, None], DEFAULT_REPRESENTATIONS), (rising[:, None], AS_PATHS), (plane, AS_PATHS))
    )
    np.testing.assert_allclose(signal, (rising - rising.mean()) / rising.std(), atol=1e-4)
    for straight in (as_path, in_the_plane):
        np.testing.assert_allclose(np.diff(straight), np.diff(straight).mean(), rtol=1e-3)


def test_what_differs_in_the_times_of_its_turns_alone_is_told_apart():
    """As paths they are one line, to and fro; as signals a slow rise and a fast one."""
    u = np.linspace(0.0, 1.0, 120)
    fast, slow = ((np.sin(np.pi * u**power))[:, None] for power in (0.5, 2.0))
    signals, paths = (
        squared_distances(*2 * (describe([fast, slow], ComparisonSpecification(how, cutoff=None)),))[:, 0, 1]
        for how in (DEFAULT_REPRESENTATIONS, AS_PATHS)
    )
    assert paths[0] < 0.01
    assert signals[0] > 10.0
    assert (signals[[2, 5]] > 0.3).all()
    shown, asked = [fast, slow], [size * (x + 3.0) for x in (fast, slow) for size in (0.5, 1.0, 3.0)]
    truth = np.repeat(["fast", "slow"], 3)
    assert Recognizer((DEFAULT_REPRESENTATIONS[0],)).fit(shown, ["fast", "slow"]).score(asked, truth) == 1.0
    assert Recognizer().fit(shown, ["fast", "slow"]).score(asked, truth) == 1.0


def _held(seconds, at=0.3, n=120):
    """A wave of a second that is held for so many more."""
    u = np.linspace(0.0, 1.0, n)
    steps = [u[u <= at], np.full(int(seconds * n), at), u[u > at]]
    phase = np.concatenate(steps)
    return kineme.Trajectory(np.arange(len(phase)) / n, np.sin(9.0 * phase)[:, None])


@pytest.mark.parametrize("choice", ["always", "never"])
@pytest.mark.parametrize("cutoff", [10.0, None])
def test_signals_keep_their_rests_in_detail_and_nothing_else_does(choice, cutoff, monkeypatch):
    """How long a value is held tells signals apart; a path that stops is the path that it would have been."""
    monkeypatch.setenv("KINEME_COMPILED", choice)
    briefly, long = _held(0.2), _held(1.0)
    signals = describe([briefly, long], ComparisonSpecification(cutoff=cutoff))
    apart = squared_distances(signals, signals)[:, 0, 1]
    assert apart[5] > 0.1 > 10.0 * apart[2]
    in_the_plane = [
        kineme.Trajectory(one.times, np.hstack((one.positions, one.positions**2))) for one in (briefly, long)
    ]
    for paths, how in ((in_the_plane, DEFAULT_REPRESENTATIONS), ([briefly, long], AS_PATHS)):
        described = describe(paths, ComparisonSpecification(how, cutoff=cutoff))
        assert squared_distances(described, described)[5, 0, 1] < 0.01


def test_gaps_in_the_stamps_of_signals_are_cut_short_in_detail():
    """Samples that are missing are no value that was held."""
    u = np.linspace(0.0, 1.0, 120)
    x, later = np.sin(9.0 * u)[:, None], u + 2.0 * (u > 0.6)
    described = describe([kineme.Trajectory(u, x), kineme.Trajectory(later, x)])
    assert squared_distances(described, described)[5, 0, 1] < 0.05


def test_a_stream_of_a_signal_compares_its_rests_as_predict_does():
    """These differ by their rests alone, which beginnings cut short."""
    recognizer = Recognizer().fit([_held(0.3), _held(0.9)], ["briefly", "long"])
    shares = []
    for seconds in (0.35, 0.8):
        live, asked = recognizer.stream(), _held(seconds)
        state = live.update(asked.times, asked.positions)
        shares.append({guess.label: guess.confidence for guess in state.ranked})
    assert recognizer.predict([_held(0.35), _held(0.8)]).tolist() == ["briefly", "long"]
    assert shares[0]["briefly"] > shares[1]["briefly"] + 0.01
    assert shares[1]["long"] > shares[0]["long"] + 0.01


def test_turning_angles_and_clouds_of_signals_have_no_weight_of_their_own():
    own = [one.own_weight(1) for one in DEFAULT_REPRESENTATIONS]
    assert own == [1.0, 1.0, 6.0, 0.0, 0.0, 6.0, 0.0]
    for d in (2, 3, 7):
        assert [one.own_weight(d) for one in DEFAULT_REPRESENTATIONS] == [one.weight for one in DEFAULT_REPRESENTATIONS]
    assert [one.own_weight(1) for one in AS_PATHS] == [one.weight for one in DEFAULT_REPRESENTATIONS]
    assert describe(draw_shapes([2], d=1)).own_weights == tuple(own)


@pytest.mark.parametrize("choice", ["always", "never"])
def test_slopes_are_for_signals_alone(choice, monkeypatch):
    """Which rest or do not move have none; a signal as a path has directions, to and fro, instead."""
    monkeypatch.setenv("KINEME_COMPILED", choice)
    u = np.linspace(0.0, 1.0, 100)
    signals = np.stack((np.sin(6 * u), np.zeros(100), np.minimum(u, 0.5)))[:, None]
    signals -= signals.mean(axis=2, keepdims=True)
    shapes = shapes_of(signals, ElasticSpec(n_segments=20), slopes=True)
    assert not shapes.turning.any()
    np.testing.assert_allclose((shapes.tangents**2).mean(axis=(1, 2)), [1.0, 0.0, 1.0], rtol=1e-6)
    np.testing.assert_allclose(shapes.tangents[2, 11:], 0.0, atol=1e-6)
    as_paths = shapes_of(signals, ElasticSpec(n_segments=20))
    np.testing.assert_allclose(np.abs(as_paths.tangents[0]), 1.0)
    assert as_paths.turning[0].any()
    assert np.isfinite(pair_distances(shapes, shapes)).all()


def test_signals_of_any_company_are_the_same():
    demos = draw_shapes([2] * 4, d=1, seed=5)
    described = describe(demos)
    alone = [describe(Demonstrations([one])) for one in demos]
    squares = np.stack([squared_distances(one, described)[:, 0] for one in alone], axis=1)
    np.testing.assert_allclose(squares[2:], squared_distances(described, described)[2:], rtol=1e-5, atol=1e-6)


def test_a_signal_and_a_path_of_one_movement_are_two_descriptions():
    demos, both = draw_shapes([3] * 3, d=1, seed=6), (True, False)
    how = {signal: ComparisonSpecification((Representation("positions", signal=signal),)) for signal in both}
    mixed = ComparisonSpecification(tuple(Representation("positions", signal=signal) for signal in both))
    for row, signal in zip(feature_rows(demos, mixed), both, strict=True):
        np.testing.assert_array_equal(row, feature_rows(demos, how[signal])[0])
    assert mixed.representations[0] != mixed.representations[1]


def test_what_is_compared_pair_by_pair_is_a_signal_if_its_positions_are():
    mixture = (Representation("positions"), Representation("elastic", signal=False))
    with pytest.raises(SpecificationError, match="expected one value of signal in positions over arc length and all"):
        ComparisonSpecification(mixture)
    as_path, as_signal = (
        feature_rows(draw_shapes([3], d=1), ComparisonSpecification(AS_PATHS)),
        feature_rows(draw_shapes([3], d=1), ComparisonSpecification()),
    )
    assert not np.allclose(as_path[-1], as_signal[-1])  # the positions in detail, too

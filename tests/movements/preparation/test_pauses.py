"""Pauses: what is cut of them, by the compiled loop and by its plain twin, and what is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.movements.preparation.pauses import LAST_REST, PAUSE, cut_pauses, uninterrupted
from movement_samples import draw_shapes, interrupted, stepped

pauses = given(
    seed=st.integers(0, 10**6),
    seconds=st.floats(0.3, 30.0),
    at_rest=st.booleans(),
    noise=st.sampled_from([0.0, 0.003]),
    d=st.integers(1, 4),
)


def cut(demos, **options):
    return cut_pauses(demos.times, demos.positions, demos.offsets, **options)


@pytest.mark.parametrize("rests", [True, False])
@pauses
def test_compiled_and_plain_cut_the_same(rests, seed, seconds, at_rest, noise, d):
    demos = interrupted(draw_shapes([2, 3], d, seed, n_samples=60 + seed % 90), seconds, at_rest, noise, seed)
    found = []
    for choice in ("always", "never"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KINEME_COMPILED", choice)
            found.append(cut(demos, rests=rests))
    assert (found[0] is None) == (found[1] is None)
    for compiled, plain in zip(*(one or () for one in found), strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=0, atol=1e-9)


@pauses
def test_a_pause_takes_little_time_and_no_place(seed, seconds, at_rest, noise, d):
    plain = draw_shapes([1, 1, 1], d, seed, n_samples=100)
    paused = interrupted(plain, seconds, at_rest, noise, seed)
    times, positions, ends = cut(paused)
    durations = times[ends[1:] - 1]
    most = 1 + PAUSE + LAST_REST
    assert (durations <= 1e-9 + most).all()
    for k in (0, -1):
        rows = ends[:-1] if k == 0 else ends[1:] - 1
        np.testing.assert_array_equal(positions[rows], [one.positions[k] for one in paused])
    assert (np.diff(times) > 0).sum() == len(times) - len(durations)  # rising in each


@pytest.mark.parametrize("choice", ["always", "never"])
@pytest.mark.parametrize(
    ("steps", "seconds", "count"),
    [
        ([(16, 1.0), (1, 100.0), (15, 1.0)], 31 + 3 * 34 / 32, 33),  # thrice what 1 takes, with 3 s for the gap
        ([(16, 1.0), (1, 100.0, 2.0), (14, 1.0)], 30 + 3.3, 32),  # a tenth of 30 and of the gap: less than for 2
        ([(16, 1.0), (1, 100.0, 0.5), (15, 1.0)], 31 + 3.0, 33),  # three usual steps, which are more
        ([(6, 1.0), (1, 3.5), (5, 1.0)], 11 + 3.0, 13),  # and so where a tenth is less
        ([(20, 1.0), (1, 2.0), (1, 4.2), (20, 1.0)], 46.2, None),  # slower from step to step
        ([(20, 1.0), (1, 4.2), (1, 2.0), (20, 1.0)], 46.2, None),
        ([(20, 1.0), (1, 1.2), (1, 5.0), (20, 1.0)], 41.2 + 3.6, 43),
        ([(64, 1.0), (-20, 1.0), (64, 1.0)], 128 + 6.4, 129 + 7),  # 0.2 of 32, of 20 samples as many as fit
        ([(-20, 1.0), (128, 1.0)], 128 + 12.8, 129 + 13),  # at the start a tenth
        ([(64, 1.0), (-20, 1.0)], 64 + 16.0, 65 + 16),  # at the end a quarter
        ([(64, 1.0), (-16, 1.0)], 80.0, None),
        ([(30, 1.0), (-3, 2.9), (30, 1.0)], 60 + 6.0, 61 + 3),  # seen in windows of four samples
        ([(20, 1.0), (-2, 2.9), (20, 1.0)], 45.8, None),
        ([(65, 1.0), (-6, 2.9), (65, 1.0)], 130 + 6.4, 131 + 3),  # and so below 256 samples
        ([(130, 1.0), (-6, 2.9), (130, 1.0)], 277.4, None),
        ([(5, 1.0), (-100, 1.0), (5, 1.0)], 10 + 1.0, 11 + 3),  # three at least
        ([(30, 1.0), (-200, 1.0), (15, 1.0), (-6, 2.9), (15, 1.0)], 60 + 2 * 6.0, 71),  # one is seen after the other
    ],
)
def test_what_is_left_of_pauses_by_hand(monkeypatch, choice, steps, seconds, count):
    monkeypatch.setenv("KINEME_COMPILED", choice)
    demos = stepped(steps)
    parts = cut(demos)
    assert demos.durations[0] == pytest.approx(seconds) if parts is None else parts[0][-1] == pytest.approx(seconds)
    assert (None if parts is None else len(parts[0])) == count


@pytest.mark.parametrize("choice", ["always", "never"])
def test_rests_can_stay_while_gaps_are_cut(monkeypatch, choice):
    monkeypatch.setenv("KINEME_COMPILED", choice)
    at_rest, both = stepped([(64, 1.0), (-20, 1.0), (64, 1.0)]), stepped([(16, 1.0), (1, 100.0), (-20, 1.0), (15, 1.0)])
    assert cut(at_rest) is not None
    assert cut(at_rest, rests=False) is None
    times, positions, _ = cut(both, rests=False)
    assert len(times) == len(both.times)
    assert times[-1] == pytest.approx(51 + 3 * 54 / 32)  # 3 s for the gap, thrice what its step takes at the mean speed
    np.testing.assert_array_equal(positions, both.positions)


@pytest.mark.parametrize(("noise", "rests"), [(0.9, True), (1.1, False)])
def test_a_rest_stays_within_a_share_of_the_reach(noise, rests):
    x = np.concatenate((np.arange(33.0), np.full(20, 32.0), np.arange(32.0, 65.0)))
    y = np.where((x == 32) & (np.arange(len(x)) % 2 > 0), 0.015 * 64 * noise, 0.0)
    assert (cut(kineme.Demonstrations.from_arrays([np.column_stack((x, y))])) is not None) is rests


def test_steady_movements_are_as_they_were():
    """At even stamps, with jitter, and slow at a corner."""
    u = np.linspace(0, 1, 200)
    rng = np.random.default_rng(0)
    for stamps in (u, np.cumsum(rng.uniform(0.5, 1.4, 200)), u + 0.02 * np.sin(2 * np.pi * u)):
        circle = np.column_stack((np.cos(6 * u), np.sin(6 * u)))
        assert cut(kineme.Demonstrations.from_arrays([circle], times=[stamps])) is None
    still = kineme.Demonstrations.from_arrays([np.zeros((20, 2))])
    assert cut(still) is None


def test_some_of_many_movements_are_cut_as_they_are_alone():
    demos = interrupted(draw_shapes([3, 3], n_samples=80), 5.0, True, 0.0, 1)
    every = uninterrupted(demos, 0, 6)
    for i in range(6):
        alone, among = uninterrupted(demos, i, i + 1), every[i]
        np.testing.assert_allclose(alone[0].times, among.times, atol=1e-9)
        np.testing.assert_array_equal(alone[0].positions, among.positions)


@pauses
def test_a_turned_movement_is_cut_where_it_was(seed, seconds, at_rest, noise, d):
    demos = interrupted(draw_shapes([2], d, seed, n_samples=60 + seed % 90), seconds, at_rest, noise, seed)
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(d, d)))[0]
    turned = kineme.Demonstrations.from_arrays(
        [demo.positions @ rotation.T for demo in demos], times=[demo.times for demo in demos]
    )
    times, positions, ends = cut(demos)
    turned_times, turned_positions, turned_ends = cut(turned)
    np.testing.assert_array_equal(ends, turned_ends)
    np.testing.assert_allclose(times, turned_times, atol=1e-9)
    np.testing.assert_allclose(positions @ rotation.T, turned_positions, atol=1e-9)

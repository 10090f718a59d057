"""Periods under noise: near what least squares can do, better with more samples, and the same in any company."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import RhythmicDMP, Trajectory
from kineme.dmp.rhythmic import encode
from kineme.dmp.rhythmic.encode import candidates, find_cycles


def _rhythms(shape, n_samples, cycles, noise, count):
    rng = np.random.default_rng(0)
    theta = 2 * np.pi * (cycles * np.linspace(0, 1, n_samples) + rng.uniform(size=(count, 1)))
    rows = {
        "sine": lambda: np.sin(theta)[:, None],
        "pulses": lambda: np.exp(8 * (np.cos(theta) - 1))[:, None],
        "sawtooth": lambda: (theta / (2 * np.pi) % 1)[:, None],
        "two and three": lambda: np.stack((np.sin(2 * theta), np.cos(3 * theta + 1)), axis=1),
        "strong second": lambda: (np.cos(2 * theta) + 0.6 * np.cos(theta + 1))[:, None],
    }[shape]()
    return rows + noise * rows.std(axis=(1, 2), keepdims=True) * rng.normal(size=rows.shape)


def _found(rows):
    return find_cycles(rows, np.full(len(rows), rows.shape[2]))


@pytest.mark.parametrize(
    ("n_samples", "noise", "count", "median"), [(300, 0.5, 20, 0.006), (1000, 0.5, 8, 0.006), (5000, 0.2, 3, 0.0005)]
)
def test_a_noisy_sine(n_samples, noise, count, median):
    """Least squares with as many harmonics is hardly better; every valley of the noise as a candidate was 3 % off."""
    found = _found(_rhythms("sine", n_samples, 3.3, noise, count))
    assert (found.explained > 0.5).all()
    assert np.median(np.abs(found.cycles / 3.3 - 1)) < median
    assert np.abs(found.cycles / 3.3 - 1).max() < 10 * median


@pytest.mark.parametrize("shape", ["pulses", "sawtooth", "two and three", "strong second"])
@pytest.mark.parametrize("cycles", [2.3, 7.7])
def test_noisy_shapes(shape, cycles):
    found = _found(_rhythms(shape, 300, cycles, 0.3, 8))
    assert (found.explained > 0.5).all()
    assert np.abs(found.cycles / cycles - 1).max() < 0.01


def test_more_samples_of_the_same_make_it_better():
    """Each sample once brought a valley of its own, so that more were worse."""
    errors = [np.median(np.abs(_found(_rhythms("sine", n, 3.3, 0.5, 8)).cycles / 3.3 - 1)) for n in (60, 240, 960)]
    assert errors[2] < errors[1] < errors[0]


def test_noise_makes_no_candidates():
    found = candidates(_rhythms("sine", 2000, 3.3, 0.5, 5), np.full(5, 2000))
    np.testing.assert_allclose(found[:, 0], 3.3, rtol=0.02)
    assert np.isfinite(found).sum(axis=1).max() <= 2


def test_company_changes_nothing():
    """Wide and narrow valleys, few and many harmonics, extents over twelve powers of ten; in any order."""
    rows = np.concatenate([_rhythms("pulses", 200, c, 0.05, 1) for c in (1.7, 3.3, 9.1, 24.0)] * 2)
    rows *= 10.0 ** np.array([-6, 6, 0, 3, 5, -4, -1, 1])[:, None, None]
    together, backwards = _found(rows), _found(rows[::-1])
    alone = np.concatenate([_found(row[None]).cycles for row in rows])
    np.testing.assert_allclose(together.cycles, alone, rtol=1e-9)
    np.testing.assert_allclose(backwards.cycles[::-1], alone, rtol=1e-9)


def test_stamps_at_random_times_are_learned_with_their_noise():
    """A tenth of noise on nearly coincident stamps once made two of five recordings look as if nothing repeats."""
    rng = np.random.default_rng(0)
    movements = []
    for _ in range(15):
        t = np.sort(rng.uniform(0, 4, 240))
        x = np.stack((np.sin(2 * np.pi * t), 0.5 * np.cos(4 * np.pi * t + 1)), axis=1)
        movements.append(Trajectory(t, x + 0.06 * rng.normal(size=x.shape)))
    np.testing.assert_allclose(RhythmicDMP().learn(movements).periods, 1.0, rtol=0.01)


@pytest.mark.parametrize(("second", "n"), [(106, 1), (115, 2)])
def test_a_valley_is_the_lowest_place_within_a_tenth_of_its_lag(second, n, monkeypatch):
    """Of two places 6 % apart the lower one counts, 15 % apart both do."""
    lag = np.arange(600)
    distance = np.minimum(lag / 30.0, 1.0)
    for at, depth in ((100, 0.5), (second, 0.6)):
        distance -= depth * np.exp(-0.5 * ((lag - at) / 1.5) ** 2)
    monkeypatch.setattr(encode, "dissimilarity", lambda rows: distance[None])
    found = candidates(np.zeros((1, 1, 600)), np.array([600]))[0]
    np.testing.assert_allclose(599 / found[np.isfinite(found)], [100, second][2 - n :], atol=1.0)

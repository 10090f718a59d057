"""Whatever is recorded: a valid cut, or an error that says what to do."""

from __future__ import annotations

import contextlib
from functools import cache

import numpy as np
import pytest

from kineme import Recognizer, Trajectory, segment
from kineme.errors import KinemeError
from soaking import examples

KINDS = {
    "constant": lambda rng, n, d: np.zeros((n, d)),
    "one spike": lambda rng, n, d: np.eye(n)[:, [rng.integers(n)] * d],
    "spike at the end": lambda rng, n, d: np.eye(n)[:, [-1] * d],
    "step": lambda rng, n, d: np.repeat(np.arange(n)[:, None] >= rng.integers(n), d, axis=1).astype(float),
    "rests": lambda rng, n, d: np.repeat(rng.normal(size=(n // 4 + 1, d)), 4, axis=0)[:n],
    "reach": lambda rng, n, d: np.repeat(np.clip(np.linspace(-1.0, 2.0, n), 0.0, 1.0)[:, None], d, axis=1),
    "random": lambda rng, n, d: rng.normal(size=(n, d)),
    "walk": lambda rng, n, d: np.cumsum(rng.normal(size=(n, d)), axis=0),
    "counter": lambda rng, n, d: rng.integers(0, 3, (n, d)).astype(float),
}
STAMPS = {
    "even": lambda rng, n: np.arange(n) * 0.01,
    "uneven": lambda rng, n: np.cumsum(rng.uniform(0.01, 1.0, n)),
    "wild": lambda rng, n: np.cumsum(10.0 ** rng.uniform(-6.0, 3.0, n)),
}
METHODS = [
    {"by": "rest"},
    {"by": "rest", "cover": True, "min_movement": 1e9},
    {"by": "rest", "min_movement": 0.0, "min_rest": 1e9},
    {"by": "speed", "turn": 0.5},
    {"by": "speed", "cover": True, "depth": 0.999, "span": 1e-9},
    {"by": "speed", "min_movement": 1e300},
    {"by": "change-points"},
    {"by": "change-points", "n_pieces": 3, "cover": True},
]


def _recording(seed):
    """Any kind of samples, number, size, offset and stamps."""
    rng = np.random.default_rng(seed)
    n, d = int(rng.integers(4, rng.choice([16, 120]))), int(rng.integers(1, 4))
    x = KINDS[rng.choice(sorted(KINDS))](rng, n, d)
    x = x * 10.0 ** rng.choice([0, 0, 0, 0, -300, -120, -3, 9, 120, 300]) + rng.choice([0.0, 0.0, 1e6])
    scale = 10.0 ** rng.choice([0, 0, 0, 0, 0, -300, 120])
    return Trajectory(scale * STAMPS[rng.choice(sorted(STAMPS))](rng, n), x)


@cache
def _recognizer(n_dims):
    rng = np.random.default_rng(n_dims)
    return Recognizer().fit([np.cumsum(rng.normal(size=(30, n_dims)), axis=0) for _ in range(3)], ["a", "b", "c"])


def _check(recording, method):
    found = segment(recording, **method)
    rows = found.rows
    assert (rows[:, 1] - rows[:, 0] >= 4).all()
    assert (rows[1:, 0] >= rows[:-1, 1]).all()
    if method.get("cover"):
        np.testing.assert_array_equal(np.append(0, rows[:, 1]), np.append(rows[:, 0], len(recording)))
    if len(rows):
        assert rows[0, 0] >= 0
        assert rows[-1, 1] <= len(recording)
        assert len(found.trajectories) == len(found.cuts) == len(rows)


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_any_recording_is_cut_or_refused(method):
    for seed in range(examples(40, 120)):
        with contextlib.suppress(KinemeError):
            _check(_recording(seed), method)


def test_known_movements_are_looked_for_in_any_recording():
    for seed in range(examples(80, 250)):
        with contextlib.suppress(KinemeError):
            recording = _recording(seed)
            for one in _recognizer(recording.n_dims).spot(recording):
                assert recording.times[0] <= one.start < one.end <= recording.times[-1]
                assert 0.0 <= one.confidence <= 1.0


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("n", [8, 9, 12])
@pytest.mark.parametrize("by", ["rest", "speed", "change-points"])
def test_a_few_random_samples_hold_no_movement_or_some(by, n):
    for seed in range(examples(12, 40)):
        x = np.random.default_rng(seed).normal(size=(n, 3))
        for one in (x, np.cumsum(x, axis=0)):
            with contextlib.suppress(KinemeError):
                _check(Trajectory(np.arange(n) * 0.01, one), {"by": by})


@pytest.mark.parametrize("moving", [0, 3, 15, 29])
def test_one_sample_that_is_elsewhere_is_no_known_movement(moving):
    assert _recognizer(2).spot(Trajectory(np.arange(30) * 0.01, np.eye(30)[:, [moving] * 2])) == []


def test_numbers_without_squares_are_refused_with_their_size():
    t, x = np.arange(20.0), np.random.default_rng(0).normal(size=(20, 2)).cumsum(axis=0)
    with pytest.raises(KinemeError, match=r"expected positions up to 1e\+100, got .* choose a unit in which they are"):
        segment(Trajectory(t, 1e150 * x))
    with pytest.raises(
        KinemeError, match=r"expected an extent of at least 1e-100, got .* choose a unit in which it is"
    ):
        segment(Trajectory(t, 1e-150 * x))
    with pytest.raises(KinemeError, match=r"expected at least 1e-50 s between stamps, got .* times are in seconds"):
        segment(Trajectory(1e-150 * t, x))
    segment(Trajectory(1e-20 * t, 1e-20 * x), cover=True)

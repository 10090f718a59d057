"""Episodes of a simple arm whose movements are known, as data sets, archives and libraries of them."""

from __future__ import annotations

import csv

import numpy as np

import kineme
from bench.work_sets import write_set
from kineme.movements.episodes import Episode

RATE, N_JOINTS = 50.0, 6
SYMBOLS = ("reach", "stir", "tap")
NAMES = tuple(f"joint_{k}.pos" for k in range(N_JOINTS))


def movement(symbol, rng):
    """A movement of a symbol, a little different each time: least jerk from way point to way point, (T, 6)."""
    fixed = np.random.default_rng([3, sum(symbol.encode())])
    ways = fixed.normal(scale=0.5, size=(fixed.integers(1, 4), N_JOINTS))
    ways *= rng.uniform(0.9, 1.1)
    ways += 0.04 * rng.normal(size=ways.shape)
    samples = round(RATE * fixed.uniform(0.8, 1.2) * rng.uniform(0.9, 1.1))
    u = np.linspace(0.0, 1.0, samples)[1:, None]
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    at, parts = np.zeros(N_JOINTS), [np.zeros((1, N_JOINTS))]
    for way in ways:
        parts.append(at + (way - at) * s)
        at = way
    return np.concatenate(parts)


def shown(each=3):
    """Some movements of each symbol, with stamps from 0."""
    rng = np.random.default_rng(0)
    paths = [movement(symbol, rng) for symbol in SYMBOLS for _ in range(each)]
    times = [np.arange(len(path)) / RATE for path in paths]
    return kineme.Demonstrations.from_arrays(paths, [symbol for symbol in SYMBOLS for _ in range(each)], times)


def episodes(count, symbols=(*SYMBOLS, "wave")):
    """Episodes with all symbols in turn, rests between them, and what is when, (start, end, name)."""
    for number in range(count):
        rng = np.random.default_rng([5, number])
        at, parts, truth, n = np.zeros(N_JOINTS), [np.zeros((25, N_JOINTS))], [], 25
        for symbol in (*symbols[number % len(symbols) :], *symbols[: number % len(symbols)]):
            path = at + movement(symbol, rng)
            truth.append((n / RATE, (n + len(path) - 1) / RATE, symbol))
            parts += [path, np.repeat(path[-1:], 30, axis=0)]
            n, at = n + len(path) + 30, path[-1]
        state = np.concatenate(parts) + 0.001 * rng.normal(size=(n, N_JOINTS))
        stamps = np.arange(n) / RATE
        yield (
            Episode(number, stamps, {"observation.state": state}, {"observation.state": NAMES}, "work", RATE),
            truth,
        )


def write_episodes(folder, count):
    """Write a data set, and return what is when in each episode."""
    both = list(episodes(count))
    write_set(folder, [episode for episode, _ in both], ("observation.state",))
    return [truth for _, truth in both]


def write_library(folder, each=3):
    """Learn the movements that are shown, in the columns of the data sets."""
    recordings = folder.parent / f"{folder.name}-shown"
    for k, one in enumerate(shown(each)):
        path = recordings / one.label / f"{k}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(("time [s]", *NAMES))
            table.writerows(np.column_stack((one.times, one.positions)).tolist())
    with kineme.ActionLibrary(folder, create=True) as library:
        library.learn(kineme.read_recordings(recordings))
    return folder

"""Streams of movements between rests, and a library that knows them."""

from __future__ import annotations

import numpy as np

import kineme

NAMES = ("CShape", "GShape", "Sine", "WShape")
RATE = 100.0  # Hz


def make_library(folder, **options):
    """A library of four handwritten shapes, four demonstrations of each."""
    demos = kineme.load_lasa(NAMES)
    library = kineme.ActionLibrary(folder, create=True)
    library.learn(demos[[k for k in range(len(demos)) if k % 7 < 4]], **options)
    return library


def take(name, number=6, rest=0.6):
    """A recording at 100 Hz that the library has not seen, with a rest before and behind: rows (k, 2)."""
    movement = kineme.load_lasa([name])[number]
    times = np.arange(0.0, movement.duration, 1.0 / RATE)
    rows = np.column_stack([np.interp(times, movement.times - movement.times[0], x) for x in movement.positions.T])
    still = np.ones((round(rest * RATE), 1))
    return np.concatenate((still * rows[:1], rows, still * rows[-1:]))


def session(*names):
    """Takes one after the other, with ways between them that last half a second: rows (k, 2)."""
    takes = [take(name) for name in names]
    rows = [takes[0]]
    for following in takes[1:]:
        share = np.linspace(0.0, 1.0, 50)[:, None]
        rows += [(1.0 - share) * rows[-1][-1] + share * following[0], following]
    return np.concatenate(rows)

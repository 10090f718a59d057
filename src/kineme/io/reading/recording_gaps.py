"""Sampling rates, jitter and gaps of movements, and notes on missing values and pauses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.io.reading.merge_files import Recordings
from kineme.io.records import note_on_missing
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.text import counted, first_names
from kineme.validation import Array

GAP = 3.0  # steps longer than this many median steps are gaps: at least two samples are missing

_NAMED = 6  # numbers that stand for no value in a note
_RATES = (2.0, 20_000.0)  # usual sampling rates of people and robots [Hz]
_PAUSE = 1.0  # s without samples from which on a movement may be several


def notes_on_gaps(recordings: Recordings) -> list[str]:
    """Say which numbers count as no value, what is converted, what was filled and cropped, what lacks values."""
    sources, notes = recordings.sources, []
    if sentinels := [*dict.fromkeys(sentinel for how, _ in recordings.detected for sentinel in how.sentinels)]:
        notes.append(f"{first_names(sentinels, _NAMED)} counts as no value, far from all others")
    if converted := [*dict.fromkeys(unit for how, _ in recordings.detected for unit in how.converted)]:
        notes.append(f"units are converted to those of most columns: {first_names(converted, _NAMED)}")
    if filled := [source for source in sources if source.filled]:
        samples, longest = sum(source.filled for source in filled), max(source.longest_gap for source in filled)
        notes.append(
            f"gaps of up to {longest:.3g} s were filled in {counted(len(filled), 'movement')}, "
            f"{counted(samples, 'sample')} in all; --fill-gaps 0 fills none"
        )
    if cropped := [source.cropped for source in sources if source.cropped]:
        notes.append(
            f"{counted(len(cropped), 'movement')} cropped to where all columns have values, by up to "
            f"{max(cropped):.3g} s, {sum(cropped):.3g} s in all"
        )
    return notes + note_on_missing(recordings.problems)


def notes_on_sampling(recordings: Recordings) -> list[str]:
    """Say that the rate is unusual, and that there are no samples for so long that a movement may be several."""
    sampling, notes = sampling_of(recordings.demonstrations), []
    rate = float(np.median(sampling.rates))
    if not _RATES[0] <= rate <= _RATES[1]:
        notes.append(f"{rate:.3g} samples per second are unusual; if the unit of time is another, give --units")
    paused = (sampling.gaps > 0) & (sampling.longest > _PAUSE)
    if not paused.any():
        return notes
    first = int(np.flatnonzero(paused)[0])
    longest = sampling.longest[paused].max()
    return [
        *notes,
        f"{counted(int(paused.sum()), 'movement')} without samples for up to {longest:.3g} s, the first "
        f"{recordings.short_names[first]}; if these are several movements, say which column tells them apart, "
        "--movement, in Python movement=, or cut them by kineme segment",
    ]


class Sampling(NamedTuple):
    """One row per movement; arrays of shape (n,)."""

    rates: Array  # one over the median step between samples [Hz]
    # Root mean square deviation of the steps from the median step, as a share of it; gaps are not counted.
    jitters: Array
    gaps: NDArray[np.intp]  # number of steps longer than `GAP` median steps
    longest: Array  # the longest step [s]


def sampling_of(demonstrations: Demonstrations) -> Sampling:
    """Rates, jitters and gaps of every movement."""
    offsets, lengths = demonstrations.offsets, demonstrations.lengths - 1
    inner = np.ones(len(demonstrations.times) - 1, dtype=bool)
    inner[offsets[1:-1] - 1] = False  # from one movement to the next
    steps = np.diff(demonstrations.times)[inner]
    starts = np.concatenate(([0], np.cumsum(lengths)[:-1]))
    owner = np.repeat(np.arange(len(lengths)), lengths)
    ordered = steps[np.lexsort((steps, owner))]
    median = 0.5 * (ordered[starts + (lengths - 1) // 2] + ordered[starts + lengths // 2])
    relative = steps / median[owner]
    gaps = relative > GAP
    deviation = np.where(gaps, 0.0, relative - 1.0) ** 2
    n_gaps = np.add.reduceat(gaps.astype(np.intp), starts)
    jitters = np.sqrt(np.add.reduceat(deviation, starts) / np.maximum(lengths - n_gaps, 1))
    return Sampling(1.0 / median, jitters, n_gaps, ordered[starts + lengths - 1])

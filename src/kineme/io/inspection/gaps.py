"""Notes on missing values and pauses: what was filled and cropped in recordings, and what would read the rest."""

from __future__ import annotations

import numpy as np

from kineme.io.inspection.sampling import sampling_of
from kineme.io.merge_files import Recordings
from kineme.io.problem import note_on_missing
from kineme.reporting.text import counted, first_names

_NAMED = 6  # numbers that stand for no value in a note
_RATES = (2.0, 20_000.0)  # usual sampling rates of people and robots [Hz]
_PAUSE = 1.0  # s without samples from which on a movement may be several


def notes_on_gaps(recordings: Recordings) -> list[str]:
    """Say which numbers count as no value, what is converted, what was filled and cropped, what lacks values."""
    sources, notes = recordings.sources, []
    if sentinels := [*dict.fromkeys(one for how, _ in recordings.detected for one in how.sentinels)]:
        notes.append(f"{first_names(sentinels, _NAMED)} counts as no value, far from all others")
    if converted := [*dict.fromkeys(one for how, _ in recordings.detected for one in how.converted)]:
        notes.append(f"units are converted to those of most columns: {first_names(converted, _NAMED)}")
    if filled := [one for one in sources if one.filled]:
        samples, longest = sum(one.filled for one in filled), max(one.longest_gap for one in filled)
        notes.append(
            f"gaps of up to {longest:.3g} s were filled in {counted(len(filled), 'movement')}, "
            f"{counted(samples, 'sample')} in all; --fill-gaps 0 fills none"
        )
    if cropped := [one.cropped for one in sources if one.cropped]:
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

"""Notes on missing values: what was filled and cropped in a set of recordings, and what would read the rest."""

from __future__ import annotations

from kineme.files.merge_files import Recordings
from kineme.files.problem import note_on_missing
from kineme.output.text import counted


def notes_on_gaps(recordings: Recordings) -> list[str]:
    """Say in one sentence each what was filled, what was cropped, and which columns keep movements from being read."""
    sources, notes = recordings.sources, []
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

"""Recordings that are no files."""

from kineme.io.reading.recordings import HowToRead, NameRule, read_paths


def read_recordings_from_bytes(data, name, layout):
    """Read what a file of that name would hold."""
    return read_paths([], HowToRead(layout, NameRule()), standard_input=(name, data))

"""Recordings that are no files."""

from kineme.io.reading.recordings import NameRule, read_paths


def read_recordings_from_bytes(data, name, layout):
    """Read what a file of that name would hold."""
    return read_paths([], layout, NameRule(), standard_input=(name, data))

"""What rosbags raises on a damaged bag becomes a `DataError`, with what may help."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from kineme.errors import DataError, KinemeError

#: File ending, or none for a folder -> what may help if the bag is damaged.
REMEDIES = {
    ".bag": "if the recording was cut off, run rosbag reindex",
    ".mcap": "if the recording was cut off, run mcap recover",
    ".db3": "copy it again, or give the folder of the bag",
    "": "copy it again, or run ros2 bag reindex",
}


@contextmanager
def refused(expected: str, remedy: str) -> Iterator[None]:
    """Whatever rosbags raises on a damaged bag, as a `DataError`."""
    try:
        yield
    except (KinemeError, MemoryError):
        raise
    except Exception as error:
        is_silent = isinstance(error, AssertionError) and not str(error)
        reason = "records that contradict each other" if is_silent else " ".join(str(error).split())
        reason = reason or type(error).__name__
        unknown = ", which rosbags does not know" if isinstance(error, KeyError) else ""
        raise DataError(f"{expected}, got: {reason[:300]}{unknown}; {remedy}") from error

"""Where an episode begins in the videos of a data set of LeRobot, and how these are coded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from kineme.errors import DataError
from kineme.io.lerobot.info import MARKER, read_json

_FILES = "meta/episodes/*/*.parquet"  # of version 3, where a video holds many episodes


def video_starts(folder: Path, camera: str) -> dict[int, float]:
    """Read the number of each episode -> the time at which it begins in the video of a camera [s].

    Episodes that no file of meta/episodes tells of begin with their video, as all of version 2 do.
    """
    import pyarrow as pa
    from pyarrow import parquet

    starts: dict[int, float] = {}
    columns = ["episode_index", f"videos/{camera}/from_timestamp"]
    for file in sorted(folder.glob(_FILES)):
        try:
            table = parquet.read_table(file, columns=columns, partitioning=None)
            numbers, seconds = (table.column(name).to_pylist() for name in columns)
        except (pa.ArrowException, OSError, KeyError):  # damaged, or it tells of no videos
            continue
        pairs = zip(numbers, seconds, strict=True)
        starts |= {int(k): float(start) for k, start in pairs if k is not None and start is not None}
    return starts


def video_codec(folder: Path, camera: str) -> str | None:
    """Return the name of a video's codec, such as ``"av1"``, as the data set declares it; None if it does not."""
    try:
        value: Any = read_json(folder / MARKER, MARKER)
        for key in ("features", camera):
            value = value[key]
    except (DataError, LookupError, TypeError):
        return None
    about = value.get("info", value.get("video_info")) if isinstance(value, dict) else None
    codec = about.get("video.codec") if isinstance(about, dict) else None
    return codec if isinstance(codec, str) else None

"""What a data set of LeRobot says of itself in meta/info.json: its rate, its features, where its shards are."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.io.limits import check_expanded

MARKER = "meta/info.json"
COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")  # features of every data set
_NUMBERS = ("float", "int", "uint", "bool")
_WIDEST = 1000  # numbers in a frame; images have more
_MOST_BYTES = 100_000_000
_LONGEST_PATH = 1000  # characters
_WIDE_FIELD = re.compile(r"\{[^}]*(\d{3}|\{)")  # in a data_path: {chunk_index:300000000} would be a text of 300 MB


class Info(NamedTuple):
    """A data set of LeRobot.

    Attributes
    ----------
    version : int
        2: a file for each episode. 3: many episodes in a file.
    fps : float
    heads : dict of str to tuple of str
        Feature of numbers -> the names of its entries; one empty name where the feature is a single number.
    others : tuple of str
        Features that cannot be coordinates: images, texts.
    data_path : str
        Where the shards are, in the syntax of `str.format`.
    episodes : int or None
        How many it says that there are.
    chunk : int
        Episodes in a chunk, for version 2.
    """

    version: int
    fps: float
    heads: dict[str, tuple[str, ...]]
    others: tuple[str, ...]
    data_path: str
    episodes: int | None
    chunk: int

    @property
    def vectors(self) -> dict[str, int]:
        """The features that are vectors, with their widths."""
        return {name: len(entries) for name, entries in self.heads.items() if entries != ("",)}


def read_json(path: Path, what: str) -> Any:
    """The content of a JSON file of a data set; a `DataError` that names it if that is damaged or not there."""
    try:
        check_expanded(min(path.stat().st_size, _MOST_BYTES) * 10)
        return json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"expected {what} of a LeRobot data set, got none that can be read ({error})") from error


def read_info(folder: Path) -> Info:
    """Read meta/info.json.

    Raises
    ------
    DataError
        It is damaged, of another program, or of a version that is not read.
    """
    info = read_json(folder / MARKER, MARKER)
    known = info if isinstance(info, Mapping) else {}
    said, features = str(known.get("codebase_version", "")), known.get("features")
    if not said or not isinstance(features, Mapping):
        raise DataError(f"expected {MARKER} of a LeRobot data set with codebase_version and features, got another one")
    major = said.lstrip("v").partition(".")[0]
    if major not in ("2", "3"):
        raise DataError(f"expected a LeRobot data set of version 2 or 3, got {said}; convert it with LeRobot")
    fps, path = known.get("fps"), known.get("data_path")
    if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 0 < fps < math.inf:
        raise DataError(f"expected fps above 0 in {MARKER}, got {fps!r}")
    if not isinstance(path, str) or len(path) > _LONGEST_PATH:
        raise DataError(f"expected a data_path of at most {_LONGEST_PATH} characters in {MARKER}, got {path!r:.80}")
    if Path(path).is_absolute() or ".." in Path(path).parts or _WIDE_FIELD.search(path):
        raise DataError(f"expected a data_path within the data set in {MARKER}, got {path!r}")
    total, chunk = known.get("total_episodes"), known.get("chunks_size")
    heads = {name: entries for name, one in features.items() if (entries := _entries(name, one))}
    others = tuple(name for name in features if name not in heads and name not in COUNTERS)
    return Info(
        int(major), float(fps), heads, others, path, total if isinstance(total, int) else None,
        chunk if isinstance(chunk, int) and chunk > 0 else 1000,
    )  # fmt: skip


def _entries(name: str, feature: Any) -> tuple[str, ...]:
    """The names of a feature's entries, with their units where it says them; none for images, texts and counters."""
    if name in COUNTERS or not isinstance(feature, Mapping) or not str(feature.get("dtype")).startswith(_NUMBERS):
        return ()
    shape = feature.get("shape")
    if not isinstance(shape, list) or not all(isinstance(one, int) and one > 0 for one in shape):
        return ()
    width = math.prod(shape)
    names, units = _names(feature.get("names")), feature.get("units")
    if width > _WIDEST:
        return ()
    if len(names) == width and len(set(names)) == width and (width > 1 or isinstance(units, list)):
        if isinstance(units, list) and len(units) == width:
            return tuple(
                f"{name} [{unit}]" if isinstance(unit, str) else name for name, unit in zip(names, units, strict=True)
            )
        return tuple(names)
    return tuple(map(str, range(width))) if width > 1 else ("",)


def _names(names: Any) -> list[str]:
    """Names as a flat list; they stand in a list or below words such as motors or axes."""
    if isinstance(names, Mapping):
        return [name for one in names.values() for name in _names(one)]
    return [str(name) for name in names] if isinstance(names, list) else []

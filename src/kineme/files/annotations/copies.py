"""Annotations inside a copy of the recording: a topic of a bag, a column of a data set of LeRobot."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

from kineme.errors import DataError
from kineme.files.annotations.annotation import Annotation
from kineme.files.annotations.tables import as_row
from kineme.files.formats import FORMATS, data_set_of
from kineme.files.lerobot.copy import copy_with_motions
from kineme.files.lerobot.info import MARKER, read_info
from kineme.files.lerobot.motions import OWN, Motion
from kineme.files.ros.add_topic import copy_with_topic
from kineme.files.ros.bag_contents import bag_contents
from kineme.output.atomic import whole_file, whole_folder

TOPIC = "/kineme/annotations"
_SECOND = 10**9  # ns
_EPISODE = "episode "  # a movement's place in a data set of LeRobot begins with it
_LEFT_OUT = ("recording",)  # of a row: the copy is the recording


def is_bag(source: Path) -> bool:
    """Whether it is a bag of ROS, a file or a folder."""
    if source.is_dir():
        known = data_set_of(source)
        return known is not None and known.format.contents is bag_contents
    known_ending = FORMATS.get(source.suffix.lower())
    return known_ending is not None and known_ending.contents is bag_contents


def is_lerobot(source: Path) -> bool:
    """Whether it is the folder of a data set of LeRobot."""
    known = data_set_of(source) if source.is_dir() else None
    return known is not None and known.marker == MARKER


def write_bag(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a copy of a bag with the topic `TOPIC`: messages of std_msgs/String with JSON, all others byte for byte.

    A message is stamped with the end of its movement. Ends by a clock that the time of recording does not know, such as
    that of a simulation, count from the first sample as the time of recording counts from the first message.

    Raises
    ------
    DataError
        The copy is to be of another kind than the bag or in a folder that is there, or the bag takes no topic: see
        `copy_with_topic`.
    """
    source = _of_one(path, source)
    check_bag(path, source)

    def texts(first: int, last: int) -> list[tuple[int, str]]:
        inside = all(first - _SECOND <= one.end * _SECOND <= last + _SECOND for one in annotations)
        spans = [(one.end, 0) if inside else (one.end - one.origin, first) for one in annotations]
        stamps = [max(0, shift + round(time * _SECOND)) for time, shift in spans]
        return [(stamp, _json(one)) for stamp, one in zip(stamps, annotations, strict=True)]

    with whole_folder(path) if source.is_dir() else whole_file(path) as beside:
        copy_with_topic(source, beside, TOPIC, texts)
    return path


def write_lerobot(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a copy of a data set of LeRobot whose frames carry the annotations of their episode.

    They are rows of the style `motion`, stamped with the start of their movement, with JSON as content. Those that an
    earlier call has written are replaced. All else is as it was: see `copy_with_motions`.

    Raises
    ------
    DataError
        A damaged data set, or `path` is there.
    """
    source = _of_one(path, source)
    check_lerobot(path, source)
    motions: dict[int, list[Motion]] = {}
    for one in annotations:
        number = one.place.removeprefix(_EPISODE)
        if not number.isdecimal():
            raise DataError(f"expected annotations of episodes, got one of {one.place!r}")
        motions.setdefault(int(number), []).append(Motion(one.start, OWN + ", " + _json(one)[1:]))
    with whole_folder(path) as beside:
        copy_with_motions(source, beside, motions)
    return path


def check_bag(path: Path, source: Path) -> None:
    """Refuse a path where no copy of that bag can be written, before the bag is read."""
    _check_apart(path, source)
    if source.is_dir():
        _check_new_folder(path, source)
    elif path.suffix.lower() != source.suffix.lower():
        raise DataError(
            f"expected a path that ends in {source.suffix} for a copy of {source.name}, got {path.name}; or write a "
            "table: .csv or .json"
        )


def check_lerobot(path: Path, source: Path) -> None:
    """Refuse a path where no copy of that data set can be written, or a data set that is damaged."""
    _check_apart(path, source)
    _check_new_folder(path, source)
    read_info(source)


def _of_one(path: Path, source: Path | None) -> Path:
    if source is None:
        raise DataError(f"expected one recording to copy with its annotations to {path.name}, got several")
    return source


def _check_apart(path: Path, source: Path) -> None:
    whole = source.resolve()
    if path.resolve() == whole or whole in path.resolve().parents:
        raise DataError(f"expected another path for the copy than the recording {source} or one inside, got {path}")


def _check_new_folder(path: Path, source: Path) -> None:
    """A folder with files is never written over: nobody knows whose they are."""
    if path.suffix.lower() in FORMATS:
        raise DataError(f"expected the name of a folder for a copy of the folder {source}, got {path.name}")
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise DataError(f"expected a new folder for the copy of {source}, {path} is there; name another, or remove it")


def _json(one: Annotation) -> str:
    row = {head: value for head, value in as_row(one).items() if head not in _LEFT_OUT}
    plain = {
        head: None if isinstance(value, float) and not math.isfinite(value) else value for head, value in row.items()
    }
    return json.dumps(plain, ensure_ascii=False)

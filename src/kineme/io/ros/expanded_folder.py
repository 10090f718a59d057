"""A bag of ROS 2 whose files are compressed as a whole is expanded into a folder of its own, up to a limit."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.io.limits import VARIABLE, max_file_bytes

METADATA = "metadata.yaml"
INFORMATION = "rosbag2_bagfile_information"

_MOST_RATIO = 64  # of recordings; a file larger than the limit on files is expanded up to this ratio
_AT_ONCE = 2**20


class Folder(NamedTuple):
    """A folder that rosbags can open, the files of the bag in it, and what is compressed: "file", "message" or ""."""

    path: Path
    files: tuple[Path, ...]
    compression: str


@contextmanager
def expanded_folder(path: Path) -> Iterator[Folder]:
    """The folder, or one with its files expanded.

    A folder that is none of ROS 2, or whose files are missing, is left to rosbags to refuse.

    Raises
    ------
    DataError
        A file expands to more than 64 times its size and the limit on files.
    """
    about = _information(path)
    mode = str(about.get("compression_mode", "")).lower().replace("none", "")
    files = tuple(path / PurePath(str(one)).name for one in about.get("relative_file_paths") or ())
    is_whole = all(one.is_file() for one in files)
    if mode != "file" or about.get("compression_format") != "zstd" or not is_whole:
        yield Folder(path, files if is_whole else (), mode)
        return
    with TemporaryDirectory() as name:
        folder = Path(name)
        for one in files:
            _expand_file(one, folder / one.stem)
        plain = {**about, "compression_mode": "", "relative_file_paths": [one.stem for one in files]}
        _write(folder / METADATA, {INFORMATION: plain})
        yield Folder(folder, tuple(folder / one.stem for one in files), mode)


def _information(path: Path) -> dict[str, Any]:
    """What the folder says of itself, or nothing: rosbags reads it too, and says why it cannot."""
    from ruamel.yaml import YAML

    try:
        whole = YAML(typ="safe").load((path / METADATA).read_text(encoding="utf-8"))
        return dict(whole[INFORMATION])
    except Exception:
        return {}


def _write(path: Path, whole: Any) -> None:
    from ruamel.yaml import YAML

    with path.open("w", encoding="utf-8") as file:
        YAML(typ="safe").dump(whole, file)


def _expand_file(source: Path, target: Path) -> None:
    from rosbags.rosbag2.storage_mcap import zstd

    most = max(max_file_bytes(), _MOST_RATIO * source.stat().st_size)
    with source.open("rb") as start:
        declared = zstd.get_frame_info(start.read(64)).decompressed_size or 0
    _check(declared, most, source)
    n_bytes = 0
    with zstd.open(source, "rb") as old, target.open("wb") as new:
        while some := old.read(_AT_ONCE):
            n_bytes += len(some)
            _check(n_bytes, most, source)
            new.write(some)


def _check(n_bytes: int, most: int, source: Path) -> None:
    if n_bytes > most:
        raise DataError(
            f"{source.name}: expected a file that expands to at most {most:,} bytes, got one that expands to "
            f"{n_bytes:,} or more; if you trust it, set the environment variable {VARIABLE} to more"
        )

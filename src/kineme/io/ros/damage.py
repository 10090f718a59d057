"""Read damaged bags safely: rosbags' errors become a `DataError`, and nothing expands beyond a limit.

What compressed bytes say of their size may be wrong, and a few may become gigabytes. Rosbags itself expands a chunk
whole before it looks at its size, if it does.
"""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

from kineme.errors import DataError, KinemeError
from kineme.io.limits import VARIABLE, check_in_passing, max_file_bytes, most_in_passing

METADATA = "metadata.yaml"
INFORMATION = "rosbag2_bagfile_information"

_MOST_RATIO = 64  # of recordings; a file larger than the limit on files is expanded up to this ratio
_AT_ONCE = 2**20

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


def expand(compression: str, data: bytes, size: int, what: str = "a chunk") -> bytes:
    """Expand all frames in some bytes, of "zstd", "lz4" or "bz2".

    `size` is how many bytes they should become, which is checked against the limit on files first.
    """
    check_in_passing(size, what)
    parts, n_bytes = [], 0
    while True:
        decompressor = _decompressor(compression)()
        parts.append(decompressor.decompress(data, max_length=size + 1 - n_bytes))
        n_bytes += len(parts[-1])
        if n_bytes > size:
            raise DataError(f"expected {what} that expands to {size:,} bytes, got one that expands to more")
        if not decompressor.eof:
            raise DataError(f"expected {what} in {compression}, got one that is cut off")
        data = decompressor.unused_data
        if not data:
            return b"".join(parts)


def expand_message(data: bytes) -> bytes:
    """Expand a message of a bag whose messages are compressed each for itself, by zstd; its size is said nowhere."""
    from rosbags.rosbag2.storage_mcap import zstd

    check_in_passing(zstd.get_frame_info(data).decompressed_size or 0, "a message")
    return expand("zstd", data, most_in_passing(), "a message")


def _decompressor(compression: str) -> Callable[[], Any]:
    if compression == "bz2":
        return BZ2Decompressor
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor
    from rosbags.rosbag2.storage_mcap import zstd

    return zstd.ZstdDecompressor


def bound_chunks_of_ros_1(reader: Any) -> None:
    """Bound every chunk of an open bag of ROS 1."""
    for at, chunk in reader.chunks.items():
        check_in_passing(chunk.datasize, f"a chunk at byte {at:,}")
        reader.chunks[at] = chunk._replace(decompressor=partial(_expand_of_ros_1, reader.bio, at))


def records_of_mcap(file: BinaryIO, validate_crcs: bool = False) -> Iterator[Any]:
    """Yield the records of an MCAP file and of its chunks, which expand no further than they say."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    for record in StreamReader(file, emit_chunks=True, validate_crcs=validate_crcs).records:
        if isinstance(record, Chunk):
            how, data = record.compression, record.data
            plain = expand(how, data, record.uncompressed_size) if how else data
            yield from breakup_chunk(replace(record, data=plain, compression=""), validate_crc=validate_crcs)
        else:
            yield record


def compression_of_ros_1(file: Any, at: int) -> tuple[str, int]:
    """Return the compression of the chunk at a byte of a bag of ROS 1, and its expanded size [bytes]."""
    from rosbags.rosbag1.reader import Header, RecordType

    file.seek(at)
    header = Header.read(file, RecordType.CHUNK)
    return header.get_string("compression"), header.get_uint32("size")


def _expand_of_ros_1(file: Any, at: int, data: bytes) -> bytes:
    compression, size = compression_of_ros_1(file, at)
    return data if compression == "none" else expand(compression, data, size, f"a chunk at byte {at:,}")


@cache
def bound_chunks_of_mcap() -> None:
    """Bound the chunks of every MCAP file from now on: it is a table of rosbags that says how they are expanded.

    Each entry takes the bytes and the size that they must have; rosbags refuses another size later.
    """
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    DECOMPRESSORS.update({name: partial(expand, name) for name in ("lz4", "zstd")})


def check_overlaps(storage: Any, topics: Sequence[str]) -> None:
    """Refuse an MCAP file of which too much must be in memory at once: chunks whose times overlap are read together."""
    ids = [connection.id for connection in storage.connections if connection.topic in topics]
    chunks = [chunk for chunk in getattr(storage, "chunks", ()) if any(chunk.channel_count.get(k, 0) for k in ids)]
    begins = [(chunk.message_start_time, 0, max(chunk.uncompressed_size, chunk.compressed_size)) for chunk in chunks]
    ends = [(chunk.message_end_time, 1, -max(chunk.uncompressed_size, chunk.compressed_size)) for chunk in chunks]
    n_bytes = 0
    for _, _, change in sorted(begins + ends):
        n_bytes += change
        check_in_passing(n_bytes, "a set of chunks of one time")


class Folder(NamedTuple):
    """A folder that rosbags can open, the files of the bag in it, and what is compressed: "file", "message" or ""."""

    path: Path
    files: tuple[Path, ...]
    compression: str


@contextmanager
def expanded_folder(path: Path) -> Iterator[Folder]:
    """The folder, or one with its files expanded.

    A folder that is none of ROS 2, or whose files are missing, is left to rosbags to refuse.
    """
    about = _information(path)
    mode = str(about.get("compression_mode", "")).lower().replace("none", "")
    files = tuple(path / PurePath(str(file)).name for file in about.get("relative_file_paths") or ())
    is_whole = all(file.is_file() for file in files)
    if mode != "file" or about.get("compression_format") != "zstd" or not is_whole:
        yield Folder(path, files if is_whole else (), mode)
        return
    from rosbags.rosbag2.storage_mcap import zstd

    with TemporaryDirectory() as name:
        folder = Path(name)
        for file in files:
            most = max(max_file_bytes(), _MOST_RATIO * file.stat().st_size)
            with file.open("rb") as start:
                declared = zstd.get_frame_info(start.read(64)).decompressed_size or 0
            _check(declared, most, file)
            n_bytes = 0
            with zstd.open(file, "rb") as old, (folder / file.stem).open("wb") as new:
                while some := old.read(_AT_ONCE):
                    n_bytes += len(some)
                    _check(n_bytes, most, file)
                    new.write(some)
        plain = {**about, "compression_mode": "", "relative_file_paths": [file.stem for file in files]}
        _write(folder / METADATA, {INFORMATION: plain})
        yield Folder(folder, tuple(folder / file.stem for file in files), mode)


def _information(path: Path) -> dict[str, Any]:
    """Read the description of the folder, or nothing: rosbags reads it too, and says why it cannot."""
    from ruamel.yaml import YAML

    try:
        metadata = YAML(typ="safe").load((path / METADATA).read_text(encoding="utf-8"))
        return dict(metadata[INFORMATION])
    except Exception:
        return {}


def _write(path: Path, content: Any) -> None:
    from ruamel.yaml import YAML

    with path.open("w", encoding="utf-8") as file:
        YAML(typ="safe").dump(content, file)


def _check(n_bytes: int, most: int, source: Path) -> None:
    if n_bytes > most:
        raise DataError(
            f"{source.name}: expected a file that expands to at most {most:,} bytes, got one that expands to "
            f"{n_bytes:,} or more; if you trust it, set the environment variable {VARIABLE} to more"
        )

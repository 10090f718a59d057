"""Small bags whose chunks, messages or files expand to much: refused by their sizes, before memory is taken."""

from __future__ import annotations

import bz2
import io
import re
import struct

import numpy as np
import pytest

import kineme
from bag_files import SECOND, START, Maker, stamps, store, write_bag, write_mcap
from kineme.io.limits import VARIABLE
from kineme.io.reading.recordings import read_recordings
from limited_child import MIB, LimitedChild
from soaking import combined

SIZE = 160 * MIB
MODULES = ("kineme.io.reading.recordings", "kineme.io.ros.read_bag", "rosbags.rosbag1", "rosbags.rosbag2", "lz4.frame")


@pytest.fixture(scope="module")
def child():
    with pytest.MonkeyPatch.context() as patch, LimitedChild(MODULES, memory=150 * MIB) as child:
        patch.setenv(VARIABLE, str(MIB))
        yield child


def joints(kind, n=9):
    m = Maker(kind)
    return [("/joints", ns, m.joint_state(ns, ["a"], [k])) for k, ns in enumerate(stamps(n))]


def written(path, kind, compression, messages):
    """By rosbags, which has no function that compresses in all ways."""
    from rosbags import rosbag1, rosbag2

    if kind == "ros1":
        writer = rosbag1.Writer(path)
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    else:
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        writer.set_compression(rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    return write_bag(path.parent, kind, messages, writer=writer)


def bomb(folder, kind, compression):
    path = folder / ("run.bag" if kind == "ros1" else "run")
    big = ("/joints", START + SECOND, ("sensor_msgs/msg/JointState", bytes(SIZE)))
    return written(path, kind, compression, [*joints(kind), big])


def file_of(path):
    return path if path.is_file() else next(file for file in sorted(path.iterdir()) if file.name != "metadata.yaml")


def refusal(child, path):
    outcome = child.call("kineme.io.reading.recordings:read_recordings", path)
    assert outcome.how == "refused", outcome
    assert path.name in outcome.what
    return outcome.what


WAYS = [("ros1", "LZ4"), ("ros1", "BZ2"), ("mcap", "STORAGE"), ("mcap", "MESSAGE"), ("sqlite3", "MESSAGE")]


@pytest.mark.parametrize(("kind", "compression"), WAYS)
def test_a_bomb_that_says_its_size_or_another(tmp_path, child, kind, compression):
    path = bomb(tmp_path, kind, compression)
    assert file_of(path).stat().st_size < MIB
    said = refusal(child, path)
    assert "at most 67,108,864 bytes of memory, got one that takes 167,77" in said
    assert VARIABLE in said
    if compression != "MESSAGE":
        (say_less_in_ros_1 if kind == "ros1" else say_less_in_mcap)(file_of(path), compression)
        assert "that expands to 5,000 bytes, got one that expands to more" in refusal(child, path)


def say_less_in_ros_1(path, compression):
    data = path.read_bytes()
    at = data.index(b"size=") + 5
    number = data[at : at + 4]
    assert struct.unpack("<L", number)[0] > SIZE
    path.write_bytes(data.replace(b"size=" + number, b"size=" + struct.pack("<L", 5000)))


def say_less_in_mcap(path, compression="zstd"):
    """In the header of the chunk, and in the index if there is one."""
    data = path.read_bytes()
    at = data.index(b"\x28\xb5\x2f\xfd" if compression != "lz4" else b"\x04\x22\x4d\x18") - 8 - 4 - 4 - 4 - 8
    at += compression == "lz4"
    number = data[at : at + 8]
    assert struct.unpack("<Q", number)[0] > SIZE
    places = [at, *(k for k in [data.rindex(number)] if k > at + 100)]  # a frame of LZ4 says it too
    for place in places:
        data = data[:place] + struct.pack("<Q", 5000) + data[place + 8 :]
    path.write_bytes(data)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("compression", ["LZ4", "ZSTD"])
def test_a_bomb_of_the_package_mcap(tmp_path, child, compression, indexed):
    from mcap.writer import CompressionType, IndexType

    options = {} if indexed else {"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False}
    options |= {} if indexed else {"repeat_channels": False, "repeat_schemas": False}
    raw = (bytes(store("mcap").serialize_cdr(message, message.__msgtype__)) for _, _, message in joints("mcap"))
    messages = [("/joints", "sensor_msgs/msg/JointState", START + k, data) for k, data in enumerate(raw)]
    messages += [("/joints", "sensor_msgs/msg/JointState", START + SECOND, bytes(SIZE))]
    path = write_mcap(tmp_path / "a.mcap", messages, compression=CompressionType[compression], **options)
    assert "a chunk of MCAP at byte" in refusal(child, path)
    say_less_in_mcap(path, compression.lower())
    assert "that expands to 5,000 bytes, got one that expands to more" in refusal(child, path)


def test_a_message_whose_size_is_not_said(tmp_path, child):
    from rosbags.rosbag2.storage_mcap import zstd

    stream = zstd.ZstdCompressor()
    raw = b"".join(stream.compress(bytes(MIB)) for _ in range(SIZE // MIB)) + stream.flush()
    assert zstd.get_frame_info(raw).decompressed_size is None
    some = [(topic, ns, (message.__msgtype__, compressed(message))) for topic, ns, message in joints("mcap")]
    path = write_bag(tmp_path, "mcap", [*some, ("/joints", START + SECOND, ("sensor_msgs/msg/JointState", raw))])
    metadata = (path / "metadata.yaml").read_text()
    metadata = metadata.replace("compression_mode: ''", "compression_mode: message")
    (path / "metadata.yaml").write_text(metadata.replace("compression_format: ''", "compression_format: zstd"))
    assert "a message that expands to 67,108,864 bytes, got one that expands to more" in refusal(child, path)


def compressed(message):
    from rosbags.rosbag2.storage_mcap import zstd

    return zstd.compress(bytes(store("mcap").serialize_cdr(message, message.__msgtype__)))


@pytest.mark.parametrize(("kind", "is_said"), combined(["mcap", "sqlite3"], [True, False], together=1))
def test_a_file_that_is_compressed_as_a_whole(tmp_path, child, kind, is_said):
    from rosbags.rosbag2.storage_mcap import zstd

    path = bomb(tmp_path, kind, "FILE")
    file = file_of(path)
    assert file.suffix == ".zstd"
    with zstd.open(file) as old:
        expanded = old.read()
    stream = zstd.ZstdCompressor()
    frames = io.BytesIO(expanded)
    parts = [stream.compress(frames.read(MIB)) for _ in range(SIZE // MIB + 1)]
    file.write_bytes(zstd.compress(expanded) if is_said else b"".join(parts) + stream.flush())
    said = refusal(child, path)
    assert re.search(rf"{file.name}: expected a file that expands to at most [\d,]{{9,10}} bytes, got one that", said)
    assert VARIABLE in said


@pytest.mark.parametrize(("kind", "compression"), [*WAYS, ("mcap", "FILE"), ("sqlite3", "FILE")])
def test_what_is_compressed_and_small_is_read(tmp_path, kind, compression):
    path = written(tmp_path / ("run.bag" if kind == "ros1" else "run"), kind, compression, joints(kind, 900))
    (movement,) = read_recordings(path).demonstrations
    np.testing.assert_array_equal(movement.recorded, np.arange(900)[:, None])


def test_a_file_larger_than_the_limit_is_expanded_if_it_may_be_a_recording(tmp_path, monkeypatch):
    """It goes to the disk and not into memory, and recordings become 64 times smaller at most."""
    path = written(tmp_path / "run", "mcap", "FILE", joints("mcap", 900))
    monkeypatch.setenv(VARIABLE, "50000")
    (movement,) = read_recordings(path).demonstrations
    assert len(movement) == 900


@pytest.mark.parametrize("at_once", [True, False])
def test_chunks_of_one_time_are_in_memory_together(tmp_path, child, at_once):
    m = Maker("mcap")
    messages = []
    for k in range(4):
        ns = START + (0 if at_once else k * SECOND)
        message = m.joint_state(ns, ["a"], [k])
        raw = bytes(store("mcap").serialize_cdr(message, message.__msgtype__))
        messages += [("/joints", "sensor_msgs/msg/JointState", ns, raw), ("/other", "x/msg/Y", ns, bytes(40 * MIB))]
    path = write_mcap(tmp_path / "a.mcap", messages, chunk_size=30 * MIB)
    if at_once:
        assert "a set of chunks of one time that takes at most 67,108,864 bytes" in refusal(child, path)
    else:
        outcome = child.call("kineme.io.reading.recordings:read_recordings", path)
        assert outcome.how == "done", outcome


def test_bytes_that_are_cut_off_are_refused():
    import lz4.frame

    from kineme.io.ros.bags import expand

    for name, compress in {"bz2": bz2.compress, "lz4": lz4.frame.compress}.items():
        data = compress(bytes(range(200)) * 50)
        assert expand(name, data, 10_000) == bytes(range(200)) * 50
        assert expand(name, data + data, 20_000) == bytes(range(200)) * 100
        with pytest.raises(kineme.errors.DataError, match="cut off"):
            expand(name, data[:-9], 10_000)
        with pytest.raises(kineme.errors.DataError, match="expands to 9,999 bytes, got one that expands to more"):
            expand(name, data, 9_999)

"""MCAP files that the package mcap wrote."""

import numpy as np
import pytest

import kineme
from bag_files import START, Maker, pose_rows, stamps, store, write_json_mcap, write_mcap
from kineme.io.reading.recordings import read_recordings


def serialized(m, ns, row):
    message = m.pose_stamped(ns, row)
    return bytes(store("mcap").serialize_cdr(message, message.__msgtype__))


def poses(name="geometry_msgs/msg/PoseStamped"):
    m = Maker("mcap")
    return [("/tool", name, ns, serialized(m, ns, row)) for ns, row in zip(stamps(), pose_rows(), strict=True)]


def compressions():
    from mcap.writer import CompressionType

    return [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


@pytest.mark.parametrize("name", ["geometry_msgs/msg/PoseStamped", "geometry_msgs/PoseStamped"])
@pytest.mark.parametrize("compression", range(3))
def test_an_mcap_by_the_package_mcap(tmp_path, compression, name):
    pytest.importorskip("mcap")
    path = write_mcap(tmp_path / "a.mcap", poses(name), compression=compressions()[compression], chunk_size=500)
    read = read_recordings(path)
    np.testing.assert_array_equal(read.demonstrations[0].recorded, pose_rows())
    assert read.detected[0][0].format == "MCAP"


def test_an_mcap_without_an_index(tmp_path):
    """It is read where its messages are in the order of time, and refused where they are not."""
    from mcap.writer import IndexType

    unindexed = {"use_chunking": False, "use_statistics": False, "use_summary_offsets": False}
    unindexed |= {"index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False}
    path = write_mcap(tmp_path / "a.mcap", poses(), **unindexed)
    np.testing.assert_array_equal(read_recordings(path).demonstrations[0].recorded, pose_rows())
    messages = poses()
    messages[20], messages[30] = messages[30], messages[20]
    path = write_mcap(tmp_path / "b.mcap", messages, **unindexed)
    with pytest.raises(
        kineme.errors.DataError, match=r"b\.mcap: topic /tool: after 21 messages: .*not in timestamp order"
    ):
        read_recordings(path)


def test_an_mcap_whose_messages_are_not_in_order(tmp_path):
    messages = poses()
    messages[20], messages[30] = messages[30], messages[20]
    read = read_recordings(write_mcap(tmp_path / "a.mcap", messages, chunk_size=500))
    np.testing.assert_array_equal(read.demonstrations[0].recorded, pose_rows())


def test_an_mcap_of_another_robot_system_is_named(tmp_path):
    for profile in ("", "px4"):
        path = write_mcap(tmp_path / "a.mcap", poses(), profile=profile, encoding="protobuf")
        with pytest.raises(
            kineme.errors.DataError, match=r"an MCAP file of ROS 2, or .* in JSON, got messages in .*as CSV"
        ):
            read_recordings(path)


PLACES = [{"x": k / 7, "y": k * k / 9, "pose": {"yaw": k / 3}} for k in range(30)]


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_messages_in_json_are_samples(tmp_path, compression):
    from mcap.writer import CompressionType

    stamped = [{"timestamp": {"sec": k // 10, "nsec": k % 10 * 100_000_000}} | place for k, place in enumerate(PLACES)]
    path = write_json_mcap(
        tmp_path / "a.mcap", {"/hand": PLACES, "/stamped": stamped}, compression=CompressionType[compression]
    )
    with pytest.raises(kineme.errors.DataError, match=r"got the topics \['/hand', '/stamped'\]; say which .*--topic"):
        read_recordings(path)
    for topic, step in (("/hand", 0.05), ("/stamped", 0.1)):
        (movement,) = read_recordings(path, topic=topic).demonstrations
        np.testing.assert_array_equal(movement.recorded, [[k / 7, k * k / 9, k / 3] for k in range(30)])
        np.testing.assert_allclose(np.diff(movement.times), step, atol=1e-6)
    with pytest.raises(kineme.errors.DataError, match="messages that are objects, got b'3'"):
        read_recordings(write_json_mcap(tmp_path / "b.mcap", {"/n": [3] * 9}))


def test_messages_in_json_take_no_more_memory_than_a_file_may(tmp_path, monkeypatch):
    path = write_json_mcap(tmp_path / "a.mcap", {"/hand": [{"x": 0.0, "t": k, "note": "a" * 5000} for k in range(99)]})
    assert path.stat().st_size < 50_000
    monkeypatch.setenv("KINEME_MAX_FILE_BYTES", "100000")
    with pytest.raises(kineme.errors.DataError, match="messages in JSON that takes at most 100,000 bytes"):
        read_recordings(path)


def test_a_chunk_of_messages_in_json_expands_no_further_than_it_says(tmp_path):
    from mcap.writer import CompressionType

    path = write_json_mcap(tmp_path / "a.mcap", {"/hand": PLACES}, compression=CompressionType.LZ4)
    data = bytearray(path.read_bytes())
    chunk = next(
        at for at in range(8, len(data)) if data[at] == 6 and data[at + 9 : at + 13] == START.to_bytes(8, "little")[:4]
    )
    data[chunk + 25 : chunk + 33] = (100).to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(
        kineme.errors.DataError, match="a chunk that expands to 100 bytes, got one that expands to more"
    ):
        read_recordings(path)


def test_an_mcap_with_an_encoding_that_rosbags_does_not_know_names_it(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", poses(), encoding="jsonschema")
    with pytest.raises(
        kineme.errors.DataError, match=r"a\.mcap: expected .*, got: 'jsonschema', which rosbags does not know"
    ):
        read_recordings(path)

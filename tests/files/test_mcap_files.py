"""MCAP files that the package mcap wrote."""

import numpy as np
import pytest

import kineme
from bag_files import Maker, pose_rows, stamps, store, write_mcap
from kineme.files.recordings import read_recordings


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
    with pytest.raises(kineme.DataError, match=r"b\.mcap: topic /tool: after 21 messages: .*not in timestamp order"):
        read_recordings(path)


def test_an_mcap_whose_messages_are_not_in_order(tmp_path):
    messages = poses()
    messages[20], messages[30] = messages[30], messages[20]
    read = read_recordings(write_mcap(tmp_path / "a.mcap", messages, chunk_size=500))
    np.testing.assert_array_equal(read.demonstrations[0].recorded, pose_rows())


def test_an_mcap_of_another_robot_system_is_named(tmp_path):
    for profile, named in (("", "no profile"), ("px4", "the b'px4' profile")):
        path = write_mcap(tmp_path / "a.mcap", poses(), profile=profile, encoding="protobuf")
        with pytest.raises(kineme.DataError, match=rf"a\.mcap: expected an MCAP file of ROS 2, got .*{named}.*as CSV"):
            read_recordings(path)


def test_an_mcap_with_an_encoding_that_rosbags_does_not_know_names_it(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", poses(), encoding="jsonschema")
    with pytest.raises(kineme.DataError, match=r"a\.mcap: expected .*, got: 'jsonschema', which rosbags does not know"):
        read_recordings(path)

"""Bags that are cut, foreign, or hold messages that are none: an error that names file and topic, and nothing lost."""

import os
import re
import struct

import numpy as np
import pytest

import kineme
from bag_files import KINDS, SECOND, START, Maker, pose_rows, stamps, write_bag
from kineme.io.reading.recordings import read_recordings
from kineme.io.writing.write_movement import write_movement

EVERY = pytest.mark.parametrize("kind", KINDS)


def a_bag(folder, kind, n=50, name="run", **options):
    m = Maker(kind)
    messages = [("/joints", ns, m.joint_state(ns, ["a", "b"], [k, -k])) for k, ns in enumerate(stamps(n))]
    return write_bag(folder, kind, messages, name, **options)


def file_of(path):
    return path if path.is_file() else next(file for file in sorted(path.iterdir()) if file.name != "metadata.yaml")


def beside(folder, make_movement):
    """A good recording beside the bag, and the problems with the bag."""
    t, x = make_movement(1, 2)
    write_movement(folder / "good.csv", {"times": t, "positions": x})
    read = read_recordings(folder)
    assert "good.csv" in [source.path for source in read.sources]
    return [str(problem) for problem in read.problems]


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.7, 0.999])
@EVERY
def test_a_cut_bag_is_named_and_what_may_help(tmp_path, kind, share, make_movement):
    path = a_bag(tmp_path, kind, 500)
    data = file_of(path).read_bytes()
    file_of(path).write_bytes(data[: int(share * len(data))])
    (problem,) = beside(tmp_path, make_movement)
    assert problem.startswith(f"{path.name}: ")
    assert "expected" in problem
    if share > 0.1:
        assert re.search("rosbag reindex|mcap recover|ros2 bag reindex|--skip sample", problem), problem


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_damage_on_the_way_costs_the_movement_or_what_comes_after(tmp_path, kind):
    m, rows = Maker(kind), np.random.default_rng(0).normal(size=(5000, 40))
    rows[:, 0] = range(5000)
    messages = [("/joints", ns, m.numbers(row)) for ns, row in zip(stamps(5000), rows, strict=True)]
    path = write_bag(tmp_path, kind, messages, compress=kind == "mcap")
    file = file_of(path)
    data = bytearray(file.read_bytes())
    at = len(data) * 6 // 10
    data[at : at + 3000] = b"\xff" * 3000
    file.write_bytes(data)
    with pytest.raises(
        kineme.errors.DataError, match=r"run(\.bag)?: topic /joints: .*; to keep the others, say skip='sample'"
    ):
        read_recordings(path)
    read = read_recordings(path, skip="sample")
    (movement,) = read.demonstrations
    assert 1000 < len(movement) < 5000
    np.testing.assert_array_equal(movement.recorded[:1000, 0], range(1000))
    assert read.problems


@EVERY
def test_messages_that_are_none_are_counted(tmp_path, kind):
    m, messages = Maker(kind), []
    for k, ns in enumerate(stamps()):
        bad = k in (7, 9)
        message = ("sensor_msgs/msg/JointState", b"\x00\x01\x00\x00garbage") if bad else m.joint_state(ns, ["a"], [k])
        messages.append(("/joints", ns, message))
    messages.append(("/odd", START, m.joint_state(START, ["a", "b"], [1])))
    path = write_bag(tmp_path, kind, messages)
    with pytest.raises(
        kineme.errors.DataError, match=r"topic /joints: message 7: .*; 1 more like this; to keep the others"
    ):
        read_recordings(path, topic="/joints")
    read = read_recordings(path, skip="sample", topic="/joints")
    assert read.demonstrations.lengths.tolist() == [48]
    assert read.problems[0].reason.startswith("topic /joints: message 7: ")
    with pytest.raises(
        kineme.errors.DataError, match=r"topic /odd: message 0: expected a position for each joint, got 2"
    ):
        read_recordings(path, topic="/odd")


def test_padding_behind_a_message_is_no_damage(tmp_path):
    """As writers in Python leave it: the buffers that rclpy returns are longer than the messages."""
    from bag_files import store

    m, messages = Maker("mcap"), []
    for ns, row in zip(stamps(), pose_rows(), strict=True):
        message = m.pose_stamped(ns, row)
        raw = bytes(store("mcap").serialize_cdr(message, message.__msgtype__)) + b"\xde\xad\xbe\xef" * 3
        messages.append(("/tool", ns, (message.__msgtype__, raw)))
    read = read_recordings(write_bag(tmp_path, "mcap", messages))
    np.testing.assert_array_equal(read.demonstrations[0].recorded, pose_rows())


@pytest.mark.parametrize("ending", [".bag", ".mcap", ".db3"])
@pytest.mark.parametrize("first", [b"", b"\0" * 64, b"PK\x03\x04", "magic"])
def test_huge_sparse_files_are_refused_at_once(tmp_path, ending, first):
    """Ten gigabytes that take no disk: nothing reads them through, or into memory."""
    magic = {".bag": b"#ROSBAG V2.0\n", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}
    path = tmp_path / f"run{ending}"
    with path.open("wb") as file:
        file.write(magic[ending] if first == "magic" else first)
        file.truncate(10 * 2**30)
    with pytest.raises(kineme.errors.DataError, match=rf"run\{ending}: expected"):
        read_recordings(path)


def test_a_sparse_mcap_that_ends_as_one_is_refused_at_once(tmp_path):
    """It has no index, and between its ends are zeros, which are no records."""
    data = file_of(a_bag(tmp_path, "mcap")).read_bytes()
    header_end = 17 + struct.unpack("<Q", data[9:17])[0]
    path = tmp_path / "sparse.mcap"
    with path.open("wb") as file:
        file.write(data[:header_end])
        file.truncate(10 * 2**30)
        file.seek(0, os.SEEK_END)
        file.write(b"\x02\x14" + bytes(7 + 20) + data[-8:])
    with pytest.raises(
        kineme.errors.DataError, match=r"sparse\.mcap: expected a record of MCAP at byte \d+, got zeros"
    ):
        read_recordings(path)


def test_a_missing_file_of_a_bag_is_named(tmp_path, make_movement):
    path = a_bag(tmp_path, "mcap")
    file_of(path).rename(path / "other.mcap")
    (problem,) = beside(tmp_path, make_movement)
    assert problem.startswith("run: expected a bag of ROS that can be opened, got: Some database files are missing")


def test_metadata_that_is_none_is_named(tmp_path, make_movement):
    path = a_bag(tmp_path, "mcap")
    for text in ("[", ": 5", ":\n  version: 99", "\0"):
        (path / "metadata.yaml").write_text(f"rosbag2_bagfile_information{text}")
        (problem,) = beside(tmp_path, make_movement)
        assert problem.startswith("run: expected a bag of ROS that can be opened, got: "), text


@pytest.mark.parametrize("text", ["", "title: my recordings\n", None])
def test_a_folder_whose_metadata_are_of_another_program_is_one_of_files(tmp_path, text):
    path = a_bag(tmp_path, "mcap")
    (path / "metadata.yaml").unlink()
    if text is not None:
        (path / "metadata.yaml").write_text(text)
    read = read_recordings(path)
    assert [source.path for source in read.sources] == ["run.mcap"]
    assert [problem.file for problem in read.problems] == ([] if text is None else ["metadata.yaml"])


def test_file_names_in_metadata_that_are_paths_lead_nowhere(tmp_path):
    path = a_bag(tmp_path, "mcap")
    secret = file_of(path).rename(tmp_path / "secret.mcap")
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(text.replace("run.mcap", "../secret.mcap"))
    (path / "beside.mcap").write_bytes(b"")
    assert secret.exists()
    with pytest.raises(kineme.errors.DataError, match="Some database files are missing"):
        read_recordings(path)


@pytest.mark.skipif(os.name != "posix", reason="such names are those of POSIX systems")
@pytest.mark.parametrize("name", ["a?mode=rwc", "a#b", "100%41", "a b; $(c)", "\u00e9\u2603"])
@EVERY
def test_names_of_bags_that_mean_something_to_a_shell_or_a_database(tmp_path, kind, name):
    path = a_bag(tmp_path, kind)
    if path.is_dir():
        file = file_of(path)
        (path / "metadata.yaml").write_text((path / "metadata.yaml").read_text().replace(file.name, name + file.suffix))
        file.rename(path / (name + file.suffix))
    path = path.rename(tmp_path / (name + path.suffix))
    assert len(read_recordings(path)) == 1
    if path.is_dir():
        file = file_of(path)
        assert len(read_recordings(file)) == 1


def test_names_of_topics_and_joints_that_are_paths(tmp_path):
    m = Maker("mcap")
    names = ["../../etc/passwd", "\x1b[2J", "", "a\nb"]
    messages = [("/../../x", ns, m.joint_state(ns, names, [k] * 4)) for k, ns in enumerate(stamps(9))]
    read = read_recordings(write_bag(tmp_path, "mcap", messages))
    assert read.detected[0][0].columns == tuple(names)
    assert read.detected[0][0].layout == "topic /../../x of sensor_msgs/msg/JointState"


def test_definitions_in_a_bag_are_not_executed(tmp_path):
    """Rosbags makes program code of them; here the standard types are used, whatever a bag says."""
    path = a_bag(tmp_path, "mcap")
    file = file_of(path)
    data = file.read_bytes()
    assert data.count(b"string[] name") == 2
    file.write_bytes(data.replace(b"string[] name", b"hostile; code"))
    assert len(read_recordings(file)) == 1


def test_another_version_of_a_type_is_refused(tmp_path):
    path = a_bag(tmp_path, "ros1")
    data = path.read_bytes()
    md5 = b"3066dcd76a6cfaef579bd0f34173e9fd"
    assert data.count(md5) == 2
    path.write_bytes(data.replace(md5, b"0" * 32))
    with pytest.raises(
        kineme.errors.DataError, match=r"topic /joints: expected messages of the standard type .*JointState"
    ):
        read_recordings(path)


def test_a_log_beside_a_database_is_named(tmp_path):
    path = a_bag(tmp_path, "sqlite3")
    file = file_of(path)
    file.with_name(f"{file.name}-wal").write_bytes(b"messages")
    (problem,) = read_recordings(path).problems
    assert problem.reason == (
        f"{file.name}-wal: messages that are not in the database yet; to add them, open it once: sqlite3 {file.name} "
        "'PRAGMA wal_checkpoint(TRUNCATE)'"
    )


def test_fewer_messages_than_the_bag_says_are_named(tmp_path):
    path = a_bag(tmp_path, "sqlite3")
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(re.sub("message_count: 50", "message_count: 70", text))
    read = read_recordings(path)
    assert len(read) == 1
    assert [problem.reason for problem in read.problems] == ["topic /joints: expected 70 messages, got 50"]


def test_a_damaged_transform_topic_is_named(tmp_path):
    m = Maker("mcap")
    messages = [("/tf", START + k * SECOND, ("tf2_msgs/msg/TFMessage", b"\0\1\0\0\xff\xff")) for k in range(4)]
    path = write_bag(tmp_path, "mcap", messages)
    with pytest.raises(kineme.errors.DataError, match=r"expected a frame 'a', got .*"):
        read_recordings(path, frame="a:b")
    messages += [
        ("/tf", s, m.tf(m.transform_stamped(s, "a", "b", r))) for s, r in zip(stamps(), pose_rows(), strict=True)
    ]
    path = write_bag(tmp_path, "mcap", messages, "some")
    with pytest.raises(
        kineme.errors.DataError, match=r"topic /tf: message \d+: .*; 3 more like this; to keep the others"
    ):
        read_recordings(path, frame="a:b")
    read = read_recordings(path, frame="a:b", skip="sample")
    assert read.demonstrations.lengths.tolist() == [50]
    assert len(read.problems) == 1


def test_a_cut_file_of_a_folder_is_named(tmp_path):
    path = a_bag(tmp_path, "mcap")
    file_of(path).write_bytes(file_of(path).read_bytes()[:-100])
    with pytest.raises(
        kineme.errors.DataError, match=r"run: run\.mcap: expected an MCAP file that was closed.*mcap recover"
    ):
        read_recordings(path)


def test_a_chunk_of_gigabytes_that_are_zeros_is_refused_at_once(tmp_path):
    path = a_bag(tmp_path, "ros1")
    data = path.read_bytes()
    at = data.index(b"size=") + 5 + 4  # the size of the chunk in the file, behind the header of the chunk
    with path.open("wb") as file:
        file.write(data[:at] + struct.pack("<L", 4 * 10**9) + data[at + 4 :])
        file.truncate(10 * 2**30)
    with pytest.raises(
        kineme.errors.DataError, match=r"run\.bag: expected a bag .*, got: records that contradict each other"
    ):
        read_recordings(path)


def test_stamps_of_two_clocks_are_said_with_the_way_out(tmp_path):
    m, rows = Maker("mcap"), pose_rows()
    messages = [("/sim", ns, m.joint_state(ns - START, ["a"], [k])) for k, ns in enumerate(stamps())]
    messages += [("/tool", ns, m.pose_stamped(ns, row)) for ns, row in zip(stamps(), rows, strict=True)]
    path = write_bag(tmp_path, "mcap", messages)
    expected = r"got none: /sim from 0 to 0.49 s, /tool from 1700000000 to 1700000000.49 s; .* --time recorded"
    with pytest.raises(kineme.errors.DataError, match=expected):
        read_recordings(path, topic=["/sim", "/tool"])
    (movement,) = read_recordings(path, topic=["/sim", "/tool"], time="recorded").demonstrations
    np.testing.assert_array_equal(movement.recorded[:, 0], range(50))

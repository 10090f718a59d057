"""A copy of a bag with one topic more: every other message byte for byte, read by rosbags and the package mcap."""

import re
import shutil
import sqlite3
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest

import kineme
from bag_files import KINDS, SECOND, START, Maker, pose_rows, stamps, store, write_bag, write_mcap
from kineme.io.ros.add_topic import copy_with_topic

pytest.importorskip("rosbags")

TOPIC = "/kineme/annotations"
TEXTS = [(START + SECOND // 4, '{"symbol": "né"}'), (START + SECOND // 10, "first"), (START + SECOND // 4, "last")]


def reader(path):
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    return (Reader1 if path.suffix == ".bag" else Reader2)(path)


def raw_messages(path):
    """(topic, type, definition's checksum, time, bytes) of all messages, in the order of reading."""
    with reader(path) as bag:
        return [
            (connection.topic, connection.msgtype, connection.digest, t, bytes(raw))
            for connection, t, raw in bag.messages()
        ]


def texts_of(path, kind):
    types = store(kind)
    parse = types.deserialize_ros1 if kind == "ros1" else types.deserialize_cdr
    return [(t, parse(raw, name).data) for topic, name, _, t, raw in raw_messages(path) if topic == TOPIC]


def recorded(tmp_path, kind, compress=False, name="run"):
    m = Maker(kind)
    poses = zip(stamps(), pose_rows(), strict=True)
    messages = [("/tool", ns, m.pose_stamped(ns, row)) for ns, row in poses]
    messages += [("/chatter", ns + 5, m.string("x" * 3000)) for ns in stamps(20)]
    messages += [("/raw", ns + 7, ("std_msgs/msg/String", bytes(range(40)))) for ns in stamps(3)]
    messages += [("/empty", "sensor_msgs/msg/JointState", None)]
    return write_bag(tmp_path, kind, messages, name=name, compress=compress)


def copied(source, target, texts=TEXTS):
    copy_with_topic(source, target, TOPIC, lambda first, last: texts)
    return target


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_all_other_messages_are_the_same_bytes(tmp_path, kind, compress):
    source = recorded(tmp_path, kind, compress)
    target = copied(source, tmp_path / ("named.bag" if kind == "ros1" else "named"))
    assert [message for message in raw_messages(target) if message[0] != TOPIC] == raw_messages(source)
    assert texts_of(target, kind) == sorted(TEXTS)
    with reader(source) as old, reader(target) as new:
        assert set(new.topics) == {*old.topics, TOPIC}
        assert new.topics[TOPIC].msgtype == "std_msgs/msg/String"
        assert new.topics[TOPIC].msgcount == len(TEXTS)
        assert (new.start_time, new.end_time) == (old.start_time, old.end_time)
        assert new.message_count == old.message_count + len(TEXTS)
    times = [message[3] for message in raw_messages(target)]
    assert times == sorted(times)


def test_texts_are_asked_for_with_the_times_of_the_first_and_the_last_message(tmp_path):
    recorded_at = [*stamps(), *(ns + 5 for ns in stamps(20)), *(ns + 7 for ns in stamps(3))]
    spans = []
    for kind in KINDS:
        source = recorded(tmp_path, kind, name=kind)
        target = tmp_path / f"named_{kind}{source.suffix}"
        copy_with_topic(source, target, TOPIC, lambda *span: spans.append(span) or TEXTS)
    assert spans == [(min(recorded_at), max(recorded_at))] * len(KINDS)


def test_messages_outside_of_the_recording_extend_it(tmp_path):
    for kind in KINDS:
        source = recorded(tmp_path, kind, name=kind)
        texts = [(START - SECOND, "before"), (START + 100 * SECOND, "after")]
        target = copied(source, tmp_path / f"named_{kind}{source.suffix}", texts)
        assert texts_of(target, kind) == texts
        with reader(target) as new:
            assert (new.start_time, new.end_time) == (START - SECOND, START + 100 * SECOND + 1)


@pytest.mark.parametrize("ending", [".mcap", ".db3"])
def test_a_bare_file_of_ros_2(tmp_path, ending):
    kind = "mcap" if ending == ".mcap" else "sqlite3"
    source = recorded(tmp_path, kind) / f"run{ending}"
    target = copied(source, tmp_path / f"named{ending}")
    assert [message for message in raw_messages(target) if message[0] != TOPIC] == raw_messages(source)
    assert texts_of(target, kind) == sorted(TEXTS)


def test_a_copy_is_compressed_as_its_bag(tmp_path):
    sources = recorded(tmp_path, "ros1", compress=True, name="lz4"), recorded(tmp_path, "ros1", name="none")
    for source in sources:
        data = copied(source, tmp_path / f"b_{source.name}").read_bytes()
        assert set(re.findall(rb"compression=(\w+)", data)) == {source.stem.encode()}
        # a version of 1, independent blocks, no size, a checksum of the content: what roslz4 reads
        assert set(re.findall(rb"\x04\x22\x4d\x18(.)", data, re.DOTALL)) == (
            {b"\x64"} if source.stem == "lz4" else set()
        )


def test_connections_that_are_equal_become_one(tmp_path):
    """A node that began anew publishes under its old name: roscpp records another connection."""
    m = Maker("ros1")
    messages = [(topic, ns, m.string(topic)) for ns in stamps(5) for topic in ("/aa", "/ab")]
    source = write_bag(tmp_path, "ros1", messages)
    source.write_bytes(source.read_bytes().replace(b"topic=/ab", b"topic=/aa"))
    with reader(source) as old, reader(copied(source, tmp_path / "b.bag")) as new:
        assert [len(old.topics["/aa"].connections), len(new.topics["/aa"].connections)] == [2, 1]
        assert old.topics["/aa"].msgcount == new.topics["/aa"].msgcount == 10
    assert [message for message in raw_messages(tmp_path / "b.bag") if message[0] != TOPIC] == raw_messages(source)


def plain(message):
    """A message of the package mcap without the number of its channel, which is the file's own."""
    return {name: value for name, value in vars(message).items() if name != "channel_id"}


def test_the_package_mcap_reads_the_copy(tmp_path):
    make_reader = pytest.importorskip("mcap.reader").make_reader
    source = recorded(tmp_path, "mcap") / "run.mcap"
    target = copied(source, tmp_path / "named.mcap")
    with source.open("rb") as file:
        old = [(channel.topic, plain(message)) for _, channel, message in make_reader(file).iter_messages()]
    with target.open("rb") as file:
        read = make_reader(file, validate_crcs=True)
        new = [(channel.topic, plain(message)) for _, channel, message in read.iter_messages()]
        counts = read.get_summary().statistics
    assert [message for message in new if message[0] != TOPIC] == old
    assert [message["log_time"] for name, message in new if name == TOPIC] == [t for t, _ in sorted(TEXTS)]
    assert counts.message_count == len(new)


def test_checksums_attachments_and_metadata_of_an_mcap_stay(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    from mcap.reader import make_reader

    source = tmp_path / "a.mcap"
    with source.open("wb") as file:
        mcap = writer.Writer(file, chunk_size=300, enable_crcs=True, enable_data_crcs=True)
        mcap.start(profile="ros2", library="test")
        channel = mcap.register_channel(
            "/s", "cdr", mcap.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        )
        raw = bytes(store("mcap").serialize_cdr(Maker("mcap").string("x" * 50), "std_msgs/msg/String"))
        for k, ns in enumerate(stamps()):
            mcap.add_message(channel, ns, raw, ns - 10**9, k)
        mcap.add_attachment(START, START, "notes.txt", "text/plain", b"abc")
        mcap.add_metadata("who", {"person": "anna"})
        mcap.finish()
    target = copied(source, tmp_path / "b.mcap")
    with target.open("rb") as file:
        read = make_reader(file, validate_crcs=True)
        messages = [(c.topic, m.sequence, m.publish_time) for _, c, m in read.iter_messages() if c.topic != TOPIC]
        assert messages == [("/s", k, ns - 10**9) for k, ns in enumerate(stamps())]
        assert [attachment.data for attachment in read.iter_attachments()] == [b"abc"]
        assert [metadata.metadata for metadata in read.iter_metadata()] == [{"person": "anna"}]
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    with target.open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
    assert len(records) > 50
    times = [record.log_time for record in records if isinstance(record, Message)]
    assert times == sorted(times)  # whenever they were published


@pytest.mark.parametrize("options", [{"use_chunking": False}, {"repeat_channels": False}, {"index_types": 0}])
def test_an_mcap_without_chunks_or_index_is_copied_with_both(tmp_path, options):
    """As rosbag2 records in its profile "fastwrite"."""
    writer = pytest.importorskip("mcap.writer")
    if "index_types" in options:
        options = {"index_types": writer.IndexType.NONE}
    types = store("mcap")
    raw = bytes(types.serialize_cdr(Maker("mcap").string("x"), "std_msgs/msg/String"))
    messages = [("/s", "std_msgs/msg/String", ns, raw) for ns in stamps(5)]
    write_mcap(tmp_path / "a.mcap", messages, **options)
    target = copied(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert texts_of(target, "mcap") == sorted(TEXTS)
    assert [message[3:] for message in raw_messages(target) if message[0] != TOPIC] == [(ns, raw) for ns in stamps(5)]


def test_chunks_of_a_copy_overlap_no_more_than_those_of_the_file(tmp_path):
    """All that is of one time is read at once: texts stand among the messages of their time."""
    m = Maker("mcap")
    text = m.string("".join(map(chr, np.random.default_rng(0).integers(65, 90, 100_000))))
    source = write_bag(tmp_path, "mcap", [("/s", ns, text) for ns in stamps(50)])
    texts = [(ns + 1, "x") for ns in stamps(50)]
    with reader(copied(source, tmp_path / "b", texts)) as new:
        spans = [(chunk.message_start_time, chunk.message_end_time) for chunk in new.storage.storages[0].chunks]
    assert len(spans) > 3
    assert all(end <= start for (_, end), (start, _) in pairwise(spans))


def offered():
    """A quality of service as of /tf_static."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    forever = QosTime(9223372036, 854775807)
    how = (QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, forever, forever, QosLiveliness.AUTOMATIC, forever)
    return [Qos(QosHistory.KEEP_LAST, 1, *how, False)]


@pytest.mark.parametrize(("kind", "version"), [("mcap", 8), ("mcap", 9), ("sqlite3", 8), ("sqlite3", 9)])
def test_how_topics_were_offered_stays(tmp_path, kind, version):
    from rosbags.rosbag2 import StoragePlugin, Writer

    m = Maker(kind)
    with Writer(tmp_path / "run", version=version, storage_plugin=StoragePlugin[kind.upper()]) as writer:
        static = writer.add_connection(
            "/s", "std_msgs/msg/String", typestore=store(kind), offered_qos_profiles=offered()
        )
        plain = writer.add_connection("/t", "std_msgs/msg/String", typestore=store(kind))
        for ns in stamps(5):
            for messages in (static, plain):
                writer.write(messages, ns, store(kind).serialize_cdr(m.string("x"), "std_msgs/msg/String"))
    with reader(tmp_path / "run") as old, reader(copied(tmp_path / "run", tmp_path / "named")) as new:
        before = [connection._replace(owner=None) for connection in old.connections]
        assert [
            connection._replace(owner=None) for connection in new.connections if connection.topic != TOPIC
        ] == before
        assert before[0].ext.offered_qos_profiles == offered()
        (added,) = (connection for connection in new.connections if connection.topic == TOPIC)
        assert (added.ext.serialization_format, added.ext.offered_qos_profiles) == ("cdr", [])
        assert new.message_count == 10 + len(TEXTS)
        assert (new.start_time, new.duration) == (old.start_time, max(old.duration, SECOND // 4 + 1))


def test_who_published_and_what_is_latched_stays_in_a_bag_of_ros_1(tmp_path):
    from rosbags.rosbag1 import Writer

    m, types = Maker("ros1"), store("ros1")
    with Writer(tmp_path / "run.bag") as writer:
        for who in ("/node_a", "/node_b"):
            new_connection = writer.add_connection(
                "/s", "std_msgs/msg/String", typestore=types, callerid=who, latching=1
            )
            for ns in stamps(5):
                writer.write(new_connection, ns, types.serialize_ros1(m.string(who), "std_msgs/msg/String"))
    with reader(tmp_path / "run.bag") as old, reader(copied(tmp_path / "run.bag", tmp_path / "named.bag")) as new:
        before = [connection._replace(owner=None) for connection in old.connections]
        assert [(connection.ext.callerid, connection.ext.latching) for connection in before] == [
            ("/node_a", 1),
            ("/node_b", 1),
        ]
        assert [
            connection._replace(owner=None) for connection in new.connections if connection.topic != TOPIC
        ] == before


def test_each_message_goes_into_the_file_of_its_time(tmp_path):
    """As rosbag2 divides a long recording."""
    from ruamel.yaml import YAML

    first, second = (recorded(tmp_path, "sqlite3", name=name) for name in ("a", "b"))
    database = sqlite3.connect(second / "b.db3")
    database.execute("UPDATE messages SET timestamp = timestamp + ?", (10 * SECOND,))
    database.commit()
    database.close()
    shutil.move(second / "b.db3", first / "b.db3")
    yaml = YAML()
    metadata = yaml.load(first / "metadata.yaml")
    about = metadata["rosbag2_bagfile_information"]
    about["relative_file_paths"].append("b.db3")
    about["message_count"] *= 2
    for topic in about["topics_with_message_count"]:
        topic["message_count"] *= 2
    about["duration"]["nanoseconds"] += 10 * SECOND
    later = {"path": "b.db3", "starting_time": {"nanoseconds_since_epoch": START + 10 * SECOND}}
    about["files"].append({**later, "duration": {"nanoseconds": SECOND}, "message_count": 73})
    about["custom_data"] = {"who": "anna"}
    yaml.dump(metadata, first / "metadata.yaml")
    texts = [(START - 9, "before a"), (START + SECOND // 4, "in a")]
    texts += [(START + 10 * SECOND + 9, "in b"), (START + 10 * SECOND + 10, "in b")]
    target = copied(first, tmp_path / "named", texts)
    assert texts_of(target / "a.db3", "sqlite3") == texts[:2]
    assert texts_of(target / "b.db3", "sqlite3") == texts[2:]
    assert texts_of(target, "sqlite3") == texts
    assert [message for message in raw_messages(target) if message[0] != TOPIC] == raw_messages(first)
    new = yaml.load(target / "metadata.yaml")["rosbag2_bagfile_information"]
    assert [file["message_count"] for file in new["files"]] == [75, 75]
    assert new["custom_data"] == {"who": "anna"}


def test_an_older_database_has_fewer_columns(tmp_path):
    source = recorded(tmp_path, "sqlite3") / "run.db3"
    database = sqlite3.connect(source)
    for table in ("schema", "metadata", "message_definitions"):
        database.execute(f"DROP TABLE {table}")
    database.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    database.commit()
    database.close()
    assert texts_of(copied(source, tmp_path / "b.db3"), "sqlite3") == sorted(TEXTS)


@pytest.mark.parametrize("kind", KINDS)
def test_without_texts_it_is_a_plain_copy(tmp_path, kind):
    source = recorded(tmp_path, kind)
    target = copied(source, tmp_path / f"b{source.suffix}", [])
    assert raw_messages(target) == raw_messages(source)


@pytest.mark.parametrize("kind", KINDS)
def test_a_topic_of_that_name_is_not_mixed_with_ours(tmp_path, kind):
    once = copied(recorded(tmp_path, kind), tmp_path / ("a.bag" if kind == "ros1" else "a"))
    with pytest.raises(kineme.errors.DataError, match="without the topic /kineme/annotations, got one that has it"):
        copied(once, tmp_path / f"b{once.suffix}")


def test_files_that_are_compressed_as_a_whole_are_refused(tmp_path):
    from ruamel.yaml import YAML

    source = recorded(tmp_path, "mcap")
    yaml = YAML()
    metadata = yaml.load(source / "metadata.yaml")
    from rosbags.rosbag2.storage_mcap import zstd

    (source / "run.mcap.zstd").write_bytes(zstd.compress((source / "run.mcap").read_bytes()))
    (source / "run.mcap").unlink()
    about = metadata["rosbag2_bagfile_information"]
    about |= {"compression_mode": "file", "compression_format": "zstd", "relative_file_paths": ["run.mcap.zstd"]}
    yaml.dump(metadata, source / "metadata.yaml")
    with pytest.raises(kineme.errors.DataError, match=r"not compressed as a whole.*ros2 bag convert"):
        copied(source, tmp_path / "b")


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_memory_does_not_grow_with_the_bag(tmp_path, kind):
    m = Maker(kind)
    text = m.string("".join(map(chr, np.random.default_rng(0).integers(65, 90, 100_000))))
    source = write_bag(tmp_path, kind, [("/s", ns, text) for ns in stamps(300)])
    copied(source, tmp_path / f"warm{source.suffix}")
    tracemalloc.start()
    copied(source, tmp_path / f"b{source.suffix}")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 6_000_000


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_bag_is_copied_or_refused_by_name(tmp_path, kind):
    """Bytes of the index, where the copy is changed, are replaced at random."""
    source = recorded(tmp_path, kind)
    file = source if kind == "ros1" else source / ("run.mcap" if kind == "mcap" else "run.db3")
    data, random = file.read_bytes(), np.random.default_rng(0)
    damaged, refused = tmp_path / f"damaged{file.suffix}", 0
    for k in range(60):
        spoiled = np.frombuffer(data, np.uint8).copy()
        near_end = random.integers(len(data) - 1500, len(data), 6) if kind != "sqlite3" else random.integers(0, 4000, 6)
        spoiled[near_end] = random.integers(0, 256, 6)
        damaged.write_bytes(spoiled.tobytes())
        try:
            copied(damaged, tmp_path / f"{k}{file.suffix}")
        except (
            kineme.errors.DataError,
            MemoryError,
        ):  # rosbags believes any length; readers of files answer for memory
            refused += 1
    assert refused

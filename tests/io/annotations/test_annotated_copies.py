"""Annotations inside copies of recordings: which writer is asked for, stamps, contents, and what is refused."""

import json

import numpy as np
import pytest

import kineme
from bag_files import SECOND, START, Maker, pose_rows, stamps, store, write_bag
from kineme.io.lerobot.motions import read_motions
from kineme.io.writing.annotations import Annotation, write_annotations
from lerobot_sets import write_lance, write_v2, write_v3

pytest.importorskip("rosbags")

TOPIC = "/kineme/annotations"


def one(start, end, symbol, place="", origin=1.7e9):
    return Annotation("run", place, start, end, symbol, 0.25, 0.75, origin, 0.125)


def bag(tmp_path, kind):
    m = Maker(kind)
    return write_bag(
        tmp_path, kind, [("/tool", ns, m.pose_stamped(ns, row)) for ns, row in zip(stamps(), pose_rows(), strict=True)]
    )


def said(path, kind):
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    types = store(kind)
    parse = types.deserialize_ros1 if kind == "ros1" else types.deserialize_cdr
    with (Reader1 if kind == "ros1" else Reader2)(path) as read:
        return [(t, json.loads(parse(raw, c.msgtype).data)) for c, t, raw in read.messages() if c.topic == TOPIC]


@pytest.mark.parametrize(("kind", "name"), [("ros1", "named.bag"), ("sqlite3", "named"), ("mcap", "named")])
def test_a_bag_has_a_message_at_the_end_of_each_movement(tmp_path, kind, name):
    source = bag(tmp_path, kind)
    annotations = [one(1.7e9 + 0.1, 1.7e9 + 0.25, "wavé"), one(1.7e9 + 0.25, 1.7e9 + 0.5, None)]
    assert write_annotations(tmp_path / name, annotations, [source]) == [tmp_path / name]
    contents = said(tmp_path / name, kind)
    np.testing.assert_allclose([t - START for t, _ in contents], [SECOND / 4, SECOND / 2], atol=1000)
    first, second = (content for _, content in contents)
    assert first == {
        "place": "", "start": 1.7e9 + 0.1, "end": 1.7e9 + 0.25, "symbol": "wavé", "p_value": 0.25, "confidence": 0.75,
        "unknown": False, "uncertainty": 0.125,
    }  # fmt: skip
    assert (second["symbol"], second["unknown"]) == (None, True)


def test_another_clock_counts_from_the_beginning_of_the_bag(tmp_path):
    """Stamps of a simulation begin at 0; a message at 1970 would be out of sight."""
    source = bag(tmp_path, "mcap") / "run.mcap"
    write_annotations(tmp_path / "b.mcap", [one(12.1, 12.25, "a", origin=12.0)], [source])
    ((t, content),) = said(tmp_path / "b.mcap", "mcap")
    assert content["end"] == 12.25
    assert t == START + SECOND // 4


def test_a_clock_that_some_movements_leave_is_another_one_for_all(tmp_path):
    """A clock that is 0.9 s ahead: one movement would seem to end within a second of the bag, the other does not."""
    source = bag(tmp_path, "mcap") / "run.mcap"
    ahead = 1.7e9 + 0.9
    annotations = [one(ahead, ahead + 0.1, "a", origin=ahead), one(ahead + 5.0, ahead + 5.25, "b", origin=ahead)]
    write_annotations(tmp_path / "b.mcap", annotations, [source])
    np.testing.assert_allclose([t - START for t, _ in said(tmp_path / "b.mcap", "mcap")], [1e8, 5.25e9], atol=1000)


def test_a_movement_may_end_a_second_beside_the_messages(tmp_path):
    """Headers are stamped before messages are recorded."""
    source = bag(tmp_path, "mcap") / "run.mcap"
    write_annotations(tmp_path / "b.mcap", [one(1.7e9 - 0.8, 1.7e9 - 0.5, "a", origin=1.7e9 - 0.9)], [source])
    ((t, _),) = said(tmp_path / "b.mcap", "mcap")
    assert abs(t - START + SECOND // 2) < 1000


def test_a_bag_is_not_copied_over_itself_nor_as_another_kind(tmp_path):
    source = bag(tmp_path, "ros1")
    before = source.read_bytes()
    with pytest.raises(kineme.errors.DataError, match=r"expected another path for the copy than the recording"):
        write_annotations(source, [one(0, 1, "a")], [source])
    with pytest.raises(kineme.errors.DataError, match=r"ends in \.bag for a copy of run\.bag, got b\.mcap"):
        write_annotations(tmp_path / "b.mcap", [one(0, 1, "a")], [source])
    assert source.read_bytes() == before
    folder = bag(tmp_path, "mcap")
    with pytest.raises(kineme.errors.DataError, match=r"expected the name of a folder"):
        write_annotations(tmp_path / "b.mcap", [one(0, 1, "a")], [folder])
    with pytest.raises(kineme.errors.DataError, match=r"or one inside"):
        write_annotations(folder / "b", [one(0, 1, "a")], [folder])


def test_nothing_is_left_of_a_copy_that_fails(tmp_path):
    source = bag(tmp_path, "mcap")
    write_annotations(tmp_path / "once", [one(1.7e9, 1.7e9 + 0.1, "a")], [source])
    before = sorted(tmp_path.iterdir())
    with pytest.raises(kineme.errors.DataError, match="got one that has it"):
        write_annotations(tmp_path / "twice", [one(1.7e9, 1.7e9 + 0.1, "a")], [tmp_path / "once"])
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_with_files_is_never_written_over(tmp_path):
    source = bag(tmp_path, "mcap")
    (tmp_path / "named").mkdir()
    (tmp_path / "named" / "thesis.txt").write_text("mine")
    with pytest.raises(kineme.errors.DataError, match=r"expected a new folder .* is there; name another, or remove it"):
        write_annotations(tmp_path / "named", [one(0, 1, "a")], [source])
    assert [path.name for path in (tmp_path / "named").iterdir()] == ["thesis.txt"]


def test_a_lerobot_set_says_it_on_the_frames(tmp_path):
    pandas = pytest.importorskip("pandas")
    source = write_v3(tmp_path / "set", fps=10)
    annotations = [one(0.5, 1.1, "wave", "episode 0", 0.0), one(0.0, 2.4, None, "episode 2", 0.0)]
    (tmp_path / "named").mkdir()  # an empty folder is as good as none
    assert write_annotations(tmp_path / "named", annotations, [source]) == [tmp_path / "named"]
    frames = pandas.read_parquet(tmp_path / "named" / "data" / "chunk-000" / "file-000.parquet")
    for episode, rows in zip(frames.episode_index, frames.language_persistent, strict=True):
        assert [row["content"] for row in rows] == (["rest", "wave", "rest"] if episode == 0 else [])
        assert [(row["style"], row["camera"]) for row in rows] == [("motion", None)] * len(rows)
    assert [motion[:6] for motion in read_motions(tmp_path / "named")] == [
        (0, 0.5, 1.1, "wave", 0.25, 0.75), (2, 0.0, 2.4, None, 0.25, 0.75),
    ]  # fmt: skip
    assert len(kineme.read_recordings(tmp_path / "named").demonstrations) == 3
    again = write_annotations(tmp_path / "again", annotations[:1], [tmp_path / "named"])[0]
    frames = pandas.read_parquet(again / "data" / "chunk-000" / "file-000.parquet")
    assert [len(rows) for rows in frames.language_persistent] == [3] * 20 + [0] * 30
    two = write_annotations(tmp_path / "two", annotations, [write_v2(tmp_path / "old", fps=10)])[0]
    frames = pandas.read_parquet(two / "data" / "chunk-000" / "episode_000000.parquet")
    (text,) = set(frames["annotation.motion"])
    assert [row["content"] for row in json.loads(text)] == ["rest", "wave", "rest"]
    with pytest.raises(kineme.errors.DataError, match="expected annotations of episodes, got one of 'run 3'"):
        write_annotations(tmp_path / "three", [one(0, 1, "a", "run 3")], [source])


def test_a_lerobot_set_in_lance_is_copied_or_named_in_place(tmp_path):
    lance = pytest.importorskip("lance")
    source = write_lance(tmp_path / "set", fps=10)
    wave = [one(0.5, 1.1, "wave", "episode 0", 0.0)]

    def contents(folder):
        frames = lance.dataset(str(folder / "frames.lance"))
        return [row["content"] for row in frames.to_table(limit=1)["language_persistent"][0].as_py()]

    write_annotations(tmp_path / "named", wave, [source])
    assert contents(tmp_path / "named") == ["rest", "wave", "rest"]
    assert read_motions(source) == []
    assert lance.dataset(str(source / "frames.lance")).version == 1
    assert write_annotations(source, [one(0, 9, "bow", "episode 0", 0.0)], [source]) == [source]
    assert contents(source) == ["bow"]
    assert contents(tmp_path / "named") == ["rest", "wave", "rest"]
    with pytest.raises(kineme.errors.DataError, match="expected another path for the copy"):
        write_annotations(source / "named", wave, [source])

"""Motions in a data set of LeRobot in Lance: one version each time, frames where they were, nothing of others lost."""

import json
import os
import shutil

import pyarrow as pa
import pytest

import kineme
from kineme.errors import DataError
from kineme.io.lerobot import copy
from kineme.io.lerobot.copy import copy_in_lance, name_in_place
from kineme.io.lerobot.motions import DETAILS, PENDING, Motion, read_motions
from kineme.io.reading.episodes import read_episodes
from lerobot_sets import TASKS, write_lance, write_v3

lance = pytest.importorskip("lance")

WAVE = {0: [Motion(0, 0, 9, "wave", 0.5, 0.75)], 2: [Motion(2, 0.5, 1, "nod")]}
NAMED = {0: ["wave"], 1: [], 2: ["rest", "nod", "rest"]}
BOW = {1: [Motion(1, 0, 9, "bow")]}


@pytest.fixture
def source(tmp_path):
    return write_lance(tmp_path / "set", fps=10)


def frames(folder, version=None):
    return lance.dataset(str(folder / "frames.lance"), version=version)


def contents(folder, version=None):
    """Episode -> contents of the rows on its frames, in the order of frames."""
    table = frames(folder, version).to_table(columns=["index", "episode_index", "language_persistent"])
    assert table["index"].to_pylist() == list(range(75))
    said = {}
    for episode, rows in zip(table["episode_index"].to_pylist(), table["language_persistent"].to_pylist(), strict=True):
        said.setdefault(episode, set()).add(tuple(row["content"] for row in rows or ()))
    assert all(len(texts) == 1 for texts in said.values())
    return {episode: list(*texts) for episode, texts in said.items()}


def test_each_run_is_one_version_and_the_frames_stay_where_they_were(source):
    frames(source).create_scalar_index("episode_index", "BTREE")
    before = frames(source).to_table()
    versions = [name_in_place(source, motions) for motions in (WAVE, BOW, WAVE, BOW, WAVE)]
    assert versions == [3, 4, 5, 6, 7]
    for version, expected in zip(versions, [NAMED, {0: [], 1: ["bow"], 2: []}] * 3, strict=False):
        assert contents(source, version) == expected
    after = frames(source).to_table()
    assert after.drop_columns(["language_persistent"]).equals(before)
    assert frames(source, 2).to_table().equals(before)
    assert [index.name for index in frames(source).describe_indices()] == ["episode_index_idx"]
    assert frames(source).to_table(filter="episode_index = 2")["index"].to_pylist() == list(range(50, 75))
    # Columns that were replaced are read no more.
    assert {len(fragment.metadata.files) for fragment in frames(source).get_fragments()} == {2}
    assert [motion.symbol for motion in read_motions(source)] == ["wave", "nod"]


def test_the_description_names_the_column_here_and_in_the_table_of_the_meta_folder(source):
    name_in_place(source, WAVE)
    info = json.loads((source / "meta" / "info.json").read_text())
    assert info["features"]["language_persistent"] == {"dtype": "language", "shape": [1], "names": None}
    table = lance.dataset(str(source / "meta.lance")).to_table().to_pydict()
    twins = dict(zip(table["path"], table["data"], strict=True))
    assert len(table["path"]) == 4
    assert json.loads(twins["info.json"]) == info
    assert twins["kineme/motions.parquet"] == (source / DETAILS).read_bytes()
    shutil.rmtree(source / "meta.lance")
    name_in_place(source, BOW)
    assert not (source / "meta.lance").exists()


def test_the_named_set_is_read_as_before(source):
    before = kineme.read_recordings(source)
    name_in_place(source, WAVE)
    after = kineme.read_recordings(source)
    assert (after.demonstrations.positions == before.demonstrations.positions).all()
    assert [episode.task for episode in read_episodes(source)] == [TASKS[0], TASKS[1], TASKS[0]]


def test_rows_of_others_stay(source):
    alien = {"role": "assistant", "content": "to the left", "style": "motion", "timestamp": 0.5}
    alien |= {"camera": None, "tool_calls": None}
    plan = alien | {"content": "first reach", "style": "plan"}
    table = frames(source).to_table()
    rows = [[alien, plan] if k == 0 else None for k in table["episode_index"].to_pylist()]
    shutil.rmtree(source / "frames.lance")
    lance.write_dataset(table.append_column("language_persistent", pa.array(rows)), str(source / "frames.lance"))
    name_in_place(source, {0: [Motion(0, 0.5, 1, "wave")], 1: [Motion(1, 0, 9, "bow")]})
    # Where others name a motion, a second row could not be told from theirs.
    assert contents(source) == {0: ["to the left", "first reach", "rest", "rest"], 1: ["bow"], 2: []}
    name_in_place(source, {})
    assert contents(source) == {0: ["to the left", "first reach"], 1: [], 2: []}


def test_a_copy_leaves_the_source_as_it_was(tmp_path, source):
    before = {path: path.read_bytes() for path in source.rglob("*") if path.is_file()}
    (tmp_path / "named").mkdir()
    copy_in_lance(source, tmp_path / "named", WAVE)
    assert {path: path.read_bytes() for path in source.rglob("*") if path.is_file()} == before
    assert contents(tmp_path / "named") == NAMED
    links = [path for path in (tmp_path / "named").glob("frames.lance/data/*") if path.stat().st_nlink == 2]
    assert len(links) == 2  # bulk is not copied


class Faster:
    """Another program that commits a column of its own just before the frames are committed."""

    def __init__(self, monkeypatch, folder, times):
        self.commit, self.path, self.times = lance.LanceDataset.commit, str(folder / "frames.lance"), times
        monkeypatch.setattr(lance.LanceDataset, "commit", staticmethod(self))

    def __call__(self, path, *arguments, **options):
        if path == self.path and self.times:
            self.times -= 1
            lance.dataset(self.path).add_columns({f"of_others_{self.times}": "index + 1"})
        return self.commit(path, *arguments, **options)


@pytest.mark.parametrize("named_before", [False, True])
def test_another_writer_at_the_same_time_loses_nothing(source, monkeypatch, named_before):
    if named_before:
        name_in_place(source, BOW)
    Faster(monkeypatch, source, 2)
    name_in_place(source, WAVE)
    assert contents(source) == NAMED
    assert {"of_others_0", "of_others_1"} <= {*frames(source).schema.names}
    assert frames(source).to_table()["of_others_0"].to_pylist() == list(range(1, 76))


def test_writers_who_are_always_faster_are_named_and_nothing_is_written(source, monkeypatch):
    name_in_place(source, BOW)
    details = (source / DETAILS).read_bytes()
    Faster(monkeypatch, source, 100)
    with pytest.raises(DataError, match=r"was changed 3 times; nothing was written, run it again"):
        name_in_place(source, WAVE)
    assert contents(source) == {0: [], 1: ["bow"], 2: []}
    assert (source / DETAILS).read_bytes() == details
    assert not (source / PENDING).exists()


@pytest.mark.skipif(os.name != "posix", reason="no locks of files")
def test_two_runs_do_not_name_the_same_set_at_once(source):
    with copy._alone(source), pytest.raises(DataError, match="expected no other program that names motions"):
        name_in_place(source, WAVE)
    assert name_in_place(source, WAVE) == 2


def test_a_run_that_ended_behind_its_version_is_known_to_the_next_one(source, monkeypatch):
    """As if it had been killed there: its rows are replaced, though their details were not yet in place."""

    def killed(at, motions):
        with monkeypatch.context() as patch:
            patch.setattr(copy, at, lambda *arguments: (_ for _ in ()).throw(KeyboardInterrupt))
            with pytest.raises(KeyboardInterrupt):
                name_in_place(source, motions)

    killed("declare", WAVE)
    assert contents(source) == NAMED
    assert read_motions(source) == []
    killed("_commit", {2: [Motion(2, 0, 9, "tap")]})  # and once more, before its version
    name_in_place(source, BOW)
    assert contents(source) == {0: [], 1: ["bow"], 2: []}
    assert [motion.symbol for motion in read_motions(source)] == ["bow"]
    assert not (source / PENDING).exists()


def test_what_cannot_be_named_is_refused(tmp_path, source):
    with pytest.raises(DataError, match="expected an episode of the data set, got 9"):
        name_in_place(source, {9: [Motion(9, 0, 1, "wave")]})
    with pytest.raises(DataError, match="expected a data set in Lance to name motions in place"):
        name_in_place(write_v3(tmp_path / "parquet"), WAVE)
    (source / DETAILS).parent.mkdir(exist_ok=True)
    (source / DETAILS).write_bytes(b"PAR1")
    with pytest.raises(DataError, match=r"expected motions\.parquet as kineme writes it .* remove it"):
        name_in_place(source, WAVE)
    assert frames(source).version == 1


def longer(data):
    """A manifest whose length, which stands before it, is wrong: Lance panics."""
    start = int.from_bytes(data[-16:-8], "little")
    return data[:start] + b"\xff\xff\xff\x7f" + data[start + 4 :]


@pytest.mark.parametrize(
    ("pattern", "damage"),
    [
        ("frames.lance/_versions/*.manifest", lambda data: data[:5]),
        ("frames.lance/data/*", lambda data: data[: len(data) // 2]),
        ("frames.lance/data/*", lambda data: b""),
        ("frames.lance/_versions/*.manifest", longer),
    ],
)
def test_damaged_tables_are_problems_of_their_episodes(source, pattern, damage):
    for path in source.glob(pattern):
        path.write_bytes(damage(path.read_bytes()))
    read = list(read_episodes(source))
    assert [episode.number for episode in read] == [0, 1, 2]
    assert all("frames.lance" in episode.problems[0] for episode in read if not len(episode))
    with pytest.raises(kineme.errors.KinemeError):
        kineme.read_recordings(source)


def test_an_unknown_storage_is_refused(source):
    path = source / "meta" / "info.json"
    info = json.loads(path.read_text())
    path.write_text(json.dumps(info | {"storage_format": "vortex"}))
    with pytest.raises(DataError, match=r"in Parquet, or of version 3 in Lance, got v3.0 in 'vortex'"):
        kineme.read_recordings(source)


def test_without_lance_the_extra_is_named(source, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "lance", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[lance\]'"):
        kineme.read_recordings(source)
    with pytest.raises(DataError, match=r"pip install 'kineme\[lance\]'"):
        next(read_episodes(source))

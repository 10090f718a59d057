"""A copy of a data set of LeRobot whose frames name motions: pandas and pyarrow read it, all else is as it was."""

import hashlib
import json

import numpy as np
import pytest

import kineme
from kineme.io.lerobot.copy import copy_with_motions
from kineme.io.lerobot.motions import DETAILS, LANGUAGE, MOTION_TEXTS, OWN, Motion, read_motions
from lerobot_sets import write_v2, write_v3

pa = pytest.importorskip("pyarrow")
pd = pytest.importorskip("pandas")
parquet = pytest.importorskip("pyarrow.parquet")

FPS = 10
MOTIONS = {
    0: [Motion(0, 1.01, 1.5, "later", 0.25, 0.75), Motion(0, 0.0, 0.6, 'né "x"')],
    2: [Motion(2, 0.31, 2.4, None, uncertainty=0.1)],
}
CONTENTS = ['né "x"', "rest", "later", "rest"]
SHARDS = ("data/chunk-000/file-000.parquet", "data/chunk-000/file-001.parquet")


def row(timestamp, content):
    """As LeRobot's own source builds one."""
    plain = {"role": "assistant", "content": content, "style": "motion", "timestamp": float(np.float32(timestamp))}
    return {**plain, "camera": None, "tool_calls": None}


EXPECTED = {
    0: [row(0.0, 'né "x"'), row(0.7, "rest"), row(1.0, "later"), row(1.6, "rest")],
    1: [],
    2: [row(0.0, "rest"), row(0.3, "unknown")],
}


def copied(source, target, motions=MOTIONS):
    target.mkdir()
    copy_with_motions(source, target, motions)
    return target


def lists(folder):
    """(episode, rows) of every frame, by pandas."""
    frames = pd.concat([pd.read_parquet(folder / shard) for shard in SHARDS if (folder / shard).exists()])
    return [
        (k, [*rows] if rows is not None else None)
        for k, rows in zip(frames.episode_index, frames[LANGUAGE], strict=True)
    ]


def digests(folder):
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture
def source(tmp_path):
    folder = write_v3(tmp_path / "set", fps=FPS)
    video = folder / "videos" / "observation.images.top" / "chunk-000" / "file-000.mp4"
    video.parent.mkdir(parents=True)
    video.write_bytes(b"film")
    (folder / "meta" / "stats.json").write_text("{}")
    (folder / "README.md").write_text("# set")
    return folder


def test_every_frame_carries_the_texts_of_its_episode(tmp_path, source):
    named = lists(copied(source, tmp_path / "named"))
    assert len(named) == 75
    assert all(rows == EXPECTED[k] for k, rows in named)


def test_stamps_are_those_of_frames(tmp_path, source):
    target = copied(source, tmp_path / "named")
    frames = pd.read_parquet(target / SHARDS[0])
    stored = set(frames.timestamp[frames.episode_index == 0].tolist())
    assert {row["timestamp"] for rows in frames[LANGUAGE] for row in rows} <= stored


def test_the_type_is_that_of_lerobot(tmp_path, source):
    kind = parquet.read_schema(copied(source, tmp_path / "named") / SHARDS[0]).field(LANGUAGE).type
    fields = {field.name: (field.type, field.nullable) for field in kind.value_type}
    assert list(fields) == ["role", "content", "style", "timestamp", "camera", "tool_calls"]
    assert fields["role"] == (pa.string(), False)
    assert fields["timestamp"] == (pa.float32(), False)
    assert fields["content"] == fields["camera"] == fields["style"] == (pa.string(), True)
    info = json.loads((tmp_path / "named" / "meta" / "info.json").read_text())
    assert info["features"][LANGUAGE] == {"dtype": "language", "shape": [1], "names": None}


def test_all_other_columns_and_files_are_as_they_were(tmp_path, source):
    before = digests(source)
    target = copied(source, tmp_path / "named")
    after = digests(target)
    assert digests(source) == before
    changed = {name for name in before if after[name] != before[name]}
    assert set(after) == {*before, DETAILS}
    assert changed == {*SHARDS, "meta/info.json"}
    for shard in SHARDS:
        old, new = (parquet.ParquetFile(folder / shard) for folder in (source, target))
        assert new.read().drop_columns([LANGUAGE]).equals(old.read(), check_metadata=True)
        assert new.schema_arrow.metadata == old.schema_arrow.metadata
        assert new.metadata.num_row_groups == old.metadata.num_row_groups
        compressions = [
            {group.column(k).path_in_schema: group.column(k).compression for k in range(group.num_columns)}
            for group in (old.metadata.row_group(0), new.metadata.row_group(0))
        ]
        assert compressions[0].items() <= compressions[1].items()
    old, new = (json.loads((folder / "meta" / "info.json").read_text()) for folder in (source, target))
    del new["features"][LANGUAGE]
    assert new == old


def test_groups_of_rows_and_compression_stay(tmp_path, source):
    path = source / SHARDS[0]
    table = parquet.read_table(path).replace_schema_metadata({"huggingface": '{"info": {}}', "mine": "1"})
    parquet.write_table(table, path, row_group_size=7, compression="zstd")
    target = copied(source, tmp_path / "named")
    new = parquet.ParquetFile(target / SHARDS[0])
    assert [new.metadata.row_group(k).num_rows for k in range(new.metadata.num_row_groups)] == [7] * 7 + [1]
    group = new.metadata.row_group(0)
    assert {group.column(k).compression for k in range(group.num_columns)} == {"ZSTD"}
    assert new.read().drop_columns([LANGUAGE]).equals(table, check_metadata=True)
    assert all(rows == EXPECTED[k] for k, rows in lists(target))


def with_rows(source, rows_of, kind=None):
    """Write a column of LeRobot's into the first shard: of a frame's number, its rows."""
    table = parquet.read_table(source / SHARDS[0])
    column = pa.array([rows_of(k) for k in range(len(table))], type=kind)
    parquet.write_table(table.append_column(LANGUAGE, column), source / SHARDS[0])
    info = json.loads((source / "meta" / "info.json").read_text())
    info["features"][LANGUAGE] = {"dtype": "language", "shape": [1], "names": None}
    (source / "meta" / "info.json").write_text(json.dumps(info))


SUBTASK = {"role": "assistant", "content": "reach", "style": "subtask", "timestamp": 0.0, "camera": None}


def test_texts_that_are_there_stay(tmp_path, source):
    said = {**SUBTASK, "tool_calls": ["{}"]}
    with_rows(
        source, lambda k: None if k == 49 else [said, {**SUBTASK, "content": str(k), "tool_calls": None}][: k % 3]
    )
    info = (source / "meta" / "info.json").read_bytes()
    after = copied(source, tmp_path / "named")
    new = parquet.read_table(after / SHARDS[0]).column(LANGUAGE).to_pylist()
    old = parquet.read_table(source / SHARDS[0]).column(LANGUAGE).to_pylist()
    assert new == [[*was, *EXPECTED[0]] if k < 20 else was for k, was in enumerate(old)]
    assert new[49] is None
    assert (after / "meta" / "info.json").read_bytes() == info


def test_a_column_as_another_program_infers_it(tmp_path, source):
    """Without texts in JSON, stamps of 64 bits, as of lists of Python."""
    with_rows(source, lambda k: [{**SUBTASK, "tool_calls": None}])
    new = parquet.read_table(copied(source, tmp_path / "named") / SHARDS[0]).column(LANGUAGE)
    assert new.type == parquet.read_schema(source / SHARDS[0]).field(LANGUAGE).type
    assert [row["content"] for row in new[0].as_py()] == ["reach", *CONTENTS]


@pytest.mark.skipif(not hasattr(pa, "json_"), reason="pyarrow before 19 has no type for JSON")
def test_a_column_of_json(tmp_path, source):
    """As LeRobot declares calls of tools."""
    calls = pa.field("tool_calls", pa.list_(pa.json_(pa.string())))
    plain = [pa.field(name, pa.string()) for name in ("role", "content", "style")]
    fields = [*plain, pa.field("timestamp", pa.float32(), nullable=False), pa.field("camera", pa.string()), calls]
    kind = pa.list_(pa.struct(fields))
    table = parquet.read_table(source / SHARDS[0])
    row_ = pa.StructArray.from_arrays(
        [
            pa.array([SUBTASK[field.name]], type=field.type) if field.name in SUBTASK else pa.nulls(1, field.type)
            for field in fields
        ],
        fields=fields,
    )
    column = pa.ListArray.from_arrays(pa.array([0, 1] + [1] * (len(table) - 1), pa.int32()), row_, type=kind)
    parquet.write_table(table.append_column(LANGUAGE, column), source / SHARDS[0])
    new = parquet.read_table(copied(source, tmp_path / "named") / SHARDS[0]).column(LANGUAGE)
    assert [row["content"] for row in new[0].as_py()] == ["reach", *CONTENTS]
    assert [row["content"] for row in new[1].as_py()] == CONTENTS


def test_another_column_of_that_name_is_refused(tmp_path, source):
    with_rows(source, lambda k: ["a"])
    with pytest.raises(
        kineme.errors.DataError, match=r"file-000\.parquet: expected rows with role, content.*got list<"
    ):
        copied(source, tmp_path / "named")


def test_videos_are_links_and_what_programs_write_over_is_not(tmp_path, source):
    target = copied(source, tmp_path / "named")
    video = "videos/observation.images.top/chunk-000/file-000.mp4"
    assert (target / video).samefile(source / video)
    assert not (target / "meta" / "stats.json").samefile(source / "meta" / "stats.json")


def test_a_folder_of_links_as_a_cache_has_them(tmp_path, source):
    """The Hugging Face hub keeps files elsewhere and links to them."""
    snapshot = tmp_path / "snapshot"
    for path in source.rglob("*"):
        if path.is_file():
            link = snapshot / path.relative_to(source)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(path)
    target = copied(snapshot, tmp_path / "named")
    assert not [path for path in target.rglob("*") if path.is_symlink()]
    assert all(rows == EXPECTED[k] for k, rows in lists(target))


def test_a_second_copy_replaces_the_rows_of_the_first_and_keeps_those_of_others(tmp_path, source):
    alien = {
        **SUBTASK,
        "style": "motion",
        "content": "to the left",
        "timestamp": float(np.float32(0.4)),
        "tool_calls": None,
    }
    old = {**alien, "content": f'{OWN}, "symbol": "wave"}}'}  # as a version of kineme before the table of details
    empty = {**SUBTASK, "content": None, "tool_calls": None}
    with_rows(source, lambda k: [alien, empty, old] if k % 2 else None)
    first = copied(source, tmp_path / "first", {0: [Motion(0, 0, 9, "wave")], 1: [Motion(1, 0, 1, "nod")]})
    second = {0: [Motion(0, 0.6, 9, "bow")], 2: [Motion(2, 0, 9, "nod")]}
    both = copied(first, tmp_path / "second", second)
    assert [len(rows) for _, rows in lists(first)] == [1, 3] * 10 + [2, 4] * 15 + [0] * 25
    for k, (episode, rows) in enumerate(lists(both)):
        said = {0: [row(0, "rest"), row(0.6, "bow")], 1: [], 2: [row(0, "nod")]}[episode]
        assert rows == ([alien, empty] if k % 2 and episode < 2 else []) + said
    assert lists(copied(both, tmp_path / "third", second)) == lists(both)
    assert [(motion.episode, motion.symbol) for motion in read_motions(both)] == [(0, "bow"), (2, "nod")]


def test_where_others_name_a_motion_no_second_row_stands(tmp_path, source):
    """Of two rows of one stamp, style and role LeRobot cannot choose."""
    alien = {**SUBTASK, "style": "motion", "content": 'né "x"', "timestamp": float(np.float32(0.0)), "tool_calls": None}
    with_rows(source, lambda k: [alien])
    first = copied(source, tmp_path / "first")
    assert {tuple(each["content"] for each in rows) for k, rows in lists(first) if k == 0} == {tuple(CONTENTS)}
    # Nor is the row of others taken for one of ours later.
    second = copied(first, tmp_path / "second", {})
    assert [rows for _, rows in lists(second)] == [[alien]] * 50 + [[]] * 25


def test_the_details_are_read_back(tmp_path, source):
    target = copied(source, tmp_path / "named")
    motions = read_motions(target)
    assert str(motions) == str([MOTIONS[0][1], MOTIONS[0][0], MOTIONS[2][0]])
    assert read_motions(source) == []
    (target / DETAILS).write_bytes(b"PAR1")
    with pytest.raises(kineme.errors.DataError, match=r"expected motions\.parquet as kineme writes it"):
        read_motions(target)


def texts_of(folder, k):
    return pd.read_parquet(folder / f"data/chunk-000/episode_{k:06d}.parquet")[MOTION_TEXTS].tolist()


def test_version_2_takes_texts_in_json(tmp_path):
    """Its programs fail on lists of rows: a frame with them could not be loaded."""
    source = write_v2(tmp_path / "set", fps=FPS)
    before = digests(source)
    target = copied(source, tmp_path / "named")
    for k, expected in EXPECTED.items():
        (text,) = set(texts_of(target, k))
        assert json.loads(text) == expected
    after = digests(target)
    same = {name for name in before if after[name] == before[name]}
    assert digests(source) == before
    assert set(after) == {*before, DETAILS}
    assert {"meta/episodes.jsonl", "meta/tasks.jsonl"} == same
    old, new = (parquet.read_table(folder / "data/chunk-000/episode_000001.parquet") for folder in (source, target))
    assert new.drop_columns([MOTION_TEXTS]).equals(old, check_metadata=True)
    old, new = (json.loads((folder / "meta" / "info.json").read_text()) for folder in (source, target))
    assert new["features"].pop(MOTION_TEXTS) == {"dtype": "string", "shape": [1], "names": None}
    assert new == old
    assert kineme.read_recordings(target).labels.tolist() == kineme.read_recordings(source).labels.tolist()


def test_a_second_copy_of_version_2_replaces_the_texts_of_the_first(tmp_path):
    source = write_v2(tmp_path / "set", fps=FPS)
    alien = row(0.5, "of another")
    path = source / "data/chunk-000/episode_000001.parquet"
    table = parquet.read_table(path)
    texts = pa.array([json.dumps([alien, "a text", row(0.0, OWN)])] * len(table))
    parquet.write_table(table.append_column(MOTION_TEXTS, texts), path)
    target = copied(source, tmp_path / "one", {0: [Motion(0, 0, 9, "wave")], 1: [Motion(1, 0, 0.4, "nod")]})
    assert json.loads(texts_of(target, 1)[0]) == [alien, "a text", row(0, "nod")]  # the rest is said by another
    target = copied(target, tmp_path / "two", {0: [Motion(0, 0.5, 9, "bow")], 1: [Motion(1, 0, 9, "nod")]})
    assert [json.loads(text) for text in set(texts_of(target, 0))] == [[row(0, "rest"), row(0.5, "bow")]]
    assert json.loads(texts_of(target, 1)[0]) == [alien, "a text", row(0, "nod")]
    assert set(texts_of(target, 2)) == {"[]"}


@pytest.mark.parametrize(
    ("values", "words"), [(["["], "lists in JSON"), (['{"a": 1}'], "lists in JSON"), ([1], "texts in")]
)
def test_another_column_of_that_name_in_version_2_is_refused(tmp_path, values, words):
    source = write_v2(tmp_path / "set", fps=FPS)
    path = source / "data/chunk-000/episode_000001.parquet"
    table = parquet.read_table(path)
    parquet.write_table(table.append_column(MOTION_TEXTS, pa.array(values * len(table))), path)
    with pytest.raises(kineme.errors.DataError, match=rf"episode_000001\.parquet: expected {words}"):
        copied(source, tmp_path / "named")


def test_an_episode_that_is_not_there(tmp_path, source):
    with pytest.raises(kineme.errors.DataError, match="expected an episode of the data set, got 7"):
        copied(source, tmp_path / "named", {7: [Motion(7, 0, 1, "a")]})


def test_a_damaged_description_is_not_copied(tmp_path, source):
    (source / "meta" / "episodes" / "chunk-000" / "file-001.parquet").write_bytes(b"cut")
    with pytest.raises(
        kineme.errors.DataError, match=r"expected a whole data set to name motions in: expected file-001\.parquet"
    ):
        copied(source, tmp_path / "named")


def test_a_damaged_shard_is_named(tmp_path, source):
    (source / SHARDS[1]).write_bytes((source / SHARDS[1]).read_bytes()[:-200])
    with pytest.raises(kineme.errors.DataError, match=r"file-001\.parquet"):
        copied(source, tmp_path / "named")

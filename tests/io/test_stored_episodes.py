"""Episodes as they are stored: raw stamps, all signals, and what is wrong with each instead of a refusal."""

import json
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.errors import DataError
from kineme.io.lerobot.episodes import Frames, episodes, runs, shard_frames
from kineme.io.lerobot.info import read_info, read_videos
from kineme.io.reading.episodes import read_episodes
from lerobot_sets import (
    CAMERA,
    FILM,
    NAMES,
    TASKS,
    add_videos,
    change,
    episode_rows,
    shard_of,
    write_lance,
    write_v2,
    write_v3,
)

WRITERS = {
    "v2": write_v2, "v3": write_v3, "v3 lists": lambda folder: write_v3(folder, fixed=False), "lance": write_lance,
}  # fmt: skip
LENGTHS = (20, 30, 25)


@pytest.fixture(params=WRITERS)
def folder(request, tmp_path):
    if request.param == "lance":
        pytest.importorskip("lance")
    return WRITERS[request.param](tmp_path / "set")


def test_all_that_is_stored_of_numbers_comes_as_it_is(folder):
    read = list(read_episodes(folder))
    assert [episode.number for episode in read] == [0, 1, 2]
    for episode, length in zip(read, LENGTHS, strict=True):
        stored = episode_rows(episode.number, length)
        np.testing.assert_array_equal(episode.times, stored["timestamp"])  # rounded to 32 bits, not the even ones
        assert list(episode.signals) == ["observation.state", "action", "next.done"]
        for name in ("observation.state", "action"):
            np.testing.assert_array_equal(episode.signals[name], np.vstack(stored[name]))
            assert episode.names[name] == tuple(NAMES)
        np.testing.assert_array_equal(episode.signals["next.done"], stored["next.done"][:, None])
        assert (episode.task, episode.fps, episode.problems) == (TASKS[episode.number % 2], 50, ())
        assert (episode.place, dict(episode.videos)) == (f"episode {episode.number}", {})


def test_batches_may_end_anywhere(folder, monkeypatch):
    expected = list(episodes(folder))
    for rows in (1, 7, 20):
        monkeypatch.setattr("kineme.io.lerobot.episodes._ROWS", rows)
        for got, episode in zip(episodes(folder), expected, strict=True):
            assert (got.number, got.task, got.problems) == (episode.number, episode.task, ())
            np.testing.assert_array_equal(got.times, episode.times)
            np.testing.assert_array_equal(got.signals["action"], episode.signals["action"])


@given(st.lists(st.integers(0, 2), max_size=30), st.lists(st.integers(1, 9), min_size=1, max_size=30))
def test_runs_hold_all_rows_in_order_and_neighbors_differ(numbers, sizes):
    n = len(numbers)
    column = np.array(numbers, dtype=np.int64)
    cuts = [cut for cut in np.cumsum(sizes).tolist() if cut < n]
    rows = np.split(np.arange(n), cuts)
    parts = (
        Frames(part[:, None] * 1.0, column[part], part, part, part * 1.0, {0: str(part[0])})
        for part in rows
        if len(part)
    )
    problems = []
    read = list(runs(parts, problems))
    assert problems == []
    assert [k for run in read for k in run.frames.tolist()] == list(range(n))
    assert all(len(set(run.episodes.tolist())) == 1 for run in read)
    assert all(a.episodes[0] != b.episodes[0] for a, b in pairwise(read))
    assert all(run.frames[row] == int(text) for run in read for row, text in run.faults.items())


def test_features_and_episodes_are_chosen(folder):
    (last,) = episodes(folder, ["action"], numbers={2})
    assert (last.number, len(last), list(last.signals), list(last.names)) == (2, 25, ["action"], ["action"])
    assert [episode.number for episode in episodes(folder, numbers=[2, 0])] == [0, 2]
    with pytest.raises(DataError, match=r"features of numbers \(observation.state, action, next.done\), got 'images'"):
        next(episodes(folder, ["images"]))
    with pytest.raises(DataError, match=r"features of numbers \(.*\), got none"):
        next(episodes(folder, []))
    with pytest.raises(DataError, match="expected numbers of episodes of the data set, got 7"):
        next(episodes(folder, numbers=[0, 7]))


def test_only_shards_of_chosen_episodes_are_read(tmp_path, monkeypatch):
    folder = write_v3(tmp_path / "set")
    shard_of(folder, 0).unlink()
    shards = []
    monkeypatch.setattr(
        "kineme.io.lerobot.episodes.shard_frames",
        lambda folder, info, shard, *given: shards.append(shard) or shard_frames(folder, info, shard, *given),
    )
    assert [(episode.number, episode.problems) for episode in episodes(folder, numbers=[2])] == [(2, ())]
    assert shards == ["data/chunk-000/file-001.parquet"]


def swapped(frames):
    order = np.arange(len(frames))
    order[[3, 4]] = [4, 3]
    return frames.iloc[order]


@pytest.mark.parametrize(
    ("frames", "n_frames", "words"),
    [
        (lambda frames: frames.drop(index=[5, 6]), 18, ("20 frames as declared, got 18", "frame 5 next, got frame 7")),
        (swapped, 20, ("expected frame 3 next, got frame 4",)),
        (lambda frames: frames.iloc[[*range(20), *range(18, len(frames))]], 22, ("got 22", "20 next, got frame 18")),
        (lambda frames: frames.assign(frame_index=frames.frame_index + 1), 20, ("frame 0 next, got frame 1",)),
        (lambda frames: frames[frames.episode_index != 0], 0, ("expected frames in data/chunk-000/file-000.parquet",)),
        (lambda frames: frames.assign(episode_index=frames.episode_index.where(frames.episode_index > 0, 9)), 0,
         ("expected frames in data/chunk-000/file-000.parquet",)),
    ],
)  # fmt: skip
def test_an_episode_that_is_not_whole_comes_with_what_is_wrong(tmp_path, frames, n_frames, words):
    folder = write_v3(tmp_path / "set")
    change(folder, frames)
    read = {episode.number: episode for episode in episodes(folder)}
    assert {*read} >= {0, 1, 2}
    assert len(read[0]) == n_frames
    said = " ".join(read[0].problems)
    assert not [word for word in words if word not in said]
    assert read[2].problems == ()
    if 9 in read:
        assert read[9].problems == ("expected an episode that the meta folder declares",)
        assert len(read[9]) == 20


def test_frames_that_stand_apart_come_as_they_stand(tmp_path):
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: pd.concat([frames[10:], frames[:10]]))
    read = list(episodes(folder))
    assert [(episode.number, len(episode)) for episode in read] == [(0, 10), (1, 30), (0, 10), (2, 25)]
    assert "expected its frames in one place" in " ".join(read[2].problems)
    assert "expected 20 frames as declared, got 10" in read[0].problems


def test_numbers_that_are_not_there(tmp_path):
    folder = write_v3(tmp_path / "set")
    states = {3: None, 5: np.zeros(2, dtype=np.float32)}

    def spoiled(frames):
        frames["observation.state"] = [
            states.get(k, state) for k, state in enumerate(frames["observation.state"].tolist())
        ]
        frames["next.done"] = frames["next.done"].astype(object).where(frames.index != 4, None)
        frames["episode_index"] = frames["episode_index"].astype("Int64").where(frames.index != 49)
        return frames

    change(folder, spoiled)
    first, _, nobody, _ = episodes(folder)
    assert np.flatnonzero(np.isnan(first.signals["observation.state"]).all(axis=1)).tolist() == [3, 5]
    assert np.flatnonzero(np.isnan(first.signals["next.done"])).tolist() == [4]
    assert first.problems[0].startswith("frame 3: expected 3 numbers in 'observation.state', got nothing")
    assert (nobody.number, len(nobody), nobody.place) == (-1, 1, "frames without an episode")


def test_a_missing_and_a_damaged_shard(tmp_path):
    folder = write_v3(tmp_path / "set", lengths=(20, 30, 25, 9), per_shard=2)
    shard_of(folder, 0).unlink()
    path = shard_of(folder, 0)
    data = path.read_bytes()
    path.write_bytes(data[:-40])
    read = list(episodes(folder))
    assert [(episode.number, len(episode), len(episode.problems)) for episode in read] == [(k, 0, 1) for k in range(4)]
    assert all(values.shape[1] == len(read[0].names[name]) for name, values in read[0].signals.items())
    assert read[0].problems == ("expected the shard data/chunk-000/file-000.parquet, found none",)
    assert "file-001.parquet to be a Parquet file, got a damaged one" in read[3].problems[0]


@pytest.mark.parametrize("size", [20, 25])
def test_a_shard_that_breaks_off_gives_the_episodes_before(tmp_path, size):
    """Groups of rows are read one after the other: what is before the damage is read, also up to an episode's end."""
    from pyarrow import parquet

    folder = write_v3(tmp_path / "set", per_shard=3)
    path = shard_of(folder)
    parquet.write_table(parquet.read_table(path), path, row_group_size=size, compression="none")
    start = parquet.ParquetFile(path).metadata.row_group(1).column(0).data_page_offset
    data = bytearray(path.read_bytes())
    data[start : start + 40] = b"\xff" * 40
    path.write_bytes(data)
    read = list(episodes(folder))
    assert [episode.number for episode in read] == [0, 1, 2]
    assert read[0].problems == ()
    assert len(read[1]) == size - 20
    assert "got a damaged one" in " ".join(read[1].problems)
    assert "got a damaged one" in " ".join(read[2].problems)


def test_damaged_descriptions_come_first(tmp_path):
    folder = write_v3(tmp_path / "set")
    (folder / "meta/tasks.parquet").write_bytes(b"PAR1")
    (folder / "meta/episodes/chunk-000/file-001.parquet").write_bytes(b"PAR1")
    about, *read = episodes(folder)
    assert (about.number, len(about), about.place) == (-1, 0, "meta")
    assert "file-001.parquet" in about.problems[0]
    assert "tasks.parquet" in about.problems[1]
    assert [(episode.number, episode.task, episode.problems) for episode in read] == [(k, None, ()) for k in range(3)]
    (folder / "meta/episodes/chunk-000/file-000.parquet").write_bytes(b"PAR1")
    with pytest.raises(DataError, match="expected episodes in a LeRobot data set, got none"):
        next(episodes(folder))


@pytest.mark.parametrize(
    ("file", "name", "numbers"),
    [("meta/tasks.parquet", b"task_index", [-1, 0, 1, 2]), ("data/chunk-000/file-000.parquet", b"action", [0, 1, 2])],
)
def test_names_that_are_no_text_are_damage(tmp_path, file, name, numbers):
    """Not an error of Python: pyarrow decodes the names of columns when it opens a file."""
    folder = write_v3(tmp_path / "set")
    data = (folder / file).read_bytes()
    (folder / file).write_bytes(data.replace(name, b"\xff" + name[1:]))
    assert [episode.number for episode in episodes(folder)] == numbers
    episodes_file = folder / "meta/episodes/chunk-000/file-000.parquet"
    episodes_file.write_bytes(episodes_file.read_bytes().replace(b"length", b"\xffength"))
    with pytest.raises(DataError, match="expected episodes in a LeRobot data set, got none"):
        next(episodes(folder))


def test_damaged_numbers_are_handed_on_without_a_warning(tmp_path):
    """NaN whose bits signal, in a vector and in the stamps."""
    import pyarrow as pa
    from pyarrow import parquet

    folder = write_v3(tmp_path / "set")
    path = shard_of(folder)
    table = parquet.read_table(path)
    bad = np.full(3 * len(table), 0x7FA00000, dtype=np.uint32).view(np.float32)
    action = pa.FixedSizeListArray.from_arrays(pa.array(bad, from_pandas=False), 3)
    for name, column in (("action", action), ("timestamp", pa.array(bad[: len(table)], from_pandas=False))):
        table = table.set_column(table.schema.get_field_index(name), name, column)
    parquet.write_table(table, path)
    first = next(episodes(folder))
    assert np.isnan(first.signals["action"]).all()
    assert np.isnan(first.times).all()


V2_VIDEOS = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
V3_VIDEOS = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"


@pytest.mark.parametrize(
    ("write", "path", "starts"), [(write_v2, V2_VIDEOS, [0, 0, 0]), (write_v3, V3_VIDEOS, [0, 0.4, 1])]
)
def test_videos_are_named(tmp_path, write, path, starts):
    folder = add_videos(write(tmp_path / "set"), path)
    for episode in read_episodes(folder):
        assert (folder / episode.videos[CAMERA]).read_bytes() == FILM
    videos = read_videos(folder, read_info(folder))
    assert [videos[k][CAMERA].start for k in range(3)] == starts


@pytest.mark.parametrize("path", ["../{video_key}/x.mp4", "/videos/x.mp4", "v{chunk_index:300}.mp4", 3])
def test_videos_stay_within_the_data_set(tmp_path, path):
    folder = add_videos(write_v3(tmp_path / "set"), V3_VIDEOS)
    info = json.loads((folder / "meta" / "info.json").read_text())
    (folder / "meta" / "info.json").write_text(json.dumps(info | {"video_path": path}))
    with pytest.raises(DataError, match="expected a video_path"):
        next(episodes(folder))
    # Nor does the name of a camera lead out.
    info["features"]["../../etc"] = info["features"][CAMERA]
    (folder / "meta" / "info.json").write_text(json.dumps(info | {"video_path": "{video_key}/x.mp4"}))
    table = pd.read_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    for name in ("chunk_index", "file_index", "from_timestamp"):
        table[f"videos/../../etc/{name}"] = table[f"videos/{CAMERA}/{name}"]
    table.to_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    assert {*next(episodes(folder)).videos} == {CAMERA}


def test_other_layouts_are_named(tmp_path):
    with pytest.raises(DataError, match=r"expected a data set of episodes \(LeRobot.*\), got nothing there"):
        read_episodes(tmp_path / "none")
    (tmp_path / "a.csv").write_text("t,x\n")
    with pytest.raises(DataError, match=r"expected a data set of episodes \(LeRobot.*\), got another"):
        read_episodes(str(tmp_path / "a.csv"))
    write_v3(tmp_path / "cups", (20,))
    for place in (tmp_path, tmp_path / "cups" / "meta", tmp_path / "cups" / "data" / "chunk-000"):
        with pytest.raises(DataError, match=r"say the folder of one: .*cups$"):
            read_episodes(place)


def many(folder, n, length=10, per_shard=1000):
    """A set of many episodes, written by plain columns."""
    import pyarrow as pa
    from pyarrow import parquet

    write_v3(folder, (1,))
    frame = np.tile(np.arange(length), per_shard)
    state = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(3 * len(frame), np.float32)), 3)
    for shard in range(n // per_shard):
        episode = np.repeat(np.arange(per_shard), length) + shard * per_shard
        columns = {"observation.state": state, "action": state, "next.done": frame == length - 1}
        columns |= {"timestamp": (frame / 50).astype(np.float32), "frame_index": frame, "episode_index": episode}
        columns |= {"index": shard * len(frame) + np.arange(len(frame)), "task_index": 0 * frame}
        parquet.write_table(pa.table(columns), folder / f"data/chunk-000/file-{shard:03d}.parquet")
    numbers = np.arange(n)
    table = {"episode_index": numbers, "length": 0 * numbers + length, "data/chunk_index": 0 * numbers}
    table["data/file_index"] = numbers // per_shard
    parquet.write_table(pa.table(table), folder / "meta/episodes/chunk-000/file-000.parquet")
    return folder


@pytest.mark.parametrize("n", [2000, pytest.param(100_000, marks=pytest.mark.soak)])
def test_many_episodes_take_little_memory(tmp_path, n):
    """Not one of them is held when the next one comes."""
    import tracemalloc

    folder = many(tmp_path / "set", n)
    tracemalloc.start()
    numbers = [episode.number for episode in episodes(folder) if not episode.problems]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert numbers == list(range(n))
    assert peak < 10e6 + 500 * n  # bytes: a batch of rows, and what the meta folder declares

"""Data sets of LeRobot: episodes are movements, tasks are labels; what is wrong is said episode by episode."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import kineme
from kineme.errors import DataError
from kineme.io.inspection.inspect import inspect
from kineme.io.lerobot.info import read_tasks
from kineme.io.limits import VARIABLE
from lerobot_sets import NAMES, TASKS, change, shard_of, write_v2, write_v3
from limited_child import MIB, LimitedChild


@pytest.fixture(params=["v2", "v3", "v3 lists"])
def folder(request, tmp_path):
    where = tmp_path / "set"
    return write_v2(where) if request.param == "v2" else write_v3(where, fixed="lists" not in request.param)


def test_episodes_are_movements_and_tasks_are_labels(folder):
    recordings = kineme.read_recordings(folder)
    demos, how = recordings.demonstrations, recordings.detected[0][0]
    assert demos.dimensions == tuple(NAMES)
    assert demos.lengths.tolist() == [20, 30, 25]
    assert [source.place for source in recordings.sources] == ["episode 0", "episode 1", "episode 2"]
    assert recordings.labels.tolist() == [TASKS[0], TASKS[1], TASKS[0]]
    assert (recordings.problems, how.time, how.units) == ((), "timestamp [s]", "s")
    assert how.format.startswith("LeRobot v")
    assert how.ignored == ("action", "next.done", "observation.images.top")
    assert (
        "LeRobot does not declare the units of joints: they are taken as they are stored" in inspect(recordings).notes
    )
    assert {source.path for source in recordings.sources} == {"set"}
    np.testing.assert_array_equal(demos[1].times, np.arange(30) / 50)  # exactly, though they are stored as float32
    stored = np.vstack(pd.read_parquet(shard_of(folder))["observation.state"])[:20]
    np.testing.assert_array_equal(demos[0].positions, stored.astype(np.float64))


def test_features_are_chosen_whole_or_by_their_entries(folder):
    both = kineme.read_recordings(folder, columns=["observation.state", "action"]).demonstrations
    assert both.dimensions == tuple(f"{name}.{entry}" for name in ("observation.state", "action") for entry in NAMES)
    demos = kineme.read_recordings(folder, columns="action.elbow_flex.pos").demonstrations
    assert demos.dimensions == ("elbow_flex.pos",)
    np.testing.assert_array_equal(demos.positions[:, 0], both.positions[:, 4])
    mixed = kineme.read_recordings(folder, columns=["action.gripper.pos", "observation.state.shoulder_pan.pos"])
    np.testing.assert_array_equal(mixed.demonstrations.positions, both.positions[:, [5, 0]])
    with pytest.raises(DataError, match=r"expected a column 'velocity', got the columns \['observation.state.shoulder"):
        kineme.read_recordings(folder, columns="velocity")


def test_entries_are_chosen_as_inspect_prints_them(folder):
    assert kineme.read_recordings(folder).demonstrations.dimensions == tuple(NAMES)
    movement = kineme.read_recordings(folder, columns=[NAMES[2], "action.elbow_flex.pos"]).demonstrations[0]
    both = kineme.read_recordings(folder, columns=["observation.state", "action"]).demonstrations[0]
    np.testing.assert_array_equal(movement.positions, both.positions[:, [2, 4]])
    with pytest.raises(
        DataError, match=r"expected a column 'wrist', got the columns \['observation\.state\.shoulder_pan"
    ):
        kineme.read_recordings(folder, columns="wrist")


def test_units_that_the_description_says_are_those_of_the_columns(folder):
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    info["features"]["observation.state"]["units"] = ["deg", None, "%"]
    path.write_text(json.dumps(info))
    movement = kineme.read_recordings(folder).demonstrations[0]
    assert [(channel.name, channel.unit) for channel in movement.channels] == [
        ("shoulder_pan.pos [deg]", "deg"), ("elbow_flex.pos", None), ("gripper.pos [%]", "%"),
    ]  # fmt: skip
    assert kineme.read_recordings(folder, columns="shoulder_pan.pos").demonstrations.dimensions[0].endswith("[deg]")


def test_without_a_state_the_vector_features_are_listed(folder):
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    features = {
        f"arm.{name}" if name == "observation.state" else name: feature for name, feature in info["features"].items()
    }
    path.write_text(json.dumps(info | {"features": features}))
    words = r"expected the feature 'observation.state', got \['arm.observation.state \(3\)', 'action \(3\)'\]"
    with pytest.raises(DataError, match=words):
        kineme.read_recordings(folder)


def test_a_data_set_in_a_folder_is_one_source_and_goes_into_a_library(folder, tmp_path):
    recordings = kineme.read_recordings(folder.parent)
    assert {source.path for source in recordings.sources} == {"set"}
    with kineme.ActionLibrary(tmp_path / "library", create=True) as library:
        report = library.learn(recordings)
    assert (report.added, sorted(report.symbols)) == (3, sorted(TASKS))


def test_a_missing_or_damaged_shard_names_its_episodes(folder):
    shard_of(folder).unlink()
    recordings = kineme.read_recordings(folder)
    lost = ["episode 0"] if (folder / "meta" / "tasks.jsonl").exists() else ["episode 0", "episode 1"]
    assert len(recordings) == 3 - len(lost)
    assert f"set: expected the shard {'data/chunk-000'}" in str(recordings.problems[0])
    assert f"found none; left out {'episode 0' if len(lost) == 1 else 'episodes 0, 1'}" in recordings.problems[0].reason


def test_a_damaged_shard_is_named(folder):
    shard_of(folder, -1).write_bytes(b"PAR1 cut")
    recordings = kineme.read_recordings(folder)
    assert len(recordings) == 2
    assert "to be a Parquet file, got a damaged one" in recordings.problems[0].reason
    assert recordings.problems[0].reason.endswith("left out episode 2")
    for shard in folder.glob("data/*/*"):
        shard.unlink()
    with pytest.raises(DataError, match="expected shards that can be read, got none; the first: expected the shard"):
        kineme.read_recordings(folder)


def swapped(frames):
    frames.loc[[3, 4]] = frames.loc[[4, 3]].to_numpy()
    return frames


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        (lambda frames: frames.drop(index=7), "episode 0: expected frame 7 next, got frame 8"),
        (swapped, "episode 0: expected frame 3 next, got frame 4"),
        (lambda frames: frames[frames["frame_index"] < 15], "episode 0: expected 20 frames as declared, got 15"),
        (lambda frames: frames.replace({"episode_index": {0: 9}}), "episode 9: expected an episode that the meta"),
    ],
)
def test_an_episode_that_is_not_whole_is_named_and_the_others_are_read(folder, frames, words):
    change(folder, frames)
    recordings = kineme.read_recordings(folder)
    assert words in "; ".join(map(str, recordings.problems))
    assert "episode 2" in [source.place for source in recordings.sources]
    assert "episode 0" not in [source.place for source in recordings.sources]


def test_episodes_in_another_order_are_read_and_named(tmp_path):
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: pd.concat([frames[frames["episode_index"] == k] for k in (1, 0)]))
    recordings = kineme.read_recordings(folder)
    assert [source.place for source in recordings.sources] == ["episode 1", "episode 0", "episode 2"]
    assert "episode 0: its frames stand behind those of episode 1" in recordings.problems[0].reason
    change(folder, lambda frames: pd.concat([frames[:5], frames[-5:], frames[5:-5]]))
    recordings = kineme.read_recordings(folder)
    assert "expected its frames in one place, got them in" in recordings.problems[0].reason


def test_an_episode_without_frames_in_a_shard_that_is_there_is_named(tmp_path):
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: frames[frames["episode_index"] == 0])
    recordings = kineme.read_recordings(folder)
    assert [source.place for source in recordings.sources] == ["episode 0", "episode 2"]
    assert recordings.problems[0].reason == "episode 1: expected frames in data/chunk-000/file-000.parquet, got none"


def test_a_vector_of_another_length_costs_its_episode_or_its_frame(tmp_path):
    folder = write_v3(tmp_path / "set", fixed=False)

    def shortened(frames):
        frames.at[5, "observation.state"] = frames.at[5, "observation.state"][:2]
        frames.at[6, "observation.state"] = None
        return frames

    change(folder, shortened)
    recordings = kineme.read_recordings(folder)
    assert "movement episode 0: expected 3 numbers in 'observation.state', got 2" in recordings.problems[0].reason
    assert len(recordings) == 2
    tolerant = kineme.read_recordings(folder, skip="sample")
    assert tolerant.demonstrations.lengths.tolist() == [18, 30, 25]


def test_stamps_that_do_not_follow_the_rate_are_kept(tmp_path):
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: frames.assign(timestamp=frames["timestamp"] * 1.5))
    times = kineme.read_recordings(folder).demonstrations[0].times
    np.testing.assert_allclose(times, 1.5 * np.arange(20) / 50, atol=1e-6)


@pytest.mark.parametrize(("shift", "stays"), [(5e-5, False), (5e-4, True), (5e-3, True)])
def test_stamps_within_a_tenth_of_a_millisecond_are_those_of_the_rate(tmp_path, shift, stays):
    """LeRobot stores them in single precision, and refuses data sets that differ by more."""
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: frames.assign(timestamp=frames["timestamp"] + shift * (frames["frame_index"] == 7)))
    times = kineme.read_recordings(folder).demonstrations[0].times
    assert abs(times[7] - (7 / 50 + shift * stays)) < 1e-6


def test_an_episode_of_several_tasks_has_the_most_frequent_one(tmp_path):
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: frames.assign(task_index=np.where(frames["frame_index"] < 3, 0, 1)))
    recordings = kineme.read_recordings(folder)
    assert recordings.labels.tolist() == [TASKS[1], TASKS[1], TASKS[0]]
    said = "expected one task, got several; labeled by that of most frames"
    assert [problem.reason for problem in recordings.problems] == [f"episode 0, episode 1: {said}"]
    declared = write_v2(tmp_path / "old") / "meta" / "episodes.jsonl"
    rows = [json.loads(line) for line in declared.read_text().splitlines()]
    declared.write_text("\n".join(json.dumps(row | {"tasks": TASKS[: 1 + row["episode_index"]]}) for row in rows))
    recordings = kineme.read_recordings(tmp_path / "old")
    assert [problem.reason for problem in recordings.problems] == [f"episode 1, episode 2: {said}"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"codebase_version": "v1.6"}, "of version 2 or 3, got v1.6; convert it"),
        ({"codebase_version": None}, "with codebase_version and features"),
        ({"fps": 0}, "expected fps above 0 in meta/info.json, got 0"),
        ({"data_path": "../{file_index}.parquet"}, "a data_path within the data set"),
        ({"data_path": "data/{file_index:300000000}.parquet"}, "a data_path within the data set"),
        ({"data_path": "data/{file_index:{chunk_index}}.parquet"}, "a data_path within the data set"),
        ({"data_path": "data/{other}.parquet"}, "expected a data_path such as"),
        ({"features": {}}, "expected features of numbers"),
    ],
)
def test_a_damaged_description_says_what_is_wrong(folder, change, words):
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text()) | change
    path.write_text(json.dumps({name: value for name, value in info.items() if value is not None}))
    with pytest.raises(DataError, match=words):
        kineme.read_recordings(folder)
    path.write_text("{")
    with pytest.raises(DataError, match=r"expected meta/info.json of a LeRobot data set"):
        kineme.read_recordings(folder)


def test_choices_that_the_data_set_makes_itself_are_refused(folder):
    assert len(kineme.read_recordings(folder, label="task", time="timestamp", movement="episode_index")) == 3
    for choice in ({"label": "next.done"}, {"time": "frame_index"}, {"movement": "task_index"}):
        with pytest.raises(DataError, match=f"as {next(iter(choice))} of a LeRobot data set"):
            kineme.read_recordings(folder, **choice)


def test_missing_metadata_is_named(tmp_path):
    folder = write_v2(tmp_path / "two")
    (folder / "meta" / "tasks.jsonl").unlink()
    assert set(kineme.read_recordings(folder).labels) == {None}
    (folder / "meta" / "episodes.jsonl").unlink()
    with pytest.raises(DataError, match=r"expected meta/episodes.jsonl"):
        kineme.read_recordings(folder)
    folder = write_v3(tmp_path / "three")
    next(folder.glob("meta/episodes/*/*")).unlink()
    with pytest.raises(DataError, match=r"expected meta/episodes/\*/\*.parquet of a LeRobot data set of version 3"):
        kineme.read_recordings(folder)


def test_damaged_tasks_cost_the_labels_alone(tmp_path):
    folder = write_v3(tmp_path / "three")
    (folder / "meta" / "tasks.parquet").write_bytes(b"PAR1 cut")
    recordings = kineme.read_recordings(folder)
    assert recordings.labels.tolist() == [None] * 3
    assert recordings.problems[0].reason.startswith("expected tasks.parquet in the meta folder of a LeRobot data set")
    (folder / "meta" / "tasks.parquet").unlink()
    recordings = kineme.read_recordings(folder)
    assert (
        "expected meta/tasks.parquet or meta/tasks.jsonl, found none; episodes have no" in recordings.problems[0].reason
    )
    folder = write_v2(tmp_path / "two")
    tasks = folder / "meta" / "tasks.jsonl"
    tasks.write_text('{"task_index": "0", "task": "a"}\n{"task_index": 1, "task": "Wave"}\n{')
    recordings = kineme.read_recordings(folder)
    assert recordings.labels.tolist() == [None, "Wave", None]
    assert [problem.reason.split(": ")[0] for problem in recordings.problems] == [
        f"meta/tasks.jsonl, line {k}" for k in (1, 3)
    ]


def test_damaged_descriptions_of_episodes_cost_those_alone(tmp_path):
    folder = write_v2(tmp_path / "two")
    path = folder / "meta" / "episodes.jsonl"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], lines[1][:-9], "", lines[2]]))
    recordings = kineme.read_recordings(folder)
    assert [source.place for source in recordings.sources] == ["episode 0", "episode 2"]
    assert "meta/episodes.jsonl, line 2: expected an object with episode_index, length" in recordings.problems[0].reason
    path.write_text("\n".join([lines[0], json.dumps(json.loads(lines[1]) | {"length": 2**70}), lines[2]]))
    assert "line 2: expected an object with" in kineme.read_recordings(folder).problems[0].reason
    folder = write_v3(tmp_path / "three", lengths=(10,) * 6)
    intact = next(folder.glob("meta/episodes/*/*"))
    pd.read_parquet(intact)[:4].to_parquet(intact)
    (intact.parent / "file-001.parquet").write_bytes(b"cut")
    recordings = kineme.read_recordings(folder)
    assert [source.place for source in recordings.sources] == [f"episode {k}" for k in range(4)]
    assert recordings.problems[0].reason.startswith(
        "expected file-001.parquet in the meta folder of a LeRobot data set"
    )
    intact.write_bytes(b"cut")
    with pytest.raises(DataError, match=r"got none in its meta folder; the first problem: expected file-000.parquet"):
        kineme.read_recordings(folder)


def test_several_chunks_of_several_files_described_in_another_order(tmp_path):
    folder = write_v3(tmp_path / "set", lengths=(10, 11, 12, 13, 14, 15, 16))
    first = folder / "data" / "chunk-000"
    (folder / "data" / "chunk-001").mkdir()
    for k in (2, 3):
        (first / f"file-00{k}.parquet").rename(folder / "data" / "chunk-001" / f"file-00{k - 2}.parquet")
    path = next(folder.glob("meta/episodes/*/*"))
    rows = pd.read_parquet(path)
    rows.loc[4:, "data/chunk_index"] = 1
    rows.loc[4:, "data/file_index"] -= 2
    rows[3:].to_parquet(path)
    rows[:3].to_parquet(path.parent / "file-001.parquet")
    recordings = kineme.read_recordings(folder)
    assert (recordings.problems, recordings.demonstrations.lengths.tolist()) == ((), [10, 11, 12, 13, 14, 15, 16])


def test_an_episode_without_frames_and_one_with_a_missing_number(tmp_path):
    folder = write_v3(tmp_path / "set", lengths=(10, 0, 12, 13))

    def spoiled(frames):
        frames.at[3, "observation.state"] = np.array([1, np.nan, 2], dtype=np.float32)
        return frames

    change(folder, spoiled)
    recordings = kineme.read_recordings(folder, fill_gaps=0)
    assert [source.place for source in recordings.sources] == ["episode 2", "episode 3"]
    reasons = [problem.reason for problem in recordings.problems]
    assert "episode 1: expected frames in data/chunk-000/file-000.parquet, got none" in reasons
    assert any(reason.startswith("movement episode 0: expected a number in ") for reason in reasons)
    assert kineme.read_recordings(folder).sources[0].filled == 1


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        (lambda frames: frames.drop(columns="observation.state"), "expected the column 'observation.state', got none"),
        (lambda frames: frames.assign(**{"observation.state": "a"}), "expected numbers in 'observation.state', got "),
    ],
)
def test_a_shard_without_its_numbers_is_named_with_its_episodes(tmp_path, frames, words):
    folder = write_v3(tmp_path / "set")
    change(folder, frames, 1)
    recordings = kineme.read_recordings(folder)
    assert len(recordings) == 2
    assert f"the shard data/chunk-000/file-001.parquet: {words}" in recordings.problems[0].reason
    assert recordings.problems[0].reason.endswith("; left out episode 2")


def test_frames_of_no_episode_are_named_without_a_number(tmp_path):
    folder = write_v3(tmp_path / "set")
    change(folder, lambda frames: frames.astype({"episode_index": "Int64"}).where(frames["index"] != 29, other=None))
    reasons = "; ".join(problem.reason for problem in kineme.read_recordings(folder).problems)
    assert "frames without an episode_index: expected frame 0 next" in reasons
    assert "episode -1" not in reasons


def test_pictures_alone_are_refused_by_their_names(folder):
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    features = {
        name: feature
        for name, feature in info["features"].items()
        if feature["dtype"] == "video" or name == "timestamp"
    }
    path.write_text(json.dumps(info | {"features": features}))
    with pytest.raises(DataError, match=r"expected features of numbers .* got only .*'observation.images.top'"):
        kineme.read_recordings(folder)


@pytest.fixture(scope="module")
def child():
    modules = ("kineme.io.reading.recordings", "kineme.io.lerobot.read", "pyarrow.parquet")
    with pytest.MonkeyPatch.context() as patch, LimitedChild(modules, memory=150 * MIB) as child:
        patch.setenv(VARIABLE, str(16 * MIB))
        yield child


def refusal(child, folder):
    outcome = child.call("kineme.io.reading.recordings:read_recordings", folder)
    assert outcome.how == "refused", outcome
    return outcome.what


def test_a_long_data_path_is_refused_before_it_is_repeated(child, tmp_path):
    folder = write_v2(tmp_path / "set")
    rows = [{"episode_index": k, "length": 20} for k in range(4000)]
    (folder / "meta" / "episodes.jsonl").write_text("\n".join(map(json.dumps, rows)))
    path = folder / "meta" / "info.json"
    info = json.loads(path.read_text())
    for data_path in ("x" * 100_000 + "{episode_index}", "{episode_index:99}" * 55):
        path.write_text(json.dumps(info | {"data_path": data_path}))
        assert re.search(r"at most 1000 characters|names of shards that takes", refusal(child, folder))


def test_episodes_that_take_little_in_the_file_and_much_in_memory_are_refused(child, tmp_path):
    folder = write_v3(tmp_path / "set")
    pd.DataFrame(
        {
            name: np.zeros(2_000_000, np.int64)
            for name in ("episode_index", "length", "data/chunk_index", "data/file_index")
        }
    ).to_parquet(path := next(folder.glob("meta/episodes/*/*")))
    assert path.stat().st_size < 100_000
    assert "file-000.parquet that takes at most" in refusal(child, folder)


def test_files_of_episodes_count_together(monkeypatch, tmp_path):
    folder = write_v3(tmp_path / "set")
    path = next(folder.glob("meta/episodes/*/*"))
    first = pd.read_parquet(path)
    rows = pd.DataFrame({name: np.zeros(3000, np.int64) for name in first})
    for k in (1, 2):
        rows.to_parquet(path.parent / f"file-00{k}.parquet")
    monkeypatch.setenv("KINEME_MAX_FILE_BYTES", "1000000")  # 600,000 for 3000 episodes
    reasons = [
        problem.reason for problem in kineme.read_recordings(folder).problems if "takes at most" in problem.reason
    ]
    assert len(reasons) == 1
    assert "file-002.parquet that takes at most" in reasons[0]


@pytest.mark.parametrize("kind", ["object", "category"])
def test_a_text_that_stands_in_many_rows_of_the_tasks_is_held_once(tmp_path, kind):
    folder = write_v3(tmp_path / "set")
    texts = pd.Series(["x" * 1000] * 300, dtype=kind)
    pd.DataFrame({"task_index": np.arange(300), "task": texts}).to_parquet(folder / "meta" / "tasks.parquet")
    tasks, problems = read_tasks(folder)
    assert (len(tasks), problems) == (300, [])
    assert len({id(text) for text in tasks.values()}) == 1

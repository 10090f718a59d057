"""Data sets of robots in HDF5 and Zarr, in the layouts of robomimic, ALOHA, UMI and Diffusion Policy."""

import json
import shutil
import sys
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.errors import DataError, SpecificationError
from kineme.io.arrays.robot_sets import LAYOUTS, robot_episodes, robot_layout
from kineme.io.arrays.zarr_arrays import zarr_arrays
from kineme.io.reading.episodes import holds_episodes, read_episodes
from lerobot_sets import write_v3
from robot_array_sets import LENGTHS, motion, write_aloha, write_buffer, write_robomimic, write_umi

h5py = pytest.importorskip("h5py", reason="h5py reads and writes HDF5")
pytest.importorskip("zarr", reason="zarr writes, and its codecs read")

WRITERS = {
    "robomimic": ("a.hdf5", write_robomimic),
    "ALOHA": ("aloha", write_aloha),
    "UMI": ("umi.zarr", write_umi),
    "Diffusion Policy": (
        "pusht.zarr.zip",
        lambda path: write_buffer(path, {"action": motion(0, sum(LENGTHS), 2), "state": motion(1, sum(LENGTHS), 5)}),
    ),
}


def written(name, folder):
    file, write = WRITERS[name]
    return write(folder / file)


@pytest.mark.parametrize("name", [row.name for rows in LAYOUTS.values() for row in rows])
def test_every_layout_is_known_and_read_by_the_one_door(name, tmp_path):
    path = written(name, tmp_path)
    assert robot_layout(path).name == name
    assert holds_episodes(path)
    episodes = list(read_episodes(path))
    assert [episode.number for episode in episodes] == [0, 1, 2]
    assert [len(episode) for episode in episodes] == list(LENGTHS)
    for episode in episodes:
        assert all(values.shape[0] == len(episode) for values in episode.signals.values())
        assert {len(episode.names[feature]) - values.shape[1] for feature, values in episode.signals.items()} == {0}
        assert (episode.problems, episode.videos) == ((), {})
    recordings = kineme.read_recordings(path)
    assert (len(recordings), recordings.problems) == (3, ())
    assert recordings.demonstrations.lengths.tolist() == list(LENGTHS)
    assert {how.layout for how, _ in recordings.detected} == {name}
    np.testing.assert_allclose(recordings.demonstrations.durations, [episode.times[-1] for episode in episodes])


def test_only_data_sets_hold_episodes(tmp_path):
    (tmp_path / "a.csv").write_text("time,x\n0,1\n")
    assert holds_episodes(write_v3(tmp_path / "set", LENGTHS))
    assert not any(map(holds_episodes, (tmp_path, tmp_path / "a.csv", tmp_path / "none")))


def test_robomimic_says_its_rate_its_task_and_its_subsets(tmp_path):
    path = write_robomimic(tmp_path / "a.hdf5", control_freq=25)
    first, second, _ = robot_episodes(path)
    assert (first.fps, first.times[1], first.task, first.place) == (25, 0.04, "Lift", "data/demo_0")
    assert (first.notes, second.notes) == (("in the subset train",), ("in the subset valid",))
    assert list(first.signals) == ["action", *(
        f"observation.{name}" for name in ("object", "robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")
    )]  # fmt: skip
    assert first.names["observation.robot0_eef_quat"] == ("x", "y", "z", "w")
    np.testing.assert_array_equal(second.signals["observation.robot0_eef_pos"], motion(1, 40, 3))
    recordings = kineme.read_recordings(path)
    assert recordings.demonstrations.dimensions == tuple(f"obs/robot0_eef_pos.{axis}" for axis in "xyz")
    assert {channel.unit for channel in recordings.demonstrations.channels} == {"m"}
    assert {source.label for source in recordings.sources} == {"Lift"}
    assert recordings.detected[0][0].units_from == "head"
    chosen = kineme.read_recordings(path, columns=["obs/object", "actions"])
    assert (chosen.demonstrations.n_dims, chosen.demonstrations.durations[0]) == (17, pytest.approx(29 / 25))


def test_demonstrations_come_by_their_numbers_and_in_the_words_of_others(tmp_path):
    path = write_robomimic(tmp_path / "a.hdf5", lengths=(9,) * 12, horizon=100)
    with h5py.File(path, "a") as file:
        file["data"].attrs["problem_info"] = json.dumps({"language_instruction": "lift the cube"})  # as LIBERO
        file["data/demo_10"].attrs["ep_meta"] = json.dumps({"lang": "open the drawer"})  # as robocasa
        file["data/demo_3"].attrs["ep_meta"] = "{"
    episodes = list(robot_episodes(path))
    assert [episode.number for episode in episodes] == list(range(12))
    assert (episodes[3].task, episodes[10].task) == ("lift the cube", "open the drawer")
    labels = {source.place: source.label for source in kineme.read_recordings(path).sources}
    assert (labels["data/demo_3"], labels["data/demo_10"]) == ("lift the cube", "open the drawer")
    assert episodes[0].notes[0] == "20 Hz assumed, the control rate of robosuite"
    assert np.isnan(episodes[0].fps)
    assert episodes[0].times[1] == 0.05


def test_aloha_is_read_at_the_rate_that_is_assumed_or_given(tmp_path):
    folder = write_aloha(tmp_path / "sets", lengths=(20,) * 11)
    episodes = list(robot_episodes(folder))
    assert [episode.number for episode in episodes] == list(range(11))
    assert episodes[10].place == "episode_10.hdf5"
    assert (episodes[0].times[1], episodes[0].notes) == (0.02, ("50 Hz assumed, the rate of ALOHA and ACT",))
    assert np.isnan(episodes[0].fps)
    assert episodes[0].names["action"] == episodes[0].names["observation.state"]
    assert episodes[0].names["action"][6:9] == ("left_gripper", "right_waist", "right_shoulder")
    assert list(episodes[0].signals) == ["action", "observation.state", "observation.velocity"]
    given_rate = next(read_episodes(folder, rate=25.0))
    assert (given_rate.fps, given_rate.times[1], given_rate.notes) == (25.0, 0.04, ())
    recordings = kineme.read_recordings(folder / "episode_0.hdf5")
    assert recordings.demonstrations.dimensions == episodes[0].names["action"]
    assert [channel.unit for channel in recordings.demonstrations.channels[5:8]] == ["rad", None, "rad"]
    assert recordings.detected[0][0].units_from.startswith("50 Hz assumed, the rate of ALOHA and ACT; else give")
    one_joint = kineme.read_recordings(folder / "episode_0.hdf5", columns="left_waist", units=0.1)
    assert one_joint.demonstrations.dimensions == ("left_waist",)
    assert one_joint.demonstrations.durations[0] == pytest.approx(1.9)
    assert "assumed" not in one_joint.detected[0][0].units_from


def test_joints_of_other_arms_are_numbered_and_have_no_unit(tmp_path):
    folder = write_aloha(tmp_path / "sets", n_joints=6)
    demonstrations = kineme.read_recordings(folder).demonstrations
    assert demonstrations.dimensions == tuple(f"observations/qpos.{k}" for k in range(6))
    assert {channel.unit for channel in demonstrations.channels or ()} <= {None}
    assert next(robot_episodes(folder)).names["action"] == tuple("012345")


def test_a_rate_is_a_number_and_for_sets_without_stamps(tmp_path):
    with pytest.raises(SpecificationError, match="rate"):
        list(read_episodes(write_aloha(tmp_path / "sets"), rate=0))
    with pytest.raises(SpecificationError, match="expected no rate for a data set of LeRobot"):
        read_episodes(write_v3(tmp_path / "lerobot"), rate=25.0)


def test_a_file_beside_a_data_set_is_not_read_in_its_place(tmp_path):
    write_robomimic(tmp_path / "lift.hdf5")
    assert len(list(read_episodes(tmp_path))) == len(LENGTHS)
    write_v3(tmp_path / "cups")
    with pytest.raises(DataError, match=r"expected a data set of episodes .* got several: .*; say the folder of one: "):
        read_episodes(tmp_path)


def test_umi_is_read_from_a_folder_and_from_an_archive(tmp_path):
    folder, archive = write_umi(tmp_path / "a.zarr"), write_umi(tmp_path / "a.zarr.zip")
    for path in (folder, archive):
        episodes = list(robot_episodes(path))
        assert [episode.place for episode in episodes] == ["episode 0", "episode 1", "episode 2"]
        assert episodes[0].notes == ("59.94 Hz assumed, the frame rate of its camera",)
        for k, episode in enumerate(episodes):
            expected = motion(k, LENGTHS[k], 3).astype(np.float32)
            np.testing.assert_array_equal(episode.signals["observation.robot0_eef_pos"], expected)
        assert [name.removeprefix("observation.robot0_") for name in episodes[0].signals] == [
            "eef_pos", "eef_rot_axis_angle", "gripper_width"
        ]  # fmt: skip
        recordings = kineme.read_recordings(path)
        assert [source.place for source in recordings.sources] == ["episode 0", "episode 1", "episode 2"]
        assert recordings.demonstrations.dimensions == tuple(f"robot0_eef_pos.{axis}" for axis in "xyz")
        wide = kineme.read_recordings(path, columns=["robot0_gripper_width", "robot0_eef_pos"])
        np.testing.assert_array_equal(wide.demonstrations[1].positions[:, :1], motion(1, 40, 1).astype(np.float32))


def test_features_are_chosen_by_name_or_by_path(tmp_path):
    path = write_robomimic(tmp_path / "a.hdf5")
    chosen = next(robot_episodes(path, ["observation.object", "states"]))
    assert {name: values.shape[1] for name, values in chosen.signals.items()} == {
        "observation.object": 10,
        "states": 32,
    }
    with pytest.raises(
        DataError, match=r"expected features of data/demo_0 \(\['action', 'observation.object', .*'speed'"
    ):
        list(robot_episodes(path, ["speed"]))


@given(
    st.lists(st.integers(1, 30), min_size=1, max_size=6), st.integers(1, 40), st.integers(1, 3),
    st.sampled_from(["blosc", "zstd", "gzip", "none"]), st.sampled_from(["C", "F"]), st.sampled_from([".", "/"]),
)  # fmt: skip
@settings(deadline=None, max_examples=40)
def test_rows_are_those_that_zarr_wrote(tmp_path_factory, lengths, tall, wide, codec, order, between):
    import numcodecs

    codecs = {"blosc": numcodecs.Blosc(), "zstd": numcodecs.Zstd(), "gzip": numcodecs.GZip(), "none": None}
    x = motion(0, sum(lengths), 3)
    path = write_buffer(
        tmp_path_factory.mktemp("zarr") / "a.zarr", {"robot0_eef_pos": x}, lengths, chunks=(tall, wide), order=order,
        compressors=codecs[codec], chunk_key_encoding={"name": "v2", "separator": between},
    )  # fmt: skip
    parts = [episode.signals["observation.robot0_eef_pos"] for episode in robot_episodes(path)]
    assert [len(part) for part in parts] == lengths
    np.testing.assert_array_equal(np.concatenate(parts), x)


def test_what_is_wrong_with_an_episode_stands_in_its_problems(tmp_path):
    path = write_robomimic(tmp_path / "a.hdf5")
    with h5py.File(path, "a") as file:
        del file["data/demo_1/actions"]
        file["data/demo_1/actions"] = motion(0, 39, 7)
        file["data/demo_2"].attrs["num_samples"] = 60
        file.create_group("data/demo_3")
    first, second, third, empty = robot_episodes(path)
    assert first.problems == ()
    assert second.problems == ("expected 40 rows of action as of others, got 39",)
    assert "action" not in second.signals
    assert third.problems == ("expected 60 rows as declared, got 50",)
    assert (len(empty), empty.problems) == (0, ("expected arrays of numbers with rows, got none",))


def test_a_damaged_demonstration_does_not_hide_the_others(tmp_path):
    path = write_robomimic(tmp_path / "a.hdf5")
    data = bytearray(path.read_bytes())
    at = data.index(b"robot0_gripper_qpos")  # in the heap of names of one group
    data[at : at + 4] = b"\xff\xfe\xff\xfe"
    path.write_bytes(data)
    problems = [episode.problems for episode in robot_episodes(path)]
    assert sorted(map(bool, problems)) == [False, False, True]
    assert any("expected the group data/demo_" in text for texts in problems for text in texts)


def test_a_damaged_file_among_others_is_an_episode_with_a_problem(tmp_path):
    folder = write_aloha(tmp_path / "sets")
    damaged = folder / "episode_1.hdf5"
    damaged.write_bytes(damaged.read_bytes()[:700])
    (tmp_path / "other.hdf5").write_bytes((folder / "episode_0.hdf5").read_bytes())
    (folder / "episode_7.hdf5").symlink_to(tmp_path / "other.hdf5")
    numbers, problems = zip(*((episode.number, episode.problems) for episode in robot_episodes(folder)), strict=True)
    assert numbers == (0, 1, 2)
    assert problems[0] == problems[2] == ()
    assert "expected an HDF5 file, got something foreign, truncated or damaged" in problems[1][0]


def test_what_is_lost_or_half_written_of_zarr_is_said(tmp_path):
    path = write_umi(tmp_path / "a.zarr", tall=8)
    (path / "data/robot0_eef_pos/4.0").unlink()  # rows 32 to 39
    chunk = path / "data/robot0_eef_rot_axis_angle/12.0"
    chunk.write_bytes(chunk.read_bytes()[:-5])
    first, second, third = robot_episodes(path)
    assert first.problems == ()
    (problem,) = second.problems
    assert problem.startswith("parts of observation.robot0_eef_pos are not there")
    assert (second.signals["observation.robot0_eef_pos"][2:10] == 0).all()
    assert third.problems[0].startswith("expected a chunk of the array data/robot0_eef_rot_axis_angle of Zarr, got a")
    assert list(third.signals) == ["observation.robot0_eef_pos", "observation.robot0_gripper_width"]
    meta = path / "data/robot0_eef_pos/.zarray"
    described = json.loads(meta.read_text())
    meta.write_text(json.dumps(described | {"shape": [75, 3]}))
    assert [len(episode) for episode in robot_episodes(path)] == [30, 40, 50]
    recordings = kineme.read_recordings(path)
    assert len(recordings) == 2
    assert "episode 2: expected rows among 75, got 70 to 120" in str(recordings.problems[0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"filters": [{"id": "pickle"}]}, "without filters"),
        ({"dtype": "|O"}, "expected numbers"),
        ({"dtype": [["a", "<f4"]]}, "expected numbers"),
        ({"compressor": {"id": "imagecodecs_jpegxl"}}, "packed by blosc"),
        ({"chunks": [0, 3]}, "expected numbers"),
        ({"shape": "many"}, "expected the description"),
    ],
)
def test_what_could_run_code_is_refused_and_never_read(change, words, tmp_path):
    path = write_umi(tmp_path / "a.zarr")
    meta = path / "data/robot0_eef_pos/.zarray"
    meta.write_text(json.dumps(json.loads(meta.read_text()) | change))
    with zarr_arrays(path) as arrays:
        assert words in str(arrays["data/robot0_eef_pos"])
    for episode in robot_episodes(path):
        assert "observation.robot0_eef_pos" not in episode.signals
        assert (len(episode.signals), len(episode.problems)) == (2, 1)
        assert words in episode.problems[0]


def test_small_files_that_would_take_much_memory_are_refused(tmp_path):
    path = write_umi(tmp_path / "a.zarr", compressors=None)
    where = path / "data/robot0_eef_pos"
    described = json.loads((where / ".zarray").read_text())
    (where / ".zarray").write_text(
        json.dumps(described | {"compressor": {"id": "zlib", "level": 9}, "chunks": [120, 3]})
    )
    (where / "0.0").write_bytes(zlib.compress(bytes(2**28), 9))
    tracemalloc.start()
    first = next(robot_episodes(path))
    assert tracemalloc.get_traced_memory()[1] < 2**22
    tracemalloc.stop()
    assert "got a damaged one" in first.problems[0]
    (where / ".zarray").write_text(json.dumps(described | {"chunks": [2**50, 3]}))
    assert "takes at most" in next(robot_episodes(path)).problems[0]
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset("action", (2**40, 14), "f4", chunks=(64, 14), compression="gzip")
        file.create_dataset("observations/qpos", (2**40, 14), "f4", chunks=(64, 14), compression="gzip")
    with pytest.raises(DataError, match="takes at most"):
        list(robot_episodes(tmp_path / "a.hdf5"))


@pytest.mark.soak
def test_one_episode_is_in_memory_at_a_time(tmp_path):
    path = write_robomimic(tmp_path / "a.hdf5", lengths=(2000,) * 12)
    tracemalloc.start()
    total = sum(values.nbytes for episode in robot_episodes(path) for values in episode.signals.values())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < total / 3


def test_other_files_are_not_read_through_links_inside(tmp_path):
    secret = write_robomimic(tmp_path / "secret.hdf5")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["data"] = h5py.ExternalLink(str(secret), "/data")
    assert robot_layout(tmp_path / "a.hdf5") is None
    path = write_umi(tmp_path / "a.zarr")
    shutil.move(path / "data/robot0_eef_pos", tmp_path / "elsewhere")
    (path / "data/robot0_eef_pos").symlink_to(tmp_path / "elsewhere")
    assert all("observation.robot0_eef_pos" not in episode.signals for episode in robot_episodes(path))


def test_other_paths_are_no_robot_sets(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("t,x\n0,1\n")
    (tmp_path / "a.hdf5").write_bytes(b"no")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("a.txt", "hello")
    (tmp_path / "bad.zip").write_bytes(b"PK\x03\x04")
    for name in ("a.csv", "a.hdf5", "a.zip", "bad.zip", "nothing", "."):
        assert robot_layout(tmp_path / name) is None
    with pytest.raises(DataError, match=r"robomimic, ALOHA, UMI"):
        read_episodes(tmp_path / "a.csv")
    with pytest.raises(DataError, match=r"expected a replay buffer in a\.zip"):
        kineme.read_recordings(tmp_path / "a.zip")
    with pytest.raises(DataError, match="expected an archive of Zarr, got a damaged one"):
        kineme.read_recordings(tmp_path / "bad.zip")
    for name in ("zarr.json", "meta/episode_ends/zarr.json"):
        (tmp_path / "new.zarr" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "new.zarr" / name).write_text('{"zarr_format": 3}')
    with pytest.raises(
        DataError, match=r"new.zarr: expected Zarr of format 2, got format 3; write it with zarr_format=2"
    ):
        kineme.read_recordings(tmp_path / "new.zarr")
    import numcodecs

    path = write_umi(tmp_path / "a.zarr", compressors=numcodecs.Blosc())
    monkeypatch.setitem(sys.modules, "numcodecs", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[zarr\]'"):
        kineme.read_recordings(path)


def test_episodes_that_need_a_missing_package_say_which(tmp_path, monkeypatch):
    paths = write_robomimic(tmp_path / "lift.hdf5"), write_aloha(tmp_path / "cups")
    monkeypatch.setitem(sys.modules, "h5py", None)
    for path in paths:
        with pytest.raises(DataError, match=r"pip install 'kineme\[hdf5\]'"):
            read_episodes(path)


def test_columns_may_be_called_as_episodes_call_them(tmp_path):
    path = write_robomimic(tmp_path / "demos.hdf5")
    columns = ("observation.robot0_eef_pos.y", "observation.robot0_gripper_qpos.1")
    recordings = kineme.read_recordings(path, columns=columns)
    episode = next(robot_episodes(path))
    expected = [
        episode.signals["observation.robot0_eef_pos"][:, 1],
        episode.signals["observation.robot0_gripper_qpos"][:, 1],
    ]
    np.testing.assert_array_equal(recordings.demonstrations[0].recorded, np.column_stack(expected))
    assert [channel.name for channel in recordings.demonstrations.channels] == [*columns]

"""Trajectories of joints as episodes of LeRobot: new data sets, longer ones, and what does not fit into them."""

import json
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import kineme
from kineme.errors import DataError, SpecificationError
from kineme.io.inspection.inspect import inspect
from kineme.io.lerobot import write_episode as module
from kineme.io.lerobot.write_episode import merged_statistics, statistics_of
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export_files import states_at, write_lerobot
from lerobot_sets import write_v2, write_v3


def trajectory(n=80, joints=("a", "b", "c")):
    t = np.arange(n) / 50
    q = np.column_stack((np.sin(t), t**2, np.cos(3 * t)))
    v = np.column_stack((np.cos(t), 2 * t, -3 * np.sin(3 * t)))
    return JointTrajectory(joints, t, q, v, 0 * q, {"grip": np.where(t < 0.8, 0.0, 1.0)})


@pytest.fixture
def folder(tmp_path):
    where = tmp_path / "set"
    written = [write_lerobot(where, trajectory(n), task, 30) for n, task in ((80, "wave"), (60, "pour"), (70, "wave"))]
    assert written == [0, 1, 2]
    return where


def rows(folder):
    return pd.concat([pd.read_parquet(path) for path in sorted(folder.glob("data/*/*.parquet"))])


def test_episodes_are_read_back_with_their_tasks(folder):
    found = kineme.read_recordings(folder)
    assert (found.labels.tolist(), found.problems) == (["wave", "pour", "wave"], ())
    assert found.demonstrations.dimensions == ("a.pos [deg]", "b.pos [deg]", "c.pos [deg]", "grip")
    assert found.demonstrations.lengths.tolist() == [49, 37, 43]
    for one, n in zip(found.demonstrations, (80, 60, 70), strict=True):
        until = np.minimum(one.times, trajectory(n).duration)
        expected = np.column_stack((np.sin(until), until**2, np.cos(3 * until)))
        np.testing.assert_allclose(one.positions[:, :3], np.degrees(expected), atol=1e-4)
        np.testing.assert_array_equal(one.positions[:, 3], until >= 0.8)


def test_every_row_is_what_lerobot_counts(folder):
    frames = rows(folder)
    assert frames["index"].tolist() == list(range(129))
    assert frames["episode_index"].tolist() == [0] * 49 + [1] * 37 + [2] * 43
    assert frames["task_index"].tolist() == [0] * 49 + [1] * 37 + [0] * 43
    np.testing.assert_allclose(frames["timestamp"], frames["frame_index"] / 30, rtol=1e-6)
    state, action = (np.vstack(frames[name]) for name in ("observation.state", "action"))
    last = frames["frame_index"].diff(-1).fillna(1).to_numpy() > 0
    np.testing.assert_array_equal(action[:-1][~last[:-1]], state[1:][~last[:-1]])
    np.testing.assert_array_equal(action[last], state[last])
    episodes = pd.concat([pd.read_parquet(path) for path in sorted(folder.glob("meta/episodes/*/*.parquet"))])
    assert episodes["dataset_from_index"].tolist() == [0, 49, 86]
    assert episodes["dataset_to_index"].tolist() == [49, 86, 129]  # after the last
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 129, 2)
    assert info["splits"] == {"train": "0:3"}
    known = json.loads((folder / "meta/stats.json").read_text())["observation.state"]
    np.testing.assert_allclose(known["mean"], state.mean(axis=0), rtol=1e-6)  # of single precision
    np.testing.assert_allclose(known["std"], state.std(axis=0), rtol=1e-6)
    np.testing.assert_allclose(known["max"], state.max(axis=0), rtol=1e-6)
    assert known["count"] == [129]
    assert pd.read_parquet(folder / "meta/tasks.parquet").index.tolist() == ["wave", "pour"]


def test_statistics_of_parts_are_those_of_all():
    values = np.random.default_rng(0).normal(size=(50, 3))
    merged = merged_statistics(statistics_of(values[:20]), statistics_of(values[20:]))
    whole = statistics_of(values)
    for name in ("min", "max", "mean", "std", "count"):
        np.testing.assert_allclose(merged[name], whole[name])


def test_the_end_is_a_frame_also_where_it_falls_between_two():
    one = trajectory(82)  # 1.62 s
    for fps, n in ((30, 50), (50, 82), (1, 3)):
        states = states_at(one, fps)
        assert len(states) == n
        np.testing.assert_allclose(states[-1, :3], one.positions[-1], atol=1e-9)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"fps": 25.0}, "expected the 30 frames per second of the data set, got 25"),
        ({"joints": ("a", "b", "d")}, "they differ in action, observation.state: "),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_is_written(folder, changed, words):
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(DataError, match=words):
        write_lerobot(folder, trajectory(joints=changed.get("joints", ("a", "b", "c"))), "x", changed.get("fps", 30))
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_data_sets_of_others_are_refused_with_what_differs(tmp_path):
    with pytest.raises(DataError, match="of version 3 to append to, got v2"):
        write_lerobot(write_v2(tmp_path / "two"), trajectory(), "x", 50)
    with pytest.raises(DataError, match=r"they differ in .*observation\.images\.top"):
        write_lerobot(write_v3(tmp_path / "three"), trajectory(), "x", 50)
    write_lerobot(tmp_path / "elsewhere", trajectory(), "x", 50)
    path = tmp_path / "elsewhere" / "meta" / "info.json"
    path.write_text(path.read_text().replace("data/chunk-", "frames/chunk-"))
    with pytest.raises(DataError, match=r"the data_path data/chunk-.*, got frames/chunk-"):
        write_lerobot(tmp_path / "elsewhere", trajectory(), "x", 50)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "note.txt").write_text("mine")
    with pytest.raises(FileExistsError):
        write_lerobot(tmp_path / "full", trajectory(), "x", 50)


def test_an_episode_that_could_not_be_finished_is_not_counted(folder, monkeypatch):
    real = module._write_json

    def full(path, content):
        if path.name == "info.json":
            raise OSError(5, "The disk does not answer")
        real(path, content)

    monkeypatch.setattr(module, "_write_json", full)
    with pytest.raises(OSError, match="does not answer"):
        write_lerobot(folder, trajectory(), "x", 30)
    with pytest.raises(OSError, match="does not answer"):
        write_lerobot(folder.with_name("new"), trajectory(), "x", 30)
    assert not folder.with_name("new").exists()
    assert json.loads((folder / "meta/info.json").read_text())["total_episodes"] == 3
    monkeypatch.undo()
    assert write_lerobot(folder, trajectory(60), "again", 30) == 3  # over what the failed one left
    assert rows(folder)["index"].tolist() == list(range(129 + 37))
    found = kineme.read_recordings(folder)
    assert (found.labels.tolist(), found.problems) == (["wave", "pour", "wave", "again"], ())


def test_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[parquet\]'"):
        write_lerobot(tmp_path / "set", trajectory(), "x")


def test_joints_have_the_names_and_units_that_drivers_take(tmp_path):
    one = replace(trajectory(), units=("rad", "m", "rad"))
    for units, size in (("deg", 180 / np.pi), ("rad", 1.0)):
        write_lerobot(tmp_path / units, one, "x", 30, joint_units=units)
        state = json.loads((tmp_path / units / "meta/info.json").read_text())["features"]["observation.state"]
        assert state["names"] == ["a.pos", "b.pos", "c.pos", "grip"]
        assert state["units"] == [units, "m", units, None]
        last = np.vstack(rows(tmp_path / units)["observation.state"])[-1]
        np.testing.assert_allclose(last[:3], one.positions[-1] * [size, 1, size], rtol=1e-6)
        notes = inspect(kineme.read_recordings(tmp_path / units)).notes
        assert [note for note in notes if "declare" in note] == [
            "LeRobot does not declare the units of grip: they are taken as they are stored"
        ]
    with pytest.raises(SpecificationError, match="expected the robot of the trajectory, with limits of every joint"):
        write_lerobot(tmp_path / "percent", one, "x", 30, joint_units="percent")
    with pytest.raises(DataError, match=r"they differ in action, observation\.state"):
        write_lerobot(tmp_path / "deg", one, "x", 30, joint_units="rad")


def test_the_only_joint_of_an_arm_keeps_its_name_and_unit(tmp_path):
    steps, still = np.linspace(0, 0.1, 20)[:, None], np.zeros((20, 1))
    made = JointTrajectory(("j",), np.linspace(0, 2, 20), steps, still, still, {}, ("rad",))
    write_lerobot(tmp_path / "set", made, "turn", 30)
    read = kineme.read_recordings(tmp_path / "set").demonstrations
    assert [(channel.name, channel.unit) for channel in read.channels] == [("j.pos [deg]", "deg")]
    assert read.recorded[-1] == pytest.approx(np.degrees(0.1))

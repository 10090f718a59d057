"""`kineme discover`: from a data set to a table, a file, and proposals that `kineme anchor` names."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from commands import answer, run, start

from bench.work_sets import write_set
from robot_array_sets import write_buffer
from soaking import slow
from work_samples import NAMES, TASKS, work_episodes

pytest.importorskip("pyarrow")
N_KINDS = sum(map(len, TASKS.values()))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_set(tmp_path_factory.mktemp("sets") / "worked", work_episodes(12)[0])


@pytest.fixture
def without_pictures(monkeypatch):
    """To draw the proposals takes longer than all else; `test_anchor` looks at pictures."""
    monkeypatch.setattr("kineme.cli.anchor._draw", lambda *_: [])


def discovered(dataset, folder, *options):
    """A library of the kinds that were discovered, all of them accepted."""
    told = answer("discover", dataset, *options, "--library", folder)
    answer("anchor", "--library", folder, "--accept", "all")
    return told


@pytest.mark.soak
def test_it_shows_kinds_and_what_they_follow(dataset):
    shown = start("discover", dataset)
    assert shown.returncode == 0, shown.stderr
    assert f"{N_KINDS} kinds among 60 movements of 12 episodes" in shown.stdout
    assert "begin 100%" in shown.stdout
    assert "pick the cube 1" in shown.stdout


def test_it_stores_proposals_which_anchor_accepts_by_their_names(dataset, tmp_path):
    told = answer("discover", dataset, "--library", tmp_path / "actions")
    names = [kind["name"] for kind in told["kinds"]]
    assert len(names) == N_KINDS
    assert told["library"] == str(tmp_path / "actions")
    listed = answer("anchor", "--library", tmp_path / "actions", cwd=tmp_path)
    assert [proposal["name"] for proposal in listed["proposals"]] == names
    shown = run("anchor", "--library", tmp_path / "actions", cwd=tmp_path)
    assert "proposed name" in shown.stdout
    (tmp_path / "names.json").write_text(json.dumps({"1": "reach"}))
    accepted = answer(
        "anchor", "--library", tmp_path / "actions", "--accept", "1,2", "--names", "names.json", cwd=tmp_path
    )
    assert list(accepted["accepted"]) == ["reach", names[1]]
    assert answer("library", "verify", "--library", tmp_path / "actions")["ok"]
    assert "discover" in run("library", "history", "--library", tmp_path / "actions").stdout


@pytest.mark.soak
@pytest.mark.usefixtures("without_pictures")
def test_movements_are_compared_where_they_are(dataset, tmp_path):
    """A way there is no way back: what was accepted is recognized, and it annotates the data set."""
    discovered(dataset, tmp_path / "actions")
    symbols = answer("library", "list", "--library", tmp_path / "actions")["symbols"]
    assert sorted(symbol["movements"] for symbol in symbols) == [6] * N_KINDS
    from kineme.library.library import ActionLibrary

    with ActionLibrary(tmp_path / "actions", read_only=True) as library:
        normalization = library.specification.comparison.normalization
    assert (normalization.translation, normalization.scale) == (False, "none")
    named = answer("annotate", dataset, "--library", tmp_path / "actions", "-o", tmp_path / "named")
    assert {row["symbol"] for row in named["annotations"]} > {"pick the cube 1"}


def test_proposals_join_a_library_that_learned_from_the_data_set(dataset, tmp_path):
    answer("learn", dataset, "--library", tmp_path / "whole")
    assert answer("discover", dataset, "--library", tmp_path / "whole")["version"] > 1


@pytest.mark.soak
@pytest.mark.usefixtures("without_pictures")
def test_a_library_of_another_feature_annotates_the_set_and_says_what_is_missing_in_others(dataset, tmp_path):
    """Its columns are called by their feature; the set has them although the one read by default is another."""
    library = tmp_path / "actions"
    discovered(dataset, library, "--feature", "action")
    by_default = answer("annotate", dataset, "--library", library)
    assert sum(row["symbol"] is not None for row in by_default["annotations"]) > 30
    assert any("without observation.state" in note for note in by_default["notes"])
    assert (
        answer("annotate", dataset, "--library", library, "--columns", "action")["annotations"]
        == (by_default["annotations"])
    )
    refused = run("discover", dataset, "--library", library)
    assert refused.returncode
    said = " ".join(refused.stderr.split())
    assert "in the shell with --columns (--feature of kineme discover), or make another library" in said


def test_it_writes_the_movements_of_each_episode_and_nothing_over_a_file(dataset, tmp_path):
    told = answer("discover", dataset, "-o", tmp_path / "movements.csv")
    with (tmp_path / "movements.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(told["segments"]) == 60
    assert {row["place"] for row in rows} == {f"episode {k}" for k in range(12)}
    assert [row["symbol"] for row in rows[:5]] == [segment["kind"] for segment in told["segments"][:5]]
    refused = run("discover", dataset, "-o", tmp_path / "movements.csv")
    assert refused.returncode == 2
    assert "--force" in refused.stderr


def test_another_feature_and_what_is_no_data_set(dataset, tmp_path):
    assert len(answer("discover", dataset, "--feature", "action")["kinds"]) >= N_KINDS - 2
    assert "--feature" in run("discover", dataset, "--feature", "wrist").stderr
    refused = run("discover", tmp_path)
    assert refused.returncode == 1
    assert "expected a data set of episodes" in refused.stderr


def test_fewer_boundaries_for_a_larger_penalty(dataset):
    few, many = (len(answer("discover", dataset, "--penalty", penalty)["segments"]) for penalty in (4.0, 1.5))
    assert few < many


def _robomimic(path, states):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path.with_suffix(".hdf5"), "w") as file:
        for k, state in enumerate(states):
            demo = file.create_group(f"data/demo_{k}")
            demo["actions"], demo["obs/object"] = state, state[:, :2]
            demo["obs/robot0_eef_pos"], demo["obs/robot0_joint_pos"] = state[:, :3], state[:, 3:6]
            demo["obs/robot0_gripper_qpos"] = np.column_stack((state[:, 6], -state[:, 6]))
    return path.with_suffix(".hdf5")


def _aloha(path, states):
    h5py = pytest.importorskip("h5py")
    path.mkdir()
    for k, state in enumerate(states):
        with h5py.File(path / f"episode_{k}.hdf5", "w") as file:
            file["action"], file["observations/qpos"] = state, state
    return path


def _umi(path, states):
    pytest.importorskip("zarr")
    rows = np.concatenate(states)
    arrays = {"robot0_eef_pos": rows[:, :3], "robot0_eef_rot_axis_angle": rows[:, 3:6], "action": rows}
    arrays |= {"robot0_gripper_width": rows[:, 6:]}
    return write_buffer(path.with_suffix(".zarr"), arrays, [*map(len, states)])


def _buffer(path, states):
    pytest.importorskip("zarr")
    rows = np.concatenate(states)
    return write_buffer(path.with_suffix(".zarr"), {"state": rows, "action": rows}, [*map(len, states)])


def _lerobot(path, states):
    """Data sets without ``observation.state``: what was observed of an arm, and its commands."""
    episodes = [
        replace(
            episode,
            signals={"observation.robot0_eef_pos": state[:, :3], "observation.robot0_joint_pos": state[:, 3:6],
                     "observation.robot0_gripper_width": state[:, 6:], "action": state},
            names={"observation.robot0_eef_pos": ("x", "y", "z"), "observation.robot0_joint_pos": ("a", "b", "c"),
                   "observation.robot0_gripper_width": ("width",), "action": NAMES},
        )
        for episode, state in zip(work_episodes(len(states))[0], states, strict=True)
    ]  # fmt: skip
    return write_set(path, episodes, [*episodes[0].signals])


@pytest.mark.parametrize("write", [slow(_robomimic), slow(_aloha), slow(_umi), slow(_buffer), _lerobot])
@pytest.mark.usefixtures("without_pictures")
def test_what_was_discovered_in_any_layout_annotates_it_without_options(write, tmp_path):
    states = [episode.signals["observation.state"] for episode in work_episodes(8)[0]]
    path = write(tmp_path / "work", states)
    told = discovered(path, tmp_path / "actions")
    named = answer("annotate", path, "--library", tmp_path / "actions", "-o", tmp_path / "labels.csv")
    assert {row["symbol"] for row in named["annotations"]} & {kind["name"] for kind in told["kinds"]}
    assert not any("compared in their order" in note for note in named["notes"])

"""``kineme features``: shards of any number of processes are the same, and answer as those of Python."""

from __future__ import annotations

import shutil

import pytest
from commands import answer, run

import kineme
from kineme.cli import pieces as cli_pieces
from kineme.pieces import open_shards
from robot_work import write_episodes, write_library


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("work")
    write_library(folder / "actions")
    shutil.copytree(folder / "actions-shown", folder / "archive")
    write_library(folder / "others", each=4)
    return folder


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    monkeypatch.setattr(cli_pieces, "_MIB", 600)


def _bytes(folder):
    return {path.name: path.read_bytes() for path in [*folder.glob("part-*"), folder / "bases.npz"]}


@pytest.mark.soak
def test_shards_of_processes_are_the_same_and_find_every_movement(work, tmp_path):
    command = ("features", work / "archive", "-l", work / "actions")
    assert answer(*command, "-o", tmp_path / "one")["recordings"] == 9
    assert answer(*command, "-o", tmp_path / "two", "--workers", 2)["pieces"]["done"] > 2
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "two")
    said = answer("gather", tmp_path / "two")
    assert (said["recordings"], said["pieces"]["missing"]) == (9, 0)
    recordings = kineme.read_recordings(work / "archive")
    nearest = open_shards(tmp_path / "two").nearest(recordings)
    assert [near[0].path for near in nearest] == [source.path for source in recordings.sources]
    assert all(near[0].similarity == pytest.approx(1.0, abs=1e-3) for near in nearest)
    assert "kineme serve --library" in run("gather", tmp_path / "two").stdout


def test_shards_stay_though_the_library_learns_more(work, tmp_path):
    write_library(tmp_path / "actions")
    command = ("features", work / "archive", "-l", tmp_path / "actions", "-o", tmp_path / "out")
    run(*command)
    before = _bytes(tmp_path / "out")
    run("learn", work / "others-shown", "-l", tmp_path / "actions")
    assert answer(*command)["pieces"].keys() == {"skipped"}
    assert _bytes(tmp_path / "out") == before
    assert answer(*command, "--force")["pieces"].keys() == {"done"}  # fitted to all that is there
    assert _bytes(tmp_path / "out") != before


def test_another_library_and_other_columns_are_refused_in_words(work, tmp_path):
    run("features", work / "archive", "-l", work / "actions", "-o", tmp_path / "out")
    done = run("features", work / "archive", "-l", work / "others", "-o", tmp_path / "out")
    assert (done.returncode, "of another one; take a new folder" in done.stderr) == (1, True)
    (tmp_path / "flat").mkdir()
    (tmp_path / "flat" / "a.csv").write_text("t,x,y\n" + "".join(f"{k},{k},{k * k}\n" for k in range(20)))
    said = answer("features", tmp_path / "flat", "-l", work / "actions", "-o", tmp_path / "none")
    assert (said["pieces"], len(said["problems"])) == ({"done": 1}, 1)


def test_episodes_are_movements_too(work, tmp_path):
    write_episodes(tmp_path / "set", 3)
    assert answer("features", tmp_path / "set", "-l", work / "actions", "-o", tmp_path / "out")["recordings"] == 3

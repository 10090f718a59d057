"""Folders of ROS 2 bags in pieces: each is one piece, read, learned and annotated as without pieces."""

from __future__ import annotations

import shutil

import pytest
from commands import answer, run

from bag_files import Maker, pose_rows, stamps, write_bag
from kineme.pieces import plan


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Bags in folders of their labels, one of them packed, and a library of them."""
    folder = tmp_path_factory.mktemp("bags")
    make = Maker("ros2")
    for k in range(6):
        label = ("nod", "wave")[k % 2]
        (folder / "archive" / label).mkdir(parents=True, exist_ok=True)
        poses = zip(stamps(60), pose_rows(60, seed=k), strict=True)
        messages = [("/hand", stamp, make.pose_stamped(stamp, row)) for stamp, row in poses]
        write_bag(folder / "archive" / label, ("ros2", "mcap")[k // 3], messages, f"run{k}", compress=k == 4)
    run("learn", folder / "archive", "-l", folder / "actions")
    return folder / "archive"


def test_each_bag_is_one_piece_with_its_files(archive):
    pieces = plan(str(archive), 1).pieces
    assert list(map(str, pieces)) == [
        f"{label}/run{k}" for label, k in zip(["nod"] * 3 + ["wave"] * 3, (0, 2, 4, 1, 3, 5), strict=True)
    ]
    for piece in pieces:
        names = [file.name for file in piece.units[0].files]
        assert sorted(name.rpartition("/")[2] for name in names)[0] == "metadata.yaml"
        assert len(names) == 2


@pytest.mark.parametrize("command", ["annotate", "inspect", "learn"])
def test_bags_answer_as_without_pieces(archive, tmp_path, command, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "always")
    actions = archive.parent / "actions"
    where = {"annotate": ("-l", actions), "inspect": (), "learn": ("-l", tmp_path / "library")}[command]
    for k in (2, 1):
        run(command, archive, *where, "-o", tmp_path / "out", "--shard", f"{k}/2")
    if command == "annotate":
        run(command, archive, *where, "-o", tmp_path / "here.csv")
        run("gather", tmp_path / "out", "-o", tmp_path / "there.csv")
        assert (tmp_path / "there.csv").read_text() == (tmp_path / "here.csv").read_text()
    elif command == "inspect":
        assert answer("gather", tmp_path / "out")["labels"] == answer(command, archive)["labels"]
    else:
        gathered = answer("gather", tmp_path / "out")
        direct = answer(command, archive, "-l", tmp_path / "other")
        names = ("added", "duplicates", "symbols", "movements")
        assert {name: gathered[name] for name in names} == {name: direct[name] for name in names}


def test_a_bag_that_is_the_archive_is_copied_with_annotations(archive, tmp_path):
    bag, actions = archive / "wave" / "run1", archive.parent / "actions"
    run("annotate", bag, "-l", actions, "-o", tmp_path / "out", "--shard", "1/1")
    run("gather", tmp_path / "out", "-o", tmp_path / "there")
    run("annotate", bag, "-l", actions, "-o", tmp_path / "here")
    here, there = (
        {path.name: path.stat().st_size for path in (tmp_path / name).iterdir()} for name in ("here", "there")
    )
    assert here == there
    assert "metadata.yaml" in here


def test_a_bag_that_is_cut_is_a_problem_of_its_piece(archive, tmp_path):
    shutil.copytree(archive, tmp_path / "archive")
    (path,) = (tmp_path / "archive" / "wave" / "run3").glob("*.mcap*")
    path.write_bytes(path.read_bytes()[:100])
    done = answer("inspect", tmp_path / "archive", "-o", tmp_path / "out", "--shard", "1/1")
    assert done["pieces"] == {"done": 6}
    assert done["recordings"] == 5
    (problem,) = done["problems"]
    assert problem.startswith("wave/run3")

"""``kineme evaluate`` as a user runs it."""

import json

import commands
import numpy as np
import pytest

from kineme.cli.evaluate import METHOD_NAMES, PROTOCOL_NAMES
from kineme.io.writing.write_movement import write_movement
from kineme_experiments.evaluation.methods import METHODS
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.paper.run import Reproduction


def run(*arguments, by=commands.run):
    return by("evaluate", *arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, make_movement):
    folder = tmp_path_factory.mktemp("a folder of Ünïcode")
    for k, label in enumerate(("wave", "point", "stir", "push")):
        (folder / label).mkdir()
        for i in range(3):
            t, x = make_movement([k, 0], n_samples=50)
            write_movement(folder / label / f"{i}.csv", {"times": t, "positions": (1 + 0.1 * i) * x})
    (folder / "wave" / "notes.txt").write_text("not a movement")
    return folder


def test_the_names_are_those_of_the_tables():
    assert tuple(PROTOCOLS) == PROTOCOL_NAMES
    assert tuple(METHODS) == METHOD_NAMES


def test_a_folder_of_recordings_is_evaluated(folder, tmp_path):
    done = run(folder, "--quick", "--method", "kineme", "--method", "euclidean", "--jobs", 1, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Few shots" in done.stdout
    assert "left out wave/notes.txt: " in done.stderr
    content = json.loads((tmp_path / "evaluation.json").read_text(encoding="utf-8"))
    assert content["data"] == folder.name
    assert content["splits"] == 2
    assert content["shots"] == [1, 3]
    assert content["protocols"]["few-shot"]["kineme"]["1 shot"]["accuracy"]["mean"] == 1.0
    assert (tmp_path / "evaluation.html").read_text(encoding="utf-8").startswith("<!doctype html>")


def test_protocols_splits_shots_and_seed_are_heard(folder, tmp_path):
    done = run(
        folder, "--protocol", "few-shot", "--method", "euclidean", "--splits", 3, "--shots", 2, "--seed", 9,
        "--jobs", 1, "--out", tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "evaluation.json").read_text(encoding="utf-8"))
    assert (content["splits"], content["shots"], content["seed"]) == (3, [2], 9)
    assert list(content["protocols"]) == ["few-shot"]
    assert len(content["protocols"]["few-shot"]["euclidean"]["2 shots"]["accuracy"]["by_split"]) == 3


def test_recordings_without_times_are_evaluated_with_the_step_between_samples(tmp_path, make_movement):
    table = ["label,frame,x,y"]
    for k, label in enumerate(("wave", "point")):
        (tmp_path / "read" / label).mkdir(parents=True)
        for i in range(3):
            _, x = make_movement([k, i], n_samples=30)
            rows = [f"{frame},{a},{b}" for frame, (a, b) in enumerate(x.tolist())]
            (tmp_path / "read" / label / f"{i}.csv").write_text("\n".join(["frame,x,y", *rows]))
            table += [f"{label},{row}" for row in rows]
    (tmp_path / "one.csv").write_text("\n".join(table))
    how = ("--protocol", "few-shot", "--method", "euclidean", "--jobs", 1, "--quick", "--out", tmp_path / "out")
    refused = run(tmp_path / "read", *how)
    assert refused.returncode == 1
    assert "--units" in refused.stderr
    done = run(tmp_path / "read", *how, "--units", 0.01)
    assert done.returncode == 0, done.stderr
    one = run(tmp_path / "one.csv", *how, "--units", 0.01, "--every", 30)
    assert one.returncode == 0, one.stderr
    alone = run("lasa", *how, "--units", "ms")
    assert alone.returncode == 2
    assert "expected --units with recordings, got it with lasa alone" in alone.stderr


@pytest.mark.soak
def test_data_that_are_not_there_are_one_line_and_exit_status_1(tmp_path):
    done = run(tmp_path / "nothing", "--out", tmp_path / "out", by=commands.start)
    assert done.returncode == 1
    assert done.stderr.startswith("kineme: expected lasa, lasa-letters, a folder or a file, found nothing at")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_one_class_is_one_line_and_exit_status_1(folder, tmp_path):
    (tmp_path / "wave").mkdir()
    for path in (folder / "wave").glob("*.csv"):
        (tmp_path / "wave" / path.name).write_bytes(path.read_bytes())
    done = run(tmp_path)
    assert done.returncode == 1
    assert "at least two folders of at least two recordings" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [("--protocol", "guess"), ("--method", "oracle"), ("--splits", 0), ("--shots", 0), ("--jobs", 0), ("--seed", -1)],
)
def test_options_that_make_no_sense_are_a_usage_error(folder, arguments):
    done = run(folder, *arguments)
    assert done.returncode == 2
    assert arguments[0] in done.stderr


def test_data_are_asked_for():
    assert run().returncode == 2


@pytest.fixture(scope="module")
def archives(tmp_path_factory, make_movement):
    """Two archives of 3 people, 2 classes and 3 movements of each; the second is in space."""
    folder = tmp_path_factory.mktemp("archives")
    for name, n_dims in (("plane", 2), ("space", 3)):
        made = [(make_movement([k, 0], n_dims, 50)[1] * (1 + 0.1 * i), k, i) for k in (0, 1) for i in range(9)]
        np.savez(
            folder / f"{name}.npz",
            positions=np.concatenate([x for x, _, _ in made]),
            times=np.tile(np.linspace(0, 2, 50), len(made)),
            offsets=np.arange(len(made) + 1) * 50,
            labels=np.array(["wave", "point"])[[k for _, k, _ in made]],
            people=np.array(["ann", "bob", "cy"])[[i % 3 for _, _, i in made]],
        )
    return folder


@pytest.mark.soak
def test_several_data_sets_have_a_folder_each_and_a_table_and_a_diagram_together(archives, tmp_path):
    methods = [part for name in ("kineme", "euclidean", "plus-cloud") for part in ("--method", name)]
    protocols = [part for name in ("user-dependent", "user-independent") for part in ("--protocol", name)]
    done = run(
        archives / "plane.npz", archives / "space.npz", *methods, *protocols, "--splits", 3, "--shots", 1, "--jobs", 1,
        "--out", tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    for name in ("plane", "space"):
        content = json.loads((tmp_path / name / "evaluation.json").read_text(encoding="utf-8"))
        assert content["data"] == name
        assert list(content["protocols"]) == ["user-dependent", "user-independent"]
    results = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert results["columns"][:3] == ["data", "protocol", "condition"]
    assert {row[0] for row in results["rows"]} == {"plane", "space"}
    assert results["ranks"]["n_blocks"] == 2 * 2 * 3
    assert "Not all rivals ran everywhere" in results["conclusions"]["plane"]
    lines = (tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + len(results["rows"])
    assert (tmp_path / "ranks.png").read_bytes().startswith(b"\x89PNG")
    assert "Mean ranks" in done.stdout


def test_an_old_diagram_does_not_stay_beside_new_results(archives, tmp_path):
    (tmp_path / "ranks.png").write_bytes(b"old")
    arguments = ["--method", "kineme", "--protocol", "user-dependent", "--splits", 1, "--shots", 1, "--jobs", 1]
    done = run(archives / "plane.npz", *arguments, "--out", tmp_path, "--force")
    assert done.returncode == 0, done.stderr
    assert "Ranks need at least 3 methods" in done.stdout
    assert not (tmp_path / "ranks.png").exists()


def test_files_of_others_are_not_written_over_and_own_ones_are(tmp_path, monkeypatch):
    """Each command knows its own results, and those of the other are as foreign as a file of the user."""
    done = []
    monkeypatch.setattr("kineme_experiments.paper.run.reproduce", lambda *_: done.append(1) or Reproduction([], []))
    monkeypatch.setattr("kineme_experiments.evaluation.data.load_data", lambda *_: done.append(1) or 1 / 0)
    for name, content, command in (
        ("results.csv", "my precious", "evaluate"),
        ("results.json", '{"draw_by_draw": {}}', "evaluate"),
        ("results.json", '{"rows": []}', "reproduce"),
        ("results.json", "[", "reproduce"),
        ("figure-01.png", "mine", "reproduce"),
    ):
        out = tmp_path / f"{command}-{len(content)}"
        out.mkdir()
        (out / name).write_text(content)
        refused = commands.run(command, *["lasa"] * (command == "evaluate"), "--out", out)
        assert (refused.returncode, done) == (2, [])
        assert f"{name} is there and not of an earlier run; choose another folder with --out" in refused.stderr
    assert commands.run("reproduce", "--out", out, "--force").returncode == 0
    (out / "results.json").write_text('{"draw_by_draw": {}}')
    assert commands.run("reproduce", "--out", out).returncode == 0
    assert len(done) == 2


def test_data_sets_of_one_name_are_numbered(archives, tmp_path):
    arguments = ["--method", "euclidean", "--protocol", "user-dependent", "--splits", 1, "--shots", 1, "--jobs", 1]
    done = run(archives / "plane.npz", archives / "plane.npz", *arguments, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir() if path.is_dir()} == {"plane-1", "plane-2"}
    results = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert [row[0] for row in results["rows"]] == ["plane-1", "plane-2"]

"""``kineme why``: a movement over its nearest example, as a picture and in words."""

from __future__ import annotations

import numpy as np
import pytest
from commands import answer, run, start

import kineme


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "actions"
    with kineme.ActionLibrary(path, create=True) as library:
        library.learn(kineme.load_lasa(["CShape", "NShape", "Angle"]))
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two movements in one file: a C, and an N with a dent."""
    path = tmp_path_factory.mktemp("asked") / "two.csv"
    c, n = kineme.load_lasa(["CShape"])[3], kineme.load_lasa(["NShape"])[2]
    dent = np.exp(-0.5 * ((np.linspace(0, 1, len(n.times)) - 0.5) / 0.05) ** 2)
    rows = [(i, *row) for i, (t, x) in enumerate(((c.times, c.positions), (n.times, n.positions + 8 * dent[:, None])))
            for row in np.column_stack((t, x))]  # fmt: skip
    np.savetxt(path, rows, delimiter=",", header="movement,time,x,y", comments="", fmt="%.9g")
    return path


def test_a_picture_and_a_sentence(folder, recording, tmp_path):
    done = run("why", recording, "-l", folder, "-o", tmp_path / "why.png")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("two.csv 0: ")  # as `kineme recognize` calls it
    assert "CShape" in done.stdout
    assert "This is the first of 2 movements; choose another with --index" in done.stdout
    assert "the first of" not in run("why", recording, "-l", folder, "--index", 0).stdout
    assert (tmp_path / "why.png").read_bytes().startswith(b"\x89PNG")
    again = run("why", recording, "-l", folder, "-o", tmp_path / "why.png")
    assert again.returncode == 2
    assert "write over it with --force" in again.stderr


def test_the_second_movement_says_where_its_dent_is(folder, recording):
    data = answer("why", recording, "-l", folder, "--index", 1)["explanation"]
    assert data["nearest"]["label"] == "NShape"
    assert data["nearest"]["from"] > 0.2
    assert data["nearest"]["to"] < 0.8
    assert data["nearest"]["largest_difference"] > data["nearest"]["similarity"] * 0.1
    assert data["in_words"].startswith(data["answer"])


def test_arrays_of_numbers_are_one_line_each(folder, recording):
    lines = run("why", recording, "-l", folder, "--json").stdout.splitlines()
    assert len(lines) < 700  # a pair of numbers each, of three paths
    assert max(map(len, lines)) > 2000  # all differences


def test_a_movement_that_is_not_there_is_refused(folder, recording):
    done = run("why", recording, "-l", folder, "--index", 2)
    assert done.returncode == 2
    assert "expected less than 2 movements, got 2" in done.stderr


@pytest.mark.soak
def test_the_command_runs_by_itself(folder, recording):
    done = start("why", recording.name, "-l", folder, cwd=recording.parent)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""

"""Recordings piece by piece are those that are read at once."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme.io.lerobot import read as lerobot_read
from kineme.io.reading.pieces import is_episodic, read_pieces
from kineme.io.reading.recordings import HowToRead, NameRule
from kineme.io.records import Problem
from kineme.movements.tables.layout import Layout
from lerobot_sets import write_v2, write_v3

LENGTHS = (20, 30, 25, 40, 22)


@pytest.mark.parametrize("write", [write_v2, write_v3])
@pytest.mark.parametrize("columns", [None, "action"])
def test_parts_of_a_data_set_are_its_episodes(tmp_path, monkeypatch, write, columns):
    folder = write(tmp_path / "set", LENGTHS)
    monkeypatch.setattr(lerobot_read, "_NUMBERS", 3 * 45)
    pieces = list(read_pieces([folder], HowToRead(Layout(columns=columns), NameRule())))
    assert len(pieces) == 3
    whole = kineme.read_recordings(folder, columns=columns)
    assert [source.name for piece in pieces for source in piece.sources] == [one.name for one in whole.sources]
    assert [source.label for piece in pieces for source in piece.sources] == whole.labels.tolist()
    for name in ("positions", "times"):
        parts = [getattr(piece.demonstrations, name) for piece in pieces]
        np.testing.assert_array_equal(np.concatenate(parts), getattr(whole.demonstrations, name))


def test_some_episodes_are_one_part(tmp_path):
    folder = write_v3(tmp_path / "set", LENGTHS)
    (piece,) = read_pieces([folder], HowToRead(Layout(), NameRule()), places=["episode 3", "episode 1"])
    assert [source.place for source in piece.sources] == ["episode 1", "episode 3"]


def test_an_archive_of_data_sets_and_files_is_read_on_when_one_of_them_cannot_be(tmp_path):
    write_v3(tmp_path / "set", LENGTHS)
    (tmp_path / "bad.csv").write_text("no,recording\n")
    (tmp_path / "good.csv").write_text("time,x\n" + "".join(f"{0.1 * k},{k**2}\n" for k in range(10)))
    assert is_episodic(tmp_path / "set")
    assert not is_episodic(tmp_path)
    pieces = list(read_pieces([tmp_path], HowToRead(Layout(), NameRule())))
    problems = [piece for piece in pieces if isinstance(piece, Problem)]
    assert [problem.file for problem in problems] == ["bad.csv"]
    names = [source.name for piece in pieces if not isinstance(piece, Problem) for source in piece.sources]
    assert names == ["good.csv", *(f"set#episode {k}" for k in range(5))]


def test_a_feature_that_is_not_there_is_said(tmp_path):
    folder = write_v3(tmp_path / "set", LENGTHS)
    (problem,) = read_pieces([folder], HowToRead(Layout(columns="observation.torque"), NameRule()))
    assert "observation.torque" in problem.reason

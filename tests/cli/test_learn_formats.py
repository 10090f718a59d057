"""The same recordings as MATLAB, Parquet and CSV files: learned once, whatever they come in."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from commands import answer

import kineme
from kineme.datasets import lasa
from lerobot_sets import write_v3

SHAPES = ["CShape", "GShape"]


def _columns(demos):
    return {
        "movement": np.repeat(np.arange(len(demos)), demos.lengths),
        "action": np.repeat(demos.labels.astype(str), demos.lengths),
        "time": demos.times,
        "x": demos.positions[:, 0],
        "y": demos.positions[:, 1],
    }


def _as_matlab(path, demos):
    path.mkdir()
    for shape in SHAPES:
        shutil.copy(lasa._resources()[shape], path / f"{shape}.mat")


def _as_parquet(path, demos):
    import pyarrow
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table(_columns(demos)), path)


def _as_long_csv(path, demos):
    columns = _columns(demos)
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]) + "\n")


WRITERS = {"mat": _as_matlab, "demos.parquet": _as_parquet, "demos.csv": _as_long_csv}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("formats")
    for name, write in WRITERS.items():
        write(path / name, kineme.load_lasa(SHAPES))
    return path


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_library(folder, name, tmp_path):
    learned = answer("learn", folder / name, "-l", tmp_path / "actions")
    assert (learned["added"], learned["problems"]) == (14, [])
    assert sorted(learned["symbols"]) == SHAPES
    with kineme.ActionLibrary(tmp_path / "actions", read_only=True) as library:
        for shape in SHAPES:
            stored, expected = library.movements(shape), kineme.load_lasa([shape])
            np.testing.assert_allclose(stored.positions, expected.positions, atol=1e-5)


def test_what_comes_in_another_format_is_known(folder, tmp_path):
    learned = answer("learn", *(folder / name for name in WRITERS), "-l", tmp_path / "actions")
    assert (learned["added"], learned["duplicates"], learned["movements"]) == (14, 28, 14)


def test_columns_by_numbers_are_named(folder, tmp_path):
    """Numbers count from 0 over all that a file has; which columns these are is said by every command that reads."""
    write_v3(tmp_path / "set")
    for source, numbers, names in (
        (folder / "demos.csv", "3,4", "['x', 'y']"),
        (tmp_path / "set", "0,4", "['observation.state.shoulder_pan.pos', 'action.elbow_flex.pos']"),
    ):
        library = tmp_path / f"{source.name}-actions"
        sentence = f"read the columns of these numbers, {names}: counted from 0, over all of a file"
        by_task = ("--label-by", "task") if source.name == "set" else ()
        for command in (
            ("inspect",),
            ("learn", "-l", library),
            ("recognize", "-l", library),
            ("annotate", "-l", library),
        ):
            said = answer(*command, source, "--columns", numbers, *(by_task if command[0] == "learn" else ()))
            assert said["notes"].count(sentence) == 1
    assert not [
        note for note in answer("inspect", folder / "demos.csv", "--columns", "x,y")["notes"] if "numbers" in note
    ]

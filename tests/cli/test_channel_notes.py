"""The shell says where recordings have other channels than a library, and refuses other kinds."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from commands import answer, run

import kineme


def _table(path, heads, bend, n=60):
    u = np.linspace(0, 1, n)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    columns = {heads[0]: s, heads[1]: bend * np.sin(np.pi * u), heads[2]: np.sin(2 * np.pi * u) * (bend > 1)}
    pd.DataFrame({"t": 2 * u} | columns).to_csv(path, index=False)


@pytest.fixture
def folder(tmp_path):
    for label, bend in (("low", 0.3), ("high", 1.5)):
        (tmp_path / "shown" / label).mkdir(parents=True)
        for k in range(2):
            _table(tmp_path / "shown" / label / f"{k}.csv", ("x [m]", "y [m]", "z [m]"), bend + 0.05 * k)
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(kineme.read_recordings(tmp_path / "shown").demonstrations)
    return tmp_path


@pytest.mark.parametrize("command", ["recognize", "annotate"])
def test_names_and_units_that_differ_are_said(folder, command):
    asked = folder / "asked.csv"
    _table(asked, ("hand_x [mm]", "hand_y [mm]", "hand_z [mm]"), 1.5)
    told = answer(command, asked, "--library", folder / "actions")
    names, units = told["notes"]
    assert names.startswith("Columns are compared in their order: hand_x [mm], hand_y [mm], hand_z [mm] of the record")
    assert units.startswith(
        "Units are converted: hand_x [mm] in mm, hand_y [mm] in mm, hand_z [mm] in mm in the record"
    )
    assert ", x [m] in m" in units
    shown = run(command, asked, "--library", folder / "actions")[1]
    assert "Columns are compared in their order" in " ".join(shown.split())
    _table(asked, ("x [m]", "y [m]", "z [m]"), 1.5)
    assert answer(command, asked, "--library", folder / "actions")["notes"] == []
    _table(asked, ("x", "y [m]", "z [m]"), 1.5)
    (unsaid,) = answer(command, asked, "--library", folder / "actions")["notes"]
    assert unsaid == "The recordings do not say the unit of x, which is taken for that of the library"


def _refusal(command, folder, heads):
    """What the command says of a recording with these heads, on one line."""
    _table(folder / "asked.csv", heads, 1.5)
    _, out, err = run(command, folder / "asked.csv", "--library", folder / "actions")
    return " ".join((out + err).split())


@pytest.mark.parametrize("command", ["recognize", "annotate"])
def test_other_kinds_are_refused(folder, command):
    said = _refusal(command, folder, ("joint1", "joint2", "joint3"))
    assert "recorded as x [m] (position), y [m] (position), z [m] (position)" in said
    assert "got joint1 (angle)" in said


@pytest.mark.parametrize("command", ["recognize", "annotate"])
def test_other_names_are_refused_unless_columns_are_chosen_by_their_numbers(folder, command):
    said = _refusal(command, folder, ("elbow [mm]", "wrist [mm]", "hip [mm]"))
    assert " of the columns ['x [m]', 'y [m]', 'z [m]']" in said
    assert "got ['elbow [mm]', 'wrist [mm]', 'hip [mm]']" in said
    told = answer(command, folder / "asked.csv", "--library", folder / "actions", "--columns", "1,2,3")
    assert "in mm in the recordings, x [m] in m" in told["notes"][0]

"""Data frames as pandas writes them to JSON and CSV, with dates, durations and times of day as texts."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import kineme

U = np.linspace(0, 1, 30)
FRAME = pd.DataFrame({"t": U, "x": np.sin(3 * U), "y": U**2})


def _same(path, **layout):
    (movement,) = kineme.read_recordings(path, **layout).demonstrations
    np.testing.assert_allclose(movement.positions, FRAME[["x", "y"]], atol=1e-9)
    np.testing.assert_allclose(movement.times - movement.times[0], U, atol=2e-6)


@pytest.mark.parametrize("orient", ["columns", "index", "records", "split", "table"])
def test_every_orient_of_json_is_read(tmp_path, orient):
    FRAME.to_json(tmp_path / "a.json", orient=orient)
    _same(tmp_path / "a.json")
    dated = FRAME.assign(t=pd.to_datetime(1.7e9 + U, unit="s"))
    dated.to_json(tmp_path / "a.json", orient=orient, date_format="iso", date_unit="us")
    _same(tmp_path / "a.json")
    lasting = FRAME.assign(t=pd.to_timedelta(U, unit="s"))
    lasting.to_json(tmp_path / "a.json", orient=orient, date_format="iso", date_unit="us")
    _same(tmp_path / "a.json")


@pytest.mark.parametrize("orient", ["columns", "index", "split"])
def test_an_index_is_a_column_and_one_of_dates_the_times(tmp_path, orient):
    FRAME.set_index("t").to_json(tmp_path / "a.json", orient=orient)
    with pytest.raises(kineme.errors.KinemeError, match="'index', 'x', 'y'"):
        kineme.read_recordings(tmp_path / "a.json")
    _same(tmp_path / "a.json", time="index")
    dated = FRAME.set_index(pd.to_datetime(1.7e9 + U, unit="s")).drop(columns="t")
    dated.to_json(tmp_path / "a.json", orient=orient, date_format="iso", date_unit="us")
    _same(tmp_path / "a.json")


def test_values_alone_say_no_times(tmp_path):
    FRAME.to_json(tmp_path / "a.json", orient="values")
    with pytest.raises(kineme.errors.KinemeError, match="expected times beside the positions"):
        kineme.read_recordings(tmp_path / "a.json")


@pytest.mark.parametrize(
    "entries",
    [
        {"columns": ["t", "x"], "index": [0, 1], "data": [[0, 1], [1]]},
        {"columns": ["t", "x"], "index": [0, 1], "data": [0, 1]},
        {"columns": 3, "index": [0, 1], "data": [[0, 1], [1, 2]]},
        {"columns": ["t", "x"], "index": 4, "data": [[k, k] for k in range(9)]},
        {"columns": [], "index": [], "data": []},
        {"t": {"0": "soon", "1": "later"}, "x": {"0": 0, "1": 1}},
        {"t": {}, "x": {}},
    ],
)
def test_what_is_no_frame_is_refused(tmp_path, entries):
    (tmp_path / "a.json").write_text(json.dumps(entries))
    with pytest.raises(kineme.errors.KinemeError, match="expected"):
        kineme.read_recordings(tmp_path / "a.json")


@pytest.mark.parametrize(
    "stamps",
    [
        pd.to_timedelta(U, unit="s").astype(str),
        pd.to_timedelta(U + 90_000, unit="s").astype(str),
        [f"12:30:{u + 10:09.6f}" for u in U],
        [f"12:30:{u + 10:09.6f}".replace(".", ",") for u in U],
        [f"{'23:59' if u < 0.5 else '00:00'}:{(u + 59.5) % 60:09.6f}" for u in U],
    ],
    ids=["duration", "days", "clock", "comma", "midnight"],
)
def test_times_of_day_and_durations_are_times(tmp_path, stamps):
    FRAME.assign(t=list(stamps)).to_csv(tmp_path / "a.csv", index=False)
    _same(tmp_path / "a.csv")
    demos = kineme.Demonstrations.of(FRAME.assign(t=list(stamps)))
    np.testing.assert_allclose(demos.durations, 1.0, atol=1e-5)

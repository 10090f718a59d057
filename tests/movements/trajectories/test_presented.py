"""Movements as a table of pandas, as a picture, and as a notebook shows them."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import kineme
from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel

RAGGED = kineme.Demonstrations.from_arrays(
    [np.random.default_rng(n).random((n, 2)) for n in (9, 5, 7)],
    labels=["wave", "<script>alert(1)</script>", "wave"],
    times=[np.arange(n) * 20.0 for n in (9, 5, 7)],
)


def test_pandas_has_every_sample_and_gives_the_movements_back():
    """Steps of 20 s stay seconds: the head of the times says the unit."""
    pandas = pytest.importorskip("pandas")
    table = RAGGED.to_pandas()
    assert isinstance(table, pandas.DataFrame)
    assert list(table) == ["movement", "label", "time [s]", "x", "y"]
    assert table.groupby("movement").size().tolist() == [9, 5, 7]
    back = kineme.Demonstrations.of(table)
    np.testing.assert_array_equal(back.positions, RAGGED.positions)
    np.testing.assert_array_equal(back.times, RAGGED.times)
    np.testing.assert_array_equal(back.labels, RAGGED.labels)


def test_pandas_has_the_columns_that_were_recorded_with_their_units():
    pandas = pytest.importorskip("pandas")
    u = np.linspace(0, 1, 30)
    turning = kineme.orientation.exp(np.outer(u, [0, 0, 2.0]))
    frame = pandas.DataFrame({"t": u, "x [mm]": u**2, "gripper": np.round(u)})
    frame[["qx", "qy", "qz", "qw"]] = turning[:, [1, 2, 3, 0]]
    demos = kineme.Demonstrations.of(frame)
    table = demos.to_pandas()
    assert list(table)[3:] == ["x [mm]", "gripper", "qx", "qy", "qz", "qw"]
    back = kineme.Demonstrations.of(table)
    assert back.channels == demos.channels
    np.testing.assert_array_equal(back.recorded, demos.recorded)
    # of an export whose heads say no unit
    named = demos.of_movements(
        demos.movements.__class__(
            u[:, None] ** 2, np.array([0, 30]), np.ones(1), dimensions=("x",),
            channels=(Channel("x", "position", ("x",), "mm"),),
        )
    )  # fmt: skip
    assert list(named.to_pandas())[-1] == "x [mm]"


def test_pandas_is_asked_for_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        kineme.errors.DataError, match="expected the package pandas for a data frame; pip install pandas"
    ):
        RAGGED.to_pandas()


def test_nothing_to_draw_is_said():
    primitives = kineme.DMP().learn(np.random.default_rng(0).random((3, 5, 1)))[[]]
    with pytest.raises(TrajectoryError, match="expected at least one movement to draw, got none"):
        primitives.plot()


def test_a_notebook_shows_a_row_for_each_label_and_runs_nothing():
    shown = RAGGED._repr_html_()
    assert "<script" not in shown
    assert "<td>2</td><td>7 to 9</td><td>120 to 160</td>" in shown
    assert '<th scope="row">&lt;script&gt;' in shown
    many = kineme.Demonstrations.from_arrays(np.random.default_rng(0).random((30, 5, 1)), labels=range(30))
    assert many._repr_html_().count("<tr>") == 1 + 20
    assert "The first 20 of 30 labels." in many._repr_html_()


def test_a_picture_holds_movements_of_unequal_length():
    figure = RAGGED.plot()
    drawn = {tuple(line.get_xdata()) for axes in figure.axes for line in axes.lines}
    for movement in RAGGED:
        assert tuple(movement.times) in drawn
        assert tuple(movement.positions[:, 0]) in drawn


@pytest.mark.parametrize("kind", ["recordings", "segmentation", "rollout"])
def test_whatever_holds_movements_is_shown_alike(kind, tmp_path):
    movement = kineme.load_lasa(["CShape"])[0]
    if kind == "recordings":
        kineme.write_movement(tmp_path / "a.csv", {"times": movement.times, "positions": movement.positions})
        held = kineme.read_recordings(tmp_path)
    elif kind == "segmentation":
        held = kineme.segment(movement)
    else:
        held = kineme.DMP().learn(movement).rollout()
    assert len(held.to_pandas()) == len(kineme.Demonstrations.of(held).positions)
    assert "<table>" in held._repr_html_()
    assert held.plot().axes or held.plot().subfigs

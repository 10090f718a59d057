"""Data frames are movements: their time is found by its name, as in files, and is never a dimension."""

# ruff: noqa: E501 - one case, one line, the message whole

from __future__ import annotations

import datetime
import decimal
import subprocess
import sys

import numpy as np
import pytest

import kineme
from kineme import Demonstrations
from kineme.errors import TrajectoryError

pd = pytest.importorskip("pandas")

T = np.linspace(0.0, 2.0, 50)
X, Y = np.sin(T), np.cos(3 * T)


def _frame(**columns):
    return pd.DataFrame({"time": T, "x": X, "y": Y, **columns})


def _check(demos, n=1):
    assert len(demos) == n
    assert demos.dimensions == ("x", "y")
    np.testing.assert_array_equal(demos[0].positions, np.column_stack((X, Y)))
    np.testing.assert_allclose(demos[0].times - demos[0].times[0], T, atol=1e-6)


SINGLE = {
    "a column": _frame(),
    "an index with a name": _frame().set_index("time"),
    "milliseconds by name": pd.DataFrame({"x": X, "y": Y, "t [ms]": 1e3 * T}),
    "nanoseconds by size": pd.DataFrame({"stamp": (1e9 * T).astype(np.int64), "x": X, "y": Y}),
    "dates": pd.DataFrame({"timestamp": pd.Timestamp("2024-05-06") + pd.to_timedelta(T, "s"), "x": X, "y": Y}),
    "dates of a zone": pd.DataFrame({"time": pd.Timestamp("2024-05-06", tz="CET") + pd.to_timedelta(T, "s"), "x": X, "y": Y}),
    "dates as texts": pd.DataFrame({"time": [(datetime.datetime(2024, 5, 6) + datetime.timedelta(seconds=t)).isoformat() for t in T], "x": X, "y": Y}),
    "an index that counts, with a name": _frame().rename_axis("part"),
    "dates in the index": pd.DataFrame({"x": X, "y": Y}, index=pd.Timestamp("2024-05-06") + pd.to_timedelta(T, "s")),
    "durations in the index": pd.DataFrame({"x": X, "y": Y}, index=pd.to_timedelta(T, "s")),
    "beside counters, texts and velocities": _frame(frame=np.arange(50), note="a", v_x=X, on=True),
    "with missing numbers allowed": _frame().astype({"x": "Float64"}),
}  # fmt: skip


@pytest.mark.parametrize("frame", SINGLE.values(), ids=SINGLE)
def test_time_is_found_by_its_name_and_is_no_dimension(frame):
    before = frame.copy()
    _check(Demonstrations.of(frame))
    _check(Demonstrations.of([frame, frame]), n=2)
    pd.testing.assert_frame_equal(frame, before)


def test_what_was_taken_is_said():
    assert repr(Demonstrations.of(_frame())) == "Demonstrations(1 movements, 2 dims (x, y), 50 samples each)"
    assert kineme.preprocess(_frame(), [kineme.Smooth(), kineme.Resample(20)]).dimensions == ("x", "y")
    assert Demonstrations.of([_frame(), _frame()])[[1]].dimensions == ("x", "y")


def test_frames_have_the_order_and_the_units_of_the_first():
    first, other = _frame().rename(columns={"x": "x [m]", "y": "y [m]"}), _frame()[["y", "time", "x"]]
    _check(Demonstrations.of([_frame(), other]), n=2)
    millimeters = pd.DataFrame({"y [mm]": 1000 * Y, "time": T, "x [mm]": 1000 * X})
    both = Demonstrations.of([first, millimeters])
    np.testing.assert_allclose(both[0].positions, both[1].positions)
    with pytest.raises(TrajectoryError, match=r"data frame 1: expected 'x' in 'm', as the others have it, got no unit"):
        Demonstrations.of([first, other])


def test_frames_are_learned_recognized_and_cut():
    demos = Demonstrations.of([_frame(), _frame(x=Y)])
    frames = [_frame(), _frame(x=Y)]
    np.testing.assert_array_equal(kineme.DMP().learn(frames).weights, kineme.DMP().learn(demos).weights)
    recognizer = kineme.Recognizer().fit(frames, ["a", "b"])
    assert recognizer.predict(frames).tolist() == ["a", "b"]
    assert len(kineme.segment(_frame(), by="speed", cover=True)) >= 1


def test_a_long_frame_is_told_apart_by_its_columns():
    parts = [_frame(demo=k, gesture=label) for k, label in enumerate(["wave", "point", "wave"])]
    long = pd.concat(parts).sample(frac=1, random_state=0).sort_values("time")
    _check(demos := Demonstrations.of(long), n=3)
    by_demo = {one.name: one.label for one in demos}
    assert by_demo == {"0": "wave", "1": "point", "2": "wave"}
    _check(Demonstrations.of(pd.concat(parts).set_index(["demo", "time"])), n=3)
    assert Demonstrations.of(pd.concat(parts).astype({"gesture": "category"})).labels.tolist() == [
        "wave",
        "point",
        "wave",
    ]


def test_groups_of_a_frame_are_movements():
    groups = pd.concat([_frame(demo=0, label="wave"), _frame(demo=1, label="point")]).groupby("demo")
    for movements in (groups, list(groups)):
        demos = Demonstrations.of(movements)
        _check(demos, 2)
        assert demos.labels.tolist() == ["wave", "point"]
    clocked = pd.concat([_frame(demo=0), _frame(demo=1)]).rename(columns={"time": "clock"}).groupby("demo")
    _check(Demonstrations.from_dataframe(clocked, time="clock"), 2)


def test_labels_that_are_numbers_stay_numbers():
    demos = Demonstrations.of([_frame(label=0), _frame(label=3)])
    assert demos.labels.tolist() == [0, 3]
    assert demos.labels.dtype.kind == "i"


def test_what_names_do_not_tell_is_said():
    frame = pd.DataFrame({"clock": 1e3 * T, "a": X, "b": Y, "who": "me"})
    demos = Demonstrations.from_dataframe(frame, time="clock", columns=["b", "a"], units="ms")
    assert demos.dimensions == ("b", "a")
    np.testing.assert_allclose(demos.times, T)
    np.testing.assert_array_equal(demos.positions, np.column_stack((Y, X)))
    even = Demonstrations.from_dataframe(frame[["a", "b"]], units=0.04)
    np.testing.assert_allclose(even.times, 0.04 * np.arange(50))


REFUSED = {
    "no time": (pd.DataFrame({"a": X, "b": Y}), r"data frame 0: expected one column of times, named as one of elapsed, epoch, .*, got the columns \['a', 'b'\]; say which with time=, .* \(of Demonstrations.from_dataframe\)"),
    "no names": (pd.DataFrame(np.column_stack((T, X))), r"expected one column of times, .*, got the columns \['0', '1'\]"),
    "two times": (_frame(timestamp=T**2), r"expected one column of times, .* got the columns \['time', 'x', 'y', 'timestamp'\]"),
    "no coordinates": (_frame()[["time"]], r"expected a column of times and at least one of positions, got one column"),
    "missing numbers": (_frame(x=[np.nan, *X[1:]]), r"trajectory 0: expected finite positions, got \[nan, 1.0\] at sample 0"),
    "no rows": (_frame()[:0], "expected samples, got a data frame without rows"),
    "time that stands still": (_frame(time=0.0), "trajectory 0: expected strictly increasing times"),
    "other coordinates": ([_frame(), _frame().rename(columns={"y": "z"})], r"data frame 1: expected the coordinates \['x', 'y'\] as in data frame 0, got \['x', 'z'\]"),
    "numbers that are words": (_frame().astype(str), r"expected numbers in the column 'x', got '0.0' in row 0; repair it, as by frame.astype"),
    "one column alone": (_frame()["x"], r"expected movements as a list of .*, got Series; pass its numbers, series.to_numpy\(\)"),
    "times that are words": (_frame(time="now"), "expected numbers or dates in the column of times 'time', got the text 'now'"),
}  # fmt: skip


@pytest.mark.parametrize(("frame", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_understood_is_refused(frame, message):
    with pytest.raises(TrajectoryError, match=message):
        kineme.DMP().learn(frame)


def test_arrays_are_no_data_frames():
    with pytest.raises(TrajectoryError, match="expected data frames, got ndarray at index 1"):
        Demonstrations.from_dataframe([_frame(), np.ones((9, 2))])


def test_frames_of_another_package_need_names_only():
    class Column:
        def __init__(self, values):
            self.values = values

        def to_numpy(self):
            return self.values

    class Frame(dict):  # as polars has them
        columns = ("t", "x", "y")

        def to_numpy(self):
            raise AssertionError

    _check(Demonstrations.of(Frame(t=Column(T), x=Column(X), y=Column(Y))))


def test_pandas_is_not_imported():
    code = "import sys, numpy, kineme\nkineme.DMP().learn([numpy.arange(20.0) ** 2])\nprint('pandas' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


REPAIRABLE = {
    "a text among numbers": (["bad", *X[1:]], "expected numbers in the column 'x', got 'bad' in row 0"),
    "complex numbers": (X + 1j, "expected numbers in the column 'x', got .*j in row 0"),
}


@pytest.mark.parametrize(("column", "message"), REPAIRABLE.values(), ids=REPAIRABLE)
def test_a_coordinate_with_something_else_than_numbers_is_refused_not_left_out(column, message):
    with pytest.raises(TrajectoryError, match=message):
        Demonstrations.of(_frame(x=column))
    only_y = Demonstrations.from_dataframe(_frame(x=column), columns=["y"])
    np.testing.assert_array_equal(only_y.positions[:, 0], Y)


def test_dates_are_no_coordinates():
    with pytest.raises(TrajectoryError, match=r"expected numbers in the column 'x', got .*2024"):
        Demonstrations.from_dataframe(_frame(x=pd.date_range("2024-01-01", periods=50)), columns=["x"])


def test_decimals_are_numbers_and_objects_of_durations_are_times():
    _check(Demonstrations.of(_frame(x=[decimal.Decimal(float(x)) for x in X])))
    spans = pd.Series([datetime.timedelta(milliseconds=40 * k) for k in range(50)], dtype=object)
    np.testing.assert_allclose(Demonstrations.of(_frame(time=spans)).times, 0.04 * np.arange(50))


def test_labels_of_numbers_and_texts_are_texts():
    demos = Demonstrations.of(_frame(label=[1] * 25 + ["a"] * 25, trial=[1] * 25 + ["b"] * 25))
    assert demos.labels.tolist() == ["1", "a"]


def test_labels_that_are_fractions_stay_numbers():
    demos = Demonstrations.of(_frame(label=[0.5] * 25 + [2.0] * 25, trial=[1] * 25 + [2] * 25))
    assert demos.labels.tolist() == [0.5, 2.0]
    assert {type(label) for label in demos.labels.tolist()} == {float}


def test_numbers_that_are_written_as_texts_are_refused_and_codes_are_not():
    frame = pd.DataFrame({"time": np.arange(6.0), "x": [f"{k / 7:.3f}" for k in range(6)], "y": np.arange(6.0) ** 2})
    with pytest.raises(TrajectoryError, match=r"expected numbers in the column 'x'.*astype"):
        kineme.Demonstrations.of(frame)
    with pytest.raises(TrajectoryError, match=r"column of times 'time'.*astype"):
        kineme.Demonstrations.of(frame.astype({"time": str, "x": float}))
    codes = frame.assign(x=range(6), subject="07")
    assert kineme.Demonstrations.of(codes).dimensions == ("x", "y")


def test_movements_of_the_same_columns_in_other_orders_and_units_are_put_together():
    plain = {"t": T, "x [mm]": 1000 * X, "y [mm]": 1000 * Y}
    turned = {"t": T, "y [m]": Y, "x [m]": X}
    first, second = (kineme.Demonstrations.of(pd.DataFrame(one))[0] for one in (plain, turned))
    both = kineme.Demonstrations([first, second])
    assert both.channels == first.channels
    np.testing.assert_allclose(both[1].positions, both[0].positions, rtol=1e-12)
    np.testing.assert_allclose(kineme.Demonstrations.of([second, first])[1].recorded, second.recorded, rtol=1e-12)
    other = kineme.Demonstrations.of(pd.DataFrame({"t": T, "x [V]": X, "y [mm]": Y}))[0]
    with pytest.raises(TrajectoryError, match=r"expected 'x \[V\]' in 'mm'"):
        kineme.Demonstrations([first, other])
    assert (
        kineme.Demonstrations([first, kineme.Demonstrations.of(pd.DataFrame({"t": T, "a": X, "b": Y}))[0]]).channels
        is None
    )

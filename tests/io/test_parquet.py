"""Parquet: the same columns as in text, whatever their types."""

import io
import sys

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import kineme
from kineme.io.layout import Layout
from kineme.io.recordings import read_recordings_from_bytes

T = np.arange(6) / 100
X = T**2


def read(table, **options):
    sink = io.BytesIO()
    parquet.write_table(pa.table(table), sink)
    return read_recordings_from_bytes(sink.getvalue(), "a.parquet", Layout(**options))


@pytest.mark.parametrize(
    "column",
    [
        pa.array(T),
        pa.array(T.astype(np.float64)),
        pa.chunked_array([T[:2], T[2:]]),
    ],
)
def test_numbers_are_kept_to_the_last_bit(column):
    found = read({"time": column, "x": pa.array(X)}).demonstrations
    np.testing.assert_array_equal(found.times, T)
    np.testing.assert_array_equal(found.positions[:, 0], X)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_and_durations_count_in_their_own_unit(unit):
    since = (T * 1e9).round().astype(np.int64)
    dates = (np.datetime64("2024-05-06T07:08:09", "ns") + since.astype("m8[ns]")).astype(f"M8[{unit}]")
    found = read({"stamp": pa.array(dates), "x": X})
    assert found.detected[0][0][4:6] == ("ns", "dates")
    np.testing.assert_allclose(found.demonstrations.times - 1714979289, T, atol=3e-7)
    spans = read({"time": pa.array(since.astype("m8[ns]").astype(f"m8[{unit}]")), "x": X})
    np.testing.assert_allclose(spans.demonstrations.times, T, rtol=1e-12)


def test_names_may_be_numbers_or_a_dictionary_and_what_is_not_needed_is_not_read():
    names = pa.array(["wave"] * 4 + ["nod"] * 4).dictionary_encode()
    found = read(
        {"id": [1] * 4 + [2] * 4, "label": names, "time": np.tile(T[:4], 2), "x": np.arange(8), "list": [[1.0]] * 8}
    )
    assert [(one.place, one.label) for one in found.sources] == [("1", "wave"), ("2", "nod")]
    assert found.detected[0][0].ignored == ("list",)
    assert found.detected[0][0].columns == ("x",)


def test_missing_values_cost_their_movement_or_themselves():
    columns = {"demo": ["a"] * 6 + ["b"] * 6, "time": np.tile(T, 2), "x": pa.array([1.0, None, *range(10)])}
    found = read(columns)
    assert [one.place for one in found.sources] == ["b"]
    assert found.problems[0].reason == "movement a: expected finite positions, got [nan] at sample 1"
    assert read(columns, skip="sample").demonstrations.lengths.tolist() == [5, 6]
    whole = read({**columns, "x": pa.array([1, None, *range(10)], pa.int64())})
    assert [one.place for one in whole.sources] == ["b"]


def test_columns_of_something_else_are_refused_by_name():
    with pytest.raises(kineme.DataError, match=r"expected numbers in the column 'x', got .*list"):
        read({"time": T, "x": [[1.0]] * 6}, columns="x")


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(kineme.DataError, match=r"pip install 'kineme\[parquet\]'"):
        read_recordings_from_bytes(b"PAR1", "a.parquet", Layout())


@pytest.mark.parametrize("columns", [("time", "x"), ("label", "time", "x"), ("demo", "time", "x")])
def test_a_table_without_rows_is_refused(columns):
    with pytest.raises(kineme.DataError, match="expected samples, got a table without rows"):
        read({name: pa.array([], pa.float64()) for name in columns})

"""Parquet: the same columns as in text, whatever their types."""

import io
import sys

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import kineme
from kineme.io.tables.parquet import _texts
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

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
    demos = read({"time": column, "x": pa.array(X)}).demonstrations
    np.testing.assert_array_equal(demos.times, T)
    np.testing.assert_array_equal(demos.positions[:, 0], X)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_and_durations_count_in_their_own_unit(unit):
    since = (T * 1e9).round().astype(np.int64)
    dates = (np.datetime64("2024-05-06T07:08:09", "ns") + since.astype("m8[ns]")).astype(f"M8[{unit}]")
    recordings = read({"stamp": pa.array(dates), "x": X})
    assert recordings.detected[0][0][4:6] == ("ns", "dates")
    np.testing.assert_allclose(recordings.demonstrations.times - 1714979289, T, atol=3e-7)
    spans = read({"time": pa.array(since.astype("m8[ns]").astype(f"m8[{unit}]")), "x": X})
    np.testing.assert_allclose(spans.demonstrations.times, T, rtol=1e-12)


def test_names_may_be_numbers_or_a_dictionary_and_what_is_not_needed_is_not_read():
    names = pa.array(["wave"] * 4 + ["nod"] * 4).dictionary_encode()
    recordings = read(
        {"id": [1] * 4 + [2] * 4, "label": names, "time": np.tile(T[:4], 2), "x": np.arange(8), "list": [[1.0]] * 8}
    )
    assert [(source.place, source.label) for source in recordings.sources] == [("1", "wave"), ("2", "nod")]
    assert recordings.detected[0][0].ignored == ("list",)
    assert recordings.detected[0][0].columns == ("x",)


def test_missing_values_cost_their_movement_or_themselves():
    columns = {"demo": ["a"] * 6 + ["b"] * 6, "time": np.tile(T, 2), "x": pa.array([1.0, None, *range(10)])}
    recordings = read(columns, fill_gaps=0)
    assert [source.place for source in recordings.sources] == ["b"]
    assert recordings.problems[0].reason.startswith("movement a: expected a number in 'x', got nothing in 17 % of the")
    assert read(columns, skip="sample", fill_gaps=0).demonstrations.lengths.tolist() == [5, 6]
    of_integers = read({**columns, "x": pa.array([1, None, *range(10)], pa.int64())}, fill_gaps=0)
    assert [source.place for source in of_integers.sources] == ["b"]


def test_columns_of_something_else_are_refused_by_name():
    with pytest.raises(kineme.errors.DataError, match=r"expected numbers in the column 'x', got .*list"):
        read({"time": T, "x": [["one"]] * 6}, columns="x")


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "kineme.io.tables.parquet")  # the reader, which is imported with the package
    with pytest.raises(kineme.errors.DataError, match=r"pip install 'kineme\[parquet\]'"):
        read_recordings_from_bytes(b"PAR1", "a.parquet", Layout())


@pytest.mark.parametrize("columns", [("time", "x"), ("label", "time", "x"), ("demo", "time", "x")])
def test_a_table_without_rows_is_refused(columns):
    with pytest.raises(kineme.errors.DataError, match="expected samples, got a table without rows"):
        read({name: pa.array([], pa.float64()) for name in columns})


def test_names_of_bytes_are_decoded():
    names = pa.array([b"wave"] * 4 + ["n\u00f6d".encode()] * 4)
    assert tuple(read({"label": names, "time": np.tile(T[:4], 2), "x": np.arange(8)}).labels) == ("wave", "n\u00f6d")


@pytest.mark.parametrize("chunked", [False, True])
def test_names_may_be_missing_and_dictionaries_differ(chunked):
    names = pa.array(["wave"] * 4 + [None] * 4 + ["nod"] * 4)
    if chunked:
        names = pa.chunked_array([names[:6].dictionary_encode(), names[6:].dictionary_encode()])
    table = {"id": [1] * 4 + [2] * 4 + [3] * 4, "label": names, "time": np.tile(T[:4], 3), "x": np.arange(12)}
    recordings = read(table)
    assert {source.place: source.label for source in recordings.sources} == {"1": "wave", "2": None, "3": "nod"}


@pytest.mark.parametrize(
    ("column", "words"),
    [
        (pa.array([[1]] * 6), "expected names in 'label', got (list|struct)"),
        (pa.array([{"a": 1}] * 6), "expected names in 'label', got (list|struct)"),
        (pa.array([float("nan")] * 6), "expected names in 'label', got nan"),
    ],
)
def test_labels_that_are_no_names(column, words):
    with pytest.raises(kineme.errors.DataError, match=words):
        read({"label": column, "time": T, "x": X})


def test_columns_of_one_name_are_refused():
    sink = io.BytesIO()
    parquet.write_table(pa.Table.from_arrays([pa.array(T), pa.array(X), pa.array(-X)], ["time", "x", "x"]), sink)
    with pytest.raises(kineme.errors.DataError, match="expected columns of different names, got 'x' 2 times"):
        read_recordings_from_bytes(sink.getvalue(), "a.parquet", Layout())


def test_names_with_dots_are_names():
    recordings = read({"observation.time": T, "observation.state": X, "observation": X}, time="observation.time")
    assert recordings.demonstrations.n_dims == 2


def test_a_bomb_is_not_expanded(monkeypatch):
    n = 2**18
    columns = {"time": np.arange(n), "x": np.zeros(n), "beside": ["a" * 100] * n}
    sink = io.BytesIO()
    parquet.write_table(pa.table(columns), sink, compression="zstd")
    monkeypatch.setenv("KINEME_MAX_FILE_BYTES", str(len(sink.getvalue()) + 2**18))
    with pytest.raises(kineme.errors.DataError, match="KINEME_MAX_FILE_BYTES"):
        read_recordings_from_bytes(sink.getvalue(), "a.parquet", Layout(units="ms"))


def test_one_long_name_costs_its_own_length(monkeypatch):
    name, n = "x" * 2**16, 2000
    monkeypatch.setenv("KINEME_MAX_FILE_BYTES", str(2**20))
    recordings = read({"label": [name] * n, "time": np.arange(n) / 100, "x": np.zeros(n)}, units="s")
    assert tuple(recordings.labels) == (name,)


@pytest.mark.parametrize("which", [[0, 5], [-1, 0]])
def test_numbers_of_names_that_are_not_there_are_damage(which):
    """pyarrow reads such pages and does not look."""
    names = pa.DictionaryArray.from_arrays(pa.array(which), pa.array(["wave"]), safe=False)
    with pytest.raises(
        kineme.errors.DataError, match=r"expected names in 'label', got numbers of names that are not there: damaged"
    ):
        _texts(pa.chunked_array([names]), "label")


def test_lists_are_one_column_for_each_number_where_they_are_meant():
    state = pa.array(np.column_stack((X, T)).tolist(), pa.list_(pa.float32(), 2))
    recordings = read({"time": T, "q": state})
    assert recordings.demonstrations.dimensions == ("q.0", "q.1")
    np.testing.assert_array_equal(recordings.demonstrations.positions[:, 0], X.astype(np.float32))
    both = {"time": T, "q": state, "dq": state, "x": X}
    assert read(both).demonstrations.dimensions == ("x",)
    assert read(both, columns="dq").demonstrations.dimensions == ("dq.0", "dq.1")
    assert read(both, columns=["x", "q.1"]).demonstrations.dimensions == ("x", "q.1")
    del both["x"]
    with pytest.raises(kineme.errors.DataError, match=r"one column of lists, or plain columns, got dq, q; say which"):
        read(both)
    lerobot = {"observation.state": state, "action": state, "timestamp": T, "frame_index": range(6)}
    assert read(lerobot).demonstrations.dimensions == ("observation.state.0", "observation.state.1")


def test_structs_are_one_column_for_each_number_in_them():
    pose = [{"x": x, "at": {"y": 2 * x, "name": "a"}, "gripper": x > 0.001} for x in X.tolist()]
    for options in ({}, {"columns": ["pose.x", "pose.at.y", "pose.gripper"]}):
        (one,) = read({"time": T, "pose": pose}, **options).demonstrations
        assert [channel.name for channel in one.channels] == ["pose.x", "pose.at.y", "pose.gripper"]
        np.testing.assert_array_equal(one.recorded, np.column_stack((X, 2 * X, X > 0.001)))
    missing = read({"time": T, "pose": [None, *pose[1:]]}, skip="sample", fill_gaps=0)
    assert missing.demonstrations.lengths.tolist() == [5]


def test_a_row_of_lists_is_a_movement():
    table = {"t": [T, T[:0], T[:5]], "x": [X, X[:0], X[:5] + 1], "label": ["a", "b", "c"], "goal": [[1.0]] * 3}
    with pytest.raises(kineme.errors.DataError, match="as many values in 'goal' as in 't', row by row, got 1 and 6"):
        read(table)
    recordings = read(table, exclude="goal")
    assert [(source.place, source.label) for source in recordings.sources] == [("0", "a"), ("2", "c")]
    np.testing.assert_array_equal(recordings.demonstrations.positions[:, 0], [*X, *(X[:5] + 1)])


def test_times_of_day_and_an_index_of_dates_without_a_name_are_times():
    stamps = (1e9 * T).astype(np.int64)
    for kind in (pa.time32("ms"), pa.time64("us"), pa.time64("ns")):
        times = pa.array(stamps).cast(pa.time64("ns")).cast(kind)
        np.testing.assert_allclose(read({"time": times, "x": X}).demonstrations.times, T)
    dates = pa.array(stamps.astype("M8[ns]"))
    np.testing.assert_allclose(read({"x": X, "__index_level_0__": dates}).demonstrations.times, T)
    np.testing.assert_allclose(read({"t": 2 * T, "x": X, "__index_level_0__": dates}).demonstrations.times, 2 * T)


def test_lists_of_other_lengths_and_missing_ones_cost_their_samples():
    rows = [[1.0, 2.0], [1.0], None, [2.0, None], [3.0, 5.0], [4.0, 4.0], [5.0, 1.0], [6.0, 9.0]]
    table = {"time": np.arange(8) / 10, "q": pa.array(rows, pa.list_(pa.float64()))}
    recordings = read(table, skip="sample")
    assert recordings.demonstrations.lengths.tolist() == [5]
    with pytest.raises(kineme.errors.DataError, match="expected 2 numbers in 'q', got 1"):
        read(table)
    nested = pa.array([[[1.0, 2.0], [3.0, k]] for k in range(6)], pa.list_(pa.list_(pa.float64())))
    assert read({"time": T, "pose": nested}).demonstrations.n_dims == 4


def test_a_written_movement_has_the_heads_of_csv(tmp_path):
    rollout = kineme.DMP().learn(kineme.Trajectory(T, np.column_stack((T, X)))).rollout(n_samples=50)
    table = parquet.read_table(kineme.write_movement(tmp_path / "x.parquet", rollout))
    text = kineme.write_movement(tmp_path / "x.csv", rollout).read_text()
    assert table.schema.names == text.splitlines()[0].split(",")
    np.testing.assert_array_equal(table.column("v_y").to_numpy(), rollout.velocities[0, :, 1])
    assert {str(kind) for kind in table.schema.types} == {"double"}


def test_writing_without_pyarrow_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(kineme.errors.DataError, match=r"pip install 'kineme\[parquet\]'"):
        kineme.write_movement(tmp_path / "x.parquet", {"times": T, "positions": X[:, None]})
    assert not list(tmp_path.iterdir())

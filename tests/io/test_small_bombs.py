"""Files that would take minutes: lines of separators alone, and HDF5 whose samples were never written."""

import numpy as np
import pytest

import kineme
from kineme.movements.tables.layout import Layout
from limited_child import MIB, LimitedChild

SECONDS = 10.0  # a few tenths where nothing else runs; minutes without the bounds
HEAD = b"time,x,y\n0,1,2\n1,2,3\n"
#: Made where they are read: they are large.
TABLES = {
    "one line of separators": lambda: b"," * (40 * MIB),
    "a long line below others": lambda: HEAD + b";" * (40 * MIB),
    "a long line of one cell": lambda: HEAD + b'"' * (40 * MIB),
    "a wide line": lambda: b"," * 200_000 + b"\n" + b"0," * 3,
    "lines without numbers": lambda: b"time,x,y\n" + b",,\n" * (8 * MIB),
    "lines of nothing": lambda: b"\n" * (40 * MIB),
    "lines of comments": lambda: b"#\n" * (20 * MIB),
}


@pytest.fixture(scope="module")
def child():
    with LimitedChild(("kineme.io.reading.recordings",), memory=2048 * MIB, seconds=SECONDS) as process:
        yield process


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_nothing_are_refused_at_once(child, name):
    outcome = child.call("recordings_in_bytes:read_recordings_from_bytes", TABLES[name](), "a.csv", Layout())
    assert outcome.how == "refused", outcome
    assert len(str(outcome.what)) < 600


def test_many_lines_with_an_empty_cell_are_read_in_seconds_and_an_empty_column_is_left_aside(child):
    rows = b"".join(b"%d,,%d\n" % (k, k * k) for k in range(60_000))
    outcome = child.call("recordings_in_bytes:read_recordings_from_bytes", b"time,x,y\n" + rows, "a.csv", Layout())
    assert outcome.how == "done", outcome
    assert outcome.what.demonstrations.lengths.tolist() == [60_000]
    assert outcome.what.detected[0][0].ignored == ("x",)


def unwritten(file):
    for name in ("t", "x"):
        file.create_dataset(f"wave/{name}", (10**8,), "f8", chunks=(1024,), compression="gzip")


def unwritten_in_chunks_of_one(file):
    for k in range(100):
        for name in ("t", "x"):
            file.create_dataset(f"wave{k}/{name}", (2**16,), "f8", chunks=(1,))


def unwritten_in_one_piece(file):
    for name in ("t", "x"):
        file.create_dataset(f"wave/{name}", (2 * 10**8,), "f8")


def packed_twice(file):
    for name in ("t", "x"):
        file.create_dataset(f"wave/{name}", data=np.zeros(10**6), chunks=(10**6,), scaleoffset=3, compression="gzip")


@pytest.mark.parametrize("fill", [unwritten, unwritten_in_chunks_of_one, unwritten_in_one_piece, packed_twice])
def test_samples_that_were_never_written_are_not_read(child, fill, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        fill(file)
    assert (tmp_path / "a.h5").stat().st_size < MIB
    outcome = child.call("kineme:read_recordings", tmp_path / "a.h5")
    assert outcome.how == "refused", outcome
    assert "the others were never written" in outcome.what


def test_zeros_that_are_packed_are_not_expanded(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["fps"] = 100.0
        packed = {"chunks": (2**20,), "compression": "gzip", "compression_opts": 1}
        file.create_dataset("x", data=np.zeros(2**23 + 1), **packed)
        file.create_dataset("y", data=np.zeros(2**23 + 1), **packed)
    assert (tmp_path / "a.h5").stat().st_size < MIB
    with pytest.raises(kineme.errors.KinemeError, match="nearly all of which are alike"):
        kineme.read_recordings(tmp_path / "a.h5")


def test_a_data_set_that_is_written_in_parts_of_little_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    t = np.arange(20_000) / 100
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("wave/t", data=t, chunks=(100,), compression="gzip")
        file.create_dataset("wave/x", (20_000,), "f8", chunks=(100,), compression="gzip")[:5000] = t[:5000]
    (movement,) = kineme.read_recordings(tmp_path / "a.h5")
    np.testing.assert_array_equal(movement.positions[:5000, 0], t[:5000])


def test_rows_that_are_all_alike_are_not_expanded(child, tmp_path):
    pa = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    zeros = np.zeros(10**7)
    parquet.write_table(pa.table({"time": zeros, "x": zeros}), tmp_path / "a.parquet", compression="zstd")
    assert (tmp_path / "a.parquet").stat().st_size < MIB
    outcome = child.call("kineme:read_recordings", tmp_path / "a.parquet")
    assert outcome.how == "refused", outcome
    assert "which cannot differ" in outcome.what

"""What a file may expand to, for every format; and that nothing is read or believed that need not be."""

from __future__ import annotations

import io
import json
import struct
import warnings
import zipfile

import numpy as np
import pytest

import kineme
from kineme.io import limits
from kineme.io.limits import VARIABLE, max_file_bytes
from kineme.io.reading.recordings import read_recordings
from kineme.movements.tables.layout import Layout
from limited_child import MIB, LimitedChild
from recordings_in_bytes import read_recordings_from_bytes

T = np.arange(6) / 100
X = np.column_stack((T, T**2))
BODY = X.tobytes()


def read(data, name="a.npz", **options):
    return read_recordings_from_bytes(data, name, Layout(**options))


def npz(save=np.savez, **arrays):
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return buffer.getvalue()


def archive(*members):
    """A zip archive of (name, bytes), with right checksums and perhaps names that occur twice."""
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        warnings.simplefilter("ignore")
        for name, content in members:
            file.writestr(name, content)
    return buffer.getvalue()


def entry(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def headed(shape="(6, 2)", descr="'<f8'", body=BODY, order="False"):
    """A .npy file with any header."""
    head = f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}}}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + body


@pytest.mark.parametrize(
    ("memory", "limit"), [(2**31, 2**30), (2**32, 2**31), (2**33, 2**32), (2**38, 2**32), (-1, 2**32)]
)
def test_the_default_is_four_gib_or_half_of_the_memory(memory, limit, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    pages = {"SC_PHYS_PAGES": memory // 4096 if memory > 0 else -1, "SC_PAGE_SIZE": 4096}
    monkeypatch.setattr(limits.os, "sysconf", pages.__getitem__, raising=False)
    limits._by_default.cache_clear()
    assert max_file_bytes() == limit
    limits._by_default.cache_clear()


def test_the_limit_has_a_default_and_can_be_set(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert 2**28 < max_file_bytes() <= 2**32
    monkeypatch.setenv(VARIABLE, "12")
    assert max_file_bytes() == 12
    for wrong in ("0", "-1", "4 GiB", "", "1e9"):
        monkeypatch.setenv(VARIABLE, wrong)
        with pytest.raises(kineme.errors.SpecificationError, match=f"{VARIABLE} to be a whole number of bytes above 0"):
            max_file_bytes()


LARGE = {
    "a.csv": b"t,x\n" + b"0,0\n" * 20_000,
    "b.csv": b"t" + b",x" * 5000 + b"\n" + b"0,1\n" * 9,
    "c.csv": b"t,x\n" + b"9" * 10_000,
    "a.json": b'{"positions": [' + b"0," * 20_000 + b"0]}",
    "b.json": b'{"positions": [' + b"[]," * 20_000 + b"[]]}",
    "a.npz": npz(np.savez_compressed, positions=np.zeros((20_000, 2)), times=np.arange(20_000)),
    "b.npz": npz(np.savez_compressed, positions=np.zeros((40_000, 2), np.int8), times=np.arange(3)),
}


@pytest.mark.parametrize("name", LARGE)
def test_what_expands_beyond_the_limit_is_refused_by_name(monkeypatch, name):
    monkeypatch.setenv(VARIABLE, str(2**18))
    assert len(LARGE[name]) < 2**18
    with pytest.raises(
        kineme.errors.DataError, match=rf"at most 262,144 bytes of memory, .* set .* variable {VARIABLE}"
    ):
        read(LARGE[name], name)


def test_a_saved_model_has_the_same_limit(tmp_path, monkeypatch):
    path = kineme.DMP(n_basis=9).learn([np.sin(np.arange(90.0))[:, None]]).save(tmp_path / "x")
    monkeypatch.setenv(VARIABLE, "10000")
    assert len(kineme.dmp.Primitives.load(path)) == 1
    monkeypatch.setenv(VARIABLE, str(path.stat().st_size - 1))
    with pytest.raises(kineme.errors.DataError, match=VARIABLE):
        kineme.dmp.Primitives.load(path)
    with zipfile.ZipFile(path) as saved:
        members = [(name, saved.read(name) + bytes(2**20)) for name in saved.namelist()]
    path.write_bytes(archive(*members))
    monkeypatch.setenv(VARIABLE, "100000")
    with pytest.raises(kineme.errors.DataError, match=VARIABLE):
        kineme.dmp.Primitives.load(path)


def test_arrays_that_nobody_needs_are_not_read(monkeypatch):
    data = npz(np.savez_compressed, positions=X, times=T, images=np.zeros(2**22), odd=np.array([None]))
    monkeypatch.setenv(VARIABLE, str(2**17))
    np.testing.assert_array_equal(read(data).demonstrations[0].positions, X)
    axes = npz(np.savez_compressed, x=T, y=T**2, t=T, images=np.zeros(2**22))
    np.testing.assert_array_equal(read(axes).demonstrations[0].positions, X)


def test_more_bytes_than_an_entry_admits_are_not_expanded():
    """The archive says 176 bytes, the stream holds 120 MiB: reading without a bound expands before it counts."""
    honest = archive(("positions.npy", bytes(120 * MIB)), ("times.npy", entry(T)))
    small = honest.replace(struct.pack("<I", 120 * MIB), struct.pack("<I", 176))
    assert small != honest
    with LimitedChild(("kineme.io.reading.recordings",), memory=60 * MIB) as child:
        outcome = child.call("recordings_in_bytes:read_recordings_from_bytes", small, "a.npz", Layout())
    assert outcome.how == "refused", outcome
    assert "CRC" in outcome.what  # not that the memory was too small


ODD = {
    "twice": archive(("positions.npy", entry(X)), ("positions.npy", entry(-X)), ("times.npy", entry(T))),
    "a long header": archive(("positions.npy", headed("(" * 9000)), ("times.npy", entry(T))),
    "a deep header": archive(("positions.npy", headed("-" * 5000 + "1")), ("times.npy", entry(T))),
    "a large shape": archive(("positions.npy", headed("(10**9, 2)")), ("times.npy", entry(T))),
    "larger than its bytes": archive(("positions.npy", headed("(7000000000, 2)")), ("times.npy", entry(T))),
    "smaller than its bytes": archive(("positions.npy", headed("(5, 2)")), ("times.npy", entry(T))),
    "a negative shape": archive(("positions.npy", headed("(-6, -2)")), ("times.npy", entry(T))),
    "axes without end": archive(("positions.npy", headed("(0, 10000000000)", body=b"")), ("times.npy", entry(T))),
    "movements without end": archive(
        ("positions.npy", headed("(9000000000, 0, 2)", body=b"")), ("times.npy", entry(T))
    ),
    "numbers of no size": archive(("positions.npy", headed("(6, 2)", "'|V0'", b"")), ("times.npy", entry(T))),
    "records": archive(("positions.npy", headed("(6,)", "[('a', '<f8'), ('b', '<f8')]")), ("times.npy", entry(T))),
    "objects": archive(("positions.npy", headed("(6, 2)", "'|O'")), ("times.npy", entry(T))),
    "a later version": archive(("positions.npy", b"\x93NUMPY\x09\x00" + entry(X)[8:]), ("times.npy", entry(T))),
    "no array": archive(("positions.npy", b"t,x"), ("times.npy", entry(T))),
    "no ending": archive(("positions", entry(X)), ("times.npy", entry(T))),
    "nothing": archive(),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_archives_are_refused(name):
    with pytest.raises(kineme.errors.DataError, match=r"a\.npz: expected"):
        read(ODD[name])


@pytest.mark.parametrize("order", [False, True])
@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4", ">i2", "|u1", "|b1", "<f2"])
def test_numbers_of_every_type_and_order_are_read(dtype, order):
    x = (100 * X).astype(dtype)
    shaped = np.asfortranarray(x) if order else x
    odd = headed(descr=repr(dtype), body=shaped.tobytes("A"), order=str(order))  # not aligned
    for data in (npz(positions=shaped, times=T), archive(("positions.npy", odd), ("times.npy", entry(T)))):
        np.testing.assert_array_equal(read(data, units="s").demonstrations[0].positions, x.astype(float))


def test_texts_that_are_none_are_refused():
    labels = headed("(1,)", "'<U2'", struct.pack("<II", 0x61, 0x110000))
    with pytest.raises(kineme.errors.DataError, match="texts in 'labels' that are none"):
        read(archive(("positions.npy", entry(X[None])), ("labels.npy", labels)))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint64, np.int64])
@pytest.mark.parametrize("offsets", [[0, 8, 4, 12], [0, 255, 12]])
def test_offsets_that_decrease_are_refused_in_every_type(dtype, offsets):
    x = np.random.default_rng(0).normal(size=(12, 2))
    with pytest.raises(kineme.errors.DataError, match="whole numbers that do not decrease"):
        read(npz(positions=x, times=np.arange(12) / 100, offsets=np.array(offsets, dtype)))
    recordings = read(npz(positions=x, times=np.arange(12) / 100, offsets=np.array([0, 4, 12], dtype)))
    assert recordings.demonstrations.lengths.tolist() == [4, 8]


def as_json(**entries):
    return json.dumps({"positions": [X.tolist()] * 3, **entries}).encode()


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (["a", None, "c"], ("a", None, "c")),
        ([1, "1.0", 1.5], ("1", "1.0", "1.5")),
        ([True, 2, ""], ("True", "2", None)),
        (["\ud800", "\u00e4", "b"], ("\\ud800", "\u00e4", "b")),
    ],
)
def test_labels_of_json_are_texts_each_by_itself(labels, expected):
    recordings = read(as_json(labels=labels), "a.json")
    assert tuple(recordings.labels) == expected
    repr(recordings.labels).encode()


@pytest.mark.parametrize("labels", [["a", ["b"], "c"], ["a", {"b": 1}, "c"], ["a", float("nan"), "c"]])
def test_labels_of_json_that_are_no_names_are_refused(labels):
    with pytest.raises(kineme.errors.DataError, match="movement 1: expected a label that is text or a number, got"):
        read(as_json(labels=labels), "a.json")


def test_entries_of_json_that_occur_twice_are_refused():
    data = as_json()[:-1] + b', "positions": 1}'
    with pytest.raises(kineme.errors.DataError, match="expected each entry once, got 'positions' several times"):
        read(data, "a.json")


def test_deeply_nested_headers_of_saved_models_are_refused(tmp_path):
    for text in ("[" * 100_000, '{"format":' * 50_000, '{"format": "kineme", "version": 1, "kind": "primitives"}'):
        np.savez(tmp_path / "x.npz", header=np.frombuffer(text.encode(), np.uint8))
        with pytest.raises(kineme.errors.DataError, match="expected"):
            kineme.dmp.Primitives.load(tmp_path / "x.npz")


def test_the_standard_input_has_the_limit(monkeypatch):
    from kineme.io.limits import read_limited

    class Endless(io.RawIOBase):
        def read(self, size=-1):
            return b"0" * size

    monkeypatch.setenv(VARIABLE, str(2**22))
    with pytest.raises(kineme.errors.DataError, match="expected a stream that takes at most 4,194,304 bytes"):
        read_limited(Endless())
    assert read_limited(io.BytesIO(b"12")) == b"12"


def test_a_limit_that_is_no_number_is_told_before_anything_is_read(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("t,x\n")
    monkeypatch.setenv(VARIABLE, "much")
    with pytest.raises(kineme.errors.SpecificationError, match=VARIABLE):
        read_recordings(tmp_path)


@pytest.mark.parametrize("skip", ["movement", "sample"])
def test_stamps_out_of_range_are_refused(skip):
    good = "a,0,0\na,1,1\na,2,4\na,3,9\n"
    bad = "b,-1.5e308,0\nb,0,1\nb,1,2\nb,2,3\nb,1.5e308,4\n"
    recordings = read(f"id,t,x\n{good}{bad}".encode(), "a.csv", units="s", skip=skip)
    assert recordings.demonstrations.lengths.tolist() == [4]  # of the other, three samples are left at most
    assert "expected times up to 1e+50 s, got -1.5e+308 at sample 0" in recordings.problems[0].reason
    with pytest.raises(
        kineme.errors.TrajectoryError, match=r"trajectory 0: expected times up to 1e\+50, got -1.5e\+308"
    ):
        kineme.Demonstrations.from_arrays([np.zeros((4, 1))], times=[np.array([-1.5e308, 0, 1, 1.5e308])])


@pytest.mark.parametrize("unit", ["s", "ms", "ns"])
def test_dates_that_are_none_are_missing_samples(unit):
    dates = np.datetime64("2024-05-06T07:08:09", unit) + np.arange(6) * np.timedelta64(10**9, "ns").astype(
        f"m8[{unit}]"
    )
    dates[0] = "NaT"
    data = npz(positions=X, times=dates)
    with pytest.raises(kineme.errors.DataError, match="expected finite times, got nan at sample 0"):
        read(data)
    assert read(data, skip="sample").demonstrations.lengths.tolist() == [5]


@pytest.mark.parametrize("dates", [np.arange(6) * 10**17, np.arange(6) * 10**10])
@pytest.mark.parametrize("kind", ["M", "m"])
def test_dates_that_wrap_around_are_refused(dates, kind):
    with pytest.raises(kineme.errors.DataError, match="expected dates from 1678 to 2262 or durations of that size"):
        read(npz(positions=X, times=dates.astype(f"{kind}8[s]")))


def test_numbers_beyond_float64_are_infinite():
    with pytest.raises(kineme.errors.DataError, match="expected finite positions, got"):
        read(npz(positions=X.astype(np.longdouble) + np.longdouble("1e4000"), times=T))
    with pytest.raises(kineme.errors.DataError, match="expected finite times, got inf"):
        read(b"t,x\n1e308,1\n1.1e308,2\n1.2e308,3\n1.3e308,4\n", "a.csv", units=100.0)


def test_labels_that_are_records_are_refused():
    with pytest.raises(kineme.errors.DataError, match="movement 0: expected a label that is text or a number, got"):
        read(npz(positions=np.stack((X, X)), labels=np.zeros(2, [("a", "f8")])))


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ("0,1e200\n1,2\n2,3\n3,5", r"expected positions up to 1e\+100, got \[1e\+200\] at sample 0"),
        ("0,0\n1e-60,2\n1,3\n2,5", "expected at least 1e-50 s between stamps, got 0 and 1e-60 s at sample 1"),
        ("0,0\n1,2e-150\n2,1e-150\n3,4e-150", "expected an extent of at least 1e-100, got 4e-150"),
    ],
)
def test_files_and_arrays_have_one_range(rows, reason):
    with pytest.raises(kineme.errors.DataError, match=reason):
        read(f"t,x\n{rows}\n".encode(), "a.csv")
    t, x = np.array([row.split(",") for row in rows.split("\n")], dtype=float).T
    with pytest.raises(
        kineme.errors.TrajectoryError, match=reason.partition(" at ")[0].replace(" s at", " s").removesuffix(" s")
    ):
        kineme.Demonstrations.from_arrays([x[:, None]], times=[t])

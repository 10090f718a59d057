"""MATLAB files by our own bounded reader: the same numbers as SciPy's, and no file that harms."""

from __future__ import annotations

import io
import struct
import zlib
from contextlib import suppress

import numpy as np
import pytest
from scipy.io import loadmat, savemat

import kineme
from kineme.datasets import lasa
from kineme.io.arrays.matlab import read_demos
from kineme.io.limits import VARIABLE

T = np.arange(6.0)
X = np.random.default_rng(0).normal(size=(6, 2))


def saved(compressed=False, **content):
    buffer = io.BytesIO()
    savemat(buffer, content, do_compression=compressed)
    return buffer.getvalue()


def one(x=X, t=T):
    return {"pos": np.asarray(x).T, "t": np.asarray(t)}


@pytest.mark.parametrize("shape", ["CShape", "Multi_Models_1"])
def test_recordings_are_those_that_scipy_reads(shape):
    data = lasa._resources()[shape].read_bytes()
    expected = np.atleast_1d(loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)["demos"])
    demos = read_demos(data)
    for theirs, t, x in zip(expected, demos.times, demos.positions, strict=True):
        np.testing.assert_array_equal(t, theirs.t)
        np.testing.assert_array_equal(x, theirs.pos.T)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"])
def test_numbers_of_every_type(compressed, dtype):
    x = (100 * np.abs(X)).astype(dtype)
    demos = read_demos(saved(compressed, demos=one(x), name="wave"))
    assert demos.name == "wave"
    np.testing.assert_array_equal(demos.positions[0], x.astype(float))


@pytest.mark.parametrize("compressed", [False, True])
def test_cells_arrays_of_structures_and_what_stands_beside_them(compressed):
    cells = np.empty(2, dtype=object)
    cells[:] = [one(), one(2 * X[:, :1])]
    records = np.zeros((1, 2), dtype=[("pos", object), ("more", object), ("t", object)])
    records[0, 0], records[0, 1] = (X.T, "x", T), (2 * X.T, {"a": cells}, T[:, None])
    beside = {"before": {"deep": {"deeper": [1j, "text"]}}, "a": np.eye(30) * 1j, "zz": np.array(["ab", "c"])}
    assert [x.shape for x in read_demos(saved(compressed, **beside, demos=cells)).positions] == [(6, 2), (6, 1)]
    demos = read_demos(saved(compressed, **beside, demos=records))
    np.testing.assert_array_equal(demos.positions[1], 2 * X)
    np.testing.assert_array_equal(demos.times[1], T)


def test_files_of_big_endian_machines():
    """Every number of 4 and 8 bytes of such a file, turned by hand."""

    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    def matrix(kind, dims, name, *content):
        head = element(6, struct.pack(">II", kind, 0)) + element(5, struct.pack(f">{len(dims)}i", *dims))
        return element(14, head + element(1, name) + b"".join(content))

    def doubles(x):
        return matrix(6, x.shape, b"", element(9, x.astype(">f8").tobytes(order="F")))

    fields = struct.pack(">HHI", 4, 5, 4) + element(1, b"t\0\0\0pos\0")
    demos = matrix(2, (1, 1), b"demos", fields, doubles(T[None]), doubles(X.T))
    packed = zlib.compress(demos)
    header = b"MATLAB 5.0".ljust(124) + b"\1\0MI"
    for body in (demos, struct.pack(">II", 15, len(packed)) + packed):
        in_that_order = read_demos(header + body)
        np.testing.assert_array_equal(in_that_order.positions[0], X)
        np.testing.assert_array_equal(in_that_order.times[0], T)


def test_the_file_that_killed_the_reader():
    """Types that there are not, in the tag of any element: SciPy's reader follows them out of its table."""
    data = saved(demos=one(), name="wave")
    for at in range(128, len(data), 8):
        for kind in (0, 8, 10, 11, 14, 16, 19, 255, 65535):
            spoiled = data[:at] + struct.pack("<H", kind) + data[at + 2 :]
            with suppress(kineme.errors.DataError):
                assert len(read_demos(spoiled).times[0]) <= len(T)


def test_a_compressed_bomb_is_not_expanded(monkeypatch):
    bomb = saved(True, beside=np.zeros(2**22), demos=one())
    assert len(bomb) < 2**17
    monkeypatch.setenv(VARIABLE, str(2**20))
    assert len(read_demos(bomb).times) == 1  # nobody needs the 32 MiB beside
    with pytest.raises(kineme.errors.DataError, match=rf"at most 1,048,576 bytes of memory, got one .*{VARIABLE}"):
        read_demos(saved(True, demos=one(np.zeros((2**22, 1)), np.zeros(2**22))))


def test_what_compressed_data_say_of_themselves_is_not_believed():
    data = saved(True, demos=one())
    size = int.from_bytes(data[132:136], "little")
    plain = zlib.decompress(data[136 : 136 + size])
    for spoiled in (
        plain[:-8],
        plain + bytes(2**20),
        plain[:4] + struct.pack("<I", 2**31) + plain[8:],
        plain[:100],
        b"",
    ):
        packed = zlib.compress(spoiled)
        with pytest.raises(kineme.errors.DataError, match="expected a"):
            read_demos(data[:128] + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(kineme.errors.DataError, match="truncated"):
        read_demos(data[:-4])


def test_a_file_that_was_cut_is_refused_wherever_that_was():
    data = saved(demos=one(), beside=np.arange(9.0))
    for at in range(0, len(data) - 1, 7):
        with pytest.raises(kineme.errors.DataError, match="expected a MATLAB file with 'demos', got"):
            read_demos(data[:at])


CELLS_T = np.arange(12) / 10
CELLS_X = np.column_stack((np.sin(CELLS_T), CELLS_T**2))


def write_mat(tmp_path, **variables):
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", variables)
    return tmp_path / "a.mat"


def read_mat(tmp_path, **variables):
    return kineme.read_recordings(write_mat(tmp_path, **variables))


def test_cells_structures_and_variables_are_movements_or_columns(tmp_path):
    cells = np.empty((1, 2), object)
    cells[0, 0], cells[0, 1] = CELLS_X, CELLS_X[:9].T  # samples along the longer axis
    recordings = read_mat(tmp_path, trials=cells)
    assert [source.place for source in recordings.sources] == ["trials/0", "trials/1"]
    np.testing.assert_array_equal(recordings.demonstrations[1].positions, CELLS_X[:9])
    structures = np.zeros((1, 2), [("t", object), ("q", object), ("label", object)])
    for k, label in enumerate(("wave", "nod")):
        structures[0, k] = (CELLS_T, CELLS_X.T, label)
    recordings = read_mat(tmp_path, data=structures)
    assert recordings.labels.tolist() == ["wave", "nod"]
    np.testing.assert_array_equal(recordings.demonstrations[0].positions, CELLS_X)
    np.testing.assert_array_equal(recordings.demonstrations[0].times, CELLS_T)
    assert read_mat(tmp_path, t=CELLS_T, a=CELLS_T, b=CELLS_T**2).demonstrations.dimensions == ("a", "b")
    rated = read_mat(tmp_path, q=CELLS_X, grip=CELLS_T, fps=50.0)
    np.testing.assert_allclose(np.diff(rated.demonstrations.times), 0.02)
    alone = kineme.read_recordings(write_mat(tmp_path, gesture=CELLS_X), units=0.02)
    np.testing.assert_array_equal(alone.demonstrations[0].positions, CELLS_X)


def test_cells_of_texts_are_a_column_of_labels(tmp_path):
    labels = np.array(["wave"] * 20 + [""] * 4 + ["nod"] * 16, dtype=object)
    t = np.arange(40) / 50
    recordings = read_mat(tmp_path, t=t, x=np.sin(t), y=t**2, label=labels)
    assert [source.label for source in recordings.sources] == ["wave", "a", "nod"]  # without one, the file's name


def test_a_matrix_of_characters_labels_cells_and_labels_that_fit_nothing_are_said(tmp_path):
    cells = np.empty((1, 3), object)
    cells[0, :] = CELLS_X, CELLS_X[:9], CELLS_X
    names = ["wäve", "nod ", "stop"]
    recordings = read_mat(tmp_path, trials=cells, dt=0.02, labels=np.array(names))
    assert recordings.labels.tolist() == ["wäve", "nod", "stop"]
    assert recordings.problems == ()
    (problem,) = read_mat(tmp_path, trials=cells, dt=0.02, labels=np.array(names[:2])).problems
    assert problem.reason.startswith("'labels': expected a label for each movement, got 2, which are not used")


def test_matrices_with_their_own_times_win_over_the_longer_axis(tmp_path):
    few = np.arange(5) / 5
    wide = np.arange(40.0).reshape(8, 5)
    recordings = read_mat(tmp_path, trial={"t": few, "q": wide})
    np.testing.assert_array_equal(recordings.demonstrations.positions, wide.T)

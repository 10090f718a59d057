"""HDF5 files in the layouts of robomimic and ALOHA, and plain ones, written by h5py."""

import sys

import numpy as np
import pytest

import kineme
from kineme.errors import DataError

T = np.arange(20) / 20
X = np.column_stack((np.sin(T), T**2, T))


@pytest.fixture
def write(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py reads and writes HDF5")

    def written(fill):
        path = tmp_path / "a.hdf5"
        with h5py.File(path, "w") as file:
            fill(file)
        return path

    return written


def robomimic(file):
    for k in range(3):
        group = file.create_group(f"data/demo_{k}")
        group.attrs["num_samples"] = n = 10 + k
        group["actions"], group["dones"], group["states"] = np.ones((n, 7)), np.zeros(n), np.ones((n, 5))
        group["obs/robot0_eef_pos"], group["obs/image"] = X[:n], np.zeros((n, 64, 64, 3), np.uint8)
        group["next_obs/robot0_eef_pos"] = X[:n]
    file["mask/train"] = np.array([b"demo_0"])


def aloha(file):
    file.attrs["sim"] = True
    file["action"], file["observations/qpos"] = np.ones((20, 14)), np.cumsum(np.ones((20, 14)), axis=0)
    file["observations/images/top"] = np.zeros((20, 48, 64, 3), np.uint8)


def test_groups_are_movements_and_data_sets_are_chosen(write):
    recordings = kineme.read_recordings(write(robomimic), columns="obs/robot0_eef_pos", units=0.05)
    assert [(source.place, source.label) for source in recordings.sources] == [
        (f"data/demo_{k}", None) for k in range(3)
    ]
    assert recordings.demonstrations.dimensions == tuple(f"obs/robot0_eef_pos.{axis}" for axis in "xyz")
    assert recordings.demonstrations.lengths.tolist() == [10, 11, 12]
    np.testing.assert_array_equal(recordings.demonstrations[1].positions, X[:11])
    np.testing.assert_allclose(recordings.demonstrations.durations, 0.05 * np.array([9, 10, 11]))


def test_without_a_choice_the_vectors_are_listed(write):
    words = r"got actions \(7\), next_obs/robot0_eef_pos \(3\), obs/robot0_eef_pos \(3\), states \(5\); say which with"

    def trials(file):
        robomimic(file)
        file.move("data", "trials")  # else it is known what the vectors are, see test_robot_sets.py

    with pytest.raises(DataError, match=words):
        kineme.read_recordings(write(trials))
    with pytest.raises(DataError, match="the step between samples with units="):
        kineme.read_recordings(write(trials), columns="states")


def test_a_file_may_be_one_movement(write):
    recordings = kineme.read_recordings(write(aloha), columns="observations/qpos", units=0.02)
    assert (len(recordings), recordings.demonstrations.n_dims) == (1, 14)


def test_groups_with_names_are_labels_and_arrays_of_their_own_are_movements(write):
    def named(file):
        for name in ("wave", "nod"):
            file[f"{name}/t"], file[f"{name}/pos"] = T, X
        file["nod"].attrs["label"] = "bow"

    recordings = kineme.read_recordings(write(named))
    assert {source.place: source.label for source in recordings.sources} == {"wave": "wave", "nod": "bow"}
    assert recordings.demonstrations.dimensions == ("x", "y", "z")

    def bare(file):
        file["wave"], file["nod"] = X, X[:9]

    assert {source.place for source in kineme.read_recordings(write(bare)).sources} == {"wave", "nod"}


def test_rates_give_times(write):
    def rated(file):
        file["pos"], file["gripper"] = X, T
        file.attrs["fps"] = 50

    times = kineme.read_recordings(write(rated)).demonstrations.times
    np.testing.assert_allclose(times, np.arange(20) / 50)


def test_other_files_are_not_read_through_this_one(write, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["y"] = X[:, 1]

    def linked(file):
        file["t"], file["x"] = T, X[:, 0]
        file["y"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "/y")
        layout = h5py.VirtualLayout((20,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "y", (20,))
        file.create_virtual_dataset("v", layout)
        file.create_dataset("e", (20,), "f8", external=[(str(tmp_path / "secret.h5"), 0, 160)])

    assert kineme.read_recordings(write(linked)).demonstrations.dimensions == ("x",)


def test_damaged_files_and_a_missing_package_say_so(write, tmp_path, monkeypatch):
    path = write(aloha)
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(DataError, match="expected an HDF5 file, got something foreign, truncated or damaged"):
        kineme.read_recordings(path)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[hdf5\]'"):
        kineme.read_recordings(path)


def test_a_file_larger_than_the_limit_is_refused_before_it_is_read(write):
    def sparse(file):
        file.create_dataset("wave/t", (2**40,), "f8", chunks=(1024,), compression="gzip")
        file.create_dataset("wave/x", (2**40,), "f8", chunks=(1024,), compression="gzip")

    with pytest.raises(DataError, match="takes at most"):
        kineme.read_recordings(write(sparse))


def test_units_are_those_of_the_attributes(tmp_path):
    h5py = pytest.importorskip("h5py")
    path, u = tmp_path / "a.h5", np.linspace(0, 1, 30)
    with h5py.File(path, "w") as file:
        for k, group in enumerate((file.create_group("wave_0"), file.create_group("wave_1"))):
            group.attrs["units"] = "mm"
            group["time"] = 20 * np.arange(30)
            group["time"].attrs["units"] = "ms"
            group["hand"] = np.column_stack([u, (k + 1) * u**2])
            group["wrist"] = 100 * u
            group["wrist"].attrs["unit"] = b"deg"
    demos = kineme.read_recordings(path).demonstrations
    assert [channel.unit for channel in demos.channels] == ["mm", "mm", "deg"]
    np.testing.assert_allclose(demos.durations, 0.58)
    with h5py.File(path, "a") as file:
        file["wave_1/hand"].attrs["units"] = ["m", "mm"]
    (problem,) = kineme.read_recordings(path).problems
    assert "expected 'hand' in mm, mm, as in the first movement, got m, mm" in str(problem)


def test_units_of_movements_without_times_are_read_and_must_agree(tmp_path):
    h5py = pytest.importorskip("h5py")
    path, u = tmp_path / "a.h5", np.linspace(0, 1, 30)
    with h5py.File(path, "w") as file:
        for name, n in (("wave", 30), ("nod", 20)):
            file[name] = np.column_stack([u, u**2])[:n]
            file[name].attrs["units"] = "mm"
    read = kineme.read_recordings(path, units=0.1)
    assert [channel.unit for channel in read.demonstrations.channels] == ["mm", "mm"]
    with h5py.File(path, "a") as file:
        file["nod"].attrs["units"] = "m"
    with pytest.raises(kineme.errors.KinemeError, match="unit"):
        kineme.read_recordings(path, units=0.1)


def test_rates_and_scales_are_those_of_the_attributes_and_records_are_columns(tmp_path):
    h5py = pytest.importorskip("h5py")
    u = np.linspace(0, 1, 30)
    x = np.column_stack([u, u**2])
    for name in ("rate", "start", "table", "sets"):
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            if name == "table":
                file["hand"] = np.rec.fromarrays([u, *x.T], names="t,x,y")
            elif name == "sets":
                file["X"], file["y"], file.attrs["fs"] = np.stack([x, x]), [b"wave", b"nod"], 10.0
            else:
                hand = file.create_dataset("acquisition/hand/data", data=100 * x)
                hand.attrs["conversion"] = 0.01
                stated = hand if name == "rate" else file.create_dataset("acquisition/hand/starting_time", data=0.0)
                stated.attrs["sampling_rate" if name == "rate" else "rate"] = 10.0
        recordings = kineme.read_recordings(tmp_path / f"{name}.h5")
        np.testing.assert_allclose(recordings.demonstrations[-1].positions, x, err_msg=name)
        np.testing.assert_allclose(recordings.demonstrations.durations, 1.0 if name == "table" else 2.9)
        assert recordings.labels.tolist() == (["wave", "nod"] if name == "sets" else ["hand"])


def test_columns_of_texts_are_labels_or_named_among_those_left_aside(tmp_path):
    h5py = pytest.importorskip("h5py")
    kinds = [("t", float), ("x", float), ("y", float), ("label", "S4"), ("trial", h5py.string_dtype()), ("note", "S2")]
    records = np.zeros(40, kinds)
    records["t"], records["x"], records["y"] = np.tile(np.arange(10) / 10, 4), np.arange(40), np.arange(40) ** 2
    records["label"], records["note"] = np.repeat([b"wave", b"nod"], 20), b"ok"
    records["trial"] = np.repeat(["a", "b", "c", "d"], 10)
    with h5py.File(tmp_path / "table.h5", "w") as table, h5py.File(tmp_path / "columns.h5", "w") as columns:
        table["hand"] = records
        for name in records.dtype.names:
            columns[name] = records[name]
    for name in ("table", "columns"):
        recordings = kineme.read_recordings(tmp_path / f"{name}.h5")
        assert recordings.labels.tolist() == ["wave", "wave", "nod", "nod"]
        assert (recordings.detected[0][0].movement, recordings.detected[0][0].ignored) == (("trial",), ("note",))


def test_labels_that_take_much_more_than_the_file_are_refused(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["X"], file.attrs["fs"] = np.ones((3, 9, 2)), 10.0
        file.create_dataset("y", (3,), dtype="S100000000", chunks=(1,), compression="gzip")
    with pytest.raises(DataError, match="expected labels of at most"):
        kineme.read_recordings(tmp_path / "a.h5")

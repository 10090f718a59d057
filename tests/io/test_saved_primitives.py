"""Primitives to a file and back; files that are not what they should be."""

import json
import os
import zipfile

import numpy as np
import pytest

import kineme
from kineme.io.arrays.npz import write_container

ARRAYS = ("scaled_weights", "starts", "goals", "velocities", "durations", "extents", "weights")


def learned(labels=("a", "b", "a"), **specification):
    rng = np.random.default_rng(3)
    arrays = [np.cumsum(rng.normal(size=(m, 2)), axis=0) for m in (30, 41, 52)]
    demos = kineme.Demonstrations.from_arrays(arrays, labels, names=["one", "zwei", "三"])
    return kineme.DMP(**specification).learn(demos)


@pytest.mark.parametrize("formulation", ["original", "bio-inspired", "amplitude-scaled"])
@pytest.mark.parametrize("fit", ["forcing", "trajectory"])
def test_round_trip_is_exact(tmp_path, formulation, fit):
    steps = (kineme.TrimRest(0.02), kineme.Smooth(15.0), kineme.Resample(64))
    before = learned(formulation=formulation, fit=fit, n_basis=12, damping=17.5, ridge=1e-5, preprocessing=steps)
    after = kineme.dmp.Primitives.load(before.save(tmp_path / "wave.kineme"))
    assert after.dmp == before.dmp
    assert list(after.labels) == list(before.labels)
    assert after.names == before.names
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    np.testing.assert_array_equal(after.rollout(goal=[1, 2]).positions, before.rollout(goal=[1, 2]).positions)


@pytest.mark.parametrize("labels", [None, [1, 2, 1], [0.5, 1.5, 2.5]])
def test_labels_keep_their_type(tmp_path, labels):
    after = kineme.dmp.Primitives.load(learned(labels).save(tmp_path / "x"))
    assert (after.labels is None) if labels is None else (after.labels.tolist() == labels)


def test_loaded_arrays_are_protected(tmp_path):
    after = kineme.dmp.Primitives.load(learned().save(tmp_path / "x"))
    with pytest.raises(ValueError, match="read-only"):
        after.starts[0] = 0


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_refused(tmp_path, share):
    path = learned().save(tmp_path / "x")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(
        kineme.errors.DataError, match=r"x to be an archive of arrays, got something foreign, truncated"
    ):
        kineme.dmp.Primitives.load(path)


def test_a_flipped_bit_in_the_numbers_is_noticed(tmp_path):
    path = learned().save(tmp_path / "x")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(kineme.errors.DataError, match="damaged"):
        kineme.dmp.Primitives.load(path)


def test_another_programs_archive_is_refused(tmp_path):
    np.savez(tmp_path / "x.npz", header=np.frombuffer(b'{"a": 1}', dtype=np.uint8))
    with pytest.raises(kineme.errors.DataError, match="another program's archive"):
        kineme.dmp.Primitives.load(tmp_path / "x.npz")


def test_text_is_refused(tmp_path):
    (tmp_path / "x").write_text("time,x,y\n0,0,0\n")
    with pytest.raises(kineme.errors.DataError, match="foreign"):
        kineme.dmp.Primitives.load(tmp_path / "x")


def test_pickled_objects_are_never_loaded(tmp_path):
    marker = tmp_path / "executed"

    class Attack:
        def __reduce__(self):
            return (os.mkdir, (str(marker),))

    np.savez(tmp_path / "x.npz", header=np.array([Attack()], dtype=object))
    with pytest.raises(kineme.errors.DataError):
        kineme.dmp.Primitives.load(tmp_path / "x.npz")
    assert not marker.exists()


def test_a_later_version_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("kineme.io.arrays.npz.VERSION", 7)
    path = learned().save(tmp_path / "x")
    monkeypatch.undo()
    with pytest.raises(kineme.errors.DataError, match="version 1 or earlier, got 7; upgrade kineme"):
        kineme.dmp.Primitives.load(path)


def test_another_kind_is_refused(tmp_path):
    path = write_container(tmp_path / "x", "recipes", {}, {})
    with pytest.raises(kineme.errors.DataError, match="to hold primitives, got 'recipes'"):
        kineme.dmp.Primitives.load(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"dmp": {"n_basis": 1}}, "n_basis"),
        ({"dmp": {"formulation": "os.system"}}, "formulation"),
        ({"dmp": {"unheard_of": 1}}, "unheard_of"),
        ({"dmp": {"preprocessing": [{"step": "os.system"}]}}, "os.system"),
        ({"dmp": {"n_basis": 13}}, "scaled_weights should be"),
    ],
)
def test_headers_that_do_not_fit_are_refused(tmp_path, change, words):
    path = learned(n_basis=12).save(tmp_path / "x.npz")
    with np.load(path) as archive:
        arrays = dict(archive)
    header = json.loads(arrays.pop("header").tobytes())
    header["dmp"] |= change["dmp"]
    np.savez(path, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)
    with pytest.raises(kineme.errors.DataError, match=words):
        kineme.dmp.Primitives.load(path)


def test_a_missing_file_is_file_not_found(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"a file of primitives at '.*nothing', found nothing there; save"):
        kineme.dmp.Primitives.load(tmp_path / "nothing")
    with pytest.raises(kineme.errors.DataError, match=r"expected a file of primitives at .*, found a folder there"):
        kineme.dmp.Primitives.load(tmp_path)
    with pytest.raises(TypeError, match="expected the path of a file of primitives, got int"):
        kineme.dmp.Primitives.load(5)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"expected a folder .*nowhere to write x\.kineme into, there is none"):
        learned().save(tmp_path / "nowhere" / "x.kineme")


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = learned().save(tmp_path / "x")
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("kineme.reporting.atomic.os.fsync", full)
    with pytest.raises(OSError, match="expected room to write, got a full disk"):
        learned(n_basis=12).save(path)
    assert path.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_labels_that_are_objects_are_refused(tmp_path):
    with pytest.raises(kineme.errors.DataError, match="text or numbers"):
        learned([object(), object(), object()]).save(tmp_path / "x")


def test_the_file_is_an_ordinary_archive(tmp_path):
    with zipfile.ZipFile(learned().save(tmp_path / "x")) as archive:
        assert {"header.npy", "scaled_weights.npy", "starts.npy"} <= set(archive.namelist())

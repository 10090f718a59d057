"""Folders of recordings: what is read, what is left out and why."""

import numpy as np
import pytest

import kineme
from kineme.io.writing.write_movement import write_movement
from kineme_experiments.evaluation.data import load_data


@pytest.fixture
def folder(tmp_path, make_movement):
    for label in ("wave", "point"):
        (tmp_path / label).mkdir()
        for k in range(3):
            t, x = make_movement([len(label), k])
            write_movement(tmp_path / label / f"{k}.csv", {"times": t, "positions": x})
    return tmp_path


def test_the_folder_is_the_label(folder):
    read = load_data(str(folder))
    assert read.name == folder.name
    assert read.left_out == {}
    assert read.demonstrations.labels.tolist() == ["point"] * 3 + ["wave"] * 3
    assert read.demonstrations.names[0] == "point/0.csv"


def test_what_is_no_recording_is_left_out_with_the_reason(folder, make_movement):
    (folder / "wave" / "notes.md").write_text("a wave")
    (folder / "wave" / "broken.csv").write_text("time,x\n0,1\n1\n")
    (folder / "wave" / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    (folder / "wave" / "short.csv").write_text("time,x\n0,1\n1,2\n")
    (folder / "wave" / ".hidden.csv").write_text("")
    t, x = make_movement(2)
    write_movement(folder / "top.csv", {"times": t, "positions": x})
    t, x = make_movement(0, 3)
    write_movement(folder / "wave" / "space.csv", {"times": t, "positions": x})
    (folder / "once").mkdir()
    t, x = make_movement(1)
    write_movement(folder / "once" / "a.csv", {"times": t, "positions": x})
    left_out = load_data(str(folder)).left_out
    assert set(left_out) == {
        "wave/notes.md", "wave/broken.csv", "wave/binary.csv", "wave/short.csv", "top.csv", "wave/space.csv",
        "once/a.csv",
    }  # fmt: skip
    assert left_out["wave/broken.csv"] == "line 3: expected 2 columns, got 1"
    assert "at least 4 samples, got 2" in left_out["wave/short.csv"]
    assert left_out["top.csv"] == "no label: not in a folder of its own"
    assert left_out["wave/space.csv"].startswith("3 dimensions where most have 2: it has ['z'] besides")
    assert left_out["once/a.csv"] == "the only movement labeled 'once'"


def test_a_folder_that_is_not_there_is_refused():
    with pytest.raises(
        kineme.errors.DataError, match="expected lasa, lasa-letters, a folder or a file, found nothing at 'nowhere'"
    ):
        load_data("nowhere")


def test_one_class_is_not_enough(folder):
    for path in (folder / "wave").iterdir():
        path.unlink()
    with pytest.raises(kineme.errors.DataError, match=r"two folders of at least two recordings .* found {'point': 3}"):
        load_data(str(folder))


def test_an_empty_folder_says_so_and_the_first_reason_is_shown(tmp_path):
    with pytest.raises(kineme.errors.DataError, match=r"expected recordings in .* found none"):
        load_data(str(tmp_path))
    (tmp_path / "a.csv").write_text("")
    with pytest.raises(kineme.errors.DataError, match=r"1 could not be read, the first a\.csv: expected samples"):
        load_data(str(tmp_path))


@pytest.mark.parametrize(("name", "n_classes"), [("lasa", 26), ("lasa-letters", 9)])
def test_packaged_data(name, n_classes):
    read = load_data(name)
    assert len(np.unique(read.demonstrations.labels)) == n_classes
    assert len(read.demonstrations) == 7 * n_classes
    assert read.people is None

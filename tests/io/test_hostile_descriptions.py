"""Descriptions of data sets that somebody wrote to harm: of arrays in Zarr, and of the shards of LeRobot."""

import json
import shutil

import numpy as np
import pytest

from kineme.audit.run import audit_episodes
from kineme.errors import DataError
from kineme.io.reading.episodes import read_episodes
from kineme.library.discover import discover
from lerobot_sets import write_v2, write_v3
from robot_array_sets import write_aloha, write_robomimic, write_umi
from work_samples import work_episode

ENDS, PLACES = "meta/episode_ends", "data/robot0_eef_pos"


def described(path, change):
    path.write_text(json.dumps(json.loads(path.read_text()) | change))


@pytest.mark.parametrize(
    ("name", "change"),
    [
        (ENDS, {"shape": [2**61], "chunks": [1]}),
        (ENDS, {"shape": [10**400]}),
        (ENDS, {"fill_value": "abc"}),
        (ENDS, {"fill_value": 10**40}),
        (ENDS, {"compressor": {"id": []}}),
    ],
)
def test_a_description_of_the_ends_that_is_none_is_refused(name, change, tmp_path):
    pytest.importorskip("zarr", reason="zarr writes")
    described(write_umi(tmp_path / "umi.zarr") / name / ".zarray", change)
    with pytest.raises(DataError):
        list(read_episodes(tmp_path / "umi.zarr"))


@pytest.mark.parametrize(
    "change",
    [{"shape": [120, 0, 10**12], "chunks": [1, 1, 1]}, {"dimension_separator": None}, {"compressor": {"id": []}}],
)
def test_a_description_of_values_that_is_none_costs_these_alone(change, tmp_path):
    pytest.importorskip("zarr", reason="zarr writes")
    described(write_umi(tmp_path / "umi.zarr") / PLACES / ".zarray", change)
    episodes = list(read_episodes(tmp_path / "umi.zarr"))
    widths = [episode.signals["observation.robot0_gripper_width"] for episode in episodes]
    assert np.isfinite(np.concatenate(widths)).all()
    assert audit_episodes(episodes).numbers.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    "path",
    [
        "{chunk_index:c}{chunk_index:c}{file_index:c}other.parquet",
        "{file_index:c}tmp/other.parquet",
        "{chunk_index!s:.>2.0}/other.parquet",
        "data/{chunk_index[0]}",
    ],
)
def test_numbers_of_shards_lead_to_no_file_outside(path, tmp_path):
    import pandas as pd

    folder = write_v3(tmp_path / "set")
    described(folder / "meta" / "info.json", {"data_path": path})
    table = folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    episodes = pd.read_parquet(table)
    episodes["data/chunk_index"], episodes["data/file_index"] = ord("."), ord("/")
    episodes.to_parquet(table)
    with pytest.raises(DataError, match="data_path within the data set"):
        list(read_episodes(folder))


@pytest.mark.parametrize(("write", "change"), [(write_v3, {"fps": 10**400}), (write_v2, {"chunks_size": 10**30})])
def test_numbers_beyond_all_bounds_are_refused_or_passed_over(write, change, tmp_path):
    folder = write(tmp_path / "set")
    described(folder / "meta" / "info.json", change)
    if "fps" in change:
        with pytest.raises(DataError, match="fps above 0"):
            list(read_episodes(folder))
    else:
        assert len(list(read_episodes(folder))) == 3


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_an_episode_without_a_usable_number_is_a_problem_of_a_discovery(value):
    episodes = [work_episode(k, "pick the cube")[0] for k in range(9)]
    usual = discover(episodes)
    episodes[4].signals["observation.state"][:] = value
    discovery = discover(episodes)
    assert discovery.problems == ("episode 4: expected finite numbers in observation.state, got none",)
    assert discovery.episodes == usual.episodes - 1


def test_files_that_count_alike_are_episodes_of_their_own(tmp_path):
    pytest.importorskip("h5py", reason="h5py writes HDF5")
    folder = write_aloha(tmp_path / "aloha")
    for k in range(2):
        shutil.copy(folder / f"episode_{k}.hdf5", folder / f"other_{k}.hdf5")
    assert [episode.number for episode in read_episodes(folder)] == [0, 1, 2, 3, 4]


def test_a_demonstration_of_very_many_digits_has_a_number(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py writes HDF5")
    with h5py.File(write_robomimic(tmp_path / "a.hdf5"), "a") as file:
        file.move("data/demo_2", f"data/demo_{'9' * 5000}")
    assert [episode.number for episode in read_episodes(tmp_path / "a.hdf5")] == [0, 1, 10**18 - 1]

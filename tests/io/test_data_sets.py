"""A folder that is one data set is one source, given directly or among others."""

import os
from pathlib import Path

import numpy as np
import pytest

import kineme
from kineme.io.limits import VARIABLE
from kineme.io.reading import formats
from kineme.io.reading.formats import DataSet, Format, data_set_of, files_under, root_of
from kineme.io.reading.recordings import read_recording, read_recordings
from kineme.movements.tables.layout import Block, Detected, Parsed

X = np.sin(np.arange(24.0)).reshape(12, 2)


def read_all(path, layout):
    """Two movements of six samples, and a third that is missing."""
    assert (path / "about.json").is_file()
    block = Block(X, np.arange(12.0) / 10, np.array([0, 6, 12]), ["wave", None], ["0", "1"])
    return Parsed(Detected("toy", "episodes", ("x", "y"), "t", "s", "given"), block, ("episode 2: expected\nmore",))


@pytest.fixture
def toy(tmp_path, monkeypatch):
    row = DataSet("about.json", ("*.bin",), ("parts/*.bin", "*.bin"), Format(read_path=read_all))
    monkeypatch.setattr(formats, "DATA_SETS", (row,))

    def make(folder="bow/set"):
        where = tmp_path / folder
        (where / "parts").mkdir(parents=True)
        for name in ("about.json", "a.bin", "parts/b.bin", "parts/.c.bin", "video.mp4"):
            (where / name).write_text(name)
        return where

    return make


def test_a_data_set_is_one_entry_among_files(tmp_path, toy):
    toy()
    (tmp_path / "a.csv").write_text("t,x,y\n" + "".join(f"{k},{k},{k * k}\n" for k in range(5)))
    assert [path.relative_to(tmp_path) for path in files_under(tmp_path)[0]] == [Path("a.csv"), Path("bow/set")]
    read = read_recordings(tmp_path)
    assert [(source.path, source.place, source.label) for source in read.sources] == [
        ("a.csv", "", None),
        ("bow/set", "0", "wave"),
        ("bow/set", "1", "bow"),
    ]
    assert [str(problem) for problem in read.problems] == ["bow/set: episode 2: expected more"]


def test_a_data_set_given_directly_is_one_source_under_its_own_name(toy, monkeypatch):
    where = toy()
    read = read_recordings(where)
    assert [(source.path, source.label) for source in read.sources] == [("set", "wave"), ("set", None)]
    assert read.sources[0].size == sum((where / name).stat().st_size for name in ("about.json", "a.bin", "parts/b.bin"))
    monkeypatch.chdir(where)
    assert {source.path for source in read_recordings(".").sources} == {"set"}
    with pytest.raises(kineme.errors.DataError, match="episode 2"):
        read_recording(where)


def test_the_checksum_is_of_the_files_that_are_read_and_of_their_names(toy):
    where = toy()
    checksum = read_recordings(where).sources[0].sha256
    (where / "video.mp4").write_text("another")
    os.utime(where / "a.bin", (0, 0))
    assert read_recordings(where).sources[0].sha256 == checksum
    (where / "parts" / "b.bin").rename(where / "parts" / "d.bin")
    renamed = read_recordings(where).sources[0].sha256
    (where / "a.bin").write_text("a.bim")
    assert len({checksum, renamed, read_recordings(where).sources[0].sha256}) == 3


def test_the_limit_is_on_what_is_kept_not_on_the_size_of_the_files(toy, monkeypatch):
    where = toy()
    monkeypatch.setenv(VARIABLE, "10")
    assert len(read_recordings(where)) == 2


def test_without_what_must_lie_beside_the_marker_it_is_a_folder_of_files(toy):
    where = toy()
    (where / "a.bin").unlink()
    assert data_set_of(where) is None
    with pytest.raises(kineme.errors.DataError, match=r"found none; 3 could not be read, the first about\.json"):
        read_recordings(where)


@pytest.mark.skipif(os.name != "posix", reason="links are those of POSIX systems")
def test_links_out_of_a_data_set_are_refused_unless_they_are_asked_for(tmp_path, toy):
    where = toy()
    (tmp_path / "elsewhere").write_text("b")
    (where / "parts" / "b.bin").unlink()
    (where / "parts" / "b.bin").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(
        kineme.errors.DataError, match=r"set: parts/b\.bin is a link that leads out of the folder; .*--follow"
    ):
        read_recordings(where)
    assert len(read_recordings(where, follow_links=True)) == 2


def test_names_of_sources_are_relative_to_the_folder_around_a_data_set(tmp_path, toy):
    where = toy()
    assert root_of(where) == root_of(where / "a.bin").parent == tmp_path / "bow"
    assert root_of(tmp_path) == tmp_path

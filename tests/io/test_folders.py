"""Folders of recordings: labels, order, links, and files that cannot be read or vanish meanwhile."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

import kineme
from kineme.io.reading import recordings as recordings_module
from kineme.io.reading.formats import as_text, files_under
from kineme.io.reading.recordings import read_recordings

TEXT = "time,x\n" + "".join(f"{k},{k * k}\n" for k in range(5))

LEADS_NOWHERE = "expected a file, got a link that leads nowhere; delete it, or restore what it leads to"
posix = pytest.mark.skipif(os.name != "posix", reason="links, pipes and names of bytes are those of POSIX systems")


def fill(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(TEXT, encoding="utf-8")


def test_the_innermost_folder_is_the_label_and_the_top_is_none(tmp_path):
    fill(tmp_path, "z.csv", "wave/b.csv", "wave/a.csv", "left/wave/c.csv", "a b; $(c)/d.csv", "winken \u2603/e.csv")
    read = read_recordings(tmp_path)
    assert [(source.path, source.label) for source in read.sources] == [
        ("a b; $(c)/d.csv", "a b; $(c)"),
        ("left/wave/c.csv", "wave"),
        ("wave/a.csv", "wave"),
        ("wave/b.csv", "wave"),
        ("winken \u2603/e.csv", "winken \u2603"),
        ("z.csv", None),
    ]


def test_a_label_in_the_file_wins_over_the_folder(tmp_path):
    fill(tmp_path, "wave/a.csv")
    rows = "".join(f"point,{k},{k}\n" for k in range(4)) + "".join(f",{k},{k}\n" for k in range(4))
    (tmp_path / "wave" / "b.csv").write_text(f"label,time,x\n{rows}")
    assert tuple(read_recordings(tmp_path).labels) == ("wave", "point", "wave")


def test_hidden_files_and_folders_are_passed_over(tmp_path):
    fill(tmp_path, "wave/a.csv", "wave/.b.csv", ".git/c.csv")
    read = read_recordings(tmp_path)
    assert [source.path for source in read.sources] == ["wave/a.csv"]
    assert read.problems == ()


@pytest.mark.parametrize("name", ["positions", "x", "xy", "joints", "hand"])
def test_a_folder_wins_over_the_name_of_the_one_array_of_a_file(tmp_path, name):
    scipy_io, h5py = pytest.importorskip("scipy.io"), pytest.importorskip("h5py")
    t = np.arange(20) / 50
    arrays = {name: np.column_stack((t, t**2)), "fs": 50.0}
    for label in ("wave", "nod"):
        (tmp_path / label).mkdir()
        np.savez(tmp_path / label / "0.npz", **arrays)
        (tmp_path / label / "1.json").write_text(json.dumps(arrays, default=np.ndarray.tolist))
        scipy_io.savemat(tmp_path / label / "2.mat", arrays)
        with h5py.File(tmp_path / label / "3.h5", "w") as file:
            file.update(arrays)
    assert read_recordings(tmp_path).labels.tolist() == ["nod"] * 4 + ["wave"] * 4
    (tmp_path / "two").mkdir()
    np.savez(tmp_path / "two" / "0.npz", circle=arrays[name], bow=arrays[name], fs=50.0)
    assert read_recordings(tmp_path / "two").labels.tolist() == ["circle", "bow"]
    (label,) = read_recordings(tmp_path / "wave" / "0.npz").labels
    assert label == ("hand" if name == "hand" else None)


def test_a_single_file_has_no_label_and_its_own_name_as_path(tmp_path):
    fill(tmp_path, "wave/a.csv")
    (source,) = read_recordings(tmp_path / "wave" / "a.csv").sources
    assert (source.path, source.label) == ("a.csv", None)


@posix
def test_links_may_lead_anywhere(tmp_path):
    fill(tmp_path, "data/wave/a.csv", "data/point/b.csv", "elsewhere/nod/c.csv")
    data = tmp_path / "data"
    (data / "wave" / "up").symlink_to(data)
    (data / "wave" / "self").symlink_to(data / "wave")
    (data / "away").symlink_to(tmp_path / "elsewhere")
    (data / "again").symlink_to(data / "point")
    (data / "broken.csv").symlink_to(tmp_path / "nothing.csv")
    read = read_recordings(data, follow_links=True)
    assert [source.path for source in read.sources] == ["away/nod/c.csv", "point/b.csv", "wave/a.csv"]
    assert [(problem.file, problem.reason) for problem in read.problems] == [("broken.csv", LEADS_NOWHERE)]


@posix
def test_links_out_of_the_folder_are_not_followed_unless_one_says_so(tmp_path):
    fill(tmp_path, "data/wave/a.csv", "data-more/b.csv", "elsewhere/nod/c.csv")
    data = tmp_path / "data"
    (data / "away").symlink_to(tmp_path / "elsewhere")
    (data / "beside").symlink_to(tmp_path / "data-more")
    (data / "up").symlink_to("..")
    (data / "wave" / "other.csv").symlink_to("../../elsewhere/nod/c.csv")
    (data / "within.csv").symlink_to("wave/a.csv")
    (tmp_path / "door").symlink_to(data)
    for folder in (data, tmp_path / "door"):
        read = read_recordings(folder)
        assert [source.path for source in read.sources] == ["wave/a.csv", "within.csv"]
        assert [problem.file for problem in read.problems] == ["away", "beside", "up", "wave/other.csv"]
        assert {problem.reason for problem in read.problems} == {
            "a link that leads out of the folder; to read it, say follow_links=True, in the shell --follow-links"
        }
    assert len(read_recordings(data, follow_links=True)) == 5


@posix
def test_a_link_to_itself_is_a_problem(tmp_path):
    fill(tmp_path, "a.csv")
    (tmp_path / "b.csv").symlink_to("b.csv")
    (tmp_path / "round").symlink_to("about")
    (tmp_path / "about").symlink_to("round")
    read = read_recordings(tmp_path)
    assert [source.path for source in read.sources] == ["a.csv"]
    assert [problem.file for problem in read.problems] == ["about", "b.csv", "round"]
    assert read.problems[1].reason == LEADS_NOWHERE


def test_a_file_larger_than_the_memory_costs_itself_alone(tmp_path, monkeypatch):
    fill(tmp_path, "a.csv", "b.csv", "c.csv")
    read_bytes = Path.read_bytes

    def too_large(path):
        if path.name == "b.csv":
            raise MemoryError
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", too_large)
    read = read_recordings(tmp_path)
    assert [source.path for source in read.sources] == ["a.csv", "c.csv"]
    assert [problem.file for problem in read.problems] == ["b.csv"]
    assert "memory" in read.problems[0].reason


def test_a_file_beyond_the_limit_costs_itself_alone(tmp_path, monkeypatch):
    fill(tmp_path, "a.csv")
    with (tmp_path / "b.csv").open("wb") as file:
        file.truncate(2**40)  # a hole: it takes no place on the disk
    monkeypatch.setenv("KINEME_MAX_FILE_BYTES", "20000")
    read = read_recordings(tmp_path)
    assert [source.path for source in read.sources] == ["a.csv"]
    assert [problem.file for problem in read.problems] == ["b.csv"]
    assert "at most 20,000 bytes of memory, got one that takes 1,099,511,627,776" in read.problems[0].reason
    assert "set the environment variable KINEME_MAX_FILE_BYTES to more" in read.problems[0].reason
    monkeypatch.setenv("KINEME_MAX_FILE_BYTES", "a lot")
    with pytest.raises(
        kineme.errors.SpecificationError, match=r"KINEME_MAX_FILE_BYTES to be a whole number .* got 'a lot'"
    ):
        read_recordings(tmp_path)


@posix
def test_a_pipe_is_not_waited_for(tmp_path):
    fill(tmp_path, "a.csv")
    os.mkfifo(tmp_path / "b.csv")
    (problem,) = read_recordings(tmp_path).problems
    assert str(problem) == "b.csv: expected a file, got a pipe or a device"


def test_a_file_that_vanishes_while_reading_is_a_problem(tmp_path):
    fill(tmp_path, "a.csv", "b.csv", "c.csv")

    def vanish(files):
        for path in files:
            if path.name == "b.csv":
                path.unlink()
            yield path

    read = read_recordings(tmp_path, progress=vanish)
    assert [source.path for source in read.sources] == ["a.csv", "c.csv"]
    assert [str(problem) for problem in read.problems] == [
        "b.csv: expected a file that can be read, got: No such file or directory"
    ]


def test_a_file_that_changes_between_looking_and_reading_is_hashed_as_it_was_read(tmp_path, monkeypatch):
    fill(tmp_path, "a.csv")
    read_bytes = Path.read_bytes

    def grown(path):
        path.write_text(TEXT + "9,9\n")
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", grown)
    read = read_recordings(tmp_path)
    assert (read.sources[0].size, read.demonstrations.lengths.tolist()) == (len(TEXT) + 4, [6])


def test_a_folder_that_cannot_be_listed_is_a_problem(tmp_path, monkeypatch):
    fill(tmp_path, "a.csv", "locked/b.csv")
    listing = os.scandir

    def refuse(path):
        if Path(path).name == "locked":
            raise PermissionError(13, "Permission denied")
        return listing(path)

    monkeypatch.setattr(os, "scandir", refuse)
    (problem,) = read_recordings(tmp_path).problems
    assert problem.file == "locked"
    assert "the folder cannot be listed" in problem.reason


def test_a_file_that_must_not_be_read_is_a_problem(tmp_path, monkeypatch):
    fill(tmp_path, "a.csv", "b.csv")
    read_bytes = Path.read_bytes

    def refuse(path):
        if path.name == "b.csv":
            raise PermissionError(13, "Permission denied", str(path))
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    (problem,) = read_recordings(tmp_path).problems
    assert str(problem) == "b.csv: expected a file that can be read, got: Permission denied"


@posix
@pytest.mark.skipif(sys.platform == "darwin", reason="its file systems hold text only")
def test_names_that_are_no_text_are_written_out(tmp_path):
    folder = os.path.join(os.fsencode(tmp_path), b"w\xffve")
    os.mkdir(folder)
    with open(os.path.join(folder, b"\xfe.csv"), "w") as file:
        file.write(TEXT)
    (source,) = read_recordings(tmp_path).sources
    assert (source.path, source.label) == (r"w\xffve/\xfe.csv", r"w\xffve")
    source.path.encode()


def test_the_order_does_not_depend_on_the_file_system(tmp_path, monkeypatch):
    fill(tmp_path, *(f"{label}/{k}.csv" for label in "cab" for k in (10, 9, 1)))
    first = files_under(tmp_path)[0]
    listing = os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: reversed(list(listing(path))))
    assert files_under(tmp_path)[0] == first == sorted(first)


def test_paths_are_text_with_forward_slashes():
    assert as_text(Path("a") / "b.csv") == "a/b.csv"


def test_progress_sees_every_file(tmp_path):
    fill(tmp_path, "a.csv", "w/b.csv")
    seen = []
    read_recordings(tmp_path, progress=lambda files: [seen.append(len(files)), *files][1:])
    assert seen == [2]


def test_reading_a_missing_file_as_one_recording_is_the_usual_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        recordings_module.read_recording(tmp_path / "a.csv")
    with pytest.raises(kineme.errors.DataError, match="found nothing at"):
        read_recordings(tmp_path / "a.csv")

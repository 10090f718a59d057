"""Files take their place as a whole; what killed writers left is removed by the next one, and nothing else."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from kineme.reporting.atomic import name_beside, remove_leftovers, whole_file, whole_folder, write_atomically

KILLED = """
import os, sys
from pathlib import Path
from kineme.reporting.atomic import whole_file
with whole_file(Path(sys.argv[1])) as beside:
    beside.write_bytes(b"half")
    os.kill(os.getpid(), 9)
"""

posix = pytest.mark.skipif(os.name != "posix", reason="elsewhere nobody can ask for a process without ending it")


def age(path, hours=2.0):
    os.utime(path, (time.time() - 3600 * hours,) * 2)


def dead_process():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def names(folder):
    return sorted(one.name for one in folder.iterdir())


@posix
def test_what_a_killed_writer_left_is_removed_by_the_next_one(tmp_path):
    path = tmp_path / "a [1].kineme"
    subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    (left,) = tmp_path.iterdir()
    write_atomically(path, b"whole")
    assert names(tmp_path) == sorted([left.name, path.name])  # for an hour it may be another machine's
    age(left)
    write_atomically(path, b"whole")
    assert names(tmp_path) == [path.name]
    assert path.read_bytes() == b"whole"


@posix
def test_left_overs_of_databases_and_of_earlier_versions(tmp_path):
    gone = dead_process()
    for end in (f"{gone}", f"{gone}.0123abcd", f"{gone}.0123abcd-wal", f"{gone}.0123abcd-journal"):
        (tmp_path / f".x.{end}").write_bytes(b"")
        age(tmp_path / f".x.{end}")
    remove_leftovers(tmp_path, "x")
    assert names(tmp_path) == []


@posix
def test_nothing_else_is_removed(tmp_path):
    gone = dead_process()
    kept = (
        f".x.{os.getpid()}.0123abcd", f".x.{os.getppid()}.0123abcd", f".y.{gone}.0123abcd", f".x.{gone}.mine",
        f"x.{gone}", ".x.swp", ".x", f".xx.{gone}", f".x.{'9' * 30}",
    )  # fmt: skip
    for name in kept:
        (tmp_path / name).write_bytes(b"")
        age(tmp_path / name)
    (tmp_path / f".x.{gone}.00000000").mkdir()
    (tmp_path / f".x.{gone}.00000001").symlink_to(tmp_path / ".x")
    fresh = tmp_path / f".x.{gone}.00000002"
    fresh.write_bytes(b"")
    before = names(tmp_path)
    remove_leftovers(tmp_path, "x")
    assert names(tmp_path) == before


def test_a_process_of_that_number_keeps_a_file_for_a_day(tmp_path):
    """It may be another one by now, or none that this system tells of."""
    left = tmp_path / f".x.{os.getpid()}.00000000"
    for hours, is_there in ((23.0, True), (25.0, False)):
        left.write_bytes(b"")
        age(left, hours)
        remove_leftovers(tmp_path, "x")
        assert left.exists() == is_there


@posix
def test_files_of_other_users_stay(tmp_path, monkeypatch):
    left = tmp_path / f".x.{dead_process()}.00000000"
    left.write_bytes(b"")
    age(left)
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    remove_leftovers(tmp_path, "x")
    assert left.exists()


def test_writers_of_one_process_do_not_share_a_name(tmp_path):
    path = tmp_path / "x"
    assert len({name_beside(path) for _ in range(100)}) == 100
    with whole_file(path) as one:
        one.write_bytes(b"one")
        with whole_file(path) as two:
            two.write_bytes(b"two")
        assert path.read_bytes() == b"two"
    assert path.read_bytes() == b"one"
    assert names(tmp_path) == ["x"]


def test_a_folder_that_is_not_there_is_named(tmp_path):
    remove_leftovers(tmp_path / "nowhere", "x")
    with pytest.raises(FileNotFoundError, match="expected a folder"):
        write_atomically(Path(tmp_path / "nowhere" / "x"), b"")
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(FileNotFoundError, match=r"expected a folder .* a file of that name is there"):
        write_atomically(Path(tmp_path / "file" / "x"), b"")


@pytest.mark.parametrize(("kind", "remedy"), [(errno.EACCES, "allow writing in"), (errno.EIO, "choose another folder")])
def test_a_folder_that_takes_no_file_is_named_and_the_hidden_name_is_not(tmp_path, monkeypatch, kind, remedy):
    def refused(path, *_, **__):
        raise OSError(kind, "Refused", str(path))

    for act, name, whole in ((Path.write_bytes, "write_bytes", write_atomically), (Path.mkdir, "mkdir", _in_folder)):
        monkeypatch.setattr(Path, name, refused)
        with pytest.raises(OSError, match=f"expected to write .*new, the system refuses: refused; {remedy}") as caught:
            whole(tmp_path / "new", b"")
        monkeypatch.setattr(Path, name, act)
        assert str(os.getpid()) not in str(caught.value).replace(str(tmp_path), "")
    with pytest.raises(OSError, match="Refused"), whole_file(tmp_path / "new"):  # of another file: as it is
        refused(tmp_path / "other")


def _in_folder(path, _):
    with whole_folder(path):
        pass


def test_the_longest_name_that_is_not_refused_can_be_written(tmp_path):
    assert write_atomically(tmp_path / ("x" * 228), b"x").read_bytes() == b"x"
    with pytest.raises(
        OSError, match=r"expected a name of at most 228 bytes to write, got x{20}\.\.\., which is longer"
    ):
        write_atomically(tmp_path / ("x" * 229), b"x")


def test_a_file_that_is_there_is_named(tmp_path):
    (tmp_path / "there").write_bytes(b"old")
    new = whole_file(tmp_path / "there", replace=False)
    with pytest.raises(FileExistsError, match=r"expected a new file to write, .*there is there; choose"), new:
        pass


@pytest.mark.parametrize("name", ["", ".", "..", "/", "there"])
def test_a_folder_is_not_written_over(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    with pytest.raises(IsADirectoryError, match=r"expected the name of a file to write, got the folder '.+'; add a"):
        write_atomically(Path(name), b"x")
    assert [one.name for one in tmp_path.iterdir()] == ["there"]


@pytest.mark.parametrize("full", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("whole", [whole_file, whole_folder])
def test_a_full_disk_is_an_error_that_names_what_was_to_be_written(tmp_path, whole, full):
    with pytest.raises(OSError, match=r"full disk.*new\.mcap") as refused, whole(tmp_path / "new.mcap"):
        raise OSError(full, "No space left on device")
    assert refused.value.errno == full  # by which a run over many pieces ends
    assert not list(tmp_path.iterdir())

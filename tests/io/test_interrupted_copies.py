"""A copy of a data set that is killed, or that another program was faster to write: nothing is lost or half there."""

import os
import signal
import subprocess
import sys

import pytest

from kineme.errors import DataError
from kineme.io.lerobot.copy import copy_with_motions
from kineme.io.lerobot.motions import Motion, read_motions
from kineme.io.reading.episodes import read_episodes
from kineme.io.writing.annotations import Annotation, write_annotations
from kineme.reporting.atomic import whole_folder
from lerobot_sets import write_lance, write_v2, write_v3
from soaking import slow

CHILD = """
import sys, time
from pathlib import Path
from kineme.io.lerobot import {module} as module
from kineme.io.writing.annotations import Annotation, write_annotations

def stop(*arguments, **options):
    print("there", flush=True)
    time.sleep(600)

module.{step} = stop
notes = [Annotation("set", f"episode {{k}}", 0.0, 9.0, "wave", 0.5, 0.5) for k in range(3)]
write_annotations(Path(sys.argv[2]), notes, [Path(sys.argv[1])])
"""


def notes(*episodes):
    return [Annotation("set", f"episode {k}", 0.0, 9.0, "wave", 0.5, 0.5) for k in episodes]


def bytes_of(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def killed(source, target, module, step):
    """Let a child annotate until it comes to a function, and kill it there."""
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD.format(module=module, step=step), str(source), str(target)], stdout=subprocess.PIPE
    )
    try:
        assert child.stdout.readline() == b"there\n"
    finally:
        child.send_signal(signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
        child.wait()
        child.stdout.close()


@pytest.mark.parametrize(
    ("write", "module", "step"),
    [
        (write_v3, "copy", "_write_shard"),
        slow(write_v2, "copy", "declare"),
        slow(write_v3, "copy", "declare"),
        slow(write_lance, "copy", "_commit"),
        (write_lance, "copy", "declare"),
    ],
)
def test_a_copy_that_is_killed_leaves_the_source_and_no_target(tmp_path, write, module, step):
    if write is write_lance:
        pytest.importorskip("lance")
    source, target = write(tmp_path / "set", fps=10), tmp_path / "named"
    before = bytes_of(source)
    killed(source, target, module, step)
    assert bytes_of(source) == before
    assert not target.exists()
    (hidden,) = tmp_path.glob(".*")  # what is left says whose it was, and is taken for no data set of anybody
    assert hidden.name.startswith(".named.")
    write_annotations(target, notes(0, 2), [source])
    assert [motion.episode for motion in read_motions(target)] == [0, 2]
    assert [episode.problems for episode in read_episodes(target)] == [()] * 3


@pytest.mark.parametrize("step", ["_commit", "declare"])
def test_names_in_place_that_are_killed_leave_the_frames_whole(tmp_path, step):
    pytest.importorskip("lance")
    source = write_lance(tmp_path / "set", fps=10)
    killed(source, source, "copy", step)
    read = list(read_episodes(source))
    assert [(len(episode), episode.problems) for episode in read] == [(20, ()), (30, ()), (25, ())]
    write_annotations(source, notes(1), [source])
    assert [motion.episode for motion in read_motions(source)] == [1]


@pytest.mark.parametrize("empty", [False, True])
def test_of_two_writers_of_one_folder_the_second_is_refused(tmp_path, empty):
    target = tmp_path / "named"
    if empty:
        target.mkdir()

    def write():
        with whole_folder(target) as beside:
            (beside / "mine.txt").write_text("mine")
            target.mkdir(exist_ok=True)
            (target / "theirs.txt").write_text("theirs")

    with pytest.raises(FileExistsError, match="another program wrote"):
        write()
    assert [path.name for path in target.iterdir()] == ["theirs.txt"]
    assert not list(tmp_path.glob(".*"))


def test_a_missing_and_a_half_written_shard(tmp_path):
    """A copy is as incomplete as its source; a damaged shard is not copied as if it were whole."""
    source = write_v3(tmp_path / "set", fps=10)
    first, second = sorted(source.glob("data/*/*.parquet"))
    second.unlink()
    (tmp_path / "named").mkdir()
    copy_with_motions(source, tmp_path / "named", {0: [Motion(0, 0, 9, "wave")]})
    assert [len(episode) for episode in read_episodes(tmp_path / "named")] == [20, 30, 0]
    first.write_bytes(first.read_bytes()[:1000])
    with pytest.raises(DataError, match=r"file-000\.parquet"):
        write_annotations(tmp_path / "again", notes(0), [source])
    assert not (tmp_path / "again").exists()

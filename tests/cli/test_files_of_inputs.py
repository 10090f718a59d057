"""No output goes over a file of the folder that it is read from, even with --force."""

from __future__ import annotations

import pytest
from commands import run

from robot_work import write_episodes, write_library


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    write_episodes(folder / "set", 2)
    write_library(folder / "actions")
    return folder


@pytest.mark.parametrize(
    "command",
    [("annotate", "set", "-l", "actions"), ("find", "reach", "set", "-l", "actions"), ("discover", "set"),
     ("audit", "set", "--train-mask", "keep.csv")],
)  # fmt: skip
def test_a_file_of_the_input_stays(command, work):
    place = work / "set" / "meta" / "info.json"
    before = place.read_bytes()
    done = run(*command, "-o", "set/meta/info.json", "--force", cwd=work)
    assert done.returncode == 2
    assert "expected another file to write than" in done.stderr
    assert place.read_bytes() == before
    assert not (work / "keep.csv").exists()

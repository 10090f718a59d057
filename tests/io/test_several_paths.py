"""Several files, folders and patterns, and rests at both ends."""

import numpy as np
import pytest

import kineme
from kineme.errors import DataError


def _write(path, rest=0, shift=0.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    u = np.clip((np.arange(60 + 2 * rest) - rest) / 59, 0, 1)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    rows = [f"{k / 50},{x + shift},{x * x}" for k, x in enumerate(s)]
    path.write_text("\n".join(["t,x,y", *rows]))


def test_files_folders_and_patterns_are_read_together_each_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a/1.csv", "a/wave/2.csv", "b1.csv", "b2.csv"):
        _write(tmp_path / name, shift=len(name))
    (tmp_path / "b3.csv").write_text("nothing\n")
    read = kineme.read_recordings(["a", "b*.csv", "b1.csv", "none.csv"])
    assert [source.path for source in read.sources] == ["a/1.csv", "a/wave/2.csv", "b1.csv", "b2.csv"]
    assert read.labels.tolist() == [None, "wave", None, None]
    assert sorted(problem.file for problem in read.problems) == ["b3.csv", "none.csv"]
    assert [source.path for source in kineme.read_recordings("a").sources] == ["1.csv", "wave/2.csv"]
    assert [source.path for source in kineme.read_recordings("**/*.csv").sources][:2] == ["a/1.csv", "a/wave/2.csv"]


def test_a_file_whose_name_is_a_pattern_is_meant_itself(tmp_path):
    for name in ("[a].csv", "a.csv"):
        _write(tmp_path / name)
    assert [source.path for source in kineme.read_recordings(tmp_path / "[a].csv").sources] == ["[a].csv"]


def test_nothing_there_says_so(tmp_path):
    with pytest.raises(DataError, match=r"found nothing at '.*\*\.csv'"):
        kineme.read_recordings(tmp_path / "*.csv")
    with pytest.raises(DataError, match=r"expected recordings in a\.csv, b\.csv, c\.csv and 1 more, found none"):
        kineme.read_recordings(["a.csv", "b.csv", "c.csv", "d.csv"])


def test_trim_leaves_out_rests_and_keeps_channels(tmp_path):
    _write(tmp_path / "plain.csv")
    _write(tmp_path / "rests.csv", rest=40)
    lines = (tmp_path / "rests.csv").read_text().splitlines()
    (tmp_path / "rests.csv").write_text(
        "\n".join([f"{lines[0]},gripper", *(f"{line},{k // 70}" for k, line in enumerate(lines[1:]))])
    )
    (tmp_path / "plain.csv").unlink()
    read = kineme.read_recordings(tmp_path, trim=True, kinds={"gripper": "discrete"}).demonstrations
    assert 40 < len(read[0]) < 62
    assert [channel.name for channel in read.channels] == ["x", "y", "gripper"]
    assert read.recorded.shape == (len(read[0]), 3)
    assert set(read.recorded[:, 2]) == {0.0, 1.0}
    assert len(kineme.read_recordings(tmp_path).demonstrations[0]) == 140

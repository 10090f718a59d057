"""``kineme segment``: one long recording of a robot becomes a file for each movement."""

from __future__ import annotations

import numpy as np
import pandas
import pytest
from commands import answer, run, start

COLUMNS = ["time", "shoulder", "elbow", "gripper"]
STARTS = (1.0, 3.0, 5.5)  # of movements of a second each


@pytest.fixture
def recording(tmp_path):
    t = np.arange(0.0, 8.0, 0.01)
    done = sum(np.clip(t - start, 0.0, 1.0) for start in STARTS)
    x = 0.5 * (1.0 - np.cos(np.pi * done))
    gripper = (t > 4.5).astype(int)
    frame = pandas.DataFrame({"time": 100.0 + t, "shoulder": x, "elbow": 2.0 * x, "gripper": gripper})
    path = tmp_path / "long.csv"
    frame.to_csv(path, index=False)
    return path


def test_pandas_reads_each_piece_with_the_columns_of_the_recording(recording, tmp_path):
    pieces = answer("segment", recording, "-o", tmp_path / "pieces")["pieces"]
    assert [int(one["start"] - 99.9) for one in pieces] == [1, 3, 5]
    assert [(one["end"] - one["start"]) == one["duration"] for one in pieces] == [True] * 3
    whole = pandas.read_csv(recording)
    for k, one in enumerate(pieces, 1):
        assert one["file"] == str(tmp_path / "pieces" / f"long-{k:03d}.csv")
        piece = pandas.read_csv(one["file"])
        assert [*piece] == COLUMNS
        assert (piece["time"].iloc[0], piece["time"].iloc[-1]) == (one["start"], one["end"])
        same = whole[whole["time"].between(one["start"] - 1e-6, one["end"] + 1e-6)]
        np.testing.assert_allclose(piece, same, atol=1e-9)
    assert abs(pieces[2]["start"] - 105.5) < 0.1


def test_a_folder_of_pieces_is_learned_again(recording, tmp_path):
    run("segment", recording, "-o", tmp_path / "pieces")
    assert answer("learn", tmp_path / "pieces", "-l", tmp_path / "actions")["added"] == 3
    for other in ("long-005.csv", "long-1-004.csv"):  # of something else
        (tmp_path / "pieces" / other).write_text("mine")
    run("segment", recording, "-o", tmp_path / "pieces", "--min-rest", 1.2, "--force")
    left = sorted(path.name for path in (tmp_path / "pieces").iterdir())
    assert left == ["long-001.csv", "long-002.csv", "long-005.csv", "long-1-004.csv"]


def test_several_recordings_and_a_picture(recording, tmp_path):
    other = tmp_path / "more" / "long.csv"
    other.parent.mkdir()
    other.write_bytes(recording.read_bytes())
    out, plot = tmp_path / "pieces", tmp_path / "pieces.png"
    done = run("segment", recording, other, "-o", out, "--format", "npz", "--plot", plot)
    assert done.returncode == 0, done.stderr
    assert len({*out.iterdir()}) == 6
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert run("segment", recording, "--plot", tmp_path / "one.svg").returncode == 0
    assert "6 movements, written to" in done.stdout


def test_nothing_is_written_over(recording, tmp_path):
    out = tmp_path / "pieces"
    out.mkdir()
    (out / "long-002.csv").write_text("mine")
    refused = run("segment", recording, "-o", out)
    assert refused.returncode == 2
    assert "long-002.csv is there; write over it with --force" in refused.stderr
    assert [one.name for one in out.iterdir()] == ["long-002.csv"]
    assert run("segment", recording, "-o", out, "--force").returncode == 0
    assert len(list(out.iterdir())) == 3
    piece = out / "long-001.csv"
    piece.write_bytes(recording.read_bytes())  # its own pieces would be long-001-001.csv ...
    recording.rename(out / "long-002.csv")
    refused = run("segment", out, "-o", out, "--plot", out / "long-002.csv", "--force")
    assert "another file to write than the input" in refused.stderr


def test_parameters_of_another_method_are_refused_by_their_option(recording):
    refused = run("segment", recording, "--by", "speed", "--min-rest", 0.2)
    assert refused.returncode == 2
    assert "expected parameters of --by speed: --depth, --turn, --min-movement; got --min-rest" in refused.stderr
    assert len(answer("segment", recording, "--min-rest", 1.2)["pieces"]) == 2
    assert len(answer("segment", recording, "--by", "speed")["pieces"]) >= 3


def test_the_command_shows_a_table(recording):
    done = start("segment", recording)
    assert done.returncode == 0, done.stderr
    assert all(word in done.stdout for word in ("start [s]", "duration [s]", "long.csv", "3 movements"))

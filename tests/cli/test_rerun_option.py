"""``--rerun`` of the commands that move, generate and annotate: a file for the viewer of Rerun."""

import numpy as np
import pytest
from commands import run

import kineme
from kineme.io.writing.write_movement import write_movement

pytest.importorskip("rerun", reason="rerun-sdk writes and reads .rrd files")


def entities(path):
    from rerun.chunk import RrdReader

    return {chunk.entity_path for chunk in RrdReader(str(path)).stream() if not chunk.is_static}


@pytest.fixture(scope="module")
def demos():
    return kineme.load_lasa(["CShape", "GShape"])


@pytest.fixture
def recording(demos, tmp_path):
    return write_movement(
        tmp_path / "wave.csv", {"times": demos[0].times + 50, "positions": np.array(demos[0].positions)}
    )


def test_a_generated_movement(recording, tmp_path):
    out = tmp_path / "a.rrd"
    done = run("generate", recording, "-o", tmp_path / "a.csv", "--rerun", out)
    assert done.returncode == 0, done.stderr
    assert {"/wave/points/point", "/wave/signals/positions", "/wave/signals/velocities"} <= entities(out)
    again = run("generate", recording, "--rerun", out)
    assert (again.returncode, again.stdout) == (2, "")
    assert "expected a new file to write" in again.stderr
    assert run("generate", recording, "-o", tmp_path / "b.csv", "--rerun", out, "--force").returncode == 0


def test_an_annotated_recording_has_its_symbols(demos, recording, tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as actions:
        actions.learn(demos)
    out = tmp_path / "a.rrd"
    words = ("annotate", recording, "--library", tmp_path / "actions", "--rerun", out)
    done = run(*words)
    assert done.returncode == 0, done.stderr
    assert f"written to {out}" in done.stdout
    assert {r"/wave.csv/symbols/symbols", r"/wave.csv/signals/positions", r"/wave.csv/points/point"} == entities(out)
    assert run(*words).returncode == 2


def test_an_arm_that_moves(recording, tmp_path, monkeypatch):
    pytest.importorskip("pinocchio", reason="the extra robot is not installed")
    out = tmp_path / "a.rrd"
    words = ("move", recording, "--robot", "ur5e", "--scale", "0.004", "--slow-down", "--rerun")
    done = run(*words, out)
    assert done.returncode == 0, done.stderr
    assert f"wrote {out}" in done.stdout
    branches = {"points/tip\\ of\\ ur5e", "points/wanted", "signals/joints", "signals/velocities", "symbols/symbols"}
    assert {f"/wave/{branch}" for branch in branches} == entities(out)
    assert "expected .rrd" in run(*words, tmp_path / "a.txt").stderr

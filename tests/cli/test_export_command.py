"""``kineme export``: files of a symbol, a recording, a saved primitive; nothing is written over unasked."""

import shutil
import subprocess

import numpy as np
import pytest
from commands import run

import kineme
from kineme.dmp import c_header
from kineme.io.writing.write_movement import write_movement
from kineme.library.grounding import learned_of


@pytest.fixture(scope="module")
def demos():
    return kineme.load_lasa(["CShape", "GShape"])


@pytest.fixture
def recording(demos, tmp_path):
    return write_movement(tmp_path / "Wave 2.csv", {"times": demos[0].times, "positions": np.array(demos[0].positions)})


def test_a_header_of_a_recording_moves(recording, tmp_path):
    done = run("export", recording, "--c", tmp_path / "wave.h")
    assert done.returncode == 0, done.stderr
    assert done.stdout == (
        f"wrote {tmp_path / 'wave.h'}: 2 dimensions, 40 basis functions; wave_2_start, wave_2_aim, wave_2_step\n"
    )
    if shutil.which("gcc") is None:
        pytest.skip("no C compiler")
    (tmp_path / "loop.c").write_text(
        '#include "wave.h"\n#include <stdio.h>\nint main(void)\n{\n    wave_2_state s;\n'
        "    wave_2_start(&s, NULL, NULL, 0);\n"
        '    while (s.u < 1) wave_2_step(&s, 0.01);\n    printf("%.12g %.12g", s.position[0], s.position[1]);\n}\n'
    )
    subprocess.run(["gcc", "-std=c99", "loop.c", "-o", "loop", "-lm"], cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "loop"], capture_output=True, text=True, check=True).stdout
    controller = kineme.DMP().learn(kineme.read_recordings(recording))[0].controller(0.01)
    while controller.state.progress < 1:
        controller.step()
    np.testing.assert_allclose([float(word) for word in printed.split()], controller.state.position, atol=1e-5)


def test_a_symbol_and_a_saved_primitive_are_the_same(demos, tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as actions:
        actions.learn(demos[:3])
    done = run("export", "CShape", "--library", tmp_path / "actions", "--c", tmp_path / "symbol.h")
    assert done.returncode == 0, done.stderr
    assert "cshape_step" in done.stdout
    with kineme.ActionLibrary(tmp_path / "actions") as actions:
        primitive = learned_of(actions.store, "CShape").primitive
    assert (tmp_path / "symbol.h").read_text() == c_header(primitive, "CShape")
    primitive.save(tmp_path / "int.kineme")
    for name, words in (("int", []), ("grasp", ["--name", "grasp"])):
        done = run("export", tmp_path / "int.kineme", *words, "--c", tmp_path / f"{name}.h")
        assert done.returncode == 0, done.stderr
        assert (tmp_path / f"{name}.h").read_text() == c_header(primitive, name)


def test_an_onnx_model(recording, tmp_path):
    onnx = pytest.importorskip("onnx", reason="the extra onnx is not installed")
    sizes = []
    for words in ([], ["--double"]):
        done = run("export", recording, "--onnx", tmp_path / "wave.onnx", "--force", *words)
        assert done.returncode == 0, done.stderr
        model = onnx.load(tmp_path / "wave.onnx")
        assert [each.name for each in model.graph.output] == ["positions", "velocities"]
        sizes.append((tmp_path / "wave.onnx").stat().st_size)
    assert 1.8 < sizes[1] / sizes[0] < 2.0


def test_a_missing_package_is_named(recording, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "onnx", None)
    done = run("export", recording, "--onnx", tmp_path / "wave.onnx", "--c", tmp_path / "wave.h")
    assert done.returncode == 1
    assert "pip install 'kineme[onnx]'" in done.stderr
    assert not list(tmp_path.glob("wave.*"))


def test_nothing_is_written_over_unasked(recording, tmp_path):
    path = tmp_path / "wave.h"
    path.write_text("mine")
    done = run("export", recording, "--c", path)
    assert (done.returncode, path.read_text()) == (2, "mine")
    assert "expected a new file to write" in done.stderr
    done = run("export", recording, "--c", recording, "--force")
    assert done.returncode == 2
    assert "expected another file to write than the input" in done.stderr
    assert run("export", recording, "--c", path, "--force").returncode == 0
    assert "wave_2_step" in path.read_text()


def test_what_is_asked_for(recording, tmp_path):
    done = run("export", recording)
    assert (done.returncode, "--c wave.h, --onnx wave.onnx" in done.stderr) == (2, True)
    done = run("export", recording, "--c", tmp_path / "a", "--onnx", tmp_path / "a")
    assert (done.returncode, "expected two files" in done.stderr) == (2, True)


def test_grippers_are_left_out_and_orientations_refused(tmp_path):
    times = np.linspace(0, 2, 60)
    head = "time,x,y,gripper\n"
    rows = "".join(f"{t},{np.sin(t)},{t * t},{int(t > 1)}\n" for t in times)
    (tmp_path / "grasp.csv").write_text(head + rows)
    done = run("export", tmp_path / "grasp.csv", "--c", tmp_path / "grasp.h")
    assert done.returncode == 0, done.stderr
    assert "note: without gripper, which is discrete" in done.stderr
    assert "columns: x, y\n" in (tmp_path / "grasp.h").read_text()
    turn = "".join(f"{t},{t},{np.cos(t / 4)},{np.sin(t / 4)},0,0\n" for t in times)
    (tmp_path / "turn.csv").write_text("time,x,qw,qx,qy,qz\n" + turn)
    done = run("export", tmp_path / "turn.csv", "--c", tmp_path / "turn.h")
    assert (done.returncode, "orientations and rhythms run in Python" in done.stderr) == (1, True)

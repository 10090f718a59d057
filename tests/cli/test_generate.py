"""``kineme generate`` as a user runs it, on a real recording."""

import json
import lzma
from dataclasses import replace
from pathlib import Path

import commands
import numpy as np
import pytest

import kineme
from kineme.io.reading.recordings import read_recording
from kineme.io.writing.write_movement import write_movement
from soaking import slow


def run(*arguments, by=commands.run, **options):
    return by("generate", *arguments, **options)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    demo = kineme.load_lasa(["GShape"])[3]
    path = tmp_path_factory.mktemp("recordings") / "a wave, $(of) Ünïcode; no paths.csv"
    return write_movement(path, {"times": demo.times, "positions": demo.positions})


def test_a_recording_replays_to_the_screen(recording, tmp_path):
    done = run(recording, "--rate", 200, by=commands.start)
    assert done.returncode == 0, done.stderr
    (tmp_path / "again.csv").write_text(done.stdout, encoding="utf-8")
    table = np.genfromtxt(tmp_path / "again.csv", delimiter=",", names=True)
    demo = read_recording(recording)
    assert table.dtype.names == ("time", "x", "y", "v_x", "v_y", "a_x", "a_y")
    for k, axis in enumerate("xy"):
        expected = np.interp(table["time"], demo.times, demo.positions[:, k])
        np.testing.assert_allclose(table[axis], expected, atol=0.1)  # mm, of a shape 45 mm wide


def test_a_rotation_vector_that_jumps_is_said_before_it_is_generated(tmp_path):
    """Of a tool that points down; the fit is off by up to half a turn."""
    columns = np.linspace(0, 1, 60)[:, None] * [1.0, 0.1, 0.2, 0.3, 0.1, 0.1, 0.1] + [0, 0, 0, 0, 2.1, 2.1, 0]
    columns[30:, 4:] *= 1 - 2 * np.pi / np.linalg.norm(columns[30:, 4:], axis=1, keepdims=True)
    path = tmp_path / "tool.csv"
    np.savetxt(path, columns, delimiter=",", header="time,x,y,z,rx,ry,rz", comments="")
    (note,) = kineme.read_recordings(path).notes
    assert note.startswith("rx, ry, rz look like a rotation vector")
    assert f"note: {note}" in run(path, "-o", tmp_path / "new.csv").stderr


@pytest.mark.parametrize("ending", [".csv", ".npz", ".json"])
def test_start_goal_and_duration_are_met_in_every_format(recording, tmp_path, ending):
    out = tmp_path / f"new{ending}"
    done = run(recording, "--start", "1,2", "--goal", "-5.5,8", "--duration", 1.5, "--settle", 0.01, "-o", out)
    assert done.returncode == 0, done.stderr
    made = read_recording(out)
    np.testing.assert_allclose(made.positions[0, :2], [1, 2], atol=1e-9)
    np.testing.assert_allclose(made.positions[-1, :2], [-5.5, 8], atol=0.01)


def test_a_goal_that_is_not_met_at_the_end_is_said_with_what_meets_it(recording, tmp_path):
    done = run(recording, "--goal", "-30,40", "-o", tmp_path / "a.csv")
    off = np.abs(read_recording(tmp_path / "a.csv").positions[-1, :2] - [-30, 40])
    assert off.max() > 0.5
    assert f"note: it ends {off.max():.3g} from its goal in " in done.stderr
    settle = done.stderr.split("--settle ")[1].split()[0]
    done = run(recording, "--goal", "-30,40", "--settle", settle, "-o", tmp_path / "b.csv")
    assert "note" not in done.stderr
    np.testing.assert_allclose(read_recording(tmp_path / "b.csv").positions[-1, :2], [-30, 40], atol=float(settle))
    assert "note" not in run(recording, "-o", tmp_path / "c.csv").stderr


def test_a_saved_primitive_does_the_same_as_its_recording(recording, tmp_path):
    first = run(recording, "--goal", "3,3", "--save", tmp_path / "g.kineme")
    second = run(tmp_path / "g.kineme", "--goal", "3,3")
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    assert first.stdout == second.stdout


def test_it_steers_around_an_obstacle_on_the_path_and_arrives(recording, tmp_path):
    plain, around = tmp_path / "plain.json", tmp_path / "around.json"
    run(recording, "-o", plain)
    middle = json.loads(plain.read_text())["positions"][200]
    done = run(recording, "--obstacle", ",".join(map(str, middle)), "--settle", 0.05, "-o", around)
    assert done.returncode == 0, done.stderr
    path = np.array(json.loads(around.read_text())["positions"])
    assert np.linalg.norm(path - middle, axis=1).min() > 1.0
    np.testing.assert_allclose(path[-1], json.loads(plain.read_text())["positions"][-1], atol=0.2)


@pytest.mark.parametrize(("ending", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), slow(".pdf", b"%PDF")])
def test_it_draws(recording, tmp_path, ending, magic):
    done = run(recording, "--goal", "3,3", "-o", tmp_path / "new.csv", "--plot", tmp_path / f"new{ending}")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / f"new{ending}").read_bytes().startswith(magic)


@pytest.mark.parametrize("d", [1, slow(3), 7])
def test_any_number_of_dimensions(tmp_path, d):
    u = np.linspace(0, 1, 60)
    positions = (u**3 * (10 - 15 * u + 6 * u**2))[:, None] * np.arange(1, d + 1)
    path = write_movement(tmp_path / "a.json", {"times": 2 * u, "positions": positions})
    done = run(path, "--plot", tmp_path / "a.png", "-o", tmp_path / "b.json")
    assert done.returncode == 0, done.stderr
    made = np.array(json.loads((tmp_path / "b.json").read_text())["positions"])
    np.testing.assert_allclose(made[-1], np.arange(1, d + 1), rtol=0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--goal", "1,2,3"), "expected 2 numbers for --goal, x, y, got 3"),
        (("--start", "1"), "expected 2 numbers for --start, x, y, got 1"),
        (("--duration", 0), "duration above 0 seconds, got 0"),
        (("--rate", 1), "expected a rate of at least"),
        (("--formulation", "newest"), "'bio-inspired'"),
        (("--n-basis", 1), "n_basis to be a whole number of at least 3, got 1"),
        (("--obstacle", "1"), "expected obstacles in the 2 dimensions"),
        (("-o", "new.xls"), ".csv, .npz, .json, .parquet, got '.xls'"),
        (("-o", "new.csv", "--plot", "new.bmp"), "png, svg, pdf, got '.bmp'"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_exit_status_1(recording, tmp_path, arguments, words):
    done = run(recording, *arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("kineme: ")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments", [("--goal", "a,b"), ("--obstacle", "1,2", "--obstacle", "1,2,3"), ("--index", 5), ("--rate", "fast")]
)
def test_options_that_make_no_sense_are_a_usage_error(recording, arguments):
    assert run(recording, *arguments).returncode == 2


def test_a_truncated_primitive_is_refused(recording, tmp_path):
    run(recording, "--save", tmp_path / "g.kineme")
    (tmp_path / "g.kineme").write_bytes((tmp_path / "g.kineme").read_bytes()[:500])
    done = run(tmp_path / "g.kineme")
    assert done.returncode == 1
    assert "truncated or damaged" in done.stderr


def test_numbers_that_are_not_finite_never_reach_a_file(recording, tmp_path):
    """A robot gets no movement that was not checked: here of a primitive with weights beyond reason."""
    primitive = kineme.DMP(n_basis=10).learn([read_recording(recording)])[0]
    path = tmp_path / "wild.kineme"
    replace(primitive, scaled_weights=np.full_like(primitive.scaled_weights, 1e308)).save(path)
    for out in ("new.json", "new.csv", "new.npz"):
        options = "--duration", 0.001, "--rate", 1e6, "--save", tmp_path / "again.kineme"
        done = run(path, *options, "-o", tmp_path / out)
        assert done.returncode == 1
        assert "expected finite" in done.stderr
        assert not (tmp_path / out).exists()
    assert not (tmp_path / "again.kineme").exists()
    done = run(recording, "--goal", "1e308,1e308", "--json")
    assert done.returncode == 1
    assert "numbers up to 1e+100 for --goal" in done.stderr
    assert done.stdout == ""


def test_help_states_no_range_where_there_is_none():
    shown = run("--help").stdout
    assert "--rate" in shown
    assert "None" not in shown


def test_a_library_of_the_first_release_moves_again_before_and_after_it_is_learned_into(tmp_path):
    kept = Path(__file__).parents[1] / "library" / "library_0.1.0.xz"
    (tmp_path / "actions").mkdir()
    (tmp_path / "actions" / "library.sqlite").write_bytes(lzma.decompress(kept.read_bytes()))
    new = write_movement(
        tmp_path / "new.csv", {"times": np.arange(20) / 20, "positions": np.random.default_rng(0).random((20, 2))}
    )
    symbol = ("tilt", "--library", tmp_path / "actions")
    assert run(*symbol, "-o", tmp_path / "before.csv").returncode == 0
    assert commands.run("learn", new, "--label", "wave", "--library", tmp_path / "actions").returncode == 0
    assert run(*symbol, "-o", tmp_path / "after.csv").returncode == 0
    assert (tmp_path / "before.csv").read_bytes() == (tmp_path / "after.csv").read_bytes()

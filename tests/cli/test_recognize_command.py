"""``kineme recognize``, and what symbols mean: a library of real recordings, asked from the shell."""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from commands import answer, run, start

import kineme
from kineme.anchoring.grounding import grounding_schema, primitive_from
from kineme.io.reading.recordings import read_recording
from kineme.io.writing.write_movement import write_movement


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "actions"
    with kineme.ActionLibrary(path, create=True) as library:
        library.learn(kineme.load_lasa(["CShape", "GShape", "NShape", "Angle", "Sine"]))
    return path


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    """A C done elsewhere, smaller, turned and faster; and a shape that the library does not know."""
    path = tmp_path_factory.mktemp("asked")
    c, strange = kineme.load_lasa(["CShape"])[3], kineme.load_lasa(["Sshape"])[2]
    turn = np.array([[math.cos(0.1), -math.sin(0.1)], [math.sin(0.1), math.cos(0.1)]])
    write_movement(path / "c.csv", {"times": 0.8 * c.times, "positions": 3 + 0.5 * c.positions @ turn.T})
    write_movement(path / "strange.csv", {"times": strange.times, "positions": strange.positions})
    (path / "bad.csv").write_text("time,x,y\n0,1\n")
    return path


def test_known_and_unknown_in_one_folder(folder, asked):
    data = answer("recognize", asked, "-l", folder)
    known, strange = data["movements"]
    assert (known["recording"], known["answer"]["label"]) == ("c.csv", "CShape")
    assert known["answer"]["nearest"][0]["name"] == "CShape 4"
    change = known["answer"]["transform"]
    assert change["scale"][0] == pytest.approx(0.5, rel=1e-3)
    assert change["angle"] == pytest.approx(0.1, abs=1e-3)
    assert change["duration_ratio"] == pytest.approx(0.8, rel=1e-6)
    assert (strange["recording"], strange["answer"]["label"], strange["id"]) == ("strange.csv", None, None)
    assert len(data["problems"]) == 1
    assert data["problems"][0].startswith("bad.csv, line 2")
    text = run("recognize", asked, "-l", folder).stdout
    assert "×0.5, +6°, 0.8 × as long" in text
    assert "unknown" in text
    assert "not read: bad.csv, line 2" in text


def assert_alike(ours, theirs):
    """Equal, numbers up to the rounding of single precision, as in `batched_functions`.

    Movements that are recognized together round together, to 8e-7 of a share. Plain and compiled loops differ by 1e-6,
    and the second answer is compiled where what ran before in this process did not repay that, but both together do.
    """
    if isinstance(theirs, dict):
        assert list(ours) == list(theirs)
        ours, theirs = list(ours.values()), list(theirs.values())
    if isinstance(theirs, list):
        assert len(ours) == len(theirs)
        for a, b in zip(ours, theirs, strict=True):
            assert_alike(a, b)
    else:
        assert ours == (pytest.approx(theirs, rel=2e-5, abs=1e-9) if isinstance(theirs, float) else theirs)


def test_progress_goes_on_to_the_end_and_does_not_change_the_answers(folder, asked, monkeypatch):
    """Through reading, one step a file, and recognizing."""
    import tqdm

    bars = []

    class Bar(tqdm.tqdm):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options | {"disable": False, "file": io.StringIO(), "mininterval": 0})
            self.seen = [0]
            bars.append(self)

        def update(self, n=1):
            self.seen.append(self.seen[-1] + n)
            return super().update(n)

    plain = answer("recognize", asked, "-l", folder)
    monkeypatch.setattr(tqdm, "tqdm", Bar)
    monkeypatch.setattr("kineme.cli.recognize._AT_ONCE", 1)
    assert_alike(answer("recognize", asked, "-l", folder), plain)
    reading, recognizing = bars
    assert (reading.desc, reading.total) == ("reading", 3)
    assert (recognizing.desc, recognizing.total, recognizing.seen) == ("recognizing", 2, [0, 1, 2])


def test_the_answer_is_that_of_python(folder, asked):
    data = answer("recognize", asked / "c.csv", "-l", folder, "--top", 5)["movements"][0]["answer"]
    with kineme.ActionLibrary(folder, read_only=True) as library:
        expected = library.recognize(read_recording(asked / "c.csv"))
    ours = expected.to_dict()
    shares = data.pop("responsibilities"), ours.pop("responsibilities")
    assert shares[0] == pytest.approx(shares[1], abs=1e-5)  # what is compiled meanwhile rounds otherwise
    for key in ("label", "certainty", "rule", "calibrated"):
        assert data[key] == ours[key]
    assert [row["label"] for row in data["ranked"]] == [row["label"] for row in ours["ranked"]]
    assert [near["index"] for near in data["nearest"]] == [near["index"] for near in ours["nearest"]]
    assert data["confidence"] == pytest.approx(ours["confidence"], abs=1e-5)
    assert data["nearest"][0]["similarity"] == pytest.approx(ours["nearest"][0]["similarity"], abs=1e-5)


def test_a_recording_may_come_through_a_pipe(folder, asked):
    data = answer("recognize", "-", "-l", folder, input=(asked / "c.csv").read_text(), by=start)
    assert data["movements"][0]["answer"]["label"] == "CShape"


def test_a_library_without_symbols_cannot_say(tmp_path, asked):
    with kineme.ActionLibrary(tmp_path / "empty", create=True) as library:
        library.learn([one.positions for one in kineme.load_lasa(["CShape"])])
    done = run("recognize", asked / "c.csv", "-l", tmp_path / "empty")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "symbol" in done.stderr


def test_a_symbol_moves_again(folder, tmp_path):
    done = run(
        "generate", "GShape", "-l", folder, "--goal", "4,2", "--duration", 2, "--settle", 0.01, "-o", tmp_path / "g.csv"
    )
    assert done.returncode == 0, done.stderr
    made = read_recording(tmp_path / "g.csv")
    np.testing.assert_allclose(made.positions[-1, :2], [4, 2], atol=0.01)
    again = json.loads(run("generate", "GShape", "-l", folder, "--json", "--rate", 50).stdout)
    with kineme.ActionLibrary(folder, read_only=True) as library:
        start = np.array([one.positions[0] for one in library.movements("GShape")])
    assert np.abs(start - again["positions"][0]).sum(axis=1).min() < 1e-4  # one of its demonstrations
    missing = run("generate", "HShape", "-l", folder)
    assert missing.returncode == 1
    assert "'HShape'" in missing.stderr


def test_a_symbol_for_a_planner(folder, tmp_path):
    from jsonschema import Draft202012Validator

    done = start("library", "ground", "GShape", "-l", folder, "--units", "mm", "-o", tmp_path / "g.json")
    assert done.returncode == 0, done.stderr
    grounding = json.loads((tmp_path / "g.json").read_text())
    Draft202012Validator(grounding_schema()).validate(grounding)
    assert json.loads(run("library", "schema").stdout) == grounding_schema()
    assert grounding["symbol"]["name"] == "GShape"
    with kineme.ActionLibrary(folder, read_only=True) as library:  # the medoid is the library's id of it
        shown = library.primitives(ids=[grounding["prototype"]["medoid"]])
    np.testing.assert_array_equal(shown.scaled_weights[0], grounding["primitive"]["scaled_weights"])
    path = primitive_from(grounding).rollout(goal=grounding["demonstrated"]["goal"]["median"])
    np.testing.assert_allclose(path.positions[0, -1], grounding["demonstrated"]["goal"]["median"], atol=1.0)


@pytest.mark.soak
def test_what_is_near_and_between(folder, tmp_path):
    near = answer("library", "nearest", "GShape", "-k", 2, "-l", folder)
    assert near[0]["symbol"] == "CShape"
    assert near[0]["distance"] < near[1]["distance"]
    found = answer("library", "between", "GShape", "Angle", "-l", folder)
    assert all(0 <= one["share"] <= 1 and one["excess"] <= 0.25 for one in found)
    assert start("library", "map", tmp_path / "map.png", "-l", folder).returncode == 0
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_that_nothing_lies_between_is_said(folder, monkeypatch):
    monkeypatch.setattr(kineme.ActionLibrary, "between", lambda *_: ())
    said = run("library", "between", "GShape", "Angle", "-l", folder)
    assert said.stdout == "no symbol lies between GShape and Angle\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [("kineme rec", "recognize"), ("kineme library na", None), ("kineme library li", "list")],
)
def test_the_shell_completes_commands(words, expected):
    assert _completed(words) == ([expected] if expected else [])


@pytest.mark.soak
def test_the_shell_completes_symbols_of_the_library_on_the_line(folder):
    assert _completed(f"kineme library show -l {folder} N") == ["NShape"]
    assert _completed(f"kineme generate -l {folder} G") == ["GShape"]
    assert _completed("kineme library show -l nowhere N") == []


@pytest.mark.soak
def test_a_name_that_a_shell_would_act_on_is_completed_as_its_id(tmp_path):
    hostile = ["a;reboot", "$(reboot)", "`x`", "two words", "*", "-y", "~", "a\nplain,b", "a,b", "a'b", "!x"]
    with kineme.ActionLibrary(tmp_path / "a", create=True) as library:
        library.learn(kineme.load_lasa(["CShape", "GShape"])[: len(hostile) + 1], labels=[*hostile, "größe/2"])
        ids = [library[name].id for name in hostile]
    assert sorted(_completed(f'kineme library show -l {tmp_path / "a"} ""')) == sorted([*ids, "größe/2"])


def _completed(words):
    """What bash would offer for the last word."""
    environment = {"_KINEME_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    code = "from kineme.cli import main; main(prog_name='kineme')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env={"PATH": "", **environment}
    )
    return [line.partition(",")[2] for line in done.stdout.splitlines() if line]


@pytest.mark.parametrize(("shown", "guess"), [(1, True), (5, False)])
def test_an_answer_that_is_a_guess_says_so(tmp_path, asked, shown, guess):
    demos = kineme.load_lasa(["CShape", "GShape", "NShape", "Angle", "Sine"])
    with kineme.ActionLibrary(tmp_path / "a", create=True) as library:
        library.learn(demos[np.arange(len(demos)) % 7 < shown])
    said = answer("recognize", asked / "c.csv", "-l", tmp_path / "a")["movements"][0]["answer"]
    assert said["calibrated"] is not guess
    assert (said["rule"] == "guess", "any share" in said["promise"]) == (guess, guess)
    text = run("recognize", asked / "c.csv", "-l", tmp_path / "a").stdout
    assert said["certainty"] == ("looks like" if guess else "sure")
    assert ("Which movements are unknown is a guess" in text) is guess
    assert ("two or more of each symbol, 19 in all, to keep --error-rate 0.05" in text) is guess


def test_numbers_are_data_and_the_table_says_the_word(tmp_path):
    """Without calibration p-values fall to 1e-100, and a confidence of 1 beside a guess contradicts itself."""
    u = np.linspace(0, 1, 50)
    shapes = {"wave": np.column_stack([u, np.sin(6 * u)]), "point": np.column_stack([u**2, u])}
    rng = np.random.default_rng(0)
    demos = [x * size + 1e-3 * rng.normal(size=x.shape) for x in shapes.values() for size in (1, 1.01, 0.99)]
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demos, [name for name in shapes for _ in range(3)])
    path = write_movement(tmp_path / "a.csv", {"times": u, "positions": shapes["wave"]})
    (movement,) = answer("recognize", path, "-l", tmp_path / "actions")["movements"]
    assert movement["answer"]["ranked"][1]["p_value"] < 1e-3
    assert (movement["answer"]["rule"], movement["answer"]["confidence"]) == ("guess", pytest.approx(1.0))
    text = run("recognize", path, "-l", tmp_path / "actions").stdout
    assert "looks like" in text
    assert not any(word in text for word in ("1.00", "p-value", "<0.001"))


def test_a_library_of_one_movement_answers_and_says_that_it_guesses(tmp_path):
    c, sine = kineme.load_lasa(["CShape"]), kineme.load_lasa(["Sine"])
    for name, one in (("one", c[0]), ("other", c[4]), ("strange", sine[0])):
        write_movement(tmp_path / f"{name}.csv", {"times": one.times, "positions": one.positions})
    run("learn", tmp_path / "one.csv", "--label", "a", "-l", tmp_path / "l")
    asked = (tmp_path / "other.csv", tmp_path / "strange.csv")
    movements = answer("recognize", *asked, "-l", tmp_path / "l")["movements"]
    assert [movement["answer"]["label"] for movement in movements] == ["a", None]
    assert "is a guess" in run("recognize", *asked, "-l", tmp_path / "l").stdout

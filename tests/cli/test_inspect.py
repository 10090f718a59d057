"""``kineme inspect`` as a user runs it, on real recordings."""

import json
import os
import subprocess
import sys

import commands
import pytest

import kineme
from kineme.io.writing.write_movement import write_movement

PNG = b"\x89PNG\r\n"


def run(*arguments, by=commands.run, **options):
    return by("inspect", *arguments, **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for one in kineme.load_lasa(["CShape", "Snake"]):
        (folder / one.label).mkdir(exist_ok=True)
        write_movement(folder / one.label / f"{one.name}.csv", {"times": one.times, "positions": one.positions})
    (folder / "Snake" / "bad.csv").write_text("time,x,y\n0,1,2\n1,oops,3\n")
    return folder


def test_a_folder_in_words_and_as_a_picture(folder, tmp_path):
    done = run(folder, "--plot", tmp_path / "out.png", by=commands.start)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # no progress bar where there is no terminal
    text = done.stdout
    assert text.startswith("14 movements of 2 dimensions in 14 files")
    assert "Snake/bad.csv, line 3: expected a number in 'x', got 'oops'" in text
    assert (tmp_path / "out.png").read_bytes().startswith(PNG)


def test_a_folder_as_data(folder):
    done = run(folder, "--json")
    data = json.loads(done.stdout)
    assert [(one["label"], one["movements"]) for one in data["labels"]] == [("CShape", 7), ("Snake", 7)]
    assert data["problems"] == [
        {"file": "Snake/bad.csv", "line": 3, "reason": "expected a number in 'x', got 'oops'"},
    ]
    (how,) = data["detected"]
    assert (how["time"], how["units"], how["columns"], how["files"]) == ("time", "s", ["x", "y"], 14)


def test_a_table_from_the_standard_input_with_columns_named():
    rows = "".join(f"a;{k * 20};{k};{-k}\n" for k in range(9))
    options = ("--time", "clock", "--columns", "y, x", "--label-column", "what", "--units", "ms", "--json")
    done = run("-", *options, input=f"what;clock;x;y\n{rows}")
    data = json.loads(done.stdout)
    assert data["detected"][0] | {"columns": ["y", "x"], "units": "ms", "units_from": "given"} == data["detected"][0]
    assert data["labels"][0]["rate"]["median"] == pytest.approx(50)
    assert data["labels"][0]["label"] == "a"


def test_samples_may_be_left_out_alone_and_units_be_a_number():
    rows = "".join(f"{k},{'' if k == 3 else k},{k}\n" for k in range(9))
    done = run("-", "--skip", "sample", "--units", "0.01", "--json", input=f"time,x,y\n{rows}")
    data = json.loads(done.stdout)
    assert data["labels"][0]["samples"]["median"] == 9
    assert any("gaps of up to 0.02 s were filled in 1 movement" in note for note in data["notes"])
    done = run("-", "--skip", "sample", "--units", "0.01", "--fill-gaps", "0", "--json", input=f"time,x,y\n{rows}")
    data = json.loads(done.stdout)
    assert data["labels"][0]["samples"]["median"] == 8
    assert data["labels"][0]["rate"]["median"] == pytest.approx(100)
    assert data["problems"][0]["line"] == 5


@pytest.mark.parametrize(
    ("arguments", "data", "words"),
    [
        (["nowhere"], "", "kineme: expected a file or folder of recordings, found nothing at 'nowhere'"),
        (["-"], "", "kineme: standard input.csv: expected samples, got an empty file"),
        (["-", "--columns", "z"], "time,x\n0,1\n", r"expected a column 'z', got the columns ['time', 'x']"),
        (["-", "--units", "week"], "time,x\n0,1\n", "kineme: expected units to be one of s, ms, us, ns"),
        (["-", "--plot", "a.gif"], "0 1\n1 2\n2 3\n3 4\n", "kineme: expected a picture ending in one of png"),
    ],
)
def test_a_failure_is_one_clear_line_and_a_status(arguments, data, words, tmp_path):
    done = run(*arguments, input=data, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_names_cannot_command_the_terminal(tmp_path):
    label = "a\x1b[31m$(b)"
    rows = "".join(f"{label},{k},{k}\n" for k in range(5))
    done = run("-", input=f"label,time,x\n{rows}", by=commands.start)
    assert "\x1b" not in done.stdout
    assert r"a\x1b[31m$(b)" in done.stdout


@pytest.mark.soak
@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are those of POSIX systems")
def test_progress_is_shown_on_a_terminal(folder):
    import termios

    ours, theirs = os.openpty()
    termios.tcsetwinsize(ours, (24, 80))
    command = [sys.executable, "-m", "kineme", "inspect", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        out = process.stdout.read()
    seen = os.read(ours, 10_000)
    os.close(ours)
    assert out.startswith(b"14 movements")
    assert b"reading" in seen
    assert b"/15" in seen


@pytest.fixture(scope="module")
def misplaced(tmp_path_factory):
    """Three shapes, one movement of which lies in the folder of another."""
    folder = tmp_path_factory.mktemp("misplaced")
    for i, one in enumerate(kineme.load_lasa(["CShape", "Snake", "Sine"])):
        label = "Snake" if i == 2 else one.label
        (folder / label).mkdir(exist_ok=True)
        write_movement(folder / label / f"{i}.csv", {"times": one.times, "positions": one.positions})
    return folder


def test_a_movement_unlike_the_others_of_its_label_is_listed(misplaced, tmp_path):
    text = run(misplaced, "--plot", tmp_path / "out.png").stdout
    assert "outliers: 1 of 21 movements unlike the others of their label (about 5 % of those listed are" in text
    assert "Snake/2.csv" in text.split("outliers: ")[1]
    assert "(CShape)" in text.split("outliers: ")[1]
    assert (tmp_path / "out.png").read_bytes().startswith(PNG)
    data = json.loads(run(misplaced, "--json").stdout)["outliers"]
    assert (data["checked"], data["error_rate"]) == (21, 0.05)
    (one,) = data["outliers"]
    assert (one["movement"], one["label"], one["label_of_most_like"]) == ("Snake/2.csv", "Snake", "CShape")


def test_outliers_are_not_looked_for_where_that_is_said_or_there_are_few(misplaced, folder):
    assert "outliers" not in run(misplaced, "--no-outliers").stdout
    assert "outliers" not in json.loads(run(misplaced, "--no-outliers", "--json").stdout)
    assert "outliers" not in run(folder).stdout
    assert run(misplaced, "--error-rate", "1").returncode == 2


def test_movements_that_cannot_be_compared_are_no_error(tmp_path):
    (tmp_path / "a").mkdir()
    for k in range(24):
        (tmp_path / "a" / f"{k}.csv").write_text("time,x\n" + "".join(f"{i},{i}\n" for i in range(9)))
    done = run(tmp_path)
    assert done.returncode == 0, done.stderr
    assert "outliers were not looked for: expected training movements that differ" in done.stdout


def test_lines_and_blocks_are_movements():
    rows = "".join(f"{k % 2},{','.join(str(k + i * i / 7) for i in range(12))}\n" for k in range(6))
    data = json.loads(run("-", "--rows", "--columns", "x,y", "--units", "0.1", "--json", input=rows).stdout)
    assert [(one["label"], one["movements"], one["duration"]["median"]) for one in data["labels"]] == [
        ("0", 3, pytest.approx(0.5)),
        ("1", 3, pytest.approx(0.5)),
    ]
    log = "aX,aY\n" + "".join(f"{k * k},{100 - k}\n" for k in range(40))
    assert run("-", "--every", "10", "--units", "0.01", input=log).stdout.startswith("4 movements of 2 dimensions")
    done = run("-", "--every", "11", "--units", "0.01", input=log)
    assert (done.returncode, done.stdout) == (1, "")
    assert "expected blocks of 11 samples, got 40 samples: 3 blocks and 7 more" in done.stderr

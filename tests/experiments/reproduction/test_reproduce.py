"""``kineme reproduce`` as a user runs it: files, determinism, errors."""

import importlib.util
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

ARM = all(map(importlib.util.find_spec, ("pinocchio", "pink")))  # the extra robot is installed


def reproduce(*arguments):
    command = [sys.executable, "-W", "error", "-m", "kineme", "reproduce", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folders = [tmp_path_factory.mktemp("run") / "new" / "out" for _ in range(2)]
    with ThreadPoolExecutor() as both:  # side by side: each uses one processor most of the time
        done = both.map(lambda folder: reproduce("--quick", "--draws", 2, "--seed", 5, "--out", folder), folders)
        return list(zip(done, folders, strict=True))


def test_it_succeeds_and_says_where_to_look(runs):
    done, folder = runs[0]
    assert done.returncode == 0, done.stderr
    assert str(folder / "report.html") in done.stdout


def test_it_prints_all_tables_with_the_papers_numbers(runs):
    text = runs[0][0].stdout
    for expected in ("Table 1", "Table 2", "Table 3", "Table 4", "Diagnosis", "26 single shapes", "0.815", "0.926"):
        assert expected in text


def test_it_draws_eleven_figures_as_png_and_svg(runs):
    folder = runs[0][1]
    for k in range(1, 12):
        assert (folder / f"figure-{k:02d}.png").read_bytes().startswith(b"\x89PNG")
        assert b"<svg" in (folder / f"figure-{k:02d}.svg").read_bytes()


def test_the_report_is_one_self_contained_file(runs):
    html = (runs[0][1] / "report.html").read_text(encoding="utf-8")
    assert html.count("<img") == 11 + ARM
    assert html.count("<table>") >= 7
    assert not re.search(r'(src|href)="(?!data:)', html)


def test_the_same_seed_gives_the_same_bytes_but_for_times(runs):
    def stable(folder):
        return re.sub(r'"seconds": [\d.]+', "", (folder / "results.json").read_text(encoding="utf-8"))

    assert stable(runs[0][1]) == stable(runs[1][1])
    for name in ("figure-03.svg", "figure-07.png", "tables.txt", "report.html"):
        assert (runs[0][1] / name).read_bytes() == (runs[1][1] / name).read_bytes()


def test_results_hold_every_accuracy_draw_by_draw(runs):
    results = json.loads((runs[0][1] / "results.json").read_text(encoding="utf-8"))
    assert results["seed"] == 5
    assert len(results["draw_by_draw"]["paper"]) == 2
    assert results["draw_by_draw"]["paper"][0]["nearest"]["bio-sa"] == 1.0
    assert set(results["versions"]) >= {"kineme", "numpy", "scikit-learn", "python"}


def test_nothing_but_the_results_is_left_in_the_folder(runs):
    assert not [path.name for path in runs[0][1].iterdir() if path.name.startswith(".")]


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    done = reproduce("--quick", "--out", blocked / "out")
    assert done.returncode == 1
    assert done.stderr.startswith("kineme: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("arguments", [("--draws", 0), ("--seed", -1), ("--draws", "many")])
def test_impossible_options_are_refused(arguments):
    assert reproduce(*arguments).returncode == 2


@pytest.mark.skipif(not ARM, reason="the extra robot is not installed")
def test_the_arm_writes_the_letter_and_recognizes_what_it_wrote(runs):
    text, folder = runs[0][0].stdout, runs[0][1]
    assert (folder / "figure-07-arm.png").read_bytes().startswith(b"\x89PNG")
    for expected in ("Figure 7 b, c", "Table 2 on movements of the arm", "Table 4 on movements of the arm"):
        assert expected in text
    arm = json.loads((folder / "results.json").read_text(encoding="utf-8"))["arm"]
    assert (arm["movements"], len(arm["paper"]), len(arm["lasa-26"])) == (178, 2, 2)
    assert 0 < arm["error"] < 5e-5
    assert 0 < arm["letter"]["tracking_rms"] <= arm["letter"]["tracking_max"] < 5e-5
    assert 0 < arm["letter"]["velocity_share"] < 1

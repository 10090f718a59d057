"""``kineme library``: an action library as people keep it in order from the shell."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from commands import answer, run, start

import kineme
from kineme.library.storage import changes

WICKED = "../wave'; DROP TABLE movement; -- $(touch x) \u202e\x1b[31m Ünï"


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "an action library"
    with kineme.ActionLibrary(path, create=True) as library:
        library.learn(kineme.load_lasa(["CShape", "GShape", "NShape"]))
    return path


def test_list_shows_symbols_and_counts(folder):
    listed = answer("library", "list", "-l", folder)
    assert (listed["movements"], listed["unlabeled"], listed["dimensions"]) == (21, 0, 2)
    assert [(one["name"], one["movements"]) for one in listed["symbols"]] == [
        ("CShape", 7),
        ("GShape", 7),
        ("NShape", 7),
    ]
    text = start("library", "list", "-l", folder).stdout
    assert "21 movements, 3 symbols, 0 without a symbol" in text
    assert listed["symbols"][0]["id"] in text


@pytest.mark.soak
def test_the_library_may_come_from_the_environment(folder):
    done = subprocess.run(
        [sys.executable, "-m", "kineme", "library", "list", "--json"],
        capture_output=True, text=True, check=True, env={"KINEME_LIBRARY": str(folder), "PATH": ""},
    )  # fmt: skip
    assert json.loads(done.stdout)["movements"] == 21


def test_show_gives_every_movement_of_a_symbol(folder):
    shown = answer("library", "show", "GShape", "-l", folder)
    demos = kineme.load_lasa(["GShape"])
    assert [one["name"] for one in shown["members"]] == list(demos.names)
    np.testing.assert_allclose([one["duration"] for one in shown["members"]], demos.durations)
    np.testing.assert_allclose([one["start"] for one in shown["members"]], [one.positions[0] for one in demos])
    assert answer("library", "show", shown["id"], "-l", folder) == shown  # an id does as well
    assert "GShape 3" in run("library", "show", "GShape", "-l", folder).stdout


def test_any_name_is_data(folder):
    """Separators, quotes, commands and escape sequences neither act nor get lost."""
    before = answer("library", "show", "GShape", "-l", folder)
    renamed = answer("library", "rename", "GShape", WICKED, "-l", folder, by=start)
    assert (renamed["name"], renamed["id"], renamed["was"]) == (WICKED, before["id"], "GShape")
    assert answer("library", "show", WICKED, "-l", folder)["members"] == before["members"]
    text = run("library", "list", "-l", folder).stdout
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert "\\x1b[31m" in text
    assert not list(folder.parent.glob("**/x"))
    assert sorted(path.name for path in folder.parent.iterdir()) == [folder.name]


def test_annotate_merge_delete_and_history(folder):
    assert answer("library", "annotate", "CShape", "open, like a C", "-l", folder)["description"] == "open, like a C"
    merged = answer("library", "merge", "CShape", "GShape", "--into", "round", "-l", folder)
    assert (merged["name"], merged["movements"], len(merged["parents"])) == ("round", 14, 2)
    answer("library", "delete", "NShape", "-y", "-l", folder)
    answer("library", "delete", "--movement", 1, "--movement", 2, "-y", "-l", folder)
    now = answer("library", "list", "-l", folder)
    assert (now["movements"], now["unlabeled"], [one["name"] for one in now["symbols"]]) == (19, 7, ["round"])
    versions = answer("library", "history", "-l", folder)
    assert [one["action"] for one in versions] == ["learn", "annotate", "merge", "delete", "delete"]
    assert answer("library", "list", "--at", 1, "-l", folder)["movements"] == 21
    assert len(answer("library", "history", "-n", 2, "-l", folder)) == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [("merge", ("CShape", "GShape", "--into", "round")), ("split", ("NShape", "--movement", 15, "--into", "en"))],
)
def test_merge_and_split_say_the_version_that_they_made(folder, monkeypatch, change, words):
    """And not one that somebody else made meanwhile."""
    done = getattr(changes, change)

    def before_another(*given):
        version = done(*given)
        with kineme.ActionLibrary(folder) as library:
            library.annotate(library.symbols()[0].name, "by somebody else")
        return version

    monkeypatch.setattr(changes, change, before_another)
    assert answer("library", change, *words, "-l", folder)["version"] == 2
    with kineme.ActionLibrary(folder) as library:
        library.undo(to=1)
    assert run("library", change, *words, "-l", folder).stdout.endswith("; version 5\n")


def test_changes_are_taken_back_one_after_the_other(folder):
    answer("library", "rename", "CShape", "round", "-l", folder)
    answer("library", "delete", "NShape", "-y", "-l", folder)
    late = run("library", "undo", "--at", 2, "-l", folder)
    assert late.returncode == 1
    assert "the library is at version 3 by now" in late.stderr
    assert answer("library", "undo", "--at", 3, "-l", folder) == {"undone": "delete", "to": 2, "version": 4}
    done = start("library", "undo", "-l", folder)
    assert done.stdout == "took back rename; as at version 1; version 5\n"
    names = [one["name"] for one in answer("library", "list", "-l", folder)["symbols"]]
    assert names == ["CShape", "GShape", "NShape"]
    answer("library", "undo", "-l", folder)
    assert answer("library", "list", "-l", folder)["movements"] == 0
    assert "has none left" in run("library", "undo", "-l", folder).stderr
    assert run("library", "undo", "--to", 3, "-l", folder).stdout == "restored version 3; version 7\n"
    names = [one["name"] for one in answer("library", "list", "-l", folder)["symbols"]]
    assert names == ["GShape", "round"]


def test_deleting_asks_first(folder):
    assert run("library", "delete", "NShape", "-l", folder, input="n\n").returncode != 0
    assert answer("library", "list", "-l", folder)["movements"] == 21
    assert start("library", "delete", "NShape", "-l", folder, input="y\n").returncode == 0
    assert [one["name"] for one in answer("library", "list", "-l", folder)["symbols"]] == ["CShape", "GShape"]


def test_export_and_import_keep_everything(folder, tmp_path):
    written = answer("library", "export", tmp_path / "all.kinelib", "-l", folder)
    assert written["movements"] == 21
    assert written["bytes"] == (tmp_path / "all.kinelib").stat().st_size
    made = answer("library", "import", tmp_path / "all.kinelib", "-l", tmp_path / "copy")
    assert (made["movements"], made["symbols"]) == (21, 3)
    symbols = [answer("library", "list", "-l", one) for one in (folder, tmp_path / "copy")]
    assert symbols[0] == symbols[1]
    again = run("library", "import", tmp_path / "all.kinelib", "-l", folder)
    assert again.returncode == 1


def test_verify_says_what_is_damaged(folder):
    assert answer("library", "verify", "-l", folder) == {"ok": True, "movements": 21, "problems": []}
    path = folder / "library.sqlite"
    data = bytearray(path.read_bytes())
    with kineme.ActionLibrary(folder) as library:
        needle = np.asarray(library.features([9])[0], dtype="<f4").tobytes()
    place = bytes(data).find(needle[:64])
    assert place > 0
    data[place + 10] ^= 4
    path.write_bytes(data)
    done = start("library", "verify", "--json", "-l", folder)
    assert done.returncode == 1
    assert any("features of movement 9" in problem for problem in json.loads(done.stdout)["problems"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "HShape"], "expected the name or id of a symbol, got 'HShape'; there are 3, such as"),
        (["rename", "CShape", "GShape"], "'GShape'"),
        (["rename", "CShape", ""], "at least one character"),
        (["delete", "--movement", "99", "-y"], "99"),
        (["list", "--at", "99"], "99"),
    ],
)
def test_failures_are_one_line_and_change_nothing(folder, arguments, message):
    done = run("library", *arguments, "-l", folder)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith("kineme: ")
    assert done.stderr.count("\n") == 1
    assert message in done.stderr
    assert len(answer("library", "history", "-l", folder)) == 1


def test_no_library_is_said_so(tmp_path):
    done = run("library", "list", "-l", tmp_path / "nowhere")
    assert done.returncode == 1
    assert "nowhere" in done.stderr
    assert not (tmp_path / "nowhere").exists()

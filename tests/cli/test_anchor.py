"""``kineme anchor``: scripted, and as a person at a terminal uses it."""

from __future__ import annotations

import os
import pty
import select
import shutil
import subprocess
import sys
import time

import pytest
from commands import answer, run

import kineme

KINDS = ["CShape", "GShape", "NShape", "Sine"]


@pytest.fixture(scope="module")
def unlabeled(tmp_path_factory):
    """A library of movements without labels, which no test changes."""
    demos, folder = kineme.load_lasa(KINDS), tmp_path_factory.mktemp("anchor") / "actions"
    with kineme.ActionLibrary(folder, create=True) as library:
        library.learn(demos, [None] * len(demos))
        library.propose()  # what it computes is stored beside the movements
    return folder


@pytest.fixture
def folder(unlabeled, tmp_path):
    return shutil.copytree(unlabeled, tmp_path / "actions")


def test_without_a_choice_it_only_lists(folder, tmp_path):
    data = answer("anchor", "-l", folder, "--pictures", tmp_path / "pictures")
    assert sorted(len(one["movements"]) for one in data["proposals"]) == [7] * 4
    assert (data["left_over"], data["accepted"], data["rejected"]) == ([], {}, [])
    drawn = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert drawn == ["all.png", *(f"proposal-{k}.png" for k in (1, 2, 3, 4))]
    assert [os.path.basename(path) for path in data["pictures"]] == drawn
    assert len(answer("library", "history", "-l", folder)) == 1


def test_without_unlabeled_movements_it_says_so(tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(kineme.load_lasa(["CShape"]))
    assert run("anchor", "-l", tmp_path / "actions").stdout == "no unlabeled movements\n"


def test_accepted_proposals_become_symbols_with_a_prototype(folder, tmp_path):
    (tmp_path / "names.json").write_text('{"1": "first/../kind", "3": "third"}')
    options = ("--accept", "all", "--names", tmp_path / "names.json", "--pictures", tmp_path / "p")
    data = answer("anchor", "-l", folder, *options)
    assert sorted(data["accepted"]) == ["cluster 2", "cluster 4", "first/../kind", "third"]
    listed = answer("library", "list", "-l", folder)
    assert listed["unlabeled"] == 0
    truth = {i + 1: label for i, label in enumerate(kineme.load_lasa(KINDS).labels.tolist())}
    for one in listed["symbols"]:
        members = [each["id"] for each in answer("library", "show", one["id"], "-l", folder)["members"]]
        assert len({truth[i] for i in members}) == 1
        assert one["prototype"] in members


def test_movements_of_two_proposals_with_one_name_are_added_up(folder, tmp_path):
    (tmp_path / "names.json").write_text('{"1": "wave", "2": "wave"}')
    options = ("--accept", "1,2", "--names", tmp_path / "names.json", "--pictures", tmp_path / "p")
    assert answer("anchor", "-l", folder, *options)["accepted"] == {"wave": 14}


def test_what_is_rejected_is_not_proposed_again(folder, tmp_path):
    first = answer("anchor", "-l", folder, "--reject", "2", "--pictures", tmp_path / "p")
    gone = first["proposals"][1]["movements"]
    again = answer("anchor", "-l", folder, "--pictures", tmp_path / "p")
    assert len(again["proposals"]) == 3
    assert again["proposals"] == first["remaining"]
    assert set(gone) <= set(again["left_over"])
    assert not (tmp_path / "p" / "proposal-4.png").exists()  # a picture of a number that there is no more


def test_what_remains_is_listed_by_the_numbers_that_the_next_call_takes(folder, tmp_path):
    options = "-l", folder, "--method", "spectral", "--no-join", "--pictures", tmp_path / "p"
    first = answer("anchor", *options)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "all.png").write_text("mine")
    refused = run("anchor", *options, "--accept", "1", "--pictures", tmp_path / "mine")
    assert (refused.returncode, (tmp_path / "mine" / "all.png").read_text()) == (2, "mine")
    assert "choose another folder with --pictures" in refused.stderr
    done = run("anchor", *options, "--accept", "1")
    assert "3 proposals, 0 movements left over; the proposals that remain have new numbers" in done.stdout
    assert not (tmp_path / "p" / "proposal-4.png").exists()
    second = answer("anchor", *options, "--accept", "1")
    assert second["proposals"][0]["movements"] == first["proposals"][1]["movements"]
    assert [each["movements"] for each in second["proposals"][1:]] == [
        each["movements"] for each in second["remaining"]
    ]


def test_numbers_of_a_list_are_refused_once_the_library_has_changed(folder, tmp_path):
    options = "-l", folder, "--method", "spectral", "--pictures", tmp_path / "p"
    first = answer("anchor", *options)
    assert run("anchor", *options).stdout.endswith(f"the same command with --accept all --at {first['version']}\n")
    done = run("anchor", *options, "--accept", "1", "--at", first["version"])
    assert done.stdout.splitlines()[-2].endswith(f"the same command with --accept all --at {first['version'] + 1}")
    refused = run("anchor", *options, "--accept", "1,2", "--at", first["version"])
    assert "expected the library at version 1, as it was listed, it is at version 2 by now" in refused.stderr
    left = answer("anchor", *options, "--reject", "all", "--at", first["version"] + 1)
    assert [len(left["rejected"]), left["version"]] == [3, len(answer("library", "history", "-l", folder))]


def test_new_movements_join_what_they_are_recognized_as(folder, tmp_path):
    demos = kineme.load_lasa(["CShape", "Angle"])
    with kineme.ActionLibrary(folder) as library:
        library.assign(range(1, 8), "C")  # the Cs, by hand
        library.assign(range(8, 15), "G")
        library.learn([2 * one.positions + 5 for one in demos])
    assert run("anchor", "-l", folder, "--accept", "7", "--pictures", tmp_path / "p").returncode == 2
    listed = answer("anchor", "-l", folder, "--pictures", tmp_path / "p")  # nothing has joined yet
    data = answer("anchor", "-l", folder, "--accept", "all", "--pictures", tmp_path / "p")
    assert (listed["would_join"], listed["joined"]) == ({"C": 7}, {})
    assert (data["would_join"], data["joined"]) == ({}, {"C": 7})
    assert listed["proposals"] == data["proposals"]  # a number means the same when listed and when accepted
    assert sorted(len(one["movements"]) for one in data["proposals"]) == [7, 7, 7]  # N, sine, angle
    actions = [one["action"] for one in answer("library", "history", "-l", folder)]
    assert actions[:4] == ["learn", "assign", "assign", "learn"]


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["--accept", "9"], 2, "there are 4 proposals, counted from 1, got 9"),
        (["--reject", "0"], 2, "there are 4 proposals, counted from 1, got 0"),
        (["--accept", "x"], 2, "expected numbers of proposals separated by commas, or all, got 'x'"),
        (["--accept", "2,1", "--reject", "1"], 2, "expected each proposal accepted or rejected, got both for 1"),
        (["--accept", "all", "--names", "worse.json"], 1, "expected a name without the character U+0000"),
        (["--accept", "all", "--names", "old.json"], 1, "proposals are counted from 1, got 0"),
        (["--accept", "1", "--names", "more.json"], 2, "there are 4 proposals, counted from 1, got 9"),
        (["--accept", "1", "--names", "bad.json"], 1, "expected bad.json to hold names by the number"),
        (["--at", "1"], 2, "expected --at with --accept or --reject, got neither"),
        (["--clusters", "3", "--method", "hdbscan"], 1, "expected no n_clusters with method='hdbscan'"),
    ],
)
def test_wrong_choices_change_nothing(folder, tmp_path, arguments, status, message):
    (tmp_path / "bad.json").write_text("[1, 2]")
    (tmp_path / "more.json").write_text('{"1": "wave", "9": "ghost"}')
    (tmp_path / "old.json").write_text('{"0": "wave", "1": "nod"}')
    (tmp_path / "worse.json").write_text('{"0": "wave", "1": "a\\u0000"}')
    done = run("anchor", "-l", folder, *arguments, cwd=tmp_path)
    assert done.returncode == status
    assert message in done.stderr
    assert len(answer("library", "history", "-l", folder)) == 1


class Terminal:
    """A person at a pseudo-terminal."""

    def __init__(self, *arguments, cwd):
        self.master, slave = pty.openpty()
        command = [sys.executable, "-W", "error", "-m", "kineme", *map(str, arguments)]
        self.process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, cwd=cwd, close_fds=True)
        os.close(slave)
        self.seen = ""

    def until(self, text, seconds=300):
        """Read until the text has come since the last answer; all that came."""
        deadline = time.monotonic() + seconds
        while text not in self.seen:
            assert time.monotonic() < deadline, f"waited for {text!r}, got {self.seen!r}"
            if select.select([self.master], [], [], 0.2)[0]:
                try:
                    self.seen += os.read(self.master, 65536).decode()
                except OSError:  # the other end is closed
                    assert text in self.seen, f"waited for {text!r}, got {self.seen!r}"
        return self.seen

    def answer(self, line, then):
        """Type a line, and wait for what follows."""
        self.seen = ""
        os.write(self.master, (line + "\n").encode())
        return self.until(then)

    def close(self):
        """The exit status."""
        status = self.process.wait(300)
        os.close(self.master)
        return status


def test_a_person_names_splits_rejects_and_quits(folder, tmp_path):
    person = Terminal("anchor", "-l", folder, "--clusters", 2, cwd=tmp_path)
    assert "2 proposals" in person.until("name:")
    assert "/reject" in person.answer("/help", "name:")
    assert "CShape" in person.answer("/members", "name:") + person.answer("", "name:") + person.answer(
        "/members", "name:"
    )
    assert "expected a name or one of /split" in person.answer("/nonsense", "name:")
    person.answer("/quit", "without one")
    assert person.close() == 0
    assert len(answer("library", "history", "-l", folder)) == 1

    person = Terminal("anchor", "-l", folder, "--clusters", 2, "--pictures", "pictures", cwd=tmp_path)
    first = person.until("name:")
    assert "movements" in first
    assert "proposal-1.png" in first
    parts = person.answer("/split", "name:")
    assert "1a:" in parts
    assert "1b:" in person.answer("wave 'em; rm -rf /", "1b:")
    person.answer("wave 'em; rm -rf /", "join")  # the same name again: asked whether to join
    person.answer("n", "name:")
    person.answer("/name /etc/passwd", "name:")
    person.answer("/reject", "without one")
    assert person.close() == 0
    names = [one["name"] for one in answer("library", "list", "-l", folder)["symbols"]]
    assert sorted(names) == ["/etc/passwd", "wave 'em; rm -rf /"]
    assert answer("library", "history", "-l", folder)[-1]["action"] == "reject"


@pytest.mark.soak
def test_the_end_of_the_input_ends_the_dialogue(folder, tmp_path):
    person = Terminal("anchor", "-l", folder, "--pictures", "pictures", cwd=tmp_path)
    person.until("name:")
    person.answer("kept", "name:")
    os.write(person.master, b"\x04")  # end of the input
    person.until("without one")
    assert person.close() == 0
    assert [one["name"] for one in answer("library", "list", "-l", folder)["symbols"]] == ["kept"]

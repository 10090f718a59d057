"""Symbols looked at again: which could be one, which are two."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

import kineme
from kineme.anchoring.proposals import Proposal, Proposals
from kineme.cli import main
from kineme.library.proposals import _without

MIXED = {"CShape": "round", "GShape": "gee", "NShape": "mixed", "Sine": "mixed"}


@pytest.fixture
def folder(tmp_path):
    """One shape under two names, and two shapes under one name."""
    demos = kineme.load_lasa(list(MIXED))
    labels = [MIXED[label] for label in demos.labels.tolist()]
    labels[:3] = ["also round"] * 3
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demos, labels)
    return tmp_path / "actions"


def test_review_names_what_is_one_and_what_is_two(folder):
    with kineme.ActionLibrary(folder) as library:
        review = library.review()
        assert [(pair.first, pair.second) for pair in review.merges] == [("also round", "round")]
        assert [split.symbol for split in review.splits] == ["mixed"]
        parts = sorted(sorted(part.tolist()) for part in review.splits[0].parts)
        assert parts == [list(range(15, 22)), list(range(22, 29))]
        library.merge(["also round", "round"], "round")
        library.split("mixed", parts[1], "sine")
        assert library.review().merges == library.review().splits == ()


@pytest.mark.soak
def test_the_shell_reviews_and_splits(folder):
    def run(*arguments):
        done = CliRunner().invoke(main, ["library", *map(str, arguments), "-l", str(folder)], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        return done.output

    command = [sys.executable, "-W", "error", "-m", "kineme", "library", "review", "-l", str(folder)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "also round and round could be one" in text
    assert "mixed could be two: 7 movements, and " in text
    part = json.loads(run("review", "--json"))["splits"][0]["parts"][1]
    result = json.loads(run("split", "mixed", "--into", "other", "--json", *(f"--movement={i}" for i in part)))
    assert (result["name"], result["movements"]) == ("other", 7)
    run("merge", "also round", "round", "--into", "round")
    assert run("review") == "the symbols are well apart, and none falls into two clusters\n"


def test_one_symbol_has_nothing_to_be_compared_with(tmp_path):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        assert library.review().merges == ()
        library.learn(kineme.load_lasa(["CShape"]))
        assert library.review().splits == ()


@pytest.mark.parametrize(("rejected", "left"), [(8, 1), (7, 2)])
def test_a_proposal_is_left_out_if_four_fifths_of_it_were_rejected(rejected, left):
    """The others are numbered anew."""
    members = (np.arange(10), np.arange(10, 14))
    proposals = Proposals(
        tuple(Proposal(some, int(some[0]), 1.0, 1.0, 1 - k, 0.5) for k, some in enumerate(members)),
        np.repeat([0, 1], [10, 4]),
        np.ones(3),
    )
    remaining = _without(proposals, [np.arange(rejected)])
    assert [len(proposal) for proposal in remaining.proposals] == [10, 4][-left:]
    assert remaining.clusters.tolist() == ([-1] * 10 + [0] * 4 if left == 1 else [0] * 10 + [1] * 4)
    assert remaining[-1].nearest == (None if left == 1 else 0)

"""An audit in words, as data, as a page, and as what a training script takes."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from audit_samples import episodes, shift, slow_clock, spike

from kineme.audit.page import DRAWN, audit_page, drawn_episodes
from kineme.audit.report import (
    audit_as_data,
    audit_as_words,
    kept_episodes,
    lerobot_arguments,
    stretch_of,
    verdict,
    write_kept,
)
from kineme.audit.run import KINDS, Reason, audit_episodes


@pytest.fixture(scope="module")
def mixed():
    some = episodes(100)
    some[5], some[17], some[30] = spike(some[5]), slow_clock(some[17]), shift(some[30])
    return some


@pytest.fixture(scope="module")
def audit(mixed):
    return audit_episodes(mixed)


def test_words_say_which_why_where_and_what_to_do(audit):
    words = audit_as_words(audit)
    flat = " ".join(words.split())
    assert "100 episodes of 1 task" in flat
    assert "1 contradicts what the set declares, 2 lie far beyond the others" in flat
    assert "frames come at 25 per second, the data set declares 50" in flat
    assert re.search(r"lift.pos jumps within one frame, \d+ times its noise", flat)
    assert "at 3.98 s" in flat
    assert "Calibrate again; subtract the offset." in flat
    assert words.index("contradiction  0") < words.index("outlying  ") < words.index("unusual  ")


def test_a_set_without_faults_is_said_to_have_none():
    clean = audit_episodes(episodes(60, seed=4))
    if not any(finding.kind == "outlying" for finding in clean.findings):
        assert "Nothing stands out" in verdict(clean)
    assert "at most 5 % of the good episodes" in verdict(clean).lower()


def test_a_set_whose_bad_episodes_hide_each_other_is_said_to_be_one():
    clean = audit_episodes(episodes(60, seed=4))
    assert "vouch for each other" not in verdict(clean)
    evidence = clean.evidence.copy()
    evidence[np.flatnonzero(~clean.flagged)[:3]] = 14.0
    assert "3 more are as unusual as no good ones are" in verdict(replace(clean, evidence=evidence))


def test_an_episode_whose_task_is_not_known_is_none_of_another_task():
    some = episodes(9)
    assert audit_episodes([*some[:8], replace(some[8], task=None)]).tasks == 1
    assert audit_episodes(replace(episode, task=None) for episode in some).tasks == 1


def test_too_few_are_uncalibrated_in_words():
    assert "Uncalibrated: it takes 20 episodes" in verdict(audit_episodes(episodes(9)))


def test_data_are_json_with_all_that_is_said(audit):
    data = json.loads(json.dumps(audit_as_data(audit), allow_nan=False))
    assert data["flagged"] == len(data["findings"]) == audit.flagged.sum()
    assert {finding["kind"] for finding in data["findings"]} <= set(KINDS)
    first = data["findings"][0]
    assert (first["episode"], first["p_value"], first["reasons"][0]["check"]) == (17, 0.0, "rate")
    assert first["reasons"][0]["evidence"] is None


def test_the_mask_keeps_what_is_not_flagged(audit, tmp_path):
    with write_kept(tmp_path / "keep.csv", audit).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["episode_index", "keep", "p", "reason"]
    assert [int(row["episode_index"]) for row in rows if row["keep"] == "1"] == kept_episodes(audit)
    assert all(bool(row["reason"]) != (row["keep"] == "1") for row in rows)
    assert not {5, 17, 30} & set(kept_episodes(audit))
    assert json.loads(write_kept(tmp_path / "keep.json", audit).read_text()) == kept_episodes(audit)


def test_of_an_episode_that_is_there_twice_neither_is_kept_where_one_is_flagged(audit):
    doubled = replace(audit, numbers=np.array([3, 4, 3, 5]), flagged=np.array([False, False, True, False]))
    assert kept_episodes(doubled) == [4, 5]


def test_the_mask_writes_over_nothing(audit, tmp_path):
    path = tmp_path / "keep.csv"
    path.write_text("mine")
    with pytest.raises(FileExistsError):
        write_kept(path, audit)
    assert path.read_text() == "mine"
    assert write_kept(path, audit, replace=True).read_text() != "mine"


def test_lerobot_is_given_the_kept_episodes(audit):
    argument, call = lerobot_arguments(audit)
    numbers = json.dumps(kept_episodes(audit)).replace(" ", "")
    assert f'--dataset.episodes "{numbers}"' in argument
    assert call == f"LeRobotDataset(repo_id, episodes={numbers})"


def test_a_list_that_no_shell_takes_is_read_from_the_file(audit):
    long = replace(audit, numbers=np.arange(1000), flagged=np.zeros(1000, dtype=bool))
    lines = lerobot_arguments(long, Path("keep.json"))
    assert 'open("keep.json")' in lines[0]
    assert max(map(len, lines)) < 200


def test_stretches_in_words():
    reason = Reason("idle", "rests", "", 1.0, 3.5, 9.0)
    assert stretch_of(reason, 10.0) == " from 1.00 to 3.50 s"
    assert stretch_of(reason._replace(end=1.02), 10.0) == " at 1.00 s"
    assert stretch_of(reason._replace(start=0.0, end=10.0), 10.0) == ""


def strips(text):
    return [ElementTree.fromstring(svg) for svg in re.findall(r"<svg.*?</svg>", text, re.DOTALL)]


def test_the_page_draws_each_flagged_episode_with_its_stretches(audit, mixed):
    text = audit_page(audit, "my set", mixed, {"data set": "my set"})
    drawings = strips(text)
    assert len(drawings) == 1 + audit.flagged.sum()
    labels = [drawing.get("aria-label") for drawing in drawings]
    assert labels[0] == f"{audit.flagged.sum()} of 100 episodes are flagged"
    spiked = next(drawing for drawing, label in zip(drawings, labels, strict=True) if " episode 5 " in label)
    titled = {
        box.find("title").text: float(box.get("x")) for box in spiked.iter("rect") if box.find("title") is not None
    }
    assert titled["spikes"] == pytest.approx(44 + (1040 - 56) * 3.98 / mixed[5].times[-1], abs=5)
    assert "http" not in text.replace("http-equiv", "")


def test_names_in_the_page_are_texts():
    evil = "<script>alert(1)</script>"
    some = [replace(each, task=evil) for each in episodes(21)]
    some[3] = replace(spike(some[3]), names=dict.fromkeys(some[3].signals, (evil, *some[3].names["action"][1:])))
    some = [replace(each, names=some[3].names) for each in some]
    text = audit_page(audit_episodes(some), evil, some, {})
    assert "<script" not in text
    assert "&lt;script&gt;" in text


def test_the_page_draws_some_and_lists_the_rest():
    many = [slow_clock(each) if each.number % 3 == 0 else each for each in episodes(150)]
    audit = audit_episodes(many)
    assert len(audit.findings) > DRAWN
    assert len(drawn_episodes(audit)) == DRAWN
    text = audit_page(audit, "set", many, {})
    assert len(strips(text)) == 1 + DRAWN
    assert "And these" in text


def test_a_page_without_signals_has_the_reasons(audit):
    text = audit_page(audit, "set", [], {})
    assert len(strips(text)) == 1
    assert "frames come at 25 per second" in text

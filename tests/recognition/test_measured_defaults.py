"""The table of defaults in docs/recognition.md is that of ``python -m bench --only defaults``."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_the_page_shows_what_was_measured():
    rows = json.loads((ROOT / "bench" / "results" / "defaults.json").read_text(encoding="utf-8"))["rows"]
    measured = {row["what"]: row["ours"] for row in rows}
    names = {what.rsplit(", ", 1)[0] for what in measured if what.endswith(("moderately", "strongly"))}
    page = " ".join((ROOT / "docs" / "recognition.md").read_text(encoding="utf-8").split())
    table = page[page.index("## How the defaults were chosen") : page.index("**Many demonstrations.**")]
    shown = {f"{name} {measured[f'{name}, moderately']:.3f} / {measured[f'{name}, strongly']:.3f}" for name in names}
    assert not {one for one in shown if one not in table}
    assert len(re.findall(r"[\d.]+ / [\d.]+", table)) == len(names)


def test_the_page_shows_what_was_measured_with_many():
    rows = json.loads((ROOT / "bench" / "results" / "defaults.json").read_text(encoding="utf-8"))["rows"]
    many = {row["what"].removeprefix("many shown: "): row["ours"] for row in rows if row["what"].startswith("many")}
    page = " ".join((ROOT / "docs" / "recognition.md").read_text(encoding="utf-8").split())
    said = page[page.index("**Many demonstrations.**") : page.index("Beyond some ten thousand")]
    assert re.findall(r"\b0\.\d{3}\b", said) == [f"{value:.3f}" for value in many.values()]
    nearest = [value for name, value in many.items() if name.startswith("1-NN")]
    vector = [value for name, value in many.items() if name.startswith("SVM")]
    assert nearest[1] > nearest[0]  # chosen weights help
    assert vector[1] > vector[0]  # and so do wide kernels
    assert ("the SVM itself is not ahead of 1-NN" in said) is (max(vector) <= max(nearest))


def test_one_number_of_it_measured_again():
    sys.path.insert(0, str(ROOT))
    try:
        from bench.defaults import LEVELS, accuracy
    finally:
        sys.path.remove(str(ROOT))
    rows = json.loads((ROOT / "bench" / "results" / "defaults.json").read_text(encoding="utf-8"))["rows"]
    measured = {row["what"]: row["ours"] for row in rows}
    assert accuracy({}, LEVELS["strongly"], 5) == pytest.approx(measured["defaults, strongly"], abs=0.005)

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
    names = {what.rsplit(", ", 1)[0] for what in measured}
    page = " ".join((ROOT / "docs" / "recognition.md").read_text(encoding="utf-8").split())
    table = page[page.index("## How the defaults were chosen") : page.index("**Many demonstrations.**")]
    shown = {f"{name} {measured[f'{name}, moderately']:.3f} / {measured[f'{name}, strongly']:.3f}" for name in names}
    assert not {one for one in shown if one not in table}
    assert len(re.findall(r"[\d.]+ / [\d.]+", table)) == len(names)


def test_one_number_of_it_measured_again():
    sys.path.insert(0, str(ROOT))
    try:
        from bench.defaults import LEVELS, accuracy
    finally:
        sys.path.remove(str(ROOT))
    rows = json.loads((ROOT / "bench" / "results" / "defaults.json").read_text(encoding="utf-8"))["rows"]
    measured = {row["what"]: row["ours"] for row in rows}
    assert accuracy({}, LEVELS["strongly"], 5) == pytest.approx(measured["defaults, strongly"], abs=0.005)

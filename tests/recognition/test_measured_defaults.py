"""The tables of results in the pages about recognition are those of the benchmark and of the evaluation."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from result_tables.__main__ import DEFAULTS, recognition
from result_tables.measured import filled

ROOT = Path(__file__).parents[2]


def _measured():
    rows = json.loads((ROOT / "experiments" / "results" / "defaults.json").read_text(encoding="utf-8"))["rows"]
    return {row["what"]: row["ours"] for row in rows}


@pytest.mark.parametrize(("page", "texts"), recognition().items(), ids=lambda value: getattr(value, "name", ""))
def test_the_page_shows_what_was_measured(page, texts):
    text = page.read_text(encoding="utf-8")
    assert text == filled(text, texts), "run make tables"


def test_every_value_that_was_measured_is_shown():
    shown = {name for _, names in DEFAULTS.values() for name in names}
    assert {what.rsplit(", ", 1)[0] for what in _measured() if not what.startswith("many shown")} == shown


def test_the_whole_is_ahead_of_each_part():
    """What the page says of people, whom the defaults serve."""
    measured = {what.removesuffix(", by others"): value for what, value in _measured().items() if "by others" in what}
    whole = measured["defaults"]
    assert all(value < whole for name, value in measured.items() if name.endswith("alone"))
    kept = {"without positions over arc length", "without point cloud", "without elastic path in detail"}
    assert all(value < whole for name, value in measured.items() if name.startswith("without") and name not in kept)


def test_one_number_of_it_measured_again():
    from bench.defaults import LEVELS, accuracy

    assert accuracy({}, LEVELS["strongly"], 5) == pytest.approx(_measured()["defaults, strongly"], abs=0.003)

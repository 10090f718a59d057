"""What the tutorial of a million movements says it took is what that page took, with all its parts."""

from pathlib import Path

from bench.million import COUNTS, parts
from result_tables.million import by_part

ROOT = Path(__file__).parents[1]


def test_every_part_with_code_was_measured_with_every_number():
    coded = [heading for heading, text in parts(20_000) if "```python" in text]
    took = by_part()
    assert list(took) == coded
    assert all(sorted(one) == list(COUNTS) for one in took.values())


def test_the_number_of_the_page_is_the_one_that_is_raised():
    raised = "".join(text for _, text in parts(1_000_000))
    assert "\nMOVEMENTS = 1000000 " in raised
    assert "MOVEMENTS = 20_000" not in raised


def test_the_picture_is_small():
    assert (ROOT / "docs" / "images" / "million.png").stat().st_size < 200_000

"""The table of speeds on the page of concepts is what was measured."""

from __future__ import annotations

import re

from concept_figures import EXAMPLES, SCRIPTS
from walk_through import DOCS

from result_tables.concepts import PAGE, speed
from result_tables.measured import filled


def test_the_page_holds_the_table_of_the_results():
    page = PAGE.read_text(encoding="utf-8")
    assert filled(page, {"speed": speed()}) == page
    changed = page.replace(speed().splitlines()[-1], "| something else | 1 | | |")
    assert changed != page
    assert filled(changed, {"speed": speed()}) == page


def test_pictures_of_concepts_come_from_scripts_that_are_there():
    shown = {
        name
        for page in (DOCS / "concepts").glob("*.md")
        for name in re.findall(r"images/(concept-\w+)\.png", page.read_text(encoding="utf-8"))
    }
    assert shown == set(SCRIPTS)
    assert all((EXAMPLES / script).is_file() for script in SCRIPTS.values())
    assert all((DOCS / "images" / f"{name}.png").stat().st_size < 200_000 for name in SCRIPTS)

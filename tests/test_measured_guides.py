"""Tables and sentences of the guide hold what the benchmark measured."""

import pytest

from result_tables import large_archives, motion_layer, planning
from result_tables.__main__ import GUIDES
from result_tables.measured import filled


@pytest.mark.parametrize("module", GUIDES, ids=lambda module: module.PAGE.name)
def test_the_page_shows_what_was_measured(module):
    page = module.PAGE.read_text(encoding="utf-8")
    assert page == filled(page, module.tables()), "run make tables"


OF_SEVERAL = large_archives.tables() | motion_layer.tables() | planning.tables()


@pytest.mark.parametrize("page", OF_SEVERAL, ids=lambda page: page.name)
def test_pages_of_one_benchmark_show_what_was_measured(page):
    text = page.read_text(encoding="utf-8")
    assert text == filled(text, OF_SEVERAL[page]), "run make tables"

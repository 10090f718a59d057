"""Tables and sentences of the guide hold what the benchmark measured."""

import pytest

from result_tables.__main__ import GUIDES
from result_tables.measured import filled


@pytest.mark.parametrize("module", GUIDES, ids=lambda module: module.PAGE.name)
def test_the_page_shows_what_was_measured(module):
    page = module.PAGE.read_text(encoding="utf-8")
    assert page == filled(page, module.tables()), "run make tables"

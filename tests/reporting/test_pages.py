"""HTML reports on screens of any width."""

import re

from kineme.reporting.page import page
from kineme.reporting.table import Table, to_html


def test_on_a_phone_the_title_of_a_table_does_not_widen_it():
    """A title on one line made tables of 390 pixels 890 wide; what is wider still scrolls within its figure."""
    text = page("t", "h", to_html(Table("A long title " * 9, ("a", "b"), [("1", "2")])), {})
    assert 'name="viewport" content="width=device-width' in text
    narrow = re.search(r"@media \(max-width: 40rem\) \{(.*?)\n\}", text, re.DOTALL)
    assert narrow is not None
    assert re.search(r"caption \{[^}]*white-space: normal;[^}]*max-width: calc\(100vw", narrow[1])
    assert re.search(r"figure \{[^}]*overflow-x: auto", text)

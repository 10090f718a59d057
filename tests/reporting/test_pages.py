"""HTML reports on screens of any width."""

import re

import pytest

from browsing import violations
from kineme.reporting.page import page
from kineme.reporting.table import Table, to_html


def test_on_a_phone_the_title_of_a_table_does_not_widen_it():
    """A title on one line made tables of 390 pixels 890 wide; what is wider still scrolls within its figure."""
    text = page("t", "h", ["v"], to_html(Table("A long title " * 9, ("a", "b"), [("1", "2")])), {})
    assert 'name="viewport" content="width=device-width' in text
    narrow = re.search(r"@media \(max-width: 40rem\) \{(.*?)\n\}", text, re.DOTALL)
    assert narrow is not None
    assert re.search(r"caption \{[^}]*white-space: normal;[^}]*max-width: calc\(100vw", narrow[1])
    assert re.search(r"figure \{[^}]*overflow-x: auto", text)


def test_what_to_think_of_it_comes_first_and_names_are_escaped():
    text = page("t", "h", ["All <b> is well.", ""], "<figure>f</figure>", {})
    assert '<h1>h</h1>\n<div class="verdict"><p>All &lt;b&gt; is well.</p></div>\n<figure>' in text


@pytest.mark.parametrize(("scheme", "paper"), [("light", "rgb(255, 255, 255)"), ("dark", "rgb(20, 24, 28)")])
def test_reports_are_legible_by_light_and_in_the_dark(browser, scheme, paper):
    """With colors of their own, and no filter over pictures."""
    table = to_html(Table("A title", ("a", "b"), [("1", "2")], "What it says."))
    shown = browser.new_page(color_scheme=scheme)
    body = f'<p class="lead">l</p>{table}<figure><img alt="p" src="data:,"></figure>'
    shown.set_content(page("t", "h", ["v", "w"], body, {"n": 1}))
    assert shown.evaluate("getComputedStyle(document.body).backgroundColor") == paper
    assert shown.evaluate("getComputedStyle(document.querySelector('img')).filter") == "none"
    assert violations(shown, runOnly=["color-contrast"]) == []
    shown.close()

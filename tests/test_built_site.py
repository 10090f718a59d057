"""The site as it was built: `make check-docs` opens it, asks its search, and looks for what keeps readers out.

Where no site is named in KINEME_SITE these tests are skipped, so that no old one is judged.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from browsing import Pages, broken_rules, wait_until

SITE = Path(os.environ.get("KINEME_SITE", "nowhere"))
pytestmark = pytest.mark.skipif(not (SITE / "search.html").is_file(), reason="KINEME_SITE names no built site")

#: One page of each kind; and some that have all colors.
KINDS = (
    "index", "start/install", "concepts/movement-primitive", "concepts/glossary", "how-to/file-not-read",
    "gallery/index", "gallery/primitives/plot_formulations", "guide/recordings", "reference/generated/kineme.DMP",
    "reference/generated/kineme-learn", "beside-others", "search", "_static/draw-light",
)  # fmt: skip
COLORED = (
    "index",
    "concepts/movement-primitive",
    "reference/generated/kineme.kernels.RBF",
    "reference/generated/kineme-learn",
    "_static/draw-dark",
)
PICTURED = ("index", "guide/robots", "gallery/index")
WIDTHS = (390, 820, 1440)
_STICKS_OUT = """() => [...document.querySelectorAll('article :is(h1, h2, h3, p, table, pre, img)')].filter((one) => {
  const article = one.closest('article').getBoundingClientRect(), box = one.getBoundingClientRect();
  let around = one;
  const scrolls = () => /auto|scroll/.test(getComputedStyle(around).overflowX);
  while (around.tagName !== 'ARTICLE' && !scrolls()) around = around.parentElement;
  return box.width && box.right > article.right + 2 && around.tagName === 'ARTICLE';
}).map((one) => one.outerHTML.slice(0, 80))"""

#: What a newcomer types -> the page that answers.
QUESTIONS = {
    "how many demonstrations": "how-to/how-many-demonstrations",
    "how many demonstrations do I need?": "how-to/how-many-demonstrations",
    "which fit": "how-to/which-fit",
    "joints that wrap": "how-to/joints-that-wrap",
    "gripper": "how-to/grippers",
    "phone accelerometer": "how-to/phone",
    "csv with joints and a gripper": "how-to/grippers",
    "quaternion order": "how-to/poses-in-the-shell",
    "poses in the shell": "how-to/poses-in-the-shell",
    "labels from file names": "how-to/labels-from-file-names",
    "rate of a stream": "how-to/rate-of-a-stream",
    "lab streaming layer": "how-to/sensors",
    "trim rests": "how-to/trim-rests",
    "units millimeters": "how-to/units",
    "my file is not read": "how-to/file-not-read",
    "everything is unknown": "how-to/everything-is-unknown",
    "new goal looks wrong": "how-to/new-goal-looks-wrong",
    "why is the first call slow": "how-to/the-first-call-is-slow",
    "via points": "guide/modulation",
    "avoid an obstacle": "guide/live-control",
    "read a ROS bag": "guide/ros-bags",
    "LeRobot data set": "guide/lerobot",
    "one shot": "concepts/unknown",
    "undo": "how-to/undo",
    "planner PDDL": "how-to/planner",
    "citation": "how-to/cite",
    "install": "start/install",
    "docker": "how-to/the-first-call-is-slow",
    "NUMBA_CACHE_DIR": "how-to/the-first-call-is-slow",
    "seconds_elapsed": "how-to/phone",  # it stands in code alone
    "what is a movement primitive": "concepts/movement-primitive",
    "inverse kinematics": "guide/robots",
    "recognize while it is made": "tutorials/recognize-live",
    "load_lasa": "reference/generated/kineme.load_lasa",
    "kineme annotate": "reference/generated/kineme-annotate",
    "Primitives.rollout": "reference/generated/kineme.dmp.Primitives",
    "Recognizer": "reference/generated/kineme.Recognizer",
    "draw in the browser": "guide/page",
    "early recognition": "guide/early-and-live",
    "scikit-learn pipeline": "guide/scikit-learn",
    "websocket": "guide/studio-network",
}
#: Questions that were asked in vain -> the page that has to come first.
MISSED = {
    "rerun": "how-to/rerun",
    "jupyter notebook": "guide/notebooks",
    "confusion matrix": "guide/notebooks",
    "real robot ur5": "guide/robots",
    "save model": "guide/moving-again",
}
#: Error messages with what stood in them -> how the entry of the page of messages begins.
MESSAGES = {
    "expected a column of times and at least one of positions, got x": "expected a column of times and at least one",
    "expected positions up to 1e+100, got 3e+120; choose another unit": "expected positions up to",
    "expected labeled demonstrations, got none with a label; pass y to fit": "expected labeled demonstrations",
    "expected a library in actions, found no library.sqlite there; make one by learning": "expected a library in",
    "Error: expected a file or folder of recordings, found nothing at wave/": "expected a file or folder of recordings",
    "topic /tf: each of its messages is a movement of its own, expected it alone": "topic …: each of its messages",
    "expected the package pyarrow to write LeRobot; pip install 'kineme[parquet]'": "expected the package … to …",
    "expected a MATLAB file of version 7.2 or earlier, got 7.3; save it with -v7": "expected a MATLAB file of version",
    "walk.trc: expected frame 12 next, got frame 14": "expected frame … next",
    "expected one place at 0.5, got two via points there: [1. 2.] and [3. 4.]": "expected one place at",
}
_ASK = "(asked) => Search._performSearch(asked).slice(-3).map(([page, title]) => [page, title])"


@pytest.fixture(scope="module")
def pages(browser):
    """Pages that open files and nothing else, and whose console stays empty."""
    opened = Pages(browser)
    yield opened
    opened.leave("file:", "data:", "blob:")
    opened.close()


@pytest.fixture(scope="module")
def searching(pages):
    page = pages.new(width=1440, height=900)
    page.goto((SITE / "search.html").resolve().as_uri())
    wait_until(page, "Search.hasIndex()")
    return page


@pytest.mark.parametrize("question", QUESTIONS)
def test_the_answer_is_among_the_first_three_that_are_found(searching, question):
    found = [page for page, _ in searching.evaluate(_ASK, question)]
    assert QUESTIONS[question] in found


@pytest.mark.parametrize("question", MISSED)
def test_the_answer_comes_first(searching, question):
    found = [page for page, _ in searching.evaluate(_ASK, question)]
    assert found[-1] == MISSED[question]


@pytest.mark.parametrize("question", ["export", "rerun", "matrix", "a file"])
def test_templates_of_messages_come_last(searching, question):
    """Unless the question is one of them; some are found all the same."""
    found = searching.evaluate("(asked) => Search._performSearch(asked).map((line) => line[2])", question)[::-1]
    are_messages = [place.startswith("#message-") for place in found]
    assert any(are_messages)
    assert are_messages == sorted(are_messages)


@pytest.mark.parametrize("message", MESSAGES)
def test_an_error_message_is_found_with_what_stood_in_it(searching, message):
    found = [
        title for page, title in searching.evaluate(_ASK, message) if page.startswith("reference/generated/messages-")
    ]
    assert any(title.startswith(MESSAGES[message]) for title in found), found


def test_what_is_found_is_shown_and_leads_there(searching):
    searching.goto((SITE / "search.html").resolve().as_uri() + "?q=undo")
    searching.locator("#search-results li a", has_text="Take a change").click()
    assert searching.locator("h1").inner_text().startswith("Take a change of the library back")


def _serious(page, **options):
    """What axe finds that keeps somebody out."""
    serious = [one for one in broken_rules(page, **options) if one["impact"] in {"serious", "critical"}]
    return [(one["id"], [node["html"][:120] for node in one["nodes"][:3]]) for one in serious]


@pytest.fixture(scope="module", params=KINDS)
def shown(pages, request):
    """A page of the site, opened once in a narrow window for all that is asked about it."""
    page = pages.new(width=WIDTHS[0])
    page.goto((SITE / f"{request.param}.html").resolve().as_uri())
    yield page
    pages.give_back(page)


def test_nothing_sticks_out(shown):
    for width in WIDTHS:
        shown.set_viewport_size({"width": width, "height": 900})
        assert shown.evaluate("window.innerWidth") == width
        assert shown.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), width
        assert shown.evaluate(_STICKS_OUT) == [], width


def test_no_serious_rule_of_accessibility_is_broken(shown):
    shown.set_viewport_size({"width": 1440, "height": 900})
    assert _serious(shown) == []


def test_colors_can_be_read_in_the_dark_and_pictures_keep_theirs(pages):
    """Colors alone differ from those by day; the theme would make pictures gray."""
    page = pages.new(width=1440, height=900, color_scheme="dark")
    for kind in (*COLORED, *PICTURED):
        page.goto((SITE / f"{kind}.html").resolve().as_uri())
        if kind in COLORED:
            assert _serious(page, runOnly=["color-contrast"]) == [], kind
        filters = page.evaluate("[...document.images].map((picture) => getComputedStyle(picture).filter)")
        assert set(filters) <= {"none"}, kind
        assert filters or kind not in PICTURED


#: Pages that are longer, and why.
LONG = {
    "reference/names": "all names on one page, to be searched by the browser",
    "reference/generated/kineme.ActionLibrary": "one class",
    "reference/generated/kineme.Demonstrations": "one class",
    "reference/generated/kineme.Recognizer": "one class",
    "reference/generated/kineme.dmp.Primitives": "one class",
}


def _amount(file):
    """Letters, lines of tables and pictures of a page, which make it long."""
    article = file.read_text(encoding="utf-8").partition("<article")[2].partition("</article>")[0]
    return len(re.sub(r"<[^>]*>", "", article)) + 50 * article.count("<tr") + 300 * article.count("<img")


def test_no_page_is_longer_than_six_thousand_pixels(pages):
    """Of those that hold most, at the width of a laptop."""
    page = pages.new(width=1440)
    files = [file for file in SITE.rglob("*.html") if not file.relative_to(SITE).parts[0].startswith("_")]
    heights = {}
    for file in sorted(files, key=_amount)[-28:]:
        page.goto(file.resolve().as_uri())
        name = file.relative_to(SITE).with_suffix("").as_posix()
        heights[name] = page.evaluate("document.documentElement.scrollHeight")
    assert {name: height for name, height in heights.items() if height > 6000 and name not in LONG} == {}
    assert min(heights.values()) < 4500, "more pages have to be measured"


def test_the_first_page_has_one_to_draw_in_by_light_and_in_the_dark(pages):
    page = pages.new(width=1440, height=900, color_scheme="dark")
    page.goto((SITE / "index.html").resolve().as_uri())
    assert page.locator("iframe.draw-here").get_attribute("src") == "_static/draw-dark.html"
    page.evaluate("document.documentElement.dataset.theme = 'light'")
    page.locator("iframe.draw-here[src='_static/draw-light.html']").wait_for()
    inside = page.frame_locator("iframe.draw-here")
    inside.get_by_role("button", name="Z", exact=True).click()
    assert inside.locator("#verdict").inner_text() == "Z"

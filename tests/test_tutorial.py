"""The tutorial is walked through as it stands: every command and block in order, in one folder, with what it shows."""

import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "action-library.md"


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """The folder that the page leaves behind, and its steps."""
    sys.path.insert(0, str(DOCS))
    try:
        from walk_through import walk
    finally:
        sys.path.remove(str(DOCS))
    folder = tmp_path_factory.mktemp("tutorial")
    return folder, list(walk(PAGE, folder))


def _normal(line):
    """A line without what differs from run to run: ids of symbols, times of day, and the width of rules."""
    line = re.sub(r"sym-[0-9a-f]{12}", "sym-ID", line.rstrip())
    line = re.sub(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d", "TIME", line)
    return re.sub(r"^-{5,}$", "-----", line)


def _as_pattern(shown):
    """A regular expression of the lines shown: ``...`` alone is any lines, within a line any text."""
    lines = [
        r"(?:.*\n)*?" if line.strip() == "..." else re.escape(_normal(line)).replace(r"\.\.\.", ".*?") + "\n"
        for line in shown
    ]
    return re.compile("".join(lines))


def _fails(step):
    """A page shows that a command fails by its line on the standard error."""
    return any(line.startswith(("kineme: ", "Error: ")) for line in step.shown)


def _answer(step):
    return "".join(f"{_normal(line)}\n" for line in step.answer)


def test_every_command_ends_as_shown(walked):
    otherwise = {step.source: step.answer for step in walked[1] if bool(step.status) != _fails(step)}
    assert not otherwise


def test_every_answer_is_the_one_shown(walked):
    shown = [step for step in walked[1] if step.shown]
    otherwise = {one.source: _answer(one) for one in shown if not _as_pattern(one.shown).fullmatch(_answer(one))}
    assert not otherwise
    assert len(shown) >= 20


def test_every_picture_is_one_that_the_commands_draw(walked):
    """images/library-NAME.png is NAME.png of the walk; make figures copies them."""
    folder, _ = walked
    pictures = re.findall(r"\]\(images/library-(.+?)\.png\)", PAGE.read_text(encoding="utf-8"))
    assert pictures
    for name in pictures:
        assert list(folder.rglob(f"{name}.png")), name
        assert (DOCS / "images" / f"library-{name}.png").stat().st_size < 80_000

"""The tutorial is walked through as it stands: every command and block in order, in one folder, with what it shows."""

import re
from pathlib import Path

import pytest
from walk_through import otherwise, text_from_the_beginning, walk

DOCS = Path(__file__).parents[1] / "docs"
TEXT = text_from_the_beginning(DOCS / "tutorials" / "action-library-in-python.md")  # three pages


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """The folder that the pages leave behind, and their steps; each is run once."""
    folder = tmp_path_factory.mktemp("tutorial")
    (folder.parent / "tutorial.md").write_text(TEXT, encoding="utf-8")
    return folder, list(walk(folder.parent / "tutorial.md", folder))


def _fails(step):
    """A page shows that a command fails by its line on the standard error."""
    return any(line.startswith(("kineme: ", "Error: ")) for line in step.shown)


def test_every_command_ends_as_shown(walked):
    others = {step.source: step.answer for step in walked[1] if bool(step.status) != _fails(step)}
    assert not others


def test_every_answer_is_the_one_shown(walked):
    shown = [step for step in walked[1] if step.shown]
    others = {one.source: answer for one in shown if (answer := otherwise(one)) is not None}
    assert not others
    assert len(shown) >= 20


def test_every_picture_is_one_that_the_commands_draw(walked):
    """images/library-NAME.png is NAME.png of the walk; make figures copies them."""
    folder, _ = walked
    pictures = re.findall(r"\]\(\.\./images/library-(.+?)\.png\)", TEXT)
    assert pictures
    for name in pictures:
        assert list(folder.rglob(f"{name}.png")), name
        assert (DOCS / "images" / f"library-{name}.png").stat().st_size < 80_000

"""The description in the metadata, which is the page on the index: its Python is run and compared."""

from importlib.metadata import metadata
from pathlib import Path

from walk_through import otherwise, walk

page = Path("README.md")
page.write_text(metadata("kineme").get_payload(), encoding="utf-8")
steps = list(walk(page, Path.cwd()))
assert steps, "no Python in the description"
others = [(step.source, answer) for step in steps if (answer := otherwise(step)) is not None]
assert not others, others
print(f"{len(steps)} blocks of the description print what they show")

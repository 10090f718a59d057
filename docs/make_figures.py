"""Draw the pictures of these pages: ``make figures``."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from browser_pictures import pictures
from concept_figures import SCRIPTS, drawn
from guide_figures import (
    adapting,
    arm,
    around_obstacles,
    many_goals,
    reliability,
    simulated_panda,
    styles,
    three_issues,
    via_points,
)
from million_figure import million
from moving_picture import moving_goal, moving_picture
from PIL import Image
from tutorial_figures import gestures, place
from walk_through import walk

from kineme.reporting.figures import render

_COLORS = 128  # of a picture of a tutorial
#: Pages that draw their own pictures as they are walked -> what the names of these begin with.
DRAWING = {
    "start/first-success": "first",
    "tutorials/action-library": "library",
    "tutorials/action-library-without-labels": "library",
    "tutorials/unlabeled-to-a-planner": "planner",
    "tutorials/symbols-to-a-plan": "planner",
    "tutorials/a-plan-that-recovers": "plan",
}
FIGURES = {
    "robots": arm,
    "simulated-panda": simulated_panda,
    "via-points": via_points,
    "around-obstacles": around_obstacles,
    "adapting": adapting,
    "reliability": reliability,
    "million": million,
    "styles": styles,
    "three-issues": three_issues,
    "many-goals": many_goals,
    "gestures": gestures,
    "place": place,
}


def pictures_of_page(folder: Path, walked: str, prefix: str) -> None:
    """PREFIX-NAME.png is NAME.png of a page, drawn as it is walked, in few colors so that it is small.

    PREFIX-NAME.gif is NAME.gif, as it is, and PREFIX-NAME.png then a still of it.
    """
    page = Path(__file__).parent / f"{walked}.md"
    with TemporaryDirectory() as place:
        for _ in walk(page, Path(place)):
            pass
        shown = re.findall(rf"\]\(\.\./images/{prefix}-(.+?)\.(png|gif)\)", page.read_text(encoding="utf-8"))
        for name, kind in shown:
            drawn_there = next(Path(place).rglob(f"{name}.{kind}"))
            with Image.open(drawn_there) as picture:
                if kind == "gif":
                    (folder / f"{prefix}-{name}.gif").write_bytes(drawn_there.read_bytes())
                    picture.seek(picture.n_frames // 2)
                few = picture.convert("RGB").quantize(_COLORS, dither=Image.Dither.NONE)
                few.save(folder / f"{prefix}-{name}.png", optimize=True)


def main(folder: Path) -> None:
    """Write every figure as PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        (folder / f"{name}.png").write_bytes(render(draw(), dpi=110)["png"])
    (folder / "kineme.svg").write_text(moving_picture(), encoding="utf-8")
    (folder / "moving-goal.svg").write_text(moving_goal(), encoding="utf-8")
    for name in SCRIPTS:
        (folder / f"{name}.png").write_bytes(render(drawn(name), dpi=110)["png"])
    for walked, prefix in DRAWING.items():
        pictures_of_page(folder, walked, prefix)
    pictures(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images")

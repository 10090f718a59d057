"""The studio and the page in Chromium, as the guide shows them; `make figures` draws them too."""

from __future__ import annotations

import io
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

import kineme
from bench.work_faults import plant
from bench.work_sets import TASKS, work_episodes
from kineme.audit.page import audit_page
from kineme.audit.run import audit_episodes
from kineme.studio.page.write_page import write_page

_TESTS = Path(__file__).parents[1] / "tests"
sys.path += [str(_TESTS), str(_TESTS / "studio")]  # the hand of the tests draws, on the studio that they start

from browser_samples import UNANSWERED, center, draw, letters, settle  # noqa: E402
from episode_samples import FPS, write_episodes  # noqa: E402
from studio_samples import running  # noqa: E402

from browsing import wait_until  # noqa: E402

SHAPES = ["Angle", "CShape", "GShape", "Khamesh", "Leaf_1", "NShape", "PShape", "Sine", "WShape", "Worm"]
SIZE = {"width": 1280, "height": 760}
WIDE = 1000  # [px]
COLORS = 256


def library_of(folder: Path, shapes: list[str]) -> Path:
    """All demonstrations of some shapes."""
    with kineme.ActionLibrary(folder, create=True) as library:
        library.learn(kineme.load_lasa(shapes))
    return folder


def long_recording() -> str:
    """Four letters one after the other, one of no known name, with rests between them."""
    rows, at, end = [], 0.0, np.zeros(2)
    for shape in ("GShape", "Zshape", "Sine", "Angle"):
        one = letters(shape)[6]
        kept = np.linspace(0, len(one.times) - 1, 200).astype(int)
        positions = one.positions[kept] - one.positions[0] + end
        times = one.times[kept] - one.times[0] + at
        end, at = positions[-1], times[-1]
        rows += [*zip(times, *positions.T, strict=True), *((at + 0.02 * k, *end) for k in range(1, 40))]
        at += 0.8
    return "t [s],x [mm],y [mm]\n" + "".join(f"{t:.4f},{x:.4f},{y:.4f}\n" for t, x, y in rows)


def show_draw(page: Page) -> None:
    """A G that is under way."""
    draw(page, letters("GShape")[6], seconds=3.0, share=0.6)
    wait_until(page, "document.getElementById('verdict').textContent === 'GShape'")


def show_library(page: Page) -> None:
    """One symbol opened."""
    page.set_viewport_size({**SIZE, "height": 1050})
    page.locator(".card-open").nth(2).click()


def show_move(page: Page) -> None:
    """A goal dragged to the right, in two formulations."""
    page.evaluate("document.getElementById('pick-part').open = true")
    page.get_by_role("radio", name="GShape").check(force=True)
    page.evaluate("document.getElementById('pick-part').open = false")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    page.evaluate("document.querySelectorAll('#formulations input')[1].click()")  # folded under Advanced
    x, y = center(page, ".handle.goal")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 120, y - 50, steps=8)
    page.mouse.up()
    wait_until(page, "document.querySelectorAll('#move-legend li').length === 3")
    page.mouse.move(5, 5)


def show_recordings(page: Page) -> None:
    """What is found in a long recording, the first span chosen."""
    page.set_input_files("#file", {"name": "long.csv", "mimeType": "text/csv", "buffer": long_recording().encode()})
    wait_until(page, "!document.getElementById('recording').hidden")
    page.click("#spot")
    wait_until(page, "document.querySelectorAll('#spans tbody tr').length >= 4")
    page.evaluate("scrollTo(0, 0)")
    page.locator("[data-key='span 0 begin']").evaluate("one => one.focus({ preventScroll: true })")


def show_robot(page: Page) -> None:
    """An arm in the middle of a G."""
    page.locator("#robot-what").select_option(label="GShape")
    page.click("#robot-go")
    wait_until(page, "document.getElementById('robot-verdict').dataset.state !== ''")
    frame = page.frame_locator(".arm-frame")
    frame.locator("#play").click()
    frame.locator("#time").fill("300")
    page.locator("#robot-preflight summary").click()


SHOWN = {
    "draw": show_draw,
    "library": show_library,
    "move": show_move,
    "recordings": show_recordings,
    "robot": show_robot,
}


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser of the system, or of the path in the environment variable CHROMIUM."""
    path = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if path is None:
        sys.exit("expected Chromium, found none: apt-get install chromium, or say where it is in CHROMIUM")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path)
        yield browser
        browser.close()


def save(page: Page, path: Path) -> None:
    """What the window shows, in few colors so that it is small."""
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    height = round(picture.height * WIDE / picture.width)
    few = picture.resize((WIDE, height), Image.Resampling.LANCZOS).quantize(COLORS, kmeans=3, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def pictures(folder: Path) -> None:
    """Write studio-VIEW.png of each view, page.png and audit.png."""
    with TemporaryDirectory() as place, chromium() as browser:
        actions = library_of(Path(place) / "actions", SHAPES)
        with running(actions) as studio:
            for view, act in SHOWN.items():
                page = browser.new_page(viewport=SIZE)
                page.add_init_script(UNANSWERED)
                page.goto(f"{studio.address}/?token={studio.token}#{view}")
                wait_until(page, "document.getElementById('library-count').textContent !== ''")
                settle(page)
                act(page)
                settle(page)
                page.wait_for_timeout(1000)
                save(page, folder / f"studio-{view}.png")
                page.close()
        picture_of_episodes(browser, actions, folder / "studio-episodes.png")
        picture_of_page(browser, actions, folder / "page.png")
        picture_of_audit(browser, folder / "audit.png")


def episodes_of_letters() -> list[Any]:
    """Positions (T, 2) of episodes of two to four letters, one of no known name, with rests between them."""
    names = ["GShape", "Zshape", "Sine", "Angle", "Worm", "PShape", "CShape"]
    episodes = []
    for k in range(12):
        parts = [np.zeros((FPS // 2, 2))]
        for shape in (names[(k * 3 + j) % len(names)] for j in range(2 + k % 3)):
            movement = letters(shape)[5 + k % 2]
            times = np.arange(movement.times[0], movement.times[-1], 1 / FPS)
            path = np.column_stack([np.interp(times, movement.times, x) for x in movement.positions.T])
            parts.append(path - path[0] + parts[-1][-1])
            parts.append(np.repeat(parts[-1][-1:], FPS // 2, axis=0))
        episodes.append(np.concatenate(parts))
    return episodes


def picture_of_episodes(browser: Any, actions: Path, path: Path) -> None:
    """Episodes of a data set as strips, one of them open, a span of no known name chosen."""
    demos = write_episodes(actions.parent / "letters", episodes_of_letters(), tasks=("Write a word", "Write another"))
    with running(actions, "--recordings", demos) as studio:
        page = browser.new_page(viewport={**SIZE, "height": 1050})
        page.add_init_script(UNANSWERED)
        page.goto(f"{studio.address}/?token={studio.token}#recordings")
        wait_until(page, "!document.getElementById('episodes').hidden")
        page.click("#spot-page")
        wait_until(page, "document.getElementById('episodes-state').textContent.startsWith('Looked')")
        page.locator(".strip").nth(4).click()
        wait_until(page, "document.querySelectorAll('#spans tbody tr').length > 0")
        page.locator("[data-key='span 0 name']").evaluate("field => field.focus({ preventScroll: true })")
        page.locator("#playhead").evaluate("field => { field.value = 3; field.dispatchEvent(new Event('input')); }")
        settle(page)
        page.wait_for_timeout(1000)
        save(page, path)
        page.close()


def picture_of_page(browser: Any, actions: Path, path: Path) -> None:
    """A letter that was drawn in the page, its goal dragged."""
    file = actions.parent / "page.html"
    with kineme.ActionLibrary(actions, read_only=True) as library:
        write_page(file, library, title="Handwriting")
    page = browser.new_page(viewport=SIZE)
    page.goto(file.as_uri())
    wait_until(page, "window.kineme !== undefined")
    draw(page, letters("GShape")[6], on="#stage")
    wait_until(page, "kineme.state.answer !== null")
    page.get_by_text("Drag it").click()
    box = page.locator("#stage").bounding_box() or {}
    x, y = page.evaluate("kineme.stage.project(kineme.state.moving.goal)")
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    page.mouse.move(box["x"] + x + 130, box["y"] + y - 40, steps=8)
    page.mouse.up()
    save(page, path)


def picture_of_audit(browser: Any, path: Path) -> None:
    """The page on simulated episodes of an arm that puts cubes into a box, of which a tenth has a planted fault."""
    faults = ("idle", "frozen", "jerk", "spike", "offset", "truncated")
    works = list(work_episodes(60, 7, tasks=list(TASKS)[:1]))
    episodes = [planted.episode for planted in plant(works, 0.1, 7, faults)]
    text = audit_page(audit_episodes(episodes), "cubes", episodes, {})
    shown = text.replace("<h2>Reasons</h2><table>", "<h2 hidden></h2><table hidden>")  # strips are more of a picture
    page = browser.new_page(viewport={"width": 1150, "height": 1240})
    page.set_content(shown)
    save(page, path)


if __name__ == "__main__":
    pictures(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images")

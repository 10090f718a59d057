"""Every picture of the studio is saved as SVG and as PNG: on white, in light colors, with its name."""

from __future__ import annotations

import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from browser_samples import UNANSWERED, draw, letters, make_letters, settle, show
from studio_samples import Served

import kineme
from browsing import Pages, wait_until

SVG = "{http://www.w3.org/2000/svg}"
INK = "#0072b2"  # of the light palette


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory):
    """A dark studio with something in each of its pictures."""
    folder = tmp_path_factory.mktemp("pictures")
    studio = Served(make_letters(folder / "letters"), read_only=True)
    pages = Pages(browser, script=UNANSWERED)
    page = pages.new(color_scheme="dark")
    page.goto(f"{studio.address}/?token={studio.token}#draw")
    wait_until(page, "document.getElementById('status').dataset.state === 'here'")
    draw(page, letters("GShape")[6])
    wait_until(page, "document.querySelector('#verdict').textContent === 'GShape'")
    show(page, "move")
    show(page, "library")
    show(page, "recordings")
    x = np.concatenate([movement.positions for movement in letters("Sine")[:2]])
    kineme.write_movement(folder / "long & <b>.csv", {"times": np.arange(len(x)) / 100, "positions": x})
    page.evaluate("document.getElementById('move-advanced').open = true")
    page.set_input_files("#file", str(folder / "long & <b>.csv"))
    wait_until(page, "document.getElementById('recording-name').textContent !== ''")
    settle(page)
    yield page
    pages.leave(studio.address, "blob:", "data:")
    pages.close()
    studio.end()


def saved(page, view, canvas, kind):
    """The file that the control of a picture gives, its name and bytes."""
    show(page, view)
    control = page.locator(f"#view-{view} .saving[data-picture={canvas}]")
    control.locator("summary").click()
    with page.expect_download() as given:
        control.locator(f"button:text('{kind}')").click()
    assert page.locator(f"#view-{view} .saving[open]").count() == 0
    return given.value.suggested_filename, given.value.path().read_bytes()


@pytest.mark.parametrize(
    ("view", "canvas", "name", "holds"),
    [
        ("draw", "draw-canvas", "GShape", f'stroke="{INK}"'),
        ("library", "map", "Map", ">GShape</text>"),
        ("move", "move-canvas", None, 'stroke-width="3.5"'),
        ("move", "plot-speed", "Speed", ">0 s</text>"),
        ("move", "plot-acceleration", "Acceleration", 'stroke-width="2.2"'),
        ("recordings", "timeline-canvas", "long & <b>.csv", ">s</text>"),
    ],
)
def test_a_picture_is_saved_with_its_name_on_white(page, view, canvas, name, holds):
    file, content = saved(page, view, canvas, "SVG")
    root = ElementTree.fromstring(content)
    title = root.findtext(f"{SVG}title")
    assert (name or title) == title != ""
    assert file.endswith(".svg")
    assert root.find(f"{SVG}rect").get("fill") == "#fff"
    text = content.decode()
    assert holds in text
    assert not re.findall(r"undefined|NaN", text)
    assert "#171b1f" not in text  # of the dark palette
    assert len(root.findall(f"{SVG}path")) >= 2
    assert root.findall(f"{SVG}text")[0].text == title

    Image = pytest.importorskip("PIL.Image", reason="the package pillow is not installed")
    file, content = saved(page, view, canvas, "PNG")
    assert file.endswith(".png")
    pixels = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
    assert pixels.shape[:2] == (2 * int(root.get("height")), 2 * int(root.get("width")))
    assert (pixels[0] == 255).all()
    assert 0.001 < (pixels != 255).any(axis=2).mean() < 0.5


def test_the_screen_stays_as_dark_as_it_was(page):
    show(page, "draw")
    ink = "document.getElementById('draw-canvas').getContext('2d').getImageData(0, 0, 1500, 1500).data"
    before = page.evaluate(f"{ink}.reduce((sum, value) => sum + value, 0)")
    saved(page, "draw", "draw-canvas", "SVG")
    settle(page)
    assert page.evaluate(f"{ink}.reduce((sum, value) => sum + value, 0)") == before


def test_the_control_is_within_a_narrow_window(page):
    page.set_viewport_size({"width": 390, "height": 844})
    for view in ("draw", "library", "move", "recordings"):
        show(page, view)
        for control in page.locator(f"#view-{view} .saving").all():
            box = control.bounding_box()
            assert 0 <= box["x"] <= box["x"] + box["width"] <= 390

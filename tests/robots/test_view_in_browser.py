"""The page in which an arm moves, opened in Chromium: it draws, obeys its slider and keys, and requests nothing."""

from __future__ import annotations

import shutil
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from view_samples import HOSTILE, arm, mesh_visual, moved, write_stl

from browsing import Pages, wait_until

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

from kineme.robots import load, write_view
from kineme.robots.execution.preflight import along
from soaking import combined

WIDTHS = (390, 820, 1440)
#: A triangle whose texture is the address of a file.
COLLADA = Path(__file__).parent / "textured.dae"


@pytest.fixture(scope="module")
def pages(browser):
    """The pages of all tests."""
    pages = Pages(browser)
    yield pages
    pages.close()


@pytest.fixture
def opened(pages, tmp_path):
    """A function that opens the page of a movement; at the end, nothing was requested and nothing went wrong."""
    addresses = []

    def open_page(made, width=820, stands=False, **options):
        page = pages.new(width, kind="stands" if stands else "", **options)
        if stands:
            page.clock.install(time=0)
        addresses.append(write_view(tmp_path / "arm.html", made).as_uri())
        page.goto(addresses[-1])
        wait_until(page, "window.kineme && kineme.frames() > 0")
        if stands:  # the time of the page, which goes on when the test says so, however busy the machine is
            page.clock.pause_at(page.evaluate("Date.now()") / 1000 + 60)
        return page

    yield open_page
    requests = pages.leave("file:", "data:")
    assert [url for url in requests if url.startswith("file:")] == addresses


def scrub(page, share):
    """Put the slider to a share of its way."""
    page.evaluate(
        """at => { const slider = document.getElementById("time"); slider.value = at * slider.max;
        slider.dispatchEvent(new Event("input")); }""",
        share,
    )


def shown(page):
    """The time that the page says [s]."""
    return float(page.inner_text("#now").split()[0])


@pytest.fixture(scope="module")
def panda():
    from kineme.movements.trajectories.trajectory import Trajectory
    from kineme.robots import move
    from kineme.robots.kinematics.descent import InverseKinematics

    robot = load("panda")
    u = np.linspace(0, 1, 150)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    shape = np.column_stack((0 * s - 0.05, 0.4 * (s - 0.5), 0.1 * np.sin(2 * np.pi * s)))
    return move(Trajectory(times=3 * u, positions=InverseKinematics(robot).tip_position + shape), robot)


def _overlap(a, b):
    return all(
        a[at] < b[at] + b[size] - 0.5 and b[at] < a[at] + a[size] - 0.5
        for at, size in (("x", "width"), ("y", "height"))
    )


@pytest.mark.parametrize(("width", "scheme"), combined(WIDTHS, ["light", "dark"], together=1))
def test_the_slider_moves_the_arm_to_where_the_model_has_its_tip(opened, panda, width, scheme):
    page = opened(panda, width, color_scheme=scheme)
    tips = along(panda.robot, panda.trajectory).tip_positions
    for sample in (0, 100, 250, len(tips) - 1):
        page.evaluate("at => kineme.show(at)", float(panda.trajectory.times[sample]))
        np.testing.assert_allclose(page.evaluate("kineme.tip()"), tips[sample], atol=1e-5)
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    before = page.evaluate("kineme.frames()")
    scrub(page, 0.5)
    wait_until(page, "before => kineme.frames() > before", before)
    duration = panda.trajectory.duration
    assert page.inner_text("#now") == f"{duration / 2:.2f} s"
    assert page.get_attribute("#time", "aria-valuetext") == f"{duration / 2:.2f} of {duration:.2f} seconds"
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.evaluate("kineme.show(0)")  # where the time is said with the longest words
    boxes = [page.locator(name).bounding_box() for name in ("#now", "#speed", "#reset", "#play")]
    assert not [True for a, b in combinations(boxes, 2) if _overlap(a, b)]
    assert page.evaluate("(now => now.scrollWidth <= now.offsetWidth)(document.getElementById('now'))")


def test_the_canvas_shows_the_arm_and_not_the_ground_alone(opened, panda):
    page = opened(panda)
    colors = page.evaluate(
        """() => new Promise(done => requestAnimationFrame(() => {
          kineme.show(2); kineme.picture(); const c = document.getElementById("canvas");
          const flat = new OffscreenCanvas(c.width, c.height).getContext("2d"); flat.drawImage(c, 0, 0);
          const p = flat.getImageData(0, 0, c.width, c.height).data; const count = {blue: 0, orange: 0, green: 0};
          for (let i = 0; i < p.length; i += 4) { const [r, g, b] = [p[i], p[i + 1], p[i + 2]];
            if (b > 150 && r < 60) count.blue += 1; if (r > 180 && b < 140 && g < 190) count.orange += 1;
            if (g > 130 && r < 60 && b < 140) count.green += 1; }
          done(count); }))"""
    )
    assert min(colors.values()) > 30, colors


def test_space_plays_and_pauses_and_the_end_stops(opened, panda):
    page = opened(panda, stands=True)
    page.select_option("#speed", "2")
    page.locator("body").press(" ")
    for _ in range(5):
        page.clock.fast_forward(100)
    assert page.inner_text("#play") == "Pause"
    assert shown(page) == pytest.approx(1.0, abs=0.05)
    page.locator("#time").press(" ")
    assert page.inner_text("#play") == "Play"
    stopped = shown(page)
    page.clock.fast_forward(500)
    assert shown(page) == stopped
    scrub(page, 0.98)
    page.click("#play")
    page.clock.fast_forward(500)
    page.clock.fast_forward(500)
    assert page.inner_text("#play") == "Play"
    assert shown(page) == pytest.approx(panda.trajectory.duration, abs=0.006)


def test_keys_turn_the_view_and_the_slider(opened, panda):
    page = opened(panda, reduced_motion="reduce")
    for key in ("ArrowLeft", "+"):
        before, place = page.evaluate("[kineme.frames(), kineme.at('goal')]")
        page.locator("#canvas").press(key)
        assert page.evaluate("kineme.at('goal')") != place
        wait_until(page, "before => kineme.frames() > before", before)
    page.locator("#time").press("End")
    assert page.inner_text("#now") == f"{panda.trajectory.duration:.2f} s"
    page.locator("#time").press("Home")
    assert page.inner_text("#now") == "0.00 s approach"


def test_hostile_names_are_text(opened, tmp_path):
    page = opened(moved(arm(tmp_path, names=HOSTILE)))
    assert page.locator(".chart .name").all_inner_texts() == [f"to {name}" for name in HOSTILE[1:]]
    assert page.evaluate("kineme.tip().length") == 3


def test_meshes_are_drawn_without_their_textures(opened, tmp_path):
    write_stl(tmp_path / "shapes" / "link.stl")
    shutil.copy(COLLADA, tmp_path / "shapes" / "hand.dae")
    made = moved(arm(tmp_path, [mesh_visual("link.stl"), mesh_visual("hand.dae"), mesh_visual("gone.stl"), ""]))
    page = opened(made)
    page.evaluate("kineme.show(1)")
    assert page.is_hidden("#problem")


def test_without_webgl_the_joints_and_the_checks_remain(opened, browser, panda, tmp_path):
    context = browser.new_context()
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = context.new_page()
    page.goto(write_view(tmp_path / "blind.html", panda).as_uri())
    page.wait_for_selector("#problem:not([hidden])")
    assert "cannot be drawn here" in page.inner_text("#problem")
    assert ".." not in page.inner_text("#problem")
    assert page.is_hidden(".legend")
    scrub(page, 1.0)
    assert shown(page) == pytest.approx(panda.trajectory.duration, abs=0.006)
    context.close()

"""Move and Robot in Chromium: the path is dragged, the goal on the arm too, and an arm draws along."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from browser_samples import INKED, center, make_letters, settle
from studio_samples import Served

from browsing import wait_until

HANDLES = "document.querySelectorAll('#handles .handle').length"
MOST_CONTROLS = 20
#: Controls that can be used and are on the screen.
CONTROLS = """() => [...document.querySelectorAll("button, input, select, a[href], summary")].filter((node) => {
  const { top, left, bottom, right, width } = node.getBoundingClientRect();
  return node.checkVisibility({ visibilityProperty: true }) && !node.matches(":disabled") && width > 0
    && bottom > 0 && right > 0 && top < innerHeight && left < innerWidth;
}).map((node) => node.id || node.textContent.trim() || node.outerHTML.slice(0, 60))"""
#: Where the goal is drawn, in the frame of the arm.
GOAL = """() => {
  const { x, y } = document.getElementById("canvas").getBoundingClientRect();
  const [right, down] = kineme.at("goal");
  return [x + right, y + down];
}"""


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A studio of letters that no test changes."""
    studio = Served(make_letters(tmp_path_factory.mktemp("letters") / "letters"), read_only=True)
    yield studio
    studio.end()


@pytest.fixture
def opened(opened, served):
    """A function that opens a view of that studio."""

    def open_page(view, **options):
        page = opened(served, view, **options)
        settle(page)
        return page

    return open_page


def grip(page, above=0.3):
    """Where the path can be taken hold of, at a share of the width of the stage."""
    box = page.locator("#move-canvas").bounding_box()
    x = box["x"] + above * box["width"]
    for y in range(round(box["y"]) + 4, round(box["y"] + box["height"]), 5):
        page.mouse.move(x, y)
        if page.evaluate("document.getElementById('move-canvas').classList.contains('grabs')"):
            return x, y
    raise AssertionError("expected the path under some place of the stage")


def test_the_path_itself_is_dragged_and_each_step_goes_back_and_forth(opened):
    page = opened("move")
    page.select_option("#export-format", "csv")
    wait_until(page, f"{HANDLES} === 2")
    x, y = grip(page, 0.45)
    page.mouse.down()
    page.mouse.move(x - 40, y + 30, steps=8)
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.evaluate(INKED, [x - 40, y + 30, 24]) > 20  # the path is where the hand is
    page.mouse.up()
    assert page.locator(".handle.via").count() == 1
    near = center(page, ".handle.via")
    page.mouse.move(near[0] + 16, near[1])
    page.mouse.move(near[0], near[1])
    page.mouse.down()  # the same point again, and no second one
    page.mouse.move(near[0], near[1] + 9)
    page.mouse.up()
    assert page.locator(".handle.via").count() == 1
    after = page.get_attribute(".handle.via", "aria-label")
    page.click("#move-undo")
    assert page.get_attribute(".handle.via", "aria-label") != after
    page.click("#move-undo")
    assert page.locator(".handle.via").count() == 0
    assert page.is_disabled("#move-undo")
    page.click("#move-redo")
    page.keyboard.press("Control+Shift+z")
    assert page.get_attribute(".handle.via", "aria-label") == after
    assert page.is_disabled("#move-redo")
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+y")
    assert page.get_attribute(".handle.via", "aria-label") == after
    page.keyboard.press("Control+z")
    page.locator(".handle.goal").press("ArrowLeft")  # a new step: what was taken back is gone
    assert page.is_disabled("#move-redo")
    page.dblclick(".handle.via")
    assert page.locator(".handle.via").count() == 0


def test_a_finger_drags_the_path_without_scrolling(opened):
    page = opened("move", has_touch=True, width=390, height=600)
    wait_until(page, f"{HANDLES} === 2")
    page.locator("#move-canvas").scroll_into_view_if_needed()
    (x, y), client = grip(page, 0.4), page.context.new_cdp_session(page)
    before = page.evaluate("window.scrollY")
    for kind, dy in (("touchStart", 0), ("touchMove", 30), ("touchMove", 60), ("touchEnd", None)):
        points = [] if dy is None else [{"x": x, "y": y + dy}]
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    wait_until(page, f"{HANDLES} === 3")
    wait_until(page, "!document.getElementById('move-stage').classList.contains('dragging')")
    np.testing.assert_allclose(center(page, ".handle.via")[1], y + 60, atol=16)
    assert page.evaluate("window.scrollY") == before


def test_a_small_obstacle_is_moved_and_not_widened(opened):
    page = opened("move", width=390, height=844)
    wait_until(page, f"{HANDLES} === 2")
    page.click("#add-obstacle")
    settle(page)
    for _ in range(8):
        page.locator(".handle.rim").press("ArrowLeft")
    on = "([x, y]) => document.elementFromPoint(x, y).classList.contains('obstacle')"
    assert page.evaluate(on, center(page, ".handle.obstacle"))


def test_an_obstacle_on_a_via_point_is_said_and_drawn_as_touched(opened):
    page = opened("move")
    wait_until(page, f"{HANDLES} === 2")
    page.click("#add-via")
    page.click("#add-obstacle")
    settle(page)
    wait_until(page, "document.getElementById('move-warnings').textContent === ''")  # it goes around
    page.mouse.move(*center(page, ".handle.obstacle"))
    page.mouse.down()
    page.mouse.move(*center(page, ".handle.via"), steps=4)
    page.mouse.up()
    wait_until(page, "document.getElementById('move-warnings').textContent.includes('whose radius is')")
    page.click("#move-undo")
    wait_until(page, "document.getElementById('move-warnings').textContent === ''")


def test_two_plain_words_choose_the_formulation_and_advanced_has_all(opened):
    page = opened("move")
    wait_until(page, f"{HANDLES} === 2")
    with page.expect_request("**/api/primitive") as request:
        page.get_by_role("radio", name="Stretch").check()
    assert request.value.post_data_json["formulation"] == "amplitude-scaled"
    wait_until(page, "document.getElementById('move-legend').innerText.trim().split(/\\s+/).join() === 'recorded,now'")
    page.click("#move-advanced > summary")
    assert page.locator("#formulations input:checked").get_attribute("value") == "amplitude-scaled"
    page.locator("#formulations input").first.check()
    assert page.locator("#manner input:checked").count() == 0  # two are side by side
    page.locator("#formulations input").nth(1).uncheck()
    assert page.get_by_role("radio", name="Keep the shape").is_checked()


@pytest.mark.parametrize("view", ["move", "robot"])
def test_the_first_screen_has_few_controls(opened, view):
    page = opened(view, width=1440, height=900)
    for width in (1440, 390):
        page.set_viewport_size({"width": width, "height": 900})
        settle(page)
        controls = page.evaluate(CONTROLS)
        for frame in page.frames[1:]:
            controls += frame.evaluate(CONTROLS)
        assert len(controls) <= MOST_CONTROLS, controls


@pytest.fixture
def robot(opened):
    """The view Robot with the arm at its movement."""
    pytest.importorskip("pinocchio", reason="the extra robot is not installed")
    page = opened("robot")
    wait_until(page, "document.getElementById('robot-verdict').dataset.state === 'passed'")
    wait_until(page, "document.querySelector('.arm-frame').contentWindow.kineme.frames() > 1")
    return page


def _frame(page):
    return next(frame for frame in page.frames if "/arm.html" in frame.url)


def test_the_goal_is_dragged_in_space_and_typed(robot):
    page = robot
    before = [page.locator("#robot-place input").nth(k).input_value() for k in range(6)]
    box, at = page.locator(".arm-frame").bounding_box(), _frame(page).evaluate(GOAL)
    x, y = box["x"] + at[0], box["y"] + at[1]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 12, y - 8, steps=4)
    with page.expect_request("**/api/robots/move") as request:
        page.mouse.up()
    body = request.value.post_data_json
    np.testing.assert_allclose(body["at"], [float(value) for value in before[:3]], atol=1e-3)
    assert np.linalg.norm(np.subtract(body["goal"], [float(value) for value in before[3:]])) > 0.01
    assert body["goal"][2] == pytest.approx(body["at"][2], abs=1e-6)  # a drawing stays in its plane
    wait_until(page, "!document.getElementById('robot-free').disabled")
    page.click(".robot-form details.advanced > summary")
    with page.expect_request("**/api/robots/move") as request:
        page.get_by_label("Start x in meters").fill(str(float(before[0]) + 0.02))
        page.get_by_label("Start x in meters").press("Enter")
    typed = request.value.post_data_json
    np.testing.assert_allclose(
        np.subtract(typed["goal"], body["goal"]), np.subtract(typed["at"], body["at"]), atol=1e-3
    )
    with page.expect_request("**/api/robots/move") as request:
        page.click("#robot-free")
    assert "goal" not in request.value.post_data_json
    settle(page)


def test_joints_that_were_checked_are_saved_and_another_arm_stands_there_at_once(robot, tmp_path):
    with robot.expect_download() as download:
        robot.click("#robot-save")
    download.value.save_as(tmp_path / "joints.csv")
    with (tmp_path / "joints.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0][:2] == ["time", "panda_joint1 [rad]"]
    assert len(rows) > 100
    assert download.value.suggested_filename == "Angle_on_panda.csv"
    page = robot
    page.route("**/api/robots/move", lambda route: None)  # it never answers
    page.select_option("#robot-arm", "so101")
    wait_until(page, "document.querySelector('.arm-frame').contentDocument.body.classList.contains('rests')")
    assert float(page.input_value("#robot-size")) < 0.2  # a small arm
    page.unroute("**/api/robots/move")


def test_an_arm_draws_along(opened):
    pytest.importorskip("pinocchio", reason="the extra robot is not installed")
    page = opened("draw")
    page.click("#mirror > summary")
    wait_until(page, "document.getElementById('mirror-note').textContent.startsWith('Its tip')")
    page.locator("#mirror-arm .arm-frame").wait_for()
    wait_until(page, "document.querySelector('#mirror-arm .arm-frame').contentWindow.kineme?.frames() > 1")
    settle(page)
    frame = _frame(page)
    home = frame.evaluate("kineme.tip()")
    box = page.locator("#draw-canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x - 90, y)
    page.mouse.down()
    page.mouse.move(x, y, steps=9)
    # In the middle the tip is where it is at rest.
    away = "([x, y, z]) => { const tip = kineme.tip(); return Math.hypot(tip[0] - x, tip[1] - y, tip[2] - z) < 2e-3; }"
    wait_until(frame, away, home, seconds=60)
    page.mouse.move(x, y - box["height"] / 4, steps=9)
    wait_until(
        frame, f"({away})([{home[0]}, {home[1]}, {home[2] + 0.2 * float(np.linalg.norm(home))}])", seconds=60
    )  # up is up
    page.mouse.up()

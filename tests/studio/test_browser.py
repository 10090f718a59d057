"""The studio in Chromium: real letters are drawn, recognized while they are drawn, named and moved; nothing is lost."""

from __future__ import annotations

import json
import re
import signal
import socket
import time
from itertools import product
from threading import Event, Thread

import numpy as np
import pytest
from browser_samples import (
    ANSWERED,
    DROP,
    HOSTILE,
    INKED,
    LETTERS,
    PIXELS,
    SHOWN,
    Hand,
    center,
    draw,
    letters,
    make_letters,
    settle,
    show,
    wait_for_text,
)  # fmt: skip
from studio_samples import ROOT, Running, Served, drawing

import kineme
from browsing import violations_in_both, wait_until
from soaking import SOAK

WIDTHS = (390, 820, 1440)
VIEWS = ("draw", "library", "move", "recordings", "robot")


def _free_port():
    """One that no other studio takes while this one is away, as these take the usual one."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


@pytest.fixture(scope="module")
def served_letters(tmp_path_factory):
    """A studio of letters that no test changes."""
    studio = Served(make_letters(tmp_path_factory.mktemp("letters") / "letters"), read_only=True)
    yield studio
    studio.end()


@pytest.mark.parametrize("shape", LETTERS[: 2 if SOAK else 1])
def test_a_letter_is_recognized_while_it_is_drawn(opened, served_letters, shape):
    page = opened(served_letters, reduced_motion="no-preference")
    assert page.is_hidden("#draw-legend")
    draw(page, letters(shape)[SHOWN], share=0.8)
    assert page.is_visible("#draw-legend")
    wait_until(page, "name => document.querySelector('.rank-name').textContent === name", shape)
    # The name may be right before all that was drawn is answered.
    wait_until(page, "Number(document.getElementById('draw-progress').getAttribute('aria-valuenow')) > 30")
    page.mouse.up()
    answers = set()
    for movement in letters(shape)[SHOWN:]:
        draw(page, movement)
        wait_until(page, ANSWERED)
        assert page.inner_text(".rank:first-child .rank-name") == shape
        answers.add((page.inner_text("#verdict"), page.inner_text("#spoken")))
        assert page.inner_text("#ranks-kind") == "If it is a known one"  # as while it was drawn
        assert "p-value" not in page.inner_text(".draw > .panel")
    page.click("#why summary")
    assert "p-value" in page.inner_text("#why-text")
    assert (shape, f"Sure {shape}.") in answers  # one in twenty may be called unknown


def test_a_movement_of_no_known_letter_is_unknown(opened, served_letters):
    page = opened(served_letters)
    draw(page, letters("Zshape")[0])
    wait_for_text(page, "#verdict", "Unknown")
    wait_for_text(page, "#spoken", "New: unknown.")  # and nothing about a name: it is open for reading only


#: What looks as if it could change the library: buttons for that, and fields that are filled in for that.
CHANGES = """() => [...document.querySelectorAll("main button, main textarea, main input, #undo")]
  .filter((node) => node.checkVisibility())
  .filter((node) => node.disabled || /name|delete|learn|save/i.test(node.textContent)
    || node.matches("textarea, .member"))
  .map((node) => node.id || node.textContent || node.className)"""


def test_a_library_that_is_only_shown_offers_no_changes(opened, served_letters):
    page = opened(served_letters)
    draw(page, letters("GShape")[SHOWN])
    wait_until(page, ANSWERED)
    assert page.evaluate(CHANGES) == []
    show(page, "library")
    page.locator(".card-open").first.click()
    wait_until(page, "n => document.querySelectorAll('.member').length === n", SHOWN)
    assert page.evaluate(CHANGES) == []
    page.evaluate(DROP, ["labeled.csv", _labeled("of a file")])
    wait_for_text(page, "#recording-name", "labeled.csv")
    assert page.evaluate(CHANGES) == []


def test_a_studio_that_knows_nothing_says_what_to_do_and_learns_from_one_drawing(opened, studio, tmp_path):
    page = opened(studio(tmp_path / "new"), "robot")
    wait_until(page, "!document.getElementById('robot-empty').hidden")
    assert page.is_hidden("#robot-go")  # it would do nothing
    page.evaluate("location.hash = 'move'")
    wait_until(page, "document.getElementById('move-empty').checkVisibility()")
    assert page.is_hidden("#move-panel")
    assert page.locator("#library-empty h2").count() == 1  # below the page's h1, where nothing else is
    page.click("#move-empty button")
    assert page.inner_text("#draw-empty-title") == "Draw a movement here"
    for name in ("GShape", "Sine"):
        draw(page, letters(name)[0])
        wait_until(page, "document.activeElement.id === 'naming-name'")
        page.keyboard.type(name)
        page.keyboard.press("Enter")
        wait_for_text(page, "#verdict-kind", "Learned")
        assert "Draw it again" in page.inner_text("#verdict-note")
    with kineme.ActionLibrary(tmp_path / "new", read_only=True) as library:
        assert [symbol.name for symbol in library.symbols()] == ["GShape", "Sine"]
    draw(page, letters("GShape")[3])
    wait_until(page, ANSWERED)
    assert page.inner_text(".rank:first-child .rank-name") == "GShape"
    assert page.inner_text("#verdict-kind") in {"Looks like", "New"}  # nothing is sure from two drawings
    held = []
    page.route("**/api/library/movements", lambda route, _: held.append(route))  # storing takes long
    page.click("text=Yes, it is GShape")
    draw(page, letters("Sine")[3])
    wait_until(page, ANSWERED)
    held[0].continue_()
    wait_until(page, "document.getElementById('library-count').textContent.includes('3 movements')")
    settle(page)
    assert page.is_enabled("#naming-learn")  # the drawing of now is there to be learned


def test_the_path_follows_the_goal_without_asking_the_server(opened, served_letters):
    page = opened(served_letters, "move")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    assert page.get_attribute(".handle.goal", "aria-label") == "Goal at 0, 0"  # no 1e-7 of the fit
    assert page.input_value("[data-key='Goal x']") == "0"
    settle(page)  # the primitive is asked for once
    page.route("**/api/rollout", lambda route: None)  # from now on it never answers
    x, y = center(page, ".handle.goal")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 70, y - 90, steps=10)
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.evaluate(INKED, [x + 70, y - 90, 30]) > 20
    page.mouse.up()
    assert center(page, ".handle.goal") != (x, y)
    page.click("#add-via")
    for _ in range(4):
        page.keyboard.press("Shift+ArrowUp")
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.evaluate(INKED, [*center(page, ".handle.via"), 30]) > 20
    loaded = (
        "performance.getEntriesByName(location.origin + '/api/library').filter((entry) => entry.responseStatus === 200)"
    )
    assert page.evaluate(f"{loaded}.map((entry) => entry.initiatorType)") == ["link"]  # once, beside the modules


def test_via_points_and_obstacles_change_the_path_and_can_be_removed(opened, served_letters):
    page = opened(served_letters, "move")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    settle(page)
    with page.expect_response("**/api/rollout"):  # else it may come after what is asked for by the reset
        page.locator(".handle.goal").press("ArrowLeft")
    settle(page)
    firsts = iter([True])  # how it was shown, but not how it moves
    page.route("**/api/rollout", lambda route: route.continue_() if next(firsts, False) else None)
    page.click("#move-reset")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    page.click("#add-via")
    assert page.evaluate("document.activeElement.getAttribute('aria-label')").startswith("Point 1 at")
    page.unroute("**/api/rollout")
    for _ in range(6):
        page.keyboard.press("Shift+ArrowUp")
    wait_until(
        page,
        f"""() => {{ const b = document.querySelector(".handle.via").getBoundingClientRect();
        return ({INKED})([b.x + b.width / 2, b.y + b.height / 2, 24]) > 20; }}""",
    )
    page.keyboard.press("Delete")
    assert page.locator(".handle").count() == 2
    page.click("#add-via")
    page.mouse.move(*center(page, ".handle.via"))
    page.mouse.down()
    page.keyboard.press("Delete")  # what the hand holds
    page.mouse.up()
    assert page.get_attribute("#move-stage", "class") == "stage"  # nothing is dragged any more
    page.click("#add-obstacle")
    assert page.locator(".handle.obstacle").count() == 1
    with page.expect_response("**/api/rollout") as answered:
        page.keyboard.press("ArrowRight")
    assert answered.value.ok


def test_a_movement_is_exported(opened, served_letters, tmp_path):
    page = opened(served_letters, "move")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    with page.expect_download() as download:
        page.click("#export")
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    assert kineme.read_recording(path).positions.shape[1] == 2


def test_two_tabs_show_the_same_library_and_undo_takes_back(opened, studio, tmp_path):
    running = studio(make_letters(tmp_path / "letters", shown=2))
    first, other = opened(running, "library", tolerated=("409",)), opened(running, "library")
    for page in (first, other):
        wait_until(page, "document.querySelectorAll('.card-open').length === 4")
    first.click(".card-open >> nth=0")
    first.get_by_role("button", name="Rename").click()
    first.keyboard.type("first")
    first.keyboard.press("Enter")
    for page in (first, other):
        wait_until(page, "[...document.querySelectorAll('.card-name')].some((name) => name.textContent === 'first')")
    other.locator("body").press("Control+z")
    for page in (first, other):
        wait_until(page, "![...document.querySelectorAll('.card-name')].some((name) => name.textContent === 'first')")
        assert sorted(page.locator(".card-name").all_inner_texts()) == sorted(LETTERS)
    first.evaluate(
        "import('/parts/changes.js').then((changes) => changes.undo(5))"
    )  # as the message about the renaming
    wait_until(
        first, "document.querySelector('.toast.failed')?.textContent.includes('look at what has changed') ?? false"
    )
    first.locator(".card-open", has_text="Angle").click()  # the second change takes it away
    held = []  # the members of the symbol that is shown, asked for after one change and answered after the next
    first.route("**/api/library/movements?symbol=*", lambda route, _: held.append(route))
    first.evaluate("import('/parts/changes.js').then(({ undo }) => Promise.all([undo(), undo()]))")
    wait_until(first, "document.querySelectorAll('.card-open').length === 2")
    assert held
    for route in held:
        route.continue_()
    settle(first)
    assert first.locator(".toast.failed", has_text="does not hold").count() == 0


def test_the_same_message_is_shown_once_and_three_at_most(opened, studio, folder):
    page = opened(studio(folder))
    said = """async (words) => {
      const { say } = await import("/parts/toasts.js");
      for (const text of words.split(" ")) say(text);
      return [...document.querySelectorAll(".toast p")].map((toast) => toast.textContent).join(" ");
    }"""
    assert page.evaluate(said, "again again other again") == "other again"
    assert page.evaluate(said, "third fourth") == "again third fourth"


#: How many movements are listed where more of them are asked for while the first are under way.
LOADED_TWICE = """async () => {
  const { Members } = await import("/library/members.js");
  const members = new Members("unlabeled=0", () => {});
  await Promise.all([members.load(), members.load()]);
  while (!members.shown) await new Promise((done) => requestAnimationFrame(done));
  return members.grid.children.length;
}"""


def test_two_chosen_movements_are_compared_and_names_that_are_mixed_up_counted(opened, studio, tmp_path):
    page = opened(studio(make_letters(tmp_path / "letters", shown=3)), "library")
    page.locator(".card-open").first.click()
    wait_until(page, "document.querySelectorAll('.member').length === 3")
    page.locator(".member").nth(0).click()
    assert page.is_hidden(".compared")
    other = center(page, ".member >> nth=2")
    page.locator(".member").nth(1).click()
    wait_until(page, "!document.querySelector('.compared').hidden")
    assert center(page, ".member >> nth=2") == other  # what can be chosen next does not move away
    assert re.search(r" beside .* of the path, by up to \d+ % of its size", page.inner_text(".compared"))
    page.locator(".member").nth(2).click()
    assert page.is_hidden(".compared")
    page.click("#confusion summary")
    wait_until(page, "document.getElementById('confusion-text').textContent.includes('of 12 movements right')")
    assert page.locator("#confusion-table .right").all_inner_texts() == ["3"] * 4


def test_a_long_name_leaves_room_for_the_table_of_names_that_are_mixed_up(opened, studio, folder):
    with kineme.ActionLibrary(folder) as library:
        library.learn([kineme.Trajectory(*drawing(9, seed=k)) for k in (0, 1)], ["long_" * 30] * 2)
    page = opened(studio(folder), "library")
    page.click("#confusion summary")
    wait_until(page, "document.querySelectorAll('#confusion-table .right').length === 5")
    assert page.locator("#confusion-table tr").first.bounding_box()["height"] < 220
    assert page.locator("#confusion-table th[scope=row]").last.bounding_box()["width"] < 300


def test_symbols_are_merged_split_deleted_and_all_of_it_taken_back(opened, studio, tmp_path):
    running = studio(make_letters(tmp_path / "letters", shown=3))
    page = opened(running, "library", width=1440, height=900)
    names = page.locator(".card-name")
    wait_until(page, "document.querySelectorAll('.card-open').length === 4")
    page.check("#choosing")
    assert page.inner_text("#chosen-count") == "Tick two or more"
    page.locator(".choose").nth(0).check()
    page.locator(".choose").nth(1).check()
    page.click("#merge")
    page.keyboard.type("both")
    page.keyboard.press("Enter")
    wait_until(page, "document.querySelectorAll('.card-open').length === 3")
    assert "both" in names.all_inner_texts()
    page.click(".card-open >> text=both")
    wait_until(page, "document.querySelectorAll('.member').length === 6")
    assert page.evaluate(LOADED_TWICE) == 12
    other = center(page, ".member >> nth=5")
    page.locator(".member").nth(0).click()
    assert center(page, ".member >> nth=5") == other  # what can be chosen next does not move away
    page.get_by_role("button", name="Split off").click()
    page.keyboard.type("part")
    page.keyboard.press("Enter")
    wait_until(page, "document.querySelectorAll('.card-open').length === 4")
    page.click(".card-open >> text=part")
    page.get_by_role("button", name="Delete symbol").click()
    page.keyboard.press("Enter")
    wait_until(page, "document.querySelectorAll('.card-open').length === 3")
    for left in (4, 3, 4):
        page.click("#undo")
        wait_until(page, "n => document.querySelectorAll('.card-open').length === n", left)
    assert sorted(names.all_inner_texts()) == sorted(LETTERS)
    page.click("#history summary")
    page.get_by_role("button", name="Restore version 6").click()
    page.keyboard.press("Enter")
    wait_until(page, "[...document.querySelectorAll('.card-name')].some((name) => name.textContent === 'part')")
    wait_until(page, "document.querySelector('#versions li').textContent.includes('Restored version 6')")


def test_hostile_names_are_text(opened, studio, tmp_path):
    folder = tmp_path / "hostile"
    with kineme.ActionLibrary(folder, create=True) as library:
        for name, shape in zip(HOSTILE, ("GShape", "Sine", "Angle", "CShape", "Zshape"), strict=True):
            library.learn(letters(shape)[:2], [name] * 2)
            library.annotate(name, name)
    page = opened(studio(folder), "library", width=390, height=844)
    wait_until(page, "document.querySelectorAll('.card-open').length === 5")
    assert set(page.locator(".card-name").all_text_contents()) == set(HOSTILE)
    for k in range(5):
        page.locator(".card-open").nth(k).click()
        assert page.input_value("#symbol textarea") in HOSTILE
        page.keyboard.press("Escape")  # in a narrow window the symbol is a sheet over the cards
        assert page.is_hidden("#symbol")
        assert page.evaluate("document.activeElement.className") == "card-open"
    for view in VIEWS:
        show(page, view)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, view
    page.evaluate("location.hash = 'draw'")
    draw(page, letters("GShape")[3])
    wait_until(page, "document.querySelectorAll('.chip').length > 0")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.locator("main img, main script").count() == 0
    page.locator(".chip").first.click()
    wait_for_text(page, "#verdict-kind", "Learned")
    with kineme.ActionLibrary(folder, read_only=True) as library:
        assert {symbol.name for symbol in library.symbols()} == set(HOSTILE)  # also where a name ends with a blank


def test_movements_without_a_name_are_proposed_and_named_together(opened, studio, tmp_path):
    with kineme.ActionLibrary(tmp_path / "unnamed", create=True) as library:
        for shape in LETTERS[:3]:
            library.learn(letters(shape), [None] * len(letters(shape)))
    page = opened(studio(tmp_path / "unnamed"), "library", width=820)
    wait_until(page, "document.querySelectorAll('.proposal').length > 1")
    shown = "[document.documentElement, ...document.querySelectorAll('.proposal')]"
    assert set(page.evaluate(f"{shown}.map((element) => element.scrollWidth - element.clientWidth)")) == {
        0
    }  # nothing is cut
    assert "Name movements that are here" in page.inner_text("#library-empty-text")
    first = page.locator(".proposal").first
    assert first.locator(".member").count() >= 3
    first.locator("input").fill("named together")
    first.locator("input").press("Enter")
    wait_until(page, "document.querySelectorAll('.card-open').length === 1")
    settle(page)
    some = page.locator(".proposal").first
    some.locator(".member").nth(0).click()
    some.locator(".member").nth(1).click()
    assert some.locator("button[type=submit]").inner_text() == "Name the 2 chosen"
    some.locator("input").fill("two of them")
    some.locator("input").press("Enter")
    wait_until(page, "document.querySelectorAll('.card-open').length === 2")
    with kineme.ActionLibrary(tmp_path / "unnamed", read_only=True) as library:
        assert len(library["two of them"].members) == 2


def test_a_finger_draws_without_scrolling_and_without_a_keyboard_of_glass(opened, served_letters):
    page = opened(served_letters, width=390, height=844, has_touch=True, is_mobile=True)
    page.evaluate("() => { HTMLInputElement.prototype.focus = function () { window.focused = this.id; }; }")
    box = page.locator("#draw-canvas").bounding_box()
    client = page.context.new_cdp_session(page)
    movement = letters("GShape")[SHOWN]
    picked = np.linspace(0, len(movement.times) - 1, 50).astype(int)
    away = (movement.positions[picked] - movement.positions.min(axis=0)) / np.ptp(movement.positions, axis=0).max()
    points = np.column_stack((box["x"] + 40 + 220 * away[:, 0], box["y"] + 260 - 220 * away[:, 1]))
    now = time.time()
    for k, (x, y) in enumerate(points):
        event = {"type": "touchMove" if k else "touchStart", "timestamp": now + 0.02 * k}
        client.send("Input.dispatchTouchEvent", {**event, "touchPoints": [{"x": x, "y": y}]})
    client.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    wait_until(page, ANSWERED)
    assert page.inner_text(".rank:first-child .rank-name") == "GShape"
    assert page.evaluate("window.scrollY") == 0
    assert page.evaluate("window.focused") is None


def test_a_second_finger_on_a_handle_does_not_drag_it(opened, served_letters):
    page = opened(served_letters, "move", has_touch=True)
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    (x, y), client = center(page, ".handle.goal"), page.context.new_cdp_session(page)

    def touch(kind, *points):
        points = [{"id": k, "x": at[0], "y": at[1]} for k, at in enumerate(points)]
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (x, y))
    touch("touchStart", (x, y), (x + 12, y))
    touch("touchMove", (x - 40, y), (x + 12, y + 30))
    touch("touchMove", (x - 80, y), (x + 12, y + 60))
    touch("touchEnd")
    wait_until(page, "!document.getElementById('move-stage').classList.contains('dragging')")
    np.testing.assert_allclose(center(page, ".handle.goal"), (x - 80, y), atol=0.2)
    assert page.get_attribute("#move-stage", "class") == "stage"


def test_a_pen_goes_before_the_hand_that_rests_and_may_be_lifted_unheard(opened, served_letters):
    page = opened(served_letters, has_touch=True)
    x, y = center(page, "#draw-canvas")
    client = page.context.new_cdp_session(page)
    client.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x + 200, "y": y + 100}]})
    pen = {"pointerType": "pen", "button": "left", "clickCount": 1, "force": 0.5}
    for k, kind in enumerate(["mousePressed", *["mouseMoved"] * 30]):
        at = {"x": x + 4 * k, "y": y - 50 * np.sin(k / 5)}
        client.send("Input.dispatchMouseEvent", {"type": kind, **at, **pen, "buttons": 1})
    assert page.inner_text("#verdict-kind") not in {"Too short", "Sure", "Probably", "Looks like", "New"}
    client.send("Input.dispatchMouseEvent", {"type": "mouseMoved", "x": x, "y": y, "pointerType": "pen", "buttons": 0})
    wait_until(page, ANSWERED)
    client.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    draw(page, letters("GShape")[SHOWN])
    wait_until(page, "document.querySelector('.rank .rank-name').textContent === 'GShape'")


def test_the_program_that_the_page_shows_is_followed_by_the_page(opened, served_letters, monkeypatch):
    page = opened(served_letters)
    shown = page.locator("#live-source pre").all_text_contents()
    documented = re.findall(
        r"```(?:py|js)\n(.*?)```", (ROOT / "docs" / "guide" / "studio-network.md").read_text(), re.DOTALL
    )
    host = served_letters.address.removeprefix("http://")
    assert shown == [text.strip().replace("127.0.0.1:8420", host) for text in documented]
    monkeypatch.setenv("KINEME_STUDIO_TOKEN", served_letters.token)
    connected = Event()  # without it, the program may be over before a busy page shows it
    monkeypatch.setattr("builtins.print", lambda *_: connected.wait(300))
    thread = Thread(target=exec, args=(shown[0], {}))
    thread.start()
    wait_for_text(page, "#sources li .source-name", "Live source connected: hand tracker")
    connected.set()
    wait_until(page, ANSWERED)
    thread.join(300)
    wait_until(page, "document.querySelectorAll('#sources li').length === 0")
    assert page.is_visible("#ranks .rank-value >> nth=0")
    assert page.evaluate("document.activeElement.id") != "naming-name"  # nobody asked for it


def test_everything_goes_by_the_keyboard(opened, studio, tmp_path):
    page = opened(studio(make_letters(tmp_path / "letters", shown=2)))
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "tab-draw"
    for _ in range(10):
        if page.evaluate("document.activeElement.id") == "draw-canvas":
            break
        page.keyboard.press("Tab")
    page.keyboard.press(" ")
    for key in ("ArrowRight", "ArrowDown", "ArrowLeft"):
        page.keyboard.down(key)
        page.evaluate(FRAMES, 20)  # a step of the pen each
        page.keyboard.up(key)
    page.keyboard.press(" ")
    wait_until(page, "document.activeElement.id === 'naming-name'")
    page.keyboard.type("hook")
    page.keyboard.press("Enter")
    wait_for_text(page, "#verdict", "hook")
    page.keyboard.press("2")
    wait_until(page, "document.querySelectorAll('.card-open').length === 5")
    assert page.evaluate("document.activeElement.id") == "tab-library"
    page.keyboard.press("ArrowRight")
    assert page.is_visible("#view-move")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    before = page.get_attribute(".handle.goal", "aria-label")
    for _ in range(20):
        page.keyboard.press("Tab")
        if "goal" in (page.evaluate("document.activeElement.className") or ""):
            break
    page.keyboard.press("Shift+ArrowRight")
    assert page.get_attribute(".handle.goal", "aria-label") != before
    page.keyboard.press("Control+z")  # here it takes back the step, and not what was learned
    assert page.get_attribute(".handle.goal", "aria-label") == before
    assert "5 symbols" in page.inner_text("#library-count")
    page.set_viewport_size({"width": 390, "height": 500})
    page.keyboard.press("?")
    assert page.is_visible("#keys")
    assert page.evaluate("document.getElementById('keys').scrollTop") == 0
    page.keyboard.press("Escape")
    assert not page.is_visible("#keys")


#: Wait for so many frames.
FRAMES = """(left) => new Promise((done) => {
  const step = () => (left-- > 0 ? requestAnimationFrame(step) : done());
  step();
})"""


def _labeled(name):
    """A table of two movements of one label."""
    rows = [
        (k, *row)
        for k in (5, 6)
        for movement in letters("Angle")[k : k + 1]
        for row in zip(movement.times, *movement.positions.T, strict=True)
    ]
    return "movement,time,x,y,label\n" + "".join(f"{k},{t:.4f},{x:.4f},{y:.4f},{name}\n" for k, t, x, y in rows)


_SAYS = "(words) => [...document.querySelectorAll('.toast')].some((toast) => toast.textContent.includes(words))"


def _one_after_the_other():
    """A table of two letters with rests behind them."""
    rows, at, end = [], 0.0, np.zeros(2)
    for shape in ("GShape", "Sine"):
        movement = letters(shape)[SHOWN]
        picked = np.linspace(0, len(movement.times) - 1, 200).astype(int)
        positions = movement.positions[picked] - movement.positions[0] + end
        times = movement.times[picked] - movement.times[0] + at
        rest = np.arange(times[-1] + 0.02, times[-1] + 0.7, 0.02)
        end, at = positions[-1], rest[-1] + 0.02
        rows += [*zip(times, *positions.T, strict=True), *((t, *end) for t in rest)]
    return "time,x,y,z\n" + "".join(f"{t:.4f},{x:.4f},{y:.4f},0\n" for t, x, y in rows)


def test_nothing_moves_under_the_hand_when_the_shapes_of_a_recording_come(opened, studio, folder):
    page = opened(studio(folder))
    late = []
    page.route("**/shapes", lambda route: [late.append(route)])
    page.evaluate(DROP, ["letters.csv", _one_after_the_other()])
    wait_for_text(page, "#recording-name", "letters.csv")
    shown = page.locator("#channels").bounding_box()
    wait_until(page, "window.unanswered > 0")
    late[0].continue_()
    wait_until(page, "document.getElementById('shape-name').textContent !== ''")
    assert page.locator("#channels").bounding_box() == shown


def test_a_dropped_recording_is_searched_corrected_and_learned(opened, studio, tmp_path):
    name = "two letters <b>.csv"
    page = opened(studio(make_letters(tmp_path / "letters")), tolerated=("400",))
    page.evaluate(DROP, ["notes.pdf", "nothing"])  # in the view Draw
    wait_until(page, "document.getElementById('drop-state').textContent.startsWith('notes.pdf: expected a file')")
    page.evaluate(DROP, [name, _one_after_the_other()])
    wait_for_text(page, "#recording-name", name)
    page.locator("#channels input").nth(2).check()  # chosen at first are as many as the library's movements have
    assert page.is_disabled("#spot")
    assert page.inner_text("#channels-note") == "Movements of this library have 2 columns; 3 are chosen. Choose 2."
    page.locator("#channels input").nth(2).uncheck()
    page.click("#zoom-in")
    page.route("**/spotted", lambda route: None)  # a search that takes long
    page.click("#spot")
    wait_for_text(page, "#spot", "Cancel")
    page.click("#spot")
    wait_for_text(page, "#spans-state", "Canceled; nothing was changed.")
    page.unroute("**/spotted")
    page.click("#spot")
    wait_until(page, "document.querySelectorAll('#spans tbody tr').length >= 2")
    named = [page.input_value(f"#spans tbody tr:nth-child({k}) input[type=text]") for k in (1, 2)]
    assert set(named) <= {"GShape", "Sine", ""}
    page.fill("#spans tbody tr:nth-child(1) input[type=text]", "from a file")
    page.locator("#spans tbody tr:nth-child(1) input[type=text]").press("Tab")
    page.locator("[data-key='edge end']").press("ArrowLeft")
    before = float(page.input_value("#spans tbody tr:nth-child(1) td:nth-child(2) input"))
    page.locator("[data-key='edge end']").press("Shift+ArrowLeft")
    assert float(page.input_value("#spans tbody tr:nth-child(1) td:nth-child(2) input")) < before
    page.click("#learn-spans")
    wait_until(page, "[...document.querySelectorAll('#names option')].some((option) => option.value === 'from a file')")
    assert not page.is_visible("#learn-file")
    page.route(
        "**/api/recordings", lambda route: route.request.headers["x-file-name"] == "slow.csv" or route.continue_()
    )
    with page.expect_event("requestfailed"):  # it is given up for the next one
        page.evaluate(DROP, ["slow.csv", "nothing"])
        page.evaluate(DROP, ["labeled.csv", _labeled("of a file")])
    wait_for_text(page, "#recording-name", "labeled.csv")
    page.route("**/spotted", lambda route: None)
    page.click("#spot")
    wait_for_text(page, "#spot", "Cancel")
    page.select_option("#tables", index=1)
    assert page.inner_text("#spot") == "Find movements"  # what was searched for was another table's
    page.unroute("**/spotted")
    assert page.input_value("#spans tbody tr:nth-child(1) input[type=text]") == "of a file"
    page.click("#learn-file")
    wait_until(page, "[...document.querySelectorAll('#names option')].some((option) => option.value === 'of a file')")
    wait_until(page, _SAYS, "Learned the whole file")
    assert not page.evaluate(_SAYS, "Nothing is new")
    page.click("#learn-file")
    wait_until(page, _SAYS, "Nothing is new")
    with kineme.ActionLibrary(tmp_path / "letters", read_only=True) as library:
        assert [len(library[name].members) for name in ("from a file", "of a file")] == [1, 2]


def test_the_server_may_be_killed_and_comes_back(opened, studio, tmp_path):
    folder = make_letters(tmp_path / "letters", shown=2)
    killed = Running(folder, "--port", _free_port())
    page = opened(killed, tolerated=("net::ERR_", "WebSocket connection"))
    draw(page, letters("GShape")[SHOWN], share=0.9)
    wait_until(page, "document.querySelector('.rank .rank-name').textContent === 'GShape'")
    killed.end(signal.SIGKILL)
    wait_until(page, "!document.getElementById('away-note').hidden")
    page.mouse.up()
    wait_for_text(page, "#verdict-kind", "No answer yet")
    Served.left.append(int(killed.address.rpartition(":")[2]))
    assert studio(folder).address == killed.address
    wait_until(page, "document.getElementById('away-note').hidden")
    wait_until(page, ANSWERED)  # what was drawn is sent anew, from its beginning
    assert page.inner_text(".rank:first-child .rank-name") == "GShape"
    draw(page, letters("CShape")[SHOWN])
    wait_until(page, "document.querySelector('.rank .rank-name').textContent === 'CShape'")
    wait_until(page, ANSWERED)


def test_every_view_fits_its_window(opened, served_letters):
    page = opened(served_letters)
    for width, view in product(WIDTHS, VIEWS):
        page.set_viewport_size({"width": width, "height": 900})
        show(page, view)
        assert page.is_visible("#library-mode")  # why nothing can be changed
        assert page.evaluate("document.documentElement.scrollWidth") <= width, (width, view)
        small = page.evaluate(
            """() => [...document.querySelectorAll("button, select, input[type=text], input[type=number]")]
            .filter((node) => node.checkVisibility() && node.getBoundingClientRect().width && !node.closest(".away"))
            .filter((node) => Math.min(node.getBoundingClientRect().height, node.getBoundingClientRect().width) < 24)
            .map((node) => node.outerHTML.slice(0, 80))"""
        )
        assert small == [], (width, view)


#: What the panel says of a movement of which this much is done, with the evidence that it is unknown.
SAYS = """([progress, unknown]) => import("/parts/answer_panel.js").then(({ AnswerPanel }) => {
  const certainty = unknown > 0.5 ? null : "looks like";
  const ranked = [{ label: "A", probability: 1 }];
  new AnswerPanel().drawing({ ranked, unknown, certainty, label: null, progress, arrival: null }, 0);
  return ["verdict-kind", "verdict"].map((id) => document.getElementById(id).textContent);
})"""


#: Keep what the page tells over its websocket.
SENT = """() => {
  const send = WebSocket.prototype.send;
  window.sent = [];
  WebSocket.prototype.send = function (text) { window.sent.push(text); send.call(this, text); };
}"""


def test_nothing_is_called_new_before_it_is_over(opened, served_letters):
    """What is unlike each letter so far may end as one in another hand: the end contradicts nothing."""
    page = opened(served_letters)
    assert page.evaluate(SAYS, [0.05, 1]) == ["Still open", "…"]  # every beginning is unlike the whole
    assert page.evaluate(SAYS, [0.3, 1]) == ["Still open", "A"]
    assert page.evaluate(SAYS, [0.3, 0]) == ["Looks like, so far", "A"]


def test_drawing_does_not_move_anything_else(opened, served_letters):
    """No jumping layout: what stands beside the drawing stays where it is, whatever is said."""
    page = opened(served_letters)
    where = """() => ["ranks", "naming", "draw-canvas", "draw-clear"].map((id) => {
        const b = document.getElementById(id).getBoundingClientRect(); return [id, b.x, b.y, b.width, b.height]; })"""
    before = page.evaluate(where)
    draw(page, letters("Sine")[SHOWN], share=0.6)
    assert page.evaluate(where) == before
    page.mouse.up()
    wait_until(page, "document.getElementById('verdict').textContent !== '…'")
    assert page.evaluate(where) == before
    draw(page, letters("Sine")[SHOWN], share=0.6)
    page.keyboard.press("Escape")
    page.mouse.move(300, 300)
    page.mouse.up()
    assert page.is_hidden("#verdict-kind")
    assert page.is_visible("#draw-empty")


def test_a_drawing_is_what_the_hand_did_when_the_window_changes(opened, served_letters):
    page = opened(served_letters)
    page.evaluate(SENT)
    (x, y), height = center(page, "#draw-canvas"), page.locator("#draw-canvas").bounding_box()["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 38, y - 19, steps=19)
    page.set_viewport_size({"width": 1000, "height": 640})
    page.mouse.move(x - 40, y - 20)
    wait_until(page, "document.getElementById('draw-canvas').clientHeight < 600")
    page.mouse.move(x - 42, y - 21)
    page.evaluate("location.hash = 'library'")  # as a swipe on the trackpad may do
    wait_until(page, "document.getElementById('view-draw').hidden")
    page.mouse.move(x - 44, y - 22)
    page.mouse.up()
    wait_until(page, "window.sent.some((text) => text.includes('finish'))")
    sent = [sample for text in page.evaluate("window.sent") for sample in json.loads(text).get("samples", [])]
    moved = np.subtract(sent[-4:], sent[0])[:, 1:] * height / 100  # the canvas is 100 high in units of the letters
    np.testing.assert_allclose(moved, [(-38, 19), (-40, 20), (-42, 21), (-44, 22)], atol=1e-6)


def test_movements_in_space_turn(opened, studio, tmp_path):
    t = np.linspace(0, 2, 80)
    shapes = [np.column_stack((np.cos(k * t), np.sin(2 * t), 0.4 * t)) for k in (1, 2, 3)]
    with kineme.ActionLibrary(tmp_path / "space", create=True) as library:
        for k, shape in enumerate(shapes):
            library.learn([kineme.Trajectory(t, shape), kineme.Trajectory(t, 1.1 * shape)], [f"in space {k}"] * 2)
    running = studio(tmp_path / "space")
    page = opened(running)
    assert page.inner_text("#draw-empty-title") == "Movements in space"
    assert "additional_headers" in page.inner_text("#live-source")
    with Hand(running, "hand <b>tracker</b>") as hand:
        hand.send(t, 1.05 * shapes[0])
        wait_for_text(page, "#sources .source-name", "Live source connected: hand <b>tracker</b>")
        wait_until(page, "document.getElementById('draw-empty').hidden")
        before = page.evaluate(PIXELS)
        page.locator("#draw-canvas").press("ArrowLeft")
        wait_until(page, f"before => ({PIXELS})() !== before", before)
        hand.finish()
        wait_until(page, ANSWERED)
        page.fill("#naming-name", "from the hand")
        hand.send(t, shapes[1])  # while it is being named: it waits
        wait_until(page, "document.getElementById('sources').classList.contains('waits')")
        page.press("#naming-name", "Enter")
        wait_for_text(page, "#verdict-kind", "Learned")
        page.get_by_role("button", name="Ignore hand").click()
        shown = page.evaluate(PIXELS)
        hand.send(t + 9, shapes[1])
        page.get_by_role("button", name="Ignore hand").click()
        wait_until(page, f"before => ({PIXELS})() !== before", shown)
    wait_until(page, ANSWERED)  # it went without an end: asked for as a whole
    with kineme.ActionLibrary(tmp_path / "space", read_only=True) as library:
        learned = library.movements("from the hand")[0]
        np.testing.assert_allclose(learned.positions, 1.05 * shapes[0], atol=1e-6)
    page.keyboard.press("3")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    before = center(page, ".handle.goal")
    page.locator("#move-canvas").press("ArrowLeft")
    assert center(page, ".handle.goal") != before


def test_no_rule_of_accessibility_is_broken(opened, studio, tmp_path):
    page = opened(studio(make_letters(tmp_path / "letters", shown=2)))
    for view in VIEWS:
        show(page, view)
        assert violations_in_both(page) == [], view


def test_sliders_move_between_the_recordings_of_a_symbol(opened, served_letters):
    page = opened(served_letters, "move")
    wait_until(page, "!document.getElementById('styles').hidden")
    settle(page)
    page.click("#move-advanced > summary")
    other = page.locator("#formulations input").nth(1)
    with page.expect_response("**/api/rollout"):
        other.check()
    wait_until(page, "document.querySelectorAll('#move-legend li').length === 3")
    with page.expect_response("**/api/rollout"):
        page.locator("#styles input[type=checkbox]").check()
    assert other.is_disabled()  # styles move in one formulation alone, and no other is asked for
    wait_until(page, "document.querySelectorAll('#move-legend li').length === 2")
    settle(page)
    with page.expect_response("**/api/rollout") as answered:
        page.locator("#styles input[type=range]").first.press("ArrowRight")
    body = answered.value.request.post_data_json
    assert body["what"]["style"]["values"][0] != 0
    assert answered.value.ok


def test_an_arm_executes_a_letter(opened, served_letters):
    pytest.importorskip("pinocchio", reason="the extra robot is not installed")
    # What moves is painted sixty times a second: in a small window that is little.
    page = opened(served_letters, reduced_motion="no-preference", width=480, height=320)
    page.evaluate("history.replaceState(null, '', '#robot')")  # shown when it is loaded again
    held = []  # arms are asked for before and after the library is there; the first answer comes last
    page.route("**/api/robots", lambda route, _: route.continue_() if held else held.append(route))
    page.reload()
    wait_until(page, "!document.getElementById('robot-main').hidden")
    held[0].continue_()
    settle(page)
    wait_until(page, "document.getElementById('robot-verdict').dataset.state === 'passed'")  # without being asked to
    assert page.locator("#robot-checks tr").count() > 5
    frame = page.frame_locator(".arm-frame")
    frame.locator("#play:text-is('Pause')").click()  # it moves by itself
    page.emulate_media(reduced_motion="reduce")
    assert frame.locator(".chart .limit").count() > 0
    assert page.is_hidden("#robot-dragged")
    with page.expect_download() as given:
        frame.locator("#save-picture").click()
    assert given.value.suggested_filename == "arm.png"
    assert given.value.path().read_bytes().startswith(b"\x89PNG")
    page.set_viewport_size({"width": 390, "height": 844})
    inside = page.frames[-1]  # as high as what is in it
    wait_until(inside, "document.documentElement.scrollHeight <= innerHeight && innerHeight > 500")
    page.set_viewport_size({"width": 1024, "height": 640})
    page.locator("#tab-robot").press("3")
    wait_until(page, "document.querySelectorAll('.handle').length === 2")
    page.locator(".handle.goal").press("Shift+ArrowLeft")
    with page.expect_request("**/api/robots/move") as request:
        page.keyboard.press("5")
    assert len(request.value.post_data_json["displacement"]) == 2  # it goes where the goal was dragged to
    page.select_option("#robot-what", label="Sine")
    for view in ("draw", "robot"):
        show(page, view)
    assert page.locator("#robot-what option:checked").inner_text() == "Sine"

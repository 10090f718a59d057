"""The first minute in Chromium: a stranger draws, names and is recognized; answers speak one language; why."""

from __future__ import annotations

import re
import time
from shutil import copytree

import numpy as np
import pytest
from browser_samples import ANSWERED, draw, letters, settle, show, wait_for_text

import kineme
from browsing import wait_until
from kineme.datasets import EXAMPLES, load_example
from kineme.studio.page.write_page import write_page
from soaking import slow

VIEWS = ("draw", "library", "move", "recordings", "robot")
MOST = 20  # enabled controls on a first screen

#: What can be used without scrolling, by id or text.
CONTROLS = """() => [...document.querySelectorAll("button, input, select, textarea, summary, a[href], [tabindex='0']")]
  .filter((node) => !node.matches(":disabled") && node.checkVisibility({ visibilityProperty: true }))
  .filter((node) => {
    const box = node.getBoundingClientRect();
    return box.width > 0 && box.bottom > 0 && box.top < innerHeight && box.right > 0 && box.left < innerWidth;
  })
  .map((node) => node.id || node.textContent.trim() || node.getAttribute("aria-label"))"""

PAINTED = """(id) => {
  const canvas = document.getElementById(id);
  return canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0);
}"""


def strokes(name):
    """A letter as another hand writes it: arcs and lines, none of LASA's."""

    def arc(x, y, a, b, n=24):
        t = np.radians(np.linspace(a, b, n))
        return np.column_stack((x * np.cos(t), y * np.sin(t)))

    points = {
        "C": arc(0.8, 1.0, 45, 315),
        "G": np.concatenate((arc(0.8, 1.0, 45, 340), [[0.7, 0.0], [0.2, 0.0]])),
        "L": np.array([[0.0, 1.0], [0.0, -1.0], [0.9, -1.0]]),
        "S": np.concatenate((arc(0.6, 0.5, 30, 265) - [0, -0.5], arc(0.6, 0.5, 85, -150) - [0, 0.5])),
        "Z": np.array([[-0.7, 1.0], [0.7, 1.0], [-0.7, -1.0], [0.7, -1.0]]),
    }[name]
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    even = np.linspace(0.0, lengths[-1], 80)
    path = np.column_stack([np.interp(even, lengths, column) for column in points.T])
    return kineme.Trajectory(np.linspace(0.0, 1.4, 80), path)


@pytest.fixture
def allowed():
    """Pages of one file, too."""
    return "file:", "blob:"


@pytest.fixture
def opened(opened, studio):
    """A function that opens a studio of a folder, by the address that it prints."""

    def open_page(folder, **options):
        page = opened(studio(folder), "", **options)
        settle(page)
        return page

    return open_page


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    """A library of each example, and its page."""
    folder = tmp_path_factory.mktemp("examples")
    for name in EXAMPLES:
        with kineme.ActionLibrary(folder / name, create=True) as library:
            library.learn(load_example(name))
            if library.n_dims == 2:
                write_page(folder / f"{name}.html", library)
    return folder


def draw_by_finger(page, movement, on):
    """Draw with a finger in the middle of a canvas, all of it in a second and a half."""
    wait_until(page, "performance.now() > 1600")  # of what came before the page, its times would all be zero
    box = page.locator(on).bounding_box()
    size = 0.6 * min(box["width"], box["height"]) / np.ptp(movement.positions, axis=0).max()
    away = (movement.positions - movement.positions.min(axis=0) - np.ptp(movement.positions, axis=0) / 2) * [
        size,
        -size,
    ]
    points = away + np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
    touch, now = page.context.new_cdp_session(page), time.time() - 1.5  # a tap that seems to come before is no tap
    for k in np.linspace(0, len(points) - 1, 50).astype(int):
        event = {"type": "touchMove" if k else "touchStart", "timestamp": now + 1.5 * k / len(points)}
        touch.send("Input.dispatchTouchEvent", {**event, "touchPoints": [{"x": points[k, 0], "y": points[k, 1]}]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    touch.detach()


@pytest.mark.parametrize("narrow", [False, True])
def test_a_stranger_is_recognized_after_five_actions(opened, tmp_path, narrow):
    phone = {"width": 390, "height": 600, "has_touch": True, "is_mobile": True, "kind": "phone"}
    page = opened(tmp_path / "new", reduced_motion="no-preference", **(phone if narrow else {}))
    seen = page.inner_text("main")
    assert [word in seen for word in ("Draw it again", "try an example", "or a program", "p-value")] == [1, 1, 0, 0]
    assert page.is_hidden("#ranks")
    assert page.is_hidden("#naming")
    hand = (lambda movement: draw_by_finger(page, movement, "#draw-canvas")) if narrow else lambda m: draw(page, m)
    began = time.monotonic()
    hand(strokes("S"))  # 1
    wait_until(page, "!document.getElementById('naming-name').disabled")
    if narrow:
        page.tap("#naming-name")  # 2
    wait_until(page, "document.activeElement.id === 'naming-name'", seconds=20)  # with a mouse it is there already
    page.keyboard.type("my own")  # 3
    page.keyboard.press("Enter")  # 4
    wait_for_text(page, "#verdict-kind", "Learned")
    settle(page)
    box = page.locator("#draw-canvas").bounding_box()
    assert 0 <= box["y"] <= page.viewport_size["height"] - box["height"]  # also where a keyboard of glass was
    hand(strokes("S"))  # 5
    wait_until(page, ANSWERED)
    assert time.monotonic() - began < 30
    assert (page.inner_text("#verdict-kind"), page.inner_text("#verdict")) == ("Looks like", "my own")
    assert page.evaluate(PAINTED, "nearest")


def test_an_example_is_learned_and_another_hand_is_told_what_its_letters_look_like(opened, tmp_path):
    page = opened(tmp_path / "new")
    page.click("text=Letters")
    wait_until(page, "document.querySelectorAll('#known-symbols li').length === 10")
    assert page.is_hidden("#draw-examples")
    for name in "CGLSZ":
        draw(page, strokes(name))
        wait_until(page, ANSWERED)
        assert (page.inner_text("#verdict-kind"), page.inner_text("#verdict")) == ("Looks like", name)
    settle(page)  # why it looks like one that is known is refused when none is
    page.click("#undo")
    wait_until(page, "document.getElementById('library-count').textContent.startsWith('0 symbols')")


def turn(overlay):
    """By how much an example was turned, as captions say it."""
    return f" turned by {overlay.turned:.0f}°" if overlay.turn else ""


def test_yes_teaches_the_library_and_why_shows_what_python_says(opened, examples, tmp_path):
    page = opened(copytree(examples / "letters", tmp_path / "own"))
    draw(page, strokes("G"))
    wait_until(page, ANSWERED)
    page.click("#why summary")
    wait_until(page, "!document.getElementById('why-pictures').hidden")
    page.click("text=Yes, it is G")
    wait_for_text(page, "#verdict-kind", "Learned")
    captions = page.locator("#why-pictures figcaption").all_text_contents()
    with kineme.ActionLibrary(tmp_path / "own") as library:
        drawn = library.movements("G")[-1]
        assert len(library["G"].members) == 8
        library.undo()
        explained = library.recognize(drawn).explain()
    assert [caption.split(";")[0] for caption in captions] == [
        f"{role}: {overlay.label}{turn(overlay)}, {overlay.similarity:.2f} alike"
        for role, overlay in (("Nearest", explained.nearest), ("Next", explained.runner_up))
    ]
    assert f"{100 * explained.nearest.differences.max():.0f} % of its size" in captions[0]


#: What another tab does to a symbol.
RENAME = """async (name) => {
  const { symbolNamed } = await import("/parts/library_state.js");
  const { post } = await import("/parts/api.js");
  await post(`/api/library/symbols/${symbolNamed(name).id}/rename`, { name: "another" });
}"""


def test_what_is_taken_back_is_asked_again(opened, examples, tmp_path):
    page = opened(copytree(examples / "letters", tmp_path / "own"))
    draw(page, strokes("C"))
    wait_until(page, ANSWERED)
    page.click("text=Yes, it is C")
    wait_for_text(page, "#verdict-kind", "Learned")
    page.click("#undo")
    wait_for_text(page, "#verdict-kind", "Looks like")
    assert page.locator(".toast:has-text('Undo')").count() == 0  # nothing offers to take it back once more
    page.click("text=Yes, it is C")
    wait_for_text(page, "#verdict-kind", "Learned")
    wait_until(page, "document.getElementById('library-count').textContent === '10 symbols, 71 movements'")
    draw(page, strokes("C"))
    wait_until(page, f"{ANSWERED} && document.activeElement.id === 'naming-name'")
    page.keyboard.type("a")
    page.keyboard.press("Control+z")  # takes back the letter alone
    assert page.input_value("#naming-name") == ""
    assert page.inner_text("#library-count") == "10 symbols, 71 movements"
    page.keyboard.press("Control+z")
    wait_until(page, "document.getElementById('library-count').textContent === '10 symbols, 70 movements'")
    page.evaluate(RENAME, "C")
    wait_until(page, "document.getElementById('chips').textContent.startsWith('Yes, it is another')")


def test_the_page_explains_as_python_does(opened, pages, examples):
    page = pages.new(kind="page")
    page.goto((examples / "letters.html").as_uri())
    wait_until(page, "window.kineme !== undefined")
    assert page.is_hidden("#ranks")
    for name in "GSZ":
        page.keyboard.press("Escape")
        draw(page, strokes(name), on="#stage")
        wait_until(page, "!document.getElementById('why-pictures').hidden")
        assert page.evaluate(PAINTED, "nearest")
        times, positions = page.evaluate("[kineme.state.drawn.times, kineme.state.drawn.positions]")
        captions = page.locator("#why-pictures figcaption").all_text_contents()
        with kineme.ActionLibrary(examples / "letters", read_only=True) as library:
            explained = library.recognize(kineme.Trajectory(np.array(times), np.array(positions))).explain()
        for caption, overlay in zip(captions, (explained.nearest, explained.runner_up), strict=True):
            assert f": {overlay.label}" in caption
            assert f", {overlay.similarity:.2f} alike" in caption
            turned = re.search(r" turned by (-?\d+)°", caption)
            assert float(turned[1] if turned else 0.0) == pytest.approx(overlay.turned, abs=3.0 if turned else 12.0)
            shown = int(caption.split("up to ")[1].split(" %")[0]) / 100
            assert shown == pytest.approx(overlay.differences.max(), abs=0.04)  # its paths are smoothed more


def test_a_second_drawing_by_a_finger_is_a_drawing_until_it_is_dragged(opened, pages, examples):
    page = pages.new(width=390, height=844, has_touch=True, is_mobile=True, kind="phone page")
    page.goto((examples / "letters.html").as_uri())
    wait_until(page, "window.kineme !== undefined")
    for name in "GC":  # both begin where the first one does
        draw_by_finger(page, strokes(name), "#stage")
        wait_until(page, "name => kineme.state.answer?.ranked[0].label === name", name)
        assert page.evaluate("kineme.state.stroke") is None
    before = page.evaluate("kineme.state.moving.goal")
    page.tap("#drag")
    wait_until(page, "kineme.state.drags", seconds=20)
    path = page.evaluate("kineme.state.moving.positions.map((x) => kineme.stage.project(x))")
    box = page.locator("#stage").bounding_box()
    (x, y), left, top = path[-1], box["x"], box["y"]
    touch = page.context.new_cdp_session(page)
    for kind, at in (("touchStart", 0), ("touchMove", 30), ("touchMove", 60)):
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": left + x + at, "y": top + y}]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert page.evaluate("kineme.state.moving.goal") != before
    assert page.evaluate("kineme.state.answer.ranked[0].label") == "C"


@pytest.mark.parametrize(
    ("name", "widths"),
    [("new", (1440,)), ("letters", (390,)), ("gestures", (390,)), ("arm", (1440,))]
    + [slow(name, (1440, 390, 820)) for name in ("new", *EXAMPLES)],
)
def test_a_first_screen_has_few_controls(opened, examples, tmp_path, name, widths):
    """In a window as it was opened, and as wide as others are."""
    many, page = {}, opened((tmp_path if name == "new" else examples) / name, width=widths[0])
    for width in widths:
        page.set_viewport_size({"width": width, "height": 900})
        for view in VIEWS:
            show(page, view)
            many[width, view] = page.evaluate(CONTROLS)
        if name == "letters":
            show(page, "draw")
            draw(page, letters("GShape")[0])
            wait_until(page, ANSWERED)
            many[width, "answered"] = page.evaluate(CONTROLS)
            page.keyboard.press("Escape")
    assert {key: controls for key, controls in many.items() if len(controls) > MOST} == {}


def test_the_first_screen_of_the_page_has_few_controls(pages, examples):
    page = pages.new(kind="page")
    for width in (390, 820, 1440):
        page.set_viewport_size({"width": width, "height": 900})
        page.goto((examples / "letters.html").as_uri())
        wait_until(page, "window.kineme !== undefined")
        assert len(page.evaluate(CONTROLS)) <= MOST
    pages.leave("file:", "blob:")


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_told_apart_and_do_not_change(name):
    demos, again = load_example(name), load_example(name)
    np.testing.assert_array_equal(demos.positions, again.positions)
    held = np.arange(len(demos)) % (7 if name == "letters" else 5) > 2
    recognizer = kineme.Recognizer().fit(demos[~held])
    answers = recognizer.recognize(demos[held])
    assert np.mean([answer.label == label for answer, label in zip(answers, demos[held].labels, strict=True)]) >= 0.9


def test_other_examples_are_refused():
    with pytest.raises(kineme.errors.SpecificationError, match="letters"):
        load_example("dances")

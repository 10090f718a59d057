"""Widgets in Chromium: their front end as anywidget loads it, in a page that is no notebook's."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from browsing import Pages, stroke, violations, wait_until

pytest.importorskip("anywidget", reason="the extra notebook is not installed")
from widget_samples import Cell, demonstrations

from kineme.notebook import Draw, Move

HOSTILE = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def tabs(browser):
    tabs = Pages(browser, errors=("error", "warning"))
    yield tabs
    tabs.close()


@pytest.fixture
def show(tabs):
    """A function that shows a widget; at the end, nothing was requested and nothing went wrong."""
    yield lambda widget, dark=False, **options: Cell(tabs.new(**options), widget, dark)
    tabs.leave("about:", "blob:")


@pytest.mark.parametrize("width", [390, 1000])
def test_movements_are_drawn_named_and_taken_back(show, width):
    cell = show(Draw(), width=width)
    cell.frame.fill("#name", HOSTILE)
    cell.draw("GShape")
    cell.frame.fill("#name", "")
    cell.draw("Sine")
    first, last = cell.widget.trajectories
    assert (first.label, last.label) == (HOSTILE, None)
    assert len(first) > 50
    assert first.duration == pytest.approx(1.0, abs=0.01)  # as fast as it was drawn
    assert kineme.Recognizer().fit(demonstrations()).predict([first.positions, last.positions]).tolist() == [
        "GShape",
        "Sine",
    ]
    assert 0 < first.positions[:, 1].min() < first.positions[:, 1].max() < 1
    assert cell.frame.locator("#symbols li").all_inner_texts() == ["no name", HOSTILE]
    cell.frame.click("#undo")
    wait_until(cell.page, "model.get('drawn').length === 1")
    cell.frame.click("#clear")
    wait_until(cell.page, "model.get('drawn').length === 0")
    cell.take()
    assert cell.widget.trajectories == []
    assert cell.frame.locator("#undo").is_disabled()
    assert cell.frame.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_a_tap_is_no_movement(show):
    cell = show(Draw())
    cell.frame.click("#stage")
    assert "Too short" in cell.frame.inner_text("#hint")
    assert cell.page.evaluate("model.get('drawn')") == []


def test_a_drawing_is_recognized_in_the_cell_and_in_python(show):
    cell = show(Draw(kineme.Recognizer().fit(demonstrations())), dark=True)
    cell.draw("GShape")
    answer = cell.widget.answer
    assert answer.ranked[0] == "GShape"
    assert cell.frame.inner_text("#verdict") == (answer.label or "Unknown")
    assert cell.frame.evaluate("kineme.state.answer.ranked[0].label") == "GShape"
    cell.take()
    np.testing.assert_allclose(cell.widget.goal, cell.widget.trajectory.positions[-1])
    assert cell.widget.path.label == "Your drawing"


def test_a_goal_is_dragged_and_read_in_python(show):
    primitives = kineme.DMP().learn(demonstrations()[[0, 3]])
    cell = show(Move(primitives))
    area = cell.frame.locator("#stage").bounding_box()
    cell.frame.get_by_role("button", name="GShape").click()
    wait_until(cell.page, "model.get('moved').name === 'GShape'")
    corner = np.array([area["x"], area["y"]]) + 6.5
    stroke(cell.page, corner + np.outer(np.arange(8), [3, 1]), np.linspace(0, 0.2, 8))
    x, y = cell.frame.evaluate("kineme.stage.project(kineme.state.moving.goal)")  # what is drawn beside it is nothing
    start = np.array([area["x"] + x, area["y"] + y])
    cell.page.mouse.move(*start)
    cell.page.mouse.down()
    cell.page.mouse.move(*(start + np.array([30, 40])), steps=3)
    cell.page.mouse.up()
    wait_until(cell.page, f"model.get('moved').goal[1] < {primitives.goals[1, 1] - 1}")
    cell.take()
    move = cell.widget
    assert move.goal[0] > primitives.goals[1, 0] + 1
    np.testing.assert_allclose(move.start, primitives.starts[1])
    assert move.primitive.labels.tolist() == ["GShape"]
    expected = move.primitive.rollout(goal=move.goal, n_samples=len(move.path)).positions[0]
    np.testing.assert_allclose(move.path.positions, expected, atol=1e-4 * np.ptp(expected))
    assert cell.page.evaluate("model.get('drawn')") == []
    again = show(move)  # as where the cell is scrolled out of sight and back
    wait_until(again.frame, "kineme.state.moving?.name === 'GShape'")
    np.testing.assert_allclose(again.frame.evaluate("kineme.state.moving.goal"), move.goal)
    again.take()
    np.testing.assert_allclose(move.goal, again.widget.goal)
    assert again.widget.goal[0] > primitives.goals[1, 0] + 1


def test_the_answer_is_whole_beside_its_example(show):
    cell = show(Move(kineme.DMP().learn(demonstrations()[[0, 3]])), width=1000)
    cell.frame.get_by_role("button", name="GShape").click()
    lines = """(text) => {
      const words = document.createRange();
      document.getElementById("verdict").textContent = text;
      words.selectNodeContents(document.getElementById("verdict"));
      return words.getClientRects().length;
    }"""
    wait_until(cell.frame, "!document.getElementById('nearest').hidden")
    assert [cell.frame.evaluate(lines, text) for text in ("GShape", "Unknown")] == [1, 1]


def test_a_goal_that_python_sets_is_shown(show):
    cell = show(Move(kineme.DMP().learn(demonstrations()[[0, 3]])))
    cell.frame.get_by_role("button", name="GShape").click()
    wait_until(cell.page, "model.get('moved').name === 'GShape'")
    cell.take()
    move = cell.widget
    move.place(goal=move.goal + np.array([4.0, -3.0]))
    cell.page.evaluate("moved => model.set('moved', moved)", move.moved)  # as the kernel sends it
    wait_until(cell.frame, "goal => String(kineme.state.moving.goal) === String(goal)", move.moved["goal"])
    assert cell.frame.evaluate("kineme.state.moving.name") == "GShape"
    wait_until(cell.page, "goal => String(window.saved.moved.goal) === String(goal)", move.moved["goal"])
    cell.take()
    expected = move.primitive.rollout(goal=move.goal, n_samples=len(move.path)).positions[0]
    np.testing.assert_allclose(move.path.positions, expected, atol=1e-4 * np.ptp(expected))


def test_what_is_drawn_is_as_light_as_a_dark_notebook_needs(show):
    """Colors that were taken before the notebook said that it is dark are taken anew."""
    cell = show(Draw(), dark=True, color_scheme="light")
    cell.draw()
    pixels = """(() => {
      const canvas = document.getElementById("stage");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      const colors = {};
      for (let k = 0; k < data.length; k += 4)
        if (data[k + 3] === 255) colors[data.slice(k, k + 3)] = (colors[data.slice(k, k + 3)] ?? 0) + 1;
      return Object.entries(colors).sort((a, b) => b[1] - a[1])[0][0];
    })()"""
    wait_until(cell.frame, f"{pixels} === '86,180,233'")  # --ink of the dark palette


def test_only_the_page_of_the_cell_is_heard(show):
    cell = show(Draw())
    cell.page.evaluate("window.postMessage({ drawn: [['x', []]], moved: { name: 'x' } }, '*')")
    cell.draw()  # heard after it
    assert len(cell.widget.drawn) == 1
    assert cell.widget.moved == {}


@pytest.mark.parametrize("dark", [False, True])
def test_a_page_is_as_dark_as_its_notebook(show, dark):
    cell = show(Draw(), dark=dark, color_scheme="light" if dark else "dark")
    paper = "getComputedStyle(document.querySelector('section')).backgroundColor"
    colors = ["rgb(255, 255, 255)", "rgb(23, 27, 31)"]
    assert cell.frame.evaluate(paper) == colors[dark]
    cell.page.evaluate("document.body.style.color = document.body.style.color === '#222' ? '#ddd' : '#222'")
    cell.page.evaluate("(dark) => document.body.style.color = dark ? '#222' : '#ddd'", dark)
    wait_until(cell.frame, f"{paper} === '{colors[not dark]}'")


def test_a_page_is_all_in_sight_and_leaves_with_its_cell(show):
    cell = show(Draw(kineme.Recognizer().fit(demonstrations())), width=600)
    fits = "document.documentElement.scrollHeight <= innerHeight"
    wait_until(cell.frame, fits)
    cell.page.evaluate("window.leave(); document.querySelector('iframe').remove(); model.set('drawn', [])")


@pytest.mark.parametrize("dark", [False, True])
def test_pages_are_accessible(show, dark):
    rules = {"runOnly": ["color-contrast"]} if dark else {}  # colors alone differ
    for widget in (Draw(), Move(kineme.DMP().learn(demonstrations()[[0, 3]]))):
        cell = show(widget, dark=dark)
        assert violations(cell.frame, **rules) == []

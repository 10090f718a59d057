"""The interactive figure of the concepts computes what kineme does, and can be used by pointer and keyboard."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from make_interactive import FOLDER, FORMULATIONS, N_BASIS, N_POINTS, html, matrices, pages_to_draw_in, write

import kineme

NODE = shutil.which("node")
_SHAPE = "Spoon"
_ASK = """
const figure = require(process.argv[1]);
const { data, name, path, goal } = JSON.parse(require("fs").readFileSync(0, "utf8"));
const one = figure.encode(data, name, path);
const u = Array.from({ length: 5 }, (_, k) => k / 4);
const moved = figure.decode(data, name, one, goal);
console.log(JSON.stringify({ one, moved, basis: u.map((u) => figure.basis(data, u)) }));
"""


@pytest.fixture(scope="module")
def data():
    return matrices()


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The figure, as the build of the site writes it."""
    path = tmp_path_factory.mktemp("figure") / "primitive.html"
    write(path)
    return path.read_text(encoding="utf-8")


def test_the_page_holds_the_matrices_of_today(data, written):
    parts = written.split('<script type="application/json">')
    held, _, after = parts[1].partition("</script>")
    fresh_before, _, fresh = html(data).partition('<script type="application/json">')
    assert (parts[0], after) == (fresh_before, fresh.partition("</script>")[2])
    held = json.loads(held)
    for key in ("Phi", "velocity", "shown", "alpha", "overlap", "n"):
        np.testing.assert_allclose(held[key], data[key], rtol=1e-3, atol=1e-4)
    for name in FORMULATIONS:
        for key in ("encode", "goal"):
            np.testing.assert_allclose(
                held["formulations"][name][key], data["formulations"][name][key], rtol=1e-3, atol=1e-3
            )


@pytest.mark.skipif(NODE is None, reason="node is not installed")
@pytest.mark.parametrize("name", FORMULATIONS)
def test_the_script_learns_and_moves_as_kineme_does(data, name):
    dmp = kineme.DMP(name, n_basis=N_BASIS, n_points=N_POINTS)
    demo = kineme.load_lasa([_SHAPE])[0]
    path = demo.positions[np.linspace(0, len(demo) - 1, N_POINTS).round().astype(int)]
    primitive = dmp.learn([path])
    goal = path[-1] + [5.0, 3.0]
    question = {"data": data, "name": name, "path": path.T.tolist(), "goal": goal.tolist()}
    script = str(Path(FOLDER / "primitive.js"))
    done = subprocess.run(
        [str(NODE), "-e", _ASK, script], input=json.dumps(question), capture_output=True, text=True, check=True
    )
    answer = json.loads(done.stdout)
    np.testing.assert_allclose(answer["one"]["weights"], primitive.scaled_weights[0] / dmp.K, atol=1e-2)
    moved = primitive.rollout(goal=goal, n_samples=N_POINTS).positions[0]
    np.testing.assert_allclose(np.transpose(answer["moved"]), moved, atol=1e-2)
    np.testing.assert_allclose(answer["basis"], dmp.basis.design(np.linspace(0, 1, 5)), atol=1e-6)


def test_it_is_used_by_pointer_and_keyboard_from_a_file(tmp_path, browser, written):
    page_file = tmp_path / "page.html"
    picture = '<p class="primitive-picture">a picture</p>'
    page_file.write_text(f"<!doctype html><meta charset=utf-8><title>x</title>{picture}{written}", encoding="utf-8")
    page = browser.new_page(viewport={"width": 900, "height": 700})
    said = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(page_file.as_uri())
    assert not page.locator(".primitive-picture").is_visible()
    line = page.locator("path.path")
    before = line.get_attribute("d")
    page.locator(".goal").focus()
    page.keyboard.press("ArrowRight")
    assert "x 1.0, y 0.0" in page.locator(".goal").get_attribute("aria-valuetext")
    after_goal = line.get_attribute("d")
    page.locator(".grip").nth(3).focus()
    page.keyboard.press("PageUp")
    after_weight = line.get_attribute("d")
    bar, grip = page.locator(".bar").nth(5), page.locator(".grip").nth(5)
    to = grip.bounding_box()
    page.mouse.move(to["x"] + 5, to["y"] + 10)
    page.mouse.down()
    page.mouse.up()
    assert abs(bar.bounding_box()["y"] - to["y"] - 10) < 2  # the bar ends where the pointer is
    box = page.locator(".drawings svg").first.bounding_box()
    page.mouse.move(box["x"] + 40, box["y"] + 200)
    page.mouse.down()
    for k in range(40):
        page.mouse.move(box["x"] + 40 + 6 * k, box["y"] + 60 + 8 * (k % 4))
    page.mouse.up()
    after_drawing = line.get_attribute("d")
    ends = [float(page.locator(".grip").nth(0).get_attribute(f"aria-value{end}")) for end in ("min", "max")]
    weights = [float(one.get_attribute("aria-valuenow")) for one in page.locator(".grip").all()]
    assert all(ends[0] <= one <= ends[1] for one in weights)  # no bar leaves its row
    page.mouse.move(box["x"] + 40, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] - 300, box["y"] - 300, steps=20)
    page.mouse.up()
    star = page.locator(".goal").bounding_box()
    assert box["x"] < star["x"] + star["width"] / 2  # a goal that was left of the plane could not be dragged back
    assert box["y"] < star["y"] + star["height"] / 2
    page.get_by_role("button", name="as it was shown").click()
    assert len({before, after_goal, after_weight, after_drawing}) == 4
    assert line.get_attribute("d") == before
    page.close()
    off = browser.new_context(java_script_enabled=False).new_page()
    off.goto(page_file.as_uri())
    assert off.locator(".primitive-picture").is_visible()
    assert not off.locator(".primitive").is_visible()
    assert said == []


def test_the_view_grows_with_a_path_that_a_goal_far_out_leads_beyond_it(tmp_path, browser, written):
    page_file = tmp_path / "page.html"
    page_file.write_text(f"<!doctype html><meta charset=utf-8><title>x</title>{written}", encoding="utf-8")
    page = browser.new_page(viewport={"width": 900, "height": 700})
    page.goto(page_file.as_uri())
    plane, star = page.locator(".drawings svg").first, page.locator(".goal").bounding_box()
    box = plane.bounding_box()
    page.mouse.move(star["x"] + star["width"] / 2, star["y"] + star["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] - 5, box["y"] + 5, steps=10)
    path = page.locator("path.path").bounding_box()
    assert plane.bounding_box() == pytest.approx(box, abs=1)  # what comes into view takes no more room
    assert box["x"] < path["x"]
    assert path["x"] + path["width"] < box["x"] + box["width"]
    page.close()


@pytest.mark.parametrize(("scheme", "paper"), [("light", "rgb(255, 255, 255)"), ("dark", "rgb(23, 27, 31)")])
def test_a_letter_is_recognized_and_moved_within_another_page(tmp_path, browser, scheme, paper):
    """In the colors of its name whatever the system likes, from a file, and no request leaves it."""
    for file, text in pages_to_draw_in().items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    around = tmp_path / "index.html"
    frame = f'<iframe src="draw-{scheme}.html" style="width: 900px; height: 600px; margin: 90px"></iframe>'
    around.write_text(f"<!doctype html><meta charset=utf-8><title>x</title>{frame}", encoding="utf-8")
    page = browser.new_page(viewport={"width": 1200, "height": 800}, color_scheme="light")
    wrong, requests = [], []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(around.as_uri())
    inside = page.frames[1]
    assert inside.evaluate("getComputedStyle(document.querySelector('.stage')).backgroundColor") == paper
    box = inside.locator("#stage").bounding_box()
    corners = np.array([[-90.0, -90.0], [90.0, -90.0], [-90.0, 90.0], [90.0, 90.0]])
    path = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(corners)])
    path += [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    page.mouse.move(*path[0])
    page.mouse.down()
    for point in path:
        page.mouse.move(*point)
        page.wait_for_timeout(12)
    page.mouse.up()
    inside.locator("#verdict", has_text="Z").wait_for()
    inside.locator("#save").wait_for(state="hidden")
    assert not wrong
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requests)
    page.close()

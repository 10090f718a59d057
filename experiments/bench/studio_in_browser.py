"""The studio in headless Chromium: its first view, the answer while a movement is drawn, and a goal that is dragged."""

from __future__ import annotations

import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import kineme
from bench.browser import chromium
from bench.movements import SEED
from bench.rows import Row
from bench.studio import _TOKEN, MEDIAN, OF_EACH, P99, SYMBOLS, _filled, _running

FIRST_VIEW = 1000.0  # ms
FRAMES = 60.0  # of the screen, in a second
_NEARLY = 0.98  # of them: where the clock of the screen and ours differ
_PROBE = Path(__file__).with_suffix(".js")
_SECONDS = 3.0  # of a drag
_SIZE = {"width": 1440, "height": 900}

_OF_ANSWERS = (
    "each sample of the pointer, drawn at uneven 8 to 25 ms, from event.timeStamp (when Chromium got it) until the "
    "state that the server computed with it is in the elements of the page, and until the end of the frame that shows "
    "it; a screen of 60 Hz adds 0 to 16.7 ms to the former"
)
_OF_DRAGGING = (
    "headless, 60 Hz; the path of a move is drawn in its own frame if the canvas is painted between the event and the "
    "next frame"
)


def measure(quick: bool) -> list[Row]:
    if not find_spec("fastapi") or not find_spec("websockets"):
        print("studio_in_browser: the extra studio is not installed")
        return []
    symbols = 20 if quick else SYMBOLS
    with tempfile.TemporaryDirectory() as temporary, chromium("studio_in_browser") as browser:
        if browser is None:
            return []
        folder = Path(temporary) / "actions"
        drawn = _filled(folder, symbols)
        with _running(folder) as socket:
            address = socket.replace("ws://", "http://").replace("/api/live", f"/?token={_TOKEN}")
            rows = _rows(browser, address, drawn, quick)
    named = f"{symbols} symbols of {OF_EACH} movements"
    return [
        Row(f"{what}, {named}", unit, value, target=None if quick else target, details=details)
        for what, unit, value, target, details in rows
    ]


def _rows(browser: Any, address: str, drawn: kineme.Demonstrations, quick: bool) -> list[Any]:
    repeats = 2 if quick else 7
    _opened(browser, address).context.close()  # code is loaded
    views = []
    for _ in range(repeats):
        page = _opened(browser, address)
        views.append(page.evaluate("probe.shown"))
        page.context.close()
    page = _opened(browser, address)
    _draw(page, drawn[0])
    page.evaluate("probe.answers = []")
    for k in range(1, repeats):
        _draw(page, drawn[k])
    updated, shown = np.array(page.evaluate("probe.answers")).T
    dragged = _drag(page, 1.0 if quick else _SECONDS)
    page.context.close()
    apart = np.diff(dragged["frames"])
    answers = {"what": _OF_ANSWERS, "samples": len(shown), "seed": SEED}
    drags = {"what": _OF_DRAGGING, "frames": len(apart), "moves": dragged["moves"]}
    view = {"what": "median, from the navigation to the end of the frame that shows the library", "repeats": repeats}
    return [
        ("first view", "ms", float(np.median(views)), ("<=", FIRST_VIEW), view),
        ("pointer to answer in the page, median", "ms", float(np.median(updated)), ("<=", MEDIAN), answers),
        (
            "pointer to answer in the page, 99th percentile",
            "ms",
            float(np.percentile(updated, 99)),
            ("<=", P99),
            answers,
        ),
        ("pointer to the end of the frame with it, median", "ms", float(np.median(shown)), None, answers),
        (
            "pointer to the end of the frame with it, 99th percentile",
            "ms",
            float(np.percentile(shown, 99)),
            None,
            answers,
        ),
        ("frames while a goal is dragged", "Hz", 1e3 / float(apart.mean()), (">=", _NEARLY * FRAMES), drags),
        ("frames that are late by half of one or more", "%", 100 * float((apart > 1.5e3 / FRAMES).mean()), None, drags),
        (
            "moves of the goal with their path in the same frame",
            "%",
            100 * dragged["drawn"] / dragged["moves"],
            (">=", 99.0),
            drags,
        ),
        ("move of the goal to the end of its frame, median", "ms", float(np.median(dragged["dragged"])), None, drags),
    ]


def _opened(browser: Any, address: str) -> Any:
    """A page of the studio in a new context, once its first view is there."""
    page = browser.new_context(viewport=_SIZE).new_page()
    page.add_init_script(path=_PROBE)
    page.goto(address)
    _until(page, "probe.shown !== null && document.getElementById('status').dataset.state === 'here'")
    return page


def _until(page: Any, expression: str) -> None:
    deadline = time.monotonic() + 60
    while not page.evaluate(expression):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(20)


def _draw(page: Any, movement: kineme.Trajectory) -> None:
    """Draw a movement by the mouse, in its own time, at uneven moments."""
    box = page.locator("#draw-canvas").bounding_box()
    size = np.ptp(movement.positions, axis=0)
    scale = min(0.6 * box["width"] / size[0], 0.6 * box["height"] / size[1])
    away = (movement.positions - movement.positions.min(axis=0) - size / 2) * scale
    corner = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
    points = corner + away * [1, -1]
    gaps = np.random.default_rng(SEED).uniform(0.008, 0.025, size=2000)
    times = np.cumsum(gaps)
    times = times[times < min(float(np.ptp(movement.times)), 6.0)]
    at = np.column_stack([np.interp(times, movement.times - movement.times[0], x) for x in points.T])
    page.mouse.move(*points[0])
    page.mouse.down()
    begin = time.perf_counter()
    for due, (x, y) in zip(times, at, strict=True):
        time.sleep(max(0.0, begin + due - time.perf_counter()))
        page.mouse.move(x, y)
    page.mouse.up()
    _until(page, "!document.getElementById('why').hidden")  # shown with the answer to the whole movement


def _drag(page: Any, seconds: float) -> dict[str, Any]:
    """Drag the goal around in circles: what the probe saw."""
    page.evaluate("location.hash = 'move'")
    _until(page, "document.querySelectorAll('.handle').length === 2")
    page.wait_for_timeout(1500)  # the primitive is there, and the server has said what is to be said
    box = page.locator(".handle.goal").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate("probe.dragging(true)")
    begin = time.perf_counter()
    while (t := time.perf_counter() - begin) < seconds:
        page.mouse.move(x - 60 * np.sin(4 * t), y + 60 * (np.cos(4 * t) - 1))
    seen: dict[str, Any] = page.evaluate("(probe.dragging(false), probe)")
    page.mouse.up()
    return seen

"""Pages in a browser: what goes wrong in them, what they ask for, and waiting for what they show."""

from __future__ import annotations

import time

import pytest


def wait_until(page, expression, *arguments, seconds=300):
    """Playwright's own waiting evaluates texts in the page, which its policy forbids."""
    deadline = time.monotonic() + seconds
    while not page.evaluate(expression, *arguments):
        assert time.monotonic() < deadline, expression
        page.wait_for_timeout(20)


def stroke(page, points, times, lift=True):
    """Draw through points of the window with the mouse.

    The events say that they happened at `times` [s], however busy the machine is, and nothing waits for these to pass.
    """
    page.mouse.move(*points[0])
    mouse, now = page.context.new_cdp_session(page), time.time()

    def send(kind, point, when):
        event = {"type": kind, "x": float(point[0]), "y": float(point[1]), "timestamp": now + float(when - times[0])}
        mouse.send("Input.dispatchMouseEvent", {**event, "button": "left", "buttons": 1, "clickCount": 1})

    send("mousePressed", points[0], times[0])
    for point, when in zip(points[1:], times[1:], strict=True):
        send("mouseMoved", point, when)
    mouse.detach()
    if lift:
        page.mouse.up()


def broken_rules(page, **options):
    """Rules of accessibility that a page breaks, as axe says it."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    options = {"preload": False, "resultTypes": ["violations"]} | options
    return axe.Axe().run(page, options=options).response["violations"]


def violations(page, **options):
    """Rules that a page breaks, each with where it does."""
    return [(rule["id"], [node["html"][:120] for node in rule["nodes"]]) for rule in broken_rules(page, **options)]


def violations_in_both(page):
    """Rules that a page breaks by light or in the dark, where colors alone differ; it stays light."""
    page.emulate_media(color_scheme="dark")
    dark = violations(page, runOnly=["color-contrast"])
    page.emulate_media(color_scheme="light")
    return violations(page) + dark


class Pages:
    """Pages that go from test to test: a new one costs more than most tests do with it.

    Each has a window of its own, as a tab that is covered by another paints once a second. One that was left is used
    again where the same options are wanted, and the same kind.
    """

    def __init__(self, browser, errors=("error",), script=""):
        self.browser, self.errors, self.script = browser, errors, script
        self.windows, self.left, self.used, self.tolerated = [], [], [], {}
        self.wrong, self.requests = [], []

    def new(
        self,
        width=1024,
        height=640,
        tolerated=(),
        reduced_motion="no-preference",
        color_scheme="light",
        kind="",
        **options,
    ):
        """An empty page; messages of its console with one of the tolerated texts are no errors.

        Its window is no larger than most tests need, as larger ones take longer to paint.
        """
        key = (kind, *sorted(options.items()))
        at = next((k for k, (left, _) in enumerate(self.left) if left == key), None)
        page = self._opened(options) if at is None else self.left.pop(at)[1]
        self.used.append((key, page))
        self.tolerated[page] = tolerated
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(reduced_motion=reduced_motion, color_scheme=color_scheme)
        return page

    def _opened(self, options):
        window = self.browser.new_context(**options)
        window.set_default_timeout(300_000)  # [ms]: a busy machine is no fault
        window.add_init_script(self.script)
        self.windows.append(window)
        page = window.new_page()
        self._listen(page)
        return page

    def _listen(self, page):
        def hear(message):
            if message.type in self.errors and not any(text in message.text for text in self.tolerated[page]):
                self.wrong.append(message.text)

        page.on("console", hear)
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("dialog", lambda dialog: self.wrong.append(dialog.message))
        page.on("request", lambda request: self.requests.append(request.url))

    def give_back(self, page):
        """Leave a page to the next one who wants such a one."""
        key = next(key for key, used in self.used if used is page)
        self.used.remove((key, page))
        if not page.is_closed():
            page.mouse.up()
            page.mouse.move(0, 0)
            page.unroute_all(behavior="ignoreErrors")
            page.goto("about:blank")
            self.left.append((key, page))

    def leave(self, *allowed):
        """Leave the pages of a test: nothing went wrong, and nothing was asked for elsewhere. What was asked for."""
        for _, page in [*self.used]:
            self.give_back(page)
        wrong, requests = self.wrong, self.requests
        self.wrong, self.requests = [], []
        elsewhere = [url for url in requests if not url.startswith(allowed)]
        assert (wrong, elsewhere) == ([], []), (wrong, elsewhere)
        return requests

    def close(self):
        """Close them all."""
        for window in self.windows:
            window.close()

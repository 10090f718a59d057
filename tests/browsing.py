"""Pages in a browser: what goes wrong in them, what they ask for, and waiting for what they show."""

from __future__ import annotations

import time


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


class Pages:
    """Pages in contexts of their own."""

    def __init__(self, browser, errors=("error",)):
        self.browser, self.errors = browser, errors
        self.contexts, self.wrong, self.requests = [], [], []

    def new(self, width=1440, height=900, tolerated=(), **options):
        """An empty page; messages of its console with one of the tolerated texts are no errors."""
        self.contexts.append(self.browser.new_context(viewport={"width": width, "height": height}, **options))
        self.contexts[-1].set_default_timeout(300_000)  # [ms]: a busy machine is no fault
        page = self.contexts[-1].new_page()

        def hear(message):
            if message.type in self.errors and not any(text in message.text for text in tolerated):
                self.wrong.append(message.text)

        page.on("console", hear)
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("dialog", lambda dialog: self.wrong.append(dialog.message))
        page.on("request", lambda request: self.requests.append(request.url))
        return page

    def close(self, *allowed):
        """Close them all: nothing went wrong, and nothing was asked for at other addresses than those allowed."""
        for context in self.contexts:
            context.close()
        elsewhere = [url for url in self.requests if not url.startswith(allowed)]
        assert (self.wrong, elsewhere) == ([], []), (self.wrong, elsewhere)

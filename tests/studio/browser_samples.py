"""A browser at a studio: real letters drawn by the mouse, and what every page must keep to."""

from __future__ import annotations

import json
import time

import numpy as np

import kineme
from browsing import stroke, wait_until

LETTERS = ("GShape", "Sine", "Angle", "CShape")
SHOWN = 5  # demonstrations of each letter that the library gets; the others are drawn

#: Names that would do harm if they were read as markup, as code or as an address.
HOSTILE = (
    "<img src=x onerror=alert(1)>",
    '"><script>alert(1)</script>',
    "javascript:alert(1)",
    "\u202eevil",
    "x" * 190,
)


def letters(shape):
    """All demonstrations of a letter."""
    return list(kineme.load_lasa([shape]))


def make_letters(folder, shapes=LETTERS, shown=SHOWN):
    """A library of letters, some demonstrations of each."""
    with kineme.ActionLibrary(folder, create=True) as library:
        for shape in shapes:
            library.learn(letters(shape)[:shown], [shape] * min(shown, len(letters(shape))))
    return folder


def wait_for_text(page, selector, text, seconds=300):
    """Wait until an element has a text."""
    deadline = time.monotonic() + seconds
    while (now := page.inner_text(selector)) != text:
        assert time.monotonic() < deadline, (selector, now, text)
        page.wait_for_timeout(20)


#: Counts the questions to the server that have no answer yet; for `show`.
UNANSWERED = """{
  const ask = window.fetch;
  window.unanswered = 0;
  window.fetch = (...what) => {
    window.unanswered += 1;
    return ask(...what).finally(() => { window.unanswered -= 1; });
  };
}"""


#: Whether the page says what a whole movement is.
ANSWERED = "['Sure', 'Probably', 'Looks like', 'New'].includes(document.getElementById('verdict-kind').textContent)"

#: Half a second of a video that the browser itself makes, as text.
FILM = """async () => {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [64, 48];
  const context = canvas.getContext("2d");
  const recorder = new MediaRecorder(canvas.captureStream(20), { mimeType: "video/webm;codecs=vp8" });
  const parts = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  recorder.start();
  for (let k = 0; k < 30; k += 1) {
    context.fillStyle = `hsl(${12 * k} 80% 50%)`;
    context.fillRect(0, 0, 64, 48);
    await new Promise((done) => setTimeout(done, 50));
  }
  recorder.stop();
  await new Promise((done) => { recorder.onstop = done; });
  const bytes = new Uint8Array(await new Blob(parts).arrayBuffer());
  return btoa([...bytes].map((byte) => String.fromCharCode(byte)).join(""));
}"""

#: A cell of a span in the table of a recording.
ROW = "#spans tbody tr:nth-child({}) {}"


def show(page, view):
    """Show a view, with what it asks the server for."""
    page.evaluate("view => { location.hash = view; }", view)
    wait_until(page, "view => !document.getElementById(`view-${view}`).hidden", view)
    settle(page)


def settle(page):
    """Wait until the server has answered everything and the page has painted it."""
    for _ in range(2):  # answers may ask for more
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        wait_until(page, "window.unanswered === 0")


def draw(page, movement, seconds=1.6, n=25, share=1.0, on="#draw-canvas"):
    """Draw a movement by the mouse, all of it in `seconds`; with a share, begin it and hold the button."""
    box = page.locator(on).bounding_box()
    size = np.ptp(movement.positions, axis=0)
    scale = min(0.5 * box["width"] / size[0], 0.6 * box["height"] / size[1])
    away = (movement.positions - movement.positions.min(axis=0) - size / 2) * [scale, -scale]
    points = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]) + away
    picked = np.linspace(0, len(points) - 1, n).astype(int)[: max(round(share * n), 2)]
    times = (movement.times - movement.times[0]) / np.ptp(movement.times) * seconds
    stroke(page, points[picked], times[picked], lift=share == 1.0)


def center(page, selector):
    """The middle of an element on the screen."""
    box = page.locator(selector).first.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


class Hand:
    """A program that sends movements to a studio."""

    def __init__(self, running, name):
        from websockets.sync.client import connect

        address = running.address.replace("http", "ws") + "/api/live"
        self.connection = connect(address, additional_headers={"Authorization": f"Bearer {running.token}"})
        self.name = name

    def __enter__(self):
        self.socket = self.connection.__enter__()
        self._tell({"name": self.name})
        return self

    def __exit__(self, *error):
        self.connection.__exit__(*error)

    def _tell(self, message):
        self.socket.send(json.dumps(message))

    def send(self, times, positions):
        """Samples of a movement."""
        self._tell({"samples": np.column_stack((times, positions)).tolist()})

    def finish(self):
        """It is over."""
        self._tell({"finish": True})


#: What is painted in the drawing area, as a number.
PIXELS = """() => {
  const canvas = document.getElementById("draw-canvas");
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return pixels.reduce((sum, value, k) => (sum * 31 + value * (k % 9973)) % 2147483647, 7);
}"""

#: Drop a file with a name and a text on the page, wherever it is.
DROP = """([name, text]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([text], name));
  for (const kind of ["dragover", "drop"]) {
    const event = new DragEvent(kind, { dataTransfer, bubbles: true, cancelable: true });
    if (document.body.dispatchEvent(event)) throw new Error("the browser would open the file");
  }
}"""

#: How many pixels of the stage of Move are of the drawn path, around a point of the screen: its color is the token's.
INKED = """([x, y, r]) => {
  const canvas = document.getElementById("move-canvas");
  const box = canvas.getBoundingClientRect();
  const sharp = canvas.width / box.width;
  const corner = [(x - box.left - r) * sharp, (y - box.top - r) * sharp];
  const pixels = canvas.getContext("2d").getImageData(...corner, 2 * r * sharp, 2 * r * sharp).data;
  const probe = document.createElement("canvas").getContext("2d");
  probe.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--ink");
  probe.fillRect(0, 0, 1, 1);
  const ink = probe.getImageData(0, 0, 1, 1).data;
  const off = (i) => [0, 1, 2].reduce((sum, k) => sum + Math.abs(pixels[i + k] - ink[k]), 0);
  let inked = 0;
  for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3] > 200 && off(i) < 60) inked += 1;
  return inked;
}"""

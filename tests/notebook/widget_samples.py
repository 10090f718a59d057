"""A widget's front end in a page, with a model that does what anywidget documents: get, set, on, off, save_changes."""

from __future__ import annotations

import numpy as np

import kineme
from browsing import stroke, wait_until

_RENDER = """async ([state]) => {
  const heard = {};
  const tell = (name) => (heard[`change:${name}`] ?? []).forEach((act) => act());
  window.model = {
    get: (name) => state[name],
    set: (name, value) => { state[name] = value; tell(name); },
    on: (event, act) => (heard[event] ??= []).push(act),
    off: (event, act) => { heard[event] = heard[event].filter((other) => other !== act); },
    save_changes: () => { window.saved = JSON.parse(JSON.stringify(state)); },
  };
  const url = URL.createObjectURL(new Blob([state._esm], { type: "text/javascript" }));
  window.leave = (await import(url)).default.render({ model, el: document.getElementById("cell") });
}"""


def demonstrations():
    """Three movements of each of three shapes."""
    demos = kineme.load_lasa(["CShape", "GShape", "Sine"])
    return demos[np.arange(len(demos)) % 7 < 3]


class Cell:
    """A widget that is shown in a page: what it saves there is set in Python."""

    def __init__(self, page, widget, dark=False):
        self.page, self.widget = page, widget
        paper, ink = ("#111", "#ddd") if dark else ("#fff", "#222")
        page.set_content(f"<!doctype html><body style='background:{paper};color:{ink}'><div id=cell></div>")
        page.evaluate(_RENDER, [widget.get_state(["_esm", "_page", "_title", "drawn", "moved"])])
        wait_until(page, "document.querySelector('iframe').height !== '400'")
        self.frame = page.frames[1]

    def draw(self, shape="GShape", index=5):
        """Draw a recorded letter, and wait for it."""
        x = kineme.load_lasa([shape])[index].positions[::16]
        x = (x - (x.min(axis=0) + x.max(axis=0)) / 2) / np.ptp(x, axis=0).max()
        box = self.frame.locator("#stage").bounding_box()
        size = 0.6 * min(box["width"], box["height"])
        points = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]) + x * [size, -size]
        before = self.page.evaluate("model.get('drawn').length")
        stroke(self.page, points, np.linspace(0, 1, len(points)))
        wait_until(self.page, f"model.get('drawn').length === {before + 1}")
        self.take()

    def take(self):
        """What the front end saved, as the state of the widget."""
        saved = self.page.evaluate("window.saved")
        self.widget.set_state({name: saved[name] for name in ("drawn", "moved")})

"""The page without a server, in headless Chromium: an answer, an update while drawing, a dragged goal, and its size.

And what the page computes with, of a body: an answer, an update, and the size of a movement.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import kineme
from bench.browser import chromium
from bench.movements import SEED, even_movements
from bench.rows import Row
from bench.space import lifted
from kineme.movements.preparation.perturbations import Perturbation
from kineme.studio import javascript
from kineme.studio.page.write_page import bundled, write_page
from kineme.studio.snapshot import snapshot_of_recognizer

_ASKED = 10
_PERTURBATION = Perturbation(shift=1.0, scale=0.3, rotation=np.radians(20), warp=0.2, noise=0.01)

#: Milliseconds of many answers, updates with half of a movement, and rollouts to another goal.
_SCRIPT = """({ movements, repeats, snapshot }) => {
  const runtime = snapshot ? module0.open(snapshot) : window.kineme.runtime;
  const timed = (work) => movements.flatMap((one) => Array.from({ length: repeats }, () => {
    const begin = performance.now();
    work(one);
    return performance.now() - begin;
  })).slice(repeats);
  const primitive = runtime.primitive(runtime.classes[0]);
  const half = (values) => values.slice(0, values.length / 2);
  const follow = runtime.follow();
  return {
    answer: timed((one) => runtime.recognize(one.times, one.positions)),
    update: timed((one) => follow(half(one.times), half(one.positions))),
    drag: timed((one) => runtime.rollout(primitive, { goal: one.positions[0] })),
  };
}"""


def measure(quick: bool) -> list[Row]:
    rows = []
    with chromium("page") as browser, tempfile.TemporaryDirectory() as folder:
        if browser is None:
            return []
        for n_dims, each in ((2, 1),) if quick else ((2, 1), (2, 3), (3, 1)):
            rows += _of_one(browser, Path(folder) / f"{n_dims}-{each}", n_dims, each, 2 if quick else 5)
        rows += _of_body(browser, 2, 2 if quick else 5)
        return rows if quick else rows + _of_body(browser, 3, 5)


def _of_body(browser: Any, n_dims: int, repeats: int) -> list[Row]:
    """Movements of 15 points, 20 of each of 20 kinds; 20 others are asked about."""
    arrays = even_movements(20, 150, 15 * n_dims)
    kinds = kineme.Demonstrations.from_arrays(arrays, [f"kind {c:02d}" for c in range(20)])
    shown = [Perturbation(warp=0.2, noise=0.01).apply(kinds, SEED + k) for k in range(20)]
    held = [one.positions for several in shown for one in several]
    recognizer = kineme.Recognizer(classifier="nearest-each", points=15).fit(held, list(kinds.labels) * len(shown))
    snapshot = snapshot_of_recognizer(recognizer).to_json()
    asked = Perturbation(warp=0.2, noise=0.01).apply(kinds, SEED + len(shown))
    movements = [{"times": one.times.tolist(), "positions": one.positions.tolist()} for one in asked]
    page = browser.new_page()
    page.add_script_tag(content=bundled(Path(javascript.__file__).with_name("runtime.js")))
    took = page.evaluate(_SCRIPT, {"movements": movements, "repeats": repeats, "snapshot": snapshot})
    page.close()
    named = f"400 movements of 15 points in {'the plane' if n_dims == 2 else 'space'}"
    return [
        Row(f"an answer, {named}", "ms", float(np.median(took["answer"])), details={"repeats": repeats, "seed": SEED}),
        Row(f"an update, {named}", "ms", float(np.median(took["update"]))),
        Row(f"a snapshot, {named}", "MB", len(snapshot) / 1e6),
    ]


def _of_one(browser: Any, folder: Path, n_dims: int, each: int, repeats: int) -> list[Row]:
    """A library of 100 symbols with as many movements of each."""
    shapes = kineme.Demonstrations.from_arrays(even_movements(100, 150), [f"symbol {c:02d}" for c in range(100)])
    shapes = shapes if n_dims == 2 else lifted(shapes)
    labels = np.tile(np.asarray(shapes.labels), each)
    copies = [one for k in range(each) for one in (shapes if k == 0 else _PERTURBATION.apply(shapes, SEED + k))]
    with kineme.ActionLibrary(folder, create=True) as library:
        library.learn([kineme.Trajectory(copy.times, copy.positions) for copy in copies], labels.tolist())
        write_page(folder / "page.html", library)
    asked = _PERTURBATION.apply(shapes[:_ASKED], SEED + 9)
    movements = [{"times": one.times.tolist(), "positions": one.positions.tolist()} for one in asked]
    page = browser.new_page()
    page.goto((folder / "page.html").as_uri())
    took = page.evaluate(_SCRIPT, {"movements": movements, "repeats": repeats})
    page.close()
    named = f"100 symbols, {each} of each, in {'the plane' if n_dims == 2 else 'space'}"
    details = {"asked": _ASKED, "repeats": repeats, "perturbation": repr(_PERTURBATION), "seed": SEED}
    size = (folder / "page.html").stat().st_size / 1e6
    return [
        Row(f"an answer, {named}", "ms", float(np.median(took["answer"])), target=("<=", 5.0), details=details),
        Row(f"an update while drawing, {named}", "ms", float(np.median(took["update"])), target=("<=", 16.0)),
        Row(f"a dragged goal, {named}", "ms", float(np.median(took["drag"])), target=("<=", 1.0)),
        Row(f"the page, {named}", "MB", size, target=("<=", 2.0)),
    ]

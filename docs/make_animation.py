"""Draw the moving picture of the landing page and the README: shown once, recognized under way, moved to other goals.

``make figures`` runs it; it writes ``images/kineme.gif``. All in it is computed: the bars are what a live stream
answers, the paths are rollouts.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import kineme
from kineme.movements.preparation.perturbations import Perturbation
from kineme.output.figures import BLUE, GRAY, GREEN, ORANGE

TARGET = Path(__file__).parent / "images" / "kineme.gif"
SHAPES = {"GShape": "G", "JShape": "J", "NShape": "N", "RShape": "R", "WShape": "W", "heee": "heee"}
SHOWN = "GShape"
STEPS, HELD, COLORS, MILLISECONDS = 24, 6, 24, 80
TITLES = ("show it once", "recognize it", "move again, to any goal")


def frames() -> list[Image.Image]:
    """The picture, frame by frame: each third is drawn in turn, and stays."""
    demos = kineme.load_lasa(list(SHAPES))
    shown = demos[::7]
    asked = Perturbation(shift=1.0, scale=0.3, rotation=np.radians(15), warp=0.2, noise=0.003).apply(demos[3:4], 4)[0]
    one = list(SHAPES).index(SHOWN)
    bars = _answers(kineme.Recognizer().fit(shown), asked, shown.labels)
    goals, paths = _moved(shown[one : one + 1])
    drawn = []
    for k in range(3 * (STEPS + HELD)):
        part, step = divmod(k, STEPS + HELD)
        at = [STEPS if part > n else 0 if part < n else min(step + 1, STEPS) for n in range(3)]
        drawn.append(_frame(at, shown[one].positions, asked.positions, bars, (goals, paths)))
    return drawn


def _answers(recognizer: Any, asked: Any, labels: Any) -> np.ndarray:
    """Confidence in each label after each step of a live stream, (STEPS + 1, labels)."""
    live, ends = recognizer.stream(), _ends(len(asked))
    said = np.zeros((STEPS + 1, len(labels)))
    for k, (t, x) in enumerate(zip(asked.times, asked.positions, strict=True), start=1):
        state = live.update(t, x)
        for step in np.flatnonzero(ends == k):
            shares = {guess.label: guess.confidence for guess in state.ranked}
            said[step] = [shares.get(label, 0.0) for label in labels]
    return said


def _moved(demos: Any) -> tuple[np.ndarray, np.ndarray]:
    """Goals on a loop that begins and ends at the demonstrated one, and the movement to each, as one batch."""
    primitives = kineme.DMP().learn(demos)
    extent = np.ptp(demos[0].positions, axis=0).max()
    u = np.linspace(0, 2 * np.pi, STEPS + 1)
    loop = 0.45 * extent * np.column_stack((1 - np.cos(u), 0.9 * np.sin(u)))
    goals = primitives.goals[0] + loop
    return goals, np.array([primitives.rollout(goal=goal, n_samples=80).positions[0] for goal in goals])


def _ends(n: int) -> np.ndarray:
    return np.linspace(0, n, STEPS + 1).astype(int)


def _frame(at: list[int], shown: np.ndarray, asked: np.ndarray, bars: np.ndarray, moved: Any) -> Image.Image:
    figure = Figure(figsize=(7.2, 2.3), dpi=100)
    for k, title in enumerate(TITLES):
        figure.text((k + 0.5) / 3, 0.91, title, ha="center", fontsize=11, color="black" if at[k] else "lightgray")
    _path(figure.add_axes((0.03, 0.06, 0.27, 0.78)), [(shown[: _ends(len(shown))[at[0]]], BLUE, 2.5)], shown)
    _path(figure.add_axes((0.35, 0.06, 0.19, 0.78)), [(asked[: _ends(len(asked))[at[1]]], ORANGE, 2.5)], asked)
    _bars(figure.add_axes((0.59, 0.14, 0.09, 0.62)), bars[at[1]])
    goals, paths = moved
    axes = figure.add_axes((0.72, 0.06, 0.27, 0.78))
    _path(axes, [(shown, GRAY, 1.0), (paths[at[2]], GREEN, 2.5)] if at[2] else [], np.concatenate(paths))
    if at[2]:
        axes.plot(*goals[at[2]], "*", color="black", markersize=10)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _path(axes: Any, lines: list[tuple[np.ndarray, str, float]], whole: np.ndarray) -> None:
    """Lines in a frame that fits the whole, and a pen at the end of the last."""
    low, high = whole.min(axis=0), whole.max(axis=0)
    margin = 0.08 * (high - low).max()
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin), aspect="equal")
    axes.axis("off")
    for line, color, width in lines:
        axes.plot(*line.T, color=color, linewidth=width, solid_capstyle="round")
        if len(line):
            axes.plot(*line[-1], "o", color=color, markersize=2 * width)


def _bars(axes: Any, shares: np.ndarray) -> None:
    rows = np.arange(len(shares))
    best = int(shares.argmax()) if shares.max() > 0 else -1
    axes.barh(rows, shares, color=[ORANGE if k == best else "lightgray" for k in rows], height=0.7)
    axes.set(xlim=(0, 1), ylim=(len(shares) - 0.4, -0.6), xticks=[], yticks=rows)
    axes.set_yticklabels(SHAPES.values(), fontsize=9)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)


def write(drawn: list[Image.Image]) -> Path:
    """All frames with the colors of one, so that what stands still costs nothing."""
    palette = drawn[-1].quantize(COLORS)
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in drawn]
    times = [MILLISECONDS] * (len(drawn) - 1) + [20 * MILLISECONDS]
    first.save(TARGET, save_all=True, append_images=others, duration=times, loop=0, optimize=True)
    return TARGET


if __name__ == "__main__":
    written = write(frames())
    print(f"{written}: {written.stat().st_size / 1000:.0f} kB")

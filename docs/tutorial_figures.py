"""Pictures of the tutorials, drawn from what their pages leave behind when they are walked through."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from walk_through import walk

import kineme
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE
from kineme.reporting.figures import new_figure

_TUTORIALS = Path(__file__).parent / "tutorials"
_COLORS = {"Sine": BLUE, "GShape": ORANGE, "WShape": GREEN}


def gestures() -> Figure:
    """Takes as a tracker wrote them, and a session with the gestures that were found in it."""
    names: dict[str, Any] = {}
    figure = new_figure(9.6, 5.0)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.0, 1.15))
    with TemporaryDirectory() as place:
        for _ in walk(_TUTORIALS / "gestures-live.md", Path(place), names):
            pass
        for axes, path in zip(top.subplots(1, 5), sorted(Path(place, "today").glob("*.csv")), strict=True):
            _draw_take(axes, path)
    samples, axes = names["samples"], bottom.subplots()
    for column, (name, line) in enumerate((("x", "-"), ("y", ":")), 1):
        axes.plot(samples[:, 0], samples[:, column], line, color="black", linewidth=1.2, label=name)
    for began, ended, answer in names["found"]:
        axes.axvspan(began, ended, color=_COLORS.get(answer.label, GRAY), alpha=0.25, linewidth=0)
        if answer.label is not None or ended - began > 2.0:
            axes.text(
                (began + ended) / 2, 0.93, answer.label or "unknown", transform=axes.get_xaxis_transform(), ha="center"
            )
    axes.set(xlabel="time [s]", ylabel="position [pixels]", xlim=(0, samples[-1, 0]), ylim=(None, 950))
    axes.legend(loc="upper left", fontsize="small")
    return figure


def _draw_take(axes: Axes, path: Path) -> None:
    """One take, a dot for each frame."""
    _, x, y = np.loadtxt(path, delimiter=",", skiprows=1).T
    axes.plot(x, y, ".", color=_COLORS.get(path.stem, GRAY), markersize=3)
    axes.set(title="Worm, never shown" if path.stem == "Worm" else path.stem, aspect="equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.axis("off")


def place() -> Figure:
    """The hand of an arm as it was guided and to a new place, and the joints over time."""
    names: dict[str, Any] = {}
    with TemporaryDirectory() as folder:
        for _ in walk(_TUTORIALS / "from-bags-to-an-arm.md", Path(folder), names):
            pass
        bags = kineme.read_recordings(f"{folder}/recordings", topic="/joint_states")
    rows, hand = names["rows"], names["hand"]
    times, joints, opened = rows[:, 0], rows[:, 1:8], rows[:, 8] > 0.5
    guided = [_of_the_hand(hand, demonstration.positions) for demonstration in bags.demonstrations]
    moved = _of_the_hand(hand, joints)
    begins = int(np.argmin(np.linalg.norm(joints - bags.demonstrations[0].positions[0], axis=1)))
    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    for path, label in zip(guided, ("recorded", None, None), strict=True):
        left.plot(path[:, 1], path[:, 2], color=GRAY, linewidth=3, alpha=0.5, label=label)
    left.plot(moved[: begins + 1, 1], moved[: begins + 1, 2], ":", color=BLUE, label="approach")
    left.plot(moved[begins:, 1], moved[begins:, 2], color=BLUE, label="to the new place")
    left.plot(*moved[-1, 1:], "*", color="black", markersize=9)
    left.set(xlabel="y of the hand [m]", ylabel="z of the hand [m]", aspect="equal")
    left.legend(fontsize="small")
    right.plot(times, joints)
    right.axvspan(0, times[begins], color=GRAY, alpha=0.2, linewidth=0)
    right.axvspan(times[opened][0], times[-1], color=GREEN, alpha=0.25, linewidth=0)
    for at, what in ((times[begins] / 2, "approach"), (times[opened].mean(), "gripper\nopen")):
        right.text(at, 0.98, what, transform=right.get_xaxis_transform(), ha="center", va="top", fontsize="small")
    right.set(xlabel="time [s]", ylabel="joints [rad]", xlim=(0, times[-1]), ylim=(None, 3.6))
    return figure


def _of_the_hand(hand: Any, joints: np.ndarray) -> np.ndarray:
    """Positions of the tip (T, 3) along joint positions (T, n)."""
    path = np.empty((len(joints), 3))
    for t, q in enumerate(joints):
        hand.reset(q)
        path[t] = hand.tip_position
    return path

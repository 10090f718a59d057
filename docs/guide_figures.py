"""Pictures of the guide, each drawn by kineme from recordings that come with it or from what was measured."""

from __future__ import annotations

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from morph_figure import draw_morph
from walk_through import walk

import kineme
from kineme.control import ObstacleAvoidance
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE
from kineme.reporting.figures import new_figure
from result_tables.measured import DOCS, rows

_FEWEST = 20  # answers that a point of the reliability diagram stands for
COLORS = {"original": BLUE, "bio-inspired": ORANGE, "amplitude-scaled": GREEN}
LINES = {"original": "-", "bio-inspired": "--", "amplitude-scaled": ":"}


def three_issues() -> Figure:
    """Section 2.1's issues: x0 = g, g close to x0, g across x0; on the y dimension of a handwritten shape."""
    demo = kineme.load_lasa(["GShape"])[3:4]
    near = kineme.Demonstrations.from_arrays([_ending_near_its_start(demo[0].positions)], times=[demo[0].times])
    cases = (
        ("g = x0: no movement", demo, lambda start, goal: start),
        ("g close to x0: 1 mm shown, 10 mm asked", near, lambda start, goal: start + 10 * (goal - start)),
        ("g across x0: mirrored", demo, lambda start, goal: 2 * start - goal),
    )
    figure = new_figure(9.6, 2.9)
    for axes, (title, demos, wish) in zip(figure.subplots(1, 3), cases, strict=True):
        u = np.linspace(0, 1, len(demos[0]))
        axes.plot(u, demos[0].positions[:, 1], color=GRAY, linewidth=4, alpha=0.4, label="demonstrated")
        for formulation, color in COLORS.items():
            primitives = _learn(formulation, demos)
            goal = wish(primitives.starts, primitives.goals)
            path = primitives.rollout(goal=goal, velocity=np.zeros(2)).positions[0, :, 1]
            axes.plot(np.linspace(0, 1, len(path)), path, color=color, linestyle=LINES[formulation], label=formulation)
            axes.plot(1, goal[0, 1], "*", color="black", markersize=8, clip_on=False)
        axes.set(title=title, xlabel="normalized time t / τ", ylabel="y [mm]", xlim=(0, 1))
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _ending_near_its_start(x: np.ndarray) -> np.ndarray:
    """The same shape, bent so that it ends 1 mm from its start in each dimension."""
    u = np.linspace(0, 1, len(x))[:, None]
    return x - u**2 * (x[-1] - x[0] - 1.0)


def _learn(formulation: str, demos: kineme.Demonstrations) -> kineme.dmp.Primitives:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kineme.errors.DegenerateMovementWarning)
        return kineme.DMP(formulation).learn(demos)


def many_goals() -> Figure:
    """One handwritten shape, moved to new goals in one product."""
    demo = kineme.load_lasa(["GShape"])[:1]
    figure = new_figure(9.6, 3.2)
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    for axes, formulation in zip(figure.subplots(1, 3, sharex=True, sharey=True), COLORS, strict=True):
        primitives = _learn(formulation, demo)
        goals = primitives.goals + 25 * np.column_stack((np.cos(angles), np.sin(angles)))
        for path in primitives.rollout(goal=goals).positions:
            axes.plot(*path.T, color=COLORS[formulation], linewidth=0.9, alpha=0.8)
        axes.plot(*goals.T, "*", color="black", markersize=6)
        axes.plot(*demo[0].positions.T, color=GRAY, linewidth=4, alpha=0.5)
        axes.set(title=formulation, xlabel="x [mm]", aspect="equal", xlim=(-95, 65), ylim=(-85, 50))
    figure.axes[0].set_ylabel("y [mm]")
    return figure


def around_obstacles() -> Figure:
    """A handwritten G and its replay around two obstacles."""
    primitive = kineme.DMP().learn(kineme.load_lasa(["GShape"])[3:4])
    obstacles = np.array([[-27.0, 0.0], [10.0, -21.0]])
    figure = new_figure(4.2, 3.8)
    axes = figure.subplots()
    axes.plot(*primitive.rollout().positions[0].T, color=GRAY, linewidth=4, alpha=0.5, label="demonstrated")
    for gamma, color, line in zip((500, 1500, 4500), (BLUE, ORANGE, GREEN), ("-", "--", ":"), strict=True):
        control = primitive.controller(dt=0.005, avoidance=ObstacleAvoidance(gamma=gamma, reach=10.0))
        steps = round(float(primitive.durations[0]) / 0.005)
        path = np.array([control.step(obstacles=obstacles).position for _ in range(steps)])
        axes.plot(*path.T, color=color, linestyle=line, label=f"γ = {gamma}")
    axes.plot(*obstacles.T, "X", color="black", markersize=9, linestyle="none", label="obstacle")
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def styles() -> Figure:
    """Movements between two styles that were recorded under one name."""
    return draw_morph(kineme.DMP().learn(kineme.load_lasa(["Multi_Models_3"])))


def adapting() -> Figure:
    """An average and what it becomes when it is conditioned; movements between tasks; an improved movement."""
    figure = new_figure(9.6, 3.1)
    left, middle, right = figure.subplots(1, 3)
    mean = kineme.styles.average(_learn("bio-inspired", kineme.load_lasa(["GShape"])))
    path, spread = mean.primitive.rollout(n_samples=101).positions[0], mean.deviation(101)
    point = path[40, 1] - 1.5 * spread[40, 1]
    conditioned = mean.condition(t=0.4, position=[np.nan, point], std=0.2)
    u = np.linspace(0, 1, 101)
    for one, color, label in ((mean, GRAY, "average"), (conditioned, ORANGE, "conditioned")):
        y, deviation = one.primitive.rollout(n_samples=101).positions[0, :, 1], one.deviation(101)[:, 1]
        left.fill_between(u, y - 2 * deviation, y + 2 * deviation, color=color, alpha=0.35, linewidth=0)
        left.plot(u, y, color=color, label=label)
    left.plot(0.4, point, "o", color="black", markersize=4)
    left.set(title="(a) conditioned on a position", xlabel="share of the duration", ylabel="y [mm]", xlim=(0, 1))

    heights = np.array([0.1, 0.2, 0.35, 0.5])
    model = kineme.dmp.Contextual().fit([lifted(height) for height in heights], parameters=heights)
    between = model.primitive(np.linspace(0.1, 0.5, 9)).rollout().positions
    middle.plot(*between.transpose(2, 1, 0), color=ORANGE, linewidth=1)
    middle.plot(
        *np.stack([lifted(height) for height in heights]).transpose(2, 1, 0), color=GRAY, linewidth=4, alpha=0.4
    )
    middle.set(title="(b) between demonstrated heights", xlabel="x [m]", ylabel="y [m]")

    primitive = kineme.DMP().learn([lifted(0.1)])
    around = kineme.improve(primitive, wall)
    for one, color, label in ((primitive, GRAY, "demonstrated"), (around.primitive, ORANGE, "improved")):
        right.plot(*one.rollout().positions[0].T, color=color, label=label)
    right.add_patch(Rectangle((0.45, 0.0), 0.1, 0.3, color=BLUE, alpha=0.4, linewidth=0))
    right.set(title="(c) around what it should not touch", xlabel="x [m]", ylabel="y [m]", ylim=(-0.02, 0.5))
    for axes in (left, right):
        axes.legend(frameon=False, fontsize=8, loc="upper right")
    return figure


def lifted(height: float) -> np.ndarray:
    """A movement over something of that height [m]."""
    u = np.linspace(0, 1, 100)
    return np.column_stack((u, height * np.sin(np.pi * u) ** 2))


def wall(rollout: kineme.dmp.Rollout) -> np.ndarray:
    """Depth inside of a wall, and a little for acceleration."""
    x, y = rollout.positions[:, :, 0], rollout.positions[:, :, 1]
    inside = np.where(np.abs(x - 0.5) < 0.08, np.maximum(0.33 - y, 0.0), 0.0)
    return np.asarray(inside.max(axis=1) + 1e-5 * np.mean(rollout.accelerations**2, axis=(1, 2)))


def reliability() -> Figure:
    """Confidence against the share of right answers, as `python -m bench --only open_set` measured it."""
    shown = {
        "gestures3d, same person": ("20 gestures, same person", BLUE, "-"),
        "gestures3d, other people": ("20 gestures, other people", ORANGE, "-"),
        "LASA, severely": ("LASA, perturbed severely", GREEN, "--"),
    }
    figure = new_figure(4.6, 3.8)
    axes = figure.subplots()
    axes.plot((0, 1), (0, 1), color=GRAY, linewidth=4, alpha=0.4)
    for row in rows("open_set"):
        name, _, what = row["what"].partition(": ")
        if name in shown and what.startswith("expected calibration error"):
            title, color, line = shown[name]
            enough = np.array(row["details"]["number"]) >= _FEWEST
            said, right = (np.array(row["details"][key])[enough] for key in ("said", "right"))
            error = f"{title} ({row['ours']:.3f})"
            axes.plot(said, right, line, color=color, marker="o", markersize=4, label=error)
    axes.set(xlabel="confidence", ylabel="share of right answers", xlim=(0, 1), ylim=(0, 1), aspect="equal")
    axes.legend(title="expected calibration error", fontsize="small", loc="lower right")
    return figure


def via_points() -> Figure:
    """A shape through points of its own, and the average of six demonstrations through two points of the seventh."""
    demos = kineme.load_lasa(["GShape", "Multi_Models_3"])
    primitives = kineme.DMP().learn(demos)
    g, rest, last = primitives[0], kineme.styles.average(primitives[8:]), primitives[7]
    figure = new_figure(9.6, 3.4)
    left, right = figure.subplots(1, 2)
    points = np.array([[-25.0, -5.0], [8.0, -10.0]])
    via = list(zip((0.4, 0.7), points, strict=True))
    left.plot(*g.rollout().positions[0].T, color=GRAY, linewidth=4, alpha=0.5, label="as demonstrated")
    left.plot(*g.rollout(via=via).positions[0].T, color=BLUE, label="through two points")
    on = g.rollout(via=via, end_velocity=[-25.0, 0.0])
    left.plot(*on.positions[0].T, color=ORANGE, linestyle="--", label="and on at the goal")
    left.plot(*points.T, "o", color="black", markersize=6)
    shown = last.rollout(n_samples=301).positions[0]
    asked = {"start": last.starts, "goal": last.goals, "velocity": last.velocities}
    guided = rest.rollout(**asked, via=[(1 / 3, shown[100]), (2 / 3, shown[200])])
    right.plot(*shown.T, color=GRAY, linewidth=4, alpha=0.5, label="seventh demonstration")
    right.plot(*rest.rollout(**asked).positions[0].T, color=GREEN, linestyle=":", label="average of six others")
    right.plot(*guided.positions[0].T, color=BLUE, label="through two points of the seventh")
    right.plot(*shown[[100, 200]].T, "o", color="black", markersize=6)
    for axes in (left, right):
        axes.set(xlabel="x [mm]", aspect="equal")
        axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.0))
    left.set_ylabel("y [mm]")
    return figure


def arm() -> Figure:
    """A handwritten shape as a Panda executes it."""
    from kineme import robots
    from kineme.robots.view.figure import draw_robot_movement

    shape = kineme.load_lasa(["GShape"])[:1][0]
    positions = 0.004 * (shape.positions - shape.positions.mean(axis=0))
    tip = [0.5, 0.0, 0.45]
    written = np.column_stack((np.full(len(positions), tip[0]), positions[:, 0] + tip[1], positions[:, 1] + tip[2]))
    primitive = kineme.DMP().learn([kineme.Trajectory(times=0.25 * shape.times, positions=written)])
    return draw_robot_movement(robots.move(primitive.rollout(rate=100), robots.load("panda"), timing="slowed"))


def simulated_panda() -> Figure:
    """The simulation of docs/guide/robots-live.md: the path of the tip, and how far it is off."""
    names: dict[str, Any] = {}
    with TemporaryDirectory() as place:
        for _ in walk(DOCS / "guide" / "robots-live.md", Path(place), names):
            pass
    goals, wanted, tips = (names[name] for name in ("goals", "wanted", "tips"))
    figure = new_figure(9.6, 3.6)
    left, right = figure.subplots(1, 2)
    left.plot(goals[:, 1], goals[:, 2], color=GRAY, linewidth=5, alpha=0.4, label="goal")
    left.plot(tips[:, 1], tips[:, 2], color=BLUE, label="tip in MuJoCo")
    left.plot(*tips[0, 1:], "o", color=BLUE, markersize=5)
    left.plot(*goals[0, 1:], "*", color="black", markersize=9)
    left.set(xlabel="y [m]", ylabel="z [m]", aspect="equal")
    left.legend(fontsize="small", loc="lower right")
    times = 1e-3 * np.arange(len(tips))
    for reference, color, label in ((goals, GRAY, "from the goal"), (wanted, BLUE, "from the movement")):
        right.semilogy(times, 1e3 * np.linalg.norm(tips - reference, axis=1), color=color, label=label)
    right.axhline(10.0, color=ORANGE, linestyle="--", linewidth=1, label="1 cm")
    right.set(xlabel="time [s]", ylabel="distance of the tip [mm]", ylim=(0.05, None))
    right.legend(fontsize="small")
    return figure

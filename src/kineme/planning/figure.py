"""Pictures of a plan and of its execution: the path of the hand among places and objects, and the arm as it moves."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kineme.errors import SpecificationError
from kineme.library.library import ActionLibrary
from kineme.movements.trajectories.figure import set_equal_scales
from kineme.planning.execution import Execution
from kineme.planning.plan import Plan
from kineme.planning.skill import move_to, skill_of
from kineme.reporting.atomic import write_atomically
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.figures import encode_figure, new_figure, principal_axes
from kineme.reporting.text import drawable
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_MOST_FRAMES = 200
_COLORS = (ORANGE, BLUE, GREEN, PURPLE, GRAY)


def paths_of_plan(plan: Plan, library: ActionLibrary) -> list[tuple[str, Array]]:
    """Return the symbol and the path (T, k) of each step that moves the hand, each from where the last one ends."""
    skills = {name: skill_of(library, name) for name in {step.operator for step in plan.steps}}
    paths: list[tuple[str, Array]] = []
    for step in plan.steps:
        if step.start:
            start = paths[-1][1][-1] if paths else step.start
            skill = skills[step.operator]
            movement = move_to(library, skill, start, step.goal, rate=100.0)
            columns = [movement.axis_names.index(axis) for axis in skill.axes]
            paths.append((step.operator, np.asarray(movement.positions[0][:, columns])))
    return paths


def draw_plan(plan: Plan, library: ActionLibrary) -> Figure:
    """Draw the paths of all steps in the two directions in which they go farthest, and the places by their names."""
    paths, axes_names = paths_of_plan(plan, library), plan.problem.domain.vocabulary.axes
    used = {name for step in plan.steps for name in step.arguments.values()} & plan.problem.places.keys()
    figure = new_figure(6.9, 3.6)
    axes = figure.subplots()
    where = np.array([plan.problem.places[name] for name in sorted(used)]).reshape(len(used), -1)
    points = np.vstack([path for _, path in paths] + [where])
    view = np.eye(len(axes_names))[:2] if len(axes_names) < 3 else principal_axes(points.T)
    symbols = list(dict.fromkeys(name for name, _ in paths))
    for k, name in enumerate(symbols):
        for number, path in enumerate(path for symbol, path in paths if symbol == name):
            shown = path @ view.T
            axes.plot(*shown[:, :2].T, color=_COLORS[k % len(_COLORS)], label=None if number else drawable(name))
    for name, place in zip(sorted(used), where, strict=True):
        x, y = view @ place
        axes.plot(x, y, "o", color="black", markersize=4)
        axes.annotate(drawable(name), (x, y), xytext=(4, 6), textcoords="offset points")
    if len(axes_names) == 2:
        axes.set(xlabel=drawable(axes_names[0]), ylabel=drawable(axes_names[1]))
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend()
    return figure


def draw_execution(execution: Execution, robot: Robot) -> Figure:
    """Draw where the tip and the objects went, with a cross where it was stopped; below how far off it was."""
    runs = execution.runs
    figure = new_figure(6.9, 6.4)
    above, below = figure.subplots(2, 1, height_ratios=(3, 1))
    tips = [run.tips for run in runs] or [kinematics(robot, robot.rest[None])[0]]
    view = principal_axes(np.vstack(tips).T) if sum(map(len, tips)) > 2 else np.eye(3)[:2]
    begun = 0.0
    for attempt, run in zip([each for each in execution.attempts if each.duration], runs, strict=True):
        color = GRAY if attempt.how == "back" else ORANGE if attempt.how == "resumed" else BLUE
        above.plot(*(run.tips @ view.T).T, color=color, linewidth=1)
        sent = kinematics(robot, run.sent)[0]
        below.plot(begun + run.times - run.times[0], 1e3 * np.linalg.norm(run.tips - sent, axis=1), color=color)
        begun += run.times[-1] - run.times[0]
        if run.stopped is not None:
            above.plot(*(view @ run.tips[np.argmin(np.abs(run.times - run.stopped))]), "x", color="black")
    for name in runs[-1].objects if runs else ():
        path = np.vstack([run.objects[name] for run in runs]) @ view.T
        visible = path[np.isfinite(path).all(axis=1)]
        if len(visible):
            above.plot(*visible.T, color=GREEN, linestyle=":")
            above.plot(*visible[-1], "o", color=GREEN)
            above.annotate(drawable(name), visible[-1], xytext=(4, 6), textcoords="offset points")
    above.set_aspect("equal", adjustable="datalim")
    below.set(xlabel="time [s]", ylabel="tip off [mm]")
    return figure


def write_moving(path: Path, execution: Execution, robot: Robot) -> Path:
    """Write the arm and the objects as they move, four frames for each second, at twice the speed, as a GIF."""
    from PIL import Image

    runs = execution.runs
    if not runs:
        raise SpecificationError("expected an execution in which something moved, to show it; nothing did")
    joints, tips = (np.vstack([getattr(run, name) for run in runs]) for name in ("joints", "tips"))
    objects = {name: np.vstack([run.objects[name] for run in runs]) for name in runs[0].objects}
    figure = new_figure(4.8, 4.2)
    axes: Any = figure.add_subplot(projection="3d")
    rows = np.unique(np.linspace(0, len(joints) - 1, min(_MOST_FRAMES, len(joints) // 25 + 2)).astype(int))
    links = _links(robot, joints[rows])
    everything = np.vstack(
        (links.reshape(-1, 3), *(where[np.isfinite(where).all(axis=1)] for where in objects.values()))
    )
    frames = []
    for links_now, row in zip(links, rows.tolist(), strict=True):
        axes.clear()
        axes.plot(*links_now.T, color=BLUE, linewidth=3, marker="o", markersize=4)
        axes.plot(*tips[: row + 1].T, color=ORANGE, linewidth=1)
        for name, where in objects.items():
            if np.isfinite(where[row]).all():
                axes.plot(*where[row], "s", color=GREEN, markersize=6)
                axes.text(*where[row], f" {drawable(name)}", fontsize=7)
        set_equal_scales(axes, everything)
        axes.set(
            **dict(zip(("xlim", "ylim", "zlim"), zip(everything.min(0), everything.max(0), strict=True), strict=True))
        )
        frames.append(Image.open(io.BytesIO(encode_figure(figure, "png"))).convert("P"))
    data = io.BytesIO()
    frames[0].save(data, "GIF", save_all=True, append_images=frames[1:], duration=125, loop=0)
    return write_atomically(path, data.getvalue())


def _links(robot: Robot, joints: Array) -> Array:
    """Return the base, the joints and the tip of an arm (m, n + 2, 3) at joint positions (m, n) [m]."""
    import pinocchio

    data, frame = robot.model.createData(), robot.model.getFrameId(robot.tip)
    points = np.zeros((len(joints), robot.n_joints + 2, 3))
    for row, q in enumerate(joints):
        pinocchio.forwardKinematics(robot.model, data, q)
        tip = pinocchio.updateFramePlacement(robot.model, data, frame).translation
        points[row, 1:] = [*(data.oMi[j].translation for j in range(1, robot.model.njoints)), tip]
    return points

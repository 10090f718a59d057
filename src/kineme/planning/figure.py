"""Picture of a plan: the path of the hand, step by step, among the places."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kineme.library.library import ActionLibrary
from kineme.planning.plan import Plan
from kineme.planning.skill import move_to, skill_of
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.figures import new_figure, principal_axes
from kineme.reporting.text import drawable
from kineme.validation import Array

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

"""Pictures of a plan and of its execution: the path of the hand among places and objects, and the arm as it moves."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from kineme.errors import SpecificationError
from kineme.library.library import ActionLibrary
from kineme.planning.execution import Execution
from kineme.planning.plan import Plan
from kineme.planning.skill import move_to, skill_of
from kineme.reporting.atomic import write_atomically
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.figures import new_figure, principal_axes
from kineme.reporting.text import drawable, shortened
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_MOST_FRAMES = 200
_JUMP, _OFF = 0.02, 0.01  # of an object within a sample, and of the tip from where it was sent [m]: a disturbance
_SHOWN, _TRAIL = 300, 400  # samples for which a disturbance and the path of the tip are shown
_LINES, _LONGEST = 4, 72  # of the report, and their characters
_SHADES = 12  # of each color, in a moving picture
_COLORS = (ORANGE, BLUE, GREEN, PURPLE, GRAY)


def paths_of_plan(plan: Plan, library: ActionLibrary) -> list[tuple[str, Array]]:
    """Return the symbol and the path (T, k) of each step that moves the hand, each from where the last one ends."""
    operators = {step.operator: plan.problem.domain.operator(step.operator) for step in plan.steps}
    skills = {name: skill_of(library, operator.symbol) for name, operator in operators.items()}
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


class _Film:
    """The arm, the objects and the report of an execution, drawn instant by instant."""

    def __init__(self, execution: Execution, robot: Robot) -> None:
        runs = execution.runs
        self.run_of = np.repeat(np.arange(len(runs)), [len(run.times) for run in runs])
        self.joints, self.tips, sent = (
            np.vstack([getattr(run, name) for run in runs]) for name in ("joints", "tips", "sent")
        )
        self.objects = {name: np.vstack([run.objects[name] for run in runs]) for name in runs[0].objects}
        self.sent = kinematics(robot, sent)[0]
        self.robot, self.lines, self.disturbances = robot, _report(execution), self._disturbed()
        self.figure = new_figure(4.8, 4.8)
        self.figure.set_layout_engine("none")
        self.axes = cast("Any", self.figure.add_axes((-0.06, 0.2, 1.12, 0.83), projection="3d"))
        self.said = [self.figure.text(0.03, 0.125 - 0.035 * k, "", fontsize=9) for k in range(_LINES)]
        self.title = self.figure.text(0.03, 0.95, "", color=ORANGE, fontsize=12, weight="bold")
        style: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round"}
        (self.shadow,) = self.axes.plot([], [], [], color=GRAY, alpha=0.3, linewidth=3, **style)
        (self.path,) = self.axes.plot([], [], [], color=BLUE, linewidth=1.2)
        (self.arm,) = self.axes.plot([], [], [], color="black", linewidth=4, marker="o", markersize=5, **style)
        (self.mark,) = self.axes.plot([], [], [], color=ORANGE, linestyle=":", linewidth=2, marker="x", markersize=9)
        self.things: dict[str, Any] = {}
        for name, where in self.objects.items():
            stays = bool((np.ptp(where, axis=0) < _JUMP).all())
            color, marker, side = (GRAY, "D", "top") if stays else (GREEN, "s", "bottom")
            text = f"\n{drawable(name)}" if stays else f"{drawable(name)}\n"
            (stem,) = self.axes.plot([], [], [], color=color, linewidth=0.8)
            (square,) = self.axes.plot([], [], [], marker, color=color, markersize=10 if stays else 8)
            label = self.axes.text(0, 0, 0, text, fontsize=9, color=color, ha="center", va=side, weight="bold")
            self.things[name] = stem, square, label
        for axis in (self.axes.xaxis, self.axes.yaxis, self.axes.zaxis):
            axis.set_pane_color((1.0, 1.0, 1.0))  # light grays are none of the few colors
        self.axes.view_init(elev=22, azim=28)

    def _disturbed(self) -> list[tuple[int, Array, Array, str]]:
        """List what was disturbed: the row, from where to where, and what is said of it."""
        rows = []
        for name, where in self.objects.items():
            is_there = np.asarray(np.isfinite(where).all(axis=1))
            jumps = np.linalg.norm(np.diff(where, axis=0), axis=1) > _JUMP
            for row in (np.flatnonzero(jumps | (is_there[:-1] & ~is_there[1:])) + 1).tolist():
                what = "moved" if is_there[row] else "taken away"
                rows.append((row, where[row - 1], where[row], f"{drawable(name)} is {what}"))
        off = np.linalg.norm(self.tips - self.sent, axis=1)
        is_off = np.append(False, off > _OFF)
        for row in np.flatnonzero(is_off[1:] & ~is_off[:-1]).tolist():
            end = row + int(np.argmax(off[row : row + _SHOWN]))
            rows.append((row, self.sent[end], self.tips[end], f"the tip is {100 * off[end]:.0f} cm off"))
        return rows

    def rows(self) -> Array:
        """Return the rows that are shown: evenly many, and the last of each run."""
        n = len(self.joints)
        even = np.linspace(0, n - 1, min(_MOST_FRAMES, n // 25 + 2)).astype(int)
        return np.union1d(even, np.append(np.flatnonzero(np.diff(self.run_of)), n - 1))

    def frames(self, rows: Array) -> Iterator[Array]:
        """Yield a picture (height, width, 4) for each row."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas: Any = FigureCanvasAgg(self.figure)
        links = _links(self.robot, self.joints[rows])
        everything = np.vstack((links.reshape(-1, 3), *(w[np.isfinite(w).all(axis=1)] for w in self.objects.values())))
        low, high = everything.min(axis=0), everything.max(axis=0)
        low[2] = min(low[2], 0.0)
        self.axes.set_box_aspect(np.maximum(high - low, 0.2 * (high - low).max()), zoom=1.0)
        self.axes.locator_params(nbins=4)
        self.axes.set(**dict(zip(("xlim", "ylim", "zlim"), zip(low, high, strict=True), strict=True)))
        self.axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
        moving = [self.shadow, self.path, self.arm, self.mark, *chain(*self.things.values()), *self.said, self.title]
        moving.sort(key=lambda artist: artist.zorder)
        for artist in moving:
            artist.set_animated(True)
        canvas.draw()  # what stays is drawn once
        behind = canvas.copy_from_bbox(self.figure.bbox)
        for points, row in zip(links, rows.tolist(), strict=True):
            self.arm.set_data_3d(*points.T)
            self.shadow.set_data_3d(*points.T[:2], np.full(len(points), low[2]))
            self.path.set_data_3d(*self.tips[max(0, row - _TRAIL) : row + 1].T)
            for name, (stem, square, label) in self.things.items():
                x, y, z = self.objects[name][row]
                stem.set_data_3d(*np.array([[x, x], [y, y], [low[2], z]]))
                square.set_data_3d(*np.array([[x], [y], [z]]))
                label.set_position_3d((x, y, z))
                label.set_visible(bool(np.isfinite(z)))
            recent = [each for each in self.disturbances if 0 <= row - each[0] < _SHOWN]
            marks = [point for each in recent for point in (np.full(3, np.nan), *each[1:3])]
            self.mark.set_data_3d(*np.array(marks or [np.full(3, np.nan)]).T)
            self.title.set_text(", ".join(dict.fromkeys(each[3] for each in recent)))
            is_over = row + 1 == len(self.run_of) or self.run_of[row + 1] > self.run_of[row]
            lines = self.lines[2 * self.run_of[row] + is_over]
            for text, (line, color) in zip(self.said, lines[-_LINES:], strict=False):
                text.set(text=line, color=color)
            with warnings.catch_warnings():  # a character that the font lacks is drawn as a box
                warnings.filterwarnings("ignore", r"Glyph \d+", UserWarning)
                canvas.restore_region(behind)
                for artist in moving:
                    self.figure.draw_artist(artist)
            yield np.array(canvas.buffer_rgba())


def _report(execution: Execution) -> list[list[tuple[str, str]]]:
    """Return the lines that report each run, and their colors, while it is under way and at its end, in turn."""
    lines: list[tuple[str, str]] = []
    reports = []
    plan = 0
    for attempt in execution.attempts:
        if attempt.plan > plan:
            plan = attempt.plan
            lines.append((f"a new plan of {len(execution.replans[plan - 1].steps)} steps", ORANGE))
        what = {
            "planned": attempt.step,
            "joined": attempt.step,
            "resumed": f"{attempt.step}, resumed",
            "back": "back, the way it came",
        }
        lines = [(text, GRAY if color == BLUE else color) for text, color in lines]
        lines.append((drawable(shortened(what[attempt.how], _LONGEST)), BLUE))
        under_way = [*lines]
        if attempt.status != "done":
            reason = shortened(": ".join((attempt.status, *attempt.reasons[:1])), _LONGEST)
            lines.append((f"    {drawable(reason)}", ORANGE))
        if attempt.duration:
            reports += [under_way, [*lines]]
    if reports:
        reports[-1].append(("the goal is reached", GREEN) if execution.reached else ("the goal is not reached", ORANGE))
    return reports


def write_moving(path: Path, execution: Execution, robot: Robot) -> Path:
    """Write the arm and the objects as they move, four frames for each second, at twice the speed, as a GIF.

    Below it stands which step is under way and how those before ended. Crosses show where an object was moved or taken
    away, and where the tip is more than 1 cm from where it was sent. At the end of a step that failed the picture
    stands.
    """
    from PIL import Image

    if not execution.runs:
        raise SpecificationError("expected an execution in which something moved, to show it; nothing did")
    film = _Film(execution, robot)
    rows = film.rows()
    shades = np.linspace(0.0, 1.0, _SHADES)[:, None]
    ramps = [255 + shades * (255 * np.array(to_rgb(color)) - 255) for color in ("black", *_COLORS)]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.vstack(ramps).round().astype(np.uint8).tobytes())
    frames = [
        Image.fromarray(picture).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in film.frames(rows)
    ]
    statuses = [attempt.status for attempt in execution.attempts if attempt.duration]
    lasting = np.full(len(rows), 125)  # [ms]
    for k, status in enumerate(statuses):
        if status != "done":
            lasting[np.flatnonzero(film.run_of[rows] == k)[-1]] = 1500
    lasting[-1] = 2500
    data = io.BytesIO()
    frames[0].save(data, "GIF", save_all=True, append_images=frames[1:], duration=lasting.tolist(), loop=0)
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

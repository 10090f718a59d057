"""A movement of a skill before anything moves: inside what was shown, on the joints of an arm, checked, and drawn."""

from __future__ import annotations

import json
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError, heard_warnings
from kineme.library.library import ActionLibrary
from kineme.movements.channels.channel import recorded_names
from kineme.movements.trajectories.figure import set_equal_scales
from kineme.planning.skill import Excess, Skill, move_to, outside, skill_of
from kineme.reporting.colors import BLUE, GRAY, ORANGE
from kineme.reporting.figures import encode_figure, new_figure
from kineme.reporting.text import drawable, printable, shortened
from kineme.robots.export_files import not_in_goal
from kineme.robots.kinematics.descent import PLANES, kinematics
from kineme.robots.models.robot import Robot
from kineme.robots.planning.move import move
from kineme.robots.planning.robot_movement import RobotMovement, duration_in_words
from kineme.robots.planning.roles import plane_of, roles_of, scales_of, space_of
from kineme.units import split_head
from kineme.validation import Array

_PLAIN_UNIT = re.compile(r"[A-Za-z0-9/^%.]{1,8}")
_ROUNDING = 1e-9  # [s]
_ROWS = 8  # coordinates that are drawn over time


class OutsideError(SpecificationError):
    """A start and a goal beyond what was shown; ``nearest`` is the pair (start, goal) that would do."""

    def __init__(self, message: str, nearest: tuple[Array, Array]) -> None:
        super().__init__(message)
        self.nearest = nearest


class Preview(NamedTuple):
    """A movement of a skill, inside what was shown, that has not been executed; places are in recorded units."""

    skill: Skill
    robot: Robot
    times: Array  # (T,) [s], from 0
    path: Array  # (T, k), the places along it
    movement: RobotMovement | None  # on the joints, with its approach; None where the arm cannot
    refusal: str  # why the arm cannot
    notes: tuple[str, ...]  # warnings

    def __str__(self) -> str:
        skill, arm = self.skill, as_data(self.robot.name)
        lines = [
            f"Movement of the skill {as_data(skill.name)} ({skill.id}), which was shown {len(skill.starts)} times:",
            f"from {in_words(skill, self.path[0])} to {in_words(skill, self.path[-1])} in {self.times[-1]:.2f} s. "
            "Start, goal, displacement and duration are inside what was shown.",
        ]
        if self.movement is None:
            lines.append(f"The arm {arm} cannot execute it: {clean(self.refusal, 1500)}")
        else:
            report, words = self.movement.preflight, duration_in_words(self.movement)
            lines.append(f"The arm {arm} can execute it, all {len(report.checks)} checks passed: {words}.")
            lines += [f"Not checked: {printable(sentence)}." for sentence in report.unchecked]
            lines += [f"Note: {clean(note, 500)}" for note in [not_in_goal(self.movement.trajectory)] if note]
        return "\n".join([*lines, *(f"Note: {clean(note, 500)}" for note in self.notes)])


def clean(text: str, longest: int = 120) -> str:
    """Return a text from a library on one line, shortened."""
    return printable(shortened(text, longest))


def as_data(text: str, longest: int = 80) -> str:
    """Write a text from a library on one line, shortened, in quotes."""
    return json.dumps(clean(text, longest), ensure_ascii=False)


def units_of(skill: Skill) -> list[str]:
    """Return the units of the coordinates, those that are no plain words as data, "" where there are none."""
    return [unit if _PLAIN_UNIT.fullmatch(unit) else as_data(unit, 20) if unit else ""
            for unit in (unit or "" for unit in skill.units)]  # fmt: skip


def identifiers(names: Sequence[str], ids: Sequence[str], fallback: str = "skill") -> list[str]:
    """Derive identifiers of small letters, digits and underscores from names; of names that clash all get their ids.

    The id stands behind a hyphen, which no other identifier has, so that all differ if the ids do.
    """
    plain = [unicodedata.normalize("NFKD", name[:200]).encode("ascii", "ignore").decode().lower() for name in names]
    words = [re.sub(r"[^a-z0-9]+", "_", name).strip("_")[:32].rstrip("_") for name in plain]
    counts = Counter(words)
    return [word if word and counts[word] == 1 else f"{word or fallback}-{own}"
            for word, own in zip(words, ids, strict=True)]  # fmt: skip


def axes_of(skill: Skill) -> list[str]:
    """Return the coordinates of a skill as identifiers."""
    return identifiers([split_head(axis)[0] for axis in skill.axes], [*map(str, range(len(skill.axes)))], "axis")


def ranges_of(skill: Skill) -> dict[str, tuple[float, float, str]]:
    """Return what was shown, ``{"goal_x": (low, high, unit), ..., "duration": (low, high, "s")}``; goals come first."""
    ranges = {
        f"{what}_{axis}": (float(values.min()), float(values.max()), unit)
        for what in ("goal", "start", "displacement")
        for axis, values, unit in zip(axes_of(skill), skill.shown[what].T, units_of(skill), strict=True)
    }
    return {**ranges, "duration": (float(skill.durations.min()), float(skill.durations.max()), "s")}


def in_words(skill: Skill, place: Array) -> str:
    """Write a place as ``x = 0.4 m, y = 0.2 m``, rounded by less than `outside` allows."""
    rounded = [f"{round(value, 10) + 0.0:.15g}" for value in place.tolist()]
    parts = zip(axes_of(skill), rounded, units_of(skill), strict=True)
    return ", ".join(f"{axis} = {value} {unit}".rstrip() for axis, value, unit in parts)


def nearest_inside(skill: Skill, start: Array, goal: Array) -> tuple[Array, Array]:
    """Return the start nearest to `start` that is inside what was shown, then the goal nearest to `goal`, (k,) each.

    There is such a goal: axis by axis, a start inside is a mean of two that were shown, and the mean of their goals has
    the mean of their displacements.
    """
    turns = skill.turns(start)
    begin = np.clip(start - turns, skill.starts.min(axis=0), skill.starts.max(axis=0))
    goals, ways = skill.goals, skill.shown["displacement"]
    low = np.maximum(goals.min(axis=0), begin + ways.min(axis=0))
    end = np.clip(goal - turns, low, np.minimum(goals.max(axis=0), begin + ways.max(axis=0)))
    return begin + turns, end + turns


def check_inside(skill: Skill, start: Array, goal: Array, duration: float) -> None:
    """Raise an `OutsideError` that says what is how far outside what was shown, and what would do."""
    excesses = outside(skill, start, goal)
    low, high = float(skill.durations.min()), float(skill.durations.max())
    if not low - _ROUNDING <= duration <= high + _ROUNDING:
        excesses.append(Excess("the", "duration", duration, low, high, "s"))
    if excesses:
        nearest = nearest_inside(skill, start, goal)
        axes, units = (dict(zip(skill.axes, words, strict=True)) for words in (axes_of(skill), units_of(skill)))
        far = [e._replace(axis=axes.get(e.axis, e.axis), unit=units.get(e.axis, e.unit)) for e in excesses]
        raise OutsideError(
            f"expected a movement inside what was shown of {as_data(skill.name)}: {'; '.join(map(str, far))}. This "
            f"would do: from {in_words(skill, nearest[0])} to {in_words(skill, nearest[1])}, in {low:.10g} to "
            f"{high:.10g} s",
            nearest,
        )


def standing_place(library: ActionLibrary, skill: Skill, robot: Robot, joints: Array) -> Array | None:
    """Return the place (k,) in recorded units at which an arm stands with joints (n,).

    None where the skill moves what the arm is not said to have, as the two hands of a person.
    """
    channels = library.channels
    n = (library.n_dims or 0) if channels is None else sum(len(channel.columns) for channel in channels)
    space = space_of(channels, np.zeros((1, n)), robot)
    try:
        roles = roles_of(channels, n, space, robot)
        scales = scales_of(roles, robot if space == "joints" else None)
        plane = plane_of(roles.columns) if space == "tip" else ""
    except TrajectoryError:
        return None
    values = joints if space == "joints" else kinematics(robot, joints[None])[0][0]
    if space == "tip" and len(roles.positions) == 2:
        values = values[list(PLANES[plane])]
    names = [channel.name for channel in roles.columns] or list(skill.axes)
    if len(roles.positions) != len(values) or len(names) != len(values) or not set(skill.axes) <= set(names):
        return None
    return ((values - scales.offset) / scales.size)[[names.index(axis) for axis in skill.axes]]


def preview_skill(  # noqa: PLR0913, PLR0917 - all that a movement depends on
    library: ActionLibrary, skill: Skill, robot: Robot, joints: ArrayLike, start: Array, goal: Array, duration: float
) -> Preview:
    """Generate a movement of a skill in `duration` [s], and check it on an arm that stands with `joints` (n,).

    Start and goal (k,) are in recorded units. An approach leads to the start; nothing moves.
    """
    check_inside(skill, start, goal, duration)
    movement, refusal = None, ""
    with heard_warnings() as heard:
        rollout = move_to(library, skill, start, goal, duration=duration)
        try:
            movement = move(rollout, robot, start=joints)
        except TrajectoryError as error:
            refusal = str(error)
    generated = rollout.demonstrations[0]
    names = list(skill.axes) if generated.channels is None else list(recorded_names(generated.channels))
    path = generated.recorded[:, [names.index(axis) for axis in skill.axes]]
    return Preview(skill, robot, generated.times - generated.times[0], path, movement, refusal, tuple(heard))


def plan_symbol(library: ActionLibrary, robot: Robot, who: str, joints: Array) -> RobotMovement:
    """Return a checked movement of a symbol as it was demonstrated nearest to where the arm stands with `joints`."""
    skill = skill_of(library, who)
    here = standing_place(library, skill, robot, joints)
    turns = 0.0 if here is None else skill.turns(here)
    row = 0 if here is None else int(np.linalg.norm(skill.starts + turns - here, axis=1).argmin())
    start, goal, duration = skill.starts[row] + turns, skill.goals[row] + turns, float(skill.durations[row])
    shown = preview_skill(library, skill, robot, joints, start, goal, duration)
    if shown.movement is None:
        raise TrajectoryError(shown.refusal)
    return shown.movement


def draw_preview(shown: Preview) -> bytes:
    """Draw the path among the starts and goals that were shown, and each coordinate over time: a picture in PNG."""
    skill, path, times = shown.skill, shown.path, shown.times
    n, names = min(_ROWS, path.shape[1]), [drawable(shortened(name, 30)) for name in (*skill.axes, skill.name)]
    figure = new_figure(8.0, max(3.2, 0.9 + 0.8 * n))
    left, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.1))  # type: ignore[misc]
    axes: Any
    if path.shape[1] in (2, 3):
        axes = left.add_subplot(projection="3d" if path.shape[1] == 3 else None)
        axes.plot(*skill.starts.T, "o", color=GRAY, markersize=4, label="starts that were shown")
        axes.plot(*skill.goals.T, "*", color=GRAY, markersize=6, label="goals that were shown")
        axes.plot(*path.T, color=BLUE, label="the movement")
        axes.plot(*path[-1:].T, "*", color=BLUE, markersize=10)
        set_equal_scales(axes, np.concatenate((path, skill.starts, skill.goals)))
        axes.locator_params(nbins=4)
        axes.set(**dict(zip(("xlabel", "ylabel", "zlabel"), names[:-1], strict=False)))
        left.legend(loc="outside lower center", ncols=2, fontsize=7)
    for k, axes in enumerate(right.subplots(n, 1, sharex=True, squeeze=False)[:, 0]):
        for when, values in ((0.0, skill.starts), (times[-1], skill.goals)):
            axes.plot([when, when], [values[:, k].min(), values[:, k].max()], color=ORANGE, linewidth=5, alpha=0.5)
        axes.plot(times, path[:, k], color=BLUE)
        axes.set_ylabel(names[k], fontsize=8)
    axes.set_xlabel("time [s]; bars: what was shown")
    can = "can" if shown.movement is not None else "CANNOT"
    figure.suptitle(f"{names[-1]}: {drawable(shown.robot.name)} {can} execute it", fontsize=9)
    return encode_figure(figure, "png", 100)

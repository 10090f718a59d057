"""Steps of a plan under way on an arm: in its frame, watched, and one going over into the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.library.library import ActionLibrary
from kineme.planning.plan import Plan, Step, check_plan
from kineme.planning.problem import Goal, Problem, facts_after
from kineme.planning.vocabulary import Fact, Variable
from kineme.reporting.text import first_names
from kineme.robots.execution.joint_trajectory import JointTrajectory, between, n_samples
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.robot import Robot
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.validation import Array, as_point

HAND_AT = "hand-at"
_RATE = 100.0  # samples per second
_STOPPED = 0.01  # of the movements like those shown, all the same
_TRIED = 32  # lengths of an overlap
_IN_A_ROW = 2  # looks that miss an object, before it counts: one may be an error of a sensor
_AXES = "xyz"
_POINTS = 50  # of an overlap, at which the tip is looked at


#: Reason to stop a movement at a time since it began [s] with the tip there [m], or None.
Watcher = Callable[[float, Array], str | None]


class Frame(NamedTuple):
    """Where the coordinates of a plan lie in the frame of the robot: each axis is that of its letter."""

    axes: list[int]  # of the plan's k coordinates: 0 for x, 1 for y, 2 for z
    origin: Array  # (3,), of the plan, in the frame of the robot [m]

    def to_robot(self, place: Array) -> Array:
        """Return a place (k,) in the frame of the robot (3,)."""
        point = self.origin.copy()
        point[self.axes] += place
        return point

    def from_robot(self, point: Array) -> Array:
        """Return a point (3,) of the robot as a place of the plan (k,)."""
        return np.asarray((point - self.origin)[self.axes])


def frame_of(plan: Plan, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Frame:
    """Return the frame of a plan whose axes are x, y, z, or two of them: then `origin` says where their plane lies."""
    axes = plan.problem.domain.vocabulary.axes
    if [*axes] != [axis for axis in _AXES if axis in axes] or len(axes) < 2:
        raise SpecificationError(
            f"expected a plan in coordinates x, y, z or two of them, got {', '.join(axes)}; learn a new library from "
            "these columns in this order (columns=, --columns), then its operators and the plan"
        )
    return Frame([_AXES.index(axis) for axis in axes], as_point("origin", origin, _AXES))


def monitored(
    plan: Plan, library: ActionLibrary, robot: Robot, frame: Frame
) -> Callable[[Step, RobotMovement], Watcher]:
    """Return what stops a step where it leaves what was shown of its symbol: `ActionLibrary.monitor`.

    Movements of more than places, as with orientations, are not watched so: of these the tip does not tell enough.
    """

    def watcher(step: Step, movement: RobotMovement) -> Watcher:
        symbol = plan.problem.domain.operator(step.operator).symbol
        if library.primitives(ids=library[symbol].members[:1]).n_dims != len(frame.axes):
            return lambda t, tip: None
        ends = kinematics(robot, movement.trajectory.positions[[movement.first, -1]])[0]
        monitor = library.monitor(symbol, *map(frame.from_robot, ends), error_rate=_STOPPED)

        def watch(t: float, tip: Array) -> str | None:
            state = monitor.update(t, frame.from_robot(tip))
            return None if state.inside else state.in_words

        return watch

    return watcher


class Part(NamedTuple):
    """A step within the movement that is sent."""

    step: Step
    place: str  # at which it begins
    alone: RobotMovement  # as planned without the others
    watcher: Watcher | None
    begins: float  # since the movement began [s]
    ends: float

    def at(self, shift: float, factor: float) -> Part:
        """Return the part in a movement that begins so much later and takes so many times as long."""
        begins, ends = factor * (self.begins - shift), factor * (self.ends - shift)
        return self._replace(begins=begins, ends=ends, watcher=None if begins < 0 else self.watcher)


class Options(NamedTuple):
    """What `execute` is told besides."""

    replan: Callable[[Problem], Plan]
    watcher: Callable[[Step, RobotMovement], Watcher]
    done: Callable[[Step], object]
    leeway: float  # [m]
    follow: str
    frame: Frame
    join: bool
    look_rate: float  # [Hz], 0 for never


class Watch:
    """Reasons to stop a movement, sample after sample: the tip, the symbols of its parts, and what these need."""

    def __init__(
        self,
        movement: RobotMovement,
        parts: Sequence[Part],
        options: Options,
        missing: Callable[[Sequence[Step]], list[str]],
        unmet: Callable[[Step], list[str]],
    ) -> None:
        self.parts, self.options, self.missing, self.unmet, self.reasons = parts, options, missing, unmet, list[str]()
        self.times, self.tips = movement.trajectory.times - movement.begins, _tips(movement)
        self.alone = [_tips(part.alone) for part in parts]
        self.n_begun, self.n_done, self.n_missed, self.next_look = 1, 0, 0, 0.0

    def __call__(self, t: float, tip: Array) -> bool:
        """Tell whether the arm is to stop, with its tip there (3,) so long after the movement began."""
        off = tip - _at(t, self.times, self.tips)
        if np.linalg.norm(off) > self.options.leeway:
            self.reasons.append(f"the tip is {100 * np.linalg.norm(off):.1f} cm from where it was sent, at {t:.2f} s")
        elif t >= 0:
            self.reasons += self.outside(t, off)
        self.finish(sum(part.ends <= t for part in self.parts[:-1]))
        if self.parts and self.options.look_rate and t >= self.next_look:
            self.next_look = t + 1.0 / self.options.look_rate
            missing = self.missing([part.step for part in self.parts[self.n_done :]])
            self.n_missed = self.n_missed + 1 if missing else 0
            self.reasons += missing if self.n_missed >= _IN_A_ROW else []
        if self.n_begun < len(self.parts) and t >= self.parts[self.n_begun].begins:
            self.reasons += self.unmet(self.parts[self.n_begun].step)
            self.n_begun += 1
        return bool(self.reasons)

    def outside(self, t: float, off: Array) -> list[str]:
        """Say which symbol is left by a tip that is so far from what was sent: so far beside its own movement."""
        for part, tips in zip(self.parts, self.alone, strict=True):
            if part.watcher is not None and part.begins <= t <= part.ends:
                own = part.alone.trajectory.times - part.alone.begins
                passed = (t - part.begins) / (part.ends - part.begins) * own[-1]
                if reason := part.watcher(t - part.begins, _at(passed, own, tips) + off):
                    return [reason]
        return []

    def finish(self, n_parts: int) -> None:
        """Say of the first parts that they came to their end."""
        for part in self.parts[self.n_done : n_parts]:
            self.options.done(part.step)
        self.n_done = max(self.n_done, n_parts)


def _tips(movement: RobotMovement) -> Array:
    return kinematics(movement.robot, movement.trajectory.positions)[0]


def _at(t: float, times: Array, tips: Array) -> Array:
    return np.array([np.interp(t, times, column) for column in tips.T])


def n_joinable(problem: Problem, steps: Sequence[Step]) -> int:
    """Count the first steps of which each needs no effect of those before it, but where the hand is."""
    changed: set[tuple[str, ...]] = set()
    for k, (step, following) in enumerate(pairwise(steps), 1):
        changed |= {*facts_after({}, problem.domain.operator(step.operator), step.arguments)}
        needed = {
            (literal.predicate, *(following.arguments[name] for name in literal.arguments))
            for literal in problem.domain.operator(following.operator).preconditions
        }
        if any(fact[0] != HAND_AT for fact in needed & changed):
            return k
    return len(steps)


def overlap_of(robot: Robot, before: JointTrajectory, after: JointTrajectory, nearest: float) -> float | None:
    """Return for how long two trajectories may go on together [s]; None where the gripper changes between them.

    At most half of either, while the gripper stays as it is, and so that the tip comes to within `nearest` [m] of the
    place between them.
    """
    longest = 0.5 * min(before.duration, after.duration)
    for name in before.steps.keys() & after.steps.keys():
        value = before.steps[name][-1]
        if after.steps[name][0] != value:
            return None
        others = [trajectory.times[trajectory.steps[name] != value] for trajectory in (before, after)]
        longest = min(longest, before.duration - max(others[0], default=0.0), min(others[1], default=after.duration))
    tips = [kinematics(robot, trajectory.positions)[0] for trajectory in (before, after)]
    away = [np.linalg.norm(path - tips[1][0], axis=1) for path in tips]
    lengths = np.linspace(0.0, longest, _TRIED)[:, None]
    passed = lengths * np.linspace(0.0, 1.0, _POINTS)
    ending = np.interp(before.duration - lengths + passed, before.times, away[0])
    nearer = (ending + np.interp(passed, after.times, away[1])).min(axis=1)
    return float(lengths[nearer <= nearest].max(initial=0.0))


def superposed(
    parts: Sequence[JointTrajectory], overlaps: Sequence[float]
) -> tuple[Array, Array, dict[str, Array], list[float]]:
    """Let each trajectory begin so long before the one ends from whose end it goes on: in between both move.

    ``q(t) = q_1(t) + sum_k q_k(t - t_k) - q_k(0)``, each at its end from then on: as smooth as its parts. T. Flash and
    E. Henis, "Arm trajectory modifications during reaching towards visual targets", Journal of Cognitive Neuroscience
    3(3), 1991, describe so how people turn from one reach to the next. Returned are times (T,) [s], joints (T, n), what
    the gripper does (T,), and when each part begins [s].
    """
    begins = [0.0]
    for part, overlap in zip(parts, overlaps, strict=False):
        begins.append(begins[-1] + part.duration - overlap)
    total = begins[-1] + parts[-1].duration
    times = np.linspace(0.0, total, n_samples(total, _RATE))
    moved, steps = np.zeros((len(times), len(parts[0].joints))), dict[str, Array]()
    for part, begin in zip(parts, begins, strict=True):
        there = between(part, np.clip(times - begin, 0.0, part.duration))
        moved += there.positions - part.positions[0]
        for name, values in there.steps.items():
            steps[name] = np.where(times < begin, steps.get(name, values), values)
    return times, parts[0].positions[0] + moved, steps, begins


def objects_of(problem: Problem, step: Step) -> list[Variable]:
    """List the items of a step, and what is at the place that it goes to."""
    places = problem.domain.operator(step.operator).places
    goal = step.arguments[places[-1].name] if places else ""
    names = {goal, *step.arguments.values()} - {step.arguments[place.name] for place in places[:-1]}
    names |= {fact[1] for fact, value in problem.facts.items() if value and fact[0] == "in" and fact[2] == goal}
    return [each for each in problem.domain.vocabulary.of_kind("item", "fixture") if each.name in names]


def trouble_of(problem: Problem, steps: Sequence[Step]) -> str | None:
    """Say why steps do not lead to the goal from the state of a problem; None if they do."""
    lost = {name for step in steps for name in step.arguments.values()} - {*problem.objects}
    if lost:
        return f"{first_names(sorted(lost), 5)} cannot be found"
    try:
        check_plan(Plan(problem, tuple(steps), ""))
    except SpecificationError as error:
        return str(error)
    return None


def may_go_on(problem: Problem, step: Step, steps: Sequence[Step]) -> bool:
    """Tell whether nothing but the hand is elsewhere: from the first or the last place of its step all could go on."""
    ends = ((place_of(problem, step, 0), steps), (place_of(problem, step, -1), steps[1:]))
    return any(trouble_of(with_hand(problem, place), rest) is None for place, rest in ends)


def place_of(problem: Problem, step: Step, k: int) -> str:
    """Return the name of one of the places of a step; nothing where it has none."""
    places = problem.domain.operator(step.operator).places
    return step.arguments[places[k].name] if places else ""


def with_hand(problem: Problem, place: str) -> Problem:
    """Return a problem with the hand at another place."""
    hands = {fact: fact[1] == place for fact in problem.facts if fact[0] == HAND_AT}
    return replace(problem, facts={**problem.facts, **hands})


def missing_effects(problem: Problem, effects: Mapping[Fact, bool]) -> list[str]:
    """List the effects that are not seen."""
    return [
        f"{Goal(fact, value)} is not {'so' if fact in problem.facts else 'known'}"
        for fact, value in effects.items()
        if problem.facts.get(fact) is not value
    ]

"""A plan on an arm: look, check, move within what was shown, watch, look again, and plan anew."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import KinemeError, SpecificationError
from kineme.library.grounding import learned_movement
from kineme.library.library import ActionLibrary
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.planning import under_way
from kineme.planning.domain import hands_of, is_shown
from kineme.planning.plan import Plan, Step, find_plan
from kineme.planning.problem import Problem, facts_after, problem_of, unmet
from kineme.planning.skill import nearest_demonstration, outside, skill_of
from kineme.planning.states import HAND, State, read_state
from kineme.planning.under_way import Frame, Options, Part, Watcher, frame_of, monitored
from kineme.planning.vocabulary import Fact, Variable, hand_of, position_of, state_in
from kineme.reporting.table import Table
from kineme.reporting.text import first_names
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.robot import Robot
from kineme.robots.planning.generate_at import generate_at
from kineme.robots.planning.move import move
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.robots.simulation import Run
from kineme.units import UNITS, unit_named
from kineme.validation import Array, check_count, check_number

FORMAT, VERSION = "kineme-execution", 1
NOT_EXECUTED = "nothing was executed, every step passed its checks"
_AXES = "xyz"
_LEAST = 8  # samples of a movement that goes on or back
_NEAR = 0.05  # before it was stopped, an arm does not stand [s]
_SHARE = 0.2  # of the limits of velocity, on the way back
_APART = 0.01  # of samples on the way back, at the limits of velocity [s]: nearer ones would shake
_CORNER = 0.5  # of the radius of a place, by which steps that are joined miss it at most

#: What `robots.move` advises, and what can be done about it here.
_ELSEWHERE = re.compile(r"choose another (?:place|goal) \(--\w+\).{0,80}?(?:\(--scale\)|\(--rest\)|of the joints)")
_HERE = "choose another origin of the recordings (--origin), other places, or a freer orientation (--follow)"

_MILLIMETERS = re.compile(r"is it in millimeters\? .{0,40} --scale 0\.001 makes a movement so")
_METERS = "are the recordings in millimeters? convert them to meters, and learn library and operators again"


class World(Protocol):
    """An arm and its sensors, as `kineme.robots.Simulation`."""

    joints: Array  # (n,), where the arm stands

    def state(self) -> State:
        """Return what the sensors say, in the columns of the states that the domain was learned from."""

    def run(self, movement: RobotMovement, watch: Callable[[float, Array], bool] | None = None) -> Run:
        """Execute a movement that passed its checks; stop it on its path where `watch` says True."""


class Attempt(NamedTuple):
    """One movement of an execution."""

    step: str  # as (carry shelf tray cup); of several that were joined, one after another
    how: str  # "planned"; "joined", several as one; "resumed", the rest after a stop; "back", to where the step began
    status: str  # "done", "stopped", "no effect", or "refused", before anything moved
    reasons: tuple[str, ...]
    plan: int  # number of the plan, from 0
    duration: float = 0.0  # [s]
    tip_error: float = 0.0  # largest distance from what was sent [m]


class Replan(NamedTuple):
    """Steps that took the place of those that were left."""

    reason: str
    steps: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Execution:
    """What became of a plan.

    - `reached`: whether the goal holds, as far as the sensors say.
    - `why`: why it was not reached; empty if it was.
    - `state`: what was seen last.
    - `runs`: of the attempts that moved.
    - `movements`: what was sent in them; without a world, what would be.
    """

    reached: bool
    why: str
    attempts: tuple[Attempt, ...]
    replans: tuple[Replan, ...]
    goal: tuple[str, ...]
    state: dict[str, Any]
    runs: tuple[Run, ...]
    movements: tuple[RobotMovement, ...]

    def __repr__(self) -> str:
        end = "reached" if self.reached else "not reached"
        return f"Execution({end}, {len(self.attempts)} movements, {len(self.replans)} replans)"

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain data that JSON can hold."""
        return {
            "format": FORMAT, "version": VERSION, "reached": self.reached, "why": self.why, "goal": [*self.goal],
            "attempts": [attempt._asdict() | {"reasons": [*attempt.reasons]} for attempt in self.attempts],
            "replans": [{"reason": each.reason, "steps": [*each.steps]} for each in self.replans],
            "state": self.state,
        }  # fmt: skip

    def table(self) -> Table:
        """List the movements: step, how and with what result, how long, how far off, and why it ended."""
        rows: list[tuple[str, ...]] = []
        for k, a in enumerate(self.attempts):
            if a.plan > (self.attempts[k - 1].plan if k else 0):
                rows.append(("a new plan", "", "", "", "", self.replans[a.plan - 1].reason))
            cells = a.step, a.how, a.status, f"{a.duration:.1f}", f"{1e3 * a.tip_error:.1f}", first_names(a.reasons, 3)
            rows.append(cells)
        note = "The goal is reached." if self.reached else f"The goal is not reached: {self.why}"
        if self.why == NOT_EXECUTED:
            note = f"{NOT_EXECUTED[0].upper()}{NOT_EXECUTED[1:]}."
        return Table("Execution", ("step", "", "", "[s]", "off [mm]", "why"), rows, note)


def execute(  # noqa: PLR0913 - one parameter per option
    plan: Plan,
    library: ActionLibrary,
    world: World,
    robot: Robot,
    *,
    replan: Callable[[Problem], Plan] = find_plan,
    most_replans: int = 3,
    leeway: float = 0.015,
    watcher: Callable[[Step, RobotMovement], Watcher] | None = None,
    done: Callable[[Step], object] | None = None,
    follow: str = "full",
    origin: ArrayLike = (0.0, 0.0, 0.0),
    join: bool = True,
    look_rate: float = 10.0,
) -> Execution:
    """Execute a plan, and plan anew when the world is not as it should be.

    Before each step the state is looked at and all that is left of the plan is checked with it. The step is the
    movement of the nearest demonstration, inside what was shown, on the joints of the arm; what the arm cannot do is
    refused before it moves. Where `watcher` says so, or the tip is too far from what was sent, the arm stops. If the
    rest of the plan still holds then, it goes on; else there is a new plan, from where the arm stands, or from where
    the step began, to which the arm goes back the way it came. The same happens if an effect of a step is missing, or
    if an object that it needs is gone on the way or farther than the radius of a place from where it was.

    Steps that need no effect of those before but where the hand is are one movement, unless the gripper changes between
    them: the arm does not stop there, and cuts the corner by half the radius of a place at most. What the next step
    needs is looked at as it begins.

    Parameters
    ----------
    plan : Plan
    library : ActionLibrary
        Of its symbols; positions in meters.
    world : World
        As `kineme.robots.Simulation`.
    robot : Robot
    replan : callable, default find_plan
        Returns a plan of a problem, or raises SpecificationError.
    most_replans : int, default 3
        Plans and continuations after the first one.
    leeway : float, default 0.015
        The tip may be so far from what was sent [m].
    watcher : callable, optional
        Returns, of a step and its movement, what watches it; by default `monitored`. The rest of a movement that was
        stopped is not watched so: it begins outside.
    done : callable, optional
        Called with each step that came to its end, before its effects are looked at.
    follow : {"full", "axis", "free"}, default "full"
        How much of orientations is followed.
    origin : array_like of shape (3,), default (0, 0, 0)
        Where the recordings have their origin, in the frame of the robot [m]; where they are in x and z alone, y says
        where their plane is.
    join : bool, default True
        Make steps as one movement where that is safe and takes no longer; else the arm stops after each.
    look_rate : float, default 10.0
        How often the state is looked at while the arm moves [Hz]; 0 for worlds that cannot tell it then: there no steps
        are joined.

    Returns
    -------
    Execution
        Also where the goal is not reached: `why` says what was missing.

    Raises
    ------
    SpecificationError
        A plan in other coordinates than x, y, z or two of them.
    """
    check_number("leeway", leeway, above=0.0)
    check_number("look_rate", look_rate, least=0.0)
    check_count("most_replans", most_replans, 0)
    frame = frame_of(plan, origin)
    watcher = watcher or monitored(plan, library, robot, frame)
    options = Options(
        replan, watcher, done or (lambda step: None), leeway, follow, frame, join and look_rate > 0, look_rate
    )
    log = _Executor(plan, library, world, robot, options)
    why = log.run(most_replans)
    return Execution(
        not why, why, tuple(log.attempts), tuple(log.replans), tuple(map(str, plan.problem.goal)), log.state,
        tuple(log.runs), tuple(log.movements),
    )  # fmt: skip


def check_steps(
    plan: Plan, library: ActionLibrary, robot: Robot, follow: str = "full", origin: ArrayLike = (0.0, 0.0, 0.0)
) -> Execution:
    """Plan the joints of each step and check them, as `execute` would without any disturbance; nothing moves.

    `movements` are those of the steps, each from where the one before ends, up to the first that is refused.
    """
    frame = frame_of(plan, origin)
    attempts: list[Attempt] = []
    movements: list[RobotMovement] = []
    joints = robot.rest
    for step in plan.steps:
        try:
            start = joints if movements else None
            movements.append(_movement(plan.problem, step, library, robot, start, (frame, follow)))
        except KinemeError as error:
            attempts.append(Attempt(str(step), "planned", "refused", (refusal(error),), 0))
            break
        joints = movements[-1].trajectory.positions[-1]
        attempts.append(Attempt(str(step), "planned", "checked", (), 0, movements[-1].trajectory.duration))
    refused = attempts and attempts[-1].status == "refused"
    why = f"{attempts[-1].step} is refused" if refused else NOT_EXECUTED
    return Execution(False, why, tuple(attempts), (), tuple(map(str, plan.problem.goal)), {}, (), tuple(movements))


def _movement(
    problem: Problem, step: Step, library: ActionLibrary, robot: Robot, joints: Array | None, how: tuple[Frame, str]
) -> RobotMovement:
    """Return the movement of a step on the arm, from where its joints stand, by default from where the step begins."""
    domain = problem.domain
    operator = domain.operator(step.operator)
    if reasons := is_shown(domain, operator, step.arguments, problem.places):
        raise SpecificationError(f"{step} is outside what was shown: {'; '.join(reasons)}")
    skill = skill_of(library, operator.symbol)
    if any(unit is not None and unit_named(unit) != UNITS["m"] for unit in skill.units):
        raise SpecificationError(f"expected movements in meters, {skill.name} is in {', '.join(map(str, skill.units))}")
    ends = hands_of(operator, step.arguments, problem.places)
    frame, follow = how
    if joints is None and ends:
        start = np.array(ends[0])
    else:
        tip = kinematics(robot, (robot.rest if joints is None else joints)[None])[0][0]
        start = frame.from_robot(tip)
    goal = start + np.median(skill.shown["displacement"], axis=0) if ends is None else ends[1]
    if excesses := outside(skill, start, goal, domain.vocabulary.radius):
        raise SpecificationError(f"{step} is outside what was shown: {'; '.join(map(str, excesses))}")
    learned = learned_movement(library.store, int(skill.movements[nearest_demonstration(skill, start, goal)]))
    plane = "".join(_AXES[axis] for axis in frame.axes[:2])
    generated = generate_at(learned, frame.to_robot(start), frame.to_robot(goal), plane=plane)
    return move(
        generated.movement, robot, space="tip", start=joints, timing="slowed", follow=follow, steps=generated.steps,
        continuous=generated.continuous,
    )  # fmt: skip


class _Stop(NamedTuple):
    """A movement that was stopped on its way."""

    parts: list[Part]  # that were not done; the first is under way
    movement: RobotMovement
    sample: int  # of its trajectory, where the arm stands


class _Way(NamedTuple):
    """Where the arm went in a step."""

    place: str  # at which the step began
    joints: Array  # (m, n)


class _Executor:
    """The state of one execution."""

    def __init__(self, plan: Plan, library: ActionLibrary, world: World, robot: Robot, options: Options) -> None:
        self.plan, self.library, self.world, self.robot, self.options = plan, library, world, robot, options
        self.places = dict(plan.problem.places)  # as they were seen last
        self.attempts: list[Attempt] = []
        self.replans: list[Replan] = []
        self.runs: list[Run] = []
        self.movements: list[RobotMovement] = []
        self.state: dict[str, Any] = {}
        self.ways: list[_Way] = []  # of the steps that were begun
        self.problem = plan.problem  # as it was when the step was planned
        self.left: list[Step] = []  # steps to be done
        self.anchors: dict[str, Array] = {}  # where the objects of the step were seen, or left by the hand

    def run(self, left: int) -> str:
        """Execute, with so many plans and continuations more; return why the goal was not reached, or nothing."""
        self.left, stop = list(self.plan.steps), None
        while True:
            problem, steps = self.look(), self.left
            if lost := self.unseen(steps):
                return f"{first_names(lost, 5)} {'is' if len(lost) == 1 else 'are'} not seen"
            trouble = under_way.trouble_of(problem, steps)
            if trouble is None and not steps:
                return ""
            resumes = False
            if trouble is not None and stop is not None:
                moved = self.moved(
                    [each for part in stop.parts for each in under_way.objects_of(self.problem, part.step)]
                )
                resumes = not moved and under_way.may_go_on(problem, stop.parts[0].step, steps)
            if trouble is not None and not resumes:
                if left == 0:
                    return f"{trouble}; and no plan more was to be made"
                left -= 1
                stop, answer = None, self.plan_anew(problem, trouble)
                if isinstance(answer, str):
                    return answer
                self.left = answer
                continue
            stop = self.attempt(problem, stop if resumes else None)
            last = self.attempts[-1]
            if last.status == "refused" or (last.status == "stopped" and left == 0):
                return f"{last.step} was {last.status}: {first_names(last.reasons, 3)}"
            left -= stop is not None

    def look(self) -> Problem:
        """Return the state now as a problem."""
        self.state = self.sensed()
        problem = problem_of(self.plan.problem.domain, self.state, self.plan.problem.goal, self.places)
        self.places = dict(problem.places)
        return problem

    def sensed(self) -> dict[str, Any]:
        """Return the state now, positions in the frame of the plan."""
        vocabulary = self.plan.problem.domain.vocabulary
        state = state_in(vocabulary, read_state(self.world.state()))
        origin = dict(zip(vocabulary.axes, self.options.frame.origin[self.options.frame.axes].tolist(), strict=True))
        places = [HAND, *vocabulary.items, *vocabulary.fixtures]
        columns = {f"{name}_{axis}": origin[axis] for name in places for axis in vocabulary.axes}
        return state | {name: state[name] - shift for name, shift in columns.items() if name in state}

    def unseen(self, steps: Sequence[Step]) -> list[str]:
        """List the objects of the goal and of the steps whose position is not known."""
        vocabulary = self.plan.problem.domain.vocabulary
        names = {name for goal in self.plan.problem.goal for name in goal.fact[1:]}
        names |= {name for step in steps for name in step.arguments.values()}
        return [
            variable.name for variable in vocabulary.of_kind("item", "fixture")
            if variable.name in names and not np.isfinite(position_of(variable.columns, self.state)).all()
        ]  # fmt: skip

    def moved(self, objects: Sequence[Variable]) -> list[str]:
        """Say which objects are neither at the hand nor where they were seen last beside it."""
        vocabulary = self.plan.problem.domain.vocabulary
        reasons = []
        for variable in objects if self.options.look_rate else ():
            here, hand = position_of(variable.columns, self.state), hand_of(vocabulary, self.state)
            away = float(np.linalg.norm(here - self.anchors.get(variable.name, here)))
            if variable.kind == "item" and np.linalg.norm(here - hand) <= vocabulary.radius:
                self.anchors[variable.name] = here
            elif away > vocabulary.radius:
                reasons.append(f"{variable.name} has moved by {100 * away:.1f} cm")
        return reasons

    def missing(self, steps: Sequence[Step]) -> list[str]:
        """Look at the state, and say which objects are gone, or have moved and these steps need them."""
        self.state = self.sensed()
        objects = [variable for step in steps for variable in under_way.objects_of(self.problem, step)]
        return [f"{name} is not seen" for name in self.unseen(self.left)] + self.moved(objects)

    def unmet(self, step: Step) -> list[str]:
        """Look at the state, and list the preconditions of a step that do not hold, but where the hand is."""
        operator = self.plan.problem.domain.operator(step.operator)
        needed = unmet(self.look().facts, operator, step.arguments)
        return [reason for reason in needed if not reason.removeprefix("(not ").startswith(f"({under_way.HAND_AT} ")]

    def attempt(self, problem: Problem, stop: _Stop | None) -> _Stop | None:
        """Make the movement of the next steps, or the rest of one that was stopped; return where it was stopped."""
        how = "planned" if stop is None else "resumed"
        try:
            if stop is None:
                self.problem = problem
                movement, parts = self.planned(problem)
                how = how if len(parts) == 1 else "joined"
                objects = self.plan.problem.domain.vocabulary.of_kind("item", "fixture")
                self.anchors = {each.name: position_of(each.columns, self.state) for each in objects}
                self.ways.append(_Way(parts[0].place, np.empty((0, self.robot.n_joints))))
            else:
                movement, sent = self.along(stop.movement.trajectory, stop.sample), stop.movement
                shift = sent.trajectory.times[min(stop.sample, len(sent.trajectory) - _LEAST)] - sent.begins
                parts = [part.at(shift, movement.factor) for part in stop.parts]
        except KinemeError as error:
            step = (self.left if stop is None else [part.step for part in stop.parts])[0]
            self.attempts.append(Attempt(str(step), how, "refused", (refusal(error),), len(self.replans)))
            return None
        stop = self.move(how, movement, parts)
        del self.left[: len(parts) - (len(stop.parts) if stop else 0)]
        if stop is None:
            self.options.done(parts[-1].step)
            problem, effects = self.look(), dict[Fact, bool]()
            for part in parts:
                effects = facts_after(effects, problem.domain.operator(part.step.operator), part.step.arguments)
            if missing := under_way.missing_effects(problem, effects):
                self.attempts[-1] = self.attempts[-1]._replace(status="no effect", reasons=tuple(missing))
        return stop

    def planned(self, problem: Problem) -> tuple[RobotMovement, list[Part]]:
        """Return the movement of the next step or, where that is safe and takes no longer, of the next steps."""
        options, joints = self.options, self.world.joints
        parts, overlaps = list[Part](), list[float]()
        for step in self.left[: under_way.n_joinable(problem, self.left) if options.join else 1]:
            try:
                alone = _movement(problem, step, self.library, self.robot, joints, (options.frame, options.follow))
                watcher = options.watcher(step, alone)
            except KinemeError:
                if not parts:
                    raise
                break
            if parts:
                corner = _CORNER * problem.domain.vocabulary.radius
                overlap = under_way.overlap_of(self.robot, parts[-1].alone.trajectory, alone.trajectory, corner)
                if overlap is None:
                    break
                overlaps.append(overlap)
            joints, lasts = alone.trajectory.positions[-1], alone.trajectory.duration - alone.begins
            parts.append(Part(step, under_way.place_of(problem, step, 0), alone, watcher, 0.0, lasts))
        return (self.joined(parts, overlaps) if overlaps else None) or (parts[0].alone, parts[:1])

    def joined(self, parts: Sequence[Part], overlaps: Sequence[float]) -> tuple[RobotMovement, list[Part]] | None:
        """Return the movement of several steps, and when each is made; None where it takes longer or is refused."""
        trajectories = [part.alone.trajectory for part in parts]
        times, positions, steps, begins = under_way.superposed(trajectories, overlaps)
        try:
            movement = self.in_joints(times, positions, steps)
        except KinemeError:
            return None
        if movement.trajectory.duration > sum(trajectory.duration for trajectory in trajectories):
            return None
        begins = [-begin - part.alone.begins for part, begin in zip(parts, begins, strict=True)]
        return movement, [part.at(begin, movement.factor) for part, begin in zip(parts, begins, strict=True)]

    def move(self, how: str, movement: RobotMovement, parts: Sequence[Part] = ()) -> _Stop | None:
        """Execute a movement, of steps or back; return where it was stopped."""
        trajectory = movement.trajectory
        watch = under_way.Watch(movement, parts, self.options, self.missing, self.unmet)
        run = self.world.run(movement, watch)
        self.runs.append(run)
        self.movements.append(movement)
        status, duration = "done" if run.stopped is None else "stopped", float(run.times[-1] - run.times[0])
        stands, times = len(trajectory) - 1, trajectory.times - movement.begins
        if run.stopped is not None:
            passed = (times >= run.stopped - _NEAR) & (times <= run.times[-1])
            away = np.linalg.norm(trajectory.positions - self.world.joints, axis=1)
            stands = int(np.argmin(np.where(passed, away, np.inf)))
        names = " ".join(str(part.step) for part in parts) or "(back)"
        self.attempts.append(
            Attempt(names, how, status, tuple(watch.reasons), len(self.replans), duration, run.tip_error)
        )
        ends = [int(np.searchsorted(times, part.ends)) for part in parts[:-1]]
        done = sum(end <= stands for end in ends)
        watch.finish(done)
        for k, joints in enumerate(np.split(trajectory.positions[: stands + 1], ends[:done]) if parts else ()):
            if k:
                self.ways.append(_Way(parts[k].place, joints))
            else:
                before, first = self.ways[-1], movement.first
                self.ways[-1] = before._replace(joints=np.vstack((before.joints, joints[first:])))
        return None if run.stopped is None else _Stop(list(parts[done:]), movement, stands)

    def along(self, trajectory: JointTrajectory, sample: int) -> RobotMovement:
        """Return the movement along the rest of what was sent before, with what the gripper does there."""
        first = min(sample, len(trajectory) - _LEAST)
        steps = {name: values[first:] for name, values in trajectory.steps.items()}
        return self.in_joints(trajectory.times[first:] - trajectory.times[first], trajectory.positions[first:], steps)

    def in_joints(self, times: Array, positions: Array, steps: Mapping[str, Array] | None = None) -> RobotMovement:
        return move(
            Trajectory(times=times, positions=positions), self.robot, space="joints", timing="slowed",
            start=self.world.joints, steps=steps,
        )  # fmt: skip

    def plan_anew(self, problem: Problem, trouble: str) -> list[Step] | str:
        """Return the steps of a new plan, or why there is none.

        It begins where the arm stands or, where none does, where one of the last steps began: there the arm goes back.
        """
        why, tried = "", set[str]()
        for n_back in range(len(self.ways) + 1):
            there = problem
            if n_back:
                place = self.ways[-n_back].place
                if place in tried or place not in problem.places:
                    continue
                tried.add(place)
                there = under_way.with_hand(problem, place)
            try:
                plan = self.options.replan(there)
            except KinemeError as error:
                why = why or str(error)
                continue
            if n_back and not self.goes_back(n_back):
                return f"{trouble}; and the way back was {self.attempts[-1].status}: {self.attempts[-1].reasons[0]}"
            self.replans.append(Replan(trouble, tuple(map(str, plan.steps))))
            return list(plan.steps)
        return f"{trouble}; {why}"

    def goes_back(self, n_steps: int) -> bool:
        """Go back to where the last steps began, the way they came, at a constant share of the limits of velocity."""
        way = np.vstack([each.joints for each in self.ways[-n_steps:]])[::-1]
        del self.ways[-n_steps:]
        lengths = np.append(0.0, np.linalg.norm(np.diff(way, axis=0) / self.robot.velocity, axis=1).cumsum())
        n = int(lengths[-1] / _APART) + 1
        if n < _LEAST:
            return True
        even, moves = np.linspace(0.0, lengths[-1], n), np.append(True, np.diff(lengths) > 0)
        joints = np.column_stack([np.interp(even, lengths[moves], column) for column in way[moves].T])
        try:
            movement = self.in_joints(even / _SHARE, joints)
        except KinemeError as error:
            self.attempts.append(Attempt("(back)", "back", "refused", (refusal(error),), len(self.replans)))
            return False
        return self.move("back", movement) is None


def refusal(error: KinemeError) -> str:
    """Return the words of an error with the options that there are here: the place is given by the plan."""
    return _MILLIMETERS.sub(_METERS, _ELSEWHERE.sub(_HERE, str(error)))

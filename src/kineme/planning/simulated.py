"""A plan's world in MuJoCo: its objects where the plan has them, flags that its steps change, and disturbances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.planning.execution import refusal
from kineme.planning.plan import Plan, Step
from kineme.planning.problem import facts_after
from kineme.planning.under_way import frame_of
from kineme.planning.vocabulary import Fact, Vocabulary
from kineme.robots.kinematics.descent import InverseKinematics, point_in_words, reaching_postures
from kineme.robots.simulation import Simulation

_FORM = "push:FX,FY,FZ@SECONDS, OBJECT:X,Y,Z@SECONDS or OBJECT:gone@SECONDS"


def simulation_of(
    plan: Plan,
    robot: Any,
    noise: float = 0.0,
    seed: int = 0,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    follow: str = "full",
) -> Simulation:
    """Return the world in which a plan begins: its objects at its places, the hand where the first step begins.

    `origin` (3,) is that of the plan in the frame of the robot [m], and `follow` how much of the orientation, as in
    `execute`.

    Raises `SpecificationError`: a first place out of reach.
    """
    problem = plan.problem
    frame, vocabulary = frame_of(plan, origin), problem.domain.vocabulary
    places = {name: frame.to_robot(place) for name, place in problem.places.items()}
    objects = {name: places[name] for name in vocabulary.fixtures if name in places}
    objects |= {fact[1]: places[fact[2]] for fact, value in problem.facts.items() if value and fact[0] == "in"}
    joints = robot.rest
    if plan.steps and plan.steps[0].start:
        ik, position = InverseKinematics(robot, follow), frame.to_robot(np.array(plan.steps[0].start))
        what = f"the place where the plan begins, {point_in_words(position)} m"
        try:
            reached = reaching_postures(robot, position, ik.tip_rotation, ik.costs, what)
        except TrajectoryError as error:
            raise SpecificationError(refusal(error)) from None
        joints = reached[int(np.argmin(np.abs(reached - joints).max(axis=1)))]  # the nearest, turned as at rest
    held = [fact[1] for fact, value in problem.facts.items() if value and fact[0] == "holding"]
    tip = Simulation(robot, start=joints).state()
    objects |= dict.fromkeys(held, np.array([tip[f"tip_{axis}"] for axis in "xyz"]))
    gripper = next(iter(vocabulary.of_kind("gripper")), None)
    middle = 0.5 if gripper is None else gripper.threshold
    sign = -1.0 if vocabulary.closed_above is False else 1.0
    half = sign * max(abs(middle), 0.5)  # either level is on its side of the threshold
    simulation = Simulation(
        robot, objects, gripper="gripper" if gripper is None else gripper.columns[0],
        opening=(middle - half, middle + half), flags=_flags(vocabulary, problem.facts), noise=noise,
        seed=seed, start=joints,
    )  # fmt: skip
    simulation.grip(bool(held))
    return simulation


def assume_flags(simulation: Simulation, plan: Plan) -> Callable[[Step], None]:
    """Return what sets the flags of a simulation as the effects of a step say: nothing else there changes them."""
    domain = plan.problem.domain

    def assume(step: Step) -> None:
        effects = facts_after({}, domain.operator(step.operator), step.arguments)
        simulation.flags.update(_flags(domain.vocabulary, effects))

    return assume


def _flags(vocabulary: Vocabulary, facts: Mapping[Fact, bool]) -> dict[str, Any]:
    """Return the values of the columns of flags and words that facts tell."""
    values: dict[str, Any] = {}
    for variable in vocabulary.of_kind("flag", "word"):
        owner, column = (variable.owner,) if variable.owner else (), variable.columns[0]
        if variable.kind == "word":
            words = [word for word in variable.words if facts.get((f"{variable.name}-{word}", *owner))]
            values |= dict.fromkeys([column] * len(words), next(iter(words), None))
            continue
        value = facts.get((variable.name, *owner))
        if value is not None:
            half = max(abs(variable.threshold), 0.5)
            levels = variable.levels or (variable.threshold - half, variable.threshold + half)
            values[column] = (variable.words or levels)[value]
    return values


def disturb(simulation: Simulation, disturbances: Sequence[str]) -> None:
    """Schedule disturbances: ``push:0,30,0@1.5`` [N], ``cup:0.4,0.1,0.2@3`` [m], ``cup:gone@3``, each at its time [s].

    Raises `SpecificationError`: a text of another form, or an object that is not there.
    """
    for text in disturbances:
        rest, _, seconds = text.rpartition("@")
        name, _, what = rest.rpartition(":")
        try:
            at = float(seconds)
            values = None if what == "gone" else [float(number) for number in what.split(",")]
            if not name or (values is not None and len(values) != 3):
                raise ValueError
        except ValueError:
            raise SpecificationError(f"expected a disturbance as {_FORM}, got {text!r:.80}") from None
        if values is None:
            simulation.remove(name, at)
        elif name == "push":
            simulation.push(values, at)
        else:
            simulation.place(name, values, at)

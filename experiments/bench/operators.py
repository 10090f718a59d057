"""Operators learned from states of generated worlds whose true operators are known, and plans for problems held out.

A world has fixtures, items, a gripper and flags, and nine true operators with preconditions. It is shown in sessions:
things stand elsewhere in each, the sensor of positions has noise, that of flags errs. Problems that were not shown are
planned with what was learned, and each plan is executed in the world itself: an operator whose true preconditions do
not hold fails, and ends it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from bench.rows import Row
from kineme.cli.operators import write_domain
from kineme.errors import KinemeError
from kineme.planning.domain import Domain
from kineme.planning.operators import operators_of
from kineme.planning.plan import Plan, find_plan
from kineme.planning.problem import problem_of
from kineme.planning.states import HAND, States
from kineme.planning.vocabulary import facts_of, places_of

AXES = ("x", "y", "z")
WORLDS, SESSIONS, STEPS, PROBLEMS = 100, (10, 20, 40), 12, 1
_NOISE, _MISREAD = 0.004, 0.01  # of positions [m]; of flags, share
_JITTER = 0.03  # of where things stand in a session [m]
_REACH = 0.015  # how far the hand stops from where it goes to [m]
_LONG = 8  # steps of the plan that a cold shell makes
_WALK = 10  # true operators that lead from a problem's start to its goal
_FIRST = 9_000  # seed of the first world; what was chosen was chosen on others


@dataclass
class World:
    """A world as it is: where things are, and what holds."""

    fixtures: dict[str, np.ndarray]
    items: dict[str, str | None]  # item -> the fixture that it stands at; None in the hand
    hand: str  # fixture or "home" that the hand is at
    home: np.ndarray
    flags: dict[str, bool]
    rules: dict[str, bool] = field(default_factory=dict)  # which of the extra preconditions this world has

    @property
    def held(self) -> str | None:
        """Item in the hand."""
        return next((item for item, at in self.items.items() if at is None), None)

    def at(self, place: str) -> list[str]:
        """Items at a place."""
        return [item for item, where in self.items.items() if where == place]

    def position(self, place: str) -> np.ndarray:
        """Position of a place."""
        return self.home if place == "home" else self.fixtures[place]


def _reach(world: World, to: str) -> bool:
    return (
        world.held is None
        and to != world.hand
        and not (world.rules["doors stop reaching"] and world.flags["door_open"])
    )


def _grasp(world: World) -> bool:
    return world.held is None and len(world.at(world.hand)) == 1


def _carry(world: World, to: str) -> bool:
    return world.held is not None and to not in (world.hand, "home")


def _release(world: World) -> bool:
    return world.held is not None and world.hand != "home" and not world.at(world.hand)


def _fill(world: World) -> bool:
    held = world.held
    return held is not None and world.hand == "tap" and not world.flags[f"{held}_full"] and not world.at("tap")


def _pour(world: World) -> bool:
    held, there = world.held, world.at(world.hand)
    return held is not None and len(there) == 1 and world.flags[f"{held}_full"] and not world.flags[f"{there[0]}_full"]


def _press(world: World) -> bool:
    return world.held is None and world.hand == "stove" and not world.flags["stove_on"]


def _open(world: World) -> bool:
    return world.held is None and world.hand == "cabinet" and not world.flags["door_open"]


def _close(world: World) -> bool:
    return world.held is None and world.hand == "cabinet" and world.flags["door_open"]


#: Operator -> (whether it goes somewhere, its true precondition).
TRUE: dict[str, tuple[bool, Callable[..., bool]]] = {
    "reach": (True, _reach), "grasp": (False, _grasp), "carry": (True, _carry), "release": (False, _release),
    "fill": (False, _fill), "pour": (False, _pour), "press": (False, _press), "open": (False, _open),
    "close": (False, _close),
}  # fmt: skip


def act(world: World, name: str, to: str | None) -> bool:
    """Do a true operator; False, and nothing happens, where its preconditions do not hold."""
    goes, possible = TRUE[name]
    if not (possible(world, to) if goes else possible(world)):
        return False
    held, there = world.held, world.at(world.hand)
    if goes:
        world.hand = str(to)
    elif name == "grasp":
        world.items[there[0]] = None
    elif name == "release":
        world.items[str(held)] = world.hand
    elif name == "fill":
        world.flags[f"{held}_full"] = True
    elif name == "pour":
        world.flags[f"{held}_full"], world.flags[f"{there[0]}_full"] = False, True
    elif name == "press":
        world.flags["stove_on"] = True
    else:
        world.flags["door_open"] = name == "open"
    return True


def drawn(random: np.random.Generator, layout: World | None = None) -> World:
    """Draw a world or, of a layout, the same world in another session."""
    if layout is None:
        names = ["tap", "stove", "cabinet", "shelf", "table", "rack"][: int(random.integers(4, 7))]
        grid = random.permutation(9)[: len(names)]
        fixtures = {
            name: np.array([0.35 * (k % 3), 0.35 * (k // 3), 0.1 * (k % 2)])
            for name, k in zip(names, grid, strict=True)
        }
        items = [f"{kind}{k}" for kind in ("cup", "bowl") for k in (1, 2)][: int(random.integers(2, 5))]
        rules = {"doors stop reaching": bool(random.random() < 0.5)}
        home = np.array([0.35, -0.4, 0.3])
    else:
        names, items, rules = [*layout.fixtures], [*layout.items], layout.rules
        fixtures = {name: where + random.normal(0, _JITTER, 3) for name, where in layout.fixtures.items()}
        home = layout.home
    at = (
        random.choice(names, len(items), replace=False)
        if len(items) <= len(names)
        else random.choice(names, len(items))
    )
    flags = {f"{item}_full": bool(random.random() < 0.3) for item in items}
    flags |= {"stove_on": bool(random.random() < 0.3), "door_open": False}
    return World(fixtures, dict(zip(items, map(str, at), strict=True)), "home", home, flags, rules)


def possible_acts(world: World) -> list[tuple[str, str | None]]:
    """List the true operators that can be done now."""
    acts: list[tuple[str, str | None]] = []
    for name, (goes, possible) in TRUE.items():
        if goes:
            acts += [(name, to) for to in world.fixtures if possible(world, to)]
        elif possible(world):
            acts.append((name, None))
    return acts


def chosen(random: np.random.Generator, world: World) -> tuple[str, str | None]:
    """Draw one of them, rare ones as often as frequent ones."""
    acts = possible_acts(world)
    names = sorted({name for name, _ in acts})
    name = names[int(random.integers(len(names)))]
    ways = [each for each in acts if each[0] == name]
    return ways[int(random.integers(len(ways)))]


def columns_of(world: World) -> list[str]:
    objects = [HAND, *world.fixtures, *world.items]
    return [f"{name}_{axis}" for name in objects for axis in AXES] + ["gripper", *world.flags]


def sensed(world: World, hand: np.ndarray, random: np.random.Generator | None) -> np.ndarray:
    """Return a state as sensors tell it; without `random`, as it is."""
    rests = np.array([0.04, 0.0, 0.0])  # of an item beside the middle of its fixture
    items = [hand if at is None else world.position(at) + rests for at in world.items.values()]
    where = [hand, *world.fixtures.values(), *items]
    flags = np.array([world.held is not None, *world.flags.values()], dtype=float)
    positions = np.concatenate(where)
    if random is not None:
        positions = positions + random.normal(0, _NOISE, len(positions))
        flags = np.where(random.random(len(flags)) < _MISREAD, 1 - flags, flags)
    return np.concatenate((positions, flags))


def shown(random: np.random.Generator, layout: World, sessions: int) -> States:
    """Demonstrate a world: sessions of true operators one after the other."""
    before, after, symbols = [], [], []
    for _ in range(sessions):
        world = drawn(random, layout)
        hand = world.position(world.hand) + random.normal(0, _REACH / 2, 3)
        for _ in range(STEPS):
            name, to = chosen(random, world)
            before.append(sensed(world, hand, random))
            act(world, name, to)
            hand = world.position(world.hand) + random.normal(0, _REACH / 2, 3)
            after.append(sensed(world, hand, random))
            symbols.append(name)
    columns = tuple(columns_of(layout))
    return States(np.arange(len(symbols)), tuple(symbols), AXES, columns, np.array(before), np.array(after), {})


def problem(random: np.random.Generator, layout: World) -> tuple[World, str]:
    """Draw a state, and as goal one to three facts that a walk of true operators changed."""
    while True:
        world = drawn(random, layout)
        end = World(world.fixtures, dict(world.items), world.hand, world.home, dict(world.flags), world.rules)
        for _ in range(_WALK):
            act(end, *chosen(random, end))
        facts = [f"(in {item} {at})" for item, at in end.items.items() if at is not None and at != world.items[item]]
        for name, value in end.flags.items():
            if value != world.flags[name]:
                item, _, flag = name.rpartition("_")
                text = f"({flag} {item})" if item in end.items or item in end.fixtures else f"({name})"
                facts.append(text if value else f"(not {text})")
        if facts:
            some = random.permutation(len(facts))[:3]
            return world, f"(and {' '.join(facts[k] for k in some)})"


def executed(plan: Plan, world: World, goal: str, domain: Domain) -> tuple[bool, bool]:
    """Execute a plan in the world itself; return whether it reaches the goal, and stays within what was shown."""
    within = True
    for step in plan.steps:
        operator = domain.operator(step.operator)
        for parameter in operator.places:
            where = plan.problem.places[step.arguments[parameter.name]]
            slack = domain.vocabulary.radius
            within &= bool(
                np.all(where >= np.array(parameter.low) - slack) and np.all(where <= np.array(parameter.high) + slack)
            )
        if not act(world, step.operator, step.arguments.get("to")):
            return False, within
    state = state_of(world)
    return all(goal_holds(domain, state, each) for each in plan.problem.goal), within


def state_of(world: World) -> dict[str, float]:
    return dict(zip(columns_of(world), sensed(world, world.position(world.hand), None).tolist(), strict=True))


def goal_holds(domain: Domain, state: dict[str, float], goal: Any) -> bool:
    places = places_of(domain.vocabulary, [state])
    return facts_of(domain.vocabulary, state, places).get(goal.fact) is goal.value


def cold_shell() -> tuple[float, int]:
    """Seconds from the start of ``kineme plan`` to its end, least of five, and how many steps it planned."""
    for number in range(WORLDS):
        random = np.random.default_rng(_FIRST + number)
        layout = drawn(random)
        states = shown(random, layout, max(SESSIONS))
        domain = operators_of(states, np.full(len(states), 2.0), {}, error_rate=0.02)
        world, goal = problem(random, layout)
        try:
            steps = len(find_plan(problem_of(domain, state_of(world), goal), timeout=20.0))
        except KinemeError:
            continue
        if steps >= _LONG:
            break
    with tempfile.TemporaryDirectory() as folder:
        write_domain(domain, Path(folder) / "world.pddl", "pddl")
        state = state_of(world)
        lines = [",".join(state), ",".join(map(repr, state.values()))]
        (Path(folder) / "now.csv").write_text("\n".join(lines))
        command = [sys.executable, "-m", "kineme", "plan", "world.pddl", "--state", "now.csv", "--goal", goal]
        took = []
        for _ in range(5):
            start = perf_counter()
            subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
            took.append(perf_counter() - start)
    return min(took), steps


def measure(quick: bool) -> list[Row]:
    took, steps = cold_shell()
    rows = [
        Row(
            f"a plan of {_LONG} steps or more from a cold shell",
            "s",
            took,
            target=("<=", 5.0),
            details={"steps": steps},
        )
    ]
    worlds = 5 if quick else WORLDS
    for sessions in (10,) if quick else SESSIONS:
        counts: dict[str, int] = dict.fromkeys(("solved", "no plan", "failed", "outside"), 0)
        learning, planning, total = 0.0, [], 0
        for number in range(worlds):
            random = np.random.default_rng(_FIRST + number)
            layout = drawn(random)
            states = shown(random, layout, sessions)
            begin = process_time()
            domain = operators_of(states, np.full(len(states), 2.0), {}, error_rate=0.02)
            learning += process_time() - begin
            for _ in range(PROBLEMS):
                world, goal = problem(random, layout)
                total += 1
                start = perf_counter()
                try:
                    plan = find_plan(problem_of(domain, state_of(world), goal), timeout=20.0)
                except KinemeError:
                    counts["no plan"] += 1
                    continue
                planning.append(perf_counter() - start)
                reached, within = executed(plan, world, goal, domain)
                counts["solved" if reached else "failed"] += 1
                counts["outside"] += not within
        shown_as = f"{sessions} sessions of {STEPS} movements"
        full = sessions == max(SESSIONS)
        rows += [
            Row(f"{shown_as}: problems solved", "share", counts["solved"] / total,
                target=(">=", 0.95) if full else None, details=counts),
            Row(f"{shown_as}: plans that fail in the world", "share", counts["failed"] / total),
            Row(f"{shown_as}: plans outside what was shown", "share", counts["outside"] / total, target=("<=", 0.0)),
            Row(f"{shown_as}: learned, processor", "s", learning / worlds),
            Row(f"{shown_as}: planned, median, wall", "s", float(np.median(planning))),
        ]  # fmt: skip
    return rows

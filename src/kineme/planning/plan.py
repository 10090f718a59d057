"""Plans: a planner's steps as places that the hand goes to, their checks, and what keeps a goal from being reached.

For the latter, operators are applied as if nothing were ever undone (the delete relaxation: B. Bonet and H. Geffner,
"Planning as Heuristic Search", Artificial Intelligence 129, 2001): what is not reached so is reached by no plan.
"""

from __future__ import annotations

import itertools
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError, SpecificationError
from kineme.io.records import needs
from kineme.planning import domain as domains
from kineme.planning.pddl import Names, domain_to_pddl, name_of, problem_to_pddl
from kineme.planning.problem import Goal, Problem, facts_after, ground, shown_arguments, unmet
from kineme.planning.vocabulary import Fact
from kineme.reporting.text import first_names
from kineme.validation import Array, check_form, check_number

FORMAT, VERSION = "kineme-plan", 1
_TRIED = 500  # operators with arguments that are looked at for why a goal is not reached
_COMPUTED = ("start", "goal", "duration")  # of a step, by its places and its operator
_DEEPEST = 6  # operators one before the other that this names


class Step(NamedTuple):
    """One action of a plan."""

    operator: str
    arguments: dict[str, str]  # parameter -> place or item
    start: tuple[float, ...]  # of the hand, at the place where it begins; empty of operators without places
    goal: tuple[float, ...]
    duration: float  # [s]

    def __str__(self) -> str:
        return f"({' '.join((self.operator, *self.arguments.values()))})"


@dataclass(frozen=True, eq=False)
class Plan:
    """Steps from the state now to a goal."""

    problem: Problem
    steps: tuple[Step, ...]
    planner: str

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def duration(self) -> float:
        """Sum of the durations of the steps [s]."""
        return sum(step.duration for step in self.steps)


def find_plan(problem: Problem, planner: str | None = None, timeout: float = 30.0) -> Plan:
    """Find a plan by a planner of unified-planning, and check each of its steps.

    - `planner`: name of an engine that is installed, as "aries" or "fast-downward"; by default one that takes the
      problem as it is, else one that takes it without costs and negative preconditions.
    - `timeout`: [s], of all that is tried together; half of it with costs.

    Raises `SpecificationError`: there is no plan, with the goals that no order of operators reaches; or a step depends
    on what is not known. Raises `DataError`: the extra ``planner`` is not installed, no engine takes the problem, or
    none finds a plan in time.
    """
    check_number("timeout", timeout, least=0.1)
    if all(problem.facts.get(goal.fact) is goal.value for goal in problem.goal):
        return Plan(problem, (), "no planner")
    shown = shown_arguments(problem)
    if missing := unreachable(problem, shown):
        raise SpecificationError(
            f"expected a goal that operators reach within what was shown; {_because(missing, problem)}"
        )
    true = [fact for fact, value in problem.facts.items() if value]
    texts = (
        domain_to_pddl(problem.domain),
        problem_to_pddl(
            problem.domain, problem.objects, true, problem.goal,
            [(operator.name, tuple(arguments.values())) for operator, arguments in shown],
        ),
    )  # fmt: skip
    actions, engine = _solved(texts, planner, timeout)
    names = Names(problem.domain, problem.objects)
    steps = []
    for name, objects in actions:
        operator = problem.domain.operator(name_of(name, names.operators, "an operator"))
        chosen = [name_of(text, names.objects, "an object") for text in objects]
        arguments = dict(zip((parameter.name for parameter in operator.parameters), chosen, strict=True))
        steps.append(step_of(operator, arguments, problem.places))
    plan = Plan(problem, tuple(steps), engine)
    check_plan(plan)
    return plan


def step_of(operator: domains.Operator, arguments: dict[str, str], places: Mapping[str, Array]) -> Step:
    """Return an operator with arguments as a step: where the hand begins and ends."""
    ends = domains.hands_of(operator, arguments, places)
    start, goal = ((), ()) if ends is None else (tuple(ends[0].tolist()), tuple(ends[1].tolist()))
    return Step(operator.name, arguments, start, goal, operator.duration)


def _solved(texts: tuple[str, str], planner: str | None, timeout: float) -> tuple[list[tuple[str, list[str]]], str]:
    """Return the actions of a plan and the name of the engine that found it."""
    with needs("unified-planning", "find plans", "planner"):
        from unified_planning.io import PDDLReader
        from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    problem = PDDLReader().parse_problem_string(*texts)
    simple = problem.clone()
    simple.clear_quality_metrics()
    failures: list[str] = []
    end = monotonic() + timeout
    for candidate, compiles in ((problem, False), (simple, False), (simple, True)):
        left = max(0.1, end - monotonic())
        # Engines warn of options that they do not know, and of processes that they leave to be collected.
        with warnings.catch_warnings(), tempfile.TemporaryFile("w") as log:
            warnings.simplefilter("ignore")
            result = _tried(candidate, compiles, planner, left if compiles else 0.5 * left, log)
        if isinstance(result, str):
            failures.append(result)
            continue
        plan, name = result
        return [(each.action.name, [str(value) for value in each.actual_parameters]) for each in plan.actions], name
    raise DataError(
        f"expected a plan, got none ({first_names(failures, 3)}); look at the preconditions of the operators, give "
        "more time, or install another planner of unified-planning, as up-aries"
    )


def _tried(problem: Any, compiles: bool, planner: str | None, timeout: float, log: Any) -> tuple[Any, str] | str:
    """Return the plan of an engine and its name, or why there is none; `compiles`: without negative preconditions."""
    from unified_planning.engines import CompilationKind, PlanGenerationResultStatus
    from unified_planning.exceptions import UPException, UPNoRequestedEngineAvailableException
    from unified_planning.plans import PlanKind
    from unified_planning.shortcuts import Compiler, OneshotPlanner, PlanValidator, get_environment

    task, back = problem, None
    try:
        if compiles:
            kind = CompilationKind.NEGATIVE_CONDITIONS_REMOVING
            with Compiler(problem_kind=problem.kind, compilation_kind=kind) as compiler:
                compiled = compiler.compile(problem, kind)
            task, back = compiled.problem, compiled.map_back_action_instance
        with OneshotPlanner(**({"problem_kind": task.kind} if planner is None else {"name": planner})) as engine:
            name = str(engine.name)
            if not engine.supports(task.kind):
                return f"{name} does not take it"
            result = engine.solve(task, timeout=timeout, output_stream=log)
    except UPNoRequestedEngineAvailableException:
        if planner is None:
            return "there is no engine that takes it"
        factory = get_environment().factory
        names = [name for name in factory.engines if factory.engine(name).is_oneshot_planner()]
        raise DataError(
            f"expected the name of a planner that is installed, one of {', '.join(names)}, got {planner!r}"
        ) from None
    except UPException as error:
        return f"{error}".partition("\n")[0]
    if result.plan is None:
        if result.status == PlanGenerationResultStatus.UNSOLVABLE_PROVEN:
            raise SpecificationError("expected a plan, there is none; look at the preconditions of the operators")
        return f"{name} found none within {timeout:g} s"
    plan = result.plan if back is None else result.plan.replace_action_instances(back)
    if plan.kind != PlanKind.SEQUENTIAL_PLAN:
        plan = plan.convert_to(PlanKind.SEQUENTIAL_PLAN, problem)
    with PlanValidator(name="sequential_plan_validator") as validator:
        if not validator.validate(problem, plan):
            return f"{name} gave a plan that is not valid"
    return plan, name


def check_plan(plan: Plan) -> None:
    """Refuse a plan that misses its goal, or with a step that is not known to be possible or was not shown so."""
    domain, facts = plan.problem.domain, dict(plan.problem.facts)
    for number, step in enumerate(plan.steps, 1):
        operator = domain.operator(step.operator)
        reasons = unmet(facts, operator, step.arguments) + domains.is_shown(
            domain, operator, step.arguments, plan.problem.places
        )
        if reasons:
            raise SpecificationError(
                f"expected steps that can be done, step {number} {step} cannot: {_because(reasons, plan.problem)}"
            )
        facts = facts_after(facts, operator, step.arguments)
    if missed := [str(goal) for goal in plan.problem.goal if facts.get(goal.fact) is not goal.value]:
        raise SpecificationError(f"expected a plan that reaches its goal, it misses {', '.join(missed)}")


def _because(reasons: Sequence[str], problem: Problem) -> str:
    return "; ".join((*reasons, *problem.notes))


def plan_to_dict(plan: Plan) -> dict[str, Any]:
    """Return a plan with its problem and domain as plain data that JSON can hold; `plan_from_dict` reads it."""
    problem = plan.problem
    return {
        "format": FORMAT,
        "version": VERSION,
        "planner": plan.planner,
        "duration": plan.duration,
        "steps": [step._asdict() | {"start": [*step.start], "goal": [*step.goal]} for step in plan.steps],
        "goal": [{"fact": [*goal.fact], "value": goal.value} for goal in problem.goal],
        "places": {name: where.tolist() for name, where in problem.places.items()},
        "facts": [{"fact": [*fact], "value": value} for fact, value in problem.facts.items()],
        "domain": domains.domain_to_dict(problem.domain),
    }


def plan_from_dict(data: Any) -> Plan:
    """Return the plan of `plan_to_dict`, checked.

    Raises `DataError`: anything else, a plan of a later version, or steps that do not fit its places. Raises
    `SpecificationError`: a step that cannot be done; see `check_plan`.
    """
    check_form(data, "plan", FORMAT, VERSION)
    try:
        domain = domains.domain_from_dict(data["domain"])
        places = {str(name): np.array(where, dtype=np.float64) for name, where in data["places"].items()}
        domains.check_positions(domain.vocabulary.axes, places.values())
        facts = {tuple(map(str, each["fact"])): bool(each["value"]) for each in data["facts"]}
        goals = tuple(Goal(tuple(map(str, each["fact"])), bool(each["value"])) for each in data["goal"])
        rows = [(domain.operator(step["operator"]), dict(step["arguments"])) for step in data["steps"]]
        steps = tuple(step_of(operator, arguments, places) for operator, arguments in rows)
        told = [{name: np.array(each[name], float) for name in _COMPUTED if name in each} for each in data["steps"]]
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise DataError(
            f"expected a complete plan, got one that does not fit ({type(error).__name__}: {error})"
        ) from error
    plan = Plan(Problem(domain, places, facts, goals), steps, str(data.get("planner", "")))
    for number, (step, values) in enumerate(zip(steps, told, strict=True), 1):
        for name, value in values.items():
            own = np.array(getattr(step, name))
            if own.shape != value.shape or not np.allclose(value, own, rtol=1e-6, atol=1e-9):
                raise DataError(
                    f"expected the {name} {own.tolist()} of step {number} {step}, as its places and its operator say, "
                    f"got {value.tolist()}; change places, or plan again"
                )
    check_plan(plan)
    return plan


def read_plan(path: str | Path) -> Plan:
    """Return the plan in a JSON file; see `plan_from_dict`."""
    return plan_from_dict(domains.read_json(path, "plan"))


def unreachable(problem: Problem, shown: Sequence[tuple[domains.Operator, dict[str, str]]]) -> list[str]:
    """Say which goals no order of the operators reaches even if nothing were ever undone, and what is missing."""
    possible = {*problem.facts.items()}
    left = list(shown)
    while ready := [pair for pair in left if possible.issuperset(ground(pair[0].preconditions, pair[1]))]:
        done = {*map(id, ready)}
        left = [pair for pair in left if id(pair) not in done]
        possible |= {each for operator, arguments in ready for each in ground(operator.effects, arguments)}
    return [
        f"{goal} {_why_not(problem, goal, possible, left, _DEEPEST)}" for goal in problem.goal if goal not in possible
    ]


def _why_not(
    problem: Problem,
    goal: Goal,
    possible: set[tuple[Fact, bool]],
    left: Sequence[tuple[domains.Operator, dict[str, str]]],
    depth: int,
) -> str:
    """Say what keeps operators from reaching a fact: what was not shown, what is not known, or what they lack."""
    ways = [pair for pair in left if goal in ground(pair[0].effects, pair[1])]
    is_told = not ways and goal.fact in problem.facts  # then what was not shown is the reason, whatever else is missing
    if reason := _not_shown(problem, goal, possible, len(problem.facts) if is_told else 0):
        return reason
    if not ways or not depth:
        state = "is not known" if goal.fact not in problem.facts else "does not hold now"
        effects = {each[::2] for operator in problem.domain.operators if operator.usable for each in operator.effects}
        is_changed = (goal.fact[0], goal.value) in effects
        return state if is_changed else f"{state}, and no operator that was shown changes that"
    needs_of = [ground(operator.preconditions, arguments) for operator, arguments in ways]
    lacking = [[Goal(*each) for each in literals if each not in possible] for literals in needs_of]
    k = min(range(len(ways)), key=lambda k: len(lacking[k]))
    others = [pair for pair in left if pair[0] is not ways[k][0]]  # no round trips
    first = min(lacking[k], key=lambda each: each.fact in problem.facts)  # what is not known comes first
    name = f"({' '.join((ways[k][0].name, *ways[k][1].values()))})"
    reason = _why_not(problem, first, possible, others, depth - 1)
    return f"needs {name}; {Goal(first.fact) if reason.startswith('is not known') else first} {reason}"


def _not_shown(problem: Problem, goal: Goal, possible: set[tuple[Fact, bool]], lacking_most: int) -> str:
    """Name an operator that would reach a fact from here, and why its arguments lie outside what was shown."""
    of_type = problem.of_type
    reasons = []
    for operator in problem.domain.operators:
        names = [parameter.name for parameter in operator.parameters]
        for literal in operator.effects if operator.usable else ():
            if (literal.predicate, literal.value) != (goal.fact[0], goal.value):
                continue
            fixed = dict(zip(literal.arguments, goal.fact[1:], strict=True))
            choices = [[fixed[p.name]] if p.name in fixed else of_type[p.type] for p in operator.parameters]
            for chosen in itertools.islice(itertools.product(*choices), _TRIED):
                arguments = dict(zip(names, chosen, strict=True))
                lacking = sum(each not in possible for each in ground(operator.preconditions, arguments))
                if len({*chosen}) == len(chosen) and lacking <= lacking_most:
                    outside = domains.is_shown(problem.domain, operator, arguments, problem.places)
                    text = f"({' '.join((operator.name, *chosen))}) was not shown so: {first_names(outside, 2)}"
                    reasons += [(lacking, len(outside), text)] if outside else []
    return f"is not reached, since {min(reasons)[2]}" if reasons else ""

"""What keeps a goal from being reached: what was not shown, what is not known, or what operators lack.

Operators are applied as if nothing were ever undone (the delete relaxation: B. Bonet and H. Geffner, "Planning as
Heuristic Search", Artificial Intelligence 129, 2001): what is not reached so is reached by no plan.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from kineme.planning.domain import Operator, is_shown
from kineme.planning.problem import Goal, Problem, ground
from kineme.planning.vocabulary import Fact
from kineme.reporting.text import first_names

_TRIED = 500  # operators with arguments that are looked at for why a goal is not reached
_DEEPEST = 6  # operators one before the other that this names


def unreachable(problem: Problem, shown: Sequence[tuple[Operator, dict[str, str]]]) -> list[str]:
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
    left: Sequence[tuple[Operator, dict[str, str]]],
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
                    outside = is_shown(problem.domain, operator, arguments, problem.places)
                    text = f"({' '.join((operator.name, *chosen))}) was not shown so: {first_names(outside, 2)}"
                    reasons += [(lacking, len(outside), text)] if outside else []
    return f"is not reached, since {min(reasons)[2]}" if reasons else ""

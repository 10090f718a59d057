"""Problems: the state now in the words of a domain, and a goal; operators with the arguments that were shown."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import SpecificationError
from kineme.planning.domain import Domain, Literal, Operator, is_shown
from kineme.planning.pddl import Names, literals_of, name_of, parsed, read_problem
from kineme.planning.states import State
from kineme.planning.vocabulary import Fact, facts_of, places_of, position_of, predicates_of, state_in, value_notes
from kineme.validation import Array, as_point

_MOST_GROUND = 200_000  # operators with arguments, at most


class Goal(NamedTuple):
    """A fact that is to be true, or false."""

    fact: Fact
    value: bool = True

    def __str__(self) -> str:
        text = f"({' '.join(self.fact)})"
        return text if self.value else f"(not {text})"


@dataclass(frozen=True, eq=False)
class Problem:
    """The state now, in a domain's words, and a goal."""

    domain: Domain
    places: Mapping[str, Array]  # (k,) each
    facts: Mapping[Fact, bool]  # what is not among them is not known
    goal: tuple[Goal, ...]
    notes: tuple[str, ...] = ()  # values of the state that count as not known

    @property
    def objects(self) -> dict[str, str]:
        """Name -> "place" or "item"."""
        return dict.fromkeys(self.places, "place") | dict.fromkeys(self.domain.vocabulary.items, "item")

    @property
    def of_type(self) -> dict[str, list[str]]:
        """Names of the places, and of the items."""
        return {"place": [*self.places], "item": list(self.domain.vocabulary.items)}


def problem_of(
    domain: Domain, state: State, goal: str | Iterable[Goal], places: Mapping[str, Any] | None = None
) -> Problem:
    """Return a problem.

    - `state`: the state now, in the columns of the states that the domain was learned from; numbers and words. A head
      may say another unit, ``cup_x [mm]``; without one, the numbers are in that of these states.
    - `goal`: facts, or a conjunction of literals in PDDL, as ``(and (in cup shelf) (not (full cup)))``.
    - `places`: positions (k,) of more places, by name.

    Raises `SpecificationError`: names that the domain does not have, or a place without a position.
    """
    named = {name: np.array(where) for name, where in domain.places.items()}
    for name, where in (places or {}).items():
        named[name] = as_point(f"the place {name}", where, domain.vocabulary.axes)
    state = state_in(domain.vocabulary, state)
    at = _places_now(domain, state, named)
    problem = Problem(
        domain, at, facts_of(domain.vocabulary, state, at), (), tuple(value_notes(domain.vocabulary, state))
    )
    if isinstance(goal, str):
        return replace(problem, goal=_goals(problem, literals_of(parsed(goal))))
    goals = tuple(goal)
    _check_goals(problem, goals)
    return replace(problem, goal=goals)


def problem_from_pddl(domain: Domain, text: str, state: State | None = None) -> Problem:
    """Return the problem in a text of PDDL, with the facts that it lists, at the places of `state` or of the domain.

    Facts of the state that the text does not list are added; what neither says is false, as PDDL has it, where the
    state is not given.
    """
    objects, facts, goals = read_problem(text)
    named = {name: np.array(where) for name, where in domain.places.items()}
    at = named | {each.name: np.array(each.typical) for each in domain.vocabulary.of_kind("fixture") if each.typical}
    state = None if state is None else state_in(domain.vocabulary, state)
    at = at if state is None else _places_now(domain, state, named)
    facts_now = {} if state is None else facts_of(domain.vocabulary, state, at)
    problem = Problem(domain, at, facts_now, (), tuple(value_notes(domain.vocabulary, state or {})))
    names = Names(domain, problem.objects)
    for identifier in objects:
        name_of(identifier, names.objects, "objects whose position is known (give the state)")
    listed = [Goal(_fact_of(words, names), value) for words, value in facts if words[0] not in names.shown.values()]
    _check_goals(problem, listed, "facts")
    known = dict.fromkeys(_all_facts(problem), False)
    if state is not None:  # what is listed to be at a place is there and nowhere else
        said = {_whose_place(goal.fact) for goal in listed if goal.value}
        known = {f: value and not ((whose := _whose_place(f)) and whose in said) for f, value in problem.facts.items()}
    return replace(problem, facts=known | dict(listed), goal=_goals(problem, goals))


def _places_now(domain: Domain, state: State, named: Mapping[str, Array]) -> dict[str, Array]:
    """Return the places of a state; one at which an item lies is where that item is, unless it is a fixture."""
    vocabulary = domain.vocabulary
    places = places_of(vocabulary, [state], named, "here")
    columns = {item.name: item.columns for item in vocabulary.of_kind("item")}
    return places | {
        fact[2]: position_of(columns[fact[1]], state)
        for fact, value in facts_of(vocabulary, state, places).items()
        if value and fact[0] == "in" and fact[2] not in vocabulary.fixtures
    }


def _all_facts(problem: Problem) -> list[Fact]:
    of_type = problem.of_type
    types = predicates_of(problem.domain.vocabulary)
    return [
        (name, *arguments)
        for name, kinds in types.items()
        for arguments in itertools.product(*(of_type[k] for k in kinds))
    ]


def _goals(problem: Problem, literals: Sequence[tuple[tuple[str, ...], bool]]) -> tuple[Goal, ...]:
    names = Names(problem.domain, problem.objects)
    goals = tuple(Goal(_fact_of(words, names), value) for words, value in literals)
    _check_goals(problem, goals)
    return goals


def _fact_of(words: Sequence[str], names: Names) -> Fact:
    """Return the fact that identifiers in PDDL name."""
    objects = (name_of(word, names.objects, "an object whose position is known") for word in words[1:])
    return (name_of(words[0], names.predicates, "a predicate"), *objects)


def _check_goals(problem: Problem, goals: Sequence[Goal], what: str = "goals") -> None:
    types, objects = Names(problem.domain).types, problem.objects
    for goal in goals:
        wanted = types.get(goal.fact[0])
        if wanted is None or tuple(map(objects.get, goal.fact[1:])) != wanted:
            kinds = "nothing" if wanted is None else f"({' '.join((goal.fact[0], *wanted))})"
            raise SpecificationError(f"expected {what} in the words of the domain, here {kinds}, got {goal}")
    if both := next((goal for goal in goals if Goal(goal.fact, not goal.value) in goals), None):
        raise SpecificationError(f"expected {what} that hold together, got {both} both true and false")
    places: dict[Fact, Goal] = {}
    for goal in goals:
        whose = _whose_place(goal.fact) if goal.value else None
        if whose and (other := places.setdefault(whose, goal)) != goal:
            raise SpecificationError(f"expected {what} that hold together, got {other} and {goal}: it is at one place")
    if not goals and what == "goals":
        raise SpecificationError("expected a goal, got none; as (and (in cup shelf))")


def _whose_place(fact: Fact) -> Fact | None:
    """Return what is at one place alone, the hand or an item, of a fact that says where; else None."""
    return {"hand-at": fact[:1], "in": fact[:2]}.get(fact[0])


def shown_arguments(problem: Problem) -> list[tuple[Operator, dict[str, str]]]:
    """Return each usable operator with all arguments that lie inside what was shown of it."""
    of_type = problem.of_type
    result = []
    for operator in problem.domain.operators:
        if not operator.usable:
            continue
        choices = [of_type[parameter.type] for parameter in operator.parameters]
        if np.prod([len(names) for names in choices]) > _MOST_GROUND:
            raise SpecificationError(
                f"expected at most {_MOST_GROUND:,} choices of arguments of {operator.name}, got more; leave out places"
            )
        for chosen in itertools.product(*choices):
            arguments = dict(zip((parameter.name for parameter in operator.parameters), chosen, strict=True))
            if len({*chosen}) == len(chosen) and not is_shown(problem.domain, operator, arguments, problem.places):
                result.append((operator, arguments))
    return result


def ground(literals: Iterable[Literal], arguments: Mapping[str, str]) -> list[Goal]:
    """Return literals of parameters as facts, of arguments."""
    return [Goal((each.predicate, *(arguments[name] for name in each.arguments)), each.value) for each in literals]


def facts_after(facts: Mapping[Fact, bool], operator: Operator, arguments: Mapping[str, str]) -> dict[Fact, bool]:
    """Return the facts after an operator; what is not known and not an effect stays unknown."""
    return {**facts} | dict(ground(operator.effects, arguments))


def unmet(facts: Mapping[Fact, bool], operator: Operator, arguments: Mapping[str, str]) -> list[str]:
    """List preconditions that do not hold, or are not known to."""
    return [
        f"{needed} {'is not known' if needed.fact not in facts else 'does not hold'}"
        for needed in ground(operator.preconditions, arguments)
        if facts.get(needed.fact) is not needed.value
    ]

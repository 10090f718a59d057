"""Operators learned from states before and after movements: parameters, preconditions, effects, and what was shown.

Preconditions and effects are those of a safe action model (R. Stern and B. Juba, "Efficient, Safe, and Probably
Approximately Complete Learning of Action Models", IJCAI 2017): a literal over the parameters is a precondition if it
held before every movement of the symbol, and an effect if it changed in one and held after all. An operator is then
never used where it was not seen to work, as far as the states say everything that counts.

A sensor errs, and then nothing holds before every movement. With the share e of facts that it gets wrong, a literal is

- the same before all movements, and the same after all: a precondition and, if they differ, an effect;
- true, or false, after all, whatever it was: an effect;
- as it was, whatever it was: neither;
- anything: what happens in four fifths of the movements is taken, and where nothing does, or where no errors are
  expected, it cannot be told; what held before them all is a precondition nevertheless.

The likeliest of these is taken, with ``log(n + 2) / 2`` off the log likelihood for each free share (G. Schwarz,
"Estimating the Dimension of a Model", Annals of Statistics 6, 1978), and with odds of 5 to 1 for a precondition, since
one too many is safe. An exception that is seen before and after counts twice.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

from kineme.library.library import ActionLibrary
from kineme.planning import vocabulary as words
from kineme.planning.domain import CHANGED, Domain, Edit, Evidence, Literal, Operator, Parameter, edited
from kineme.planning.states import States, states_of
from kineme.reporting.text import counted
from kineme.validation import Array, check_number

_MOST_PLACES = 60  # places without an object that a domain names, the most visited ones
_PLACES = ("from", "to", "at")  # roles of places
_NEEDED = math.log(5.0)  # log odds that a literal is a precondition, before any movement is seen: too many are safe
_MOSTLY = 0.8  # of the movements: an effect, or that a literal is kept, which has more exceptions cannot be told
_FEW = 3  # movements of a symbol below which preconditions hold much by chance


class Example(NamedTuple):
    """One movement: its places, the facts before and after, and where the hand is."""

    movement: int
    places: dict[str, Array]
    before: dict[words.Fact, bool]
    after: dict[words.Fact, bool]
    hands: tuple[Array, Array]


def learn_operators(
    library: ActionLibrary,
    table: str | Path | Mapping[str, Sequence[Any]] | None = None,
    *,
    radius: float | None = None,
    error_rate: float = 0.02,
    edits: Sequence[Edit] = (),
) -> Domain:
    """Learn an operator for each symbol of a library from the states before and after its movements; see the module.

    - `table`: states beside the recordings, see `states_of`; without it the hand and the grippers of the recordings
      alone.
    - `radius`: of places, in the unit of the recordings; by default where distances of the hand from objects part into
      near and far, see `vocabulary_of`.
    - `error_rate`: share of facts that a sensor gets wrong; 0 takes each fact as it is.
    - `edits`: of a person, as those of an earlier domain.

    Raises `DataError`: a table that is none, or rows that belong to no movement. Raises `SpecificationError`: no symbol
    has movements; a radius or an error rate out of range.
    """
    states = states_of(library, table)
    durations = library.primitives(ids=states.movements).durations
    symbol_ids = {symbol.name: symbol.id for symbol in library.symbols()}
    return operators_of(states, durations, symbol_ids, radius=radius, error_rate=error_rate, edits=edits)


def operators_of(
    states: States,
    durations: Array,
    symbol_ids: Mapping[str, str],
    *,
    radius: float | None = None,
    error_rate: float = 0.02,
    edits: Sequence[Edit] = (),
) -> Domain:
    """Learn operators from states, with the durations of their movements (n,) [s] and the ids of the symbols."""
    check_number("error_rate", error_rate, least=0.0, most=0.25)
    vocabulary = words.vocabulary_of(states, radius)
    examples = [_example(vocabulary, states, row) for row in range(len(states))]
    values_of: dict[str, set[bool]] = {}
    for example in examples:
        for facts in (example.before, example.after):
            for fact, value in facts.items():
                values_of.setdefault(fact[0], set()).add(value)
    varied = {predicate for predicate, values in values_of.items() if len(values) == 2}
    rules = _Rules(words.predicates_of(vocabulary), varied, error_rate, {*vocabulary.fixtures})
    operators = []
    for name in dict.fromkeys(sorted(states.symbols)):
        rows = [row for row, symbol in enumerate(states.symbols) if symbol == name]
        duration = float(np.median(np.asarray(durations)[rows]))
        own = [examples[row] for row in rows]
        operator = _operator(name, symbol_ids.get(name, ""), own, duration, rules)
        if n := sum(each.movement in states.missing for each in own):
            note = f"the states have no row before or after {n} of {counted(len(own), 'movement')}"
            operator = replace(operator, cannot_tell=(note, *operator.cannot_tell))
        operators.append(operator)
    domain = Domain(vocabulary, tuple(operators), _visited(vocabulary, examples))
    return edited(domain, edits)


def _example(vocabulary: words.Vocabulary, states: States, row: int) -> Example:
    moments = [
        {
            name: states.words[name][int(value)] if name in states.words else float(value)
            for name, value in zip(states.columns, values[row], strict=True)
            if np.isfinite(value)
        }
        for values in (states.before, states.after)
    ]
    places = words.places_of(vocabulary, moments)
    before, after = (words.facts_of(vocabulary, moment, places) for moment in moments)
    hands = words.hand_of(vocabulary, moments[0]), words.hand_of(vocabulary, moments[1])
    return Example(int(states.movements[row]), places, before, after, hands)


def _holds_at(facts: Mapping[words.Fact, bool], predicate: str, *known: str) -> list[str]:
    """List the last arguments, or of ``in`` the items of a place, with which a predicate is true."""
    if predicate == "in":
        return [fact[1] for fact, value in facts.items() if value and fact[0] == "in" and fact[2] == known[0]]
    return [fact[1] for fact, value in facts.items() if value and fact[0] == predicate]


def _bindings(example: Example) -> dict[str, str]:
    """Bind the roles that a movement may have: places at its ends, the item it takes along, what lies there."""
    roles: dict[str, str] = {}
    for role, facts in (("from", example.before), ("to", example.after)):
        if at := _holds_at(facts, "hand-at"):
            roles[role] = at[0]
    items = {fact[1] for fact in example.before if fact[0] == "in"}
    held = {*_holds_at(example.before, "holding"), *_holds_at(example.after, "holding")}
    changed = {
        fact[1] for fact, value in example.before.items()
        if fact[0] == "in" and value and example.after.get(fact) is False
    } & items  # fmt: skip
    taken = held or changed
    if len(taken) == 1:
        roles["item"] = next(iter(taken))
    for role, place in (("item-from", roles.get("from")), ("item-to", roles.get("to"))):
        there = [] if place is None else [item for item in _holds_at(example.before, "in", place) if item not in taken]
        if len(there) == 1:
            roles[role] = there[0]
    return roles


class _Rules(NamedTuple):
    """What decides which literals count."""

    predicates: Mapping[str, tuple[str, ...]]  # predicate -> types of its arguments
    varied: set[str]  # predicates that were both true and false
    error_rate: float
    fixtures: set[str]


class _Literals(NamedTuple):
    """Literals of an operator, and what the states do not decide."""

    preconditions: list[Literal]
    effects: list[Literal]
    evidence: list[Evidence]
    cannot_tell: list[str]
    decided: list[bool]  # whether each effect came after all movements or after none


def _operator(name: str, symbol_id: str, examples: list[Example], duration: float, rules: _Rules) -> Operator:
    cannot_tell = []
    if len(examples) < _FEW:
        cannot_tell.append(f"shown {counted(len(examples), 'time')}: preconditions hold much by chance")
    roles, bound = _roles(examples, rules.error_rate)
    fits = [all(role in each for role in roles) and len({each[role] for role in roles}) == len(roles) for each in bound]
    if not all(fits):
        others = counted(fits.count(False), "movement")
        cannot_tell.append(f"{others} of {len(fits)} had other places or items and do not count")
    pairs = [(example, each) for example, each, fit in zip(examples, bound, fits, strict=True) if fit]
    parameters = tuple(_parameter(role, pairs, rules.fixtures) for role in roles)
    literals = _literals(pairs, parameters, rules)
    places = [role for role in roles if role in _PLACES]
    ends: list[tuple[float, ...]] = [(), ()]
    if places and pairs:
        for k in (0, -1):
            offsets = [example.hands[k] - example.places[each[places[k]]] for example, each in pairs]
            ends[k] = tuple(np.median(offsets, axis=0).tolist())
    ways = np.array([example.hands[1] - example.hands[0] for example, _ in pairs] or [np.zeros(0)])
    return Operator(
        name, symbol_id, parameters, tuple(literals.preconditions), tuple(literals.effects), duration, ends[0], ends[1],
        (tuple(ways.min(axis=0).tolist()), tuple(ways.max(axis=0).tolist())), tuple(literals.evidence),
        (*cannot_tell, *literals.cannot_tell), bool(pairs) and all(literals.decided),
        tuple(example.movement for example, _ in pairs),
    )  # fmt: skip


def _roles(examples: Sequence[Example], error_rate: float) -> tuple[list[str], list[dict[str, str]]]:
    """Return the roles that all movements of a symbol have, and what each binds to them."""
    bound = [_bindings(example) for example in examples]
    leaves = [roles["from"] != roles["to"] for roles in bound if "from" in roles and "to" in roles]
    if not any(leaves) or 2 * sum(leaves) < len(leaves):  # it stays where it begins
        stays = {"at": "from", "item": "item", "item-at": "item-from"}
        bound = [{role: each[of] for role, of in stays.items() if of in each} for each in bound]
        roles = list(stays)
    else:
        roles = ["from", "to", "item", "item-from", "item-to"]
    return [role for role in roles if _accepts(sum(role not in each for each in bound), len(bound), error_rate)], bound


def _literals(
    pairs: Sequence[tuple[Example, Mapping[str, str]]], parameters: Sequence[Parameter], rules: _Rules
) -> _Literals:
    """Return what held before all movements, what changed, and the counts."""
    literals = _Literals([], [], [], [], [])
    candidates = (
        (predicate, tuple(parameter.name for parameter in chosen))
        for predicate, types in rules.predicates.items()
        for chosen in itertools.permutations(parameters, len(types))
        if tuple(parameter.type for parameter in chosen) == types
    )
    for predicate, arguments in candidates:
        facts = [(predicate, *(each[argument] for argument in arguments)) for _, each in pairs]
        known = [
            (example.movement, example.before[fact], example.after[fact])
            for fact, (example, _) in zip(facts, pairs, strict=True)
            if fact in example.before and fact in example.after
        ]
        text = str(Literal(predicate, arguments))
        if 2 * len(known) < len(pairs):
            literals.cannot_tell.append(f"{text}: known in {len(known)} of {counted(len(pairs), 'movement')}")
        if not known:
            continue
        counts = np.zeros((2, 2), dtype=int)
        np.add.at(counts, tuple(np.array([row[1:] for row in known], dtype=int).T), 1)
        before, after, decided = _regularity(counts, rules.error_rate)
        changed = int(counts[0, 1] + counts[1, 0])
        if before is not None and 2 * len(known) >= len(pairs):
            literals.preconditions.append(Literal(predicate, arguments, before))
        if after is not None and after != before and changed:
            literals.effects.append(Literal(predicate, arguments, after))
        if not decided:
            literals.decided.append(False)
            literals.cannot_tell.append(f"{text}: {CHANGED} {changed} of {len(known)}, true after {counts[:, 1].sum()}")
        odd = {row[0] for row in known for k, value in ((1, before), (2, after)) if value is (not row[k])}
        literals.evidence.append(
            Evidence(predicate, arguments, len(known), int(counts[1].sum()), int(counts[:, 1].sum()), changed,
                      tuple(sorted(odd)), predicate in rules.varied)
        )  # fmt: skip
    return literals


def _accepts(exceptions: int, n: int, error_rate: float) -> bool:
    """Tell whether so many exceptions among n are more likely errors of a sensor than chance."""
    if exceptions == 0:
        return n > 0
    if error_rate == 0:
        return False
    return exceptions * math.log(error_rate) + (n - exceptions) * math.log1p(-error_rate) > -n * math.log(2.0)


def _regularity(counts: NDArray[np.int_], error_rate: float) -> tuple[bool | None, bool | None, bool]:
    """Return the value that a literal always has before, and after; None is any, and kept; and whether it is decided.

    `counts` (2, 2): movements by the value that was seen before, and after.
    """
    n, share = int(counts.sum()), float(counts[1].sum() / counts.sum())
    priors, free = np.array([1.0 - share, share]), float(xlogy(counts, counts / n).sum())
    scores: dict[tuple[bool | None, bool | None], float] = {}
    for rate in (0.0, 0.25 * error_rate, 0.5 * error_rate, error_rate):  # a sensor may be better than is said
        reading = np.array([[1.0 - rate, rate], [rate, 1.0 - rate]])  # true value -> value of the sensor
        laws: dict[tuple[bool | None, bool | None], Array] = {
            (before, after): np.outer(reading[int(before)], reading[int(after)])
            for before in (False, True) for after in (False, True)
        }  # fmt: skip
        laws |= {(None, after): np.outer(priors @ reading, reading[int(after)]) for after in (False, True)}
        laws[None, None] = np.einsum("t,tb,ta->ba", priors, reading, reading)
        for law, likelihoods in laws.items():
            score = float(xlogy(counts, likelihoods).sum())
            score -= 0.5 * math.log(n + 2) + _NEEDED if law[0] is None else 0.0
            scores[law] = max(scores.get(law, -np.inf), score)
    best = max(scores, key=lambda law: scores[law])
    is_alone = sum(score >= scores[best] - 1e-9 for score in scores.values()) == 1
    if is_alone and scores[best] >= free - 1.5 * math.log(n + 2):
        before, after = best
        if before is None and after is not None and _accepts(int(counts[int(not after), int(after)]), n, error_rate):
            before = after  # what changed may be errors alone: it is no effect, and needed
        return before, after, True
    kept = {None: counts.trace(), False: counts[:, 0].sum(), True: counts[:, 1].sum()}
    mostly = max(kept, key=lambda value: kept[value])
    needed = next(
        (value for value in (False, True) if _accepts(int(counts[int(not value)].sum()), n, error_rate)), None
    )
    return needed, mostly, bool(kept[mostly] >= (_MOSTLY if error_rate > 0 else 1.0) * n)


def _parameter(role: str, pairs: Sequence[tuple[Example, Mapping[str, str]]], fixtures: set[str]) -> Parameter:
    is_place = role in _PLACES
    names = [each[role] for _, each in pairs]
    kinds = tuple(sorted({"" if is_place and name not in fixtures else words.kind_of(name) for name in names}))
    if not is_place:
        return Parameter(role, "item", kinds)
    where = np.array([example.places[each[role]] for example, each in pairs])
    return Parameter(role, "place", kinds, tuple(where.min(axis=0).tolist()), tuple(where.max(axis=0).tolist()))


def _visited(vocabulary: words.Vocabulary, examples: Iterable[Example]) -> dict[str, tuple[float, ...]]:
    """Return the places without a fixture that were visited, the means of what lies within the radius."""
    fixtures = {*vocabulary.fixtures}
    places = [where for each in examples for name, where in each.places.items() if name not in fixtures]
    centers, visits, n = np.zeros((len(places), len(vocabulary.axes))), np.zeros(len(places), dtype=int), 0
    for where in places:
        away = np.linalg.norm(centers[:n] - where, axis=1)
        k = int(away.argmin()) if n and away.min() <= vocabulary.radius else n
        n = max(n, k + 1)
        visits[k] += 1
        centers[k] += (where - centers[k]) / visits[k]  # their mean
    order = np.argsort(-visits[:n], kind="stable")[:_MOST_PLACES]
    names = (name for k in itertools.count(1) if (name := f"place-{k}") not in fixtures)
    return {name: tuple(centers[k].tolist()) for k, name in zip(order.tolist(), names, strict=False)}

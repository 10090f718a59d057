"""Domains and problems as PDDL, and a person's changes of a domain read back from it.

STRIPS with types, negative preconditions and action costs, which are durations in milliseconds. What was shown of an
operator is a static predicate over its parameters, ``(shown-carry ?from ?to ?item)``, whose facts a problem lists.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Iterable, Mapping
from hashlib import sha256
from typing import Any

from kineme.errors import DataError, SpecificationError
from kineme.planning.domain import Domain, Edit, Literal, Operator
from kineme.planning.vocabulary import Fact, predicates_of
from kineme.reporting.text import first_names, printable

_RESERVED = frozenset(
    {"and", "or", "not", "imply", "exists", "forall", "when", "either", "object", "place", "item", "number", "define",
     "total-cost", "increase", "decrease", "assign", "minimize", "domain", "problem", "always", "sometime",
     "sometime-after", "sometime-before", "at-most-once"}
)  # fmt: skip
_Words = tuple[tuple[str, ...], bool]  # a literal: its words, and whether it is true
_LONGEST = 60  # characters of an identifier
_MOST_TOKENS, _DEEPEST = 1_000_000, 200
_DIGEST = re.compile(r"; of the operators ([0-9a-f]+)")
_TOKEN = re.compile(r";[^\n]*|[()]|[^\s()]+")


def identifiers(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Return name -> its identifier in PDDL: small letters, digits and hyphens, each of its own, none that is taken."""
    result: dict[str, str] = {}
    others = {*taken}
    for name in sorted({*names}, key=lambda name: (not name.islower(), name)):  # cup before CUP
        plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
        stem = re.sub(r"[^a-z0-9_]+", "-", plain).strip("-_")[:_LONGEST] or "name"
        stem = stem if stem[0].isalpha() and stem not in _RESERVED else f"n-{stem}"
        text, number = stem, 1
        while text in others:
            number += 1
            text = f"{stem}-{number}"
        others.add(text)
        result[name] = text
    return result


class Names:
    """Identifiers of what a domain names, each of its own, as planners want them."""

    def __init__(self, domain: Domain, objects: Iterable[str] = ()) -> None:
        self.types = predicates_of(domain.vocabulary)
        for operator in domain.operators:
            kinds = {parameter.name: parameter.type for parameter in operator.parameters}
            for literal in (*operator.preconditions, *operator.effects):  # a person may add predicates
                types = tuple(kinds.get(name, "unknown") for name in literal.arguments)
                if self.types.setdefault(literal.predicate, types) != types or "unknown" in types:
                    expected = " ".join((literal.predicate, *self.types[literal.predicate]))
                    raise SpecificationError(f"expected ({expected}) in {operator.name}, got {literal}")
        self.predicates = identifiers(self.types)
        self.operators = identifiers((operator.name for operator in domain.operators), self.predicates.values())
        prefix = "shown"
        own = {*self.operators.values()}
        while any(text.startswith(f"{prefix}-") for text in self.predicates.values()) or any(
            f"{prefix}-{text}" in own for text in own
        ):
            prefix = f"was-{prefix}"
        self.shown = {name: f"{prefix}-{text}" for name, text in self.operators.items()}
        self.objects = identifiers(
            objects, [text for each in (self.predicates, self.operators, self.shown) for text in each.values()]
        )


def domain_to_pddl(domain: Domain, name: str = "kineme") -> str:
    """Return a domain as PDDL; operators that a planner does not get are comments that say why."""
    names = Names(domain)
    predicates = [_typed(names.predicates[predicate], types) for predicate, types in names.types.items()]
    usable = [operator for operator in domain.operators if operator.usable]
    predicates += [_typed(names.shown[each.name], [p.type for p in each.parameters]) for each in usable]
    lines = [
        f"; of the operators {_digest(domain)}, by which the file beside it is known",
        f"(define (domain {identifiers([name])[name]})",
        "  (:requirements :strips :typing :negative-preconditions :action-costs)",
        "  (:types place item)",
        "  (:predicates",
        *(f"    {text}" for text in predicates),
        "  )",
        "  (:functions (total-cost) - number)",
    ]
    for operator in domain.operators:
        lines += _action(operator, names) if operator.usable else _left_out(operator)
    return "\n".join([*lines, ")", ""])


def _digest(domain: Domain) -> str:
    """Return the digest of all that a person's changes are compared with."""
    said = [
        [each.name, each.usable, [parameter[:2] for parameter in each.parameters], each.preconditions, each.effects]
        for each in domain.operators
    ]
    return sha256(json.dumps(said).encode()).hexdigest()[:16]


def is_signed(text: str) -> bool:
    """Tell whether a domain in PDDL says which operators it was written of; those of earlier versions do not."""
    return _DIGEST.search(text) is not None


def _typed(predicate: str, types: Iterable[str]) -> str:
    return f"({' '.join([predicate, *(f'?{kind[0]}{k} - {kind}' for k, kind in enumerate(types, 1))])})"


def _comment(text: str) -> str:
    return f"  ; {printable(text)}"


def _left_out(operator: Operator) -> list[str]:
    why = [*operator.cannot_tell] or ["no movement of it has a state"]
    return [_comment(f"{operator.name} is left out, its effects are not told:"), *map(_comment, why)]


def _literal(literal: Literal, names: Names) -> str:
    return str(literal._replace(predicate=names.predicates[literal.predicate]))


def _action(operator: Operator, names: Names) -> list[str]:
    """Return the lines of an operator, with the counts behind each precondition."""
    evidence = {row[:2]: row for row in operator.evidence}
    parameters = " ".join(f"?{parameter.name} - {parameter.type}" for parameter in operator.parameters)
    shown = f"({' '.join([names.shown[operator.name], *(f'?{p.name}' for p in operator.parameters)])})"
    lines = [
        _comment(f"{operator.name}: {len(operator.movements)} movements"),
        *map(_comment, operator.cannot_tell),
        f"  (:action {names.operators[operator.name]}",
        f"    :parameters ({parameters})",
        f"    :precondition (and {shown}",
    ]
    for literal in operator.preconditions:
        row = evidence.get(literal[:2])
        said = (
            "a person's" if row is None else f"{row.true_before if literal.value else row.n - row.true_before}/{row.n}"
        )
        never = "" if row is None or row.varied else ", never varied"
        lines.append(f"      {_literal(literal, names)}  ; {said}{never}")
    lines += ["    )", "    :effect (and"]
    lines += [f"      {_literal(literal, names)}" for literal in operator.effects]
    return [*lines, f"      (increase (total-cost) {max(1, round(1000 * operator.duration))})", "    ))"]


def problem_to_pddl(
    domain: Domain,
    objects: Mapping[str, str],
    true: Iterable[Fact],
    goal: Iterable[tuple[Fact, bool]],
    shown: Iterable[tuple[str, tuple[str, ...]]],
) -> str:
    """Return a problem as PDDL.

    `objects` maps a name to "place" or "item"; `true` are the facts now; `shown` the operators with the arguments that
    lie inside what was shown of them.
    """
    names = Names(domain, objects)

    def ground(fact: Fact) -> str:
        return f"({' '.join([names.predicates[fact[0]], *(names.objects[name] for name in fact[1:])])})"

    lines = ["(define (problem now)", f"  (:domain {identifiers(['kineme'])['kineme']})", "  (:objects"]
    lines += [f"    {names.objects[name]} - {kind}" for name, kind in objects.items()]
    lines += ["  )", "  (:init", "    (= (total-cost) 0)", *(f"    {ground(fact)}" for fact in sorted(true))]
    lines += [
        f"    ({' '.join([names.shown[name], *(names.objects[argument] for argument in arguments)])})"
        for name, arguments in shown
    ]
    goals = [ground(fact) if value else f"(not {ground(fact)})" for fact, value in goal]
    return "\n".join([*lines, "  )", f"  (:goal (and {' '.join(goals)}))", "  (:metric minimize (total-cost)))", ""])


def parsed(text: str) -> Any:
    """Return one expression of PDDL as nested lists of words, in small letters."""
    stack: list[list[Any]] = [[]]
    for number, token in enumerate(match[0] for match in _TOKEN.finditer(text.lstrip("\ufeff"))):
        if number > _MOST_TOKENS or len(stack) > _DEEPEST:
            raise DataError(f"expected PDDL of at most {_MOST_TOKENS:,} words, {_DEEPEST} deep, got more")
        if token == "(":
            stack.append([])
        elif token == ")":
            if len(stack) == 1:
                raise DataError("expected PDDL, got a ) without its (")
            last = stack.pop()
            stack[-1].append(last)
        elif not token.startswith(";"):
            stack[-1].append(token.lower())
    outside = [word for word in stack[0] if isinstance(word, str)]
    if len(stack) > 1:
        raise DataError("expected PDDL, got a ( without its )")
    if len(stack[0]) != 1 or outside:
        got = f"words outside, as {' '.join(outside)[:60]!r}" if outside else f"{len(stack[0])} expressions"
        raise DataError(
            f"expected one expression in parentheses, as (sweet cup) or (and (sweet cup) (not (full cup))), got {got}"
        )
    return stack[0][0]


def _plain(expression: Any) -> str:
    """Return an expression as it was written."""
    return f"({' '.join(map(_plain, expression))})" if isinstance(expression, list) else str(expression)


def literals_of(expression: Any) -> list[_Words]:
    """Return the literals of a conjunction, as ``(and (in cup shelf) (not (full cup)))``: words, and whether true."""
    if isinstance(expression, list) and expression and expression[0] == "and":
        return [literal for part in expression[1:] for literal in literals_of(part)]
    if isinstance(expression, list) and len(expression) == 2 and expression[0] == "not":
        within = literals_of(expression[1])
        if len(within) != 1:  # of several, at least one is false, and nothing says which
            raise DataError(
                f"expected not of one literal, as (not (full cup)), got it of {len(within)}; write (not ...) around "
                "each that is to be false"
            )
        return [(words, not value) for words, value in within]
    if not (isinstance(expression, list) and expression and all(isinstance(word, str) for word in expression)):
        raise DataError(
            f"expected literals and their conjunctions, as (and (in cup shelf)), got {_plain(expression):.100}"
        )
    return [(tuple(expression), True)]


def _sections(expression: Any, what: str) -> dict[str, list[Any]]:
    """Return section -> its content, of ``(define (domain ...) (:section ...) ...)``."""
    if (
        not isinstance(expression, list)
        or expression[:1] != ["define"]
        or not any(part[:1] == [what] for part in expression[1:])
    ):
        raise DataError(f"expected (define ({what} ...) ...) in PDDL, got something else")
    sections: dict[str, list[Any]] = {}
    for part in expression[1:]:
        if not isinstance(part, list) or not part or not isinstance(part[0], str):
            raise DataError(f"expected sections in parentheses in PDDL, got {_plain(part):.100}")
        sections.setdefault(part[0], []).append(part[1:])
    return sections


def edits_in(text: str, domain: Domain) -> list[Edit]:
    """Return a person's changes in the PDDL of a domain: what differs from what `domain_to_pddl` wrote of it.

    Literals of preconditions and effects count; operators and predicates are told by their identifiers. Raises
    `DataError`: a text that was written of another domain, where what was learned since would count as a change.
    """
    if (signed := _DIGEST.search(text)) and signed[1] != _digest(domain):
        raise DataError(
            "expected the PDDL and the JSON of one call of kineme operators, got those of two; restore the JSON of "
            "this PDDL, or move the PDDL away, learn into it anew and make your changes again"
        )
    names = Names(domain)
    sections = _sections(parsed(text), "domain").get(":action", [])
    actions = {part[0]: part[1:] for part in sections if part and isinstance(part[0], str)}
    usable = [operator for operator in domain.operators if operator.usable]
    written = [names.operators[operator.name] for operator in usable]
    if actions.keys() != {*written} or len(sections) != len(written):
        raise DataError(
            f"expected the actions that kineme operators wrote, {first_names(written, 8)}, each once, got "
            f"{first_names([*actions], 8)}; an action that is not to be used takes a precondition that never holds"
        )
    predicate_of = {text: name for name, text in names.predicates.items()}
    edits = []
    for operator in usable:
        content = _content(operator.name, actions[names.operators[operator.name]])
        for part, learned in (("precondition", operator.preconditions), ("effect", operator.effects)):
            expressions = [each for each in _conjuncts(content.get(f":{part}", ["and"])) if each[:1] != ["increase"]]
            present = [
                Literal(
                    predicate_of.get(words[0], words[0]), tuple(name.removeprefix("?") for name in words[1:]), value
                )
                for words, value in literals_of(["and", *expressions])
                if words[0] != names.shown[operator.name]
            ]
            if any(literal.predicate == "=" for literal in present):
                raise DataError(
                    f"expected no = in the {part} of {operator.name}, got one; take it out, arguments are always "
                    "different things"
                )
            parameters = [parameter.name for parameter in operator.parameters]
            if unknown := next((literal for literal in present if {*literal.arguments} - {*parameters}), None):
                raise DataError(
                    f"expected parameters of {operator.name}, {first_names(parameters, 8)}, got {unknown} in its {part}"
                )
            if both := next((each for each in present if each._replace(value=not each.value) in present), None):
                raise DataError(f"expected {both} of {operator.name} true or false in its {part}, got both")
            edits += [
                Edit(operator.name, part, literal, True, operator.symbol_id)
                for literal in present
                if literal not in learned
            ]
            edits += [
                Edit(operator.name, part, literal, False, operator.symbol_id)
                for literal in learned
                if literal not in present
            ]
    return edits


def _content(name: str, action: list[Any]) -> dict[str, Any]:
    """Return keyword -> its expression, of an action; refuse what would leave out one of them."""
    heads = action[::2]
    if len(action) % 2 or any(str(head)[:1] != ":" or heads.count(head) > 1 for head in heads):
        got = " ".join("(...)" if isinstance(word, list) else word for word in action)
        raise DataError(
            f"expected :parameters, :precondition and :effect of {name}, each once and with one expression, got "
            f"{got:.100}; join several by (and ...)"
        )
    return dict(zip(heads, action[1::2], strict=True))


def _conjuncts(expression: Any) -> list[Any]:
    if expression == []:  # an empty condition
        return []
    return expression[1:] if isinstance(expression, list) and expression[:1] == ["and"] else [expression]


def read_problem(text: str) -> tuple[list[str], list[_Words], list[_Words]]:
    """Return objects, facts and goal of a problem in PDDL, in identifiers; costs and metrics are left out."""
    sections = _sections(parsed(text), "problem")
    if twice := next((name for name in (":objects", ":init", ":goal") if len(sections.get(name, [])) > 1), None):
        raise DataError(f"expected one section {twice} in PDDL, got {len(sections[twice])}; join them")
    if not any(sections.get(":goal", [])):
        raise DataError("expected a problem with a goal, got none; add (:goal ...)")
    if (n := len(sections[":goal"][0])) > 1:
        raise DataError(f"expected one expression in :goal, got {n}; join them by (and ...)")
    words = sections.get(":objects", [[]])[0]
    objects, position = [], 0
    while position < len(words):  # a b - place c - item
        if words[position] == "-":
            position += 1
        elif isinstance(words[position], str):
            objects.append(words[position])
        else:
            raise DataError(f"expected names of objects in :objects, got {_plain(words[position]):.100}")
        position += 1
    facts = literals_of(["and", *(fact for fact in sections.get(":init", [[]])[0] if fact[:1] != ["="])])
    return objects, facts, literals_of(sections[":goal"][0][0])


def name_of(identifier: str, identifier_of: Mapping[str, str], what: str) -> str:
    """Return the name behind an identifier, or the name itself; refuse what is neither."""
    for names in ({text: name for name, text in identifier_of.items()}, {name.lower(): name for name in identifier_of}):
        if identifier in names:
            return names[identifier]
    raise SpecificationError(
        f"expected {what} among {first_names([*identifier_of], 12)}, got {printable(identifier)!r}"
    )

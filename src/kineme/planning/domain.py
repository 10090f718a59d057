"""A domain: operators with what was shown of them, places, a person's edits; and its form in JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import DataError, SpecificationError
from kineme.planning.vocabulary import Variable, Vocabulary, kind_of
from kineme.validation import Array, check_form

FORMAT, VERSION = "kineme-domain", 1
#: What says of an effect that it came after some movements and not after others.
CHANGED = "changed by"


class Parameter(NamedTuple):
    """A parameter of an operator, and what was shown of it."""

    name: str
    type: str  # "place" or "item"
    kinds: tuple[str, ...]  # names of objects without their numbers; "" is a place without a fixture
    low: tuple[float, ...] = ()  # of a place, the box of the positions that were shown
    high: tuple[float, ...] = ()


class Literal(NamedTuple):
    """A predicate of parameters, true or false."""

    predicate: str
    arguments: tuple[str, ...]
    value: bool = True

    def __str__(self) -> str:
        text = f"({' '.join((self.predicate, *(f'?{argument}' for argument in self.arguments)))})"
        return text if self.value else f"(not {text})"


class Evidence(NamedTuple):
    """Counts over the movements of a symbol in which a literal was known before and after."""

    predicate: str
    arguments: tuple[str, ...]
    n: int
    true_before: int
    true_after: int
    changed: int
    exceptions: tuple[int, ...]  # ids of movements that were taken as errors of a sensor
    varied: bool  # whether the predicate was both true and false in the states of any symbol


@dataclass(frozen=True)
class Operator:
    """One symbol as an action of a planner.

    - `duration`: median [s]. `displacement` (2, k): least and largest way of the hand.
    - `begin`, `end` (k,): hand minus the first place at the start, and minus the last place at the end; medians.
    - `cannot_tell`: what the states do not decide.
    - `usable`: whether a planner gets it; not if an effect came after some movements and not after others.
    """

    name: str
    symbol_id: str
    parameters: tuple[Parameter, ...]
    preconditions: tuple[Literal, ...]
    effects: tuple[Literal, ...]
    duration: float
    begin: tuple[float, ...]
    end: tuple[float, ...]
    displacement: tuple[tuple[float, ...], tuple[float, ...]]
    evidence: tuple[Evidence, ...]
    cannot_tell: tuple[str, ...]
    usable: bool
    movements: tuple[int, ...]

    @property
    def symbol(self) -> str:
        """What names its symbol in the library: the id, which outlives a new name, if there is one."""
        return self.symbol_id or self.name

    @property
    def places(self) -> list[Parameter]:
        """Parameters that are places."""
        return [parameter for parameter in self.parameters if parameter.type == "place"]


class Edit(NamedTuple):
    """A person's change of an operator, which survives learning again."""

    operator: str  # its name, which counts where there is no id
    part: str  # "precondition" or "effect"
    literal: Literal
    added: bool  # else taken away
    symbol_id: str = ""  # of the operator, which outlives a new name


@dataclass(frozen=True)
class Domain:
    """What a planner knows: operators, what can be said of a state, and places."""

    vocabulary: Vocabulary
    operators: tuple[Operator, ...]
    places: Mapping[str, tuple[float, ...]]  # (k,) of each name: places without a fixture that were visited
    edits: tuple[Edit, ...] = ()  # of a person, and already made in `operators`

    def operator(self, name: str) -> Operator:
        """Return the operator of a symbol."""
        for operator in self.operators:
            if operator.name == name:
                return operator
        names = ", ".join(operator.name for operator in self.operators)
        raise SpecificationError(f"expected an operator of the domain ({names}), got {name!r}")


def edited(domain: Domain, edits: Sequence[Edit]) -> Domain:
    """Return the domain with a person's edits; those of operators that are not there are kept for when they are.

    An edit of an effect that the movements did not decide decides it.
    """
    edits, operators = _bound(edits, domain.operators), []
    for operator in domain.operators:
        parts = {"precondition": list(operator.preconditions), "effect": list(operator.effects)}
        decided = set()
        for edit in edits:
            if not _is_edited(operator, edit):
                continue
            if edit.part not in parts:
                raise SpecificationError(f"expected an edit of a precondition or an effect, got {edit.part!r}")
            parts[edit.part] = [
                literal
                for literal in parts[edit.part]
                if literal[:2] != edit.literal[:2] or (not edit.added and literal != edit.literal)
            ]
            if edit.added:
                parts[edit.part].append(edit.literal)
            if edit.part == "effect":
                decided.add(str(edit.literal._replace(value=True)))
        open_effects = [
            text for text in operator.cannot_tell if f": {CHANGED} " in text and text.partition(": ")[0] not in decided
        ]
        usable = operator.usable or (bool(operator.movements) and not open_effects)
        operators.append(
            replace(operator, preconditions=tuple(parts["precondition"]), effects=tuple(parts["effect"]), usable=usable)
        )
    return replace(domain, operators=tuple(operators), edits=edits)


def _is_edited(operator: Operator, edit: Edit) -> bool:
    if edit.symbol_id and operator.symbol_id:
        return edit.symbol_id == operator.symbol_id
    return edit.operator == operator.name


def _bound(edits: Sequence[Edit], operators: Sequence[Operator]) -> tuple[Edit, ...]:
    """Return edits with the names and ids that their operators have now; those of none stay as they are."""
    of = [next((each for each in operators if _is_edited(each, edit)), None) for edit in edits]
    return tuple(
        edit if operator is None else edit._replace(operator=operator.name, symbol_id=operator.symbol_id)
        for edit, operator in zip(edits, of, strict=True)
    )


def unmade(domain: Domain) -> list[Edit]:
    """List the edits of operators that are not there, as after their symbol was deleted."""
    return [edit for edit in domain.edits if not any(_is_edited(operator, edit) for operator in domain.operators)]


def kinds_in_words(parameter: Parameter) -> str:
    """Say which objects were shown as a parameter."""
    return ", ".join(kind or "a place without an object" for kind in parameter.kinds)


def is_shown(
    domain: Domain, operator: Operator, arguments: Mapping[str, str], places: Mapping[str, Array]
) -> list[str]:
    """List why arguments lie outside what was shown of an operator; empty if they lie inside.

    Each place lies in the box of those shown, and the way of the hand in the box of ways, both larger by the radius.
    """
    reasons = []
    for parameter in operator.parameters:
        name = arguments[parameter.name]
        is_fixture = name in domain.vocabulary.fixtures
        kind = kind_of(name) if parameter.type == "item" or is_fixture else ""
        if kind not in parameter.kinds:
            reasons.append(f"{parameter.name} = {name} is none of what was shown: {kinds_in_words(parameter)}")
        if parameter.type == "place":
            reasons += _beyond(domain, f"{parameter.name} = {name}", places[name], parameter.low, parameter.high)
    ends = hands_of(operator, arguments, places)
    if ends is not None and len(operator.places) > 1:
        reasons += _beyond(domain, "the way of the hand", ends[1] - ends[0], *operator.displacement)
    return reasons


def hands_of(
    operator: Operator, arguments: Mapping[str, str], places: Mapping[str, Array]
) -> tuple[Array, Array] | None:
    """Return where the hand begins and ends with these arguments; None of an operator without places."""
    if not operator.places:
        return None
    first, last = (places[arguments[operator.places[k].name]] for k in (0, -1))
    return first + np.array(operator.begin), last + np.array(operator.end)


def _beyond(domain: Domain, what: str, where: Array, low: Sequence[float], high: Sequence[float]) -> list[str]:
    margin = domain.vocabulary.radius
    return [
        f"{what}: {axis} = {value:.4g} is {max(a - value, value - b):.3g} outside {a:.4g} to {b:.4g}"
        for axis, value, a, b in zip(domain.vocabulary.axes, where.tolist(), low, high, strict=True)
        if not a - margin <= value <= b + margin
    ]


def domain_to_dict(domain: Domain) -> dict[str, Any]:
    """Return a domain as plain data that JSON can hold; `domain_from_dict` reads it."""
    data = asdict(domain)
    for operator in data["operators"]:
        for part in ("parameters", "preconditions", "effects", "evidence"):
            operator[part] = [row._asdict() for row in operator[part]]
    data["vocabulary"]["variables"] = [variable._asdict() for variable in domain.vocabulary.variables]
    data["edits"] = [edit._asdict() | {"literal": edit.literal._asdict()} for edit in domain.edits]
    plain: dict[str, Any] = json.loads(json.dumps({"format": FORMAT, "version": VERSION, **data}, allow_nan=False))
    return plain


def domain_from_dict(data: Any) -> Domain:
    """Return the domain of `domain_to_dict`.

    Raises `DataError`: anything else, or a domain of a later version.
    """
    check_form(data, "domain", FORMAT, VERSION, "write one by kineme operators")
    try:
        words = data["vocabulary"]
        variables = tuple(_record(Variable, variable) for variable in words["variables"])
        vocabulary = _record(Vocabulary, words | {"variables": variables})
        for each in variables:
            n = len(vocabulary.axes) if each.kind in ("fixture", "item") else 1
            two = (each.words, each.levels) if each.kind == "flag" else (each.levels,)
            if len(each.columns) != n or any(len(values) not in (0, 2) for values in two):
                raise ValueError(f"{each.name} has {len(each.columns)} columns and {len(each.words)} words")
        records = (("parameters", Parameter), ("preconditions", Literal), ("effects", Literal), ("evidence", Evidence))
        operators = tuple(
            _record(Operator, row | {part: tuple(_record(of, each) for each in row[part]) for part, of in records})
            for row in data["operators"]
        )
        places = {name: tuple(map(float, where)) for name, where in data["places"].items()}
        edits = tuple(_record(Edit, edit | {"literal": _record(Literal, edit["literal"])}) for edit in data["edits"])
        domain = Domain(vocabulary, operators, places, _bound(edits, operators))  # earlier files have no ids of edits
        check_positions(vocabulary.axes, _positions(domain))
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise DataError(
            f"expected a complete domain, got one that does not fit ({type(error).__name__}: {error}); write it anew "
            "by kineme operators"
        ) from error
    return domain


def read_domain(path: str | Path) -> Domain:
    """Return the domain in a JSON file; see `domain_from_dict`."""
    return domain_from_dict(read_json(path, "domain"))


def read_json(path: str | Path, what: str) -> Any:
    """Return the data in a JSON file that should hold `what`."""
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise DataError(f"expected a {what} in JSON, {path} is none: {error}") from error


def _record(of: Any, data: Mapping[str, Any]) -> Any:
    """Return a record of data, with lists as tuples; refuse values of other types than those of its fields."""

    def freeze(value: Any) -> Any:
        return tuple(map(freeze, value)) if isinstance(value, list) else value

    record = of(**{name: freeze(value) for name, value in data.items()})
    for name, hint in get_type_hints(of).items():
        if not _is_of(getattr(record, name), hint):
            raise ValueError(f"{of.__name__.lower()}.{name} = {getattr(record, name)!r:.80}")
    return record


def _is_of(value: Any, hint: Any) -> bool:
    """Tell whether a value is of a type: a tuple, a mapping of texts, a union, a finite number, or anything plain."""
    kinds = get_args(hint)
    if get_origin(hint) is tuple:
        several = kinds[:1] * len(value) if kinds[-1] is Ellipsis and isinstance(value, tuple) else kinds
        return isinstance(value, tuple) and len(several) == len(value) and all(map(_is_of, value, several))
    if get_origin(hint) is Mapping:
        return isinstance(value, Mapping) and all(isinstance(text, str) for pair in value.items() for text in pair)
    if hint is float:
        return type(value) in (int, float) and math.isfinite(value)
    return any(_is_of(value, kind) for kind in kinds) if kinds else type(value) is hint


def _positions(domain: Domain) -> list[Sequence[float]]:
    positions: list[Sequence[float]] = [
        *domain.places.values(),
        *(each.typical for each in domain.vocabulary.variables if each.typical),
    ]
    for operator in domain.operators:
        positions += [where for parameter in operator.places for where in (parameter.low, parameter.high)]
        positions += [operator.begin, operator.end, *operator.displacement] if operator.places else []
    return positions


def check_positions(axes: Sequence[str], positions: Iterable[ArrayLike]) -> None:
    """Refuse positions that are not one finite number for each axis, with a ValueError."""
    for where in positions:
        if np.shape(where) != (len(axes),) or not np.isfinite(where).all():
            raise ValueError(f"the position {where!r} is not one finite number for each of {', '.join(axes)}")


def operator_schema(domain: Domain, operator: Operator) -> dict[str, Any]:
    """Return a JSON Schema of the arguments of an operator: which objects, and the box of each place that was shown."""
    properties: dict[str, Any] = {}
    for parameter in operator.parameters:
        properties[parameter.name] = {
            "type": "string",
            "description": f"a {parameter.type}: {kinds_in_words(parameter)}",
        }
        margin = domain.vocabulary.radius
        for axis, low, high in zip(domain.vocabulary.axes, parameter.low, parameter.high, strict=False):
            properties[f"{parameter.name}_{axis}"] = {
                "type": "number",
                "minimum": low - margin,
                "maximum": high + margin,
            }
    return {
        "title": operator.name,
        "type": "object",
        "properties": properties,
        "required": [parameter.name for parameter in operator.parameters],
        "additionalProperties": False,
    }

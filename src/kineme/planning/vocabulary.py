"""What can be said of a state: places, items, flags; and which of it is true, false or not known.

Facts are literals over names, as ``("in", "cup", "shelf")``:

- ``hand-at p``: the hand is within the radius of a place, nearer than of any other;
- ``in i p``: an item lies in a place, in no hand; ``clear p``: no item does;
- ``holding i``: the gripper is closed around an item, ``hand-empty``: around none;
- a flag or the word of a column, of an object (``full cup``) or of the world (``door-open``).

A *fixture* is an object of which none of its kind ever moved in a demonstration: it is a place, wherever it stands
today. *Items* are the others. The kind of an object is its name without the number at its end.
Other places are positions, as those where a hand or an item came to rest.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError, SpecificationError
from kineme.planning.skill import is_gripper
from kineme.planning.states import HAND, State, States, check_number_in, in_unit, value_of
from kineme.reporting.text import first_names, printable
from kineme.units import split_head
from kineme.validation import Array

Fact = tuple[str, ...]  # a predicate and its arguments

_OWN = ("hand-at", "in", "clear", "holding", "hand-empty")  # predicates that are always there
_TELLING = ("flag", "word", "gripper")  # kinds of variables that predicates come from
_TRUE = {"true", "yes", "on", "open", "full", "1"}
_FALSE = {"false", "no", "off", "closed", "empty", "0"}
_MOST_WORDS = 12  # different words of a column, at most; more are names or notes
_SEPARATE = 4.0  # ratio of neighboring distances from which near and far are told apart
_NEAREST, _FARTHEST = 0.005, 0.25  # of the diagonal of the workspace, between which that is looked for
_USUAL = 0.05  # of the diagonal: the radius where nothing tells it
_SPREAD = 0.2  # of the distance of two levels of a signal, within which values lie


class Variable(NamedTuple):
    """Columns that say one thing."""

    name: str  # of the object, or the predicate
    kind: str  # "fixture", "item", "gripper", "flag" or "word"
    columns: tuple[str, ...]
    owner: str = ""  # object that a flag or word is of; empty: the world
    words: tuple[str, ...] = ()  # of a column of words; of a flag of words: which mean false, true
    threshold: float = 0.5  # of a flag of numbers: above is true
    typical: tuple[float, ...] = ()  # of a fixture, the median of where it stood
    levels: tuple[float, ...] = ()  # of a flag or a gripper of numbers: the two that mean false, true


@dataclass(frozen=True)
class Vocabulary:
    """Objects and predicates of a set of states, and how near is near."""

    axes: tuple[str, ...]  # coordinates of places
    variables: tuple[Variable, ...]
    radius: float  # in the unit of the recordings: what lies within it is at a place
    closed_above: bool | None  # whether the gripper is closed above its threshold; None where no movement tells
    left_out: Mapping[str, str]  # columns that say nothing here -> why
    units: Mapping[str, str] = field(default_factory=dict)  # of columns, as far as they were said

    def of_kind(self, *kinds: str) -> list[Variable]:
        """Return the variables of some kinds, in order."""
        return [variable for variable in self.variables if variable.kind in kinds]

    @property
    def items(self) -> list[str]:
        """Names of the items."""
        return [variable.name for variable in self.of_kind("item")]

    @property
    def fixtures(self) -> list[str]:
        """Names of the fixtures."""
        return [variable.name for variable in self.of_kind("fixture")]

    @property
    def positions(self) -> list[str]:
        """Columns of positions: of the hand and of objects."""
        hand = [f"{HAND}_{axis}" for axis in self.axes]
        return hand + [column for variable in self.of_kind("item", "fixture") for column in variable.columns]

    @property
    def tells_grasp(self) -> bool:
        """Tell whether a gripper says what is held."""
        return self.closed_above is not None


def vocabulary_of(states: States, radius: float | None = None) -> Vocabulary:
    """Return the vocabulary of a set of states.

    The radius of places is by default where distances of the hand from the nearest object part into near and far.
    """
    columns = {name: k for k, name in enumerate(states.columns)}
    stems = [name.removesuffix(f"_{states.axes[0]}") for name in columns if name.endswith(f"_{states.axes[0]}")]
    axes_of = {stem: tuple(f"{stem}_{axis}" for axis in states.axes) for stem in stems if stem}
    positions = {stem: names for stem, names in axes_of.items() if columns.keys() >= {*names}}
    hand = positions.pop(HAND)
    if radius is not None and not radius > 0:
        raise SpecificationError(f"expected a radius of places above 0, got {radius!r}")
    ends = np.vstack([_columns(states, moment, hand) for moment in (states.before, states.after)])
    objects = {
        name: np.stack([_columns(states, m, p) for m in (states.before, states.after)]) for name, p in positions.items()
    }
    near = _radius(ends, [np.vstack(list(where)) for where in objects.values()]) if radius is None else float(radius)
    variables: list[Variable] = []
    left_out: dict[str, str] = {}
    ways = {name: np.linalg.norm(where[1] - where[0], axis=1) for name, where in objects.items()}
    move = {kind_of(name) for name, way in ways.items() if (way > near).any()}
    for name, where in objects.items():
        kind = "item" if kind_of(name) in move else "fixture"
        stood = where[np.isfinite(where).all(axis=2)]
        typical = tuple(np.median(stood, axis=0).tolist()) if kind == "fixture" and len(stood) else ()
        variables.append(Variable(name, kind, positions[name], typical=typical))
    names = sorted(objects, key=len, reverse=True)
    for column, k in columns.items():
        if column in hand or any(column in several for several in positions.values()):
            continue
        variable = _said(
            column, np.concatenate((states.before[:, k], states.after[:, k])), states.words.get(column), names
        )
        if (stem := column.rpartition("_"))[2] in states.axes and stem[0] and column not in states.words:
            others = ", ".join(f"{stem[0]}_{axis}" for axis in states.axes)
            variable = f"a position has all of {others}"
        if isinstance(variable, str):
            left_out[column] = variable
        else:
            variables.append(variable)
    variables = _told_apart(variables)
    vocabulary = Vocabulary(states.axes, tuple(variables), near, None, left_out, states.units)
    return replace(vocabulary, closed_above=_closed_above(states, vocabulary))


def kind_of(name: str) -> str:
    """Return the kind of an object: its name without the number at its end, so that block_1 and block_2 are blocks."""
    return re.sub(r"[ _\-]*\d+$", "", name) or name


def _columns(states: States, moment: Array, names: Sequence[str]) -> Array:
    return moment[:, [states.columns.index(name) for name in names]]


def _radius(ends: Array, objects: list[Array]) -> float:
    """Return the distance that parts near from far: the largest ratio of neighbors among the distances."""
    everything = np.vstack([ends, *objects])
    diagonal = float(np.linalg.norm(np.fmax.reduce(everything) - np.fmin.reduce(everything)))
    if objects:
        distances = np.fmin.reduce([np.linalg.norm(ends - where, axis=1) for where in objects])
    else:
        some = ends[np.linspace(0, len(ends) - 1, min(len(ends), 300)).astype(int)]
        distances = np.linalg.norm(some[:, None] - some[None], axis=2)[np.triu_indices(len(some), 1)]
    distances = np.sort(distances[np.isfinite(distances)])
    gaps = [
        (b / max(a, _NEAREST * diagonal), a, b)
        for a, b in pairwise(distances.tolist())
        if b > _NEAREST * diagonal and a < _FARTHEST * diagonal
    ]
    ratio, near, far = max(gaps, default=(0.0, 0.0, 0.0))
    if ratio < _SEPARATE:
        return max(_USUAL * diagonal, 1e-12)
    return float(np.sqrt(max(near, _NEAREST * diagonal) * min(far, _FARTHEST * diagonal)))


def _said(column: str, values: Array, words: tuple[str, ...] | None, objects: Sequence[str]) -> Variable | str:
    """Return the variable that a column is, or why it is none."""
    owner = next((name for name in objects if column.startswith(f"{name}_")), "")
    name = column.removeprefix(f"{owner}_") if owner else column
    levels = np.unique(values[np.isfinite(values)])
    if not len(levels):
        return "nothing is known of it"
    if words is not None:
        return _said_in_words(name, column, owner, words)
    kind = "gripper" if is_gripper(column) else "flag"
    low, high = float(levels[0]), float(levels[-1])
    if low == high:
        if kind == "gripper" or low not in (0.0, 1.0):
            return f"it is always {low:g}"
        return Variable(name, kind, (column,), owner, levels=(0.0, 1.0))
    middle = 0.5 * (low + high)
    if np.minimum(levels - low, high - levels).max() > _SPREAD * (high - low):
        return f"{len(levels)} different numbers are neither two levels nor a position with all of its axes"
    return Variable(name, kind, (column,), owner, threshold=middle, levels=(low, high))


def _said_in_words(name: str, column: str, owner: str, words: tuple[str, ...]) -> Variable | str:
    if len(words) > _MOST_WORDS:
        return f"{len(words)} different words, {first_names(words, 3)}, are no state"
    lower = [word.lower() for word in words]
    if {*lower} <= _TRUE | _FALSE and len(lower) <= 2 and sum(word in _TRUE for word in lower) <= 1:
        false = next((word for word in words if word.lower() in _FALSE), "")
        true = next((word for word in words if word.lower() in _TRUE), "")
        return Variable(name, "flag", (column,), owner, (false, true))
    return Variable(name, "word", (column,), owner, words)


def _told_apart(variables: list[Variable]) -> list[Variable]:
    """Return variables whose predicates are of one type each: "full" of items and of places become two."""
    items = {variable.name for variable in variables if variable.kind == "item"}

    def type_of(variable: Variable) -> str:
        return "world" if not variable.owner else "item" if variable.owner in items else "place"

    types: dict[str, set[str]] = {}
    for variable in variables:
        if variable.kind in _TELLING:
            types.setdefault(variable.name, set()).add(type_of(variable))
    return [
        variable._replace(name=f"{variable.name}-{type_of(variable)}")
        if variable.kind in _TELLING and (len(types[variable.name]) > 1 or variable.name in _OWN)
        else variable
        for variable in variables
    ]


def _closed_above(states: States, vocabulary: Vocabulary) -> bool | None:
    """Return the level of the gripper at which items go with the hand; None where none does."""
    gripper = next(iter(vocabulary.of_kind("gripper")), None)
    if gripper is None:
        return None
    k = states.columns.index(gripper.columns[0])
    levels = np.stack([states.before[:, k], states.after[:, k]]) > gripper.threshold
    steady = (levels[0] == levels[1]) & np.isfinite(states.before[:, k] + states.after[:, k])
    carried = np.zeros(len(states), bool)
    hand = tuple(f"{HAND}_{axis}" for axis in states.axes)
    way = _columns(states, states.after, hand) - _columns(states, states.before, hand)
    for item in vocabulary.of_kind("item"):
        moved = _columns(states, states.after, item.columns) - _columns(states, states.before, item.columns)
        goes_along = np.linalg.norm(moved - way, axis=1) < vocabulary.radius
        carried |= goes_along & (np.linalg.norm(moved, axis=1) > vocabulary.radius)
    votes = [int((carried & steady & (levels[0] == level)).sum()) for level in (False, True)]
    return None if votes[0] == votes[1] else votes[1] > votes[0]


def state_in(vocabulary: Vocabulary, state: State) -> dict[str, Any]:
    """Return a state in the columns of a vocabulary and in their units; refuse words where a position is expected."""
    result: dict[str, Any] = {}
    for head, column in _meant(vocabulary, state).items():
        if column in result:
            raise DataError(f"expected one column {column} in the state, got several, the last is {head}")
        value = state[head]
        if column in vocabulary.positions and isinstance(value, str):
            value = check_number_in(head, value_of(value))
        is_text = isinstance(value, str | None)
        result[column] = value if is_text else in_unit(value, head, vocabulary.units.get(column))
    return result


def _meant(vocabulary: Vocabulary, state: State) -> dict[str, str]:
    """Return head of a state -> column, which is one of the vocabulary in any case if one alone is meant."""
    plain = {head: split_head(head)[0] for head in state}
    known = [*vocabulary.positions, *(each.columns[0] for each in vocabulary.of_kind(*_TELLING)), *vocabulary.left_out]
    lower = [column.lower() for column in known]
    free = {
        name: column
        for name, column in zip(lower, known, strict=True)
        if lower.count(name) == 1 and column not in plain.values()
    }
    return {head: free.get(column.lower(), column) for head, column in plain.items()}


def unit_notes(vocabulary: Vocabulary, state: State) -> list[str]:
    """Say of which positions of a state the units are not told apart from those of a vocabulary, for want of one."""
    positions = {head: column for head, column in _meant(vocabulary, state).items() if column in vocabulary.positions}
    units = {(split_head(head)[1] or "", vocabulary.units.get(column, "")) for head, column in positions.items()}
    bare, others = {unit for own, unit in units if not own} - {""}, {own for own, unit in units if not unit} - {""}
    return [
        *(f"positions whose heads say no unit are taken in {unit}, that of the recordings" for unit in sorted(bare)),
        *(f"positions in {unit} are taken as they are: the domain says no unit of them" for unit in sorted(others)),
    ]


def position_of(names: Sequence[str], state: State) -> Array:
    """Return the position in some columns of a state; NaN where it is not known."""
    return np.array([_as_number(state.get(name)) for name in names])


def _as_number(value: Any) -> float:
    try:
        return math.nan if value is None else float(value)
    except (TypeError, ValueError):
        return math.nan


def hand_of(vocabulary: Vocabulary, state: State) -> Array:
    """Return where the hand is."""
    return position_of([f"{HAND}_{axis}" for axis in vocabulary.axes], state)


def nearest_place(vocabulary: Vocabulary, places: Mapping[str, Array], position: Array) -> str | None:
    """Return the nearest place within the radius; None where there is none, or the position is not known."""
    distances = {name: float(np.linalg.norm(place - position)) for name, place in places.items()}
    name = min(distances, key=lambda name: (np.isnan(distances[name]), distances[name]), default=None)
    return name if name is not None and distances[name] <= vocabulary.radius else None


def places_of(
    vocabulary: Vocabulary, states: Iterable[State], named: Mapping[str, Array] | None = None, prefix: str = "place"
) -> dict[str, Array]:
    """Return the places of some states, by name: fixtures, `named` ones, and wherever else an item or the hand is."""
    several = list(states)
    places = {}
    for fixture in vocabulary.of_kind("fixture"):
        known = [where for state in several if np.isfinite(where := position_of(fixture.columns, state)).all()]
        if known:
            places[fixture.name] = known[0]
    for name, where in (named or {}).items():
        places.setdefault(name, where)
    rests = []
    for state in several:
        held = _held(vocabulary, state)
        rests += [position_of(item.columns, state) for item in vocabulary.of_kind("item") if not held[item.name]]
    for where in [*rests, *(hand_of(vocabulary, state) for state in several)]:
        if np.isfinite(where).all() and nearest_place(vocabulary, places, where) is None:
            number = 1 + sum(name.startswith(f"{prefix}-") for name in places)
            while f"{prefix}-{number}" in places:
                number += 1
            places[f"{prefix}-{number}"] = where
    return places


def _held(vocabulary: Vocabulary, state: State) -> dict[str, bool | None]:
    """Tell of each item whether it is held: the nearest one, by a closed gripper; None where that is not known."""
    items = vocabulary.of_kind("item")
    if not vocabulary.tells_grasp:
        return {item.name: False for item in items}
    gripper = next(iter(vocabulary.of_kind("gripper")), None)
    is_above = None if gripper is None else _truth(gripper, state.get(gripper.columns[0]))
    if is_above is None or is_above != vocabulary.closed_above:
        return dict.fromkeys((item.name for item in items), None if is_above is None else False)
    hand = hand_of(vocabulary, state)
    away = {item.name: float(np.linalg.norm(position_of(item.columns, state) - hand)) for item in items}
    near = {name: distance for name, distance in away.items() if distance <= vocabulary.radius}
    nearest = min(near, key=lambda name: near[name], default=None)
    return {name: None if np.isnan(distance) else name == nearest for name, distance in away.items()}


def facts_of(vocabulary: Vocabulary, state: State, places: Mapping[str, Array]) -> dict[Fact, bool]:
    """Return what is true and false in a state; what is not among it is not known."""
    facts: dict[Fact, bool] = {}
    hand = hand_of(vocabulary, state)
    if np.isfinite(hand).all():
        at = nearest_place(vocabulary, places, hand)
        facts |= {("hand-at", place): place == at for place in places}
    facts |= _facts_of_items(vocabulary, state, places)
    owners: dict[str, set[str]] = {}
    for variable in vocabulary.of_kind(*_TELLING):
        facts |= _flags(vocabulary, variable, state)
        for name in _predicates(variable):
            owners.setdefault(name, set()).add(variable.owner)
    for predicate, names in owners.items():
        if "" not in names:  # an object without that column does not have the property
            others = vocabulary.items if names & {*vocabulary.items} else [*places]
            facts |= {(predicate, name): False for name in others if name not in names}
    return facts


def _facts_of_items(vocabulary: Vocabulary, state: State, places: Mapping[str, Array]) -> dict[Fact, bool]:
    """Return where items lie, what is held, and which places are clear."""
    facts: dict[Fact, bool] = {}
    held = _held(vocabulary, state)
    where: dict[str, str | None] = {}
    for item in vocabulary.of_kind("item"):
        position = position_of(item.columns, state)
        if held[item.name]:
            where[item.name] = None
        elif held[item.name] is False and np.isfinite(position).all():
            where[item.name] = nearest_place(vocabulary, places, position)
    for name, inside in where.items():
        facts |= {("in", name, place): place == inside for place in places}
    for place in places if vocabulary.items else ():
        if place in where.values():
            facts["clear", place] = False
        elif len(where) == len(vocabulary.items):
            facts["clear", place] = True
    if vocabulary.tells_grasp:
        facts |= {("holding", name): value for name, value in held.items() if value is not None}
        if None not in held.values():
            facts["hand-empty",] = not any(held.values())
    return facts


def _predicates(variable: Variable) -> list[str]:
    if variable.kind == "word":
        return [f"{variable.name}-{word}" for word in variable.words]
    return [variable.name]


def _flags(vocabulary: Vocabulary, variable: Variable, state: State) -> dict[Fact, bool]:
    arguments = (variable.owner,) if variable.owner else ()
    value = state.get(variable.columns[0])
    if variable.kind == "word":
        word = _word(value)
        return {
            (f"{variable.name}-{name}", *arguments): name == word for name in variable.words if word in variable.words
        }
    if variable.kind == "gripper" and vocabulary.tells_grasp:
        return {}  # it is said by holding and hand-empty
    truth = _truth(variable, value)
    return {} if truth is None else {(variable.name, *arguments): truth}


def _word(value: Any) -> str:
    """Return what a state says as a word; empty where it says nothing."""
    said = value_of(str(value))
    return f"{said:g}" if isinstance(said, float) else said or ""


def _truth(variable: Variable, value: Any) -> bool | None:
    """Tell whether a value of a flag means true, or one of a gripper its upper level; None where it means neither."""
    said, word = value_of(str(value)), _word(value)
    if variable.kind == "gripper" and word.lower() in ("true", "false"):
        if variable.levels and not np.allclose(variable.levels, (0.0, 1.0), atol=_SPREAD):
            return None  # is true an open one?
        said = float(word.lower() == "true")
    if isinstance(said, float) and not variable.words:
        away = min((abs(said - level) for level in variable.levels), default=0.0)
        is_level = variable.kind == "gripper" or away <= _SPREAD * float(np.ptp(variable.levels or 0.0))
        return said > variable.threshold if is_level else None
    if word in variable.words:
        return word == variable.words[1]
    is_listed = variable.kind == "flag" and word.lower() in _TRUE | _FALSE
    return word.lower() in _TRUE if is_listed else None


def value_notes(vocabulary: Vocabulary, state: State) -> list[str]:
    """Say which values of flags, words and grippers count as not known, since they are none that was learned."""
    notes = []
    for variable in vocabulary.of_kind(*_TELLING):
        word = _word(state.get(variable.columns[0]))
        is_known = word in variable.words if variable.kind == "word" else _truth(variable, word) is not None
        if word and not is_known:
            learned = first_names(variable.words or [f"{level:g}" for level in variable.levels], 12)
            notes.append(f"{variable.columns[0]} = {printable(word)} counts as not known: learned was {learned}")
    return notes


def predicates_of(vocabulary: Vocabulary) -> dict[str, tuple[str, ...]]:
    """Return predicate -> types of its arguments, "place" or "item"."""
    predicates: dict[str, tuple[str, ...]] = {"hand-at": ("place",)}
    if vocabulary.items:
        predicates |= {"in": ("item", "place"), "clear": ("place",)}
    if vocabulary.tells_grasp:
        predicates |= {"holding": ("item",), "hand-empty": ()}
    for variable in vocabulary.of_kind(*_TELLING):
        if variable.kind == "gripper" and vocabulary.tells_grasp:
            continue
        arguments = () if not variable.owner else ("item",) if variable.owner in vocabulary.items else ("place",)
        predicates |= dict.fromkeys(_predicates(variable), arguments)
    return predicates

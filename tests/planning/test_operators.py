"""Operators learned from states: the true ones come out, errors of sensors do not change them, doubts are said."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import tea_states as tea
from hypothesis import given
from hypothesis import strategies as st

from kineme.errors import DataError, SpecificationError
from kineme.planning import Edit, Literal, domain_from_dict, domain_to_dict, edited
from kineme.planning.domain import is_shown, operator_schema, unmade
from kineme.planning.operators import operators_of
from kineme.planning.states import States, value_of
from kineme.planning.vocabulary import Variable, Vocabulary, facts_of, value_notes, vocabulary_of

COLUMN = {name: k for k, name in enumerate(tea.COLUMNS)}


def _learned(states: States, **options):
    return operators_of(states, np.full(len(states), 2.0), {"stir": "sym-1"}, **options)


def test_the_true_operators_are_learned():
    domain = tea.domain()
    assert {operator.name: tea.literals(operator) for operator in domain.operators} == tea.TRUE
    assert all(operator.usable and operator.duration == 2.0 for operator in domain.operators)
    assert domain.vocabulary.fixtures == ["jar", "cup", "mug"]
    assert [parameter.kinds for parameter in domain.operator("carry").parameters] == [("jar",), ("cup", "mug")]


def test_the_order_of_movements_does_not_count():
    states, order = tea.states(), np.random.default_rng(1).permutation(48)
    shuffled = States(
        states.movements[order], tuple(states.symbols[k] for k in order), states.axes, states.columns,
        states.before[order], states.after[order], {},
    )  # fmt: skip
    for a, b in zip(_learned(states).operators, _learned(shuffled).operators, strict=True):
        assert tea.literals(a) == tea.literals(b)
        assert a.displacement == b.displacement


@pytest.mark.parametrize("column", ["spoon_full", "cup_sweet"])
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_misread_flag_changes_no_operator(column, when):
    for row in range(0, 48, 5):
        states = tea.states()
        moment = getattr(states, when)
        moment[row, COLUMN[column]] = 1 - moment[row, COLUMN[column]]
        assert {operator.name: tea.literals(operator) for operator in _learned(states).operators} == tea.TRUE


def test_without_an_error_rate_one_exception_counts():
    states = tea.states()
    row = states.symbols.index("scoop")
    states.before[row, COLUMN["spoon_full"]] = 1
    scoop = _learned(states, error_rate=0.0).operator("scoop")
    assert tea.literals(scoop)[0] == {"(hand-at ?at)", "(not (sweet ?at))"}


def test_what_was_so_before_and_after_several_times_is_no_precondition():
    states = tea.states()
    for row in [k for k, symbol in enumerate(states.symbols) if symbol == "carry"][:3]:
        states.before[row, COLUMN["spoon_full"]] = states.after[row, COLUMN["spoon_full"]] = 0
    assert "(spoon_full)" not in tea.literals(_learned(states).operator("carry"))[0]


def test_an_effect_that_comes_half_the_time_is_not_guessed_and_a_person_decides():
    states = tea.states()
    rows = [k for k, symbol in enumerate(states.symbols) if symbol == "scoop"]
    states.after[rows[::2], COLUMN["spoon_full"]] = 0
    scoop = _learned(states).operator("scoop")
    assert not scoop.usable
    assert any("(spoon_full): changed by 6 of 12" in text for text in scoop.cannot_tell)
    edit = Edit("scoop", "effect", Literal("spoon_full", ()), True)
    decided = _learned(states, edits=[edit])
    assert decided.operator("scoop").usable
    assert "(spoon_full)" in tea.literals(decided.operator("scoop"))[1]
    assert decided.edits == (edit,)


def test_few_movements_and_unknown_columns_are_said():
    states = tea.states(1)
    states.before[:, COLUMN["cup_sweet"]] = states.after[:, COLUMN["cup_sweet"]] = np.nan
    states.before[:, COLUMN["mug_sweet"]] = states.after[:, COLUMN["mug_sweet"]] = np.nan
    domain = _learned(states)
    assert domain.vocabulary.left_out == dict.fromkeys(("cup_sweet", "mug_sweet"), "nothing is known of it")
    assert "shown 2 times: preconditions hold much by chance" in domain.operator("stir").cannot_tell


def test_a_literal_that_is_mostly_not_known_is_no_precondition():
    states = tea.states()
    rows = [k for k, symbol in enumerate(states.symbols) if symbol == "carry"]
    states.before[rows[3:], COLUMN["spoon_full"]] = np.nan
    carry = _learned(states).operator("carry")
    assert "(spoon_full)" not in tea.literals(carry)[0]
    assert "(spoon_full): known in 3 of 12 movements" in carry.cannot_tell


def _gripped(closed: float, seed: int = 0) -> States:
    """Pick, carry and place of a block between two shelves, by a gripper that is `closed` when it holds something."""
    random = np.random.default_rng(seed)
    shelves = {"shelf1": np.array([0.0, 0.0]), "shelf2": np.array([1.0, 0.0])}
    columns = ("hand_x", "hand_z", "shelf1_x", "shelf1_z", "shelf2_x", "shelf2_z", "block_x", "block_z", "gripper")
    before, after, symbols = [], [], []

    def sensed(hand, block, held):
        values = [shelves[hand] + random.normal(0, 0.01, 2), *shelves.values()]
        where = values[0] if held else shelves[block] + [0.03, 0.0]
        return np.concatenate((*values, where + random.normal(0, 0.001, 2), [closed if held else 1.0 - closed]))

    at = "shelf1"
    for _ in range(6):
        to = "shelf2" if at == "shelf1" else "shelf1"
        for symbol, one, two in (
            ("pick", (at, at, False), (at, at, True)), ("carry", (at, at, True), (to, at, True)),
            ("place", (to, at, True), (to, to, False)),
        ):  # fmt: skip
            before.append(sensed(*one))
            after.append(sensed(*two))
            symbols.append(symbol)
        at = to
    return States(np.arange(len(symbols)), tuple(symbols), ("x", "z"), columns, np.array(before), np.array(after), {})


@pytest.mark.parametrize("closed", [0.0, 1.0])
def test_the_level_at_which_a_gripper_holds_is_found(closed):
    states = _gripped(closed)
    domain = _learned(states)
    assert domain.vocabulary.closed_above is bool(closed)
    assert domain.vocabulary.items == ["block"]
    pick, place = domain.operator("pick"), domain.operator("place")
    assert {"(in ?item ?at)", "(hand-empty)"} <= tea.literals(pick)[0]
    assert {"(holding ?item)", "(not (in ?item ?at))", "(clear ?at)", "(not (hand-empty))"} == tea.literals(pick)[1]
    assert {"(in ?item ?at)", "(hand-empty)", "(not (holding ?item))", "(not (clear ?at))"} == tea.literals(place)[1]
    assert pick.parameters[0].kinds == ("shelf",)  # shelf1 and shelf2 are of one kind


def test_columns_are_told_apart_and_what_says_nothing_is_named():
    states = tea.states(1)
    words = {"lid": ("closed", "open"), "cup_color": ("blue", "green", "red")}
    extra = np.tile([[0.0, 1.0, 5.0, 0.5]], (8, 1))
    extra[::2, 0], extra[:3, 1], extra[:, 3] = 1.0, 2.0, np.linspace(0, 1, 8)
    columns = (*states.columns, "lid", "cup_color", "always", "drift")
    more = [np.column_stack((moment, extra)) for moment in (states.before, states.after)]
    vocabulary = vocabulary_of(replace(states, columns=columns, before=more[0], after=more[1], words=words))
    told = {variable.columns[0]: variable for variable in vocabulary.variables}
    assert (told["lid"].kind, told["lid"].words) == ("flag", ("closed", "open"))
    assert (told["cup_color"].kind, told["cup_color"].owner, told["cup_color"].name) == ("word", "cup", "color")
    assert set(vocabulary.left_out) == {"always", "drift"}


@pytest.mark.parametrize(
    ("column", "value", "meant"),
    [
        *[("full", value, False) for value in (0, 0.1, False, np.False_, "False", "no", "0", "empty")],
        *[("full", value, True) for value in (1, 0.9, True, "true", "Yes", "1.0", "full")],
        *[("full", value, None) for value in (-1, 2, 0.49, "red", float("inf"), [1])],
        *[("lit", value, True) for value in (True, "True", "true", 1, "on")],
        *[("lit", value, None) for value in (0.5, -1, "red")],
        *[("color-red", "red", True), ("color-red", "green", False), ("color-red", "RED", None)],
        *[("holding cup", value, True) for value in (1, 0.7, True, "True")],
        *[("holding cup", value, False) for value in (0, False, "False")],
        ("holding cup", "open", None),
        ("width", True, None),
        *[(name, value, None) for name in ("full", "lit", "color-red") for value in (None, float("nan"), "", "-")],
    ],
)  # fmt: skip
def test_a_value_of_a_state_means_what_was_learned_or_is_not_known_and_named(column, value, meant):
    variables = (
        Variable("cup", "item", ("cup_x",)), Variable("full", "flag", ("full",), levels=(0.0, 1.0)),
        Variable("lit", "flag", ("lit",), words=("False", "True")),
        Variable("color", "word", ("color",), words=("green", "red")),
        Variable("width" if column == "width" else "grip", "gripper", ("grip",), threshold=0.5,
                 levels=(0.03, 0.97) if column != "width" else (0.03, 0.08)),
    )  # fmt: skip
    vocabulary = Vocabulary(("x",), variables, 1.0, None if column == "width" else True, {})
    head = {"color-red": "color", "holding cup": "grip", "width": "grip"}.get(column, column)
    state = {"hand_x": 0.0, "cup_x": 0.0, head: value}
    assert facts_of(vocabulary, state, {}).get(tuple(column.split())) is meant
    noted = [f"{head} = {value}"] if meant is None and value_of(str(value)) is not None else []
    assert [note.partition(" counts")[0] for note in value_notes(vocabulary, state)] == noted


def test_a_domain_survives_json_and_others_are_refused():
    domain = tea.domain()
    data = domain_to_dict(domain)
    assert domain_from_dict(json.loads(json.dumps(data))) == domain
    for wrong in ({}, [], {"format": "kineme-domain"}, data | {"version": 99}, data | {"operators": [{}]}):
        with pytest.raises(DataError, match="expected"):
            domain_from_dict(wrong)


def test_arguments_outside_what_was_shown_say_how_far():
    domain = tea.domain()
    carry, places = domain.operator("carry"), {name: np.array(where) for name, where in tea.PLACES.items()}
    assert is_shown(domain, carry, {"from": "jar", "to": "cup"}, places) == []
    assert "none of what was shown: cup, mug" in is_shown(domain, carry, {"from": "jar", "to": "home"}, places)[0]
    far = places | {"cup": np.array([2.0, 0.1])}
    reasons = is_shown(domain, carry, {"from": "jar", "to": "cup"}, far)
    assert any(reason.startswith("to = cup: x = 2 is") for reason in reasons)
    assert any(reason.startswith("the way of the hand") for reason in reasons)


def test_the_schema_of_an_operator_has_the_shown_box_as_bounds():
    domain = tea.domain()
    carry = domain.operator("carry")
    schema, margin = operator_schema(domain, carry), domain.vocabulary.radius
    assert schema["properties"]["to_x"]["minimum"] == carry.parameters[1].low[0] - margin
    assert schema["properties"]["to_x"]["maximum"] == carry.parameters[1].high[0] + margin
    assert schema["required"] == ["from", "to"]


@given(st.permutations(range(4)), st.booleans())
def test_edits_are_made_in_their_order_and_the_last_one_counts(order, last):
    domain = tea.domain(2)
    literal = Literal("sweet", ("at",))
    edits = [Edit("scoop", "effect", literal, k % 2 == 0) for k in order] + [Edit("scoop", "effect", literal, last)]
    assert ("(sweet ?at)" in tea.literals(edited(domain, edits).operator("scoop"))[1]) == last


def test_edits_follow_their_symbol_whatever_it_is_called():
    states, edit = tea.states(2), Edit("stir", "effect", Literal("served", ("at",)), True)
    before = operators_of(states, np.ones(len(states)), {"stir": "sym-1", "scoop": "sym-2"}, edits=[edit])
    data = domain_to_dict(before)
    del data["edits"][0]["symbol_id"]  # as files had it before
    edits = domain_from_dict(data).edits
    assert edits == before.edits == (edit._replace(symbol_id="sym-1"),)
    after = operators_of(states, np.ones(len(states)), {"scoop": "sym-1", "stir": "sym-2"}, edits=edits)
    served = ["(served ?at)" in tea.literals(after.operator(name))[1] for name in ("scoop", "stir")]
    assert (served, unmade(after)) == ([True, False], [])
    gone = operators_of(states, np.ones(len(states)), {"scoop": "sym-3", "stir": "sym-2"}, edits=edits)
    assert unmade(gone) == [*gone.edits] == [*edits]


def test_wrong_options_are_refused():
    states = tea.states(1)
    with pytest.raises(SpecificationError, match="radius"):
        _learned(states, radius=-1.0)
    with pytest.raises(SpecificationError, match="error_rate"):
        _learned(states, error_rate=0.7)
    with pytest.raises(SpecificationError, match="expected an operator of the domain"):
        _learned(states).operator("fly")

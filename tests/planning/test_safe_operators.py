"""Operators without sensor errors are safe: no fewer preconditions than those of SAM learning, and its effects."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import tea_states as tea
from hypothesis import given
from hypothesis import strategies as st

from kineme.planning.operators import _regularity, operators_of
from kineme.planning.states import States

COLUMNS = ("hand_x", "hand_z", "jar_x", "jar_z", "cup_x", "cup_z", "lamp", "door", "jar_full", "cup_full")
SEEN = ("(lamp)", "(door)", "(full ?at)")  # of the place where the hand is

operators = st.tuples(*[st.sampled_from([None, False, True])] * 6)  # needs and makes of each of SEEN
flags = st.lists(st.tuples(*[st.booleans()] * 5), min_size=1, max_size=12)  # lamp, door, both full, which place


def _world(operator, examples) -> tuple[States, np.ndarray]:
    """States of an operator that is done where its preconditions hold, and what is seen (n, 2, 3)."""
    rows, seen = [], []
    for lamp, door, *full, second in examples:
        before = [lamp, door, full[second]]
        before = [value if need is None else need for value, need in zip(before, operator[:3], strict=True)]
        after = [value if make is None else make for value, make in zip(before, operator[3:], strict=True)]
        place = [0.5, 0.0] if second else [0.0, 0.0]
        for moment in (before, after):
            full[second] = moment[2]
            rows.append([*place, 0.0, 0.0, 0.5, 0.0, *moment[:2], *full])
        seen.append((before, after))
    values = np.array(rows, dtype=float)
    n = len(examples)
    return States(np.arange(n), ("do",) * n, ("x", "z"), COLUMNS, values[::2], values[1::2], {}), np.array(seen)


@given(operators, flags)
def test_without_errors_preconditions_and_effects_are_those_of_safe_learning(operator, examples):
    states, seen = _world(operator, examples)
    learned = operators_of(states, np.ones(len(states)), {}, radius=0.1, error_rate=0.0).operator("do")
    needs, does = tea.literals(learned)
    for k, text in enumerate(SEEN):
        for value, literal in ((True, text), (False, f"(not {text})")):
            if (seen[:, 0, k] == value).all():
                assert literal in needs
            changes = (seen[:, 0, k] != value) & (seen[:, 1, k] == value)
            assert (literal in does) == changes.any()
    assert learned.usable


@pytest.mark.parametrize("counts", [c for c in itertools.product(range(4), repeat=4) if sum(c)])
def test_what_held_before_all_is_needed_and_only_what_came_after_all_is_decided(counts):
    table = np.array(counts).reshape(2, 2)
    before, after, decided = _regularity(table, 0.0)
    for value in (False, True):
        if not table[int(not value)].sum():
            assert before is value
        if not table[:, int(not value)].sum() and table[int(not value), int(value)]:
            assert after is value
    is_one_effect = not table[:, 0].sum() or not table[:, 1].sum() or table.trace() == table.sum()
    assert decided == is_one_effect


@given(st.tuples(*[st.integers(0, 12)] * 4).filter(any), st.sampled_from([0.0, 0.02, 0.1, 0.25]))
def test_a_predicate_and_its_opposite_are_learned_alike(counts, rate):
    table = np.array(counts).reshape(2, 2)
    before, after, decided = _regularity(table, rate)
    others = _regularity(table[::-1, ::-1], rate)
    assert others[2] == decided
    if decided:
        assert others[:2] == tuple(None if value is None else not value for value in (before, after))


def test_an_operator_whose_effect_is_not_decided_keeps_what_it_needs():
    states = tea.states()
    scoops = [row for row, symbol in enumerate(states.symbols) if symbol == "scoop"]
    states.after[scoops[::2], tea.COLUMNS.index("spoon_full")] = 0
    learned = operators_of(states, np.ones(len(states)), {}).operator("scoop")
    assert "(not (spoon_full))" in tea.literals(learned)[0]

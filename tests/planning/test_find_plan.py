"""Domains in PDDL, plans that keep within what was shown, behavior trees that py_trees executes."""

from __future__ import annotations

import functools
import json
import re
import warnings

import numpy as np
import pytest
import tea_states as tea
from hypothesis import given
from hypothesis import strategies as st

from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.planning import (
    Edit,
    Goal,
    Literal,
    domain_to_behavior_tree,
    domain_to_pddl,
    edited,
    edits_in,
    find_plan,
    plan_from_dict,
    plan_to_behavior_tree,
    plan_to_dict,
    problem_from_pddl,
    problem_of,
)
from kineme.planning.pddl import identifiers, parsed
from kineme.planning.problem import shown_arguments

pytest.importorskip("unified_planning")
GOAL = "(and (sweet cup) (sweet mug))"
STEPS = [
    "(reach place-1 jar)", "(scoop jar)", "(carry jar cup)", "(stir cup)",
    "(reach cup jar)", "(scoop jar)", "(carry jar mug)", "(stir mug)",
]  # fmt: skip


@pytest.fixture(scope="module")
def domain():
    return tea.domain()


@pytest.fixture(scope="module")
def plan(domain):
    return find_plan(problem_of(domain, tea.now(), GOAL))


def _makes_tea(plan):
    """Tell whether a plan is the one of eight steps, whichever of cup and mug comes first."""
    steps = [str(step) for step in plan.steps]
    swap = {"cup": "mug", "mug": "cup"}
    return steps in (STEPS, [re.sub("cup|mug", lambda word: swap[word[0]], step) for step in STEPS])


@pytest.mark.soak
def test_two_cups_of_tea_take_eight_steps(plan):
    assert _makes_tea(plan)
    assert plan.duration == 16.0
    carry = plan.steps[2]
    assert np.allclose(carry.goal, tea.PLACES[carry.arguments["to"]], atol=0.02)


def test_a_planner_without_costs_and_negative_preconditions_finds_one_too(domain):
    pytest.importorskip("up_pyperplan")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plan = find_plan(problem_of(domain, tea.now(), GOAL), "pyperplan")
    assert len(plan) == 8


def test_things_may_stand_elsewhere_within_what_was_shown(domain):
    moved = {name: value + 0.03 for name, value in tea.now().items() if name.endswith(("_x", "_z"))}
    carry = find_plan(problem_of(domain, tea.now(**moved), GOAL)).steps[2]
    assert np.allclose(carry.goal, np.array(tea.PLACES[carry.arguments["to"]]) + 0.03, atol=0.02)


@pytest.mark.parametrize(
    ("changes", "goal", "message"),
    [
        ({}, "(sweet jar)", "(stir jar) was not shown so: at = jar is none of what was shown: cup, mug"),
        ({"hand_x": 3.0}, "(sweet cup)", "was not shown so: from = here-"),
        ({"spoon_full": None}, "(sweet cup)", "(spoon_full) is not known"),
        ({"spoon_full": -1}, "(sweet cup)", "; spoon_full = -1 counts as not known: learned was 0, 1"),
        ({}, "(not (sweet cup))", None),
    ],
)
def test_a_goal_that_cannot_be_reached_says_what_is_missing(domain, changes, goal, message):
    state = {name: value for name, value in tea.now(**changes).items() if value is not None}
    if message is None:  # it holds already
        assert len(find_plan(problem_of(domain, state, goal))) == 0
        return
    with pytest.raises(SpecificationError, match=re.escape(message)):
        find_plan(problem_of(domain, state, goal))


@pytest.mark.parametrize(
    "goal",
    [
        "",
        "(",
        "sweet cup",
        "(or (sweet cup))",
        "(sweet)",
        "(sweet cup mug)",
        "(bitter cup)",
        "(sweet tea)",
        "(and)",
        "(not)",
        "(not (and (sweet cup) (sweet mug)))",
        "(and (hand-at jar) (hand-at cup))",
    ],
)
def test_a_goal_in_other_words_is_refused(domain, goal):
    with pytest.raises(KinemeError, match="expected"):
        problem_of(domain, tea.now(), goal)


def test_a_plan_survives_json_and_one_that_was_changed_is_refused(plan):
    data = json.loads(json.dumps(plan_to_dict(plan)))
    assert plan_to_dict(plan_from_dict(data)) == data
    for change in (
        lambda data: data["steps"].pop(0),
        lambda data: data["steps"][2]["arguments"].update(to="jar"),
        lambda data: data["places"].update(cup=[5.0, 5.0]),
        lambda data: data["steps"][0].update(goal=[0.3, 0.4]),
        lambda data: data["steps"][0].update(goal=[0.3]),
        lambda data: data["steps"][0].update(duration=-5),
        lambda data: data["goal"].append({"fact": ["sweet", "jar"], "value": True}),
        lambda data: data["steps"][0].update(operator="fly"),
        lambda data: data.pop("domain"),
    ):
        changed = json.loads(json.dumps(data))
        change(changed)
        with pytest.raises(KinemeError, match="expected"):
            plan_from_dict(changed)


def test_all_that_is_tried_takes_the_time_to_plan_together(domain, monkeypatch):
    shares = []
    monkeypatch.setattr("kineme.planning.plan.monotonic", lambda: sum(shares))
    monkeypatch.setattr("kineme.planning.plan._tried", lambda *task: shares.append(task[3]) or "none")
    with pytest.raises(DataError, match="give more time"):
        find_plan(problem_of(domain, tea.now(), GOAL), timeout=10)
    assert shares == [5, 2.5, 2.5]


def test_a_problem_in_pddl_is_planned_where_things_were_shown(domain):
    text = f"""(define (problem two) (:domain tea) (:objects jar cup mug - place)
        (:init (hand-at place-1) (= (total-cost) 0)) (:goal {GOAL}))"""
    assert _makes_tea(find_plan(problem_from_pddl(domain, text)))
    state = tea.now(spoon_full=1)  # of which the problem says otherwise
    empty = problem_from_pddl(domain, text.replace("(= (", "(not (spoon_full)) (= ("), state)
    assert empty.facts["spoon_full",] is False
    assert problem_from_pddl(domain, text.replace("place-1", "jar"), state).facts["hand-at", "place-1"] is False
    with pytest.raises(SpecificationError, match="whose position is known"):
        problem_from_pddl(domain, text.replace("mug - place", "mug glass - place"))
    with pytest.raises(DataError, match="goal"):
        problem_from_pddl(domain, "(define (problem two) (:init))")


def test_every_grounding_of_a_plan_was_shown(domain, plan):
    shown = {(operator.name, *arguments.values()) for operator, arguments in shown_arguments(plan.problem)}
    assert {(step.operator, *step.arguments.values()) for step in plan.steps} <= shown
    assert ("stir", "jar") not in shown


def test_what_a_person_changes_in_the_pddl_survives(domain):
    text = domain_to_pddl(domain, "tea")
    assert edits_in(text, domain) == []
    changed = text.replace("      (sweet ?at)\n", "      (sweet ?at)\n      (served ?at)\n")
    changed = re.sub(r"\(not \(sweet \?from\)\)[^\n]*\n", "\n", changed)
    edits = edits_in(changed, domain)
    assert edits == [
        Edit("carry", "precondition", Literal("sweet", ("from",), False), False),
        Edit("stir", "effect", Literal("served", ("at",), True), True),
    ]
    again = tea.domain(edits=edits)
    assert edits_in(domain_to_pddl(again, "tea"), again) == []
    plan = find_plan(problem_of(again, tea.now(), "(served cup)"))
    assert str(plan.steps[-1]) == "(stir cup)"


@pytest.mark.parametrize(
    ("goal", "got"),
    [
        ("sweet cup", "words outside, as 'sweet cup'"),
        ("", "0 expressions"),
        ("(sweet cup) (sweet mug)", "2 expressions"),
    ],
)
def test_a_goal_without_its_parentheses_is_refused_with_an_example(domain, goal, got):
    with pytest.raises(DataError, match=re.escape(f"as (sweet cup) or (and (sweet cup) (not (full cup))), got {got}")):
        problem_of(domain, tea.now(), goal)


def test_changes_that_fit_no_operator_are_refused(domain):
    text = domain_to_pddl(domain)
    other = edited(domain, [Edit("stir", "effect", Literal("served", ("at",)), True)])
    for wrong, message in (
        (domain_to_pddl(other), "expected the PDDL and the JSON of one call"),
        (text.replace("(sweet ?at)", "(sweet ?cup)"), "expected parameters of"),
        (text + ")", "without its"),
        (text.replace("(sweet ?at)", "(not (and (sweet ?at) (spoon_full)))"), "expected not of one literal"),
        ("(define (problem x))", "expected .define .domain"),
        ("(" * 500 + ")" * 500, "deep"),
    ):
        with pytest.raises(DataError, match=message):
            edits_in(wrong, domain)


@given(st.lists(st.text(max_size=30), max_size=8))
def test_identifiers_are_of_pddl_and_each_of_its_own(names):
    found = identifiers(names)
    assert len({*found.values()}) == len({*names})
    assert all(
        re.fullmatch(r"[a-z][a-z0-9_-]*", text) and text not in ("and", "not", "object") for text in found.values()
    )


HOSTILE = [
    "carry",
    "Carry",
    "car-ry",
    "sequence",
    "and",
    ")(:action x",
    '"><Sequence/>',
    "; drop",
    "\n\x00",
    "ö",
    "?from",
    "1",
    "shown carry",
]
#: Predicates that the parser of unified-planning takes for operators of PDDL.
OPERATORS = ["always", "sometime", "sometime-after", "sometime-before", "at-most-once", "assign", "decrease"]


def test_hostile_names_break_neither_pddl_nor_xml_nor_json(domain):
    from unified_planning.io import PDDLReader

    operators = tuple(
        edited_operator(domain.operators[k % len(domain.operators)], name) for k, name in enumerate(HOSTILE)
    )
    hostile = edited(domain, ())
    hostile = type(domain)(domain.vocabulary, operators, domain.places)
    edits = [Edit("carry", "precondition", Literal(name, (), False), True) for name in OPERATORS]
    hostile = edited(hostile, edits)
    problem = PDDLReader().parse_problem_string(domain_to_pddl(hostile, ")(evil"))
    assert len(problem.actions) == len(HOSTILE)
    assert edits_in(domain_to_pddl(hostile), hostile) == []
    nodes = re.findall(r'<Action ID="(\w+)"', domain_to_behavior_tree(hostile))
    assert len({node.lower() for node in nodes}) == len(HOSTILE)
    assert "Sequence" not in nodes
    parsed(domain_to_pddl(hostile))


def edited_operator(operator, name):
    from dataclasses import replace

    return replace(operator, name=name)


def test_py_trees_executes_the_tree_of_a_plan(plan, tmp_path):
    py_trees = pytest.importorskip("py_trees")
    from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml
    from py_trees.ports import PortInformation, PortsMixin

    done = []

    class Skill(PortsMixin, py_trees.behaviour.Behaviour, register=False):
        INPUT_PORTS = {  # noqa: RUF012 - as py_trees has it
            **{name: PortInformation(data_type=str, required=False) for name in ("from", "to", "at")},
            "duration": PortInformation(data_type=float),
            **{f"{end}_{axis}": PortInformation(data_type=float) for end in ("start", "goal") for axis in "xz"},
        }  # fmt: skip

        OUTPUT_PORTS = {}  # noqa: RUF012

        def __init__(self, name, symbol="", **options):
            super().__init__(name=name, **options)
            self.symbol = symbol

        def update(self):
            done.append((self.symbol, self.get_input("goal_x"), self.get_input("duration")))
            return py_trees.common.Status.SUCCESS

    path = tmp_path / "plan.xml"
    path.write_text(plan_to_behavior_tree(plan))
    nodes = {name: functools.partial(Skill, symbol=name.lower()) for name in ("Reach", "Scoop", "Carry", "Stir")}
    tree = parse_behaviour_tree_xml(str(path), "Plan", node_registry=nodes)
    for _ in range(20):
        tree.tick_once()
        if tree.status == py_trees.common.Status.SUCCESS:
            break
    assert tree.status == py_trees.common.Status.SUCCESS
    assert [symbol for symbol, *_ in done] == [step.operator for step in plan.steps]
    assert [goal for _, goal, _ in done] == [step.goal[0] for step in plan.steps]


def test_a_goal_says_itself():
    assert str(Goal(("in", "cup", "shelf"), False)) == "(not (in cup shelf))"

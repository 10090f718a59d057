"""Recordings, tables, names, domains and plans as strangers have them: read as meant, or refused in words."""

from __future__ import annotations

import copy
import json
import re
import time
from dataclasses import replace

import numpy as np
import pytest
import tea_states as tea

import kineme
from kineme import ActionLibrary
from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.planning import (
    Goal,
    domain_from_dict,
    domain_to_behavior_tree,
    domain_to_dict,
    domain_to_pddl,
    edited,
    edits_in,
    find_plan,
    learn_operators,
    move_to,
    operator_schema,
    plan_from_dict,
    plan_to_dict,
    problem_from_pddl,
    problem_of,
    skill_of,
    states_of,
)
from kineme.planning.figure import paths_of_plan
from kineme.planning.operators import operators_of
from kineme.planning.problem import shown_arguments
from kineme.planning.states import States
from kineme.planning.vocabulary import unit_notes


def _library(folder, heads, width=None):
    """A library of three movements to a cup at (0.5, 0.3, 0.1) and three back, with columns called `heads`."""
    u = np.linspace(0, 1, 60)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    random = np.random.default_rng(0)
    for label, a, b in (("go", (0.0, 0.0, 0.1), (0.5, 0.3, 0.1)), ("back", (0.5, 0.3, 0.1), (0.0, 0.0, 0.1))):
        for k in range(3):
            start, goal = np.array([a, b]) + random.normal(0, 0.01, (2, 3))
            path = start + (goal - start) * s[:, None] + np.sin(np.pi * u)[:, None] ** 2 * [0, 0.05, 0.1]
            extra = [] if width is None else [np.interp(u, [0.4, 0.6], width if label == "go" else width[::-1])]
            (folder / label).mkdir(exist_ok=True)
            np.savetxt(folder / label / f"{label}{k}.csv", np.column_stack((2 * u, *extra, path)), fmt="%.5f",
                       delimiter=",", header=f"t,{heads}", comments="")  # fmt: skip
    library = ActionLibrary(folder / "actions", create=True)
    for label in ("go", "back"):
        library.learn(kineme.read_recordings(folder / label), [label] * 3)
    return library


def _cup(library, heads=("cup_x", "cup_y", "cup_z")):
    ids = [str(k) for symbol in library.symbols() for k in symbol.members]
    moments = {"movement": ids * 2, "moment": ["before"] * 6 + ["after"] * 6}
    return moments | {head: [value] * 12 for head, value in zip(heads, (0.5, 0.3, 0.1), strict=True)}


@pytest.mark.parametrize(
    "heads",
    ["tip_x,tip_y,tip_z", "hand.x,hand.y,hand.z", "X,Y,Z", "x [mm],y [mm],z [mm]", "arm_pos_x,arm_pos_y,arm_pos_z"],
)
def test_objects_are_found_whatever_the_recordings_call_the_hand(tmp_path, heads):
    with _library(tmp_path, heads) as library:
        states = states_of(library)
        assert states.columns == ("hand_x", "hand_y", "hand_z")
        domain = learn_operators(library, _cup(library))
        assert domain.vocabulary.fixtures == ["cup"]
        assert domain.operator("go").parameters[1].kinds == ("cup",)


@pytest.mark.parametrize("heads", ["x [mm],y [mm],z [mm]", "x,y,z"])
def test_units_of_states_are_those_of_the_recordings(tmp_path, heads):
    """What the recordings do not say, the table does; a domain that knows none takes the numbers as they are."""
    bare, meters = (tuple(f"cup_{axis}{unit}" for axis in "xyz") for unit in ("", " [m]"))
    with _library(tmp_path, heads) as library:
        domain = learn_operators(library, _cup(library, meters))
        where = np.array([0.5, 0.3, 0.1]) * (1000 if "mm" in heads else 1)
        np.testing.assert_allclose(domain.vocabulary.variables[0].typical, where)
        plain = learn_operators(library, _cup(library, bare))
    domain = domain_from_dict(json.loads(json.dumps(domain_to_dict(domain))))
    now = {f"{name}_{axis} [cm]": 40.0 for name in ("hand", "cup") for axis in "xyz"}
    for each, place in ((domain, where[0] * 0.8), (plain, 400.0 if "mm" in heads else 40.0)):
        problem = problem_of(each, now, "(hand-at cup)")
        np.testing.assert_allclose(problem.places["cup"], [place] * 3)
        assert unit_notes(each.vocabulary, now) == (
            [] if each.vocabulary.units else ["positions in cm are taken as they are: the domain says no unit of them"]
        )
    with pytest.raises(DataError, match=r"expected cup_z \[kg\] in \[m"):
        problem_of(domain, {"cup_z [kg]": 1.0}, "(hand-at cup)")
    unit = "mm" if "mm" in heads else "m"
    assert f"taken in {unit}," in unit_notes(domain.vocabulary, {"cup_x": 0.4})[0]


def test_the_width_of_a_gripper_is_no_place_and_a_plan_is_drawn_beside_it(tmp_path):
    with _library(tmp_path, "gripper_width,x,y,z", (0.08, 0.03)) as library:
        skill = skill_of(library, "go")
        assert skill.axes == ("x", "y", "z")
        assert move_to(library, skill, [0, 0, 0.1], [0.5, 0.3, 0.1]).positions[0, -1, 0] == pytest.approx(
            0.03, abs=1e-3
        )
        domain = learn_operators(library, _cup(library))
        assert [variable.kind for variable in domain.vocabulary.variables] == ["fixture", "gripper"]
        now = {"hand_x": 0.0, "hand_y": 0.0, "hand_z": 0.1, "cup_x": 0.5, "cup_y": 0.3, "cup_z": 0.1}
        plan = find_plan(problem_of(domain, now | {"gripper_width": 0.08}, "(hand-at cup)"))
        [(_, path)] = paths_of_plan(plan, library)
        assert np.allclose(path[[0, -1]], [plan.steps[0].start, plan.steps[0].goal], atol=1e-3)


def test_a_coordinate_without_its_others_is_named(tmp_path):
    with _library(tmp_path, "x,y,z") as library:
        table = _cup(library)
        del table["cup_y"]
        assert (
            learn_operators(library, table).vocabulary.left_out["cup_x"] == "a position has all of cup_x, cup_y, cup_z"
        )
        with pytest.raises(DataError, match="equally long"):
            states_of(library, _cup(library) | {"lid": [1]})


def _of_names(**names):
    """The domain of tea with other names of its objects, and the state now."""
    states = tea.states()
    columns = tuple(re.sub("^(jar|cup|mug)", lambda match: names.get(match[0], match[0]), c) for c in states.columns)
    domain = operators_of(replace(states, columns=columns), np.full(len(states), 2.0), {})
    return domain, dict(zip(columns, tea.now().values(), strict=True))


@pytest.mark.parametrize(
    "name", ["place-1", "here-1", "shown-stir", "stir", "sweet", "spoon_full", "and", "?x", "a\nb", "杯"]
)
def test_an_object_may_have_any_name(name):
    domain, now = _of_names(cup=name)
    plan = find_plan(problem_of(domain, now, [Goal(("sweet", name))]))
    assert len(plan) == 4
    assert plan_to_dict(plan_from_dict(json.loads(json.dumps(plan_to_dict(plan))))) == plan_to_dict(plan)


def test_names_that_differ_by_case_are_told_apart():
    domain, now = _of_names(cup="cup", mug="CUP")
    assert problem_of(domain, now, "(sweet cup)").goal == (Goal(("sweet", "cup")),)
    assert problem_of(domain, now, "(sweet cup-2)").goal == (Goal(("sweet", "CUP")),)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(:action stir", "(:action mix", "expected the actions that kineme operators wrote"),
        ("(:action stir", "(:action (stir)", "expected the actions"),
        ("(sweet ?at)\n", "(sweet)\n", r"expected \(sweet place\) in stir"),
        ("(sweet ?at)\n", "(spoon_full ?at)\n", r"expected \(spoon_full\) in stir"),
        ("(sweet ?at)\n", "(sweet ?at) (not (sweet ?at))\n", "got both"),
        ("(not (hand-at ?to))  ;", "(not (= ?from ?to))  ;", "expected no = in the precondition of carry"),
        ("    :effect", "    :precondition (spoon_full)\n    :effect", "each once and with one expression, got :para"),
        ("    :effect", "    (spoon_full)\n    :effect", "each once and with one expression, got :para"),
    ],
)
def test_an_edit_that_a_planner_would_not_follow_is_refused(old, new, message):
    domain = tea.domain()
    text = domain_to_pddl(domain)
    with pytest.raises(KinemeError, match=message):
        domain_to_pddl(edited(domain, edits_in(text.replace(old, new), domain)))
    assert edits_in("\ufeff" + text, domain) == []


def test_an_empty_precondition_is_one():
    domain = tea.domain()
    text = re.sub(r":precondition \(and.*?\n    \)", ":precondition ()", domain_to_pddl(domain), flags=re.DOTALL)
    assert not any(operator.preconditions for operator in edited(domain, edits_in(text, domain)).operators)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("(:init (sweet)) (:goal (sweet cup))", "expected facts in the words"),
        ("(:init ()) (:goal (sweet cup))", r"expected literals .*, got \(\)"),
        ("(:init (at 5 (spoon_full))) (:goal (sweet cup))", r"expected literals .*, got \(at 5 \(spoon_full\)\)"),
        (
            "(:init (hand-at cup) (hand-at mug)) (:goal (sweet cup))",
            "got .hand-at cup. and .hand-at mug.: it is at one",
        ),
        ("(:init (spoon_full) (not (spoon_full))) (:goal (sweet cup))", "expected facts that hold together"),
        ("(:init) (:goal)", "with a goal"),
        ("(:objects (cup)) (:goal (sweet cup))", "names of objects"),
        ("(:init) (:goal (and (sweet cup) (not (sweet cup))))", "both true and false"),
        ("(:init) (:goal (sweet cup)) (:init (spoon_full))", "one section :init in PDDL, got 2"),
        ("(:init) (:goal (sweet cup) (sweet mug))", "one expression in :goal, got 2"),
    ],
)
def test_a_problem_that_says_nothing_is_refused(text, message):
    with pytest.raises(KinemeError, match=message):
        problem_from_pddl(tea.domain(2), f"(define (problem now) {text})")


def test_a_planner_that_is_not_there_and_places_that_are_none_are_refused():
    pytest.importorskip("unified_planning")
    domain = tea.domain(2)
    with pytest.raises(
        DataError, match=r"^expected the name of a planner that is installed, one of .{,200}, got 'nonesuch'$"
    ):
        find_plan(problem_of(domain, tea.now(), "(sweet cup)"), "nonesuch")
    with pytest.raises(KinemeError, match="place shelf"):
        problem_of(domain, tea.now(), "(sweet cup)", {"shelf": "top"})
    with pytest.raises(SpecificationError, match="whose position is known"):
        problem_of(domain, tea.now() | {"cup_x": float("nan")}, "(sweet cup)")


def _leaves(data, path=()):
    yield path
    children = data.items() if isinstance(data, dict) else enumerate(data[:1]) if isinstance(data, list) else ()
    for key, child in children:
        yield from _leaves(child, (*path, key))


def _changed(data, path, value):
    data = copy.deepcopy(data)
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return data


DOMAIN = domain_to_dict(tea.domain(2))
ODD = [None, 5, "text", [], {}, [[]], float("nan"), True, -1, 10**400, ["a", "b"], [1, 2, 3], [None]]


@pytest.mark.parametrize("value", ODD, ids=range(len(ODD)))
def test_a_damaged_domain_is_refused_or_still_works(value):
    for path in [path for path in _leaves(DOMAIN) if path]:
        try:
            domain = domain_from_dict(_changed(DOMAIN, path, value))
            domain_to_behavior_tree(domain)
            domain_to_pddl(domain)
            shown_arguments(problem_of(domain, tea.now(), "(sweet cup)"))
            json.dumps([domain_to_dict(domain), [operator_schema(domain, each) for each in domain.operators]])
        except KinemeError:
            pass


@pytest.mark.parametrize("value", [5, None, [1.0, None], [1.0], [10**400, 0.0], float("nan")])
def test_a_plan_with_a_damaged_place_is_refused(value):
    problem = problem_of(tea.domain(2), tea.now(), "(not (sweet cup))")
    with pytest.raises(DataError, match="expected a complete plan"):
        plan_from_dict(_changed(plan_to_dict(find_plan(problem)), ("places", "cup"), value))


def test_thousands_of_movements_to_as_many_places_take_seconds():
    random, n = np.random.default_rng(0), 4000
    ends = random.uniform(0, 1, (2, n, 2))
    ends[:, : n // 2] = random.normal(0.5, 0.001, (2, n // 2, 2))
    states = States(np.arange(n), ("go",) * n, ("x", "z"), ("hand_x", "hand_z"), ends[0], ends[1], {})
    began = time.process_time()
    domain = operators_of(states, np.ones(n), {}, radius=0.01)
    assert time.process_time() - began < 15  # 0.8 here, and a minute where each place is compared with each
    assert len(domain.places) == 60
    assert np.allclose(domain.places["place-1"], 0.5, atol=0.001)  # the mean of most visits


def test_why_a_goal_is_not_reached_names_each_operator_once():
    now = tea.now()
    del now["spoon_full"]
    with pytest.raises(SpecificationError, match="is not known") as caught:
        find_plan(problem_of(tea.domain(), now, "(sweet cup)"))
    assert re.findall(r"needs \((\w+)", str(caught.value)) == ["stir", "scoop"]


def test_a_folder_with_a_folder_for_each_label_is_read_and_equal_names_are_told_apart(tmp_path):
    with _library(tmp_path, "x,y,z") as library:
        ids = np.concatenate([symbol.members for symbol in library.symbols()])
    (tmp_path / "actions").rename(tmp_path / "other")
    for label, value in (("go", 0), ("back", 1)):
        for k in range(3):
            (tmp_path / label / f"{label}{k}.csv").rename(tmp_path / label / f"{k}.csv")
        (tmp_path / "states" / label).mkdir(parents=True)
        for k in range(3):
            table = f"t,lid\n0,{value}\n2,{value}\n"
            (tmp_path / "states" / label / f"{k}.csv").write_text(table)
    demonstrations = kineme.read_recordings([tmp_path / "go", tmp_path / "back"])
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demonstrations, ["go"] * 3 + ["back"] * 3)
        states = states_of(library, tmp_path / "states")
    assert len(states) == len(ids)
    lid = states.before[:, states.columns.index("lid")]
    assert [int(value) for value in lid] == [int(symbol == "back") for symbol in states.symbols]


def test_a_recording_without_a_table_takes_none_of_a_similar_name(tmp_path):
    with _library(tmp_path, "x,y,z") as library:
        table = {"time": [0, 2, 0, 2], "file": ["go1", "go1", "bac", "bac"], "lid": [0, 1, 0, 1]}
        states = states_of(library, table)
        note = learn_operators(library, table).operator("go").cannot_tell[0]
    known = np.isfinite(states.before[:, states.columns.index("lid")])
    assert known.sum() == 1
    assert note == "the states have no row before or after 2 of 3 movements"

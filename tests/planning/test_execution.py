"""Plans on a simulated arm: they reach their goal; what goes wrong is seen, said, and mended as far as it was shown."""

from __future__ import annotations

import json
from collections import deque
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("mujoco", reason="MuJoCo is not installed")

import kineme
from bench.execution import learned
from kineme.cli.main import main
from kineme.errors import DataError, SpecificationError
from kineme.planning import (
    Plan,
    check_steps,
    disturb,
    draw_execution,
    execute,
    learn_operators,
    plan_to_dict,
    problem_from_pddl,
    problem_of,
    read_plan,
    read_state,
    simulation_of,
    skill_of,
    under_way,
)
from kineme.planning.execution import frame_of, monitored
from kineme.planning.figure import paths_of_plan, write_moving
from kineme.planning.plan import step_of
from kineme.planning.problem import facts_after, shown_arguments, unmet
from kineme.planning.simulated import assume_flags
from kineme.robots import Simulation, load
from kineme.robots.execution.preflight import preflight
from kineme.robots.kinematics.descent import kinematics

OBJECTS = {"cup": (0.45, -0.05, 0.2), "mug": (0.35, 0.15, 0.2), "tray": (0.5, 0.25, 0.25), "shelf": (0.45, -0.3, 0.4)}
GOAL = "(and (in cup tray))"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("table")
    learned(folder).close()
    return folder


@pytest.fixture(scope="module")
def table(folder):
    with kineme.ActionLibrary(folder / "actions", read_only=True) as library:
        yield library, learn_operators(library, folder / "states.csv"), load("panda")


def shortest(problem):
    """Plan breadth first: small problems need no engine."""
    ways, waiting = shown_arguments(problem), deque([(dict(problem.facts), ())])
    seen = set()
    while waiting:
        facts, steps = waiting.popleft()
        if all(facts.get(goal.fact) is goal.value for goal in problem.goal):
            return Plan(problem, tuple(step_of(*pair, problem.places) for pair in steps), "breadth first")
        true = frozenset(fact for fact, value in facts.items() if value)
        if true not in seen:
            seen.add(true)
            waiting.extend((facts_after(facts, *pair), (*steps, pair)) for pair in ways if not unmet(facts, *pair))
    raise SpecificationError("expected a plan, there is none")


def unwatched(step, movement):
    return lambda t, tip: None


def begin(table, goal=GOAL, **options):
    _, domain, robot = table
    world = Simulation(robot, OBJECTS, **options)
    return shortest(problem_of(domain, read_state(world.state()), goal)), world


def run(table, plan, world, **options):
    library, _, robot = table
    return execute(plan, library, world, robot, **{"replan": shortest, "watcher": unwatched, **options})


def apart(world):
    state = world.state()
    return np.linalg.norm([state[f"cup_{axis}"] - state[f"tray_{axis}"] for axis in "xyz"])


def statuses(execution):
    return [(attempt.how, attempt.status) for attempt in execution.attempts]


def test_a_plan_reaches_its_goal_and_every_movement_keeps_the_limits(table):
    plan, world = begin(table, noise=0.0005)
    execution = run(table, plan, world, watcher=monitored(plan, table[0], table[2], frame_of(plan)), join=False)
    assert execution.reached
    assert execution.why == ""
    assert statuses(execution) == [("planned", "done")] * 3
    assert apart(world) < 0.02
    assert len(execution.runs) == len(execution.movements) == 3
    for movement, run_ in zip(execution.movements, execution.runs, strict=True):
        assert preflight(table[2], movement.trajectory).passed
        assert run_.tip_error < 1e-3
        assert run_.effort < 1
    assert execution.state["cup_x"] == pytest.approx(world.state()["cup_x"], abs=0.005)
    data = json.loads(json.dumps(execution.to_dict(), allow_nan=False))
    assert data["reached"] is True
    assert [row["step"] for row in data["attempts"]] == [str(step) for step in plan.steps]
    assert "The goal is reached." in execution.table().reading


def test_who_is_pushed_stops_and_goes_on(table):
    plan, world = begin(table)
    world.push((0.0, 35.0, 0.0), at=1.5)
    execution = run(table, plan, world)
    assert execution.reached
    assert apart(world) < 0.02
    assert statuses(execution)[:2] == [("planned", "stopped"), ("resumed", "done")]
    assert "cm from where it was sent" in execution.attempts[0].reasons[0]
    assert not execution.replans
    assert execution.runs[0].stopped is not None
    np.testing.assert_allclose(execution.movements[1].trajectory.positions[0], execution.runs[0].sent[-1], atol=1e-9)


def test_the_monitor_of_a_symbol_stops_what_leaves_it(table):
    library, _, robot = table
    plan, world = begin(table)
    world.push((0.0, 30.0, 0.0), at=1.5)
    execution = run(
        table, plan, world, leeway=1.0, watcher=monitored(plan, library, robot, frame_of(plan)), most_replans=1
    )
    assert execution.reached
    assert execution.attempts[0].status == "stopped"
    assert "outside what was shown" in execution.attempts[0].reasons[0]


@pytest.mark.parametrize(
    ("look_rate", "status", "reason"),
    [(0.0, "no effect", "(holding cup) is not so"), (10.0, "stopped", "cup has moved by 8.9 cm")],
)
def test_an_object_that_is_moved_is_fetched_from_where_it_is(table, look_rate, status, reason):
    plan, world = begin(table)
    world.place("cup", (0.41, 0.03, 0.2), at=1.5)  # on the way to it: who does not look closes the hand on nothing
    execution = run(table, plan, world, look_rate=look_rate)
    assert execution.reached
    assert apart(world) < 0.02
    assert statuses(execution)[:2] == [("planned", status), ("back", "done")]
    assert reason in execution.attempts[0].reasons
    assert look_rate == 0 or execution.runs[0].stopped < 1.75
    assert len(execution.replans) == 1
    assert len(execution.replans[0].steps) == 3
    went_back = execution.runs[1]
    np.testing.assert_allclose(went_back.tips[-1], execution.runs[0].tips[0], atol=0.02)
    assert execution.attempts[1].duration < 2 * execution.attempts[0].duration


@pytest.mark.soak
def test_a_hand_that_shook_goes_back_as_quickly(table):
    """What a person shows is not smooth; nearby samples of it say nothing of the way."""
    plan, world = begin(table)
    world.place("cup", (0.41, 0.03, 0.2), at=1.0)
    random = np.random.default_rng(0)
    steady = world.run

    def run_shaking(movement, watch=None):
        positions = movement.trajectory.positions
        positions += 2e-5 * random.normal(size=positions.shape)
        return steady(movement, watch)

    world.run = run_shaking
    execution = run(table, plan, world, look_rate=0.0)
    back = [attempt.duration for attempt in execution.attempts if attempt.how == "back"]
    assert back
    assert back[0] < 2 * execution.attempts[0].duration


def test_a_plan_goes_to_where_the_item_is_now(table):
    """Not to where another one stood when it was demonstrated, near by."""
    _, domain, _ = table
    world = Simulation(table[2], OBJECTS | {"cup": (0.48, -0.02, 0.205)})
    state = read_state(world.state())
    text = f"(define (problem today) (:domain d) (:objects) (:init) (:goal {GOAL}))"
    for problem in (problem_of(domain, state, GOAL), problem_from_pddl(domain, text, state)):
        np.testing.assert_allclose(shortest(problem).steps[0].goal, (0.48, -0.02, 0.205), atol=0.005)


def test_what_is_taken_out_of_the_hand_is_fetched_again(table):
    plan, world = begin(table)
    world.place("cup", (0.42, 0.0, 0.2), at=4.6)
    execution = run(table, plan, world)
    assert execution.reached
    steps = [attempt.step.split()[0] for attempt in execution.attempts]
    assert steps == ["(fetch", "(bring", "(back)", "(fetch", "(bring"]
    assert execution.attempts[1].reasons[0].startswith("cup has moved by")
    np.testing.assert_allclose(execution.runs[2].tips[-1], execution.runs[0].tips[0], atol=0.02)  # back by two steps


def test_who_is_stopped_on_the_way_back_stays_there(table):
    plan, world = begin(table)
    world.place("cup", (0.41, 0.03, 0.2), at=1.0)
    world.push((0.0, 35.0, 0.0), at=5.5)
    execution = run(table, plan, world, look_rate=0.0)
    assert not execution.reached
    assert statuses(execution) == [("planned", "no effect"), ("back", "stopped")]
    assert "the way back was stopped: the tip is" in execution.why


def test_a_fixture_that_is_moved_is_found_there(table):
    plan, world = begin(table)
    world.place("tray", (0.47, 0.22, 0.25), at=1.0)
    execution = run(table, plan, world)
    assert execution.reached
    assert not execution.replans
    assert apart(world) < 0.02


@pytest.mark.parametrize("name", ["cup", "tray"])
def test_an_object_that_is_gone_is_said(table, name):
    plan, world = begin(table)
    world.remove(name, at=5.0)
    execution = run(table, plan, world)
    assert not execution.reached
    assert execution.why == f"{name} is not seen"
    assert len(execution.attempts) == 2
    assert f"not reached: {name} is not seen" in execution.table().reading
    assert f"{name}_x" not in execution.state
    json.dumps(execution.to_dict(), allow_nan=False)


def test_who_loses_an_object_on_the_way_stops(table):
    plan, world = begin(table)
    world.remove("tray", at=1.0)  # needed later
    execution = run(table, plan, world)
    assert execution.why == "tray is not seen"
    assert execution.attempts[0].reasons == ("tray is not seen",)
    assert execution.runs[0].stopped < 1.25
    plan, world = begin(table)
    seen, missed = world.state, iter([False, False, True, False, True])

    def blinks():
        gone = {f"cup_{axis}": float("nan") for axis in "xyz"}
        return seen() | (gone if next(missed, False) else {})

    world.state = blinks
    assert run(table, plan, world).attempts[0].status == "done"  # one look alone may be an error


def test_steps_that_follow_each_other_are_one_movement(table):
    library, domain, robot = table
    plan, world = begin(table, noise=0.0005)
    execution = run(table, plan, world, watcher=monitored(plan, library, robot, frame_of(plan)))
    assert execution.reached
    assert apart(world) < 0.02
    assert statuses(execution) == [("planned", "done"), ("joined", "done")]
    assert execution.attempts[1].step == f"{plan.steps[1]} {plan.steps[2]}"
    assert preflight(robot, execution.movements[1].trajectory).passed
    assert execution.runs[1].tip_error < 1e-3
    away = np.linalg.norm(execution.runs[1].tips - OBJECTS["tray"], axis=1)
    assert away.min() < 0.5 * domain.vocabulary.radius
    stops = run(table, *begin(table), join=False)
    assert sum(each.duration for each in execution.attempts) < sum(each.duration for each in stops.attempts) - 0.25
    assert run(table, *begin(table), look_rate=0.0).attempts[1].how == "planned"  # who cannot look does not go on


def test_who_is_pushed_in_the_second_of_joined_steps_goes_on_with_it(table):
    plan, world = begin(table)
    world.push((0.0, 35.0, 0.0), at=8.0)
    done = []
    execution = run(table, plan, world, done=lambda step: done.append(step.operator))
    assert execution.reached
    assert statuses(execution) == [("planned", "done"), ("joined", "stopped"), ("resumed", "done")]
    assert execution.attempts[2].step == str(plan.steps[2])
    assert done == ["fetch", "bring", "drop"]


def test_what_the_next_of_joined_steps_needs_is_looked_at(table):
    plan, world = begin(table)
    world.place("cup", (0.42, 0.0, 0.2), at=4.6)
    execution = run(table, plan, world, look_rate=0.01)
    assert execution.attempts[1].how == "joined"
    assert "(holding cup) does not hold" in execution.attempts[1].reasons
    assert execution.reached


def test_no_steps_are_joined_where_an_effect_or_the_gripper_is_between(table):
    library, _, robot = table
    plan, _ = begin(table)
    assert [under_way.n_joinable(plan.problem, plan.steps[k:]) for k in range(3)] == [1, 2, 1]
    sent = [movement.trajectory for movement in check_steps(plan, library, robot).movements]
    overlap = under_way.overlap_of(robot, sent[1], sent[2], 0.02)
    opens = sent[2].times[np.argmax(sent[2].steps["gripper"] < 0.5)]
    assert 0.05 < overlap <= opens
    changed = replace(sent[2], steps={"gripper": 1.0 - sent[2].steps["gripper"]})
    assert under_way.overlap_of(robot, sent[1], changed, 0.02) is None
    assert under_way.overlap_of(robot, sent[1], sent[2], 0.0) < 0.1 * overlap
    times, positions, steps, begins = under_way.superposed(sent[1:], [overlap])
    assert begins == [0.0, pytest.approx(sent[1].duration - overlap)]
    assert times[-1] == pytest.approx(sent[1].duration + sent[2].duration - overlap)
    np.testing.assert_allclose(positions[[0, -1]], [sent[1].positions[0], sent[2].positions[-1]], atol=1e-6)
    assert np.flatnonzero(np.diff(steps["gripper"]))[0] * 0.01 == pytest.approx(begins[1] + opens, abs=0.02)


def test_what_was_not_shown_is_not_done(table):
    plan, world = begin(table)
    world.place("cup", (0.45, -0.4, 0.2))
    execution = run(table, plan, world)
    assert not execution.reached
    assert not execution.runs
    assert "does not hold" in execution.why
    assert "there is none" in execution.why


def test_replans_are_counted(table):
    plan, world = begin(table)
    world.push((0.0, 35.0, 0.0), at=1.5)
    execution = run(table, plan, world, most_replans=0)
    assert not execution.reached
    assert "was stopped: the tip is" in execution.why
    assert len(execution.attempts) == 1
    plan, world = begin(table)
    reasons = iter(["smoke", "smoke", "smoke", "smoke"])
    execution = run(table, plan, world, most_replans=1, watcher=lambda step, movement: lambda t, tip: next(reasons))
    assert execution.attempts[0].reasons == ("smoke",)
    assert len(execution.attempts) <= 2 + 3
    with pytest.raises(SpecificationError, match="most_replans"):
        run(table, plan, world, most_replans=-1)


def test_what_the_arm_cannot_do_is_refused_before_it_moves(table):
    library, _, _ = table
    plan, _ = begin(table)
    small = load("so101")
    world = Simulation(small, OBJECTS)
    state = begin(table)[1].state()
    world.state = lambda: state
    execution = execute(plan, library, world, small, replan=shortest, watcher=unwatched)
    assert not execution.reached
    assert not execution.runs
    assert execution.attempts[0].status == "refused"
    assert world.time == 0


def test_steps_are_checked_without_a_world(table):
    library, _, robot = table
    plan, _ = begin(table)
    execution = check_steps(plan, library, robot)
    assert [attempt.status for attempt in execution.attempts] == ["checked"] * 3
    assert not execution.reached
    assert "Nothing was executed" in execution.table().reading
    for before, after in zip(execution.movements, execution.movements[1:], strict=False):
        np.testing.assert_allclose(after.trajectory.positions[0], before.trajectory.positions[-1], atol=1e-9)
    far = check_steps(plan, library, robot, origin=(0.5, 0.0, 0.0)).attempts[-1]
    assert far.status == "refused"
    assert "--origin" in far.reasons[0]
    assert not any(option in far.reasons[0] for option in ("--at", "--scale", "--rest"))
    assert check_steps(plan, library, load("so101")).attempts[-1].status == "refused"


@pytest.mark.parametrize(("unit", "status"), [("meters", "checked"), (None, "checked"), ("mm", "refused")])
def test_movements_are_in_meters_however_these_are_spelled(plane, monkeypatch, unit, status):
    domain = learn_operators(plane)
    high = next(name for name, where in domain.places.items() if where[0] > 0.5)
    plan = shortest(problem_of(domain, {"hand_x": 0.4, "hand_z": 0.3}, f"(hand-at {high})"))
    in_unit = replace(skill_of(plane, "up"), units=(unit, unit))
    monkeypatch.setattr("kineme.planning.execution.skill_of", lambda *_: in_unit)
    [attempt] = check_steps(plan, plane, load("panda"), origin=(0.0, 0.1, 0.0)).attempts
    assert attempt.status == status
    assert (unit == "mm") == ("expected movements in meters" in "".join(attempt.reasons))


def test_the_world_of_a_plan_is_as_the_plan_has_it(table):
    plan, _ = begin(table)
    world = simulation_of(plan, table[2], noise=0.001, seed=3)
    assert set(world.state()) == {"gripper"} | {f"{name}_{axis}" for name in ("tip", *OBJECTS) for axis in "xyz"}
    state = read_state(simulation_of(plan, table[2]).state())
    where = np.array([state[f"cup_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(where, plan.problem.places[plan.steps[1].arguments["from"]], atol=1e-6)
    np.testing.assert_allclose([state[f"hand_{axis}"] for axis in "xyz"], plan.steps[0].start, atol=1e-3)
    disturb(world, ["push:0,1,0@0.5", "cup:0.4,0.1,0.2@0.2", "tray:gone@1"])
    assume_flags(world, plan)(plan.steps[0])
    for wrong in ("cup", "cup:gone", "cup:1,2@3", "push:a,b,c@1", ":1,2,3@1", "cup:1,2,3@x"):
        with pytest.raises(SpecificationError, match="expected a disturbance as push:"):
            disturb(world, [wrong])
    with pytest.raises(SpecificationError, match="expected one of the objects"):
        disturb(world, ["jar:gone@1"])


def test_a_first_place_in_millimeters_is_refused_with_what_can_be_done_here(table):
    with pytest.raises(SpecificationError, match=r"recordings in millimeters\? convert") as refused:
        simulation_of(begin(table)[0], table[2], origin=(450.0, 0.0, 0.0))
    assert "--scale" not in str(refused.value)


@pytest.mark.soak
def test_recordings_may_have_an_origin_of_their_own(table):
    library, _, robot = table
    plan, _ = begin(table)
    origin = (-0.03, 0.04, 0.02)
    world = simulation_of(plan, robot, origin=origin)
    np.testing.assert_allclose([world.state()[f"tray_{axis}"] for axis in "xyz"], np.add(OBJECTS["tray"], origin))
    execution = execute(plan, library, world, robot, replan=shortest, origin=origin, join=False)
    assert execution.reached
    assert not execution.replans
    assert apart(world) < 0.02
    np.testing.assert_allclose(execution.runs[1].tips[-1], np.add(OBJECTS["tray"], origin), atol=0.01)
    assert execution.state["tray_x"] == pytest.approx(OBJECTS["tray"][0])
    with pytest.raises(SpecificationError, match="origin as 3 finite numbers"):
        check_steps(plan, library, robot, origin=(0, 0))


@pytest.fixture
def plane(tmp_path):
    """A library of movements in a plane, without rests: up, along, and down again."""
    random = np.random.default_rng(0)
    u = np.linspace(0, 1, 80)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    corners = {"up": [[0.4, 0.3], [0.55, 0.4]], "along": [[0.55, 0.4], [0.45, 0.5]], "down": [[0.55, 0.4], [0.4, 0.3]]}
    for name, shown in corners.items():
        (tmp_path / "recordings" / name).mkdir(parents=True)
        for k in range(6):
            ends = np.array(shown) + random.normal(0, 0.003, (2, 2))
            path = ends[0] + s * (ends[1] - ends[0]) + 0.05 * np.sin(np.pi * s) * [0.0, 1.0]
            file = tmp_path / "recordings" / name / f"{k}.csv"
            np.savetxt(file, np.column_stack((2 * u, path)), fmt="%.5f", delimiter=",", header="t,x,z", comments="")
    learn = ["learn", str(tmp_path / "recordings"), "--library", str(tmp_path / "actions")]
    assert CliRunner().invoke(main, learn).exit_code == 0
    with kineme.ActionLibrary(tmp_path / "actions", read_only=True) as library:
        yield library


@pytest.mark.parametrize("axes", [("z", "y", "x"), ("y", "x"), ("x",), ("across", "up")])
def test_a_plan_in_other_coordinates_is_refused_with_what_to_do(axes):
    domain = SimpleNamespace(vocabulary=SimpleNamespace(axes=axes))
    with pytest.raises(SpecificationError, match=f"got {', '.join(axes)}; learn a new library .*--columns"):
        frame_of(SimpleNamespace(problem=SimpleNamespace(domain=domain)))


def test_a_plan_in_a_plane(plane):
    domain, robot = learn_operators(plane), load("panda")
    state = {"hand_x": 0.4, "hand_z": 0.3}
    high = next(name for name, where in domain.places.items() if where[0] > 0.5)
    plan = shortest(problem_of(domain, state, f"(hand-at {high})"))
    assert [step.operator for step in plan.steps] == ["up"]
    world = simulation_of(plan, robot, origin=(0.0, 0.1, 0.0))
    execution = execute(plan, plane, world, robot, replan=shortest, origin=(0.0, 0.1, 0.0))
    assert execution.reached
    np.testing.assert_allclose(execution.runs[0].tips[-1], (0.55, 0.1, 0.4), atol=0.01)
    np.testing.assert_allclose(execution.runs[0].tips[:, 1], 0.1, atol=2e-3)


def test_symbols_that_swapped_their_names_are_drawn_and_watched_as_in_the_plan(plane, tmp_path):
    domain, robot, origin = learn_operators(plane), load("panda"), (0.0, 0.1, 0.0)
    high = next(name for name, where in domain.places.items() if where[0] > 0.5)
    plan = shortest(problem_of(domain, {"hand_x": 0.4, "hand_z": 0.3}, f"(hand-at {high})"))
    [(_, path)] = paths_of_plan(plan, plane)
    with kineme.ActionLibrary(tmp_path / "actions") as library:
        for old, new in (("up", "other"), ("along", "up"), ("other", "along")):
            library.rename(old, new)
        np.testing.assert_array_equal(paths_of_plan(plan, library)[0][1], path)
        [movement] = check_steps(plan, library, robot, origin=origin).movements
        frame = frame_of(plan, origin)
        watch = monitored(plan, library, robot, frame)(plan.steps[0], movement)
        tips = kinematics(robot, movement.trajectory.positions[movement.first :])[0]
        times = movement.trajectory.times[movement.first :] - movement.begins
        assert not any(watch(t, tip) for t, tip in zip(times, tips, strict=True))


@pytest.mark.soak
def test_joined_steps_do_not_stop_between_them(plane):
    domain, robot = learn_operators(plane), load("panda")
    far = next(name for name, where in domain.places.items() if where[1] > 0.45)
    plan = shortest(problem_of(domain, {"hand_x": 0.4, "hand_z": 0.3}, f"(hand-at {far})"))
    assert [step.operator for step in plan.steps] == ["up", "along"]
    executions = {}
    for join in (True, False):
        world = simulation_of(plan, robot, origin=(0.0, 0.1, 0.0))
        executions[join] = execute(plan, plane, world, robot, replan=shortest, origin=(0.0, 0.1, 0.0), join=join)
        assert executions[join].reached
    (going,), (stops, _) = executions[True].runs, executions[False].runs
    away = np.linalg.norm(going.tips - stops.tips[-1], axis=1)
    assert away.min() < 0.5 * domain.vocabulary.radius
    speeds = np.linalg.norm(np.gradient(going.tips, going.times, axis=0), axis=1)
    assert speeds[50:-80].min() > 0.02
    assert going.times[-1] < sum(run_.times[-1] for run_ in executions[False].runs) - 0.5
    np.testing.assert_allclose(going.tips[-1], executions[False].runs[1].tips[-1], atol=2e-3)


@pytest.mark.soak
def test_pictures(table, tmp_path, monkeypatch):
    monkeypatch.setattr("kineme.planning.figure._MOST_FRAMES", 6)
    plan, world = begin(table)
    world.remove("cup", at=0.5)
    execution = run(table, plan, world, look_rate=0.0)
    assert len(draw_execution(execution, table[2]).axes) == 2
    from PIL import Image

    with Image.open(write_moving(tmp_path / "x.gif", execution, table[2])) as moving:
        assert 6 <= moving.n_frames <= 6 + len(execution.runs)
        durations, headings, reports = [], [], []
        for k in range(moving.n_frames):
            moving.seek(k)
            durations.append(moving.info["duration"])
            pixels = np.asarray(moving.convert("RGB"))
            is_orange = (pixels == (213, 94, 0)).all(axis=2)
            headings.append(is_orange[:40].any())
            reports.append(is_orange[-80:].any())
    assert durations == [120] * (len(durations) - 1) + [2500]  # in hundredths of a second
    assert headings[0] is np.False_  # nothing has happened yet
    assert any(headings)  # the cup is taken away
    assert [*map(bool, reports)] == [False] * (len(reports) - 1) + [True]  # the goal is not reached
    with pytest.raises(SpecificationError, match="nothing did"):
        write_moving(tmp_path / "y.gif", check_steps(plan, table[0], table[2]), table[2])


def shell(folder, *words):
    options = ["--library", str(folder / "actions"), "--robot", "panda"]
    return CliRunner().invoke(main, ["execute", *map(str, words), *options])


@pytest.mark.soak
def test_in_the_shell(table, folder, tmp_path):
    plan, _ = begin(table)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan_to_dict(plan)))
    report, picture = tmp_path / "run.json", tmp_path / "run.png"
    result = shell(folder, path, "--simulate", "--disturb", "cup:gone@0.5", "-o", report, "--plot", picture)
    assert result.exit_code == 1, result.output
    assert "cup is not seen" in result.output
    assert json.loads(report.read_text())["why"] == "cup is not seen"
    assert picture.stat().st_size > 1000
    again = shell(folder, path, "--simulate", "-o", report)
    assert again.exit_code == 2
    assert "is there" in again.output
    checked = shell(folder, path, "-o", tmp_path / "joints", "--json")
    assert checked.exit_code == 0, checked.output
    assert len(json.loads(checked.stdout)["written"]) == 4
    assert sorted(file.name for file in (tmp_path / "joints").iterdir())[1:] == [f"step-0{k}.csv" for k in (1, 2, 3)]
    stops = shell(folder, path, "--simulate", "--stop-at-each-step", "--disturb", "tray:gone@7.5", "--json")
    assert [attempt["how"] for attempt in json.loads(stops.stdout)["attempts"]] == ["planned"] * 3
    assert "--simulate" in shell(folder, path, "--disturb", "cup:gone@1").output
    assert "expected a folder" in shell(folder, path, "-o", tmp_path / "x.json").output


@pytest.mark.parametrize("text", ["", "[" * 5000, '{"format": "kineme-plan"}', '{"format": "other"}', "\udc80"])
def test_what_is_no_plan_is_refused(folder, tmp_path, text):
    path = tmp_path / "plan.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(DataError, match="expected a"):
        read_plan(path)
    result = shell(folder, path, "--simulate")
    assert result.exit_code == 1
    assert "expected a" in result.output

"""How slow is slow enough: short movements, weak arms, what a refusal says, steps of a gripper."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

import kineme
from arm_samples import simple_arm, stroke
from kineme.errors import KinemeError
from kineme.robots import InfeasibleError, load, move
from kineme.robots.planning import robot_movement
from soaking import SOAK, combined

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

TIMINGS = ["generated", "slowed", "fastest"]


def swing(robot, seconds, distance=0.8, n=60):
    """A movement of the first joint that begins and ends at a stand."""
    u = np.linspace(0, 1, n)
    joints = np.tile(robot.rest, (n, 1))
    joints[:, 0] += distance * (10 * u**3 - 15 * u**4 + 6 * u**5)
    return kineme.Trajectory(times=seconds * u, positions=joints)


@pytest.mark.parametrize("seconds", [1e-9, 1e-3, 0.05, 1.0])
def test_however_short_it_was_it_is_slowed_down_to_the_same_duration(seconds):
    robot = load("panda")
    made = move(stroke(robot, seconds), robot, timing="slowed")
    known = move(stroke(robot, 1.2), robot, timing="slowed")
    assert made.preflight.passed
    assert made.trajectory.duration == pytest.approx(known.trajectory.duration, rel=0.01)


@pytest.mark.parametrize(
    ("along_path", "as_shown", "chosen"),
    [
        ((False, 1.0), (True, 2.0), "as shown"),
        ((True, 2.0), (False, 1.0), "along path"),
        ((True, 2.0), (True, 1.0), "as shown"),
        ((False, 1.0), (False, 2.0), "along path"),
    ],
)
def test_of_the_two_timings_the_shorter_that_passes_is_taken(monkeypatch, along_path, as_shown, chosen):
    def made(name, passed, duration):
        preflight, trajectory = SimpleNamespace(passed=passed, slower=1.5), SimpleNamespace(duration=duration)
        return SimpleNamespace(name=name, factor=1.1, preflight=preflight, trajectory=trajectory)

    def slowed(planned, course, most, follows=False):
        return made("along path", *along_path) if follows else made("as shown", *as_shown)

    monkeypatch.setattr(robot_movement, "fastest", lambda robot, joints: "a parameterization")
    monkeypatch.setattr(robot_movement, "_slowed", slowed)
    planned = SimpleNamespace(robot=None, joints=None, rate=100.0)
    assert robot_movement.with_timing(planned, "fastest").name == chosen


@pytest.mark.soak
def test_what_a_refusal_promises_holds():
    robot = load("ur5e")
    for movement in (stroke(robot, 0.02), swing(robot, 0.3), stroke(robot, 0.4))[: 2 + SOAK]:
        with pytest.raises(InfeasibleError, match="It works in") as caught:
            move(movement, robot)
        promised = float(re.search(r"It works in ([\d.]+) s", str(caught.value))[1])
        made = move(movement, robot, timing="slowed")
        assert made.trajectory.duration - made.begins == pytest.approx(promised, rel=0.01)
        assert made.preflight.passed


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("timing", TIMINGS)
@pytest.mark.parametrize("limit", ["max_velocity", "max_acceleration"])
def test_an_approach_of_days_is_refused_before_it_fills_the_memory(timing, limit):
    robot = load("panda", **{limit: 1e-9})
    with pytest.raises(KinemeError, match=r"at most 1,000,000 samples|no timing of this path"):
        move(stroke(robot), robot, timing=timing)


def test_a_weak_arm_approaches_as_slowly_as_its_torques_demand(tmp_path):
    weak = simple_arm(tmp_path, effort=0.03, mass=0.5)
    start = np.array([-1.5, 1.57])
    movement = swing(weak, 20.0)
    joints = movement.positions + np.array([0.0, 1.57])
    made = move(kineme.Trajectory(times=movement.times, positions=joints), weak, space="joints", start=start)
    strong = move(
        kineme.Trajectory(times=movement.times, positions=joints),
        simple_arm(tmp_path, mass=0.5),
        space="joints",
        start=start,
    )
    assert made.preflight.passed
    assert made.begins > 1.05 * strong.begins


@pytest.mark.parametrize(("timing", "rate"), combined(TIMINGS, [20.0, 100.0, 1000.0], together=1))
def test_steps_hold_from_the_same_place_of_the_path_on_whatever_the_timing(timing, rate):
    robot = load("ur5e")
    movement = swing(robot, 0.6, n=121)
    grip = np.repeat([0.0, 1.0, 0.5], [30, 41, 50])
    made = move(
        movement,
        robot,
        space="joints",
        steps={"grip": grip},
        timing="slowed" if timing == "generated" else timing,
        rate=rate,
    )
    t = made.trajectory
    assert t.steps["grip"][0] == 0.0
    assert t.steps["grip"][-1] == 0.5
    moving = t.times >= made.begins - 1e-9
    at = np.flatnonzero(np.diff(t.steps["grip"]))
    assert len(at) == 2
    assert moving[at].all()
    for k, from_here in zip(at, (30, 71), strict=True):
        before, after = t.positions[k, 0], t.positions[k + 1, 0]
        assert before <= movement.positions[from_here, 0] <= after + 1e-9


def waiting(robot):
    """Out, one second at a stand, and on; its times, and its joints."""
    u = np.linspace(0, 1, 50)
    s = np.concatenate(((10 * u**3 - 15 * u**4 + 6 * u**5), np.ones(50), 1 + (10 * u**3 - 15 * u**4 + 6 * u**5)))
    joints = np.tile(robot.rest, (150, 1))
    joints[:, 0] += 0.5 * s
    return kineme.Trajectory(times=0.02 * np.arange(150), positions=joints)


@pytest.mark.parametrize(("closes", "opens"), [(65, 85), (60, 150)])
def test_a_gripper_that_waits_for_a_stand_is_not_timed_without_one(closes, opens):
    robot = load("ur5e")
    grip = np.zeros(150)
    grip[closes:opens] = 1.0
    for timing in ("generated", "slowed"):
        t = move(waiting(robot), robot, space="joints", steps={"grip": grip}, timing=timing).trajectory
        changed = np.flatnonzero(np.diff(t.steps["grip"])) + 1
        assert len(changed) == (2 if opens < 150 else 1)
        assert np.abs(t.velocities[changed]).max() < 1e-3
    with pytest.raises(InfeasibleError, match=r"steps of grip .* It works in 2.98 s instead of 0.9\d*: slow it down"):
        move(waiting(robot), robot, space="joints", steps={"grip": grip}, timing="fastest")


def test_a_gripper_that_closes_while_the_arm_moves_is_said_with_its_speed():
    """A rest at the beginning is left early when the goal is new; a gripper that closed in it closes in motion."""
    robot = load("ur5e")
    for closes, moving in ((25, True), (75, False)):
        grip = np.where(np.arange(150) >= closes, 1.0, 0.0)
        made = move(waiting(robot), robot, space="joints", steps={"grip": grip})
        (check,) = (one for one in made.preflight.checks if one.what == "steps")
        assert check.passed
        assert check.unit.endswith("moving") == np.isnan(check.limit) == moving
        assert (check.worst > 0.2) == moving


def test_joints_beyond_a_stop_need_another_goal_and_not_another_place():
    robot = load("panda")
    with pytest.raises(
        InfeasibleError, match=r"position of panda_joint1 .* No speed helps: choose another goal .*joints"
    ):
        move(swing(robot, 5.0, distance=3.0), robot)


def test_a_pulse_of_a_gripper_that_few_samples_would_lose_is_said_with_a_rate_that_keeps_it():
    robot = load("ur5e")
    grip = np.zeros(150)
    grip[70:71] = 1.0
    with pytest.raises(InfeasibleError, match=r"steps of grip at 0.00 s: 0, limit 2 changes. Choose .* of 100 samples"):
        move(waiting(robot), robot, space="joints", steps={"grip": grip}, rate=10.0)
    made = move(waiting(robot), robot, space="joints", steps={"grip": grip}, rate=100.0)
    assert made.trajectory.steps["grip"].sum() == 2

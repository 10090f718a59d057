"""An arm under live control keeps its limits whatever its goal does, catches up without overshooting, and says so."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from itertools import product as product_of
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import kineme
from arm_samples import stroke
from kineme.orientation import PoseDMP, exp, product
from kineme.robots import ArmController, ArmStatus, load
from kineme.robots.arm_controller import Braking, brakeable
from soaking import SOAK, combined, examples

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

MODELS = ("panda", "ur5e", "wam", "so101")
time_steps = st.floats(0.001, 0.02)
seeds = st.integers(0, 10_000)


@cache
def robot_of(name):
    return load(name)


@cache
def primitive(name, poses=False, seconds=2.0):
    robot = robot_of(name)
    there = stroke(robot, seconds)
    if not poses:
        return kineme.DMP().learn([there])
    turned = product(exp(np.linspace(0, 1, len(there.times))[:, None] * [0.5, -0.4, 0.8]), [0.0, 1.0, 0.0, 0.0])
    return PoseDMP().learn([np.column_stack((there.positions, turned))])


def drawn_goals(name, seed, dt, n):
    """What a goal may do: stand, move, jump within reach and beyond it, and leave the world."""
    rng = np.random.default_rng(seed)
    size = 0.1 if name == "so101" else 0.4
    goal, velocity = stroke(robot_of(name)).positions[-1].copy(), np.zeros(3)
    for _ in range(n):
        if rng.random() < 4 * dt:
            goal = stroke(robot_of(name)).positions[-1] + rng.normal(scale=size, size=3)
            if rng.random() < 0.1:
                goal *= 1e9
        if rng.random() < 4 * dt:
            velocity = rng.normal(scale=2 * size, size=3) * (rng.random() < 0.7)
        goal = goal + dt * velocity
        yield goal


def check_limits(robot, path, dt):
    """Of joints (T, n) that start at rest, by differences alone."""
    assert np.all((path >= robot.lower) & (path <= robot.upper))
    velocities = np.diff(path, axis=0, prepend=path[:1]) / dt
    assert np.all(np.abs(velocities) <= robot.velocity * (1 + 1e-9) + 1e-11 / dt)
    accelerations = np.diff(velocities, axis=0) / dt
    assert np.all(np.abs(accelerations) <= robot.acceleration * (1 + 1e-9) + 1e-14 / dt**2)


@pytest.mark.parametrize(
    ("name", "follow"),
    [*product_of(MODELS, ["full", "free"])] if SOAK else [*zip(MODELS, ["free", "full", "full", "free"], strict=True)],
)
@settings(max_examples=examples(1), deadline=None)
@example(0.001, 3, False)
@example(0.02, 5, True)
@given(time_steps, seeds, st.booleans())
def test_limits_hold_at_every_step_whatever_the_goal_does(name, follow, dt, seed, waits):
    robot = robot_of(name)
    options = {"feedback": "phase", "phase_stopping": 1e3} if waits else {}
    arm = ArmController(robot, primitive(name).controller(dt, **options), follow=follow)
    states = [arm.state, *(arm.step(goal=goal) for goal in drawn_goals(name, seed, dt, 250 if SOAK else 120))]
    check_limits(robot, np.array([state.joints for state in states]), dt)
    for before, after in pairwise(states):
        np.testing.assert_allclose(after.velocities * dt, after.joints - before.joints, atol=1e-14)
        np.testing.assert_allclose(after.accelerations * dt, after.velocities - before.velocities, atol=1e-12)


@pytest.mark.parametrize("name", MODELS[:3] if SOAK else MODELS[:1])
@settings(max_examples=examples(3), deadline=None)
@given(time_steps, seeds)
def test_limits_hold_for_poses_too(name, dt, seed):
    robot = robot_of(name)
    arm = ArmController(robot, primitive(name, True).controller(dt, duration=2.0))
    turned = np.random.default_rng(seed).normal(size=4)
    goals = (np.concatenate((goal, turned / np.linalg.norm(turned))) for goal in drawn_goals(name, seed, dt, 250))
    check_limits(robot, np.array([arm.state.joints, *(arm.step(goal=goal).joints for goal in goals)]), dt)


@settings(deadline=None)
@given(time_steps, seeds, st.floats(0, 1))
def test_joints_that_are_pushed_against_their_stops_brake_before_them(dt, seed, share):
    """Whatever velocity is wanted, at any limits: the range is never empty and no stop is passed."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2, 1, (4, 5))
    robot = SimpleNamespace(lower=-size[0], upper=size[1], velocity=size[2], acceleration=size[3])
    braking, q, v, path = Braking(robot, dt), np.zeros(5), np.zeros(5), [np.zeros(5)]
    wanted = rng.choice((-1e3, 1e3), 5)
    for _ in range(400):
        wanted = np.where(rng.random(5) < 0.01, -wanted, wanted)
        allowed = braking.range(q, v)
        assert np.all(allowed.least >= v - braking.change * (1 + 1e-9))
        v = allowed.nearest(wanted if rng.random() < share else rng.normal(scale=20, size=5))
        q = q + v * dt
        path.append(q)
    path = np.array(path)
    assert np.all((path >= robot.lower - 1e-12) & (path <= robot.upper + 1e-12))
    check_limits(robot, np.clip(path, robot.lower, robot.upper), dt)


@given(st.floats(1e-9, 1e3), st.floats(1e-4, 10), time_steps)
def test_the_fastest_velocity_that_can_be_braked_needs_all_of_the_distance(distance, change, dt):
    first = float(brakeable(np.array([distance]), np.array([change]), dt)[0])
    steps = np.ceil(first / change) + 1
    m = np.arange(steps)
    assert dt * np.maximum(first - m * change, 0).sum() == pytest.approx(distance, rel=1e-9)


@pytest.mark.parametrize(("name", "dt"), combined(MODELS, [0.001, 0.005, 0.02], together=1))
def test_what_was_missed_is_caught_up_without_overshooting(name, dt):
    """The movement starts with a jump of 10 cm: the tip must come back to it and pass it by no more than 1 mm."""
    robot = robot_of(name)
    arm = ArmController(robot, primitive(name).controller(dt, duration=20.0))
    there = arm.state.movement.position
    away = 0.1 * np.array([0.0, 0.6, 0.8]) * (0.4 if name == "so101" else 1)
    arm = ArmController(
        robot, primitive(name).controller(dt, duration=20.0, start=there + away), start=arm.state.joints
    )
    first = arm.state
    assert first.distance == pytest.approx(np.linalg.norm(away), abs=1e-5)
    assert first.status & ArmStatus.LAGS
    states = [arm.step() for _ in range(round(2.0 / dt))]
    assert states[2].status & ArmStatus.ACCELERATION_LIMIT
    distances = np.array([state.distance for state in states])
    reached = int(np.argmax(distances < 1e-3))
    assert reached > 0
    assert distances[reached:].max() < 1.5e-3
    assert not states[-1].status
    check_limits(robot, np.array([first.joints, *(state.joints for state in states)]), dt)


@pytest.mark.parametrize("name", MODELS if SOAK else MODELS[:1])
def test_an_arm_that_is_stretched_towards_a_goal_out_of_reach_comes_to_rest(name):
    arm = ArmController(robot_of(name), primitive(name).controller(0.005))
    goal = arm.state.movement.position + np.array([1.5, 0.2, 0.3])
    states = [arm.step(goal=goal) for _ in range(1600)]
    assert states[-1].distance > 0.05
    assert states[-1].status & ArmStatus.LAGS
    assert max(np.abs(state.velocities).max() for state in states[-100:]) < 0.05
    back = [arm.step(goal=stroke(arm.robot).positions[-1]) for _ in range(1600)]
    assert back[-1].distance < 1e-4
    assert not back[-1].status


def test_an_arm_that_follows_says_nothing_and_one_that_lags_says_why():
    robot = robot_of("panda")
    arm = ArmController(robot, primitive("panda").controller(0.005, duration=4.0))
    assert not any(arm.step().status for _ in range(800))
    slow = replace(robot, velocity=robot.velocity / 10)
    arm = ArmController(slow, primitive("panda").controller(0.005, duration=4.0))
    said = set().union(*(arm.step().status.messages for _ in range(800)))
    assert {ArmStatus.LAGS.messages[0], ArmStatus.VELOCITY_LIMIT.messages[0]} <= said
    assert ArmStatus.TORQUE_LIMIT.messages[0] not in said


def test_torques_are_those_of_the_model_and_are_reported():
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    from arm_samples import simulated

    robot = robot_of("panda")
    arm = ArmController(robot, primitive("panda").controller(0.005))
    states = [arm.step() for _ in range(200)]
    model = simulated(mujoco, robot)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data, state = mujoco.MjData(model), states[-1]
    data.qpos[:], data.qvel[:], data.qacc[:] = state.joints, state.velocities, state.accelerations
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(state.torques, data.qfrc_inverse, atol=0.01)  # MuJoCo's hand weighs a gram more
    assert not any(one.status & ArmStatus.TORQUE_LIMIT for one in states)
    weak = ArmController(replace(robot, effort=robot.effort / 10), primitive("panda").controller(0.005))
    assert weak.step().status == ArmStatus.TORQUE_LIMIT


def test_a_model_without_masses_has_no_torques():
    import pinocchio

    robot = robot_of("panda")
    model = robot.model.copy()
    for i in range(len(model.inertias)):
        model.inertias[i] = pinocchio.Inertia.Zero()
    state = ArmController(replace(robot, model=model), primitive("panda").controller(0.005)).step()
    assert np.isnan(state.torques).all()
    assert not state.status

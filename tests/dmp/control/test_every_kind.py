"""One contract: what every controller does, be its primitive discrete, rhythmic, an orientation or a pose."""

from __future__ import annotations

import copy
import inspect
import pickle

import numpy as np
import pytest

import kineme
from kineme.control import Controller, ObstacleAvoidance, Options, State, Status
from kineme.dmp.control.plan import Plan
from kineme.errors import SpecificationError
from kineme.orientation import PoseDMP, angle_between, exp

U = np.linspace(0.0, 1.0, 100)
RISE = U**3 * (10 - 15 * U + 6 * U**2)
TURN = exp(np.column_stack((0.3 * RISE, 0.8 * RISE * (1 - U), 1.5 * RISE)))  # about an axis that changes


def discrete():
    return kineme.DMP(n_basis=20, n_points=100).learn([np.outer(RISE, [1.0, 0.5, -0.2])])[0]


def rhythmic():
    t = np.linspace(0.0, 3.0, 300)
    wave = 2 * np.pi * t
    return kineme.RhythmicDMP().learn([kineme.Trajectory(t, np.column_stack((np.sin(wave), np.cos(wave), 0 * t)))])[0]


def orientation():
    return PoseDMP(kineme.DMP(n_basis=20)).learn([TURN])[0]


def pose():
    return PoseDMP(kineme.DMP(n_basis=20)).learn([np.hstack((np.outer(RISE, [1.0, 0.5, -0.2]), TURN))])[0]


KINDS = {"discrete": discrete, "rhythmic": rhythmic, "orientation": orientation, "pose": pose}
WITH_POSITIONS = ("discrete", "rhythmic", "pose")


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture(params=KINDS)
def moving(request):
    """A primitive of each kind."""
    return KINDS[request.param]()


@pytest.fixture(params=WITH_POSITIONS)
def steered(request):
    """A primitive of each kind that has positions."""
    return KINDS[request.param]()


def rollout_of(primitive, dt, n_steps):
    if isinstance(primitive, kineme.dmp.RhythmicPrimitives):
        return primitive.rollout(n_steps * dt / primitive.periods[0], n_samples=n_steps + 1)
    return primitive.rollout(duration=n_steps * dt, n_samples=n_steps + 1)


def controller_of(primitive, dt, n_steps, **options):
    if not isinstance(primitive, kineme.dmp.RhythmicPrimitives):
        options["duration"] = n_steps * dt
    return primitive.controller(dt, **options)


def states_of(controller, n, **told):
    return [controller.state, *(controller.step(**told) for _ in range(n))]


def column(states, name):
    return np.array([getattr(state, name) for state in states])


def test_it_is_one_controller_with_one_state(moving):
    controller = moving.controller(0.01)
    assert isinstance(controller, Controller)
    assert isinstance(controller.state, State)
    assert isinstance(controller.step(), State)
    assert isinstance(controller.reset(), State)


def test_an_editor_knows_every_option_and_everything_a_step_can_be_told(moving):
    options = set(inspect.signature(moving.controller).parameters)
    expected = set(inspect.signature(Options).parameters) - (
        {"settle"} if isinstance(moving, kineme.dmp.RhythmicPrimitives) else set()
    )
    assert expected <= options
    common = set(inspect.signature(Controller.step).parameters)
    assert common - {"self"} <= set(inspect.signature(moving.controller(0.01).step).parameters)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("dt", [0.003, 0.05])
def test_undisturbed_it_is_the_rollout(moving, twin, agree, dt):
    n = round(0.9 / dt)
    states, rollout = states_of(controller_of(moving, dt, n), n), rollout_of(moving, dt, n)
    agree(column(states, "time"), rollout.times[0], 1e-12)
    derivatives = {"position": rollout.positions, "velocity": rollout.velocities, "acceleration": rollout.accelerations}
    for name, expected in derivatives.items():
        agree(column(states, name), expected[0], 1e-8)


def test_reset_restores_everything(moving):
    controller = moving.controller(0.01, goal_filter=0.1, velocity_limit=1.0)
    first = states_of(controller, 30)
    for k in range(30):
        told = {"obstacles": [[0.5, 0.2, 0.0]]} if len(first[0].position) != 4 else {}
        controller.step(first[k].position, first[0].velocity + 1.0, first[9].position, 1.5, **told)
    again = [controller.reset(), *(controller.step() for _ in range(30))]
    for one, other in zip(first, again, strict=True):
        assert one.status == other.status
        for a, b in zip(one[:6], other[:6], strict=True):
            np.testing.assert_array_equal(a, b)


def test_velocity_limits_count_where_the_state_says_that_they_are_exceeded(moving):
    free = column(states_of(moving.controller(0.01), 90), "velocity")
    limit = float(np.median(np.abs(free).max(axis=1)))
    controller = moving.controller(0.01, velocity_limit=limit)
    hits = 0
    for k in range(1, 91):
        state = controller.step()
        np.testing.assert_array_equal(state.velocity, free[k])
        assert bool(state.status & Status.VELOCITY_LIMIT) is bool((np.abs(free[k]) > limit).any())
        hits += bool(state.status & Status.VELOCITY_LIMIT)
    assert 10 < hits < 80


def test_limits_may_differ_from_component_to_component(moving):
    free = column(states_of(moving.controller(0.01), 90), "velocity")
    widest = int(np.abs(free).max(axis=0).argmax())
    limit = np.full(free.shape[1], 1e6)
    assert not states_hit(moving.controller(0.01, velocity_limit=limit))
    limit[widest] = 0.5 * np.abs(free[:, widest]).max()
    assert states_hit(moving.controller(0.01, velocity_limit=limit))
    with pytest.raises(SpecificationError, match=f"velocity_limit to be a number above 0, or {len(limit)} of them"):
        moving.controller(0.01, velocity_limit=limit[1:])


def states_hit(controller):
    return any(state.status & Status.VELOCITY_LIMIT for state in states_of(controller, 90))


def test_acceleration_limits_count_jumps_too(moving):
    states = states_of(moving.controller(0.01), 90)
    largest = np.abs(column(states, "acceleration")).max()
    controller = moving.controller(0.01, acceleration_limit=1.5 * largest)
    for _ in range(30):
        assert not controller.step().status & Status.ACCELERATION_LIMIT
    assert controller.step(tempo=3.0).status & Status.ACCELERATION_LIMIT


def distance_to(path, point):
    return np.linalg.norm(path[:, :3] - point, axis=1).min()


@pytest.mark.soak("combinations")
def test_obstacles_are_avoided_and_the_movement_goes_on(steered, twin):
    n = 300
    free = column(states_of(controller_of(steered, 0.005, 200), n), "position")
    obstacle = free[100, :3]
    assert distance_to(free, obstacle) < 1e-9
    controller = controller_of(steered, 0.005, 200, avoidance=ObstacleAvoidance(reach=0.3))
    path = column(states_of(controller, n, obstacles=[obstacle]), "position")
    assert distance_to(path, obstacle) > 0.04
    after = column(states_of(controller, 600), "position")[-1]
    expected = column(states_of(controller_of(steered, 0.005, 200), n + 600), "position")[-1]
    np.testing.assert_allclose(after[:3], expected[:3], atol=1e-3)


def test_moving_obstacles_are_known_by_their_velocities(steered):
    free = column(states_of(steered.controller(0.01), 60), "position")
    there = [free[50, :3] + 0.05]
    still = column(states_of(steered.controller(0.01), 60, obstacles=there), "position")
    gone = column(
        states_of(steered.controller(0.01), 60, obstacles=there, obstacle_velocities=[[0.0, 9.0, 0.0]]), "position"
    )
    assert np.abs(still - gone).max() > 1e-3


def test_what_has_no_position_has_no_way_around():
    state = orientation().controller(0.01).step(obstacles=[[1.0, 0.0, 0.0]])
    assert state.status == Status.MOVING | Status.OBSTACLES_REJECTED


def test_obstacles_leave_the_course_of_the_orientation_alone():
    one, other = pose().controller(0.01), pose().controller(0.01)
    for _ in range(80):
        a, b = one.step(obstacles=[[0.5, 0.25, -0.1]]), other.step()
    np.testing.assert_allclose(a.position[3:], b.position[3:], atol=1e-12)
    assert np.abs(a.position[:3] - b.position[:3]).max() > 0.01


def other_goal(primitive):
    here = primitive.controller(0.01).state.goal.copy()
    if len(here) != 4:
        here[:3] += [0.3, -0.4, 0.2]
    return here if len(here) == 3 else np.concatenate((here[:-4], exp([0.1, 0.4, 1.1])))


def test_a_new_goal_is_reached_and_a_filter_glides_there(moving):
    goal = other_goal(moving)
    jumps, glides = moving.controller(0.01), moving.controller(0.01, goal_filter=0.2)
    for _ in range(70):
        before = jumps.step().acceleration, glides.step().acceleration
    jump, glide = jumps.step(goal=goal), glides.step(goal=goal)
    np.testing.assert_allclose(jump.goal, goal, atol=1e-12)
    assert 0 < np.abs(glide.goal - jump.goal).max() < np.abs(goal - jumps.reset().goal).max()
    changes = [np.abs(state.acceleration - a).max() for state, a in zip((jump, glide), before, strict=True)]
    assert changes[1] < 0.5 * changes[0]
    for _ in range(1500):
        state = glides.step(goal=goal)
    np.testing.assert_allclose(state.goal, goal, atol=1e-12)
    if not isinstance(moving, kineme.dmp.RhythmicPrimitives):
        assert state.status == Status.SETTLED
        np.testing.assert_allclose(state.position, goal, atol=1e-8)


def test_feedback_to_the_phase_waits_for_a_robot_that_is_held(moving):
    controller = moving.controller(0.01, feedback="phase", phase_stopping=1e3)
    free = moving.controller(0.01)
    held = controller.state.position
    for _ in range(60):
        state, expected = controller.step(position=held), free.step()
    assert state.progress < 0.7 * expected.progress
    assert state.time == expected.time


def test_a_coupling_is_an_acceleration(moving, agree):
    push = np.zeros(len(moving.controller(0.01).state.velocity))
    push[-1] = 0.7
    one, other = moving.controller(1e-6), moving.controller(1e-6)
    difference = one.step(coupling=push).acceleration - other.step().acceleration
    np.testing.assert_allclose(difference, push, atol=1e-4)


def test_a_measured_state_is_where_it_goes_on(moving):
    one, other = moving.controller(0.01), moving.controller(0.01)
    for _ in range(20):
        ahead = other.step()
    state = one.step(ahead.position, ahead.velocity, dt=1e-9)
    np.testing.assert_allclose(state.position, ahead.position, atol=1e-6)
    np.testing.assert_allclose(state.velocity, ahead.velocity, atol=1e-4)


def test_tempo_is_the_speed_of_the_same_path(moving, agree):
    slow, fast = moving.controller(0.01), moving.controller(0.005)
    for _ in range(60):
        one, other = slow.step(), fast.step(tempo=2.0)
        np.testing.assert_allclose(other.position, one.position, atol=1e-9)
    np.testing.assert_allclose(other.velocity, 2.0 * one.velocity, atol=1e-6)
    assert fast.step(tempo=0.0).status == Status.PAUSED


class Broken:
    def __array__(self, *_, **__):
        raise RuntimeError("the driver died")

    def __float__(self):
        raise RuntimeError("the driver died")


BAD = [np.full(3, np.nan), np.ones(5), "left", [[1.0], [2.0, 3.0]], object(), Broken(), np.full(4, 1e300), 2j]
REJECTIONS = {
    "position": Status.MEASUREMENT_REJECTED,
    "velocity": Status.MEASUREMENT_REJECTED,
    "goal": Status.GOAL_REJECTED,
    "coupling": Status.COUPLING_REJECTED,
    "tempo": Status.TEMPO_REJECTED,
    "dt": Status.DT_REJECTED,
    "obstacles": Status.OBSTACLES_REJECTED,
    "obstacle_velocities": Status.OBSTACLES_REJECTED,
}


@pytest.mark.parametrize("name", REJECTIONS)
def test_nothing_that_a_step_is_told_raises(moving, name):
    one, other = moving.controller(0.01), moving.controller(0.01)
    for bad in BAD:
        state, expected = one.step(**{name: bad}), other.step()
        assert state.status == Status.MOVING | REJECTIONS[name]
        for a, b in zip(state[:6], expected[:6], strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_twins_agree_whatever_happens(moving, monkeypatch, agree):
    controllers = []
    for choice in ("always", "never"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        controllers.append(moving.controller(0.02, goal_filter=0.1, velocity_limit=0.5))
    random, goal = np.random.default_rng(0), other_goal(moving)
    for _ in range(60):
        told = {"tempo": random.uniform(0.0, 3.0), "dt": random.uniform(0.001, 0.2)}
        if random.random() < 0.3:
            told["goal"] = goal
        if random.random() < 0.3:
            told["velocity"] = controllers[0].state.velocity + random.normal(size=len(controllers[0].state.velocity))
        if len(goal) != 4 and random.random() < 0.5:
            told |= {"obstacles": random.normal(size=(2, 3)), "obstacle_velocities": random.normal(size=(2, 3))}
        one, other = (controller.step(**told) for controller in controllers)
        assert one.status == other.status
        for a, b in zip(one[:6], other[:6], strict=True):
            agree(np.asarray(a), np.asarray(b), 1e-7)


def test_a_pose_says_where_it_is_and_how_it_is_turned():
    state = pose().controller(0.01).step()
    np.testing.assert_array_equal(state.pose, state.position)
    np.testing.assert_array_equal(state.orientation, state.position[3:])
    assert angle_between(state.orientation, TURN[0]) < 0.1


def test_a_controller_is_pickled_on_its_way_and_goes_on(moving, twin):
    going = moving.controller(0.01, goal_filter=0.1)
    for _ in range(20):
        going.step(goal=other_goal(moving))
    copies = pickle.loads(pickle.dumps(going)), copy.deepcopy(going)
    expected = states_of(going, 30)
    for other in copies:
        for ours, theirs in zip(states_of(other, 30), expected, strict=True):
            np.testing.assert_array_equal(np.hstack(ours[:6]), np.hstack(theirs[:6]))


def test_a_controller_is_made_from_a_plan():
    with pytest.raises(SpecificationError, match=r"expected the plan of one movement, got Primitives; write prim"):
        Controller(discrete(), 0.01, Options())
    assert Plan.__dataclass_params__.frozen

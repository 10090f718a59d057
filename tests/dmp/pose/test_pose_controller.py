"""Orientations and poses step by step: the rollout when nothing happens, the goal whatever happens, never an error."""

import numpy as np
import pytest
from hypothesis import given

import kineme
from kineme.control import Status
from kineme.orientation import PoseDMP, angle_between, conjugate, exp, product
from rotation_samples import carry, random_quaternions, seeds, tumble, turn

DEMONSTRATIONS = {"orientation": tumble, "pose": carry, "more than pi": lambda seed: turn(5.0)[0]}
kinds = pytest.mark.parametrize("kind", ["orientation", "pose"])


def learn(kind, seed=0):
    return PoseDMP(kineme.DMP(n_basis=20)).learn([DEMONSTRATIONS[kind](seed)])


def goal_of(kind, seed):
    q = random_quaternions(seed + 9, 1)[0]
    return q if kind == "orientation" else np.concatenate(([0.3, -0.2, 0.5], q))


@kinds
@given(seeds)
def test_undisturbed_it_is_the_rollout(kind, seed):
    primitives, goal = learn(kind, seed), goal_of(kind, seed)
    rollout = primitives.rollout(goal=goal, duration=2.0, n_samples=21)
    control = primitives.controller(0.1, goal=goal, duration=2.0)
    states = [control.state, *(control.step() for _ in range(20))]
    for name, values in (
        ("pose", rollout.poses),
        ("velocity", rollout.velocities),
        ("acceleration", rollout.accelerations),
    ):
        size = 1 + np.abs(values).max()
        np.testing.assert_allclose(
            [getattr(state, name) for state in states], values[0], atol=1e-9 * size, err_msg=name
        )


@kinds
@given(seeds)
def test_it_reaches_a_goal_that_turns_and_moves_after_a_push(kind, seed):
    control, goal = learn(kind, seed).controller(0.02), goal_of(kind, seed)
    for k in range(400):
        state = control.step(
            goal_of(kind, seed + 1) if k == 20 else None, goal=-goal if k % 2 and kind == "orientation" else goal
        )
        assert abs(np.linalg.norm(state.pose[-4:]) - 1) < 1e-9
    assert state.status == Status.SETTLED
    assert angle_between(state.pose[-4:], goal[-4:]) < 1e-6
    np.testing.assert_allclose(state.pose[:-4], goal[:-4], atol=1e-6)


@pytest.mark.parametrize("kind", DEMONSTRATIONS)
def test_the_measured_state_of_another_run_is_that_run(kind):
    one, other = learn(kind).controller(0.02), learn(kind).controller(0.02)
    for k in range(30):
        now = other.state
        measured = (
            {"position": now.pose * [*[1] * (len(now.pose) - 4), *[-1] * 4], "velocity": now.velocity} if k else {}
        )
        np.testing.assert_allclose(one.step(**measured).pose, other.step().pose, atol=1e-9)


def test_velocities_are_those_of_the_path():
    control = learn("orientation").controller(1e-4)
    for _ in range(3000):
        state = control.step()
    before, after = state.pose, control.step().pose
    turned = product(after, conjugate(before))
    np.testing.assert_allclose(turned, exp(1e-4 * state.velocity), atol=2e-7)


class Broken:
    def __array__(self, *_, **__):
        raise RuntimeError("the driver died")


BAD = [[np.nan, 0, 0, 0], [2.0, 0, 0, 0], [1.0, 0, 0], "left", 1.0, [], object(), Broken()]
STATUS = {
    "position": Status.MEASUREMENT_REJECTED,
    "velocity": Status.MEASUREMENT_REJECTED,
    "goal": Status.GOAL_REJECTED,
}


@pytest.mark.parametrize("name", STATUS)
@pytest.mark.parametrize("value", BAD, ids=range(len(BAD)))
def test_nothing_raises_in_mid_motion(name, value):
    one, other = learn("orientation").controller(0.02), learn("orientation").controller(0.02)
    if name == "velocity" and value == [1.0, 0, 0]:
        value = [1.0, 0, 0, 0]
    for k in range(5):
        state, expected = one.step(**({name: value} if k == 2 else {})), other.step()
        np.testing.assert_array_equal(state.pose, expected.pose)
        assert state.status == (Status.MOVING | STATUS[name] if k == 2 else Status.MOVING)


def test_one_primitive_at_a_time():
    both = PoseDMP().learn([tumble(0), tumble(1)])
    with pytest.raises(
        kineme.errors.SpecificationError,
        match=r"expected one primitive to control, got 2; choose one: primitives\[0\].controller\(dt\)",
    ):
        both.controller(0.02)
    with pytest.raises(kineme.errors.SpecificationError, match="got 3"):
        both[0].controller(0.02, goal=random_quaternions(0, 3))
    with pytest.raises(kineme.errors.TrajectoryError, match=r"goal: .*expected a unit quaternion"):
        both[0].controller(0.02, goal=[2.0, 0, 0, 0])


@pytest.mark.soak("combinations")
@kinds
@pytest.mark.parametrize("size", [1e3, 1e10, 1e49, 1e90, 1e149])
def test_however_fast_it_is_said_to_turn_what_comes_back_is_a_pose(kind, size):
    control, draw = learn(kind).controller(0.01), np.random.default_rng(0)
    for k in range(40):
        pushed = size * draw.normal(size=6)[-len(control.state.velocity) :]
        state = control.step(velocity=pushed if k % 3 == 0 else None, coupling=pushed if k % 5 == 0 else None)
        assert np.isfinite(np.concatenate((state.position, state.velocity, state.acceleration))).all()
        assert abs(np.linalg.norm(state.orientation) - 1.0) < 1e-9
    for _ in range(3000):
        state = control.step()
    assert angle_between(state.orientation, state.goal[-4:]) < 1e-3

"""Poses through via points, to goals that move, within limits: over formulations, in a batch and step by step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme import DMP, Demonstrations
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, PosePrimitives, conjugate, exp, log, product
from soaking import examples

SPECIFICATIONS = [
    DMP(name, n_basis=25, n_points=120, gating=gating)
    for name in FORMULATIONS
    if name != "amplitude-scaled"
    for gating in GATINGS
]
each = pytest.mark.parametrize("dmp", SPECIFICATIONS, ids=lambda dmp: f"{dmp.formulation}-{dmp.gating}")
seeds = st.integers(0, 10**6)


def demonstrations(n=3, seed=0, turn=1.2):
    """Poses that move and turn about all axes, from other orientations to others."""
    rng, u = np.random.default_rng(seed), np.linspace(0, 1, 90)[:, None]
    s = u**3 * (10 - 15 * u + 6 * u**2)
    blocks = []
    for _ in range(n):
        x = s * rng.choice([-1, 1], 3) * rng.uniform(0.3, 0.6, 3) + 0.1 * np.sin(np.pi * u) * rng.normal(size=3)
        p = (s - 1) * turn * rng.choice([-1, 1], 3) * rng.uniform(0.4, 0.8, 3)
        p += 0.2 * turn * np.sin(np.pi * u) ** 2 * rng.normal(size=3)
        q = product(exp(p), exp(rng.normal(size=3)))
        blocks.append(np.concatenate((x, q), axis=1))
    return Demonstrations.from_arrays(blocks, times=[np.linspace(0, 2.0 + i, 90) for i in range(n)])


def angle(one, other):
    """How far quaternions are turned from each other [rad]."""
    return np.linalg.norm(log(product(one, conjugate(other))), axis=-1)


def beside(poses, rng, far=0.05, turned=0.3):
    """Poses near these, with quaternions of either sign."""
    q = product(exp(turned * rng.normal(size=(*poses.shape[:-1], 3))), poses[..., 3:])
    q = q * rng.choice([-1, 1], (*poses.shape[:-1], 1))
    return np.concatenate((poses[..., :3] + far * rng.normal(size=(*poses.shape[:-1], 3)), q), axis=-1)


@each
@settings(max_examples=examples(3, 8), deadline=None)
@given(seed=seeds)
def test_poses_are_met_with_start_goal_and_velocities(dmp, seed):
    rng = np.random.default_rng(seed)
    primitives = PoseDMP(dmp).learn(demonstrations(seed=seed))
    asked = {"goal": beside(primitives.goals, rng), "duration": 3.0, "n_samples": 101}
    plain = primitives.rollout(**asked)
    first, second = beside(plain.poses[:, 30], rng), beside(plain.poses[:, 70], rng)
    first[:, 3:], second[:, 1] = np.nan, np.nan
    end_velocity = 0.1 * rng.normal(size=(3, 6))
    path = primitives.rollout(**asked, via=[(0.7, second), (0.3, first)], end_velocity=end_velocity)
    near = {"rtol": 0, "atol": 1e-8}
    np.testing.assert_allclose(path.poses[:, 30, :3], first[:, :3], **near)
    np.testing.assert_allclose(path.poses[:, 70, [0, 2]], second[:, [0, 2]], **near)
    np.testing.assert_allclose(angle(path.orientations[:, 70], second[:, 3:]), 0, atol=1e-6)
    np.testing.assert_allclose(path.poses[:, 0, :3], plain.poses[:, 0, :3], **near)
    np.testing.assert_allclose(angle(path.orientations[:, 0], plain.orientations[:, 0]), 0, atol=1e-6)
    np.testing.assert_allclose(path.velocities[:, 0], plain.velocities[:, 0], **near)
    np.testing.assert_allclose(path.poses[:, -1, :3], asked["goal"][:, :3], **near)
    np.testing.assert_allclose(angle(path.orientations[:, -1], asked["goal"][:, 3:]), 0, atol=1e-6)
    np.testing.assert_allclose(path.velocities[:, -1], end_velocity, **near)


def stepped(controller, n):
    states = [controller.state] + [controller.step() for _ in range(n - 1)]
    return {
        "positions": np.array([one.position for one in states]),
        "velocities": np.array([one.velocity for one in states]),
        "accelerations": np.array([one.acceleration for one in states]),
    }


@each
@settings(max_examples=examples(2, 4), deadline=None)
@given(seed=seeds)
def test_the_controller_moves_the_same(dmp, seed):
    rng = np.random.default_rng(seed)
    one = PoseDMP(dmp).learn(demonstrations(1, seed))
    plain = one.rollout(n_samples=41).poses[0]
    low = plain[:, :3].min(axis=0) - 0.5
    asked = {"goal": beside(one.goals[0], rng), "via": [(0.4, beside(plain[16], rng))], "end_velocity": [0.1] * 6}
    asked["position_limits"] = (low, np.inf)
    path = one.rollout(**asked, n_samples=41)
    states = stepped(one.controller(path.times[0, 1], **asked), 41)
    for name, numbers in states.items():
        np.testing.assert_allclose(numbers, getattr(path, name)[0], rtol=1e-7, atol=1e-8)


@each
@settings(max_examples=examples(2, 4), deadline=None)
@given(seed=seeds)
def test_goals_that_move_and_turn_are_those_of_the_controller(dmp, seed):
    rng = np.random.default_rng(seed)
    one = PoseDMP(dmp).learn(demonstrations(1, seed))
    velocity, goal = np.append(0.1 * rng.normal(size=3), 0.3 * rng.normal(size=3)), beside(one.goals[0], rng)
    path = one.rollout(goal=goal, goal_velocity=velocity, n_samples=51)
    controller = one.controller(path.times[0, 1], goal=goal)
    states = [controller.step(goal=goal, goal_velocity=velocity)] + [controller.step() for _ in range(49)]
    # The goal begins to move in the first step: the state at rest before it does not know of it.
    for name, numbers in (("position", path.positions), ("velocity", path.velocities)):
        np.testing.assert_allclose([getattr(state, name) for state in states], numbers[0, 1:], rtol=1e-6, atol=1e-7)
    tau, last = one.durations[0], rng.normal(size=6)
    other = one.rollout(goal=goal, goal_velocity=velocity, end_velocity=0.2 * last, n_samples=3)
    np.testing.assert_allclose(other.velocities[0, -1], 0.2 * last, atol=1e-8)
    reached = one.rollout(goal=goal, goal_velocity=velocity, end_velocity=velocity, n_samples=3)
    np.testing.assert_allclose(reached.poses[0, -1, :3], goal[:3] + tau * velocity[:3], atol=1e-8)
    there = product(exp(tau * velocity[3:]), goal[3:])
    np.testing.assert_allclose(angle(reached.orientations[0, -1], there), 0, atol=1e-6)
    np.testing.assert_allclose(reached.velocities[0, -1], velocity, atol=1e-8)


def test_a_batch_goes_as_its_members():
    rng = np.random.default_rng(1)
    primitives = PoseDMP(DMP(n_basis=25)).learn(demonstrations(4))
    points = beside(primitives.rollout(n_samples=11).poses[:, 4], rng)
    points[::2, 3:] = np.nan
    moving = 0.05 * rng.normal(size=(4, 6))
    together = primitives.rollout(via=[(0.4, points)], goal_velocity=moving)
    for i in range(4):
        alone = primitives[i].rollout(via=[(0.4, points[i])], goal_velocity=moving[i])
        np.testing.assert_allclose(alone.positions[0], together.positions[i], atol=1e-10)
        np.testing.assert_allclose(together[[i]].velocities[0], alone.velocities[0], atol=1e-9)
    points = beside(np.tile(primitives[1].rollout(n_samples=11).poses[0, 4], (4, 1)), rng)
    many = primitives[1].rollout(via=[(0.4, points)])
    assert many.poses.shape == (4, 200, 7)
    np.testing.assert_allclose(many.poses[1], primitives[1].rollout(via=[(0.4, points[1])]).poses[0], atol=1e-10)


def test_the_long_way_round_stays_the_long_way():
    """A tool that turns by 5 rad is met where 4.2 rad are still to go, and not turned the other way."""
    u = np.linspace(0, 1, 100)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    one = PoseDMP().learn([exp(np.outer(5.0 * s, [0, 0, 1.0]))])
    via = exp([0.1, 0.0, 0.7])
    path = one.rollout(via=[(0.3, -via)], n_samples=101)
    np.testing.assert_allclose(angle(path.orientations[0, 30], via), 0, atol=1e-6)
    assert path.angular_velocities[0, :, 2].min() > -1.0
    turned = np.trapezoid(path.angular_velocities[0, :, 2], path.times[0])
    assert turned == pytest.approx(5.0, abs=0.1)


def test_a_stretch_of_poses_is_followed():
    one = PoseDMP(DMP(n_basis=40)).learn(demonstrations(1))
    u = np.linspace(0.4, 0.6, 21)
    plain = one.rollout(n_samples=1001).poses[0, np.round(1000 * u).astype(int)]
    bump = np.sin(np.pi * (u - 0.4) / 0.2)[:, None]
    asked = np.concatenate((plain[:, :3] + 0.05 * bump, product(exp(bump * [0.1, 0.2, 0.0]), plain[:, 3:])), axis=1)
    path = one.rollout(via=[((0.4, 0.6), asked)], n_samples=1001).poses[0, np.round(1000 * u).astype(int)]
    assert np.abs(path[:, :3] - asked[:, :3]).max() < 1e-3
    assert angle(path[:, 3:], asked[:, 3:]).max() < 2e-3


def test_several_orientations_go_through_points():
    channels = (
        Channel("a", "orientation", ("aw", "ax", "ay", "az"), None, "wxyz"),
        Channel("x", "position", ("x",)),
        Channel("b", "orientation", ("bw", "bx", "by", "bz"), None, "wxyz"),
    )
    shown = demonstrations(2)
    columns = np.concatenate((shown.positions[:, 3:], shown.positions[:, :1], shown.positions[::-1, 3:]), axis=1)
    two = PoseDMP(DMP(n_basis=25)).learn(
        Demonstrations.of_movements(of_channels(Demonstrations.from_arrays(np.split(columns, 2)).movements, channels))
    )
    point = two[0].rollout(n_samples=11).positions[0, 5]
    point[1:5] = product(exp([0.1, 0.0, 0.2]), point[1:5])
    point[5:] = np.nan
    asked = {"via": [(0.5, point)], "end_velocity": np.full(7, 0.1)}
    path = two[0].rollout(**asked, n_samples=11)
    np.testing.assert_allclose(path.positions[0, 5, 0], point[0], atol=1e-9)
    np.testing.assert_allclose(angle(path.orientations[0, 5, :4], point[1:5]), 0, atol=1e-6)
    states = stepped(two[0].controller(path.times[0, 1], **asked), 11)
    np.testing.assert_allclose(states["positions"], path.positions[0], atol=1e-8)
    own = PosePrimitives.from_rollout(path)
    assert own.channels == channels
    np.testing.assert_allclose(own.rollout(n_samples=11).positions, path.positions, atol=1e-9)


def test_a_modulated_pose_is_a_primitive_of_its_own(tmp_path):
    one = PoseDMP(DMP(n_basis=25)).learn(demonstrations(1))
    points = beside(np.tile(one.rollout(n_samples=3).poses[0, 1], (3, 1)), np.random.default_rng(0))
    path = one.rollout(via=[(0.5, points)], end_velocity=[0.1] * 6, duration=4.0)
    own = PosePrimitives.from_rollout(path)
    assert len(own) == 3
    for again in (own, PosePrimitives.load(own.save(tmp_path / "own.kineme"))):
        np.testing.assert_allclose(again.rollout().poses, path.poses, atol=1e-10)
    with pytest.raises(SpecificationError, match="goals at rest"):
        PosePrimitives.from_rollout(one.rollout(goal_velocity=[0.1] * 6))


def test_an_empty_list_meets_the_goal():
    one = PoseDMP(DMP(n_basis=12, fit="forcing")).learn(demonstrations(1))
    goal = one.goals[0]
    assert np.abs(one.rollout().poses[0, -1, :3] - goal[:3]).max() > 1e-6
    path = one.rollout(via=[]).poses[0, -1]
    np.testing.assert_allclose(path[:3], goal[:3], atol=1e-12)
    np.testing.assert_allclose(angle(path[3:], goal[3:]), 0, atol=1e-7)


def test_positions_stay_within_limits_and_orientations_as_they_were():
    one = PoseDMP(DMP(n_basis=40)).learn(demonstrations(1, 5))
    plain = one.rollout()
    low, high = plain.poses[0, :, :3].min(axis=0), plain.poses[0, :, :3].max(axis=0)
    ends = one.tangent.starts[0, :3], one.goals[0, :3]
    limits = (np.minimum(low, -9.0), np.maximum(*ends) + 0.25 * np.maximum(1e-3, high - np.maximum(*ends)))
    assert (high > limits[1]).any()
    path = one.rollout(position_limits=limits)
    assert (path.poses[0, :, :3] <= limits[1] + 1e-6).all()
    np.testing.assert_allclose(path.orientations, plain.orientations, atol=1e-5)  # the goal is met exactly
    with pytest.raises(SpecificationError, match="movements with positions, got orientations alone"):
        PoseDMP().learn([demonstrations(1)[0].positions[:, 3:]]).rollout(position_limits=(0.0, 1.0))
    with pytest.raises(SpecificationError, match="each a number or 3 of them"):
        one.rollout(position_limits=([0.0, 1.0], [2.0, 3.0]))


@pytest.mark.parametrize("limits", [{"velocity": [0.2] * 3 + [0.3] * 3}, {"acceleration": 0.4}])
def test_the_least_duration_keeps_linear_and_angular_limits(limits):
    primitives = PoseDMP().learn(demonstrations(2))
    least = primitives.rollout().least_duration(**limits)
    quick = primitives.rollout(duration=least, n_samples=10_000)
    for name, numbers in (("velocity", quick.velocities), ("acceleration", quick.accelerations)):
        if name in limits:
            share = (np.abs(numbers) / limits[name]).max(axis=(1, 2))
            np.testing.assert_allclose(share, 1.0, rtol=1e-5)
    with pytest.raises(SpecificationError, match="6 of them"):
        primitives.rollout().least_duration(velocity=[1.0, 2.0])
    with pytest.raises(SpecificationError, match="depends on the duration"):
        primitives.rollout(end_velocity=[0.1] * 6).least_duration(**limits)


class TestWhatIsSaid:
    def straight(self):
        """It does not turn."""
        u = np.linspace(0, 1, 60)
        s = u**3 * (10 - 15 * u + 6 * u**2)
        return PoseDMP(DMP(n_basis=25)).learn(
            [np.column_stack((np.outer(s, [0.3, 0.1, 0]), np.tile([1.0, 0, 0, 0], (60, 1))))]
        )

    def test_a_movement_that_does_not_turn_may_be_tilted(self):
        one = self.straight()
        point = np.append(one.rollout(n_samples=3).poses[0, 1, :3], exp([0.4, 0.0, 0.2]))
        path = one.rollout(via=[(0.5, point)], n_samples=3)  # a warning would be an error
        np.testing.assert_allclose(angle(path.orientations[0, 1], point[3:]), 0, atol=1e-7)

    @pytest.mark.parametrize(
        ("far", "turned", "match"),
        [
            ([2.0, 0, 0], [0.1, 0, 0], r"at 0.5 of the duration is 2 from .*, which is 0.316 large"),
            ([0.0, 0, 0], [0.0, 2, 0], r"at 0.5 of the duration is 2 rad from .*, which is 1 rad large"),
        ],
    )
    def test_positions_and_orientations_are_measured_apart(self, far, turned, match):
        one = self.straight()
        point = np.append(one.rollout(n_samples=3).poses[0, 1, :3] + far, exp(turned))
        with pytest.warns(ExtrapolationWarning, match=match) as said:
            one.rollout(via=[(0.5, point)])
        assert len(said) == 1
        assert said[0].filename == __file__

    @pytest.mark.parametrize(
        ("point", "match"),
        [
            ([0.1, 0.1, 0.1, np.nan, 0.0, 0.0, 1.0], "NaN in all four where one is free"),
            ([0.1, 0.1, 0.1, 2.0, 0.0, 0.0, 1.0], "^via: .*norm"),
            ([0.1, 0.1, 0.1], r"via\[0\]: expected points of shape \(7,\)"),
            ([np.nan] * 7, "NaN only for dimensions that are free"),
        ],
    )
    def test_what_is_no_pose_is_refused(self, point, match):
        with pytest.raises(TrajectoryError, match=match):
            self.straight().rollout(via=[(0.5, point)])

    def test_one_pose_at_one_time(self):
        one = self.straight()
        point = np.append(one.rollout(n_samples=3).poses[0, 1, :3], exp([0.2, 0.1, 0.0]))
        other = np.append(point[:3], -point[3:])
        once, twice = (one.rollout(via=via).poses for via in ([(0.5, point)], [(0.5, point), (0.5, other)]))
        np.testing.assert_allclose(twice, once, atol=1e-9)
        other[3:] = exp([0.3, 0.1, 0.0])
        with pytest.raises(SpecificationError, match=r"one place at 0.5 .* \[0.15.*\] and \[0.15"):
            one.rollout(via=[(0.5, point), (0.5, other)])

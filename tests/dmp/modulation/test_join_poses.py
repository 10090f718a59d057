"""Poses one after another, in positions and orientations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme import DMP, Demonstrations, blend, couple, join
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, PosePrimitives, conjugate, exp, log, product
from soaking import examples, some

SPECIFICATIONS = [
    DMP(name, n_basis=25, n_points=120, gating=gating)
    for name in FORMULATIONS
    if name != "amplitude-scaled"
    for gating in GATINGS
]


def demonstrations(n, seed, turn=0.6):
    rng, u = np.random.default_rng(seed), np.linspace(0, 1, 90)[:, None]
    s = u**3 * (10 - 15 * u + 6 * u**2)
    blocks = []
    for _ in range(n):
        x = s * rng.choice([-1, 1], 3) * rng.uniform(0.3, 0.6, 3) + 0.1 * np.sin(np.pi * u) * rng.normal(size=3)
        p = (s - 1) * turn * rng.choice([-1, 1], 3) * rng.uniform(0.4, 0.8, 3)
        blocks.append(np.concatenate((x, product(exp(p), exp(rng.normal(size=3)))), axis=1))
    return Demonstrations.from_arrays(blocks, times=[np.linspace(0, 2.0 + 0.5 * i, 90) for i in range(n)])


def angle(one, other):
    return np.linalg.norm(log(product(one, conjugate(other))), axis=-1)


@pytest.mark.parametrize("dmp", some(SPECIFICATIONS, 0, 3, 4), ids=lambda dmp: f"{dmp.formulation}-{dmp.gating}")
@settings(max_examples=examples(1, 12), deadline=None)
@given(seed=st.integers(0, 10**6))
def test_each_part_follows_the_one_before_it(dmp, seed):
    """With their angular velocities; start, end and the velocities there exact."""
    parts = PoseDMP(dmp).learn(demonstrations(3, seed))
    both = join([parts[i] for i in range(3)], shift=True)
    assert type(both) is PosePrimitives
    assert both.durations[0] == pytest.approx(parts.durations.sum())
    path, begin = both.rollout(n_samples=1501), 0.0
    at = path.times[0]
    for one in parts:
        shown = one.rollout(n_samples=201)
        inside = (at >= begin) & (at <= begin + one.durations[0])
        expected = np.column_stack(
            [np.interp(at[inside] - begin, shown.times[0], row) for row in shown.velocities[0].T]
        )
        largest = np.abs(shown.velocities[0]).max(axis=0)
        middle = slice(inside.sum() // 5, 4 * inside.sum() // 5)
        assert (np.abs(path.velocities[0, inside] - expected)[middle] < 0.05 * largest.max() + 0.02).all()
        begin += one.durations[0]
    first = parts[0].rollout()
    np.testing.assert_allclose(path.poses[0, 0, :3], first.poses[0, 0, :3], atol=1e-9)
    np.testing.assert_allclose(angle(path.orientations[0, 0], first.orientations[0, 0]), 0, atol=1e-7)
    np.testing.assert_allclose(path.velocities[0, 0], first.velocities[0, 0], atol=1e-7)
    moved = sum(one.rollout().positions[0, -1, :3] - one.starts[0, :3] for one in parts)
    np.testing.assert_allclose(path.poses[0, -1, :3] - path.poses[0, 0, :3], moved, atol=1e-6)
    np.testing.assert_allclose(path.velocities[0, -1], parts[2].rollout().velocities[0, -1], atol=1e-6)
    # Mounted otherwise: the turn of each part, in the world, is what it was.
    turned = [product(one.rollout().orientations[0, -1], conjugate(one.starts[0, 3:])) for one in parts]
    whole = product(turned[2], product(turned[1], turned[0]))
    np.testing.assert_allclose(angle(product(whole, path.orientations[0, 0]), path.orientations[0, -1]), 0, atol=1e-6)


def test_without_a_shift_each_goes_on_to_its_own_goal():
    parts = PoseDMP(DMP(n_basis=30)).learn(demonstrations(2, 3))
    both = join([parts[0].rollout(), parts[1]], overlap=0.3)
    assert both.durations[0] == pytest.approx(parts.durations.sum() - 0.3)
    end = both.rollout(n_samples=2).poses[0, -1]
    expected = parts[1].rollout(start=parts[0].rollout().poses[0, -1]).poses[0, -1]
    np.testing.assert_allclose(end[:3], expected[:3], atol=1e-9)
    assert angle(end[3:], expected[3:]) < 1e-7


def test_a_batch_goes_as_its_members():
    parts = PoseDMP(DMP(n_basis=25)).learn(demonstrations(4, 1))
    many = join([parts[:3], parts[3]], shift=True)
    for i in range(3):
        alone = join([parts[i], parts[3]], shift=True)
        # A batch has as many basis functions as the movement that needs most.
        apart = many[i].rollout(n_samples=50).positions - alone.rollout(n_samples=50).positions
        assert np.abs(apart[..., :3]).max() < 2e-3


def test_what_was_joined_is_saved_and_moved_again(tmp_path):
    parts = PoseDMP(DMP(n_basis=25)).learn(demonstrations(2, 5))
    both = join([parts[0], parts[1]], shift=True)
    again = PosePrimitives.load(both.save(tmp_path / "both.kineme"))
    np.testing.assert_allclose(again.rollout().poses, both.rollout().poses, atol=1e-12)
    goal = both.goals[0] + [0.1, 0, 0, 0, 0, 0, 0]
    assert np.abs(both.rollout(goal=goal, via=[]).poses[0, -1] - goal).max() < 1e-6


def test_channels_are_kept():
    channels = (
        *(Channel(axis, "position", (axis,), "m") for axis in "xyz"),
        Channel("q", "orientation", ("qx", "qy", "qz", "qw"), None, "xyzw"),
        Channel("gripper", "discrete", ("gripper",)),
    )
    shown = demonstrations(2, 7)
    grip = np.tile(np.arange(90) > 40, 2)[:, None]
    columns = np.concatenate((shown.positions[:, [0, 1, 2, 4, 5, 6, 3]], grip), axis=1)
    plain = Demonstrations.from_arrays(np.split(columns, 2), times=[one.times for one in shown])
    parts = PoseDMP(DMP(n_basis=25)).learn(Demonstrations.of_movements(of_channels(plain.movements, channels)))
    both = join([parts[0], parts[1]], shift=True)
    assert both.channels == channels
    steps = np.flatnonzero(np.diff(both.rollout(n_samples=1001).demonstrations.recorded[:, -1])) / 1000
    assert len(steps) == 3  # closed in the first, opened where the second begins, closed again


def test_what_is_no_pose_does_not_go_with_poses():
    poses, plain = PoseDMP().learn(demonstrations(2, 0)), DMP().learn([np.random.default_rng(0).normal(size=(50, 6))])
    with pytest.raises(TrajectoryError, match="expected PosePrimitives or PoseRollout as part 1, got Primitives"):
        join([poses[0], plain])
    with pytest.raises(TrajectoryError, match="as part 1, got PosePrimitives; poses are joined with poses"):
        join([plain, poses[0]])
    for refused in (lambda: blend(poses[0], poses[1], (0.4, 0.6)), lambda: couple(poses[0], poses[1], (0.4, 0.6))):
        with pytest.raises(TrajectoryError, match="neither blended nor coupled"):
            refused()
    with pytest.raises(TrajectoryError, match="expected several movements"):
        join(poses)

"""The rotation vector from the goal: continuous past half a turn, blind to signs, and refused where there is none."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given

from kineme import Demonstrations, Resample, Trajectory
from kineme.dmp.pose.tangent import with_orientations_last
from kineme.errors import TrajectoryError
from kineme.orientation import angle_between, exp, from_tangent, product, to_tangent
from rotation_samples import as_rotation, carry, random_quaternions, seeds, tumble, turn


def vectors(movement):
    return to_tangent([movement])[0].positions


@given(seeds)
def test_it_is_scipys_rotation_vector_relative_to_the_goal(seed):
    q = tumble(seed)
    near = angle_between(q, q[-1]) < 3
    relative = as_rotation(q) * as_rotation(q[-1]).inv()
    p = vectors(q)
    np.testing.assert_allclose(p[near], relative.as_rotvec()[near], atol=1e-13)
    np.testing.assert_array_equal(p[-1], 0)


@given(seeds)
def test_there_and_back_is_the_same_pose(seed):
    poses = [carry(seed, 60), carry(seed + 1, 75)]
    back = from_tangent(*to_tangent(poses))
    for one, original in zip(back, poses, strict=True):
        np.testing.assert_array_equal(one.positions[:, :3], original[:, :3])
        assert angle_between(one.positions[:, 3:], original[:, 3:]).max() < 1e-14


@given(seeds)
def test_signs_of_quaternions_do_not_matter(seed):
    q = tumble(seed, size=0.9)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(q), 1))
    np.testing.assert_allclose(vectors(q * signs), vectors(q), atol=1e-14)


@pytest.mark.parametrize("angle", [1.0, np.pi, 4.0, 6.2, 2 * np.pi, 7.0, 4 * np.pi, 20.0])
@given(seeds)
def test_turns_about_one_axis_have_no_limit(angle, seed):
    q, axis = turn(angle, seed)
    p = vectors(q)
    np.testing.assert_allclose(p, np.outer(p @ axis, axis), atol=1e-7)
    np.testing.assert_allclose(p[0], -angle * axis, atol=1e-12)
    assert (np.diff(p @ axis) > -1e-12).all()


def test_a_sample_exactly_at_a_full_turn_keeps_the_axis():
    angles = np.linspace(0, 4 * np.pi, 17)  # quarter turns
    p = vectors(exp(np.outer(angles, [0.0, 0.0, 1.0])))
    np.testing.assert_allclose(p, np.outer(angles - 4 * np.pi, [0, 0, 1.0]), atol=1e-12)


def test_resting_at_the_start_and_the_goal_gives_no_axis_and_no_trouble():
    q = np.concatenate((np.tile([1.0, 0, 0, 0], (5, 1)), exp(np.outer(np.linspace(0, 2, 20), [1.0, 0, 0]))))
    q = np.concatenate((q, np.tile(q[-1], (5, 1))))
    p = vectors(q)
    np.testing.assert_allclose(p[:6], [[-2.0, 0, 0]] * 6, atol=1e-15)
    np.testing.assert_array_equal(p[-5:], 0)


@given(seeds)
def test_a_turned_tool_changes_nothing_and_a_turned_scene_turns_the_vectors(seed):
    q, c = tumble(seed), random_quaternions(seed + 7)
    np.testing.assert_allclose(vectors(product(q, c)), vectors(q), atol=1e-14)
    np.testing.assert_allclose(vectors(product(c, q)), as_rotation(c).apply(vectors(q).copy()), atol=1e-14)


def test_many_movements_are_as_one_by_one_whatever_the_tile():
    movements = [tumble(seed, n_samples=30 + seed % 50, size=0.7) for seed in range(300)]
    movements[17] = turn(9.0)[0]
    tangent, references = to_tangent(movements)
    for one, q in zip(tangent, movements, strict=True):
        np.testing.assert_array_equal(one.positions, vectors(q))
    np.testing.assert_allclose(references, [q[-1] for q in movements], atol=1e-15)


def test_times_labels_names_stay_and_nothing_is_written_to():
    pose = carry(3)
    pose.setflags(write=False)
    times = np.sort(np.random.default_rng(0).uniform(5, 9, len(pose)))
    demos = Demonstrations([Trajectory(times, pose, label="pour", name="one.csv")])
    tangent, _ = to_tangent(demos)
    assert tangent.names == ("one.csv",)
    assert tangent.labels.tolist() == ["pour"]
    np.testing.assert_array_equal(tangent.times, times)


def test_preprocessing_reads_the_goal_again():
    tangent, references = to_tangent([tumble(0, 80)], [Resample(50)])
    assert tangent.lengths.tolist() == [50]
    np.testing.assert_array_equal(tangent.positions[-1], 0)
    assert angle_between(references[0], tumble(0, 80)[-1]) < 1e-12


def off_norm():
    q = tumble(0)
    q[42] *= 1.25
    return q


def wandering_full_turn():
    angle = np.linspace(0, 2 * np.pi + 1, 200)[:, None]
    side = 0.2 * np.sin(np.linspace(0, 3, 200))[:, None]
    return product(exp(angle * [0, 0, 1.0]), exp(side * [1.0, 0, 0]))


@pytest.mark.parametrize(("angle", "good"), [(3.0, True), (5.1, True), (5.3, False), (6.0, False)])
def test_a_rotation_vector_may_move_five_times_as_far_as_the_orientation(angle, good):
    """``(t / 2) / sin(t / 2)`` where only the axis turns: 5 at t = 5.2."""
    turned = np.linspace(0.0, np.pi / 2, 5)[:, None]
    around = angle * np.concatenate((np.cos(turned), np.sin(turned), 0 * turned), axis=1)
    back = np.linspace(angle, 0.0, 60)[1:, None] * [0.0, 1.0, 0.0]
    movement = exp(np.concatenate((around, back)))
    if good:
        np.testing.assert_allclose(np.linalg.norm(vectors(movement)[:5], axis=1), angle, rtol=1e-9)
        return
    with pytest.raises(TrajectoryError, match="jumps by"):
        vectors(movement)


@pytest.mark.parametrize(
    ("movements", "message"),
    [
        ([np.zeros((9, 3))], r"expected movements of 4 columns, an orientation .* or 7, .* got 3 columns"),
        ([tumble(1), off_norm()], r"trajectory 1: sample 42: expected a unit quaternion .* got norm 1\.25 from \["),
        (
            [tumble(1), wandering_full_turn()],
            r"trajectory 1: sample \d+: expected orientations within a full turn of the goal.* jumps by [\d.]+ rad .* "
            r"turns by 0\.0\d+ rad; split the movement there",
        ),
    ],
)
def test_what_has_no_rotation_vector_is_refused(movements, message):
    with pytest.raises(TrajectoryError, match=message):
        to_tangent(movements)


def test_messages_name_the_movement_beyond_the_first_tile():
    movements = [tumble(0, 100)] * 250 + [off_norm()]
    with pytest.raises(TrajectoryError, match=r"trajectory 250 \('last'\): sample 42: .* norm 1\.25"):
        to_tangent(Demonstrations.from_arrays(movements, names=[None] * 250 + ["last"]))


def test_a_joint_beside_an_orientation_is_learned_with_the_positions():
    """Between the columns of a pose of a robot there may be angles: they come first, before the orientations."""
    t, q = np.linspace(0, 1, 40), exp(np.outer(np.linspace(0, 1, 40), [0.1, 0.4, 1.0]))
    frame = pd.DataFrame({"t": t, "qw": q[:, 0], "qx": q[:, 1], "qy": q[:, 2], "qz": q[:, 3], "joint1": t**2, "x": t})
    columns, n_orientations = with_orientations_last(Demonstrations.of(frame))
    assert n_orientations == 1
    np.testing.assert_allclose(columns.positions, np.column_stack([t**2, t, q]), atol=1e-15)

"""Orientations become coordinates without limits, and nothing that was recorded is lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.dmp.pose.tangent import as_poses
from kineme.dmp.recorded_as import RecordedAs
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.coordinates import as_wxyz, canonical, learned, lengths_of
from kineme.movements.preparation.trim import TrimRest
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, exp, product

Q = Channel("q", "orientation", ("qx", "qy", "qz", "qw"), None, "xyzw")
XYZ = tuple(Channel(axis, "position", (axis,)) for axis in "xyz")
GRIPPER = Channel("gripper", "discrete", ("gripper",))
POSE = (*XYZ, Q, GRIPPER)


def from_wxyz(q, channel):
    """Quaternions in the order of a channel's columns: the inverse of `as_wxyz`."""
    return q[..., ["wxyz".index(part) for part in channel.order]]


def turning(seed=0, n=80, turns=4.0):
    """A tool that turns several times about an axis that moves, with signs of quaternions that jump."""
    random = np.random.default_rng(seed)
    u = np.linspace(0, 1, n)
    q = product(exp(np.outer(u * turns * 2 * np.pi, [0, 0, 1.0])), exp(np.outer(np.sin(3 * u), [1.0, 0.3, 0])))
    return q * random.choice([-1.0, 1.0], n)[:, None]


def poses(n=80):
    u = np.linspace(0, 1, n)
    columns = np.column_stack([u, u**2, np.sin(2 * u), from_wxyz(turning(n=n, turns=0.4), Q), u > 0.5])
    plain = Demonstrations.from_arrays([columns, columns[: n // 2]], ["a", "b"], [2 * u, 2 * u[: n // 2]])
    return Demonstrations.of_movements(of_channels(plain.movements, POSE)), columns


@given(seed=st.integers(0, 1000), turns=st.floats(-5, 5))
def test_the_steps_of_the_coordinates_turn_each_orientation_into_the_next(seed, turns):
    q = turning(seed, turns=turns)
    r = learned(canonical(from_wxyz(q, Q), np.array([0, 80]), (Q,)), np.array([0, 80]), (Q,))
    found = [q[0]]
    for step in np.diff(r, axis=0):
        found.append(product(exp(step), found[-1]))
    assert np.abs(np.abs((np.array(found) * q).sum(axis=1)) - 1).max() < 1e-9
    assert (r[0] == 0).all()


def test_many_turns_about_one_axis_are_counted():
    q = exp(np.outer(np.linspace(0, 20, 200), [0, 0, 1.0]))
    r = learned(from_wxyz(q, Q), np.array([0, 200]), (Q,))
    np.testing.assert_allclose(r, np.outer(np.linspace(0, 20, 200), [0, 0, 1.0]), atol=1e-9)


@given(seed=st.integers(0, 1000))
def test_signs_of_quaternions_and_a_tool_mounted_differently_change_nothing(seed):
    offsets = np.array([0, 30, 80])
    q, tool = turning(seed), exp(np.random.default_rng(seed).normal(size=3))
    r, other = (
        learned(canonical(from_wxyz(one, Q), offsets, (Q,)), offsets, (Q,))
        for one in (q, -product(q, np.broadcast_to(tool, q.shape)))
    )
    np.testing.assert_allclose(r, other, atol=1e-9)


def test_a_batch_equals_its_members():
    both, columns = poses()
    for one, piece in zip(both, (columns, columns[:40]), strict=True):
        alone = Demonstrations.of_movements(of_channels(Demonstrations.from_arrays([piece]).movements, POSE))
        np.testing.assert_allclose(one.positions, alone.positions, atol=1e-12)
        np.testing.assert_array_equal(one.recorded, alone.recorded)


def test_orders_of_components():
    q = turning()
    np.testing.assert_array_equal(as_wxyz(from_wxyz(q, Q), Q), q)
    np.testing.assert_array_equal(from_wxyz(q, Q)[:, 3], q[:, 0])


def test_what_was_recorded_goes_with_a_movement_wherever_it_goes():
    both, _ = poses()
    assert both.dimensions == ("x", "y", "z", "q.rx", "q.ry", "q.rz")
    for some in (both[[1, 0]], Demonstrations([both[1], both[0]]), kineme.Demonstrations.of([both[1], both[0]])):
        assert some.channels == POSE
        np.testing.assert_array_equal(some.recorded, np.concatenate([both[1].recorded, both[0].recorded]))
    piece = kineme.segment(both[0], by="rest", cover=True).demonstrations[0]
    np.testing.assert_array_equal(piece.recorded, both[0].recorded[: len(piece)])


def test_steps_that_change_samples_do_not_keep_other_samples_recorded():
    both, _ = poses()
    trimmed = TrimRest(0.3).apply(both)
    assert len(trimmed.recorded) == len(trimmed.positions) < len(both.positions)
    for step in (kineme.Smooth(), kineme.Resample(50)):
        assert step.apply(both).recorded is None
        assert step.apply(both).channels is None
        assert step.apply(both).dimensions == both.dimensions


def test_poses_are_learned_as_recorded():
    both, columns = poses()
    direct = [np.column_stack([columns[:, :3], as_wxyz(columns[:, 3:7], Q)])[: len(one)] for one in both]
    plain = Demonstrations.from_arrays(direct, times=[one.times for one in both])
    expected, found = PoseDMP().learn(plain), PoseDMP().learn(both)
    np.testing.assert_allclose(found.tangent.scaled_weights, expected.tangent.scaled_weights, atol=1e-9)
    assert found.labels.tolist() == ["a", "b"]


def test_channels_that_are_no_pose_are_refused_by_name():
    both, _ = poses()
    two = replace(both.movements, channels=(*XYZ[:2], Q, GRIPPER), positions=both.positions[:, 1:])
    with pytest.raises(kineme.errors.TrajectoryError, match=r"x \(position\), y \(position\), q \(orientation\)"):
        as_poses(Demonstrations.of_movements(two))


@pytest.mark.parametrize(
    ("unit", "lever"),
    [
        *(("m", 0.2), (None, 0.2), ("cm", 20.0), ("mm", 200.0), ("furlong", 0.2)),
        *(("MM", 200.0), ("Millimeters", 200.0), ("meters", 0.2), ("dm", 2.0), ("µm", 2e5), ("inches", 0.2 / 0.0254)),
    ],
)
def test_beside_positions_a_radian_counts_as_the_way_of_a_tool(unit, lever):
    q = exp(np.outer(np.linspace(0, 2, 30), [0, 0, 1.0]))
    channels = (Channel("x", "position", ("x",), unit), Q)
    columns = np.column_stack([np.zeros(30), from_wxyz(q, Q)])
    np.testing.assert_allclose(learned(columns, np.array([0, 30]), channels)[-1], [0, 0, 0, 2 * lever], atol=1e-9)
    joint = (Channel("x", "angle", ("x",), "rad"), Q)
    np.testing.assert_allclose(learned(columns, np.array([0, 30]), joint)[-1], [0, 0, 0, 2], atol=1e-9)


def test_lengths_compare_coordinates_of_several_units():
    units = ("mm", "deg", "%", None, "furlong")
    channels = (*(Channel(str(k), "position", (str(k),), unit) for k, unit in enumerate(units)), Q)
    grip = Channel("grip", "discrete", ("grip",))
    metric = [0.001, 0.2 * np.pi / 180, 0.002, 0.001, 0.001, 0.001, 0.001, 0.001]  # a radian is 200 mm already
    np.testing.assert_allclose(lengths_of((*channels, grip)), metric)
    np.testing.assert_allclose(lengths_of((Channel("q", "angle", ("q",), "rad"),)), [0.2])


def test_discrete_channels_alone_are_refused():
    with pytest.raises(kineme.errors.SpecificationError, match="a channel that moves, got gripper, all discrete"):
        learned(np.zeros((8, 1)), np.array([0, 8]), (GRIPPER,))


def test_the_first_quaternion_of_each_movement_keeps_its_sign_whatever_came_before():
    q = from_wxyz(np.abs(turning(turns=0.1)), Q)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    q[20:40] *= -1
    found = canonical(q, np.array([0, 30, 80]), (Q,))
    assert (found[:30] > -0.2).all()
    np.testing.assert_allclose(found[30], q[30], atol=1e-12)
    assert ((found[30:] * found[30]).sum(axis=1) > 0).all()


def test_movements_of_other_channels_have_none_together():
    both, _ = poses()
    other = replace(both.movements, channels=(*XYZ, Q, GRIPPER._replace(name="claw")))
    assert Demonstrations([both[0], Demonstrations.of_movements(other)[1]]).channels is None


def test_rates_follow_an_orientation_between_positions():
    assert RecordedAs((XYZ[0], Q, GRIPPER, *XYZ[1:])).rates_in_order == [0, 3, 4, 5, 1, 2]

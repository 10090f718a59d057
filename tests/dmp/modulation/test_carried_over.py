"""Joined and blended movements keep labels, names, channels and the steps of discrete channels at their new times."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, Demonstrations, blend, join
from kineme.dmp import Primitives
from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels

CHANNELS = (
    *(Channel(name, "position", (name,), "mm") for name in ("elbow", "wrist")),
    Channel("gripper", "discrete", ("gripper",)),
)


def gripped(steps, durations, label="pick", unit="mm"):
    """One movement for each step (share of its duration, value before, value after)."""
    blocks, times = [], []
    for k, ((share, before, after), duration) in enumerate(zip(steps, durations, strict=True)):
        u = np.linspace(0, 1, 201)
        s = u**3 * (10 - 15 * u + 6 * u**2)
        blocks.append(np.column_stack((s, np.sin(3 * s + k), np.where(u >= share, after, before))))
        times.append(duration * u)
    channels = (*(one._replace(unit=unit) for one in CHANNELS[:2]), CHANNELS[2])
    plain = Demonstrations.from_arrays(blocks, [label] * len(blocks), times, ["a.csv"] * len(blocks))
    return DMP().learn(Demonstrations.of_movements(of_channels(plain.movements, channels)))


def steps_in_time(primitives, i=0):
    """(time, value) of each step of the gripper, from a rollout that is written in the columns of the recording."""
    movement = primitives.rollout(n_samples=4001).demonstrations[i]
    grip, times = movement.recorded[:, 2], movement.times
    changes = np.flatnonzero(np.diff(grip)) + 1
    return [(0.0, grip[0]), *((float(times[k]), grip[k]) for k in changes)]


@pytest.fixture
def parts():
    return gripped([(0.25, 0.0, 1.0)], [2.0]), gripped([(0.5, 1.0, 0.0)], [4.0])


@pytest.mark.parametrize(("overlap", "expected"), [(0.0, [0.5, 4.0]), (0.6, [0.5, 3.4])])
def test_a_gripper_steps_when_it_did_in_the_parts(parts, overlap, expected):
    joined = join(parts, shift=True, overlap=overlap)
    assert joined.channels == parts[0].channels
    assert joined.rollout().axis_names == ["elbow", "wrist"]
    found = steps_in_time(joined)
    assert [value for _, value in found] == [0.0, 1.0, 0.0]
    np.testing.assert_allclose([time for time, _ in found[1:]], expected, atol=2e-3)


def test_where_the_parts_differ_it_steps_where_the_next_one_begins():
    one, other = gripped([(0.25, 0.0, 1.0)], [2.0]), gripped([(0.5, 3.0, 4.0)], [2.0])
    assert [value for _, value in steps_in_time(join([one, other], shift=True))] == [0.0, 1.0, 3.0, 4.0]
    np.testing.assert_allclose([t for t, _ in steps_in_time(join([one, other], shift=True))][2], 2.0, atol=2e-3)
    cut = steps_in_time(join([one, other], shift=True, overlap=0.5))
    np.testing.assert_allclose([t for t, _ in cut][1:], [0.5, 1.5, 2.5], atol=2e-3)


def test_blended_it_is_that_of_the_first_and_then_that_of_the_second():
    one, other = gripped([(0.2, 0.0, 1.0)], [2.0]), gripped([(0.9, 5.0, 6.0)], [2.0])
    found = steps_in_time(blend(one, other, (0.4, 0.6)))
    assert [value for _, value in found] == [0.0, 1.0, 5.0, 6.0]
    np.testing.assert_allclose([time for time, _ in found[1:]], [0.4, 1.0, 1.8], atol=2e-3)


def test_a_step_before_the_switch_is_in_force_from_the_switch_on():
    """The second has closed its gripper before it counts: it never was open."""
    one, other = gripped([(0.25, 0.0, 1.0)], [2.0]), gripped([(0.05, 3.0, 4.0)], [2.0])
    mixed = steps_in_time(blend(one, other, (0.4, 0.6)))
    assert [value for _, value in mixed] == [0.0, 1.0, 4.0]
    np.testing.assert_allclose([time for time, _ in mixed[1:]], [0.5, 1.0], atol=2e-3)


def test_a_step_at_the_switch_itself_has_no_value_before_it():
    """Both are at half the duration: what the second part was until then was never in force."""
    one, other = gripped([(0.25, 0.0, 1.0)], [2.0]), gripped([(0.5, 5.0, 6.0)], [2.0])
    steps = blend(one, other, (0.4, 0.6)).recorded_as.steps
    np.testing.assert_array_equal(steps.values[:, 0], [0.0, 1.0, 6.0])


def test_each_movement_of_a_batch_has_its_own_steps(tmp_path):
    many = gripped([(0.25, 0.0, 1.0), (0.5, 0.0, 1.0)], [2.0, 3.0])
    one = gripped([(0.5, 1.0, 0.0)], [4.0])
    joined = Primitives.load(join([many, one], shift=True).save(tmp_path / "joined.npz"))
    for i, expected in enumerate(([0.5, 4.0], [1.5, 5.0])):
        np.testing.assert_allclose([time for time, _ in steps_in_time(joined, i)[1:]], expected, atol=3e-3)


def test_labels_and_names_are_kept_where_they_are_equal(parts):
    joined = join(parts, shift=True)
    assert joined.labels.tolist() == ["pick"]
    assert joined.names == ("a.csv",)
    placed = gripped([(0.5, 1.0, 0.0)], [4.0], label="place")
    assert join([parts[0], placed], shift=True).labels is None
    assert blend(parts[0], parts[1], (0.4, 0.6)).labels.tolist() == ["pick"]


def test_parts_of_which_some_have_no_channels_have_none_in_common(parts):
    plain = DMP().learn(parts[1].rollout().positions)
    assert join([parts[0], plain], shift=True).channels is None


def test_parts_that_were_recorded_in_other_units_are_refused(parts):
    meters = gripped([(0.5, 1.0, 0.0)], [4.0], unit="m")
    with pytest.raises(TrajectoryError, match="elbow is in mm, elbow in m;"):
        join([parts[0], meters], shift=True)

"""Demonstrations are an immutable sequence of trajectories in one block."""

from __future__ import annotations

import pickle
from collections import deque
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from kineme import DMP, Demonstrations, Trajectory
from kineme.errors import TrajectoryError
from kineme.movements.trajectories.demonstrations import require_labels


@pytest.fixture(scope="module")
def trajectories(make_movement):
    return [Trajectory(*make_movement(i, even=False), label=c, name=f"take {c}") for i, c in enumerate("abca")]


@pytest.fixture(scope="module")
def demos(trajectories):
    return Demonstrations(trajectories)


def _same(one, other):
    return (
        np.array_equal(one.times, other.times)
        and np.array_equal(one.positions, other.positions)
        and (one.label, one.name) == (other.label, other.name)
    )


def test_iteration_gives_the_trajectories_back(demos, trajectories):
    assert all(_same(one, other) for one, other in zip(demos, trajectories, strict=True))


@pytest.mark.parametrize("index", [0, 3, -1, -4, np.int64(2)])
def test_an_integer_gives_one_trajectory(demos, trajectories, index):
    assert _same(demos[index], trajectories[index])


@pytest.mark.parametrize("index", [4, -5])
def test_an_integer_beyond_the_end_is_an_index_error(demos, index):
    with pytest.raises(IndexError, match=f"expected an index below 4, got {index}"):
        demos[index]


@pytest.mark.parametrize(
    ("index", "chosen"),
    [
        (slice(1, 3), [1, 2]),
        (slice(None, None, -1), [3, 2, 1, 0]),
        ([2, 0, 2], [2, 0, 2]),
        (np.array([-1, 0]), [3, 0]),
        (np.array([True, False, True, False]), [0, 2]),
        ([False, True, False, False], [1]),
    ],
)
def test_a_selection_gives_demonstrations(demos, trajectories, index, chosen):
    selected = demos[index]
    assert isinstance(selected, Demonstrations)
    assert all(_same(one, trajectories[i]) for one, i in zip(selected, chosen, strict=True))


def test_lengths_durations_and_dimensions(demos, trajectories):
    assert len(demos) == 4
    assert demos.lengths.tolist() == [len(one) for one in trajectories]
    assert demos.durations.tolist() == [one.duration for one in trajectories]
    assert demos.n_dims == 2


def test_blocks_cannot_be_written(demos):
    for array in (
        demos.positions,
        demos.times,
        demos.offsets,
        demos.durations,
        demos.labels,
        demos[0].positions,
        demos[0].times,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = array[-1]


@pytest.mark.parametrize("copy", [deepcopy, lambda whole: pickle.loads(pickle.dumps(whole))])
def test_copies_cannot_be_written(demos, copy):
    primitives = copy(DMP().learn(demos))
    for array in (copy(demos).positions, copy(demos)[0].times, copy(demos[0]).positions, primitives.goals):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = array[-1]


def test_positions_are_in_one_order_in_memory(demos):
    """Whatever is computed from them: compiled loops would be compiled once more for another order."""
    movements = replace(demos.movements, positions=np.asfortranarray(demos.positions))
    assert movements.positions.flags.c_contiguous
    np.testing.assert_array_equal(movements.positions, demos.positions)


def test_fields_cannot_be_set(demos):
    for name in ("positions", "times", "labels", "names", "offsets", "n_dims"):
        with pytest.raises(AttributeError):
            setattr(demos, name, None)


def test_a_trajectory_cannot_be_changed(trajectories):
    one = trajectories[0]
    with pytest.raises(AttributeError):
        one.label = "other"
    with pytest.raises(ValueError, match="read-only"):
        one.positions[0] = 0


def test_copies_are_independent_of_the_arrays_that_they_came_from():
    times, block = np.linspace(0, 1, 9), np.random.default_rng(0).normal(size=(2, 9, 2))
    one, many = Trajectory(times, block[0]), Demonstrations.from_arrays(block, times=times)
    kept = block.copy()
    block[:] = 0
    times[:] = 0
    np.testing.assert_array_equal(one.positions, kept[0])
    np.testing.assert_array_equal(many.positions, kept.reshape(-1, 2))
    assert many.durations.tolist() == [1.0, 1.0]


def test_a_block_is_used_in_place_where_copying_was_declined():
    block = np.random.default_rng(0).normal(size=(2, 9, 2))
    assert np.shares_memory(Demonstrations.from_arrays(block, copy=False).positions, block)
    assert block.flags.writeable


def test_reprs_show_sizes_labels_and_names(demos, make_movement):
    low, high = demos.lengths.min(), demos.lengths.max()
    assert repr(demos) == f"Demonstrations(4 movements, 2 dims, {low} to {high} samples each, 3 labels)"
    assert repr(demos[0]) == f"Trajectory({len(demos[0])} samples, 2 dims, 2 s, label='a', name='take a')"
    assert repr(Trajectory(*make_movement(0, 1, n_samples=50))) == "Trajectory(50 samples, 1 dims, 2 s)"


@pytest.mark.parametrize("container", [list, tuple, deque, Demonstrations], ids=lambda one: one.__name__)
def test_any_sequence_of_trajectories_is_taken(trajectories, container):
    assert len(Demonstrations.of(container(trajectories))) == 4


def test_a_single_trajectory_is_a_batch_of_one(trajectories):
    assert len(Demonstrations.of(trajectories[0])) == 1


@pytest.mark.parametrize("label", ["a", 3, 2.5])
def test_labels_come_back_as_plain_python(label):
    demos = Demonstrations.from_arrays(np.random.default_rng(0).normal(size=(1, 9, 2)), [label])
    assert type(demos[0].label) is type(label)
    assert demos[0].label == label


def test_without_times_a_movement_lasts_one_second():
    demos = Demonstrations.from_arrays([np.arange(5.0)])
    np.testing.assert_allclose(demos.times, np.linspace(0, 1, 5))


@pytest.mark.parametrize(
    ("times", "even"),
    [
        (None, 50),
        ([np.linspace(0, 2, 50)] * 2, 50),
        ([1.7e9 + np.linspace(0, 2, 50)] * 2, 50),
        ([np.linspace(0, 2, 50), np.linspace(0, 1, 50) ** 1.01], None),
    ],
    ids=["none", "even", "epoch", "uneven"],
)
def test_even_sampling_is_recognized(times, even):
    block = np.random.default_rng(0).normal(size=(2, 50, 2))
    assert Demonstrations.from_arrays(block, times=times).even_length == even


def test_movements_of_unequal_length_are_not_even():
    assert Demonstrations.from_arrays([np.arange(5.0), np.arange(6.0)]).even_length is None


def test_labels_are_returned_or_asked_for(demos):
    assert require_labels(demos).tolist() == ["a", "b", "c", "a"]
    with pytest.raises(
        TrajectoryError, match=r"expected labeled demonstrations.*pass y to fit, labels= to Demonstrations.from_arrays"
    ):
        require_labels(Demonstrations.from_arrays([np.arange(5.0)]))


@pytest.mark.parametrize("odd", [0, 700, 799])
def test_one_uneven_movement_among_many_is_noticed(odd):
    """Stamps are looked at some thousands at a time."""
    times = np.tile(np.linspace(0.0, 1.0, 100), (800, 1))
    positions = np.zeros((800, 100, 1)) + times[:, :, None]
    assert Demonstrations.from_arrays(positions, times=list(times)).even_length == 100
    times[odd, 50] += 1e-4
    assert Demonstrations.from_arrays(positions, times=list(times)).even_length is None

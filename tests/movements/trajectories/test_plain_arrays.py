"""Plain float64 arrays are joined at once; whatever is not plain goes the way that converts and checks each."""

import numpy as np
import pytest

from kineme import Demonstrations
from kineme.errors import TrajectoryError
from kineme.movements.trajectories.collect import plain_block, plain_stamps


def _ragged(n_dims=2):
    random = np.random.default_rng(3)
    return [random.normal(size=(length, n_dims)) for length in (5, 9, 4, 300)]


@pytest.mark.parametrize("n_dims", [1, 2, 3])
def test_plain_arrays_are_joined_as_concatenate_does(n_dims):
    arrays = _ragged(n_dims)
    positions, offsets = plain_block(arrays)
    assert np.array_equal(positions, np.concatenate(arrays))
    assert offsets.tolist() == [0, 5, 14, 18, 318]
    times = [np.arange(float(len(one))) for one in arrays]
    assert np.array_equal(plain_stamps(times, np.diff(offsets)), np.concatenate(times))


@pytest.mark.parametrize(
    "odd",
    [
        np.zeros((6, 2), np.float32),
        np.zeros((6, 2), ">f8"),
        np.zeros((6, 4))[:, ::2],
        np.zeros((6, 3))[:, :2],
        np.asfortranarray(np.zeros((6, 2))),
        np.zeros((6, 3)),
        np.zeros((6, 0)),
        np.zeros((3, 2)),
        np.zeros(6),
        np.ma.masked_array(np.zeros((6, 2))),
        [[0.0, 0.0]] * 6,
    ],
    ids=["float32", "bytes", "strided", "sliced", "Fortran", "wider", "empty", "short", "flat", "masked", "list"],
)
def test_anything_else_is_not_taken_for_plain(odd):
    assert plain_block([*_ragged(), odd]) is None
    assert plain_block([odd]) is None or np.array_equal(plain_block([odd])[0], odd)


def test_stamps_are_plain_only_with_the_lengths_of_the_positions():
    times = [np.arange(5.0), np.arange(9.0)]
    assert plain_stamps(times, np.array([5, 9])) is not None
    assert plain_stamps(times, np.array([9, 5])) is None
    assert plain_stamps([times[0], np.arange(18.0)[::2]], np.array([5, 9])) is None


def test_arrays_that_are_not_plain_hold_the_same_numbers():
    arrays = _ragged()
    plain = Demonstrations.from_arrays(arrays).positions
    for mixed in ([np.asfortranarray(one) for one in arrays], [arrays[0].astype(">f8"), *arrays[1:]]):
        assert np.array_equal(Demonstrations.from_arrays(mixed).positions, plain)


def test_later_changes_of_the_arrays_do_not_reach_the_movements():
    arrays = _ragged()
    positions = Demonstrations.from_arrays(arrays).positions
    before = positions.copy()
    arrays[0][:] = 7.0
    assert np.array_equal(positions, before)


def test_stamps_close_to_zero_are_refused_within_a_movement_and_taken_from_one_to_the_next():
    arrays = [np.arange(8.0).reshape(4, 2)] * 2
    fine = [np.array([0.0, 1.0, 2.0, 3.0]), np.array([3.0, 4.0, 5.0, 6.0])]
    assert len(Demonstrations.from_arrays(arrays, times=fine)) == 2
    with pytest.raises(TrajectoryError, match="trajectory 1: expected at least 1e-50 s between stamps"):
        Demonstrations.from_arrays(arrays, times=[fine[0], np.array([0.0, 1e-60, 1.0, 2.0])])


def test_a_list_of_reversed_arrays_is_taken():
    arrays = [one[::-1] for one in _ragged()]
    assert np.array_equal(Demonstrations.of(arrays).positions, np.concatenate(arrays))
    assert np.array_equal(Demonstrations.of(arrays[:1]).positions, arrays[0])

"""Plain float64 arrays are joined at once; whatever is not plain goes the way that converts and checks each."""

import numpy as np
import pytest

from kineme import Demonstrations
from kineme.errors import TrajectoryError


def _ragged(n_dims=2):
    random = np.random.default_rng(3)
    return [random.normal(size=(length, n_dims)) for length in (5, 9, 4, 300)]


@pytest.mark.parametrize("n_dims", [1, 2, 3])
def test_plain_arrays_are_joined_as_concatenate_does(n_dims):
    arrays = _ragged(n_dims)
    times = [np.arange(float(len(one))) for one in arrays]
    demos = Demonstrations.from_arrays(arrays, times=times)
    assert np.array_equal(demos.positions, np.concatenate(arrays))
    assert demos.offsets.tolist() == [0, 5, 14, 18, 318]
    assert np.array_equal(demos.times, np.concatenate(times))


@pytest.mark.parametrize(
    "odd",
    [
        np.zeros((6, 2), np.float32) + 0.1,
        np.ones((6, 2), ">f8"),
        np.arange(24.0).reshape(6, 4)[:, ::2],
        np.arange(18.0).reshape(6, 3)[:, :2],
        np.asfortranarray(np.arange(12.0).reshape(6, 2)),
        np.ma.masked_array(np.arange(12.0).reshape(6, 2)),
        [[0.0, 1.0]] * 6,
    ],
    ids=["float32", "bytes", "strided", "sliced", "Fortran", "masked", "list"],
)
def test_whatever_holds_numbers_is_joined_with_plain_arrays(odd):
    for arrays in ([odd], [*_ragged(), odd], [odd, *_ragged()]):
        positions = Demonstrations.from_arrays(arrays).positions
        assert type(positions) is np.ndarray
        assert positions.dtype == np.float64
        assert np.array_equal(positions, np.concatenate([np.asarray(one, dtype=float) for one in arrays]))


@pytest.mark.parametrize(
    ("odd", "problem"),
    [
        (np.zeros((6, 3)), "expected 2 dimensions as in trajectory 0, got 3"),
        (np.zeros((6, 0)), r"expected positions of shape \(T, d\), samples by dimensions, got shape \(6, 0\)"),
        (np.zeros((3, 2)), "expected at least 4 samples, got 3"),
        (np.zeros(6), "expected 2 dimensions as in trajectory 0, got 1"),
        (np.ma.masked_array(np.zeros((6, 2)), np.eye(6, 2)), "expected an array of numbers, got one with 2 masked"),
        (np.zeros((6, 2), complex), "expected real numbers"),
    ],
    ids=["wider", "empty", "short", "flat", "masked", "complex"],
)
def test_what_does_not_fit_is_refused_by_its_number(odd, problem):
    with pytest.raises(TrajectoryError, match=f"trajectory 4: {problem}"):
        Demonstrations.from_arrays([*_ragged(), odd])


def test_stamps_need_the_lengths_of_the_positions():
    arrays, times = [np.ones((5, 1)), np.ones((9, 1))], [np.arange(5.0), np.arange(9.0)]
    strided = Demonstrations.from_arrays(arrays, times=[times[0], np.arange(18.0)[::2]])
    assert strided.times.tolist() == [*range(5), *range(0, 18, 2)]
    for wrong in (times[::-1], [times[0], np.arange(9.0).reshape(9, 1)]):
        with pytest.raises(TrajectoryError, match="expected one time stamp for each of the"):
            Demonstrations.from_arrays(arrays, times=wrong)


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

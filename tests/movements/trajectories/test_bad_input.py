"""Every refusal says what was expected, what came, where, and what to do."""

# ruff: noqa: E501 - one case, one line, the message whole

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from kineme import DMP, Demonstrations, Trajectory, orientation, styles
from kineme.errors import KinemeError, TrajectoryError
from kineme.kernels.random_binning import RandomBinning

T = np.linspace(0, 1, 8)
X = np.column_stack((T, T**2))


def _with(value, row=3):
    bad = X.copy()
    bad[row, 1] = value
    return bad


def _stamps(row, value):
    bad = T.copy()
    bad[row] = value
    return bad


BAD_ARRAYS = {
    "NaN": ([X, _with(np.nan)], "trajectory 1 ('two'): expected finite positions, got [0.42857142857142855, nan] at sample 3; remove the sample"),
    "infinity": ([_with(np.inf, 7), X], "trajectory 0 ('one'): expected finite positions, got [1.0, inf] at sample 7"),
    "two infinities": ([_with(np.inf), _with(-np.inf)], "trajectory 0 ('one'): expected finite positions"),
    "two samples": ([X, X[:2]], "trajectory 1 ('two'): expected at least 4 samples, got 2"),
    "transposed": ([X, X.T], "trajectory 1 ('two'): expected at least 4 samples, got 2; samples run along the first axis: transpose the array"),
    "mixed dimensions": ([X, X[:, :1]], "trajectory 1 ('two'): expected 2 dimensions as in trajectory 0, got 1; movements of one batch share"),
    "three axes": ([X, X[None]], "trajectory 1 ('two'): expected positions of shape (T, d), samples by dimensions, got shape (1, 8, 2); pass many movements as a list"),
    "a number": ([X, 3.0], "trajectory 1 ('two'): expected positions of shape (T, d), samples by dimensions, got shape ()"),
    "no dimension": ([X, X[:, :0]], "got shape (8, 0)"),
    "words": ([X, ["left", "right", "up", "down"]], "trajectory 1 ('two'): expected positions to be an array of numbers, got could not convert"),
    "masked": ([X, np.ma.masked_greater(X, 0.9)], "trajectory 1 ('two'): expected an array of numbers, got one with 2 masked; drop the samples"),
    "complex": ([X, X + 1j], "trajectory 1 ('two'): expected real numbers, got complex128; pass both parts as columns"),
    "rows of a movement": (X.tolist(), "expected at least 4 samples, got 2; pass one movement of several dimensions as [array]"),
    "ragged rows": ([X, [[1, 2], [3]]], "trajectory 1 ('two'): expected positions to be an array of numbers, got setting an array element"),
}  # fmt: skip


@pytest.mark.parametrize(("arrays", "message"), BAD_ARRAYS.values(), ids=BAD_ARRAYS)
def test_bad_positions_are_refused(arrays, message):
    with pytest.raises(TrajectoryError, match=re.escape(message)):
        Demonstrations.from_arrays(arrays, names=["one", "two"])


def test_nothing_is_advised_to_be_transposed_that_stays_too_short():
    for shape in ((0, 2), (2, 3)):
        with pytest.raises(TrajectoryError, match=rf"expected at least 4 samples, got {shape[0]}$"):
            Demonstrations.from_arrays([np.zeros(shape)])


BAD_TIMES = {
    "duplicate": (_stamps(4, T[3]), "trajectory 1 ('two'): expected strictly increasing times, got duplicate stamps 0.428571429 and 0.428571429 at samples 3 and 4; sort the samples and drop repeated ones"),
    "decreasing": (T[::-1], "trajectory 1 ('two'): expected strictly increasing times, got decreasing stamps 1 and 0.857142857 at samples 0 and 1"),
    "NaN": (_stamps(2, np.nan), "trajectory 1 ('two'): expected finite times, got nan at sample 2"),
    "one too few": (T[:-1], "trajectory 1 ('two'): expected one time stamp for each of the 8 samples, got times of shape (7,)"),
    "dates": ((1000 * T).astype("M8[ms]"), "trajectory 1 ('two'): expected times in seconds, got datetime64[ms], which counts in a unit of its own; pass (times - times[0]) / np.timedelta64(1, 's')"),
    "words": (list("abcdefgh"), "trajectory 1 ('two'): expected times in seconds, got could not convert"),
}  # fmt: skip


@pytest.mark.parametrize(("times", "message"), BAD_TIMES.values(), ids=BAD_TIMES)
def test_bad_times_are_refused(times, message):
    with pytest.raises(TrajectoryError, match=re.escape(message)):
        Demonstrations.from_arrays([X, X], times=[T, times], names=["one", "two"])


def test_the_last_and_the_next_first_stamp_may_be_in_any_order():
    assert len(Demonstrations.from_arrays([X, X], times=[T + 10, T])) == 2


@pytest.mark.parametrize(("times", "message"), BAD_TIMES.values(), ids=BAD_TIMES)
def test_a_trajectory_refuses_the_same_times(times, message):
    with pytest.raises(TrajectoryError, match=re.escape(message.partition(": ")[2])):
        Trajectory(times, X, name="two")


def test_a_trajectory_names_itself():
    with pytest.raises(TrajectoryError, match=r"'take 7'\)?: expected finite positions, got \[.*nan\] at sample 3"):
        Trajectory(T, _with(np.nan), name="take 7")


BAD_COLLECTIONS = {
    "nothing": (lambda: Demonstrations.of([]), "expected at least one movement, got none"),
    "no trajectory": (lambda: Demonstrations([]), "expected at least one movement, got none"),
    "an empty block": (lambda: Demonstrations.of(np.empty((0, 8, 2))), "expected at least one movement, got none"),
    "an empty mask": (lambda: Demonstrations.of([X])[[False]], "expected at least one movement, got an empty selection"),
    "a masked block": (lambda: Demonstrations.of(np.ma.masked_greater(X[None], 0.9)), "the block: expected an array of numbers, got one with 2 masked"),
    "a 4-D block": (lambda: Demonstrations.of(X[None, None]), "or one movement of shape (T, d), got shape (1, 1, 8, 2)"),
    "a transposed movement": (lambda: Demonstrations.of(np.ones((7, 150))), "trajectory 0: expected samples along the first axis and dimensions along the last, got shape (7, 150), more dimensions than samples; transpose the array, or, if it is right, pass its time stamps: kineme.Trajectory(times, array)"),
    "time along the last axis": (lambda: Demonstrations.of(np.ones((9, 6, 150))), "got shape (6, 150), more dimensions than samples; if time runs along the last axis, as in (n, d, T), pass np.moveaxis(array, 1, 2), or, if it is right"),
    "a short time along the last axis": (lambda: Demonstrations.of(np.ones((9, 2, 150))), "expected an array of shape (n, T, d), movements by samples by dimensions, got shape (9, 2, 150); if time runs along the last axis, as in (n, d, T), pass np.moveaxis(array, 1, 2)"),
    "transposed movements": (lambda: Demonstrations.of([np.ones((7, 150)), np.ones((7, 150))]), "more dimensions than samples; transpose the array, as by [x.T for x in arrays], or, if it is right"),
    "transposed movements of several durations": (lambda: Demonstrations.of([np.ones((7, 150)), np.ones((7, 90))]), "share their dimensions; transpose the array, as by [x.T for x in arrays]"),
    "a transposed one of a list": (lambda: Demonstrations.from_arrays([X.repeat(5, 1), X.repeat(5, 1)], names=["a", "b"]), "trajectory 0 ('a'): expected samples along the first axis"),
    "a transposed block": (lambda: Demonstrations.of(np.ones((20, 7, 150))), "trajectory 0: expected samples along the first axis"),
    "rows with labels": (lambda: Demonstrations.from_arrays(np.ones((9, 5)), labels=list("abcabcabc")), "expected one label for the one movement, got labels of shape (9,); one array (T, d) is one movement: pass many as a list or as one array (n, T, d)"),
    "a short block": (lambda: Demonstrations.of(np.zeros((5, 3, 2))), "every movement of the block: expected at least 4 samples, got 3"),
    "a block of words": (lambda: Demonstrations.of(np.full((2, 8, 2), "a")), "expected positions to be an array of numbers, got an array of type <U1"),
    "a block with NaN": (lambda: Demonstrations.of(np.stack((X, _with(np.nan)))), "trajectory 1: expected finite positions"),
    "None": (lambda: Demonstrations.of(None), "expected movements as a list of (T, d) arrays or one (n, T, d) array, got NoneType"),
    "a word": (lambda: Demonstrations.of("CShape"), "got str"),
    "a generator": (lambda: Demonstrations.of(x for x in [X]), "got generator"),
    "a file name": (lambda: Demonstrations.of("recordings/"), "got str; read files with kineme.read_recordings(path)"),
    "a path": (lambda: Demonstrations.of(Path("recordings")), "; read files with kineme.read_recordings(path)"),
    "a dictionary": (lambda: Demonstrations.of({"a": X}), "got dict; pass its values as a list, or a table as a data frame"),
    "an iterator": (lambda: Demonstrations.of(iter([X])), "got list_iterator; pass list(...) of it"),
    "trajectories and arrays": (lambda: Demonstrations([Trajectory(T, X), X]), "expected a sequence of Trajectory, got ndarray at index 1; use Demonstrations.from_arrays"),
    "labels": (lambda: Demonstrations.from_arrays([X, X], labels=["a"]), "expected one label for each of the 2 movements, got labels of shape (1,)"),
    "names": (lambda: Demonstrations.from_arrays([X, X], names=["a"]), "expected one name for each of the 2 movements, got 1"),
    "too few times": (lambda: Demonstrations.from_arrays([X, X], times=[T]), "expected times for each of the 2 movements, got 1"),
    "one time": (lambda: Demonstrations.from_arrays([X, X], times=1.0), "expected times as a list of (T,) arrays or one (T,) array, got float"),
    "some labels": (lambda: Demonstrations([Trajectory(T, X, "a"), Trajectory(T, X, name="b")]), "expected a label on every movement or on none, got none on trajectory 1 ('b')"),
    "some labels of arrays": (lambda: Demonstrations.from_arrays([X, X], ["a", None]), "expected a label on every movement or on none, got none on trajectory 1"),
    "dimensions": (lambda: Demonstrations([Trajectory(T, X), Trajectory(T, T, name="b")]), "trajectory 1 ('b'): expected 2 dimensions as in trajectory 0, got 1"),
    "no movement at all": (lambda: DMP().learn([X, np.ones((8, 2))]), "trajectory 1: expected a movement, got 8 samples at the same place (1 of 2 movements do not move); leave them out"),
    "rounding": (lambda: DMP().learn([1e6 + 1e-10 * X]), "trajectory 0: expected a movement"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "message"), BAD_COLLECTIONS.values(), ids=BAD_COLLECTIONS)
def test_bad_collections_are_refused(make, message):
    with pytest.raises(TrajectoryError, match=re.escape(message)):
        make()


def test_errors_are_those_that_numpy_users_catch():
    assert issubclass(TrajectoryError, ValueError)
    assert issubclass(TrajectoryError, KinemeError)


def test_positions_and_stamps_as_large_and_as_small_as_they_may_be_are_learned():
    """Where the sum of their squares is beyond what one of them may be."""
    for size, seconds in ((0.9e100, 1e49), (1e-99, 1e-48), (1e-99, 1e49), (0.9e100, 1e-48)):
        demos = Demonstrations.from_arrays([size * X, size * X[::-1]], times=seconds * np.append(T[:-1], 1.1))
        movement = DMP("original", n_basis=10).learn(demos).rollout()
        for numbers in (movement.positions / size, movement.velocities / size * seconds):
            assert np.isfinite(numbers).all()
            assert np.abs(numbers).max() < 10
        assert np.isfinite(movement.accelerations).all()


OUT_OF_RANGE = {
    "large": (1e160 * X, T, "expected positions up to 1e+100, got [1.42857142857142"),
    "large, one sample": (_with(-1e101), T, "expected positions up to 1e+100, got [0.42857142857142855, -1e+101] at sample 3; choose a unit in which they are"),
    "small": (1e-101 * X, T, "expected an extent of at least 1e-100, got 1e-101; choose a unit in which it is"),
    "denormal": (5e-324 * np.arange(16.0).reshape(8, 2), T, "expected an extent of at least 1e-100"),
    "late": (X, 1e60 + 1e50 * T, "expected times up to 1e+50, got"),
    "short": (X, 1e-60 * T, "expected at least 1e-50 s between stamps, got 0 and 1.42857143e-61 at samples 0 and 1; times are in seconds"),
    "denormal stamps": (X, 5e-324 * np.arange(8), "expected at least 1e-50 s between stamps"),
}  # fmt: skip


@pytest.mark.parametrize(("x", "t", "message"), OUT_OF_RANGE.values(), ids=OUT_OF_RANGE)
def test_what_is_out_of_range_is_refused(x, t, message):
    for make in (
        lambda: Demonstrations.from_arrays([X, x], times=[T, t]),
        lambda: Trajectory(t, x),
    ):
        with pytest.raises(TrajectoryError, match=re.escape(message)):
            make()


def test_small_positions_of_a_movement_that_is_not_small_and_rest_are_no_matter():
    closed = np.column_stack((np.sin(2 * np.pi * T), 1e-120 * T))
    closed[[0, 4, -1]] = 0.0
    assert len(Demonstrations.from_arrays([closed, np.zeros((8, 2)), np.full((8, 2), 1e-200)])) == 3


COMPLEX = {
    "an array": X + 1j,
    "a list": (X + 1j).tolist(),
    "a list of arrays": list(X + 1j),
    "numbers of NumPy": [list(row) for row in X + 1j],
    "single precision": [list(row) for row in (X + 1j).astype(np.complex64)],
    "objects": (X + 1j).astype(object),
    "objects of NumPy": np.array([[np.complex64(v) for v in row] for row in X + 1j], dtype=object),
}


@pytest.mark.parametrize("values", COMPLEX.values(), ids=COMPLEX)
def test_imaginary_parts_are_refused_wherever_they_hide(values):
    column = [row[0] for row in values]
    primitives = DMP(n_basis=10).learn([X])
    wish = values[0]
    for take in (
        lambda: Demonstrations.of([X, values]),
        lambda: Trajectory(T, values),
        lambda: Trajectory(column, X),
        lambda: Demonstrations.from_arrays([X], times=[column]),
        lambda: primitives.rollout(goal=wish),
        lambda: primitives.rollout(start=wish),
        lambda: styles.average(primitives, [wish[0]]),
        lambda: RandomBinning().fit(values),
        lambda: orientation.normalized([*wish, *wish]),
        lambda: orientation.log([*wish, *wish]),
        lambda: orientation.exp([*wish, wish[0]]),
    ):
        with pytest.raises(TrajectoryError, match=r"expected real numbers|expected numbers for"):
            take()

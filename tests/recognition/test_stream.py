"""A movement, sample by sample."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from sklearn.base import clone

import kineme
from kineme.errors import SpecificationError, TrajectoryError
from kineme.recognition.early.evidence import partial_shares as shares_of
from kineme.recognition.early.hypotheses import Early, hypotheses
from kineme.recognition.early.live_state import LiveStatus
from kineme.recognition.early.stream import BoundedPath, Decision
from soaking import SOAK

SHAPES = ("CShape", "GShape", "NShape", "Sshape", "WShape", "Zshape")


def partial_shares(recognizer, movements):
    stored = hypotheses(recognizer.comparison_, recognizer.references_, Early())
    return shares_of(recognizer.comparison_, stored, movements)


@pytest.fixture(scope="module")
def lasa():
    demos = kineme.load_lasa()
    return demos[[i for i, label in enumerate(demos.labels) if label in SHAPES]]


@pytest.fixture(scope="module")
def recognizer(lasa):
    return kineme.Recognizer().fit(lasa[[i for i in range(len(lasa)) if i % 7 < 3]])


@pytest.fixture(scope="module", params=range(0, len(SHAPES), 1 if SOAK else 2), ids=lambda k: SHAPES[k])
def movement(lasa, request):
    """A movement that the recognizer has not seen, at 200 of its samples."""
    recorded = lasa[7 * request.param + 5]
    return kineme.Trajectory(recorded.times[::5], recorded.positions[::5], recorded.label)


def _states(live, movement):
    return [live.update(t, x) for t, x in zip(movement.times, movement.positions, strict=True)]


@pytest.fixture(scope="module")
def followed(recognizer, movement):
    """The states of a stream after each sample, and its answer at the end."""
    live = recognizer.stream()
    return _states(live, movement), live.finish()


def test_a_stream_fed_whole_ends_with_the_batch_answer(recognizer, movement, followed):
    again = recognizer.stream()
    again.update(movement.times, movement.positions)
    batch = recognizer.recognize(movement)
    for answer in (followed[1], again.finish()):
        assert (answer.label, answer.confidence) == (batch.label, batch.confidence)


def test_a_stream_ends_with_the_fit_that_it_began_with(recognizer, movement):
    fitted_again = clone(recognizer).fit(recognizer.demonstrations_)
    live = fitted_again.stream()
    fitted_again.fit(recognizer.demonstrations_, [f"another {label}" for label in recognizer.demonstrations_.labels])
    live.update(movement.times, movement.positions)
    assert live.finish().label == recognizer.recognize(movement).label


def test_it_decides_before_the_end_and_never_flickers(followed, movement):
    states = followed[0]
    labels = [state.label for state in states]
    if movement.label == "CShape":  # which is how a G begins: nobody can know before it stops
        assert set(labels) == {None}
        assert {guess.label for guess in states[-1].ranked[:2]} == {"CShape", "GShape"}
        return
    decided = labels.index(movement.label)
    assert labels[:decided] == [None] * decided
    assert labels[decided:] == [movement.label] * (len(labels) - decided)
    assert decided < 0.9 * len(labels)


def test_progress_grows_and_the_goal_is_found(followed, movement):
    states = followed[0]
    leaders = [state.ranked[0].label if state.ranked else None for state in states]
    progress = np.array([state.progress for state in states])
    since = len(leaders) - next((k for k, label in enumerate(leaders[::-1]) if label != movement.label), len(leaders))
    assert (np.diff(progress[since:]) >= 0).all()
    assert ((progress >= 0) & (progress <= 1)).all()
    extent = np.linalg.norm(np.ptp(movement.positions, axis=0))
    late = states[int(0.9 * len(states))]
    assert np.linalg.norm(late.goal - movement.positions[-1]) < 0.25 * extent
    assert late.arrival == pytest.approx(movement.times[-1], abs=0.25 * movement.times[-1])
    assert late.path.shape == (20, 2)
    np.testing.assert_allclose(late.path[0], movement.positions[int(0.9 * len(states))])


def test_shares_sum_to_one_and_are_ranked(recognizer, followed):
    for state in followed[0][10::40]:
        shares = [guess.confidence for guess in state.ranked]
        assert sum(shares) + state.unknown == pytest.approx(1.0)
        assert shares == sorted(shares, reverse=True)
        assert {guess.label for guess in state.ranked} == set(recognizer.classes_)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("fraction", [0.4, 0.7, 1.0])
def test_the_stream_agrees_with_the_batch_on_a_beginning(recognizer, movement, fraction):
    end = int(fraction * len(movement.times))
    live = recognizer.stream().update(movement.times[:end], movement.positions[:end])
    batch = partial_shares(recognizer, [kineme.Trajectory(movement.times[:end], movement.positions[:end])])[0]
    streamed = {guess.label: guess.confidence for guess in live.ranked}
    np.testing.assert_allclose([streamed[label] for label in recognizer.classes_], batch[:-1], atol=0.03)


def test_place_size_and_direction_do_not_change_what_is_said(recognizer, movement):
    angle, half = 0.2, slice(0, len(movement.times) // 2)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    early = Early(size_spread=np.inf, max_angle=np.pi)
    plain = recognizer.stream(early=early).update(movement.times[half], movement.positions[half])
    moved = recognizer.stream(early=early).update(movement.times[half], 3.0 * movement.positions[half] @ R.T + 70.0)
    assert plain.ranked[0].label == moved.ranked[0].label
    shares = [{guess.label: guess.confidence for guess in state.ranked} for state in (plain, moved)]
    np.testing.assert_allclose(*([one[label] for label in SHAPES] for one in shares), atol=1e-3)
    np.testing.assert_allclose(moved.goal, 3.0 * R @ plain.goal + 70.0, atol=0.01)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize(
    ("t", "x", "flag"),
    [
        (np.nan, [0.0, 0.0], LiveStatus.NOT_FINITE),
        (9.0, [0.0, np.inf], LiveStatus.NOT_FINITE),
        (9.0, [0.0, 1e308], LiveStatus.NOT_FINITE),
        (1e60, [0.0, 0.0], LiveStatus.NOT_FINITE),
        (9.0, np.ma.masked_array([0.0, 1e4], [False, True]), LiveStatus.NOT_FINITE),
        (-1.0, [0.0, 0.0], LiveStatus.TIME_NOT_INCREASING),
        (0.0, [0.0, 0.0], LiveStatus.TIME_NOT_INCREASING),
        (9.0, [0.0, 0.0, 0.0], LiveStatus.WRONG_SHAPE),
        (9.0, "here", LiveStatus.WRONG_SHAPE),
        ([9.0, 9.1], [[0.0, 0.0]], LiveStatus.WRONG_SHAPE),
        (None, None, LiveStatus.WRONG_SHAPE),
    ],
)
def test_what_cannot_be_used_is_skipped_counted_and_flagged(recognizer, movement, t, x, flag):
    live = recognizer.stream()
    live.update(movement.times[:50], movement.positions[:50])
    state = live.update(t, x)
    assert flag in state.status
    assert state.skipped == 1
    assert all(state.status.messages)
    after = live.update(movement.times[50:], movement.positions[50:])
    undisturbed = recognizer.stream().update(movement.times, movement.positions)
    assert after.ranked == undisturbed.ranked
    assert flag not in after.status
    assert live.finish().label == movement.label


def test_a_repeated_time_stamp_is_skipped(recognizer, movement):
    live = recognizer.stream()
    live.update(movement.times[:50], movement.positions[:50])
    state = live.update(movement.times[49], movement.positions[49] + 1.0)
    assert (LiveStatus.TIME_NOT_INCREASING in state.status, state.skipped) == (True, 1)


def test_nothing_is_claimed_before_there_is_motion(recognizer):
    live = recognizer.stream()
    for k in range(10):
        state = live.update(0.1 * k, [1.0, 2.0])
        assert state.status == LiveStatus.TOO_SHORT | LiveStatus.UNDECIDED
        assert (state.label, state.ranked, state.path, state.unknown) == (None, (), None, 1.0)


def test_too_little_to_finish_is_refused(recognizer):
    live = recognizer.stream()
    live.update(0.0, [0.0, 0.0])
    for finish in (live.finish, live.next, recognizer.stream().next):
        said = r"^expected a movement of at least 4 samples since the stream began it, got [01]; update it with more"
        with pytest.raises(TrajectoryError, match=said):
            finish()
    live.update(0.0, [np.nan, 0.0])
    with pytest.raises(TrajectoryError, match="got 1 and 1 sample skipped; update"):
        live.finish()


def test_reset_begins_anew(recognizer, movement):
    live = recognizer.stream()
    first = live.update(movement.times, movement.positions)
    live.update(np.nan, [0.0, 0.0])
    live.reset()
    second = live.update(movement.times - 100.0, movement.positions)
    assert second.skipped == 0
    assert [guess.label for guess in second.ranked] == [guess.label for guess in first.ranked]
    np.testing.assert_allclose(
        [guess.confidence for guess in second.ranked], [guess.confidence for guess in first.ranked], atol=1e-9
    )


def test_memory_is_bounded_and_an_endless_path_is_averaged():
    path = BoundedPath(8, 1)
    for k in range(1000):
        path.append(float(k), np.array([2.0 * k]))
    kept = path.kept()
    assert len(kept) <= 9
    assert (np.diff(kept[:, 0]) > 0).all()
    np.testing.assert_allclose(kept[:, 1], 2.0 * kept[:, 0])
    np.testing.assert_array_equal(kept[-1], [999.0, 1998.0])
    assert kept[0, 0] == pytest.approx((path.per_row - 1) / 2)


def test_short_paths_are_kept_as_they_came():
    path, rows = BoundedPath(16, 2), np.random.default_rng(0).normal(size=(16, 2))
    for k, row in enumerate(rows):
        path.append(float(k), row)
    np.testing.assert_array_equal(path.kept()[:, 1:], rows)


def test_a_decision_needs_patience_and_a_change_twice_as_much():
    decision = Decision(confidence=0.8, patience=0.1)
    assert [decision.update(t, 3, 0.9) for t in (1.0, 1.05, 1.2)] == [None, None, 3]
    assert decision.update(1.3, 5, 0.7) == 3  # not sure enough
    assert [decision.update(t, 5, 0.9) for t in (2.0, 2.3)] == [3, 3]
    assert decision.update(2.4, 3, 0.9) == 3  # the other one must begin again
    assert [decision.update(t, 5, 0.9) for t in (2.5, 2.9, 3.2)] == [3, 3, 5]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"confidence": 0.5}, "expected confidence to be a number above 0.5, got 0.5"),
        ({"confidence": 1.0}, "expected confidence below 1, got 1.0"),
        ({"patience": -0.1}, "expected patience to be a number of at least 0, got -0.1"),
    ],
)
def test_wishes_out_of_range_are_refused(recognizer, options, message):
    with pytest.raises(SpecificationError, match=message):
        recognizer.stream(**options)


def test_nothing_is_loaded_while_a_movement_is_under_way():
    """A fresh process: after `stream()`, no update imports anything, however many there are."""
    code = (
        "import sys, kineme\n"
        "demos = kineme.load_lasa(['CShape', 'GShape'])\n"
        "live = kineme.Recognizer().fit(demos).stream()\n"
        "before = set(sys.modules)\n"
        "for t, x in zip(demos[3].times[::5], demos[3].positions[::5]):\n"
        "    live.update(t, x)\n"
        "print(sorted(set(sys.modules) - before))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_an_answer_up_to_a_stamp_is_that_of_a_stream_that_ended_there(recognizer, movement):
    live, shorter = recognizer.stream(), recognizer.stream()
    rest = np.repeat(movement.positions[-1:], 50, axis=0)
    after = movement.times[-1] + np.arange(1, 51) / 100
    live.update(np.append(movement.times, after), np.concatenate((movement.positions, rest)))
    shorter.update(movement.times, movement.positions)
    assert live.finish(until=movement.times[-1]).probabilities == shorter.finish().probabilities
    assert live.movement(until=movement.times[-1]).duration == movement.duration
    assert live.movement().duration > movement.duration
    with pytest.raises(TrajectoryError):
        live.finish(until=movement.times[2])


def test_to_remember_an_answer_is_the_second_half_of_next(recognizer, movement):
    at_once, apart = recognizer.stream(), recognizer.stream()
    for live in (at_once, apart):
        live.update(movement.times, movement.positions)
    answer = apart.finish()
    assert at_once.next().probabilities == answer.probabilities
    apart.remember(answer)
    apart.reset()
    half = len(movement.times) // 2
    states = [live.update(movement.times[:half], movement.positions[:half]) for live in (at_once, apart)]
    assert states[0].ranked == states[1].ranked
    fresh = recognizer.stream().update(movement.times[:half], movement.positions[:half])
    assert states[0].ranked != fresh.ranked

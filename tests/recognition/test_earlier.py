"""A stream that remembers the earlier movements of a person."""

from __future__ import annotations

import math

import numpy as np
import pytest

import kineme
from kineme.errors import TrajectoryError
from kineme.recognition.early.earlier import MOST_OF_EACH, Earlier, earlier, remembered, with_earlier
from kineme.recognition.early.hypotheses import Early, hypotheses
from kineme.similarity.comparison import References

SHAPES = ("CShape", "NShape", "Sshape", "WShape", "Zshape")
SLOWER, LARGER = 1.8, 2.0


@pytest.fixture(scope="module")
def lasa():
    demos = kineme.load_lasa()
    return demos[[i for i, label in enumerate(demos.labels) if label in SHAPES]]


@pytest.fixture(scope="module")
def recognizer(lasa):
    return kineme.Recognizer().fit(lasa[[i for i in range(len(lasa)) if i % 7 < 2]])


def _by_person(lasa, shape, example=4, slower=SLOWER):
    """A movement by somebody who is slower and larger than those who demonstrated, and has a curve of her own."""
    recorded = lasa[7 * SHAPES.index(shape) + example]
    positions = recorded.positions[::10].copy()
    positions[:, 0] += 0.2 * np.ptp(positions, axis=0).max() * np.sin(np.linspace(0, 2 * np.pi, len(positions)))
    return kineme.Trajectory(slower * recorded.times[::10], LARGER * positions, shape)


def _confidence(live, movement, label):
    """The share of a label after half of a movement, which is forgotten."""
    half = len(movement.times) // 2
    state = live.update(movement.times[:half], movement.positions[:half])
    live.reset()
    return next(guess.confidence for guess in state.ranked if guess.label == label)


def _finished(live, movement):
    live.update(movement.times, movement.positions)
    return live.next()


def test_a_movement_seen_before_is_named_surer_and_another_person_begins_anew(lasa, recognizer):
    live, movement = recognizer.stream(), _by_person(lasa, "NShape")
    before = _confidence(live, movement, "NShape")
    assert _finished(live, movement).label == "NShape"
    again = _by_person(lasa, "NShape", 5)
    assert _confidence(live, again, "NShape") > before + 0.1
    live.reset()
    assert _confidence(live, movement, "NShape") > before + 0.1
    live.reset(person=True)
    assert _confidence(live, movement, "NShape") == before


def test_whole_movements_are_answered_as_without_earlier_ones(lasa, recognizer):
    live = recognizer.stream()
    for shape in SHAPES:
        for example in (4, 5):
            movement = _by_person(lasa, shape, example)
            batch = recognizer.recognize(movement)
            answer = _finished(live, movement)
            assert (answer.label, answer.confidence) == (batch.label, batch.confidence)


def test_what_is_unknown_or_unsure_is_not_remembered(lasa, recognizer):
    live, movement = recognizer.stream(), _by_person(lasa, "NShape")
    before = _confidence(live, movement, "NShape")
    angle = np.linspace(0, 6 * np.pi, 200)
    unknown = kineme.Trajectory(angle, np.column_stack((angle * np.cos(angle), angle * np.sin(angle))))
    assert _finished(live, unknown).label is None
    assert _confidence(live, movement, "NShape") == before
    careful = recognizer.stream(confidence=1.0 - 1e-12)
    assert _finished(careful, movement).label == "NShape"
    assert _confidence(careful, movement, "NShape") == before


def test_a_movement_that_is_too_short_leaves_the_stream_as_it_is(lasa, recognizer):
    live = recognizer.stream()
    live.update(0.0, [0.0, 0.0])
    with pytest.raises(TrajectoryError, match="at least"):
        live.next()
    live.reset()
    assert _finished(live, _by_person(lasa, "NShape")).label == "NShape"


def test_the_last_three_of_each_class_are_kept_in_order():
    movements = [Earlier(k % 2, None, float(k), 0.0) for k in range(11)]
    kept = []
    for movement in movements:
        kept = remembered(kept, movement)
    assert [movement.size for movement in kept] == [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    assert MOST_OF_EACH == 3


def _stored(recognizer, early):
    return hypotheses(recognizer.comparison_, recognizer.references_, early)


def test_joined_beginnings_are_those_of_all_movements_together(lasa, recognizer):
    early = Early(size_spread=math.inf, duration_spread=math.inf)  # nothing is shifted
    stored = _stored(recognizer, early)
    shown = kineme.Demonstrations([_by_person(lasa, shape) for shape in ("Zshape", "CShape", "NShape")])
    labels = [recognizer.classes_.tolist().index(label) for label in shown.labels]
    own = [earlier(stored, shown[[k]], label) for k, label in enumerate(labels)]
    joined = with_earlier(stored, own)
    everything = kineme.Demonstrations([*recognizer.demonstrations_, *shown])
    order = np.argsort(everything.labels, kind="stable")
    comparison, sorted_labels = recognizer.comparison_, np.asarray(everything.labels)[order]
    described = comparison.describe(everything[order])
    together = hypotheses(comparison, References.of(everything[order], described, sorted_labels), early)
    for name in ("first", "durations", "log_lengths", "log_durations", "timing_squares", "paths"):
        np.testing.assert_allclose(getattr(joined, name), getattr(together, name), atol=1e-9)
    for ours, theirs in zip(joined.prefixes, together.prefixes, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    for ours, theirs in ((joined.wholes, together.wholes), (joined.described, together.described)):
        np.testing.assert_allclose(ours.pairs.positions.rows, theirs.pairs.positions.rows, atol=1e-5)
        assert len(ours) == len(theirs)
    np.testing.assert_array_equal(joined.widths, stored.widths)


def test_size_and_tempo_are_shifted_the_surer_the_more_were_seen_and_the_steadier_they_were(lasa, recognizer):
    stored = _stored(recognizer, Early())

    def after(tempos):
        sized = [Earlier(0, earlier(stored, lasa[[0]], 0).begun, 0.0, math.log(tempo)) for tempo in tempos]
        joined = with_earlier(stored, sized)
        rows = len(joined.log_durations) - 20  # the last movement was stored, not seen
        return joined.log_durations[rows:] - stored.log_durations[-20:], joined.early.duration_spread

    once, spread_once = after([2.0])
    thrice, spread_thrice = after([2.0] * 3)
    assert 0 < once.mean() < thrice.mean() < math.log(2.0)
    assert np.ptp(once) < 1e-9
    assert spread_thrice < spread_once < Early().duration_spread
    changing, spread_changing = after([0.25, 1.0, 4.0])
    assert spread_changing > Early().duration_spread
    assert abs(changing).max() < 1e-9


def test_a_stream_of_a_library_remembers_too(tmp_path, lasa, recognizer):
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(recognizer.demonstrations_, recognizer.demonstrations_.labels)
        live, movement = library.stream(), _by_person(lasa, "NShape")
        before = _confidence(live, movement, "NShape")
        assert _finished(live, movement).label == "NShape"
        assert _confidence(live, _by_person(lasa, "NShape", 5), "NShape") > before + 0.1

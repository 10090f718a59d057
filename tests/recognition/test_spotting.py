"""Known movements are found inside unlabeled motion, and what is between them is called unknown."""

# ruff: noqa: E501 - one case, one line, the message whole

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import kineme
from kineme import Demonstrations, Recognizer, Trajectory
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.segmentation.segment import pieces_of
from kineme.movements.segmentation.table import observe
from kineme.recognition import compared_windows
from kineme.recognition.compared_windows import (
    Candidates,
    ComparedWindows,
    Durations,
    Surroundings,
    Templates,
    candidate_windows,
    compare_candidates,
    rarity_weights,
    resampled,
    size_and_slowness,
)
from kineme.recognition.spotting import (
    Expected,
    Manner,
    Spotted,
    _best_chain,
    _completed,
    _distances,
    _left_over,
    closest_classes,
    durations_of,
    far,
    most_nonconformity,
    score_windows,
)
from kineme_experiments.evaluation.spotting import Counts, concatenate, count_spotted
from movement_samples import draw_shapes
from soaking import SOAK, slow

KNOWN = ["CShape", "NShape", "Sshape", "WShape"]
UNKNOWN = ["heee", "Spoon", "Khamesh"]
RATE = 100


@cache
def _recognizer():
    demos = kineme.load_lasa(KNOWN)
    return Recognizer().fit(demos[np.flatnonzero(np.arange(len(demos)) % 7 < 4)])


def _stream(seed, shapes, noise=0.0, rest=0.6):
    """Recordings of demonstrations not trained on, one after the other: other sizes and places, rests between them."""
    rng = np.random.default_rng(seed)
    x, truth = [np.zeros((int(rest * RATE), 2))], []
    for shape in shapes:
        one = kineme.load_lasa([shape])[int(rng.integers(4, 7))]
        even = np.linspace(one.times[0], one.times[-1], int(one.duration * rng.uniform(0.8, 1.25) * RATE))
        path = np.column_stack([np.interp(even, one.times, column) for column in one.positions.T])
        start = sum(map(len, x))
        truth.append((start / RATE, (start + len(path) - 1) / RATE, shape if shape in KNOWN else None))
        x.append(x[-1][-1] + (path - path[0]) * rng.uniform(0.7, 1.4))
        x.append(np.repeat(x[-1][-1:], int(rest * RATE), axis=0))
    x = np.concatenate(x)
    x = x + noise * 30.0 * rng.normal(size=x.shape)
    return Trajectory(np.arange(len(x)) / RATE, x), truth


def _frames(segments, times):
    """Label of each sample; "" at rest, "?" in unknown motion."""
    labels = np.full(len(times), "", dtype=object)
    for start, end, label, *_ in segments:
        labels[(times >= start) & (times <= end)] = "?" if label is None else label
    return labels


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [0.0, 0.005, 0.1])
def test_known_movements_are_found_where_they_are(seed, noise):
    order = np.random.default_rng(seed).permutation(KNOWN).tolist()
    recording, truth = _stream(seed, order, noise)
    found = _recognizer().spot(recording)
    frames, true = _frames(found, recording.times), _frames(truth, recording.times)
    assert (frames == true)[true != ""].mean() > 0.9
    for start, end, label in truth:
        middle = frames[(recording.times > start) & (recording.times < end)]
        assert (middle == label).mean() > 0.8, label


@pytest.mark.parametrize("seed", range(3))
def test_unknown_movements_between_known_ones_are_called_unknown(seed):
    order = [x for pair in zip(KNOWN, UNKNOWN, strict=False) for x in pair]
    recording, truth = _stream(seed, order, 0.002)
    frames, true = _frames(_recognizer().spot(recording, 0.1), recording.times), _frames(truth, recording.times)
    assert (frames == true)[true != ""].mean() > 0.75


def test_segments_are_in_order_apart_and_say_how_sure_they_are():
    recording, _ = _stream(3, [*KNOWN, *UNKNOWN])
    found = _recognizer().spot(recording)
    assert all(isinstance(one, Spotted) for one in found)
    bounds = np.array([(one.start, one.end) for one in found]).ravel()
    assert (np.diff(bounds) > -2 / RATE).all()
    assert all(0.0 <= one.confidence <= 1.0 for one in found)
    assert {one.label for one in found} <= {*KNOWN, None}


def test_confidence_and_p_known_are_those_of_the_answer_to_the_stretch():
    recording, _ = _stream(3, [*KNOWN, *UNKNOWN], 0.002)
    recognizer = _recognizer()
    found = recognizer.spot(recording)
    rows = np.searchsorted(recording.times, [(one.start, one.end) for one in found]) + np.array([0, 1])
    answers = recognizer.recognize(pieces_of(recording, rows))
    assert {one.label is None for one in found} == {True, False}
    for one, answer in zip(found, answers, strict=True):
        assert one.p_known == pytest.approx(answer.p_known)
        if one.label is None:
            assert one.confidence == pytest.approx(1.0 - one.p_known)
        elif one.label == answer.label:
            assert one.confidence == pytest.approx(answer.confidence)


def test_what_was_stored_before_p_known_was_told_still_opens():
    stored = b"ckineme.recognition.spotting\nSpotted\n(F0.0\nF1.0\nVa\nF0.9\nt\x81."
    assert pickle.loads(stored)[:4] == (0.0, 1.0, "a", 0.9)
    assert np.isnan(pickle.loads(stored).p_known)


@pytest.mark.parametrize("labels", [[3, 4, 5], ["a", "b", "c"], np.array(["a", "b", "c"])])
def test_labels_are_plain_numbers_and_texts(labels):
    demos = draw_shapes([1, 1, 1])
    recording = Trajectory(np.linspace(0.0, 1.0, 80), demos[1].positions)
    (found,) = Recognizer().fit(demos, labels).spot(recording)
    assert found.label == labels[1]
    assert type(found.label) is type(np.asarray(labels).tolist()[1])


def test_unit_place_and_origin_of_time_do_not_matter():
    recording, _ = _stream(1, ["NShape", "heee", "CShape"])
    moved = Trajectory(recording.times + 50.0, 1e3 * recording.positions + 1e4)
    for one, other in zip(_recognizer().spot(recording), _recognizer().spot(moved), strict=True):
        assert one.label == other.label
        np.testing.assert_allclose((one.start + 50.0, one.end + 50.0), (other.start, other.end), atol=3 / RATE)


def test_arrays_without_time_stamps_have_no_duration_to_compare():
    demos = kineme.load_lasa(KNOWN)
    arrays = [one.positions for one in demos]
    recording, _ = _stream(2, ["WShape", "CShape"])
    found = Recognizer().fit(arrays, demos.labels).spot(recording)
    assert [one.label for one in found if one.label is not None] == ["WShape", "CShape"]


def test_durations_of_even_stamps_that_are_not_kept_sample_by_sample_count():
    demos = kineme.load_lasa(KNOWN)
    untimed = replace(demos.movements, times=None)
    even = replace(untimed, durations=np.full(len(demos), 1.98))
    fitted = Recognizer().fit(Demonstrations.of_movements(even), demos.labels)
    np.testing.assert_allclose(durations_of(fitted.references_), 1.98)
    arrays = Recognizer().fit([one.positions for one in demos], demos.labels)
    assert durations_of(arrays.references_) is None


def _stretched(movements, factor):
    """The movements, slower by a factor, without labels."""
    return Demonstrations([Trajectory(factor * one.times, one.positions) for one in movements])


def _counts(rests, known=True, stretched=1.0):
    """Spots in concatenated recordings of demonstrations not trained on, of eight classes."""
    shapes = [*KNOWN, "GShape", "Zshape", "PShape", "Trapezoid"]
    rng, found = np.random.default_rng(0), Counts()
    demos = kineme.load_lasa([*shapes, *UNKNOWN])
    held_out = np.flatnonzero(np.arange(len(demos)) % 7 >= 3)
    shown = np.isin(demos.labels, shapes) & (np.arange(len(demos)) % 7 < 3)
    recognizer = Recognizer().fit(demos[np.flatnonzero(shown)])
    for _ in range(3):
        chosen = [i for i in rng.permutation(held_out).tolist() if not known or demos.labels[i] in shapes][:9]
        labels = [demos.labels[i] if demos.labels[i] in shapes else None for i in chosen]
        movements = _stretched(demos[chosen], stretched)
        recording, truth, _ = concatenate(movements, labels, rng, rests=rests)
        found = found + count_spotted(recognizer.spot(recording), truth)
    return found


@pytest.mark.parametrize(("rests", "known"), [(True, True), slow(True, False), slow(False, True), (False, False)])
def test_what_is_in_a_recording_is_found_with_and_without_rests(rests, known):
    found = _counts(rests, known)
    assert found.recall >= 0.95
    assert found.precision >= 0.9


@pytest.mark.parametrize("stretched", [0.6, 1.7])
def test_a_recording_may_be_faster_or_slower_than_what_was_demonstrated(stretched):
    found = _counts(True, stretched=stretched)
    assert found.recall >= 0.95
    assert found.precision >= 0.9


def test_the_tempo_of_a_recording_is_estimated_from_what_is_found(monkeypatch):
    """Of two classes that differ in duration alone, the order stays where all is slower."""
    short = kineme.load_lasa(["CShape"])
    long = _stretched(short, 2.0)
    others = kineme.load_lasa(["NShape", "Sshape"])
    train = _stretched([*short[:3], *long[:3], *others[[0, 1, 2, 7, 8, 9]]], 1.0)
    recognizer = Recognizer().fit(train, ["short"] * 3 + ["long"] * 3 + ["N"] * 3 + ["S"] * 3)
    slower = [(short[4], "short"), (others[4], "N"), (long[5], "long"), (others[11], "S"), (others[5], "N")]
    movements = _stretched([one for one, _ in slower], 1.6)
    recording, truth, _ = concatenate(movements, [label for _, label in slower], np.random.default_rng(1))
    assert count_spotted(recognizer.spot(recording), truth) == Counts(5, 5, 5)
    monkeypatch.setattr("kineme.recognition.spotting._PASSES", 1)
    assert count_spotted(recognizer.spot(recording), truth).n_right < 5


def _compared(distances, durations=None):
    """Windows that start together, compared with two classes whose typical duration is one second."""
    n = len(distances)
    durations = np.ones(n) if durations is None else np.asarray(durations)
    scores = np.asarray(distances, dtype=np.float64)
    return ComparedWindows(np.zeros((n, 2), dtype=np.intp), scores, np.log(durations), np.zeros(n), np.zeros(n))


SAME = Expected(np.zeros(2), np.zeros(2), np.zeros(2))


@pytest.mark.parametrize(("end", "best"), [(0.91, 1), (1.1, 1), (0.89, 0), (1.12, 0)])
def test_the_class_is_the_closest_of_windows_that_share_nine_tenths(end, best):
    spans = np.array([[0.0, 1.0], [0.0, end]])
    compared = _compared([[0.5, 0.6], [0.9, 0.4]])
    assert closest_classes(compared, compared.scores, SAME, Manner(), spans, [0]).tolist() == [best]


def test_windows_that_start_earlier_or_later_are_alike_too():
    spans = np.array([[0.0, 1.0], [0.08, 1.08], [0.16, 1.16]])
    compared = _compared([[0.5, 0.6], [0.7, 0.7], [0.9, 0.4]])
    assert closest_classes(compared, compared.scores, SAME, Manner(), spans, [0, 1, 2]).tolist() == [0, 0, 1]
    spans[1:] = (0.04, 1.04), (0.05, 1.05)
    assert closest_classes(compared, compared.scores, SAME, Manner(), spans, [0, 1, 2]).tolist() == [1, 1, 1]


def test_a_short_window_costs_less_from_rest_to_rest():
    compared = _compared([[0.7, 0.9]] * 3, [0.4, 0.4, 2.0])
    around = Surroundings(np.zeros(3), np.array([0.0, 1e-3, 0.0]), np.zeros(3), np.zeros(3))
    scored = score_windows(compared, SAME, around, Manner(tempo=0.0), 1.0)
    others = 0.05 * compared.log_durations**2 + 0.03 * around.far_from_rest
    expected = (1.0 - 0.7 - others) * np.exp(compared.log_durations) - [0.2 * 0.4, 0.165, 0.165]
    np.testing.assert_allclose(scored.score, expected)
    most = most_nonconformity(compared, SAME, around, Manner(tempo=0.0), 1.0)
    for row in range(3):
        at = replace(compared, scores=most)
        assert score_windows(at, SAME, around, Manner(tempo=0.0), 1.0).score[row] == pytest.approx(0.0, abs=1e-12)


def test_durations_and_sizes_decide_between_classes_that_are_as_close():
    compared = _compared([[0.5, 0.5]], [2.0])
    typical = Expected(np.log([1.0, 2.0]), np.zeros(2), np.zeros(2))
    spans, asked = np.array([[0.0, 2.0]]), Manner(tempo=0.0)
    assert closest_classes(compared, compared.scores, typical, asked, spans, [0]).tolist() == [1]
    cost = 0.25 * 0.4 * np.log(2.0) ** 2
    for less, best in ((0.99, 1), (1.01, 0)):
        distances = np.array([[0.5 - less * cost, 0.5]])
        assert closest_classes(compared, distances, typical, asked, spans, [0]).tolist() == [best]


def test_a_class_that_much_of_the_recording_is_near_to_counts_less():
    """A fifth of the windows is within 0.2 of the first class and 0.8 of the second."""
    distances = np.column_stack((np.linspace(0.0, 1.0, 11), np.linspace(0.6, 1.6, 11)))
    compared = _compared(distances / [1.0, 2.0])
    candidates = Candidates(compared, rarity_weights(distances), np.ones(11, dtype=bool))
    np.testing.assert_allclose(candidates.weighted().scores, compared.scores * [2.0**0.3, 2.0**-0.3])
    assert np.isfinite(rarity_weights(0.0 * distances)).all()


def _windows(shapes):
    """A recording's windows, and what they are compared with."""
    recording, _ = _stream(2, shapes, 0.002)
    recognizer = _recognizer()
    lasting = recognizer.references_.all_movements().durations
    windows = candidate_windows(recording, Durations(lasting.min() / 2.0, lasting.max() * 3.0), 8)
    return Templates(recognizer.comparison_, recognizer.references_, recognizer.calibration()), windows


def test_windows_within_reach_are_compared_completely_and_no_other_seems_to_be(monkeypatch):
    known, windows = _windows([*KNOWN, *UNKNOWN])
    reach = far(0.05)
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 10**6)
    every = compare_candidates(known, windows.motion, windows.rows, reach)
    assert every.completely.all()
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 100)
    some = compare_candidates(known, windows.motion, windows.rows, reach)
    assert 98 <= some.completely.sum() <= 100 < len(windows) / 4
    np.testing.assert_allclose(some.weights, every.weights, rtol=0.02)
    exact = every.compared.scores * some.weights
    within, scores = exact <= reach, some.weighted().scores
    assert 0.001 < within.mean() < 0.2
    np.testing.assert_allclose(scores[within], exact[within], rtol=1e-5)
    np.testing.assert_allclose(scores[some.completely], exact[some.completely], rtol=1e-5)
    assert (scores[~within] > reach).all()
    assert (scores <= exact * (1 + 1e-5)).all()
    assert not np.allclose(scores, exact)
    chosen = np.arange(0, len(windows), 7)
    complete = _completed(known, windows.motion, some, chosen).compared.scores[chosen]
    np.testing.assert_allclose(complete, every.compared.scores[chosen], rtol=1e-5)
    for name in ("rows", "log_durations", "log_sizes", "slowness"):
        np.testing.assert_allclose(getattr(some.compared, name), getattr(every.compared, name))


def test_windows_are_nearest_to_the_class_that_the_recognizer_answers():
    known, windows = _windows([*KNOWN, *UNKNOWN])
    rows = windows.rows[::10]
    pieces = Demonstrations.of_movements(resampled(windows.motion, *windows.motion.times[rows].T))
    away = _distances(known, windows.motion, rows)
    assert (known.references.classes[away.argmin(axis=1)] == _recognizer().predict(pieces)).all()


@pytest.mark.parametrize("shapes", [KNOWN, [*KNOWN, *UNKNOWN], UNKNOWN])
def test_movements_are_the_same_where_few_windows_are_compared_completely(shapes, monkeypatch):
    recording, _ = _stream(4, shapes, 0.002)
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 10**6)
    found = _recognizer().spot(recording)
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 100)
    assert [one[:3] for one in _recognizer().spot(recording)] == [one[:3] for one in found]


def test_progress_of_a_recording_in_which_few_windows_are_compared_completely_goes_on_to_the_end(monkeypatch):
    known, windows = _windows(KNOWN)
    monkeypatch.setattr(compared_windows, "_COMPLETELY", 100)
    told = []
    compare_candidates(known, windows.motion, windows.rows, far(0.05), told.append)
    assert len(told) >= 2
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)


def test_windows_are_the_same_compiled_and_plain(monkeypatch):
    recording, _ = _stream(3, ["CShape"], 0.002)
    rng = np.random.default_rng(0)
    times = np.sort(recording.times + rng.uniform(-0.004, 0.004, len(recording.times)))
    motion = observe(Trajectory(times, recording.positions), 0.04)
    start = np.append(rng.uniform(times[0], times[-1] - 1.0, 20), times[0])
    end = np.append(np.minimum(start[:-1] + rng.uniform(0.1, 9.0, 20), times[-1]), times[-1])
    found = []
    for choice in ("never", "always"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        movements = resampled(motion, start, end)
        paths = movements.positions.reshape(21, 64, -1).transpose(0, 2, 1)
        paths = np.concatenate((paths, np.ones_like(paths[:1])))  # the last one stands still: all of it is slow
        found.append((movements.positions, movements.offsets, movements.durations, *size_and_slowness(paths)))
    for plain, compiled in zip(*found, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-12)
    assert found[0][-1][-1] == found[1][-1][-1] == 1.0


@pytest.mark.soak
@pytest.mark.parametrize(("rests", "least"), [(True, 0.8), (False, 0.72)][: 1 + SOAK])
def test_gestures_of_twenty_kinds_are_found_by_templates_of_other_people(gestures, rests, least):
    """Precision was 0.65 when the chosen window alone, over the scale of each class, told the class."""
    movements, people = gestures
    labels = np.asarray(movements.labels)
    found = Counts()
    for k, person in enumerate(np.unique(people)):
        rng = np.random.default_rng([1, k])
        others = np.flatnonzero(people != person)
        shown = np.concatenate([rng.choice(others[labels[others] == x], 3, replace=False) for x in np.unique(labels)])
        recognizer = Recognizer().fit(movements[shown], labels[shown], groups=people[shown])
        for _ in range(2 if SOAK else 1):
            chosen = rng.choice(np.flatnonzero(people == person), 8, replace=False)
            recording, truth, _ = concatenate(movements[chosen], labels[chosen].tolist(), rng, rests=rests)
            found = found + count_spotted(recognizer.spot(recording), truth)
    assert found.recall >= least
    assert found.precision >= least


def test_the_best_chain_is_that_of_all_chains():
    """Against enumeration."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        n = int(rng.integers(2, 7))
        first, last = (side[:12] for side in rng.permutation(np.array(np.triu_indices(n, 1)).T).T)
        score = rng.normal(size=len(first))
        chain = _best_chain(np.column_stack((first, last)), score)
        assert all(last[a] <= first[b] for a, b in pairwise(chain))
        best = 0.0
        for chosen in range(2 ** len(first)):
            members = sorted((c for c in range(len(first)) if chosen >> c & 1), key=lambda c: first[c])
            if all(last[a] <= first[b] for a, b in pairwise(members)):
                best = max(best, score[members].sum())
        assert score[chain].sum() == pytest.approx(best)


def test_what_is_left_over_is_from_one_stretch_of_motion_and_long_enough():
    bouts, known = np.array([[10, 100], [100, 140], [150, 160]]), np.array([[30, 50], [85, 98]])
    times = np.arange(200) / RATE
    assert _left_over(known, bouts, times, 0.0).tolist() == [[10, 30], [50, 85], [100, 140], [150, 160]]
    assert _left_over(known, bouts, times, 0.1).tolist() == [[10, 30], [50, 85], [100, 140]]


BAD = {
    "dimensions": ((Trajectory(np.arange(20.0), np.zeros((20, 3))),), TrajectoryError, "expected a recording of 2 dimensions as learned, got 3; select the dimensions"),
    "rest": ((Trajectory(np.arange(20.0), np.zeros((20, 2))),), TrajectoryError, "expected some movement, got 19 s at rest"),
    "error rate 1": ((np.zeros((20, 2)), 1.0), SpecificationError, "expected error_rate below 1, got 1.0; 0.05 is one member in twenty"),
    "error rate 0": ((np.zeros((20, 2)), 0.0), SpecificationError, "expected error_rate to be a number above 0, got 0.0"),
    "no time stamps": ((np.cumsum(np.ones((500, 2)), axis=0),), TrajectoryError, "expected time stamps, as the demonstrations have, got an array, which counts as one second; pass kineme.Trajectory(times, positions)"),
    "pieces": ((np.zeros((20, 2)), 0.05, 0), SpecificationError, "expected max_pieces to be a whole number of at least 1, got 0"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "error", "message"), BAD.values(), ids=BAD)
def test_bad_input_is_refused(arguments, error, message):
    with pytest.raises(error, match=re.escape(message)):
        _recognizer().spot(*arguments)


def test_it_is_fitted_first():
    with pytest.raises(ValueError, match="not fitted"):
        Recognizer().spot(np.zeros((20, 2)))


@pytest.mark.parametrize("gap", [0.6, 60.0, 3600.0])
def test_a_rest_may_have_no_samples_however_long_it_is(gap):
    """A pen that is lifted sends nothing, and one pause says nothing of how fast the others move."""
    recording, truth = _stream(0, KNOWN)
    moving = _frames(truth, recording.times) != ""
    later = np.where(recording.times > truth[1][1] + 0.3, gap, 0.0)
    found = _recognizer().spot(Trajectory((recording.times + later)[moving], recording.positions[moving]))
    assert [one.label for one in found if one.label is not None] == KNOWN
    np.testing.assert_allclose(
        [(one.start, one.end) for one in found if one.label is not None],
        [(start + gap * (k > 1), end + gap * (k > 1)) for k, (start, end, _) in enumerate(truth)],
        atol=0.4,
    )


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
@pytest.mark.parametrize("rest", [0, 50])
def test_a_robot_that_repeats_its_movements_exactly_is_recognized(noise, rest):
    # Its demonstrations differ less from each other than from themselves with a hundredth cut off, as a search does.
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 150)
    s = 10 * t**3 - 15 * t**4 + 6 * t**5
    shapes = {
        "wave": np.column_stack((0.3 * np.sin(4 * np.pi * s), 0.1 * s, 0.2 * s**2)),
        "reach": np.column_stack((0.4 * s, 0.1 * np.sin(np.pi * s), 0.3 * s)),
        "circle": np.column_stack((0.2 * np.cos(2 * np.pi * s) - 0.2, 0.2 * np.sin(2 * np.pi * s), 0.05 * s)),
    }

    def recorded(x):
        return Trajectory(np.arange(len(x)) / 100, x + noise * rng.normal(size=x.shape))

    names = [name for name in shapes for _ in range(3)]
    recognizer = Recognizer().fit([recorded(shapes[name]) for name in names], names)
    x, shown = np.zeros((1, 3)), ["wave", "circle", "reach", "circle"]
    for name in shown:
        moved = shapes[name] - shapes[name][0] + x[-1]
        x = np.concatenate((x, moved, np.repeat(moved[-1:], rest, axis=0)))
    found = recognizer.spot(recorded(x))
    assert [one.label for one in found] == shown
    assert min(one.p_known for one in found) > 1e-3


def test_demonstrations_of_few_samples_are_found():
    shown = kineme.load_lasa(["CShape", "NShape", "Sshape"])
    sparse = [kineme.Trajectory(movement.times[::170], movement.positions[::170], movement.label) for movement in shown]
    recognizer = Recognizer().fit([sparse[k] for k in (0, 1, 7, 8, 14, 15)])
    asked = shown[[3, 10, 17]]
    recording, truth, _ = concatenate(asked, asked.labels, np.random.default_rng(0))
    assert count_spotted(recognizer.spot(recording), truth) == Counts(3, 3, 3)


@pytest.mark.parametrize("fast", [0.5, 0.45])
def test_movements_of_one_recording_may_differ_in_pace(fast):
    shown = kineme.load_lasa(["CShape", "NShape", "Sshape", "WShape"])
    recognizer = Recognizer().fit(shown[[k for k in range(28) if k % 7 < 3]])
    asked = shown[[k for k in range(28) if k % 7 > 2]]
    paced = [
        kineme.Trajectory(movement.times * pace, movement.positions, movement.label)
        for movement, pace in zip(asked, np.resize([fast, 1.0, 2.0], len(asked)), strict=True)
    ]
    recording, truth, _ = concatenate(kineme.Demonstrations(paced), asked.labels, np.random.default_rng(0))
    assert count_spotted(recognizer.spot(recording), truth).n_right == len(truth)

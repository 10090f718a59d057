"""Four words say how sure an answer is, and none of them takes back what was said while the movement was under way."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.recognition.answer import LEAST_CONFIDENCE, certainty
from kineme.recognition.early.live_state import LiveState, LiveStatus
from kineme_experiments.evaluation.data import load_data

STRENGTH = {"looks like": 0, "probably": 1, "sure": 2}


@pytest.mark.parametrize(
    ("confidence", "is_guess", "word"),
    [
        (1.0, False, "sure"),
        (LEAST_CONFIDENCE["sure"], False, "sure"),
        (LEAST_CONFIDENCE["sure"] - 1e-9, False, "probably"),
        (LEAST_CONFIDENCE["probably"], False, "probably"),
        (LEAST_CONFIDENCE["probably"] - 1e-9, False, "looks like"),
        (1.0, True, "looks like"),
    ],
)
def test_the_word_is_that_of_the_confidence_and_never_more_than_a_likeness_by_a_guess(confidence, is_guess, word):
    assert certainty(confidence, is_new=False, is_guess=is_guess) == word
    assert certainty(confidence, is_new=True, is_guess=is_guess) == "new"


@given(st.tuples(st.floats(0, 1), st.floats(0, 1)), st.booleans())
def test_more_confidence_is_never_a_weaker_word(confidences, is_guess):
    words = [certainty(one, is_new=False, is_guess=is_guess) for one in sorted(confidences)]
    assert STRENGTH[words[0]] <= STRENGTH[words[1]]


def test_an_answer_says_its_word():
    demos = kineme.load_lasa(["CShape", "GShape", "NShape", "Angle", "Sine"])
    first = np.arange(len(demos)) % 7
    strange = kineme.load_lasa(["Worm"])[0]
    several, once = kineme.Recognizer().fit(demos[first < 5]), kineme.Recognizer().fit(demos[first < 1])
    assert several.recognize(demos[6]).in_words == "sure CShape"
    assert once.recognize(demos[6]).in_words == "looks like CShape"
    assert once.recognize(demos[6]).confidence > LEAST_CONFIDENCE["sure"]
    answer = several.recognize(strange)
    assert answer.in_words == f"new, most like {answer.ranked[0]}"
    assert sum(answer.probabilities.values()) == pytest.approx(1.0)


def test_nothing_is_said_before_a_movement_begins():
    state = LiveState((), 1.0, None, 0.0, None, None, np.nan, 0, LiveStatus.TOO_SHORT)
    assert (state.certainty, state.in_words) == (None, "nothing yet")


def check_streams(recognizer, movements):
    """Finishing says what recognizing says, which is never less than was said while the movement was under way."""
    agree, live = [], recognizer.stream()
    # A movement under way is compared by kernels alone.
    shown, groups = recognizer.demonstrations_, recognizer._groups
    by_kernels = kineme.Recognizer(classifier="nearest-each").fit(shown, groups=groups).recognize(movements)
    for movement, answer, kernel_answer in zip(movements, recognizer.recognize(movements), by_kernels, strict=True):
        live.reset()
        parts = np.array_split(np.arange(len(movement)), 6)
        states = [live.update(movement.times[part], movement.positions[part]) for part in parts]
        finished = live.finish()
        for name in ("label", "certainty", "in_words", "rule", "ranked"):
            assert getattr(finished, name) == getattr(answer, name)
        assert finished.confidence == pytest.approx(answer.confidence, abs=1e-5)
        assert finished.probabilities == pytest.approx(answer.probabilities, abs=1e-5)
        words = {state.certainty for state in states} - {None}
        assert words <= {"looks like"}
        assert all("so far" in state.in_words for state in states[1:])
        assert all((state.certainty is None) == state.in_words.startswith("still open") for state in states[1:])
        if kernel_answer.label is not None:
            agree.append(states[-1].ranked[0].label == kernel_answer.label)
    assert np.mean(agree) >= 0.9  # of the last states: the evidence is not that of whole movements


def test_finishing_takes_nothing_back():
    demos = kineme.load_lasa()
    shapes = np.flatnonzero(np.arange(len(demos)) % 7 < 3)[: 3 * 8]
    for n_shown in (1, 3):
        recognizer = kineme.Recognizer().fit(demos[shapes[shapes % 7 < n_shown]])
        check_streams(recognizer, demos[np.arange(5, 7 * 12, 7)])  # the last four are of no known shape


@pytest.fixture(scope="module")
def strokes(development_data):
    data = load_data(str(development_data / "strokes2d.npz"))
    return data.demonstrations, np.asarray(data.demonstrations.labels), np.asarray(data.people)


def taught(strokes, n_shown, seed=0):
    """A recognizer of two thirds of the kinds by all but the last two people, and which movements are by those."""
    demos, labels, people = strokes
    rng = np.random.default_rng(seed)
    known = rng.permutation(np.unique(labels))[: 2 * len(np.unique(labels)) // 3]
    theirs = np.isin(people, np.unique(people)[-2:])
    shown = itertools.chain.from_iterable(
        rng.permutation(np.flatnonzero((labels == label) & ~theirs))[:n_shown] for label in known
    )
    chosen = np.array(list(shown))
    asked = rng.permutation(np.flatnonzero(theirs))
    return kineme.Recognizer().fit(demos[chosen], labels[chosen], groups=people[chosen]), known, asked


def test_finishing_takes_nothing_back_of_drawings_by_others(strokes):
    recognizer, _, asked = taught(strokes, 3)
    check_streams(recognizer, strokes[0][asked[:20]])


def test_what_is_sure_is_right(strokes):
    """By people who showed nothing; less often where a third of the movements are of no known kind."""
    every, of_known_kinds = ({word: [] for word in ("sure", "probably", "looks like", "new")} for _ in range(2))
    for seed in range(6):  # of three, too few are uncertain
        recognizer, known, asked = taught(strokes, 5, seed)
        for answer, label in zip(recognizer.recognize(strokes[0][asked[:200]]), strokes[1][asked[:200]], strict=True):
            every[answer.certainty].append(answer.label == label)
            if label in known:
                of_known_kinds[answer.certainty].append(answer.label == label)
    assert len(every["sure"]) > 400
    assert np.mean(of_known_kinds["sure"]) >= 0.99
    assert np.mean(every["sure"]) >= 0.93
    assert np.mean(every["sure"]) > np.mean(every["probably"]) > np.mean(every["looks like"])


def test_of_new_people_about_the_error_rate_is_unknown_where_groups_tell_people_apart(strokes):
    """What `Answer.promise` says of other people, on average over draws."""
    rejected, calibrated = [], []
    for seed in range(6):
        recognizer, known, asked = taught(strokes, 5, seed)
        members = asked[np.isin(strokes[1][asked], known)][:100]
        answers = recognizer.recognize(strokes[0][members])
        rejected.append(np.mean([one.label is None for one in answers]))
        calibrated += [one.calibrated for one in answers]
    assert all(calibrated)
    assert 0.005 <= np.mean(rejected) <= 0.1


def test_of_one_person_alone_movements_by_others_look_like_what_they_are(strokes):
    """Nothing promises this: the rule of what is rescued is "strangers", and of foreign movements most stay unknown."""
    demos, labels, people = strokes
    kinds = np.unique(labels)
    rescued, foreign = [], []
    for person in np.unique(people)[:3]:
        own, rng = people == person, np.random.default_rng(0)
        known = rng.permutation(kinds)[: len(kinds) // 2]
        shown = np.concatenate([np.flatnonzero(own & (labels == kind))[:4] for kind in known])
        recognizer = kineme.Recognizer().fit(demos[shown], labels[shown])
        theirs = rng.permutation(np.flatnonzero(~own))[:150]
        for answer, label in zip(recognizer.recognize(demos[theirs]), labels[theirs], strict=True):
            if label in known:
                rescued.append(answer.label == label)
            else:
                foreign.append(answer.label is None)
            assert answer.certainty == "looks like" or answer.rule != "strangers"
    assert np.mean(rescued) >= 0.78
    assert np.mean(foreign) >= 0.85

"""Movements under way, recognized by a library: as a recognizer does, in a large library by some of its movements."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from library_samples import draw_movements

from kineme import ActionLibrary, Recognizer, Trajectory
from kineme.errors import SpecificationError
from kineme.library.recognize import LibraryRecognizer


@pytest.fixture
def library(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(8, 2, 3), [f"kind {i // 2}" for i in range(8)])
        yield library


def _follow(stream, movement, step=5):
    states = [
        stream.update(movement.times[k : k + step], movement.positions[k : k + step])
        for k in range(0, len(movement.times), step)
    ]
    return states[-1]


def test_a_stream_says_what_that_of_a_recognizer_says(library):
    demos = library.movements()
    ours, theirs = library.stream(), Recognizer().fit(demos).stream()
    for movement in demos:
        ours.reset()
        theirs.reset()
        a, b = _follow(ours, movement), _follow(theirs, movement)
        assert [ranked_label.label for ranked_label in a.ranked] == [ranked_label.label for ranked_label in b.ranked]
        assert a.unknown == pytest.approx(b.unknown, abs=1e-4)
        assert a.label == b.label
    answer = ours.finish()
    assert (answer.label, answer.nearest[0].index) == ("kind 3", int(library.ids()[-1]))


def test_in_a_large_library_some_movements_of_each_symbol_are_compared_and_the_answer_is_that_of_all(library):
    recognizer = LibraryRecognizer(library.store, exhaustive=0)
    stream, movement = recognizer.stream(), library.movements()[4]
    assert _follow(stream, movement).ranked[0].label == "kind 2"
    assert stream.finish().nearest[0].index == int(library.ids()[4])


def test_a_stream_after_a_change_knows_the_new_symbol_and_the_one_before_does_not(library):
    before = library.stream()
    new = draw_movements(1, 2, 77)[0]
    library.learn([new], ["new"])
    _follow(before, new)
    assert before.finish().label != "new"
    after = library.stream()
    assert _follow(after, new).ranked[0].label == "new"
    assert after.finish().label == "new"


def test_streams_share_what_is_prepared(library):
    assert library.stream()._hypotheses is library.stream()._hypotheses


def test_threads_ask_while_the_library_changes(library):
    question = library.movements()[0]

    def ask(k):
        if k % 10 == 3:
            library.learn(
                [Trajectory(question.times, question.positions @ np.diag([1.0, 1.0 + k / 10]))], [f"more {k}"]
            )
        stream = library.stream()
        _follow(stream, question, 20)
        return library.recognize(question).nearest[0].similarity, stream.finish().nearest[0].similarity

    with ThreadPoolExecutor(6) as pool:
        assert np.array(list(pool.map(ask, range(30)))).min() > 0.99


def test_a_library_without_symbols_has_no_stream(tmp_path):
    with (
        ActionLibrary(tmp_path / "actions", create=True) as library,
        pytest.raises(SpecificationError, match="expected a library with movements that show a symbol"),
    ):
        library.stream()

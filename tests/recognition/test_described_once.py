"""A movement is described once for each question, smoothed and in detail, whatever is computed from that."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Recognizer, Trajectory
from kineme.anchoring.assignment import assign
from kineme.similarity import describe
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS
from movement_samples import draw_shapes

QUESTIONS = ["predict", "predict_proba", "decision_function", "p_values", "predict_known", "novelty", "describe"]


class _Counts:
    """Movements that were smoothed, smoothed in detail, and described."""

    def __init__(self, monkeypatch):
        self.smoothed = self.detailed = self.described = 0
        smooth, rows = describe.smooth_rows, describe._tile_rows

        def counted_smooth(demos, start, stop, cutoff, *rest):
            assert cutoff in (10.0, 40.0)
            self.smoothed += (stop - start) * (cutoff == 10.0)
            self.detailed += (stop - start) * (cutoff == 40.0)
            return smooth(demos, start, stop, cutoff, *rest)

        def counted_rows(demos, start, stop, *rest):
            self.described += stop - start
            return rows(demos, start, stop, *rest)

        monkeypatch.setattr(describe, "smooth_rows", counted_smooth)
        monkeypatch.setattr(describe, "_tile_rows", counted_rows)


@pytest.fixture(params=[[1] * 5, [3, 4], [9, 8, 10]])
def asked(request):
    """A recognizer by the nearest or by support vectors, which has its calibration, and movements."""
    recognizer = Recognizer().fit(draw_shapes(request.param))
    recognizer.calibration()
    return recognizer, draw_shapes([4] * len(request.param), seed=0, spread=0.2)


@pytest.mark.parametrize("question", QUESTIONS)
def test_one_description_answers_a_question(question, asked, monkeypatch):
    recognizer, movements = asked
    counts = _Counts(monkeypatch)
    getattr(recognizer, question)(movements)
    assert (counts.smoothed, counts.detailed, counts.described) == (len(movements),) * 3


def test_what_is_not_compared_in_detail_is_not_smoothed_in_detail(monkeypatch):
    shapes = draw_shapes([3, 4])
    weights = [1, 1, 1, 1, 1, 0, 0]
    for recognizer in (Recognizer(DEFAULT_REPRESENTATIONS[:5]), Recognizer(weights=weights)):
        recognizer.fit(shapes)
        counts = _Counts(monkeypatch)
        recognizer.predict(shapes)
        assert (counts.smoothed, counts.detailed) == (len(shapes), 0)


def test_an_answer_smooths_each_movement_once_and_again_with_each_example_for_all_transforms(asked, monkeypatch):
    """Most answers are not asked for the map from the nearest demonstration, which needs no details."""
    recognizer, movements = asked
    counts = _Counts(monkeypatch)
    answers = recognizer.recognize(movements)
    examples = {one.nearest[0].index for one in answers}
    assert (counts.smoothed, counts.detailed, counts.described) == (len(movements),) * 3
    assert len([one.transform for one in answers]) == len(movements)
    assert counts.described == len(movements)
    assert counts.smoothed == 2 * len(movements) + len(examples)
    assert counts.detailed == len(movements)


def test_movements_that_are_assigned_to_symbols_are_described_once(asked, monkeypatch):
    recognizer, movements = asked
    strange = draw_shapes([6], seed=9)
    both = [one.positions for one in (*movements, *strange)]
    counts = _Counts(monkeypatch)
    assign(both, recognizer)
    assert (counts.smoothed, counts.detailed, counts.described) == (len(both),) * 3


def test_a_candidate_in_a_recording_is_described_once(monkeypatch):
    demos = draw_shapes([3] * 3)
    recognizer = Recognizer().fit(demos)
    recognizer.calibration()
    asked = []
    from kineme.recognition import compared_windows, spotting

    def counting(inner):
        def counted(comparison, references, movements, *others):
            asked.append(len(movements))
            return inner(comparison, references, movements, *others)

        return counted

    for module, name in ((spotting, "score"), (compared_windows, "for_compared")):
        monkeypatch.setattr(module, name, counting(getattr(module, name)))
    counts = _Counts(monkeypatch)
    pieces = [demos[0].positions, np.repeat(demos[0].positions[-1:], 40, axis=0), demos[3].positions]
    positions = np.concatenate(pieces)
    recognizer.spot(Trajectory(np.linspace(0.0, 3.0, len(positions)), positions))
    assert asked
    assert (counts.smoothed, counts.detailed, counts.described) == (sum(asked),) * 3

"""An answer as a table of pandas, as a picture, and as a notebook shows it."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from movement_samples import draw_shapes

DEMOS = draw_shapes([2] * 3, 2, 0)
BOLD = kineme.Demonstrations.from_arrays(
    [one.positions for one in DEMOS], [f"<b>{label}</b>" for label in DEMOS.labels]
)
RECOGNIZER = kineme.Recognizer().fit(DEMOS)


def test_answers_join_to_a_table():
    pandas = pytest.importorskip("pandas")
    answers = RECOGNIZER.recognize(DEMOS)
    table = pandas.concat([one.to_pandas() for one in answers], ignore_index=True)
    assert table["label"].tolist() == [one.label for one in answers] == DEMOS.labels.tolist()
    assert table["nearest"].tolist() == list(range(6))
    np.testing.assert_array_equal(table["confidence"], [one.confidence for one in answers])
    assert table["certainty"].tolist() == [one.certainty for one in answers]


def test_a_notebook_shows_the_classes_and_runs_nothing():
    answer = kineme.Recognizer().fit(BOLD).recognize(BOLD[0])
    shown = answer._repr_html_()
    assert "<b>" not in shown
    assert shown.count("&lt;b&gt;") == 1 + 3  # in the caption, and each class
    assert answer.promise.replace("'", "&#x27;") in shown


def test_a_picture_lays_the_nearest_example_over_the_movement():
    moved = kineme.Trajectory(2.0 * DEMOS[3].times + 5, 3.0 * DEMOS[3].positions + 7)
    answer = RECOGNIZER.recognize(moved)
    assert len(answer.plot().axes) == 2
    figure = answer.plot(moved, RECOGNIZER.demonstrations_)
    lines = [line.get_xydata() for axes in figure.axes for line in axes.lines if len(line.get_xdata()) == len(moved)]
    assert len(lines) == 2 * 3  # the path, and two dimensions over time
    for first, second in zip(lines[::2], lines[1::2], strict=True):
        np.testing.assert_allclose(second, first, atol=1e-3)


def test_a_picture_with_other_demonstrations_is_refused():
    answer = RECOGNIZER.recognize(DEMOS[0])
    for wrong in (DEMOS[2:], draw_shapes([2] * 3, 3, 0), DEMOS[:0:-1]):
        with pytest.raises(kineme.errors.SpecificationError, match="expected"):
            answer.plot(DEMOS[0], wrong)
    with pytest.raises(kineme.errors.SpecificationError, match="got one of them"):
        answer.plot(DEMOS[0])
    with pytest.raises(kineme.errors.SpecificationError, match="expected one movement"):
        answer.plot(DEMOS, DEMOS)

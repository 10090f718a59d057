"""Which classes are taken for which by recognizers that have not seen a movement, and how two movements differ."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from sklearn.metrics import confusion_matrix

import kineme
from kineme.errors import SpecificationError
from kineme.recognition import Confusion, compare, confusion
from movement_samples import draw_shapes

LETTERS = kineme.load_lasa(["CShape", "GShape", "Sine"])
PEOPLE = np.arange(len(LETTERS)) % 7


def test_every_movement_is_recognized_by_who_has_not_seen_it(monkeypatch):
    """All movements of a person are left out at once, and each movement is asked for once."""
    seen, asked = [], []
    fit, predict = kineme.Recognizer.fit, kineme.Recognizer.predict

    def hear_fit(self, X, y=None, groups=None):
        seen.append({movement.name for movement in X})
        return fit(self, X, y, groups)

    def hear_predict(self, X):
        asked.append({movement.name for movement in X})
        return predict(self, X)

    monkeypatch.setattr(kineme.Recognizer, "fit", hear_fit)
    monkeypatch.setattr(kineme.Recognizer, "predict", hear_predict)
    result = confusion(LETTERS, groups=PEOPLE)
    assert len(asked) == 7
    assert all(not known & new and len(known | new) == 21 for known, new in zip(seen, asked, strict=True))
    assert result.counts.tolist() == [[7, 0, 0, 0], [0, 7, 0, 0], [0, 0, 7, 0]]
    assert (result.accuracy, result.mistakes) == (1.0, [])
    seen.clear()
    confusion(LETTERS, groups=PEOPLE, folds=3)
    assert len(seen) == 3
    seen.clear()
    confusion(LETTERS)
    assert len(seen) == 5


def test_counts_are_those_of_scikit_learn():
    """Letters that are halves of each other, drawn badly."""
    rng = np.random.default_rng(1)
    demos = draw_shapes([6] * 4, 2, 0)
    noisy = kineme.Demonstrations.from_arrays(
        [movement.positions + 0.6 * np.cumsum(rng.normal(size=movement.positions.shape), 0) for movement in demos],
        demos.labels,
    )
    groups = np.arange(len(noisy)) % 6
    result = confusion(noisy, groups=groups, recognizer=kineme.Recognizer(classifier="nearest"))
    answers = np.empty(len(noisy), dtype=object)
    for group in range(6):
        known = groups != group
        recognizer = kineme.Recognizer(classifier="nearest").fit(noisy[known])
        answers[~known] = recognizer.predict(noisy[~known])
    expected = confusion_matrix(
        list(map(str, noisy.labels)), list(map(str, answers)), labels=list(map(str, result.labels))
    )
    np.testing.assert_array_equal(result.counts[:, :-1], expected)
    assert 0.0 < result.accuracy < 1.0
    assert sum(number for *_, number in result.mistakes) == len(noisy) - expected.trace()


def test_what_is_called_new_has_its_own_column():
    result = confusion(LETTERS, groups=PEOPLE, error_rate=0.3)
    assert result.counts[:, -1].sum() > 0
    assert result.counts.sum() == 21
    assert any(answer is None for _, answer, _ in result.mistakes)
    assert "is called new" in result.in_words


def test_a_confusion_says_shows_and_draws_its_numbers():
    result = Confusion(("a", "<b>", "$c"), np.array([[3, 1, 0, 0], [2, 8, 0, 0], [0, 0, 5, 1]]))
    assert result.accuracy == 16 / 20
    assert result.mistakes == [("<b>", "a", 2), ("a", "<b>", 1), ("$c", None, 1)]
    assert result.in_words == "16 of 20 movements right (80.0 %); most often <b> is taken for a: 2 of 10"
    shown = result._repr_html_()
    assert "data:image/svg+xml;base64," in shown
    assert "<b>" not in shown
    axes = plt.figure().subplots()
    assert result.plot(axes) is axes
    assert {text.get_text() for text in axes.texts} == {"3", "1", "2", "8", "5"}
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["a", "<b>", r"\$c", "new"]
    shares = np.asarray(axes.images[0].get_array())
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    np.testing.assert_allclose(shares[1], [0.2, 0.8, 0, 0])
    plt.close("all")
    table = pytest.importorskip("pandas") and result.to_pandas()
    assert table.loc["<b>"].tolist() == [2, 8, 0, 0]


def test_of_many_classes_those_with_mistakes_are_drawn():
    counts = np.hstack((10 * np.eye(60, dtype=int), np.zeros((60, 1), dtype=int)))
    counts[58, 59] = 3
    figure = Confusion(tuple(f"c{k}" for k in range(60)), counts).plot()
    names = [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
    assert len(names) == 40
    assert {"c58", "c59"} <= set(names)
    assert "40 of 60 classes" in figure.axes[0].get_title()


def test_what_cannot_be_left_out_is_refused():
    with pytest.raises(SpecificationError, match="got a class of one movement"):
        confusion(LETTERS[:8])
    with pytest.raises(SpecificationError, match="got one group"):
        confusion(LETTERS, groups=np.zeros(21, int))
    with pytest.raises(SpecificationError, match="folds"):
        confusion(LETTERS, folds=1)


def test_a_class_that_none_could_recognize_is_refused():
    """Of which no movement is left to learn from, when a person, or the persons of a fold, are left out."""
    classes = np.unique(LETTERS.labels, return_inverse=True)[1]
    with pytest.raises(SpecificationError, match=r"all groups of a class left out: CShape, GShape, .*; leave"):
        confusion(LETTERS, groups=classes)
    people = np.where(classes == 0, 0, np.arange(21) % 3)
    with pytest.raises(SpecificationError, match="left out: CShape;"):
        confusion(LETTERS, groups=people)
    together = np.array([0, 3])[np.arange(7) % 2].tolist() + [*[1] * 6, 0] * 2
    with pytest.raises(SpecificationError, match=r"left out: CShape; .*without folds="):
        confusion(LETTERS, groups=together, folds=2)


def test_a_data_frame_has_every_class_whatever_it_is_called():
    pytest.importorskip("pandas")
    frame = Confusion(("class", "new"), np.array([[1, 2, 3], [4, 5, 6]])).to_pandas()
    assert (list(frame.index), list(frame.columns)) == (["class", "new"], ["class", "new", "new"])
    assert frame.to_numpy().tolist() == [[1, 2, 3], [4, 5, 6]]


def test_two_movements_are_laid_over_each_other():
    """The other one moved, turned by 20 degrees and half as large, in twice the time, is the same."""
    movement, angle = LETTERS[8], np.radians(20)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    other = kineme.Trajectory(2 * movement.times, 0.5 * movement.positions @ turn.T + 7, "G", "turned")
    explanation = compare(movement, other)
    assert explanation.nearest.differences.max() < 0.06  # a prior on rotations leaves some
    assert explanation.in_words.startswith(f"{movement.name} beside turned (")
    assert "times as large, turned by -" in explanation.answer
    assert "2 times as fast" in explanation.answer
    np.testing.assert_allclose(explanation.path[0], movement.positions[0], atol=1)
    far = compare(movement, LETTERS[0])
    assert far.nearest.similarity < 0.5 < explanation.nearest.similarity
    assert far.nearest.differences.max() > 0.5
    exact = compare(movement, other, kineme.Recognizer(max_angle=np.pi))
    assert exact.nearest.differences.max() < 1e-3
    titles = [axes.get_title() for axes in far.plot().axes]
    assert titles[0].startswith(f"{LETTERS[0].name}, ")  # no rank


@pytest.mark.parametrize(
    ("factor", "pace", "parameters", "words"),
    [
        ([3, 1], 1, {"scale": "per-dimension", "max_angle": 0}, "2.99 by 1 times as large, 1 times as fast"),
        ([1, 3], 1, {"scale": "per-dimension", "max_angle": 0}, "1 by 3 times as large, 1 times as fast"),
        (1000, 0.001, {}, "1,000 times as large, 0.001 times as fast"),
        (3, 1, {"scale": "none"}, "1 times as fast"),
        (3, 1, {"classifier": "svm"}, "3 times as large, 1 times as fast"),
    ],
)
def test_sizes_and_tempos_are_those_of_the_movements(factor, pace, parameters, words):
    movement = LETTERS[0]
    other = kineme.Trajectory(movement.times / pace, movement.positions * factor, name="sized")
    assert compare(other, movement, kineme.Recognizer(**parameters)).answer.endswith(f"({words})")


def test_movements_without_names_are_first_and_second():
    u = np.linspace(0, 1, 50)
    assert compare(np.sin(6 * u), np.sin(5 * u)).in_words.startswith("first beside second (")
    assert compare(kineme.Trajectory(u, np.sin(6 * u), 0), np.sin(5 * u)).in_words.startswith("0 beside second")
    with pytest.raises(SpecificationError, match="expected one movement and another"):
        compare(LETTERS, LETTERS[0])

"""One demonstration of each class gives p-values that are a guess; answers, the shell and the docs say so."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import kineme
from kineme import Recognizer
from kineme.recognition.answer import Answer
from kineme.recognition.conformal import Calibration
from movement_samples import draw_shapes

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def fitted():
    """A recognizer for each number of demonstrations per class, and a movement to ask."""
    made = {}
    for counts in ((1,) * 12, (2,) * 12, (25, 25), (25, 1), (2, 2)):
        demos = draw_shapes(counts, seed=3)
        made[counts] = Recognizer(classifier="nearest").fit(demos), demos[0]
    return made


@pytest.mark.parametrize(
    ("counts", "rate", "expected"),
    [
        ((1,) * 12, 0.05, [False] * 12),  # no distance within a class is known
        ((1,) * 12, 0.5, [False] * 12),
        ((2,) * 12, 0.05, [True] * 12),  # 24 left-out scores of all classes
        ((2,) * 12, 0.03, [False] * 12),  # 24 cannot tell 3 %
        ((25, 25), 0.04, [True, True]),  # each class speaks for itself
        ((25, 1), 0.05, [True, True]),  # the class shown once is judged by the others
        ((2, 2), 0.2, [True, True]),
        ((2, 2), 0.19, [False, False]),
    ],
)
def test_calibrated_where_enough_left_out_scores_tell_the_error_rate(fitted, counts, rate, expected):
    recognizer, asked = fitted[counts]
    calibration = recognizer.calibration()
    assert calibration.calibrated(rate).tolist() == expected
    assert recognizer.recognize(asked, rate).calibrated is all(expected)
    # What is called calibrated is counted, so it is a multiple of 1 / (scores + 1); what is not follows a smooth law.
    far = -0.5 * (100 * np.arange(1, 4)[:, None] * np.ones(len(counts))) ** 2
    smallest = calibration.p_values(far, rate)[-1]
    assert ((smallest > 1e-6) == expected).all()


def test_an_answer_is_calibrated_only_if_every_class_is():
    scores = np.linspace(0.5, 2, 30)
    some = (scores, np.empty(0))
    mixed = Calibration(np.ones(2), some, some, some, some)
    assert mixed.calibrated(0.05).tolist() == [True, False]


@pytest.mark.parametrize("n_dims", [1, 2, 6])
def test_one_movement_shown_under_two_names_leaves_the_answers_in_numbers(n_dims):
    """Copies are at no distance from each other, which tells nothing about how far movements of a class are apart."""
    demos = draw_shapes((1, 1), n_dims, seed=3)
    movements = [demos[0].positions, demos[0].positions, demos[1].positions]
    answers = Recognizer().fit(movements, ["a", "the same", "another"]).recognize(movements)
    assert [answer.label for answer in answers] == ["a", "a", "another"]
    for answer in answers:
        np.testing.assert_allclose(sum(answer.probabilities.values()), 1.0)
        assert answer.p_known == 1.0
        assert np.isfinite([answer.confidence, *answer.p_values.values()]).all()


def test_a_guess_shows_in_what_is_printed(fitted):
    once, asked = fitted[(1,) * 12]
    assert "calibrated=False" in repr(once.recognize(asked))
    many, asked = fitted[25, 25]
    assert "calibrated=True" in repr(many.recognize(asked))


@pytest.mark.parametrize(
    "documented", [Answer, Calibration, Recognizer.recognize, Recognizer.p_values, kineme.ActionLibrary.recognize]
)
def test_whoever_gives_p_values_says_that_one_demonstration_gives_a_guess(documented):
    assert "guess" in documented.__doc__
    assert "one demonstration" in " ".join(documented.__doc__.split())


def test_one_demonstration_does_not_keep_the_error_rate_and_five_do(one_shot):
    alike, different = (np.mean([one_shot.made_up(spread, 1, seed) for seed in range(3)]) for spread in (0.1, 0.5))
    assert alike < 0.01
    assert different > 0.5
    assert np.mean([one_shot.made_up(0.5, 5, seed) for seed in range(3)]) <= 0.05


def test_the_page_shows_what_was_measured(one_shot):
    """docs/guide/unknown-movements.md against the results of one_shot, and one number of that measured again."""
    rows = json.loads((ROOT / "experiments" / "results" / "one_shot.json").read_text())["rows"]
    measured = {row["what"]: row["ours"] for row in rows}
    page = (ROOT / "docs" / "guide" / "unknown-movements.md").read_text(encoding="utf-8")
    for n_shown, words in ((1, "one"), (5, "five")):
        values = [
            f"{measured[f'shapes that differ by {spread:.0%}, {n_shown} shown']:.1f} %" for spread in one_shot.SPREADS
        ]
        assert f"| {words} of each | {' | '.join(values)} |" in page
    assert f"| shapes differ by | {' | '.join(f'{100 * spread:.0f} %' for spread in one_shot.SPREADS)} |" in page
    lasa = [f"{measured[f'LASA {name}, 1 shown']:.0f} %" for name in one_shot.LASA]
    said = re.search(r"LASA, one of each: (\S+ %) as recorded, (\S+ %) .* weakly, (\S+ %) moderately, (\S+ %) strongly",
                     " ".join(page.split()))  # fmt: skip
    assert list(said.groups()) == lasa
    again = [100 * one_shot.made_up(0.2, 1, seed) for seed in range(10)]
    assert np.mean(again) == pytest.approx(measured["shapes that differ by 20%, 1 shown"], abs=1.0)


@pytest.fixture(scope="module")
def one_shot():
    import bench.one_shot

    return bench.one_shot

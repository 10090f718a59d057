"""How often answers are right, by the word that says how sure they are, and what becomes of movements by strangers.

Of LASA's shapes, and of recordings of people, see `bench.open_set`: a third of the kinds are unknown, a third of the
people showed nothing. The letters of LASA's names by another hand, and others, are asked of all of LASA's movements.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.by_person import FOLDER
from bench.people import Recorded, recorded
from bench.rows import Row

SHOWN = (1, 3, 5)
DRAWS = 3
N_ASKED = 240
WORDS = ("sure", "probably", "looks like", "new")
#: Letter -> the shape of LASA that has its name.
NAMES = {letter: f"{letter}Shape" for letter in "CGJLNPRW"} | {"S": "Sshape", "Z": "Zshape"}
#: Letters that LASA's shapes Angle and Line may be taken for.
ALIKE = ("V", "I")


class Answered(NamedTuple):
    """An answer, what is right, and whether that is of a known kind."""

    answer: kineme.recognition.Answer
    label: str
    is_known: bool


def measure(quick: bool) -> list[Row]:
    """Shares of right answers by word, and of strangers' movements called unknown."""
    files = sorted(FOLDER.glob("*.npz")) if FOLDER.is_dir() else []
    rows = []
    for file in files[:1] if quick else files:
        answered = list(_answered(file.stem, 1 if quick else DRAWS))
        for word in WORDS:
            rows += _rows(file.stem, word, [one for one in answered if one.answer.certainty == word])
    letters = recorded("letters2d.npz")
    return rows if letters is None else rows + _strangers(letters)


def _answered(name: str, draws: int) -> Iterator[Answered]:
    data = recorded(f"{name}.npz")
    assert data is not None
    demos, labels = data.demos, data.labels
    people = data.people if len(np.unique(data.people)) > 1 else None
    for n_shown in SHOWN:
        for draw in range(draws):
            rng = np.random.default_rng([draw, n_shown])
            kinds = rng.permutation(np.unique(labels))
            known = kinds[: max(2, 2 * len(kinds) // 3)]
            is_asked = _new_people(people, len(demos), rng)
            shown = _shown(labels, is_asked, known, n_shown, rng)
            asked = rng.permutation(np.flatnonzero(is_asked))[:N_ASKED]
            for grouped in (False, True) if people is not None and n_shown > 1 else (False,):
                groups = people[shown] if grouped and people is not None else None
                recognizer = kineme.Recognizer().fit(demos[shown], labels[shown], groups=groups)
                for k, answer in zip(asked, recognizer.recognize(demos[asked]), strict=True):
                    yield Answered(answer, labels[k], labels[k] in known)


def _new_people(people: NDArray[Any] | None, n: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Whether each movement is by one of the third of the people who show nothing; of one person, four in ten."""
    if people is None:
        return rng.random(n) < 0.4
    everyone = np.unique(people)
    return np.isin(people, rng.choice(everyone, max(1, len(everyone) // 3), replace=False))


def _shown(
    labels: NDArray[np.str_],
    is_asked: NDArray[np.bool_],
    known: NDArray[np.str_],
    n_shown: int,
    rng: np.random.Generator,
) -> NDArray[np.intp]:
    chosen = [rng.permutation(np.flatnonzero((labels == kind) & ~is_asked))[:n_shown] for kind in known]
    return np.asarray(np.concatenate(chosen), dtype=np.intp)


def _rows(name: str, word: str, answered: list[Answered]) -> list[Row]:
    if not answered:
        return []
    if word == "new":
        foreign = 100 * float(np.mean([not one.is_known for one in answered]))
        return [Row(f"{name}, new: of no known kind", "%", foreign, details={"n": len(answered)})]
    right = [one.answer.label == one.label for one in answered]
    known = [one.answer.label == one.label for one in answered if one.is_known]
    details = {"n": len(answered), "right_of_known_kinds": float(np.mean(known)) if known else None}
    return [Row(f"{name}, {word}: right", "%", 100 * float(np.mean(right)), details=details)]


def _strangers(letters: Recorded) -> list[Row]:
    """Letters by one hand, asked of the shapes that another hand drew."""
    same = np.flatnonzero(np.isin(letters.labels, list(NAMES)))
    foreign = np.flatnonzero(~np.isin(letters.labels, [*NAMES, *ALIKE]))
    recognizer = kineme.Recognizer().fit(kineme.load_lasa())
    unknown = [
        100 * float(np.mean([one is None for one in recognizer.predict_known(letters.demos[which])]))
        for which in (same, foreign)
    ]
    return [
        Row("letters of LASA's names by another hand: called unknown", "%", unknown[0], details={"n": len(same)}),
        Row("letters that LASA does not have: unknown rejected", "%", unknown[1], details={"n": len(foreign)}),
    ]

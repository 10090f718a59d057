"""Movements of strangers: templates by other people only, every set of the folder beside the best of four rivals.

The sets are those of `bench.people`, LASA strongly perturbed, one coordinate of four of them as a signal, and two hands
made of pairs of digits, turned about the vertical by up to 60 degrees. Rows give our accuracy, the best rival's on the
same draws, and the mean difference with its standard error over draws and people. MiniRocket takes part from ten
demonstrations on, where aeon is installed. Seeds are others than those that chose the defaults.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import kineme
from bench.people import Recorded, handwriting, recorded
from bench.rows import Row
from kineme_experiments.evaluation.conditions import TOGETHER
from kineme_experiments.evaluation.methods import METHODS, Options

SHOTS, SEED, DRAWS = (1, 2, 4, 10), 2026, 30
RIVALS = ("dtw", "euclidean", "plus-cloud")
MANY, RIVAL_OF_MANY = 10, "minirocket"
FILES = {
    "words": "words2d.npz", "signs": "signs2d.npz", "multistrokes": "multistrokes2d.npz", "strokes": "strokes2d.npz",
    "exercises": "exercises6d.npz", "letters": "letters2d.npz",
}  # fmt: skip
SIGNALS = {"words": 1, "letters": 0, "digits": 1, "exercises": 0}  # set -> coordinate


def measure(quick: bool) -> list[Row]:
    draws = 5 if quick else DRAWS
    rows: list[Row] = []
    for name, movements in _sets():
        for shots in SHOTS:
            if (row := _row(name, movements, shots, draws)) is not None:
                rows.append(row)
    if rows:
        leads = [row.ours - (row.peer or 0.0) for row in rows]
        rows.append(Row("mean lead over the best rival", "accuracy", float(np.mean(leads)), target=(">=", 0.03)))
    return rows


def _sets() -> Iterator[tuple[str, Recorded]]:
    sets = {name: found for name, file in FILES.items() if (found := recorded(file)) is not None}
    if (gestures := recorded("gestures3d.npz")) is not None:
        digits = np.char.isdigit(gestures.labels)
        sets |= {"digits": gestures.take(digits), "solids": gestures.take(~digits)}
    yield from sets.items()
    lasa = handwriting()
    yield "LASA, strongly perturbed", lasa._replace(demos=TOGETHER[2].apply(lasa.demos, [SEED, 0]))
    for name, k in SIGNALS.items():
        if name in sets:
            yield f"{name}, coordinate {k + 1}", _coordinate(sets[name], k)
    if gestures is not None:
        yield "two hands, turned", two_hands(sets["digits"])


def _coordinate(movements: Recorded, k: int) -> Recorded:
    arrays = [demo.positions[:, k : k + 1] for demo in movements.demos]
    times = [demo.times for demo in movements.demos]
    return movements._replace(demos=kineme.Demonstrations.from_arrays(arrays, movements.labels, times))


def two_hands(digits: Recorded, each: int = 6) -> Recorded:
    """A digit with each hand at once, ten kinds of pairs, by each person; turned about the vertical."""
    rng, kinds, u = np.random.default_rng(SEED), np.unique(digits.labels), np.linspace(0, 1, 80)
    arrays, labels, people = [], [], []
    for person in np.unique(digits.people):
        for k, kind in enumerate(kinds):
            for _ in range(each):
                pair = [
                    digits.demos[int(rng.choice(np.flatnonzero((digits.people == person) & (digits.labels == of))))]
                    for of in (kind, kinds[(3 * k + 1) % len(kinds)])
                ]
                shares = [(hand.times - hand.times[0]) / np.ptp(hand.times) for hand in pair]
                hands = [
                    np.stack([np.interp(u, share, x) for x in hand.positions.T], axis=1)
                    for share, hand in zip(shares, pair, strict=True)
                ]
                turn = Rotation.from_rotvec([0, rng.uniform(-np.pi / 3, np.pi / 3), 0]).as_matrix()
                shift = np.array([0.4, 0.0, 0.0])
                arrays.append(np.hstack([(x + h * shift) @ turn.T for h, x in enumerate(hands)]))
                labels.append(kind)
                people.append(person)
    demos = kineme.Demonstrations.from_arrays(arrays, labels, [2.0 * u] * len(arrays))
    return Recorded(demos, np.array(labels), np.array(people))


def splits(movements: Recorded, shots: int, draws: int) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Train and test: `shots` of each label by the others, if people are known, else drawn at random."""
    people = np.unique(movements.people)
    for draw in range(draws):
        rng = np.random.default_rng([SEED, shots, draw])
        person = people[draw % len(people)]
        own = movements.people == person if len(people) > 1 else np.zeros(len(movements.labels), bool)
        train = np.concatenate(
            [
                rng.permutation(np.flatnonzero(~own & (movements.labels == label)))[:shots]
                for label in np.unique(movements.labels)
            ]
        )
        test = np.flatnonzero(own) if len(people) > 1 else np.setdiff1d(np.arange(len(own)), train)
        yield np.sort(train), test


def _row(name: str, movements: Recorded, shots: int, draws: int) -> Row | None:
    fewest = min(np.unique(movements.labels, return_counts=True)[1])
    if shots >= fewest:
        return None
    rivals = [key for key in (*RIVALS, *((RIVAL_OF_MANY,) if shots >= MANY else ())) if not METHODS[key].unavailable()]
    ours, theirs = [], {key: [] for key in rivals}
    points = {"points": 2} if name.startswith("two hands") else {}
    for train, test in splits(movements, shots, draws):
        shown, asked, truth = movements.demos[train], movements.demos[test], movements.labels[test]
        if not len(test):
            continue
        recognizer = kineme.Recognizer(**points).fit(shown, movements.labels[train])
        ours.append(float((recognizer.predict(asked) == truth).mean()))
        for key in rivals:
            contender = METHODS[key].contender(Options(seed=SEED))
            contender.fit(shown)
            theirs[key].append(float((contender.classify(asked)[0] == truth).mean()))
    best = max(rivals, key=lambda key: np.mean(theirs[key]))
    leads = np.array(ours) - np.array(theirs[best])
    error = float(leads.std(ddof=1) / np.sqrt(len(leads)))
    details = {
        "lead": float(leads.mean()),
        "standard_error": error,
        "rivals": {key: float(np.mean(values)) for key, values in theirs.items()},
    }
    title = METHODS[best].title
    return Row(f"{name}, {shots} by others", "accuracy", float(np.mean(ours)), float(np.mean(theirs[best])), title,
               details=details)  # fmt: skip

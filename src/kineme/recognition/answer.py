"""The full answer to a movement: what it is, how sure, like which demonstration, and how it maps onto it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.similarity import LOG_MEANS, SHARES
from kineme.kernels.procrustes import Prepared
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.classifiers import Nearest
from kineme.recognition.conformal import check_error_rate
from kineme.recognition.transform import Transform, map_onto
from kineme.validation import Array

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_SHOWN = 3  # demonstrations named in an answer


@dataclass(frozen=True)
class Neighbor:
    """A demonstration like the movement; `index` is its place in the recognizer's `demonstrations_`."""

    index: int
    name: str | None
    similarity: float


@dataclass(frozen=True, eq=False)
class Answer:
    """What a recognizer says about one movement.

    Attributes
    ----------
    label : label or None
        The best-ranked class whose p-value is above the error rate; None if there is none: unknown.
    confidence : float
        1 minus the largest p-value of what was not answered: of the other classes, or, if unknown, of all
        (Vovk et al. 2005, section 3.4).
    p_values : mapping from label to float
        How many members of the class would look as strange or stranger; see `Calibration`.
    calibrated : bool
        Whether enough demonstrations were left out and scored, for every class compared with, that the error rate is
        kept. If not, as with one demonstration of each class, p-values and confidence are a guess.
    ranked : tuple of labels
        Best first, in the order of the classifier.
    nearest : tuple of Neighbor
        Up to three demonstrations of the answered class, or, if unknown, of the best-ranked one; nearest first.
    transform : Transform
        Maps the first of them onto the movement.
    responsibilities : mapping from str to float
        Share of each representation in the similarity to the first of them; they sum to 1.
    """

    label: Any
    confidence: float
    p_values: Mapping[Any, float]
    calibrated: bool
    ranked: tuple[Any, ...]
    nearest: tuple[Neighbor, ...]
    transform: Transform
    responsibilities: Mapping[str, float]

    def __repr__(self) -> str:
        sure = f"confidence={self.confidence:.3g}, calibrated={self.calibrated}"
        return f"Answer(label={self.label!r}, {sure}, like={self.nearest[0]})"


def is_one(X: Any) -> bool:
    """Whether this is one movement: a `Trajectory`, or an array of shape (T,) or (T, d)."""
    from kineme.movements.trajectories.trajectory import Trajectory

    return isinstance(X, Trajectory) or (isinstance(X, np.ndarray) and X.dtype != object and X.ndim <= 2)


def answers(recognizer: Recognizer, X: Any, error_rate: float) -> list[Answer]:
    """An answer for each movement."""
    check_error_rate(error_rate)
    demos = Demonstrations.of(X)
    seen = recognizer.look_at(demos)
    found: list[Answer] = []
    for tile in recognizer._tiles(seen):
        n = len(tile[0].rows)
        found += answers_to(recognizer, demos[len(found) : len(found) + n], tile, error_rate)
    return found


def known_labels(classes: NDArray[Any], scores: Array, p_values: Array, error_rate: float) -> NDArray[np.object_]:
    """The best class of each row with a p-value above the error rate, None where there is none."""
    possible = p_values > error_rate
    labels = classes.astype(object)[np.where(possible, scores, -np.inf).argmax(axis=1)]
    labels[~possible.any(axis=1)] = None
    return np.asarray(labels)


def answers_to(
    recognizer: Recognizer, demos: Demonstrations, seen: tuple[Prepared, ...], error_rate: float
) -> list[Answer]:
    """An answer for each movement of a tile that the recognizer has looked at."""
    by_look = recognizer.similarity_.logs(seen, recognizer.views_)  # (R, n, m)
    logs = LOG_MEANS[recognizer.mean](by_look)
    nearest = np.maximum.reduceat(logs, recognizer.first_, axis=1)
    classifier = recognizer.classifier_
    scores = nearest if isinstance(classifier, Nearest) else classifier.scores(recognizer, seen)
    calibration = recognizer.calibration()
    p, calibrated = calibration.p_values(nearest, error_rate), bool(calibration.calibrated(error_rate).all())
    labels = known_labels(recognizer.classes_, scores, p, error_rate)
    classes = recognizer.classes_.tolist()
    ranks = np.argsort(-scores, axis=1, kind="stable")
    place = {label: c for c, label in enumerate(classes)}
    shown = np.array([ranks[i, 0] if label is None else place[label] for i, label in enumerate(labels)])
    like = [_nearest(recognizer, logs[i], int(c)) for i, c in enumerate(shown)]
    example = np.array([near[0].index for near in like], dtype=np.intp)
    share = SHARES[recognizer.mean](by_look[:, np.arange(len(demos)), example])
    transforms = map_onto(recognizer, example, demos, share)
    names = [one.name for one in recognizer.looks()]
    others = p.copy()
    known = np.array([label is not None for label in labels])
    others[known, shown[known]] = 0.0
    return [
        Answer(
            labels[i],
            1.0 - float(others[i].max()),
            dict(zip(classes, p[i].tolist(), strict=True)),
            calibrated,
            tuple(classes[c] for c in ranks[i]),
            like[i],
            transforms[i],
            dict(zip(names, share[:, i].tolist(), strict=True)),
        )
        for i in range(len(demos))
    ]


def _nearest(recognizer: Recognizer, logs: Array, c: int) -> tuple[Neighbor, ...]:
    """The nearest demonstrations of one class."""
    stop = [*recognizer.first_[1:], len(recognizer.labels_)][c]
    rows = np.arange(recognizer.first_[c], stop)
    best = rows[np.argsort(-logs[rows], kind="stable")[:_SHOWN]]
    names = recognizer.demonstrations_.names
    return tuple(Neighbor(int(i), names[i] if names else None, float(np.exp(logs[i]))) for i in best)

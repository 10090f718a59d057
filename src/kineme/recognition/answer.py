"""The answer to a movement: label, confidence, nearest demonstrations, and the map from the nearest one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.comparison import Comparison
from kineme.comparison.describe import Tile, recorded_paths
from kineme.comparison.references import IndexedMovements, References
from kineme.comparison.scores import Compared, for_compared
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.classifiers import Classifier
from kineme.recognition.conformal import Calibration
from kineme.recognition.transform import Transform, map_onto
from kineme.validation import Array

_SHOWN = 3  # demonstrations named in an answer


@dataclass(frozen=True)
class Neighbor:
    """A stored demonstration that is similar to the movement.

    Attributes
    ----------
    index : int
        Its position in the recognizer's `demonstrations_`; in a library, its id.
    name : str or None
        Where it comes from.
    similarity : float
        The averaged kernel K between the two, from 0 to 1.
    """

    index: int
    name: str | None
    similarity: float


@dataclass(frozen=True, eq=False)
class Answer:
    """The answer of a recognizer to one movement.

    Attributes
    ----------
    label : label or None
        The best-ranked class whose p-value is above the error rate; None if there is none: unknown.
    confidence : float
        1 minus the largest p-value of what was not answered: of the other classes, or, if unknown, of all (Vovk et al.
        2005, section 3.4). At 0.95 no other answer has a p-value above 0.05; it is low where another class fits the
        movement too.
    p_values : mapping from label to float
        Share of the members of the class that would be as far from their nearest demonstration, or farther; see
        `Calibration`.
    calibrated : bool
        Whether there are enough demonstrations for every class that the error rate is kept, see `Calibration`. If not,
        as with one demonstration of each class, p-values and confidence are a guess.
    ranked : tuple of labels
        Best first, in the order of the classifier.
    nearest : tuple of Neighbor
        Up to three demonstrations of the answered class, or, if unknown, of the best-ranked one; nearest first.
    transform : Transform
        Maps the first of them onto the movement.
    responsibilities : mapping from str to float
        Share of each representation in the similarity to the first of them; they sum to 1.
    """

    label: Label | None
    confidence: float
    p_values: Mapping[Label, float]
    calibrated: bool
    ranked: tuple[Label, ...]
    nearest: tuple[Neighbor, ...]
    transform: Transform
    responsibilities: Mapping[str, float]

    def __repr__(self) -> str:
        sure = f"confidence={self.confidence:.3g}, calibrated={self.calibrated}"
        return f"Answer(label={self.label!r}, {sure}, nearest={self.nearest[0]})"


def is_one(X: MovementsLike) -> bool:
    """Whether this is one movement: a `Trajectory`, or an array of shape (T,) or (T, d)."""
    return isinstance(X, Trajectory) or (isinstance(X, np.ndarray) and X.dtype != object and X.ndim <= 2)


def known_labels(classes: NDArray[Any], scores: Array, p_values: Array, error_rate: float) -> NDArray[np.object_]:
    """The best class of each row with a p-value above the error rate, None where there is none."""
    possible = p_values > error_rate
    labels = classes.astype(object)[np.where(possible, scores, -np.inf).argmax(axis=1)]
    labels[~possible.any(axis=1)] = None
    return np.asarray(labels)


def answers(
    comparison: Comparison,
    references: References,
    classifier: Classifier,
    calibration: Calibration,
    demos: Demonstrations,
    error_rate: float,
) -> list[Answer]:
    """An answer for each movement."""
    found: dict[int, list[Answer]] = {}

    def answer(tile: Tile, compared: Compared) -> None:
        some = demos if len(compared) == len(demos) else demos[tile.start : tile.stop]
        paths = recorded_paths(some, tile.paths)
        found[tile.start] = answers_to(compared, classifier, calibration, some, paths, error_rate)

    for_compared(comparison, references, demos, answer)
    return [one for start in sorted(found) for one in found[start]]


def answers_to(
    compared: Compared,
    classifier: Classifier,
    calibration: Calibration,
    demos: Demonstrations,
    paths: Array,
    error_rate: float,
) -> list[Answer]:
    """An answer for each movement of a tile that was compared; `paths` (n, d, T) are where they were recorded."""
    verdicts = verdicts_of(compared, classifier, calibration, error_rate)
    return with_transforms(verdicts, compared.comparison, compared.references.demonstrations, demos, paths)


class Verdict(NamedTuple):
    """An `Answer` without its transform."""

    label: Label | None
    confidence: float
    p_values: Mapping[Label, float]
    calibrated: bool
    ranked: tuple[Label, ...]
    nearest: tuple[Neighbor, ...]
    responsibilities: Mapping[str, float]


def verdicts_of(
    compared: Compared, classifier: Classifier, calibration: Calibration, error_rate: float
) -> list[Verdict]:
    """What each movement is, from how it compares."""
    scores = classifier.scores(compared)
    p = calibration.p_values(compared.nearest, error_rate)
    calibrated = bool(calibration.calibrated(error_rate).all())
    references = compared.references
    labels = known_labels(references.classes, scores, p, error_rate)
    classes = references.classes.tolist()
    ranks = np.argsort(-scores, axis=1, kind="stable")
    index_of = {label: c for c, label in enumerate(classes)}
    shown = np.array([ranks[i, 0] if label is None else index_of[label] for i, label in enumerate(labels)])
    slices = list(references.slices())
    like = [_nearest(references, compared.log_average[i], slices[c]) for i, c in enumerate(shown.tolist())]
    share = compared.shares(np.array([near[0].index for near in like], dtype=np.intp))
    names = [one.name for one in compared.comparison.representations]
    others = p.copy()
    known = np.array([label is not None for label in labels])
    others[known, shown[known]] = 0.0
    confidence = (1.0 - others.max(axis=1)).tolist()
    return [
        Verdict(
            labels[i],
            confidence[i],
            dict(zip(classes, p[i].tolist(), strict=True)),
            calibrated,
            tuple(classes[c] for c in ranks[i].tolist()),
            like[i],
            dict(zip(names, share[:, i].tolist(), strict=True)),
        )
        for i in range(len(labels))
    ]


def with_transforms(
    verdicts: Sequence[Verdict],
    comparison: Comparison,
    references: IndexedMovements,
    demos: Demonstrations,
    paths: Array,
) -> list[Answer]:
    """The answers to movements: with the transforms from those of the references that they are most like."""
    example = np.array([one.nearest[0].index for one in verdicts], dtype=np.intp)
    share = np.array([list(one.responsibilities.values()) for one in verdicts]).T
    transforms = map_onto(comparison, references, example, demos, paths, share)
    return [Answer(**one._asdict(), transform=each) for one, each in zip(verdicts, transforms, strict=True)]


def _nearest(references: References, logs: Array, rows: slice) -> tuple[Neighbor, ...]:
    """The nearest references of one class, which are in these rows."""
    best = rows.start + np.argsort(-logs[rows], kind="stable")[:_SHOWN]
    names = references.demonstrations.names
    return tuple(Neighbor(int(i), names[i] if names else None, float(np.exp(logs[i]))) for i in best)

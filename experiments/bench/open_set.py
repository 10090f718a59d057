"""The unknown: known movements called unknown, unknown ones rejected, and how often answers are as right as they say.

On LASA, perturbed, and on recordings of people that are no part of the project: every ``*.npz`` in the folder that the
environment variable KINEME_RECORDINGS names, by default shared/data beside the checkout, with arrays ``positions``
(sum T_i, d), ``times`` (sum T_i,), ``offsets`` (n + 1,), ``labels`` (n,) and ``people`` (n,). Half of the classes are
unknown. Of every person, the templates are his own ("same person") or those of the others alone ("other people", who
are given as groups).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from sklearn.metrics import roc_auc_score

import kineme
from bench.by_person import FOLDER
from bench.people import recorded
from bench.rows import Row
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition.answer import fit_known_classes
from kineme.recognition.classifiers import BY_CONVOLUTIONS
from kineme.recognition.conformal import EXPONENT, LEAST, class_probabilities, distances
from kineme.similarity.comparison import References, fit_to_references
from kineme.similarity.describe import Described, describe
from kineme.similarity.scores import score
from kineme.similarity.specification import ComparisonSpecification
from kineme_experiments.evaluation.conditions import TOGETHER

ERROR_RATE = 0.05
SHOWN = (1, 2, 4, 8)
N_BINS = 10
#: What is said of when -> numbers of demonstrations of each class: confidence is fitted to three or more of them.
FITTED = {"": (3, 4, 8), ", 1 shown": (1,)}
#: Beyond what the recognizer is made for, so that one answer in ten is wrong.
SEVERELY = Perturbation(1.0, 1.0, math.radians(40), 0.7, 0.05)
_SPECIFICATION = ComparisonSpecification()


@dataclass(frozen=True, eq=False)
class Recordings:
    """Described movements of people."""

    name: str
    described: Described
    demos: kineme.Demonstrations
    labels: NDArray[np.str_]
    people: NDArray[np.str_]

    @classmethod
    def of(cls, name: str, demos: kineme.Demonstrations, people: NDArray[np.str_]) -> Recordings:
        """Described once, whichever are shown."""
        return cls(
            name, describe(demos, _SPECIFICATION), demos, np.array([str(label) for label in demos.labels]), people
        )


class Split(NamedTuple):
    """Indices of movements, templates ordered by class."""

    templates: NDArray[np.intp]
    known: NDArray[np.intp]
    unknown: NDArray[np.intp]


class Asked(NamedTuple):
    """What was found of the movements of one split: log similarities (n, C) of the known ones, and verdicts."""

    right: NDArray[np.bool_]  # whether the most similar class is that of each known movement
    similar: NDArray[np.float64]
    truth: NDArray[np.intp]
    novelty: tuple[NDArray[np.float64], NDArray[np.float64]]
    rejected: tuple[float, float]
    confidence: NDArray[np.float64]  # of the most similar class of each known movement
    exponent: float


def measure(quick: bool) -> list[Row]:
    """False rejections, unknown rejected, AUROC, and reliability."""
    draws = 1 if quick else 10
    rows = []
    for one in data():
        for others in (False, True) if len(np.unique(one.people)) > 1 else (False,):
            fewest = np.unique(one.labels + one.people, return_counts=True)[1].min()
            for n_shown in SHOWN:
                if others or n_shown < fewest:  # of oneself, some are left to ask for
                    asked = [ask(one, split, others) for split in splits(one, n_shown, others, draws)]
                    rows += open_set_rows(f"{_where(one, others)}, {n_shown} shown", asked, n_shown)
    return rows + reliability_rows(draws)


def data() -> Iterator[Recordings]:
    """LASA, then what the folder holds."""
    yield from perturbed_lasa({"LASA, moderately": TOGETHER[1], "LASA, strongly": TOGETHER[2]})
    yield from people()


def perturbed_lasa(how: dict[str, Perturbation]) -> Iterator[Recordings]:
    """LASA with everything perturbed."""
    for name, perturbation in how.items():
        demos = perturbation.apply(kineme.load_lasa(), [0, 2])
        yield Recordings.of(name, demos, np.full(len(demos), "one"))


def people() -> Iterator[Recordings]:
    """Recordings in the folder that the environment names."""
    for path in sorted(FOLDER.glob("*.npz")):
        found = recorded(path.name)
        assert found is not None
        yield Recordings.of(path.stem, found.demos, found.people)


def splits(one: Recordings, n_shown: int, others: bool, draws: int, known_share: float = 0.5) -> Iterator[Split]:
    """For each person, templates of a random half of the classes, and the person's other movements."""
    classes, everyone = np.unique(one.labels), np.unique(one.people)
    for k, person in enumerate(everyone):
        for draw in range(draws):
            rng = np.random.default_rng([draw, n_shown, k])
            known = np.sort(rng.permutation(classes)[: round(known_share * len(classes))])
            pool = np.flatnonzero((one.people != person) if others else (one.people == person))
            of_class = [pool[one.labels[pool] == c] for c in known]
            if min(map(len, of_class)) < n_shown:
                continue  # as where each person wrote each word once
            templates = np.concatenate([rng.choice(rows, n_shown, replace=False) for rows in of_class])
            asked = np.setdiff1d(np.flatnonzero(one.people == person), templates)
            is_known = np.isin(one.labels[asked], known)
            yield Split(templates, asked[is_known], asked[~is_known])


def ask(one: Recordings, split: Split, grouped: bool) -> Asked:
    """Fit to the templates and ask the others."""
    shown = split.templates
    references = References.of(one.demos[shown], one.described.take(shown), one.labels[shown])
    groups = np.unique(one.people[shown], return_inverse=True)[1] if grouped else None
    recognizer = fit_known_classes(*fit_to_references(_SPECIFICATION, references), "auto", groups)
    classifier, calibration = recognizer.classifier, recognizer.calibration
    truth = np.searchsorted(references.classes, one.labels[split.known])
    logs, novelty, rejected = [], [], []
    for asked in (split.known, split.unknown):
        compared = recognizer.comparison, recognizer.references, one.described.take(asked)
        found, similar = score(*compared, classifier.nearest_logs, classifier.scores)
        p = calibration.known_p_values(found, ERROR_RATE)
        logs.append(similar)
        novelty.append(calibration.scores(found).min(axis=1))
        rejected.append(float(np.mean(p <= ERROR_RATE)) if len(p) else math.nan)
    probabilities = (
        classifier.probabilities(logs[0])
        if isinstance(classifier, BY_CONVOLUTIONS)
        else class_probabilities(logs[0], calibration.exponent)
    )
    return Asked(
        logs[0].argmax(axis=1) == truth,
        logs[0],
        truth,
        (novelty[0], novelty[1]),
        (rejected[0], rejected[1]),
        probabilities.max(axis=1),
        calibration.exponent,
    )


def open_set_rows(what: str, asked: list[Asked], n_shown: int) -> list[Row]:
    """Means over the splits."""
    if not asked:
        return []
    known, unknown = (100 * np.array([one.rejected[k] for one in asked]) for k in (0, 1))
    area = [
        roc_auc_score(np.repeat([0, 1], [len(n) for n in one.novelty]), np.concatenate(one.novelty)) for one in asked
    ]
    reached = [100 * float(np.mean(one.novelty[1] > np.quantile(one.novelty[0], 1 - ERROR_RATE))) for one in asked]
    target = ("<=", 8.0 if n_shown > 1 else 15.0)
    return [
        Row(
            f"{what}: known called unknown",
            "%",
            float(known.mean()),
            target=target,
            details={"by_split": known.tolist()},
        ),
        Row(f"{what}: unknown rejected", "%", float(unknown.mean()), float(np.mean(reached)), "at 5 % of the known"),
        Row(f"{what}: AUROC", "", float(np.mean(area))),
    ]


def reliability_rows(draws: int) -> list[Row]:
    """How far confidence is from the share of right answers, with all classes known."""
    sets = [*perturbed_lasa({"LASA, strongly": TOGETHER[2], "LASA, severely": SEVERELY}), *people()]
    rows = []
    for one in sets:
        for others in (False, True) if len(np.unique(one.people)) > 1 else (False,):
            for when, shown in FITTED.items():
                found = [ask(one, s, others) for n in shown for s in splits(one, n, others, draws, 1.0)]
                right = np.concatenate([one.right for one in found]) if found else np.empty(0)
                if not len(right):  # no movement is left to ask for
                    continue
                confidence = np.concatenate([each.confidence for each in found])
                details = reliability(confidence, right)
                details |= {"accuracy": float(right.mean()), "confidence": float(confidence.mean())}
                if shown == (1,):
                    details["exponent"] = exponent(found)
                what = f"{_where(one, others)}{when}: expected calibration error"
                rows.append(Row(what, "", details["error"], target=("<=", 0.05), details=details))
    return rows


def reliability(confidence: NDArray[np.float64], right: NDArray[np.bool_]) -> dict[str, object]:
    """Ten bins of equal width: confidence, share right, number; and their mean difference, weighted by the number."""
    bins = np.minimum((N_BINS * confidence).astype(int), N_BINS - 1)
    held = np.unique(bins)
    said = [float(confidence[bins == b].mean()) for b in held]
    was = [float(right[bins == b].mean()) for b in held]
    number = [int(np.count_nonzero(bins == b)) for b in held]
    error = float(np.dot(np.abs(np.subtract(said, was)), number) / len(right))
    return {"error": error, "said": said, "right": was, "number": number}


def exponent(asked: list[Asked]) -> float:
    """The exponent at which the right classes are most likely."""
    logs = [np.log(np.maximum(distances(one.similar), LEAST)) for one in asked]

    def loss(m: float) -> float:
        total = 0.0
        for one, each in zip(asked, logs, strict=True):
            z = -m * (each - each.min(axis=1, keepdims=True))
            chance = (z - np.log(np.exp(z).sum(axis=1, keepdims=True)))[np.arange(len(z)), one.truth]
            total -= float(chance.sum())
        return total

    return float(minimize_scalar(loss, bounds=(1.0, 4 * EXPONENT), method="bounded").x)


def _where(one: Recordings, others: bool) -> str:
    return one.name if len(np.unique(one.people)) == 1 else f"{one.name}, {'other people' if others else 'same person'}"

"""The scores of one method in one split of one protocol."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.recognition.early.evidence import cut
from kineme.validation import Array
from kineme_experiments.evaluation.conditions import Condition
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.methods import METHODS, Contender, Options
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.evaluation.spotting import Counts, concatenate_all, count_spotted
from kineme_experiments.evaluation.trials import TASKS, Settings, Trial

FALSE_REJECTION = 0.05  # of known movements


class Scores(NamedTuple):
    """The scores of a method in one trial, measure -> value, and the seconds that learning and classifying took."""

    condition: Condition
    values: dict[str, float]
    seconds: float


def score_split(data: DataSet, protocol: str, method: str, index: int, settings: Settings) -> list[Scores]:
    """The scores of all trials of a split; empty for a method that cannot do what the protocol asks."""
    scores: list[Scores] = []
    if not does(method, PROTOCOLS[protocol].task):
        return scores
    for trial in PROTOCOLS[protocol].trials(data, settings, index):
        contender = METHODS[method].contender(Options(trial.max_angle, settings.seed, trial.people), trial.task)
        if trial.task == "spot":
            scores += _spot(contender, trial, [settings.seed, index])
        else:
            scores += _SCORED[trial.task](contender, trial)
    return scores


def does(method: str, task: str) -> bool:
    """Whether a method can do a task of `TASKS`."""
    return callable(getattr(METHODS[method].contender(Options(), task), TASKS[task].method, None))


def _whole(contender: Contender, trial: Trial) -> Iterator[Scores]:
    train, test = trial.demonstrations[trial.split.train], trial.demonstrations[trial.split.test]
    began = time.perf_counter()
    contender.fit(train)
    predicted, familiarity = contender.classify(test)
    seconds = time.perf_counter() - began
    labels, known = require_labels(test), trial.split.known
    values = accuracy(predicted, labels) if known.all() else open_set(predicted, labels, familiarity, known)
    yield Scores(trial.condition, values, seconds)


def _partial(contender: Any, trial: Trial) -> Iterator[Scores]:
    test = trial.demonstrations[trial.split.test]
    contender.fit(trial.demonstrations[trial.split.train])
    for fraction in trial.fractions:
        partial = cut(test, fraction)
        began = time.perf_counter()
        values = accuracy(contender.classify_partial(partial), require_labels(test))
        condition = Condition(trial.condition.varied, 100 * fraction, f"{100 * fraction:.0f} %")
        yield Scores(condition, values, time.perf_counter() - began)


def _spot(contender: Any, trial: Trial, seed: list[int]) -> Iterator[Scores]:
    test = trial.demonstrations[trial.split.test]
    labels = [a if known else None for a, known in zip(require_labels(test), trial.split.known, strict=True)]
    recordings = concatenate_all(test, labels, [2, *seed], rests=trial.rests)
    began = time.perf_counter()
    contender.fit(trial.demonstrations[trial.split.train])
    found = [contender.spot(recording.recording) for recording in recordings]
    seconds = time.perf_counter() - began
    counts = sum(
        (count_spotted(*both) for both in zip(found, [recording.truth for recording in recordings], strict=True)),
        Counts(),
    )
    yield Scores(trial.condition, {"precision": counts.precision, "recall": counts.recall}, seconds)


def _cluster(contender: Any, trial: Trial) -> Iterator[Scores]:
    movements = trial.demonstrations[trial.split.test]
    labels = require_labels(movements)
    unlabeled = Demonstrations.of_movements(replace(movements.movements, labels=None))
    began = time.perf_counter()
    found = contender.cluster(unlabeled, None)
    given = contender.cluster(unlabeled, len(np.unique(labels)))
    yield Scores(trial.condition, clustered(found, given, labels), time.perf_counter() - began)


_SCORED: dict[str, Callable[[Any, Trial], Iterator[Scores]]] = {
    "classify": _whole,
    "classify partial": _partial,
    "cluster": _cluster,
}


def accuracy(predicted: NDArray[Any], labels: NDArray[Any]) -> dict[str, float]:
    """Share of movements whose class is right."""
    return {"accuracy": float(np.mean(predicted == labels))}


def open_set(
    predicted: NDArray[Any], labels: NDArray[Any], familiarity: Array, known: NDArray[np.bool_]
) -> dict[str, float]:
    """Area under the ROC curve of known against unknown, and what a threshold at 5 % false rejection gives.

    The threshold is the lowest familiarity that at most 5 % of the known test movements stay below: it measures
    the ranking, not the choice of a threshold.

    Returns
    -------
    dict
        ``auroc``; ``rejected``, the share of unknown movements below the threshold; ``accuracy``, the share of known
        movements above it and given the right class.
    """
    inside, outside = np.sort(familiarity[known]), familiarity[~known]
    threshold = inside[int(np.floor(FALSE_REJECTION * len(inside)))]
    right = (predicted[known] == labels[known]) & (familiarity[known] >= threshold)
    return {"auroc": auroc(inside, outside), "rejected": float(np.mean(outside < threshold))} | {
        "accuracy": float(np.mean(right))
    }


def auroc(inside: Array, outside: Array) -> float:
    """Probability that a known movement is more familiar than an unknown one; ties count half (Mann and Whitney)."""
    order = np.sort(outside)
    below = np.searchsorted(order, inside, side="left") + np.searchsorted(order, inside, side="right")
    return float(below.mean() / (2.0 * len(order)))


def clustered(found: NDArray[Any] | None, given: NDArray[Any], labels: NDArray[Any]) -> dict[str, float]:
    """Adjusted Rand index of clusters, with the number of classes given, and with it found and how it was found.

    Parameters
    ----------
    found, given : ndarray of shape (n,)
        Cluster of each movement, -1 for none; such movements count as clusters of one, but not in the number. `found`
        is None for a method that must be given the number.
    labels : ndarray of shape (n,)
    """
    values = {} if found is None else {"adjusted_rand": _adjusted_rand(found, labels)}
    values["adjusted_rand_given"] = _adjusted_rand(given, labels)
    if found is not None:
        values["clusters"] = len(np.unique(found[found >= 0])) / len(np.unique(labels))
    return values


def _adjusted_rand(clusters: NDArray[Any], labels: NDArray[Any]) -> float:
    from sklearn.metrics import adjusted_rand_score

    alone = clusters < 0
    separate = np.where(alone, clusters.max(initial=0) + np.cumsum(alone), clusters)
    return float(adjusted_rand_score(labels.astype(str), separate))

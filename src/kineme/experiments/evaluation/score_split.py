"""The scores of one method in one split of one protocol."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from kineme.experiments.evaluation.conditions import Condition
from kineme.experiments.evaluation.data import DataSet
from kineme.experiments.evaluation.measures import accuracy, clustered, open_set
from kineme.experiments.evaluation.methods import METHODS, Contender, Options
from kineme.experiments.evaluation.protocols import PROTOCOLS
from kineme.experiments.evaluation.spotting import Counts, concatenate_all, count_spotted
from kineme.experiments.evaluation.trials import TASKS, Settings, Trial
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.recognition.early.early import cut


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
    found = [contender.spot(one.recording) for one in recordings]
    seconds = time.perf_counter() - began
    counts = sum(
        (count_spotted(*both) for both in zip(found, [one.truth for one in recordings], strict=True)), Counts()
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

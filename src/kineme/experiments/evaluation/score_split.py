"""The scores of one method in one split of one protocol."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from kineme.experiments.evaluation.conditions import Condition
from kineme.experiments.evaluation.measures import accuracy, open_set
from kineme.experiments.evaluation.methods import METHODS, Contender, Options
from kineme.experiments.evaluation.protocols import PROTOCOLS, Settings, Trial
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.recognition.early.early import cut


class Scores(NamedTuple):
    """The scores of a method in one trial, measure -> value, and the seconds that learning and classifying took."""

    condition: Condition
    values: dict[str, float]
    seconds: float


def score_split(
    demonstrations: Demonstrations, protocol: str, method: str, index: int, settings: Settings
) -> list[Scores]:
    """The scores of all trials of a split; empty for a method that cannot do what the protocol asks."""
    scores = []
    for trial in PROTOCOLS[protocol].trials(demonstrations, settings, index):
        if trial.reference or not METHODS[method].slow:
            contender = METHODS[method].make(Options(trial.max_angle, settings.seed))
            scores += list(_score_early(contender, trial) if trial.fractions else _score_whole(contender, trial))
    return scores


def classifies_partial(method: str) -> bool:
    """Whether a method can classify movements that are not over yet."""
    return callable(getattr(METHODS[method].make(Options()), "classify_partial", None))


def _score_whole(contender: Contender, trial: Trial) -> Iterator[Scores]:
    train, test = trial.demonstrations[trial.split.train], trial.demonstrations[trial.split.test]
    began = time.perf_counter()
    contender.fit(train)
    predicted, familiarity = contender.classify(test)
    seconds = time.perf_counter() - began
    labels, known = require_labels(test), trial.split.known
    values = accuracy(predicted, labels) if known.all() else open_set(predicted, labels, familiarity, known)
    yield Scores(trial.condition, values, seconds)


def _score_early(contender: Any, trial: Trial) -> Iterator[Scores]:
    if not callable(getattr(contender, "classify_partial", None)):
        return
    test = trial.demonstrations[trial.split.test]
    contender.fit(trial.demonstrations[trial.split.train])
    for fraction in trial.fractions:
        partial = cut(test, fraction)
        began = time.perf_counter()
        values = accuracy(contender.classify_partial(partial), require_labels(test))
        condition = Condition(trial.condition.varied, 100 * fraction, f"{100 * fraction:.0f} %")
        yield Scores(condition, values, time.perf_counter() - began)

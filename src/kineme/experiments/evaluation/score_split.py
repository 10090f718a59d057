"""One method in one split of one protocol."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from kineme.experiments.evaluation.conditions import Condition
from kineme.experiments.evaluation.measures import accuracy, open_set
from kineme.experiments.evaluation.methods import METHODS, Contender, Wishes
from kineme.experiments.evaluation.protocols import PROTOCOLS, Settings, Trial
from kineme.movements.preparation.arc_length import arc_length_phase
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.validation import MIN_SAMPLES


class Verdict(NamedTuple):
    """What a method reached in a trial: measure -> value, and the seconds it took to learn and to answer."""

    condition: Condition
    values: dict[str, float]
    seconds: float


def judge(demonstrations: Demonstrations, protocol: str, method: str, index: int, settings: Settings) -> list[Verdict]:
    """The verdicts of all trials of a split; empty for a method that does not answer what is asked."""
    verdicts = []
    for trial in PROTOCOLS[protocol].trials(demonstrations, settings, index):
        if trial.reference or not METHODS[method].slow:
            contender = METHODS[method].make(Wishes(trial.max_angle, settings.seed))
            verdicts += list(_early(contender, trial) if trial.fractions else _whole(contender, trial))
    return verdicts


def answers_early(method: str) -> bool:
    """Whether a method is made for movements that are not over yet."""
    return callable(getattr(METHODS[method].make(Wishes()), "answer_partial", None))


def _whole(contender: Contender, trial: Trial) -> Iterator[Verdict]:
    train, test = trial.demonstrations[trial.split.train], trial.demonstrations[trial.split.test]
    began = time.perf_counter()
    contender.fit(train)
    predicted, familiarity = contender.answer(test)
    seconds = time.perf_counter() - began
    labels, known = require_labels(test), trial.split.known
    judged = accuracy(predicted, labels) if known.all() else open_set(predicted, labels, familiarity, known)
    yield Verdict(trial.condition, judged, seconds)


def _early(contender: Any, trial: Trial) -> Iterator[Verdict]:
    if not callable(getattr(contender, "answer_partial", None)):
        return
    test = trial.demonstrations[trial.split.test]
    contender.fit(trial.demonstrations[trial.split.train])
    for fraction in trial.fractions:
        seen = beginnings(test, fraction)
        began = time.perf_counter()
        judged = accuracy(contender.answer_partial(seen), require_labels(test))
        condition = Condition(trial.condition.kind, 100 * fraction, f"{100 * fraction:.0f} %")
        yield Verdict(condition, judged, time.perf_counter() - began)


def beginnings(demonstrations: Demonstrations, fraction: float, n_samples: int = 200) -> Demonstrations:
    """The movements until a fraction of their path's length, at `n_samples` even times of the whole."""
    n = len(demonstrations)
    paths = relative_rows(demonstrations, 0, n, n_samples)
    last = np.maximum((arc_length_phase(paths) <= fraction + 1e-12).sum(axis=1), MIN_SAMPLES)
    starts = demonstrations.positions[demonstrations.offsets[:-1]]
    steps = demonstrations.durations / (n_samples - 1)
    return Demonstrations.from_arrays(
        [path[:, :end].T + start for path, end, start in zip(paths, last, starts, strict=True)],
        demonstrations.labels,
        [step * np.arange(end) for step, end in zip(steps, last, strict=True)],
    )

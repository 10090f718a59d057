"""Protocols by person: templates by oneself or by others, unknown classes, beginnings, spotting, anchoring."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kineme.movements.trajectories.demonstrations import require_labels
from kineme_experiments.evaluation.conditions import Condition
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.splits import Split, one_person_out, within_person
from kineme_experiments.evaluation.trials import Protocol, Settings, Trial, shots_label

_SHOTS = (1, 2, 3, 4, 8)
_SOME_SHOTS = (1, 4)  # where each trial costs more
_FRACTIONS = (0.5, 0.7, 0.9, 1.0)
_RESTS = ((True, "with rests"), (False, "without rests"))


def _people(data: DataSet) -> list[str]:
    assert data.people is not None
    return sorted(set(data.people.tolist()))


def _n_splits(data: DataSet, settings: Settings) -> int:
    """Every person equally often, unless fewer splits than people are asked for."""
    n = len(_people(data))
    return settings.splits if settings.splits < n else -(-settings.splits // n) * n


def _person(data: DataSet, index: int) -> str:
    """Who is tested in split `index`: the people take turns."""
    people = _people(data)
    return people[index % len(people)]


def _split(data: DataSet, shots: int, seed: int, index: int, *, own: bool = False, unknown: bool = False) -> Split:
    """Split `index`: each turn of a person draws anew."""
    draw = index // len(_people(data))
    labels = require_labels(data.demonstrations)
    tested = np.asarray(data.people == _person(data, index))
    if own:
        return within_person(labels, tested, shots, seed, draw)
    return one_person_out(labels, tested, shots, seed, draw, unknown=unknown)


def _usable(data: DataSet, split: Split) -> bool:
    """Whether there is something to test, and at least two classes to choose from."""
    return len(split.test) > 0 and len(np.unique(require_labels(data.demonstrations)[split.train])) > 1


def _dependent(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    for shots in settings.shots or _SHOTS:
        split = _split(data, shots, settings.seed, index, own=True)
        if _usable(data, split):
            yield Trial(shots_label(shots), data.demonstrations, split)


def _independent(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    for shots in settings.shots or _SHOTS:
        split = _split(data, shots, settings.seed, index)
        if _usable(data, split):
            yield Trial(shots_label(shots), data.demonstrations, split)


def _open_set(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    for shots in settings.shots or _SOME_SHOTS:
        split = _split(data, shots, settings.seed, index, unknown=True)
        if _usable(data, split) and split.known.any() and not split.known.all():
            yield Trial(shots_label(shots), data.demonstrations, split)


def _early(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    split = _split(data, max(settings.shots or _SOME_SHOTS), settings.seed, index)
    if _usable(data, split):
        condition = Condition("path", 100, "whole path")
        yield Trial(condition, data.demonstrations, split, "classify partial", fractions=_FRACTIONS)


def _spotting(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    for own in (True, False):
        split = _split(data, max(settings.shots or _SOME_SHOTS), settings.seed, index, own=own)
        people = None if own or data.people is None else data.people[split.train]
        for k, (rests, label) in enumerate(_RESTS):
            if _usable(data, split):
                condition = Condition(f"spotting {own}", k, f"{'own' if own else 'others'}, {label}")
                yield Trial(condition, data.demonstrations, split, "spot", rests=rests, people=people)


def _anchoring(data: DataSet, _: Settings, index: int) -> Iterator[Trial]:
    people = _people(data)
    across = index == len(people)
    chosen = np.arange(len(data.demonstrations)) if across else np.flatnonzero(data.people == people[index])
    split = Split(np.empty(0, dtype=np.intp), chosen, np.ones(len(chosen), bool))
    condition = Condition("people", int(across), "all people" if across else "within a person")
    yield Trial(condition, data.demonstrations, split, "cluster")


def _n_splits_of_anchoring(data: DataSet, settings: Settings) -> int:
    """Every person once, then all of them; fewer people, and not all together, where fewer splits are asked for."""
    n = len(_people(data))
    return settings.splits if settings.splits < n else n + 1


def _person_or_all(data: DataSet, index: int) -> str:
    return "" if index == len(_people(data)) else _person(data, index)


PERSON_PROTOCOLS: dict[str, Protocol] = {
    "user-dependent": Protocol(
        "User-dependent", "A few random movements of each class by one person train, all others by this person test; "
        "each person takes turns.", _dependent, _n_splits, person=_person, by_person=True,
    ),
    "user-independent": Protocol(
        "User-independent", "The movements of one person test; a few random movements of each class by the other "
        "people, all together, train. Each person takes turns.", _independent, _n_splits, person=_person,
        by_person=True,
    ),
    "open-set-by-person": Protocol(
        "Unknown classes, user-independent", "As user-independent, but only a random half of the classes is known. A "
        "threshold on each method's own familiarity rejects 5 % of the known test movements: the share of unknown "
        "movements below it, and the share of known ones above it that get the right class.", _open_set, _n_splits,
        person=_person, by_person=True, min_classes=4,
    ),
    "earliness-by-person": Protocol(
        "Early, user-independent", "As user-independent, with the most movements of each class that are asked for, 4 "
        "by default and 3 with --quick, but only the first part of each test movement's path is given.", _early,
        _n_splits, "classify partial", person=_person, by_person=True,
    ),
    "spotting": Protocol(
        "Spotting", "The test movements of one person in random order, in recordings of up to twenty, with rests and "
        "straight transits between them, or linked without a stop; templates by the same person (own) or by the "
        "others: the most of each class that are asked for, 4 by default and 3 with --quick. A movement is found if "
        "its class is right and the stretch overlaps it by half of their union or more. Methods are told which of the "
        "others made each template.",
        _spotting, _n_splits, "spot", person=_person, by_person=True,
    ),
    "anchoring": Protocol(
        "Anchoring", "Movements without labels are clustered, those of each person alone and, where at least as "
        "many splits as people are asked for, those of all people together: adjusted Rand index, and number of "
        "clusters per class, where the number of clusters is found, and the index where the number of classes is "
        "given. Rivals get average linkage, and the number.", _anchoring,
        _n_splits_of_anchoring, "cluster", person=_person_or_all, by_person=True,
    ),
}  # fmt: skip

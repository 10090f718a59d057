"""One table of protocols; each protocol generates trials, the same for every method."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from kineme.movements.preparation.perturbations import Perturbation
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme_experiments.evaluation.conditions import TOGETHER, UNTOUCHED, Condition, robustness_conditions
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.person_protocols import PERSON_PROTOCOLS
from kineme_experiments.evaluation.splits import few_shot, folds, half_unknown, one_left_out
from kineme_experiments.evaluation.trials import Protocol, Settings, Trial, shots_label

_SHOTS = (1, 3, 5)
_FOLDS = 5
_OPEN_SET_SHOTS = 5
_EARLY_SHOTS = 3
_FRACTIONS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
_EARLY_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=math.radians(30))


def usable_shots(demonstrations: Demonstrations, shots: tuple[int, ...]) -> tuple[int, ...]:
    """The numbers of shots that leave every class a movement to test; at least one number."""
    largest = int(np.unique(require_labels(demonstrations), return_counts=True)[1].min()) - 1
    return tuple(sorted({min(k, largest) for k in shots}))


def _few_shot(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    labels = require_labels(demos)
    for shots in usable_shots(demos, settings.shots or _SHOTS):
        split = few_shot(labels, shots, settings.seed, index)
        yield Trial(shots_label(shots), demos, split)


def _leave_one_out(data: DataSet, _: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    yield Trial(UNTOUCHED, demos, one_left_out(require_labels(demos), index))


def _cross_validation(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    n_folds = min(_FOLDS, int(np.unique(require_labels(demos), return_counts=True)[1].min()))
    for split in folds(require_labels(demos), n_folds, settings.seed, index):
        yield Trial(UNTOUCHED, demos, split)


def _robustness(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    split = few_shot(require_labels(demos), usable_shots(demos, settings.shots or _SHOTS)[0], settings.seed, index)
    for condition, perturbation in robustness_conditions(demos.n_dims):
        perturbed = perturbation.apply(demos, [settings.seed, index])
        yield Trial(condition, perturbed, split)


def _any_angle(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    split = few_shot(require_labels(demos), usable_shots(demos, settings.shots or _SHOTS)[0], settings.seed, index)
    turned = Perturbation(rotation=math.pi).apply(demos, [settings.seed, index])
    yield Trial(Condition("rotation", 180, "any angle"), turned, split, max_angle=math.pi)


def _open_set(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    shots = usable_shots(demos, (_OPEN_SET_SHOTS,))[0]
    split = half_unknown(require_labels(demos), shots, settings.seed, index)
    yield Trial(UNTOUCHED, demos, split)
    perturbation = TOGETHER[1].in_dimensions(demos.n_dims)
    perturbed = perturbation.apply(demos, [settings.seed, index])
    yield Trial(Condition("together", 2, "perturbed"), perturbed, split)


def _early(data: DataSet, settings: Settings, index: int) -> Iterator[Trial]:
    demos = data.demonstrations
    split = few_shot(require_labels(demos), usable_shots(demos, (_EARLY_SHOTS,))[0], settings.seed, index)
    perturbation = _EARLY_PERTURBATION.in_dimensions(demos.n_dims)
    moved = perturbation.apply(demos, [settings.seed, index])
    yield Trial(Condition("path", 100, "whole path"), moved, split, "classify partial", fractions=_FRACTIONS)


PROTOCOLS: dict[str, Protocol] = {
    "few-shot": Protocol("Few shots", "A few random movements of each class train, all others test.", _few_shot),
    "leave-one-out": Protocol(
        "Leave one out", "Each movement tests once, all others train.", _leave_one_out,
        lambda data, _: len(data.demonstrations), by_default=False,
    ),
    "cross-validation": Protocol(
        "Cross-validation", "Each class is spread over five parts, each of which tests once.", _cross_validation,
        by_default=False,
    ),
    "robustness": Protocol(
        "Robustness", "Fewest shots. Training and test movements are perturbed alike, at growing strength.", _robustness
    ),
    "any-angle": Protocol(
        "Rotation by any angle", "Fewest shots; every movement is turned by any angle, and max_angle is pi.",
        _any_angle, rotates=True,
    ),
    "open-set": Protocol(
        "Unknown classes", "A random half of the classes is known, and up to five movements of each train. A threshold "
        "on each method's own familiarity rejects 5 % of the known test movements: the share of unknown movements "
        "below it, and the share of known ones above it that get the right class.", _open_set, min_classes=4,
    ),
    "earliness": Protocol(
        "Early", "Up to three shots; only the first part of each test movement's path is given, and position, "
        "size and direction within 30 degrees are unknown.", _early, task="classify partial",
    ),
} | PERSON_PROTOCOLS  # fmt: skip

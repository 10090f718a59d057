"""One table of protocols; each protocol generates trials, the same for every method."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kineme.experiments.evaluation.conditions import TOGETHER, UNTOUCHED, Condition, robustness_conditions
from kineme.experiments.evaluation.splits import Split, few_shot, folds, half_unknown, one_left_out
from kineme.movements.preparation.perturbations import Perturbation
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels

_FOLDS = 5
_OPEN_SET_SHOTS = 5
_EARLY_SHOTS = 3
_FRACTIONS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
_EARLY_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=math.radians(30))


class Settings(NamedTuple):
    """The options of the command."""

    splits: int = 10
    seed: int = 0
    shots: tuple[int, ...] = (1, 3, 5)


@dataclass(frozen=True, eq=False)
class Trial:
    """Training and test movements under one condition.

    With `fractions`, only these shares of the test movements' paths are classified. Slow methods run in reference
    trials only.
    """

    condition: Condition
    demonstrations: Demonstrations
    split: Split
    max_angle: float | None = None
    fractions: tuple[float, ...] = ()
    reference: bool = True


Trials = Callable[[Demonstrations, Settings, int], Iterator[Trial]]


@dataclass(frozen=True)
class Protocol:
    """One row of `PROTOCOLS`.

    Attributes
    ----------
    title, description : str
        Texts of the report.
    trials : callable
        (demonstrations, settings, index of the split) -> trials.
    n_splits : callable
        (demonstrations, settings) -> number of splits.
    rotates : bool
        Needs movements of two or three dimensions, which can be rotated.
    min_classes : int
        Smallest number of classes.
    by_default : bool
        Whether the protocol runs if none is named.
    """

    title: str
    description: str
    trials: Trials
    n_splits: Callable[[Demonstrations, Settings], int] = lambda _, settings: settings.splits
    rotates: bool = False
    min_classes: int = 2
    by_default: bool = True

    def unsuitable(self, demonstrations: Demonstrations) -> str:
        """Why the data do not allow this protocol, or ""."""
        if self.rotates and demonstrations.n_dims not in (2, 3):
            return f"needs movements of 2 or 3 dimensions, these have {demonstrations.n_dims}"
        n_classes = len(np.unique(require_labels(demonstrations)))
        few = n_classes < self.min_classes
        return f"needs at least {self.min_classes} classes, these are {n_classes}" if few else ""


def usable_shots(demonstrations: Demonstrations, shots: tuple[int, ...]) -> tuple[int, ...]:
    """The numbers of shots that leave every class a movement to test; at least one number."""
    largest = int(np.unique(require_labels(demonstrations), return_counts=True)[1].min()) - 1
    return tuple(sorted({min(k, largest) for k in shots}))


def _few_shot(demos: Demonstrations, settings: Settings, index: int) -> Iterator[Trial]:
    labels = require_labels(demos)
    for k, shots in enumerate(usable_shots(demos, settings.shots)):
        split = few_shot(labels, shots, settings.seed, index)
        yield Trial(Condition("shots", shots, f"{shots} shot" + "s" * (shots > 1)), demos, split, reference=k == 0)


def _leave_one_out(demos: Demonstrations, _: Settings, index: int) -> Iterator[Trial]:
    yield Trial(UNTOUCHED, demos, one_left_out(require_labels(demos), index))


def _cross_validation(demos: Demonstrations, settings: Settings, index: int) -> Iterator[Trial]:
    n_folds = min(_FOLDS, int(np.unique(require_labels(demos), return_counts=True)[1].min()))
    for split in folds(require_labels(demos), n_folds, settings.seed, index):
        yield Trial(UNTOUCHED, demos, split)


def _robustness(demos: Demonstrations, settings: Settings, index: int) -> Iterator[Trial]:
    split = few_shot(require_labels(demos), usable_shots(demos, settings.shots)[0], settings.seed, index)
    for condition, perturbation, reference in robustness_conditions(demos.n_dims):
        perturbed = perturbation.apply(demos, [settings.seed, index])
        yield Trial(condition, perturbed, split, reference=reference)


def _any_angle(demos: Demonstrations, settings: Settings, index: int) -> Iterator[Trial]:
    split = few_shot(require_labels(demos), usable_shots(demos, settings.shots)[0], settings.seed, index)
    turned = Perturbation(rotation=math.pi).apply(demos, [settings.seed, index])
    yield Trial(Condition("rotation", 180, "any angle"), turned, split, max_angle=math.pi)


def _open_set(demos: Demonstrations, settings: Settings, index: int) -> Iterator[Trial]:
    shots = usable_shots(demos, (_OPEN_SET_SHOTS,))[0]
    split = half_unknown(require_labels(demos), shots, settings.seed, index)
    yield Trial(UNTOUCHED, demos, split, reference=False)
    perturbation = TOGETHER[1].in_dimensions(demos.n_dims)
    perturbed = perturbation.apply(demos, [settings.seed, index])
    yield Trial(Condition("together", 2, "perturbed"), perturbed, split)


def _early(demos: Demonstrations, settings: Settings, index: int) -> Iterator[Trial]:
    split = few_shot(require_labels(demos), usable_shots(demos, (_EARLY_SHOTS,))[0], settings.seed, index)
    perturbation = _EARLY_PERTURBATION.in_dimensions(demos.n_dims)
    moved = perturbation.apply(demos, [settings.seed, index])
    yield Trial(Condition("path", 100, "whole path"), moved, split, fractions=_FRACTIONS, reference=False)


PROTOCOLS: dict[str, Protocol] = {
    "few-shot": Protocol("Few shots", "A few random movements of each class train, all others test.", _few_shot),
    "leave-one-out": Protocol(
        "Leave one out", "Each movement tests once, all others train.", _leave_one_out,
        lambda demos, _: len(demos), by_default=False,
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
        "size and direction within 30 degrees are unknown.", _early,
    ),
}  # fmt: skip

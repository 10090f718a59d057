"""What protocols are made of: options, trials and the record of a protocol."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme_experiments.evaluation.conditions import Condition
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.splits import Split


class Task(NamedTuple):
    """What a trial asks: the method that a contender needs for it, and how a sentence calls it."""

    method: str
    words: str


TASKS = {
    "classify": Task("classify", "classify movements"),
    "classify partial": Task("classify_partial", "classify movements before their end"),
    "spot": Task("spot", "find movements in a recording"),
    "cluster": Task("cluster", "cluster movements"),
}


class Settings(NamedTuple):
    """The options of the command; without `shots`, each protocol has its own."""

    splits: int = 10
    seed: int = 0
    shots: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Trial:
    """Training and test movements under one condition.

    Attributes
    ----------
    condition : Condition
    demonstrations : Demonstrations
    split : Split
    task : str
        One of `TASKS`.
    max_angle : float, optional
        Largest rotation, for methods that have such a limit.
    fractions : tuple of float
        The shares of the test movements' paths that are classified, for "classify partial".
    rests : bool
        Whether there are rests between the concatenated test movements, for "spot".
    people : ndarray, optional
        Who made each training movement, for methods that take groups.
    """

    condition: Condition
    demonstrations: Demonstrations
    split: Split
    task: str = "classify"
    max_angle: float | None = None
    fractions: tuple[float, ...] = ()
    rests: bool = True
    people: NDArray[Any] | None = None


Trials = Callable[[DataSet, Settings, int], Iterator[Trial]]


@dataclass(frozen=True)
class Protocol:
    """One row of `PROTOCOLS`.

    Attributes
    ----------
    title, description : str
        Texts of the report.
    trials : callable
        (data, settings, index of the split) -> trials.
    n_splits : callable
        (data, settings) -> number of splits.
    task : str
        The task of its trials.
    rotates : bool
        Needs movements of two or three dimensions, which can be rotated.
    person : callable
        (data, index of the split) -> whose movements are tested; "" for everybody's.
    by_person : bool
        Needs movements of at least two people.
    min_classes : int
        Smallest number of classes.
    by_default : bool
        Whether the protocol runs if none is named.
    """

    title: str
    description: str
    trials: Trials
    n_splits: Callable[[DataSet, Settings], int] = lambda _, settings: settings.splits
    task: str = "classify"
    rotates: bool = False
    person: Callable[[DataSet, int], str] = lambda _, __: ""
    by_person: bool = False
    min_classes: int = 2
    by_default: bool = True

    def unsuitable(self, data: DataSet) -> str:
        """Why the data do not allow this protocol, or ""."""
        demonstrations = data.demonstrations
        if self.by_person and data.people is None:
            return "needs to know which of at least two people made each movement"
        if self.rotates and demonstrations.n_dims not in (2, 3):
            return f"needs movements of 2 or 3 dimensions, these have {demonstrations.n_dims}"
        n_classes = len(np.unique(require_labels(demonstrations)))
        few = n_classes < self.min_classes
        return f"needs at least {self.min_classes} classes, these are {n_classes}" if few else ""

    def runs_by_default(self, data: DataSet) -> bool:
        """Whether it runs if none is named: by person where the people are known, else as recorded and perturbed."""
        return self.by_default and self.by_person == (data.people is not None)


def shots_label(shots: int) -> Condition:
    """The condition of so many training movements per class."""
    return Condition("shots", shots, f"{shots} shot" + "s" * (shots > 1))

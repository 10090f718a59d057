"""Movements unlike the others of their label: wrong labels, cut recordings, failed demonstrations; and a report."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.conformal import LEAST, check_error_rate, distances
from kineme.reporting.table import Table, to_text
from kineme.reporting.text import counted, printable
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References, fit_comparison
from kineme.similarity.describe import Described, for_described
from kineme.similarity.specification import ComparisonSpecification
from kineme.validation import Array

_SHOWN = 50  # rows of the table; the rest is counted

FEWEST, FEWEST_OF_LABEL = 20, 5  # movements: with fewer, nobody can tell what is usual
_NEAREST = 3  # others whose distance counts: with one, two movements that are wrong alike would vouch for each other
_COMPARED = 200  # movements of a label that each is compared with, at most, evenly spaced
_FITTED = 500  # movements that widths are estimated from, and that stand for other labels, at most
_PRIOR = 4.0  # movements that the typical distance of all labels counts for beside those of the label
_MIDDLE, _UPPER = 0.5, 0.8  # quantiles that tell the law of distances: up to a fifth may be outliers
_NARROWEST = 0.1  # difference of these quantiles, where most movements are copies


@dataclass(frozen=True)
class Outlier:
    """A movement unlike the others of its label.

    Attributes
    ----------
    index : int
        Of the movement.
    label : str or number
    ratio : float
        Its score, see `find_outliers`: 1 is typical.
    p_value : float
        Share of movements like the others that would be as far or farther.
    most_like : int
        Index of the movement that is nearest among up to 200 of each label.
    label_of_most_like : str or number
        Another one than `label` tells of a wrong label.
    """

    index: int
    label: Label
    ratio: float
    p_value: float
    most_like: int
    label_of_most_like: Label


@dataclass(frozen=True)
class Outliers:
    """Result of `find_outliers`.

    Attributes
    ----------
    outliers : tuple of Outlier
        The most unlike first.
    checked : int
        Movements that were compared with others of their label: those of labels with at least 5, if these are 20 or
        more, else 0.
    error_rate : float
        Expected share of `outliers` that are like the others after all.
    """

    outliers: tuple[Outlier, ...]
    checked: int
    error_rate: float


def find_outliers(
    movements: MovementsLike,
    labels: Sequence[Label | None] | NDArray[Any] | None = None,
    error_rate: float = 0.05,
    progress: Callable[[int], object] | None = None,
) -> Outliers:
    """Find movements that are unlike the others of their label.

    The score of a movement is ``a = (d / s) sqrt(h / e)``: its mean distance d from the three nearest others of its
    label, ``d = sqrt(-2 log K)`` by the similarity K of `Recognizer`, over the typical one s, the median of its label
    shrunk towards that of all as if by four more movements; e is its distance from the nearest of some 500 movements of
    other labels, h the median of e. Above their median m, scores of movements that are alike fall about exponentially,
    ``p = exp(-(a - m) / t) / 2`` with ``t = (1 + 1 / sqrt(n)) (q - m) / log(5 / 2)`` among n movements; q is the
    score that a fifth exceeds, and the first factor is for what is not known of it. Both are of the set itself, and
    hardly change if some of it are outliers. Those movements are found that the procedure of Benjamini and Hochberg
    lists: the k of smallest p where the k-th has ``p <= error_rate k / n``.

    Shape counts; place, size and duration do not, nor do rotations that are usual. The law is an approximation:
    `docs/guide/outliers.md` has measured rates.

    Parameters
    ----------
    movements : movements as `Demonstrations.of` accepts them
    labels : sequence of n labels or None, optional
        By default those of the movements. What has none is not checked.
    error_rate : float, default 0.05
        Expected share of false alarms among what is found.
    progress : callable, optional
        Called now and then with the number of movements that are done.

    Raises
    ------
    TrajectoryError
        Movements without labels, or not one label for each.
    SpecificationError
        An error rate that is not between 0 and 1, or movements that are all the same.

    References
    ----------
    Y. Benjamini, Y. Hochberg, "Controlling the False Discovery Rate", J. R. Stat. Soc. B 57(1), 1995, procedure (1).
    """
    check_error_rate(error_rate)
    demos = Demonstrations.of(movements)
    owners = {label: rows for label, rows in _owners(demos, labels).items() if len(rows) >= FEWEST_OF_LABEL}
    named, members = list(owners), list(owners.values())
    checked = sum(map(len, members))
    if checked < FEWEST:
        return Outliers((), 0, error_rate)
    comparison, references = _fitted(demos, members)
    own, others, done = [], [], 0
    for number, rows in enumerate(members):
        to_own, to_others = _distances(comparison, demos, rows, references, number)
        own.append(to_own)
        others.append(to_others)
        done += len(rows)
        if progress is not None:
            progress(done)
    scores, far = scaled(own), np.concatenate(others)
    if np.isfinite(far).all():  # else there is one label; what is nearer than usual to another label scores more
        scores = scores * np.sqrt(max(float(np.median(far)), LEAST) / np.maximum(far, LEAST))
    p_values = tail_p_values(scores)
    every = np.concatenate(members)
    names = np.repeat(np.array([*named, None], dtype=object)[:-1], [len(rows) for rows in members])
    chosen = listed(p_values, error_rate)
    chosen = chosen[np.argsort(-scores[chosen], kind="stable")]
    alike = _most_like(comparison, demos, members, every[chosen])
    label_of = dict(zip(every.tolist(), names.tolist(), strict=True)) if len(chosen) else {}
    outliers = [
        Outlier(int(every[k]), names[k], float(scores[k]), float(p_values[k]), like, label_of[like])
        for k, like in zip(chosen.tolist(), alike.tolist(), strict=True)
    ]
    return Outliers(tuple(outliers), checked, error_rate)


def tail_p_values(scores: Array) -> Array:
    """Return p-values of scores by the law that their middle tells, see `find_outliers`."""
    middle, upper = np.quantile(scores, [_MIDDLE, _UPPER])
    step = max(float(upper - middle), _NARROWEST) / math.log((1 - _MIDDLE) / (1 - _UPPER))
    step *= 1 + 1 / math.sqrt(len(scores))
    return np.asarray(np.minimum(1.0, (1 - _MIDDLE) * np.exp(-(scores - middle) / step)))


def listed(p_values: Array, error_rate: float) -> NDArray[np.intp]:
    """Return indices of the p-values that Benjamini and Hochberg's procedure rejects, smallest first."""
    order = np.argsort(p_values, kind="stable")
    below = np.flatnonzero(p_values[order] <= error_rate * np.arange(1, len(order) + 1) / len(order))
    return np.asarray(order[: below[-1] + 1 if len(below) else 0])


def _owners(demos: Demonstrations, labels: Sequence[Label | None] | NDArray[Any] | None) -> dict[Any, NDArray[np.intp]]:
    """Return the label -> the movements that have it."""
    given: Any = demos.labels if labels is None else labels
    if given is None:
        raise TrajectoryError("expected movements with labels, to compare each with the others of its label, got none")
    if len(given) != len(demos):
        raise TrajectoryError(f"expected one label or None for each of {len(demos)} movements, got {len(given)}")
    owners: dict[Any, list[int]] = {}
    for i, label in enumerate(given):
        if label is not None:
            owners.setdefault(label, []).append(i)
    return {label: np.array(rows) for label, rows in owners.items()}


def _fitted(demos: Demonstrations, members: list[NDArray[np.intp]]) -> tuple[Comparison, References]:
    """Fit the comparison to some of the movements; return these too, with the numbers of their labels."""
    every = np.concatenate(members)
    numbers = np.repeat(np.arange(len(members)), [len(rows) for rows in members])
    some = evenly_spaced(len(every), _FITTED)
    return fit_comparison(ComparisonSpecification(), demos[every[some]], numbers[some])


def _described(comparison: Comparison, demos: Demonstrations, rows: NDArray[np.intp]) -> Described:
    return comparison.describe(demos[rows])


def _distances(
    comparison: Comparison, demos: Demonstrations, rows: NDArray[np.intp], references: References, number: int
) -> tuple[Array, Array]:
    """Return mean distances of a label's movements from its nearest others, and distances from the nearest else."""
    compared = evenly_spaced(len(rows), _COMPARED)
    own = _described(comparison, demos, rows[compared])
    foreign = references.described.take(np.flatnonzero(references.labels != number))
    near, far = np.empty(len(rows)), np.full(len(rows), np.inf)
    k = min(_NEAREST, len(compared) - 1)

    def fill(chosen: slice, described: Described) -> None:
        away = distances(comparison.similarity.log_average(described, own))
        away[np.arange(chosen.start, chosen.stop)[:, None] == compared] = np.inf
        near[chosen] = np.partition(away, k - 1, axis=1)[:, :k].mean(axis=1)
        if len(foreign):
            far[chosen] = distances(comparison.similarity.log_average(described, foreign)).min(axis=1)

    for_described(demos[rows], comparison, comparison.procrustes, fill, _COMPARED)
    return near, far


def scaled(own: list[Array]) -> Array:
    """Return distances of the movements of each label as multiples of what is typical there."""
    common = float(np.median(np.concatenate(own)))
    scales = [(np.median(away) * len(away) + _PRIOR * common) / (len(away) + _PRIOR) for away in own]
    return np.concatenate([away / max(scale, LEAST) for away, scale in zip(own, scales, strict=True)])


def _most_like(
    comparison: Comparison, demos: Demonstrations, members: list[NDArray[np.intp]], chosen: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return the movement nearest to each that is asked for, among up to 200 of each label."""
    if not len(chosen):
        return chosen
    described = _described(comparison, demos, chosen)
    nearest, alike = np.full(len(chosen), np.inf), np.empty(len(chosen), dtype=np.intp)
    for rows in members:
        some = rows[evenly_spaced(len(rows), _COMPARED)]
        away = distances(comparison.similarity.log_average(described, _described(comparison, demos, some)))
        away[chosen[:, None] == some] = np.inf
        closest = away.argmin(axis=1)
        near = away[np.arange(len(chosen)), closest]
        alike = np.where(near < nearest, some[closest], alike)
        nearest = np.minimum(near, nearest)
    return alike


def outliers_as_data(outliers: Outliers, names: Sequence[str]) -> dict[str, Any]:
    """Return nested lists and dictionaries, with the names of the movements."""
    rows = [
        {
            "movement": names[outlier.index], "label": outlier.label,
            "ratio": outlier.ratio, "p_value": outlier.p_value,
            "most_like": names[outlier.most_like], "label_of_most_like": outlier.label_of_most_like,
        }
        for outlier in outliers.outliers
    ]  # fmt: skip
    return {"checked": outliers.checked, "error_rate": outliers.error_rate, "outliers": rows}


def outliers_as_words(outliers: Outliers, names: Sequence[str]) -> str:
    """Return a table, the most unlike first; empty if no movement was checked."""
    if not outliers.checked:
        return ""
    if not outliers.outliers:
        return f"no outliers: none of {counted(outliers.checked, 'movement')} is unlike the others of its label"
    title = (
        f"outliers: {len(outliers.outliers):,} of {counted(outliers.checked, 'movement')} unlike the others of their "
        f"label (about {100 * outliers.error_rate:.2g} % of those listed are false alarms)"
    )
    rows = [
        (
            printable(names[outlier.index]),
            printable(str(outlier.label)),
            f"{outlier.ratio:.1f} times",
            f"{outlier.p_value:.1g}",
            printable(f"{names[outlier.most_like]} ({outlier.label_of_most_like})"),
        )
        for outlier in outliers.outliers[:_SHOWN]
    ]
    more = len(outliers.outliers) - _SHOWN
    table = to_text(Table(title, ("movement", "label", "farther than usual", "p-value", "most like"), rows))
    return f"{table}\nand {more:,} more" if more > 0 else table

"""Classifiers on the averaged kernel: nearest reference of all or in each representation, prototype, SVM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.coordinates import mean_turn, turns_beyond
from kineme.recognition.conformal import (
    DIMENSIONS,
    EXPONENT,
    class_probabilities,
    comparable_groups,
    distances,
    fit_exponent,
    log_class_probabilities,
)
from kineme.recognition.convolutions import Convolutions, Kernels, convolve, fit_convolutions, series_of, transform
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import N_MEANS, Described
from kineme.similarity.scores import Classifier, Compared, most_similar, nearest_of
from kineme.similarity.similarity import SHARE, AveragedSimilarity
from kineme.similarity.specification import LOG_MEANS, softmax
from kineme.validation import Array

_WIDER = 2.0  # times the width: an impostor then has a similarity of exp(-0.8)
_PENALTY = 1000.0  # similarities are at most 1, so a small penalty would hold every multiplier at its bound
#: Fewest demonstrations of each class with which convolutions join, and most in all.
FEWEST, MOST = 2, 1000
_COMPARED = 500  # demonstrations by which the kernels are judged, at most
#: Share of demonstrations left out that the kernels recognize from which on nothing else is tried. Of other people the
#: kernels then recognize more, but for points that turn together.
_ENOUGH = 0.98
#: Share of the convolutions' probabilities in the pool, and where they recognize so much more of what is left out.
_SHARE, _SHARE_AHEAD, _AHEAD = 0.25, 0.5, 0.01
_SURE = 0.99  # probability of a class by the kernels above which the convolutions would hardly change the answer
#: Share of profiles in the score. Exercises at a wrist gain more from a half, and smooth paths of joints lose from it.
PROFILED = 0.25
#: Shares of recorded values in the score, of which the one is taken by which what is left out is most likely; the first
#: where nothing can be left out. With it exercises, spoken vowels and activities gain 0.01 to 0.14, and coordinates of
#: words and strokes and joints of an arm lose 0.00 to 0.03.
VALUED = (0.15, 0.05, 0.3, 0.5)
#: `EXPONENT` of these: at one demonstration, 3 to 10 were most likely on the coordinates of five sets and on exercises.
#: Written words differ; they are right more often than is said.
_EXPONENT = 8.0
_LEAST = 1e-9  # of a probability by convolutions
_NO_PROFILE = 1e-9  # length of features that are all as their center
_SAME, _COPIES = 1e-3, 1e-12  # width, and squared distance, that are rounding
_CONSTANT, _NOTHING = 1e-9, 1e-14  # spread of a column, for its size and for the largest spread, that is rounding
_ROUNDING = 1e-4  # of the mean of log similarities, as single precision leaves it: nearer ones are equal


@dataclass(frozen=True)
class Nearest(Classifier):
    """Each class scores as its most similar reference: the nearest neighbor by the averaged kernel."""

    def scores(self, compared: Compared) -> Array:
        """Return the logarithm of the largest similarity to a reference of each class."""
        return compared.nearest

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the class of the most similar reference, without the distances that cannot change it."""
        references = compared.references
        chosen = most_similar(compared.comparison.similarity, compared.described, references.described)
        return np.searchsorted(references.first, chosen, side="right") - 1


@dataclass(frozen=True)
class NearestEach(Classifier):
    """Each class scores as the average over representations of its most similar reference in each.

    Of several demonstrations one may have the movement's path, and another its timing: each representation chooses its
    own. With one demonstration of each class this is `Nearest`.
    """

    def scores(self, compared: Compared) -> Array:
        """Return the logarithm of the average of the largest similarities to a reference of each class."""
        return compared.nearest_each

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the index (n,) of the class with the largest score."""
        one_each = len(compared.references) == len(compared.references.classes)
        return Nearest().best(compared) if one_each else super().best(compared)


class ValueScale(NamedTuple):
    """How `recorded_values` of references are centered and scaled; angles lie in the turn around their mean start."""

    near: Array  # (d,), where columns of references start
    periods: Array  # (d,), infinite where recorded values stay
    center: Array  # (d, 9), means
    spread: Array  # (d, 1), standard deviation in all references; infinite of a column that never changes

    @classmethod
    def of(cls, values: Array, periods: Array | None) -> ValueScale:
        """Return that of values (n, d, 9) whose columns wrap by these periods (d,)."""
        near, periods = mean_turn(values[:, :, 0], np.full(values.shape[1], np.inf) if periods is None else periods)
        return cls(near, periods, *_center_and_spread(_in_turn(values, near, periods)))

    def rows(self, values: Array) -> Array:
        """Return rows (n, 9 d) of values (n, d, 9), whose squared distances are means over time, and of deviations."""
        weights = np.append(np.full(N_MEANS, N_MEANS**-0.5), 1.0)
        away = _in_turn(values, self.near, self.periods) - self.center
        return np.asarray((away / self.spread * weights).reshape(len(values), -1))


def _in_turn(values: Array, near: Array, periods: Array) -> Array:
    """Return values (n, d, 9) less whole turns: each recording is unwrapped from its own first sample."""
    turns = turns_beyond(values[:, :, 0], near, periods, most=0.5)
    return np.concatenate((values[:, :, :N_MEANS] - turns[:, :, None], values[:, :, N_MEANS:]), axis=2)


class Values(NamedTuple):
    """Rows of `recorded_values` of the references in units of each column's spread, and their share of the score."""

    scale: ValueScale
    rows: Array  # (m, 9 d)
    width: float
    share: float = VALUED[0]


@dataclass(frozen=True, eq=False)
class NearestProfiled(NearestEach):
    """The score is that of `NearestEach`, and shares of two kernels: on profiles, and on recorded values.

    The profile is the features of random convolutions, `convolutions.transform`, centered at the mean of the references
    and of length 1: it tells which details a movement has, wherever they are. So it is for what is never rotated, and
    whose parts may come in another order or number, as those of signals and of sensors. The values are those that were
    recorded, `recorded_values`, in units of their spread: at which level, and how far, a signal goes. Where all levels
    are far from those of the references, they change nothing.
    """

    kernels: Kernels = field(repr=False)
    center: Array = field(repr=False)  # (f,)
    profiles: Array = field(repr=False)  # (m, f)
    width: float
    values: Values | None = field(default=None, repr=False)
    exponent: float = _EXPONENT  # of `class_probabilities`, fitted to these scores

    def scores(self, compared: Compared) -> Array:
        """Return the logarithm of the average of all, (n, C)."""
        others = [nearest_of(logs, compared.references) for logs in self._others(compared)]
        return self._averaged(compared.nearest_each, others)

    def nearest_logs(self, compared: Compared) -> Array:
        """Return log similarity (n, C), by all kernels, to the nearest reference of each class."""
        return nearest_of(self._averaged(compared.log_average, self._others(compared)), compared.references)

    def logs_among(self, logs: Array, chosen: NDArray[np.intp]) -> Array:
        """Return log similarities (k, m) of chosen references to all, by all kernels."""
        return self._averaged(logs, self._of_references(chosen))

    def scores_without(self, left_out: LeftOut, references: References) -> Array:
        """Return scores (k, C) of references that are left out."""
        shown = [np.where(left_out.hidden, -np.inf, logs) for logs in self._of_references(left_out.chosen)]
        return self._averaged(left_out.scores, [nearest_of(logs, references) for logs in shown])

    def _others(self, compared: Compared) -> list[Array]:
        """Return logarithms (n, m) of the kernels on profiles and, where there are some, on values; computed once."""
        by, others = vars(compared).get("others", (None, []))
        if by is not self:
            own, values = self.values, compared.described.values
            profiles = _profiles(transform(series_of(compared.described), self.kernels), self.center)
            rows = None if own is None or values is None else own.scale.rows(values)
            others = self._logs(profiles, rows)
            vars(compared)["others"] = self, others
        return others

    def _of_references(self, chosen: NDArray[np.intp]) -> list[Array]:
        """Return the same of chosen references, (k, m)."""
        return self._logs(self.profiles[chosen], None if self.values is None else self.values.rows[chosen])

    def _logs(self, profiles: Array, rows: Array | None) -> list[Array]:
        logs = [_log_kernel(2.0 - 2.0 * (profiles @ self.profiles.T), self.width)]
        if rows is not None and self.values is not None:
            logs.append(_log_kernel(_squares(rows, self.values.rows), self.values.width))
        return logs

    def _averaged(self, by_kernels: Array, others: list[Array]) -> Array:
        """Return the logarithm of the average, with a share of profiles, and one of values."""
        for logs, share in zip(others, (PROFILED, self.values.share if self.values else 0.0), strict=False):
            by_kernels = np.logaddexp(np.log(1.0 - share) + by_kernels, np.log(share) + logs)
        return by_kernels

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the index (n,) of the class with the largest score."""
        return self.scores(compared).argmax(axis=1)

    def probabilities(self, scores: Array) -> Array:
        """Return the probability of each class, (n, C)."""
        return class_probabilities(scores, self.exponent)


def _log_kernel(squares: Array, width: float) -> Array:
    """Return the logarithm of a Gaussian of squared distances."""
    return np.asarray(-0.5 * np.maximum(squares, 0.0) / width**2)


def _squares(rows: Array, others: Array) -> Array:
    """Return squared distances (n, m)."""
    return np.asarray((rows**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2.0 * rows @ others.T)


@dataclass(frozen=True, eq=False)
class LogarithmicPool(Classifier):
    """Each class scores ``(1 - s) log p + s log q``: p its probability by the kernels, q that by the convolutions.

    p is `class_probabilities` at the `exponent`, of kernels with profiles or without, and s the `share`. Where one p is
    above 0.99, the score is log p: most movements then need no convolutions.

    Source: C. Genest, J. Zidek, "Combining probability distributions: a critique and an annotated bibliography",
    Statistical Science 1, 1986 (the logarithmic opinion pool).
    """

    nearest: NearestEach
    convolutions: Convolutions
    share: float
    exponent: float

    def scores(self, compared: Compared) -> Array:
        """Return the logarithms of the pooled probabilities, (n, C), but for a constant of each movement."""
        scores = log_class_probabilities(self.nearest.scores(compared), self.exponent)
        unsure = np.flatnonzero(scores.max(axis=1) <= np.log(_SURE))
        if len(unsure):
            some = replace(compared, described=compared.described.take(unsure))
            by_convolutions = self.convolutions.probabilities(self.convolutions.scores(some))
            pooled = self.share * np.log(np.maximum(by_convolutions, _LEAST))
            scores[unsure] = (1.0 - self.share) * scores[unsure] + pooled
        return scores

    def nearest_logs(self, compared: Compared) -> Array:
        """Return those of what is pooled with the convolutions."""
        return self.nearest.nearest_logs(compared)

    def logs_among(self, logs: Array, chosen: NDArray[np.intp]) -> Array:
        """Return those of what is pooled with the convolutions."""
        return self.nearest.logs_among(logs, chosen)

    def probabilities(self, scores: Array) -> Array:
        """Return the probability of each class, (n, C)."""
        return softmax(scores, axis=1)


@dataclass(frozen=True, eq=False)
class Prototype(Classifier):
    """Each class is its medoid: the reference most similar to the others of its class.

    Attributes
    ----------
    medoids : ndarray of shape (C,)
        Indices of the references.
    described : Described
        The medoids.
    """

    medoids: NDArray[np.intp]
    described: Described

    def scores(self, compared: Compared) -> Array:
        """Return the logarithm of the similarity to each class's medoid."""
        return compared.comparison.similarity.log_average(compared.described, self.described)

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the class of the most similar medoid."""
        return most_similar(compared.comparison.similarity, compared.described, self.described)


@dataclass(frozen=True, eq=False)
class SupportVectors(Classifier):
    """scikit-learn's SVM on the averaged kernel, one class against the others.

    The kernels are twice as wide as for the nearest neighbor, which should depend on the closest movement alone. An SVM
    combines many movements, which needs similarities of different demonstrations that are not almost zero.
    """

    similarity: AveragedSimilarity  # with the wider kernels
    model: Any

    def scores(self, compared: Compared) -> Array:
        """Return the SVM's decision values; of two classes, the negative and the positive one."""
        gram = np.exp(LOG_MEANS[self.similarity.mean](self.similarity.logs_at(compared.squares)))
        values = np.asarray(self.model.decision_function(gram))
        return np.column_stack((-values, values)) if values.ndim == 1 else values


def fit_prototype(comparison: Comparison, references: References) -> Prototype:
    """Choose the medoid of each class: the largest mean log similarity to the others, of equal ones the first."""
    medoids = []
    for rows in references.slices():
        own = references.described.take(rows)
        logs = comparison.similarity.log_average(own, own)
        logs = 0.5 * (logs + logs.T)  # of a pair, the two orders round differently
        np.fill_diagonal(logs, 0.0)
        means = logs.sum(axis=1) / max(1, len(logs) - 1)
        medoids.append(rows.start + int(np.argmax(means >= means.max() - _ROUNDING)))
    chosen = np.array(medoids)
    return Prototype(chosen, references.described.take(chosen))


def fit_support_vectors(comparison: Comparison, references: References) -> SupportVectors:
    """Fit an SVM to the Gram matrix of the references.

    Raises `SpecificationError`: references of one class.
    """
    from sklearn.svm import SVC

    if len(references.classes) == 1:
        raise SpecificationError(
            f"expected movements of two or more classes for classifier='svm', got one class, "
            f"{references.classes[0]!r}; add movements of another class, or pass classifier='nearest'"
        )

    similarity = comparison.similarity.widened(_WIDER)
    gram = np.exp(similarity.log_average(references.described, references.described))
    numbers = np.repeat(np.arange(len(references.classes)), references.counts)  # labels may be any, as 0.5
    model = SVC(kernel="precomputed", C=_PENALTY, decision_function_shape="ovr").fit(gram, numbers)
    return SupportVectors(similarity, model)


def _profiles(features: Array, center: Array) -> Array:
    """Return features of random convolutions less their center, at length 1, (n, f)."""
    away = features - center
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), _NO_PROFILE))


class LeftOut(NamedTuple):
    """References, each compared with those of other groups alone."""

    chosen: NDArray[np.intp]  # (k,), which references
    scores: Array  # (k, C) of `NearestEach`, -inf without others
    hidden: NDArray[np.bool_]  # (k, m), pairs that are not compared
    owners: NDArray[np.intp]  # (k,), their classes
    n_others: NDArray[np.intp]  # (k,), how many others of their class they are compared with


def fit_profiled(references: References, left_out: LeftOut, convolved: tuple[Kernels, Array]) -> NearestEach:
    """Return the kernels with profiles and values of the references; widths are chosen as for representations.

    Without profiles where most have a copy in another class, which leaves a width of rounding, or there is one class.
    """
    kernels, features = convolved
    center = features.mean(axis=0)
    profiles = _profiles(features, center)
    width = _width(2.0 - 2.0 * (profiles @ profiles.T), references)
    if not _SAME < width < np.inf:
        return NearestEach()
    profiled = NearestProfiled(kernels, center, profiles, width, _values(references))
    tried = [profiled]
    if profiled.values is not None and references.counts.min() >= FEWEST:
        tried = [replace(profiled, values=profiled.values._replace(share=share)) for share in VALUED]
    fits = [_fitted_exponent(each, references, left_out) for each in tried]
    best = max(range(len(fits)), key=lambda k: fits[k][1])  # of the most likely the first
    return replace(tried[best], exponent=fits[best][0])


def _width(squares: Array, references: References) -> float:
    """Return the width of a kernel: a share of the median distance to the nearest of another class."""
    same = references.labels[:, None] == references.labels
    apart = np.sqrt(np.maximum(np.where(same, np.inf, squares).min(axis=1), 0.0))
    return SHARE * float(np.median(apart))


def _values(references: References) -> Values | None:
    """Return the recorded values of the references; None where they tell classes no more apart than rounding does."""
    values = references.described.values
    if values is None:
        return None
    scale = ValueScale.of(values, references.described.periods)
    rows = scale.rows(values)
    width = _width(_squares(rows, rows), references)
    return Values(scale, rows, width) if _SAME < width < np.inf else None


def _center_and_spread(values: Array) -> tuple[Array, Array]:
    """Return means (d, 9) of values (n, d, 9), and the standard deviation (d, 1) of each column in all of them."""
    spread = np.sqrt((values[:, :, -1] ** 2).mean(axis=0) + values[:, :, :-1].mean(axis=2).var(axis=0))
    size = np.abs(values).max(axis=(0, 2))
    spread[spread <= np.maximum(_CONSTANT * size, _NOTHING * spread.max())] = np.inf
    return values.mean(axis=0), spread[:, None]


def squares_beside_kernels(described: Described) -> tuple[Array, Array]:
    """Return weights (k,) beside the kernels, which have the rest, and squared distances (k, n, n), 0 if rounding.

    Of signals and sensors those of profiles and of values, see `NearestProfiled`; of other movements k is 0.
    """
    if described.values is None:
        return np.empty(0), np.empty((0, len(described), len(described)))
    features = convolve(described)[1]
    profiles = _profiles(features, features.mean(axis=0))
    values = ValueScale.of(described.values, described.periods).rows(described.values)
    squares = np.stack([_squares(rows, rows) for rows in (profiles, values)])
    return np.array([PROFILED, VALUED[0]]), np.where(squares > _COPIES, squares, 0.0)


def fit_best(comparison: Comparison, references: References, groups: NDArray[np.intp] | None = None) -> Classifier:
    """Return the kernels, of two demonstrations of each class and more pooled with convolutions if they need help.

    Convolutions are for movements that are compared in detail and not rotated there. Signals, and more than three
    columns that are no points, have profiles and values beside the kernels, if there are few or many.
    """
    pairs, rotated = references.described.pairs, comparison.procrustes.max_angle > 0
    in_detail = pairs is not None and pairs.details is not None and (pairs.upright or not rotated)
    able = in_detail and comparison.normalization.translation
    n_classes = len(references.classes)
    if not able or n_classes < 2 or len(references) > MOST:
        return NearestEach()
    profiled = not rotated and comparison.n_dims not in (2, 3) and comparison.mean == "arithmetic"
    one_each = references.counts.min() < FEWEST
    if one_each and not profiled:
        return NearestEach()
    chosen = evenly_spaced(len(references), _COMPARED)
    logs = comparison.similarity.logs(references.described.take(chosen), references.described)
    groups = comparable_groups(groups)
    by_groups = _left_out(comparison, references, chosen, logs, groups)
    convolved = convolve(references.described) if profiled else None
    nearest = NearestEach() if convolved is None else fit_profiled(references, by_groups, convolved)
    if one_each:
        return nearest
    alone = by_groups if groups is None else _left_out(comparison, references, chosen, logs, None)
    by_kernels = float((alone.scores.argmax(axis=1) == alone.owners).mean())
    if by_kernels >= _ENOUGH and comparison.procrustes.n_points == 1:
        return nearest
    convolutions, by_convolutions = fit_convolutions(comparison, references, convolved)
    share = _SHARE_AHEAD if by_convolutions >= by_kernels + _AHEAD else _SHARE
    if isinstance(nearest, NearestProfiled):
        return LogarithmicPool(nearest, convolutions, share, nearest.exponent)
    return LogarithmicPool(nearest, convolutions, share, _fitted_exponent(nearest, references, by_groups)[0])


def _fitted_exponent(nearest: NearestEach, references: References, left_out: LeftOut) -> tuple[float, float]:
    """Return the exponent by which references are most likely, left out with their group, and how likely they are.

    See `fit_exponent`.
    """
    _, scores, _, owners, n_others = left_out
    if isinstance(nearest, NearestProfiled):
        scores = nearest.scores_without(left_out, references)
    away = distances(scores)
    # As `calibrate` does: with all demonstrations of the class, the nearest would be somewhat nearer.
    away[np.arange(len(owners)), owners] *= (np.maximum(n_others, 1) / references.counts[owners]) ** (1 / DIMENSIONS)
    prior = _EXPONENT if isinstance(nearest, NearestProfiled) else EXPONENT
    away, owners = away[n_others > 0], owners[n_others > 0]
    exponent = fit_exponent(away, owners, prior)
    logs = log_class_probabilities(-0.5 * away**2, exponent)
    return exponent, float(logs[np.arange(len(owners)), owners].sum())


def _left_out(
    comparison: Comparison,
    references: References,
    chosen: NDArray[np.intp],
    logs: Array,
    groups: NDArray[np.intp] | None,
) -> LeftOut:
    """Compare chosen references, of which logs (R, k, m) are known, with those of other groups."""
    groups = np.arange(len(references)) if groups is None else groups
    hidden = groups[chosen, None] == groups
    each = np.maximum.reduceat(np.where(hidden, -np.inf, logs), references.first, axis=2)
    alone = np.logical_and.reduceat(hidden, references.first, axis=1)
    each[:, alone] = 0.0  # averages of nothing would be NaN
    scores = np.where(alone, -np.inf, LOG_MEANS[comparison.mean](each))
    owners = np.searchsorted(references.first, chosen, side="right") - 1
    n_others = np.add.reduceat(~hidden, references.first, axis=1)[np.arange(len(chosen)), owners]
    return LeftOut(chosen, scores, hidden, owners, n_others)


#: Those in which random convolutions rank the classes, alone or beside the kernels; they tell probabilities, too.
BY_CONVOLUTIONS = (Convolutions, LogarithmicPool, NearestProfiled)

#: Name -> what fits the classifier.
CLASSIFIERS: dict[str, Callable[[Comparison, References], Classifier]] = {
    "nearest": lambda comparison, references: Nearest(),
    "nearest-each": lambda comparison, references: NearestEach(),
    "prototype": fit_prototype,
    "svm": fit_support_vectors,
    "convolutions": lambda comparison, references: fit_convolutions(comparison, references)[0],
}

#: What "auto" stands for where nothing joins the kernels. Of gestures in space by other people, two to eight
#: demonstrations of each class, and of bent handwriting, twelve of each, it is ahead of the nearest by up to 0.01, and
#: of the SVM (``python -m bench --only defaults``).
KERNELS = "nearest-each"


def fit_classifier(
    name: str, comparison: Comparison, references: References, groups: NDArray[np.intp] | None = None
) -> Classifier:
    """Return the classifier of that name, or the one that "auto" stands for; `groups` as in `Recognizer.fit`."""
    return fit_best(comparison, references, groups) if name == "auto" else CLASSIFIERS[name](comparison, references)


def by_kernels(name: str) -> str:
    """Return the name of a classifier, of "auto" that of its kernels alone."""
    return KERNELS if name == "auto" else name

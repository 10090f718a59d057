"""Classifiers on the averaged kernel: nearest reference of all or in each representation, prototype, SVM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.recognition.conformal import (
    DIMENSIONS,
    EXPONENT,
    class_probabilities,
    comparable_groups,
    distances,
    fit_exponent,
    log_class_probabilities,
)
from kineme.recognition.convolutions import Convolutions, Kernels, fit_convolutions, fit_kernels, series_of, transform
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import Described
from kineme.similarity.scores import Classifier, Compared, most_similar
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
#: `EXPONENT` of these: at one demonstration, 3 to 10 were most likely on the coordinates of five sets and on exercises.
#: Written words differ; they are right more often than is said.
_EXPONENT = 8.0
_LEAST = 1e-9  # of a probability by convolutions
_NO_PROFILE, _SAME = 1e-9, 1e-3  # length of features that are all as their center; width that is rounding
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


@dataclass(frozen=True, eq=False)
class NearestProfiled(NearestEach):
    """The score is that of `NearestEach`, and a share of a kernel on profiles, that of the nearest reference.

    The profile is the features of random convolutions, `convolutions.transform`, centered at the mean of the references
    and of length 1: it tells which details a movement has, wherever they are. So it is for what is never rotated, and
    whose parts may come in another order or number, as those of signals and of sensors.
    """

    kernels: Kernels = field(repr=False)
    center: Array = field(repr=False)  # (f,)
    profiles: Array = field(repr=False)  # (m, f)
    width: float
    exponent: float = _EXPONENT  # of `class_probabilities`, fitted to these scores

    def scores(self, compared: Compared) -> Array:
        """Return the logarithm of the average of both, (n, C)."""
        features = transform(series_of(compared.described), self.kernels)
        return self.with_profiles(compared.nearest_each, _profiles(features, self.center), compared.references)

    def with_profiles(
        self, by_kernels: Array, profiles: Array, references: References, hidden: NDArray[np.bool_] | None = None
    ) -> Array:
        """Return scores (n, C), of `by_kernels` and of profiles (n, f) but for pairs with references hidden (n, m)."""
        cosines = profiles @ self.profiles.T
        if hidden is not None:
            cosines[hidden] = -np.inf
        nearest = np.maximum.reduceat(cosines, references.first, axis=1)
        by_profile = (np.minimum(nearest, 1.0) - 1.0) / self.width**2  # the squared distance is 2 - 2 cosines
        return np.logaddexp(np.log(1.0 - PROFILED) + by_kernels, np.log(PROFILED) + by_profile)

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the index (n,) of the class with the largest score."""
        return self.scores(compared).argmax(axis=1)

    def probabilities(self, scores: Array) -> Array:
        """Return the probability of each class, (n, C)."""
        return class_probabilities(scores, self.exponent)


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
    model = SVC(kernel="precomputed", C=_PENALTY, decision_function_shape="ovr").fit(gram, references.labels)
    return SupportVectors(similarity, model)


def _profiles(features: Array, center: Array) -> Array:
    """Return features of random convolutions less their center, at length 1, (n, f)."""
    away = features - center
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), _NO_PROFILE))


def fit_profiled(comparison: Comparison, references: References, groups: NDArray[np.intp] | None = None) -> NearestEach:
    """Return the kernels with profiles of the references; the width is that of any representation, see `SHARE`.

    Without profiles where most have a copy in another class, which leaves a width of rounding, or there is one class.
    """
    series = series_of(references.described)
    kernels = fit_kernels(series)
    features = transform(series, kernels)
    center = features.mean(axis=0)
    profiles = _profiles(features, center)
    cosines = profiles @ profiles.T
    cosines[references.labels[:, None] == references.labels] = -np.inf
    apart = np.sqrt(np.maximum(2.0 - 2.0 * cosines.max(axis=1), 0.0))
    width = SHARE * float(np.median(apart))
    if not _SAME < width < np.inf:
        return NearestEach()
    profiled = NearestProfiled(kernels, center, profiles, width)
    return replace(profiled, exponent=_exponent(profiled, comparison, references, groups))


def fit_best(comparison: Comparison, references: References, groups: NDArray[np.intp] | None = None) -> Classifier:
    """Return the kernels, of two demonstrations of each class and more pooled with convolutions if they need help.

    Convolutions are for movements that are compared in detail and not rotated there. Signals, and more than three
    columns that are no points, have profiles beside the kernels, if there are few or many.
    """
    pairs, rotated = references.described.pairs, comparison.procrustes.max_angle > 0
    in_detail = pairs is not None and pairs.details is not None and (pairs.upright or not rotated)
    able = in_detail and comparison.normalization.translation
    n_classes = len(references.classes)
    if not able or n_classes < 2 or len(references) > MOST:
        return NearestEach()
    profiled = not rotated and comparison.n_dims not in (2, 3) and comparison.mean == "arithmetic"
    nearest = fit_profiled(comparison, references, groups) if profiled else NearestEach()
    if references.counts.min() < FEWEST:
        return nearest
    scores, owners, _ = _left_out(NearestEach(), comparison, references, None)
    by_kernels = float((scores.argmax(axis=1) == owners).mean())
    if by_kernels >= _ENOUGH and comparison.procrustes.n_points == 1:
        return nearest
    convolutions, by_convolutions = fit_convolutions(comparison, references)
    share = _SHARE_AHEAD if by_convolutions >= by_kernels + _AHEAD else _SHARE
    if isinstance(nearest, NearestProfiled):
        return LogarithmicPool(nearest, convolutions, share, nearest.exponent)
    exponent = _exponent(nearest, comparison, references, groups)
    return LogarithmicPool(nearest, convolutions, share, exponent)


def _exponent(
    nearest: NearestEach, comparison: Comparison, references: References, groups: NDArray[np.intp] | None
) -> float:
    """Return the exponent by which references are most likely, left out with their group, see `fit_exponent`."""
    scores, owners, n_others = _left_out(nearest, comparison, references, comparable_groups(groups))
    away = distances(scores)
    # As `calibrate` does: with all demonstrations of the class, the nearest would be somewhat nearer.
    away[np.arange(len(owners)), owners] *= (np.maximum(n_others, 1) / references.counts[owners]) ** (1 / DIMENSIONS)
    prior = _EXPONENT if isinstance(nearest, NearestProfiled) else EXPONENT
    return fit_exponent(away[n_others > 0], owners[n_others > 0], prior)


def _left_out(
    nearest: NearestEach, comparison: Comparison, references: References, groups: NDArray[np.intp] | None
) -> tuple[Array, NDArray[np.intp], NDArray[np.intp]]:
    """Return scores (k, C) of references by those of other groups, -inf without; their classes; numbers of others."""
    chosen = evenly_spaced(len(references), _COMPARED)
    groups = np.arange(len(references)) if groups is None else groups
    hidden = groups[chosen, None] == groups
    logs = comparison.similarity.logs(references.described.take(chosen), references.described)
    logs[:, hidden] = -np.inf
    each = np.maximum.reduceat(logs, references.first, axis=2)
    alone = np.logical_and.reduceat(hidden, references.first, axis=1)
    each[:, alone] = 0.0  # averages of nothing would be NaN
    scores = np.where(alone, -np.inf, LOG_MEANS[comparison.mean](each))
    if isinstance(nearest, NearestProfiled):
        scores = nearest.with_profiles(scores, nearest.profiles[chosen], references, hidden)
    owners = np.searchsorted(references.first, chosen, side="right") - 1
    n_others = np.add.reduceat(~hidden, references.first, axis=1)[np.arange(len(chosen)), owners]
    return scores, owners, n_others


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

#: What "auto" stands for. Of gestures in space by other people, two to eight demonstrations of each class, and of bent
#: handwriting, twelve of each, it is ahead of the nearest by up to 0.01, and of the SVM
#: (``python -m bench --only defaults``).
AUTO = "nearest-each"


def fit_classifier(name: str, comparison: Comparison, references: References) -> Classifier:
    """Return the classifier of that name, or the one that "auto" stands for."""
    return CLASSIFIERS[AUTO if name == "auto" else name](comparison, references)

"""Classifiers on the averaged kernel: nearest reference of all or in each representation, prototype, SVM."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.recognition.convolutions import Convolutions, Kernels, fit_convolutions, fit_kernels, series_of, transform
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import Described
from kineme.similarity.scores import Classifier, Compared, most_similar
from kineme.similarity.similarity import SHARE, AveragedSimilarity
from kineme.similarity.specification import LOG_MEANS
from kineme.validation import Array

_WIDER = 2.0  # times the width: an impostor then has a similarity of exp(-0.8)
_PENALTY = 1000.0  # similarities are at most 1, so a small penalty would hold every multiplier at its bound
#: Fewest demonstrations of each class with which convolutions are considered, and most in all.
FEWEST, MOST = 8, 1000
_COMPARED = 500  # demonstrations by which the kernels are judged, at most
#: Share of demonstrations left out that the kernels recognize from which on nothing else is tried, and by how much
#: more the convolutions must recognize: on five of seven sets of people's movements the kernels are ahead.
_ENOUGH, _AHEAD = 0.97, 0.01
#: Share of profiles in the score. Exercises at a wrist gain more from a half, and smooth paths of joints lose from it.
PROFILED = 0.25
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

    def scores(self, compared: Compared) -> Array:
        """Return the logarithm of the average of both, (n, C)."""
        features = transform(series_of(compared.described), self.kernels)
        cosines = _profiles(features, self.center) @ self.profiles.T
        nearest = np.maximum.reduceat(cosines, compared.references.first, axis=1)
        by_profile = (np.minimum(nearest, 1.0) - 1.0) / self.width**2  # the squared distance is 2 - 2 cosines
        return np.logaddexp(np.log(1.0 - PROFILED) + compared.nearest_each, np.log(PROFILED) + by_profile)

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the index (n,) of the class with the largest score."""
        return self.scores(compared).argmax(axis=1)


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


def fit_profiled(references: References) -> NearestEach:
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
    return NearestProfiled(kernels, center, profiles, width) if _SAME < width < np.inf else NearestEach()


def fit_best(comparison: Comparison, references: References) -> Classifier:
    """Return the convolutions where they recognize clearly more of the demonstrations left out, else the kernels.

    Considered from eight demonstrations of each class on, of movements that are compared in detail and not rotated.
    Signals, and more than three columns that are no points, have profiles beside the kernels, if there are few or many.
    """
    pairs, rotated = references.described.pairs, comparison.procrustes.max_angle > 0
    in_detail = pairs is not None and pairs.details is not None and (pairs.upright or not rotated)
    able = in_detail and comparison.normalization.translation
    n_classes = len(references.classes)
    if not able or n_classes < 2 or len(references) > MOST:
        return NearestEach()
    if references.counts.min() >= FEWEST and (by_kernels := _recognized_left_out(comparison, references)) < _ENOUGH:
        fitted, by_convolutions = fit_convolutions(comparison, references)
        if by_convolutions >= by_kernels + _AHEAD:
            return fitted
    profiled = not rotated and comparison.n_dims not in (2, 3) and comparison.mean == "arithmetic"
    return fit_profiled(references) if profiled else NearestEach()


def _recognized_left_out(comparison: Comparison, references: References) -> float:
    """Return the share of references that the kernels recognize by the others."""
    chosen = evenly_spaced(len(references), _COMPARED)
    logs = comparison.similarity.logs(references.described.take(chosen), references.described)
    logs[:, np.arange(len(chosen)), chosen] = -np.inf
    scores = LOG_MEANS[comparison.mean](np.maximum.reduceat(logs, references.first, axis=2))
    owners = np.searchsorted(references.first, chosen, side="right") - 1
    return float((scores.argmax(axis=1) == owners).mean())


#: Those in which random convolutions rank the classes, alone or beside the kernels.
BY_CONVOLUTIONS = (Convolutions, NearestProfiled)

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

"""From similarities to a score per class: nearest demonstration, nearest prototype, support vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.procrustes import Prepared
from kineme.validation import Array

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_MANY = 8  # demonstrations of every class, from which on "auto" takes the SVM
_LARGEST_GRAM = 4000  # demonstrations; beyond, "auto" keeps memory linear in them
_WIDER = 2.0  # times the width: an impostor counts exp(-1)
_PENALTY = 1000.0  # similarities are at most 1, so a small penalty would hold every multiplier at its bound


class Classifier(Protocol):
    """What a recognizer needs of a classifier."""

    def fit(self, recognizer: Recognizer) -> None:
        """Learn from the stored views and labels of a recognizer."""
        ...

    def scores(self, recognizer: Recognizer, seen: tuple[Prepared, ...]) -> Array:
        """A score per class, shape (n, C)."""
        ...


class Nearest:
    """The most similar demonstration of each class speaks for it: 1-NN on the averaged kernel."""

    def fit(self, recognizer: Recognizer) -> None:
        """Nothing to learn."""

    def scores(self, recognizer: Recognizer, seen: tuple[Prepared, ...]) -> Array:
        """Logarithm of the largest similarity to a demonstration of each class."""
        logs = recognizer.similarity_.log_average(seen, recognizer.views_)
        return np.asarray(np.maximum.reduceat(logs, recognizer.first_, axis=1))


class Prototype:
    """Each class is its medoid: the demonstration most similar to the others of its class."""

    def fit(self, recognizer: Recognizer) -> None:
        """Choose the medoid of each class."""
        ends = [*recognizer.first_[1:], len(recognizer.labels_)]
        medoids = []
        for start, end in zip(recognizer.first_, ends, strict=True):
            own = tuple(one.take(slice(start, end)) for one in recognizer.views_)
            medoids.append(start + int(recognizer.similarity_.log_average(own, own).mean(axis=1).argmax()))
        self.medoids_ = np.array(medoids)
        self.views_ = tuple(one.take(self.medoids_) for one in recognizer.views_)

    def scores(self, recognizer: Recognizer, seen: tuple[Prepared, ...]) -> Array:
        """Logarithm of the similarity to each class's medoid."""
        return recognizer.similarity_.log_average(seen, self.views_)


class SupportVectors:
    """scikit-learn's SVM on the averaged kernel, one class against the rest.

    The kernels are twice as wide as for the nearest: there, only the closest movement shall speak; an SVM weighs many,
    and between demonstrations that do not see each other it has nothing to weigh.
    """

    def fit(self, recognizer: Recognizer) -> None:
        """Fit on the Gram matrix of the stored demonstrations."""
        from sklearn.svm import SVC

        self.similarity_ = recognizer.similarity_.widened(_WIDER)
        gram = np.exp(self.similarity_.log_average(recognizer.views_, recognizer.views_))
        self.model_ = SVC(kernel="precomputed", C=_PENALTY, decision_function_shape="ovr")
        self.model_.fit(gram, recognizer.labels_)

    def scores(self, recognizer: Recognizer, seen: tuple[Prepared, ...]) -> Array:
        """The SVM's decision values; of two classes, the negative and the positive one."""
        gram = np.exp(self.similarity_.log_average(seen, recognizer.views_))
        values = np.asarray(self.model_.decision_function(gram))
        return np.column_stack((-values, values)) if values.ndim == 1 else values


#: Name -> classifier.
CLASSIFIERS: dict[str, type[Any]] = {"nearest": Nearest, "prototype": Prototype, "svm": SupportVectors}


def choose(name: str, per_class: NDArray[Any]) -> Classifier:
    """The classifier of that name; "auto" by the number of demonstrations per class."""
    if name == "auto":
        few = len(per_class) == 1 or per_class.min() < _MANY or per_class.sum() > _LARGEST_GRAM
        name = "nearest" if few else "svm"
    chosen: Classifier = CLASSIFIERS[name]()
    return chosen

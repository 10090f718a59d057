"""Rivals that fit a linear classifier: an SVM on the alignment kernel, ridge on random convolutions."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.validation import Array
from kineme_experiments.evaluation.optional import optional_module
from kineme_experiments.evaluation.paths import paths_over_length

_PENALTY = 1000.0  # of the SVM, as in the recognizer of this library: with 1 every multiplier is at its bound
_GAK_POINTS = 100  # its cost is quadratic
_N_POINTS = 200


def _familiarity(values: Array) -> Array:
    """The largest decision value; for two classes there is one value, and its magnitude counts."""
    return np.abs(values) if values.ndim == 1 else values.max(axis=1)


class AlignmentSVM:
    """Global alignment kernel (Cuturi, ICML 2011) of tslearn, its width by tslearn's rule, in an SVM."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        from sklearn.svm import SVC

        self.metrics = optional_module("tslearn.metrics")
        self.stored = self._series(demonstrations)
        self.width = float(self.metrics.sigma_gak(self.stored, random_state=self.seed))
        self.model = SVC(kernel="precomputed", C=_PENALTY)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # many classes with few movements each are intended
            self.model.fit(self._gram(self.stored), require_labels(demonstrations))

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and largest decision value of each movement."""
        gram = self._gram(self._series(demonstrations))
        return np.asarray(self.model.predict(gram)), _familiarity(self.model.decision_function(gram))

    def _gram(self, series: Array) -> Array:
        return np.asarray(self.metrics.cdist_gak(series, self.stored, sigma=self.width))

    @staticmethod
    def _series(demonstrations: Demonstrations) -> Array:
        return np.ascontiguousarray(paths_over_length(demonstrations, _GAK_POINTS).transpose(0, 2, 1))


class MiniRocket:
    """MiniRocket (Dempster et al., KDD 2021) and a ridge classifier, as implemented in aeon."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn from labeled movements."""
        aeon = optional_module("aeon.classification.convolution_based")
        self.model = aeon.MiniRocketClassifier(random_state=self.seed, n_jobs=1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # many classes with few movements each are intended
            self.model.fit(paths_over_length(demonstrations, _N_POINTS), require_labels(demonstrations))

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and largest decision value of each movement."""
        values = self.model.pipeline_.decision_function(paths_over_length(demonstrations, _N_POINTS))
        best = (values > 0).astype(int) if values.ndim == 1 else values.argmax(axis=1)
        return np.asarray(self.model.classes_)[best], _familiarity(values)

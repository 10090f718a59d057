"""Rival that fits a generative model to each class: a hidden Markov model."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.experiments.evaluation.optional import optional_module
from kineme.experiments.evaluation.paths import paths_over_length
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.validation import Array

_N_POINTS = 100
_N_STATES = 10
_MIN_VARIANCE = 1e-2  # for movements of unit size: one demonstration alone has no variance


class HiddenMarkov:
    """One left-to-right HMM per class on centered, scaled positions and their differences; the likeliest class wins."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def fit(self, demonstrations: Demonstrations) -> None:
        """Learn one model per class."""
        self.hmm = optional_module("hmmlearn.hmm")
        logging.getLogger("hmmlearn").setLevel(logging.ERROR)  # it warns when EM steps fall below rounding
        labels = require_labels(demonstrations)
        series = _series(demonstrations)
        self.classes = np.unique(labels)
        self.models = [self._model(series[labels == label]) for label in self.classes]

    def _model(self, series: Array) -> Any:
        n, length, d = series.shape
        model = self.hmm.GaussianHMM(
            _N_STATES, "diag", min_covar=_MIN_VARIANCE, n_iter=10, init_params="", params="tmc", random_state=self.seed
        )
        stay = 1.0 - _N_STATES / length
        model.startprob_ = np.eye(_N_STATES)[0]
        model.transmat_ = stay * np.eye(_N_STATES) + (1.0 - stay) * np.eye(_N_STATES, k=1)
        model.transmat_[-1, -1] = 1.0
        parts = np.array_split(series, _N_STATES, axis=1)  # each state begins as an equal part of the path
        model.means_ = np.array([part.mean(axis=(0, 1)) for part in parts])
        model.covars_ = np.array([part.var(axis=(0, 1)) + _MIN_VARIANCE for part in parts])
        return model.fit(series.reshape(-1, d), [length] * n)

    def classify(self, demonstrations: Demonstrations) -> tuple[NDArray[Any], Array]:
        """Class and log-likelihood of each movement."""
        series = _series(demonstrations)
        likelihood = np.array([[model.score(one) for model in self.models] for one in series])
        return self.classes[likelihood.argmax(axis=1)], likelihood.max(axis=1)


def _series(demonstrations: Demonstrations) -> Array:
    """Positions and their differences, scaled to the size of the positions: (n, T, 2 d)."""
    paths = paths_over_length(demonstrations, _N_POINTS)
    steps = np.gradient(paths, axis=2)
    size = np.sqrt((steps**2).sum(axis=1, keepdims=True).mean(axis=2, keepdims=True))
    steps = steps / np.where(size > 0, size, 1.0)
    return np.ascontiguousarray(np.concatenate((paths, steps), axis=1).transpose(0, 2, 1))

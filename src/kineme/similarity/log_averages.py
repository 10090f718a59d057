"""A-averages of kernels that are given by their logarithms, and the share of each kernel in them.

`kineme.kernels.average` has the same averages of the kernels themselves, with what is proved of each.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kineme.validation import Array


def _log_mean_exp(logs: Array) -> Array:
    top = logs.max(axis=0)
    return np.asarray(np.log(np.mean(np.exp(logs - top), axis=0)) + top)


#: Name -> A-average (paper's reference [10]) of kernels given by their logarithms, over the first axis.
LOG_MEANS: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _log_mean_exp,
    "geometric": lambda logs: np.asarray(logs.mean(axis=0)),
    "harmonic": lambda logs: -_log_mean_exp(-logs),
    "quadratic": lambda logs: 0.5 * _log_mean_exp(2.0 * logs),
    "min": lambda logs: np.asarray(logs.min(axis=0)),
}


def _softmax(logs: Array) -> Array:
    weights = np.exp(logs - logs.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


#: Name -> share of each kernel in the average, d log K / d log k_r: none negative, their sum over the first axis 1.
SHARES: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _softmax,
    "geometric": lambda logs: np.full(logs.shape, 1.0 / len(logs)),
    "harmonic": lambda logs: _softmax(-logs),
    "quadratic": lambda logs: _softmax(2.0 * logs),
    "min": lambda logs: (np.arange(len(logs))[:, None] == logs.argmin(axis=0)).astype(float),
}

"""Whether a movement is over, by its speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.validation import Array

_LEAST_SPREAD = 0.4  # of the logarithm of the speed, where there are few movements
_MOST = 10.0  # of the logarithm of the likelihood ratio: the speed alone settles nothing
#: Logarithm of the odds that a movement is over before its speed is known: about one in 20, as for any other progress.
#: At 0 a movement slows down at a corner and is taken for a whole one of another class, or of a known one.
_PRIOR = -3.0


class Ending(NamedTuple):
    """How fast stored movements are at their end and before it: mean and spread of the logarithm of the speed.

    Speeds are shares of the mean speed so far, see `Prefixes`.
    """

    over: tuple[float, float]
    before: tuple[float, float]

    def log_odds(self, speeds: Array) -> Array:
        """Logarithm of the odds that movements of these speeds are over, between -13 and 7.

        The likelihood ratio of two normal densities, times prior odds of 0.05. Being slower than at a typical end is no
        evidence against one, nor is being faster than typical before the end evidence for one. Where movements were
        recorded at full speed until their last sample, the speed says nothing, and the odds stay near the prior ones.
        """
        too_fast = np.maximum(speeds - self.over[0], 0.0) / self.over[1]
        too_slow = np.minimum(speeds - self.before[0], 0.0) / self.before[1]
        return np.asarray(_PRIOR + np.clip(0.5 * (too_slow**2 - too_fast**2), -_MOST, _MOST))


def ending(speeds: Array) -> Ending:
    """From the speeds (m, G) at the ends of beginnings of m movements, the last of which are whole."""
    return Ending(_moments(speeds[:, -1]), _moments(speeds[:, :-1]))


def _moments(speeds: Array) -> tuple[float, float]:
    return float(speeds.mean()), max(float(speeds.std()), _LEAST_SPREAD)

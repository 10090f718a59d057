"""Whether a movement is over, by its speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.validation import Array

_LEAST_SPREAD = 0.4  # of the logarithm of the speed, where there are few movements
_MOST = 6.0  # the speed alone settles nothing


class Ending(NamedTuple):
    """How fast stored movements are at their end and before it: mean and spread of the logarithm of the speed.

    Speeds are shares of the mean speed so far, see `Prefixes`.
    """

    over: tuple[float, float]
    before: tuple[float, float]

    def log_odds(self, speeds: Array) -> Array:
        """Logarithm of the likelihood ratio that a movement of this speed is over, within -6 and 6.

        Of two normal densities. Being slower than at a typical end is no evidence against one, nor is being faster than
        typical before the end evidence for one. Near 0 at any speed if the movements were recorded at full speed until
        their last sample.
        """
        too_fast = np.maximum(speeds - self.over[0], 0.0) / self.over[1]
        too_slow = np.minimum(speeds - self.before[0], 0.0) / self.before[1]
        return np.asarray(np.clip(0.5 * (too_slow**2 - too_fast**2), -_MOST, _MOST))


def ending(speeds: Array) -> Ending:
    """From the speeds (m, G) at the ends of beginnings of m movements, the last of which are whole."""
    return Ending(_moments(speeds[:, -1]), _moments(speeds[:, :-1]))


def _moments(speeds: Array) -> tuple[float, float]:
    return float(speeds.mean()), max(float(speeds.std()), _LEAST_SPREAD)

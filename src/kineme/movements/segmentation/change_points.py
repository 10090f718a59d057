"""Segmentation at change points of the velocity, with the library ruptures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kineme.errors import SpecificationError
from kineme.movements.segmentation.bouts import Rows, consecutive
from kineme.movements.segmentation.motion import Motion
from kineme.validation import check_count, check_number

_MOST_POINTS = 10_000
_MIN_POINTS = 5  # even points per piece


@dataclass(frozen=True)
class ChangePoints:
    """Cut at change points of the velocity: kernel change-point detection, PELT or dynamic programming.

    The velocity, in peak speeds, is taken at ``n_points`` even times and cut so that the sum of squared distances to
    each piece's mean, in the feature space of a Gaussian kernel, is smallest. Rest, motion there and motion back are
    three regimes; within a bend the velocity changes continuously, and cuts there mean little.

    Parameters
    ----------
    penalty : float, default 0.1
        Cost of one more cut: larger means fewer cuts. Its unit is the cost of one characteristic time, ``sqrt(mean
        squared speed / mean squared acceleration)``, spent unlike the rest of the piece; so neither the tempo nor the
        length of the recording matters. Not used with ``n_pieces``.
    n_pieces : int, optional
        The number of pieces, if it is known; pieces at rest count.
    n_points : int, default 1000
        Time resolution; the cost grows with its square. At most 10,000.

    References
    ----------
    S. Arlot, A. Celisse, Z. Harchaoui, "A kernel multiple change-point algorithm via model selection", Journal of
    Machine Learning Research 20, 2019.
    """

    penalty: float = 0.1
    n_pieces: int | None = None
    n_points: int = 1000

    def __post_init__(self) -> None:
        check_number("penalty", self.penalty, above=0.0)
        check_count("n_points", self.n_points, 2 * _MIN_POINTS, most=_MOST_POINTS)
        if self.n_pieces is not None:
            check_count("n_pieces", self.n_pieces, 1)
            if self.n_pieces * _MIN_POINTS > self.n_points:
                raise SpecificationError(
                    f"expected n_points of at least {_MIN_POINTS} per piece, got {self.n_points} for "
                    f"{self.n_pieces} pieces"
                )

    @property
    def resolution(self) -> float:
        """Share of the peak speed that must be distinguished from rest."""
        return 0.05

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        t = motion.times - motion.times[0]
        even = np.linspace(0.0, t[-1], self.n_points)
        velocity = np.gradient(motion.positions, t, axis=0) / motion.peak
        signal = np.column_stack([np.interp(even, t, column) for column in velocity.T])
        detector = _ruptures().KernelCPD(kernel="rbf", min_size=_MIN_POINTS, params={"gamma": 1.0}).fit(signal)
        if self.n_pieces == 1:
            return np.zeros(0, dtype=np.intp)
        if self.n_pieces is not None:
            breakpoints = detector.predict(n_bkps=self.n_pieces - 1)
        else:
            acceleration = np.gradient(velocity, t, axis=0)
            characteristic = np.sqrt((velocity**2).sum() / (acceleration**2).sum())
            breakpoints = detector.predict(pen=self.penalty * float(characteristic) / even[1])
        rows = np.searchsorted(t, even[np.array(breakpoints[:-1], dtype=np.intp)])
        return np.unique(rows[(rows > 0) & (rows < len(t) - 1)])

    def pieces(self, motion: Motion) -> Rows:
        """The pieces between cuts that move most of the time, rows (n, 2)."""
        pieces = consecutive(self.inner_cuts(motion), len(motion.times))
        fast = motion.speed > 2.0 * max(self.resolution * motion.peak, 2.0 * motion.noise)
        return pieces[2 * np.add.reduceat(fast, pieces[:, 0], dtype=np.intp) > pieces[:, 1] - pieces[:, 0]]


def _ruptures() -> Any:
    try:
        import ruptures  # type: ignore[import-untyped, import-not-found, unused-ignore]
    except ImportError:
        raise SpecificationError(
            'expected the library ruptures for by="change-points", found none; '
            'pip install "kineme[segmentation]", or choose by="rest" or by="speed"'
        ) from None
    return ruptures

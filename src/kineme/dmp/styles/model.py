"""Movements as points of a style space of few dimensions: back and forth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.styles.metrics import compared
from kineme.dmp.styles.parameters import from_numbers, to_numbers
from kineme.errors import SpecificationError
from kineme.movements.channels.alike import check_alike
from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.validation import Array, as_numbers, check_count

_SLACK = 1e-9  # of the range: a demonstrated style is inside, whatever the rounding


class StyleEstimate(NamedTuple):
    """Styles recovered from n movements."""

    styles: Array  # (n, J)
    residuals: Array  # (n,), root mean square over time of what the styles do not explain, in the metric's unit
    inside: NDArray[np.bool_]  # (n,), whether within the demonstrated range


@dataclass(frozen=True, eq=False)
class StyleModel:
    """Primitives of one label as a function of a style s of J numbers; made by `learn_styles`.

    Every number of a primitive is affine in s, ``theta(s) = mean + s @ basis``, so styles mix like the
    demonstrations' paths do; ln tau is affine in s too. Style zero is the average.

    Attributes
    ----------
    styles : ndarray of shape (n, J)
        Of the demonstrations; each column has mean 0 and mean square 1.
    singular_values : ndarray of shape (min(n, d T),)
        Of all styles that could be told apart, not of the J kept ones only.
    recorded_as : RecordedAs or None
        Channels of the recordings, where they are known; see `channels`.
    """

    dmp: DMP
    metric: str
    styles: Array
    singular_values: Array
    mean: Array  # (d, N + 3), theta of style zero
    basis: Array  # (J, d, N + 3)
    duration: float  # tau of style zero [s]
    tempo_basis: Array  # (J,), change of ln tau
    directions: Array  # (J, d T), change of what the metric compares
    label: Any = None
    recorded_as: RecordedAs | None = None

    @property
    def channels(self) -> Channels | None:
        """What was recorded, where that is known; see `Demonstrations.channels`."""
        return None if self.recorded_as is None else self.recorded_as.channels

    @property
    def n_styles(self) -> int:
        """Number of style parameters J."""
        return len(self.basis)

    @property
    def explained_variance(self) -> Array:
        """Share of the demonstrations' variance, in the metric, for each singular value; the first J are kept."""
        return self.singular_values**2 / np.sum(self.singular_values**2)

    @property
    def lowest(self) -> Array:
        """Smallest demonstrated value of each style parameter, shape (J,)."""
        return self.styles.min(axis=0)

    @property
    def highest(self) -> Array:
        """Largest demonstrated value of each style parameter, shape (J,)."""
        return self.styles.max(axis=0)

    def primitive(self, style: ArrayLike, extrapolate: bool = False) -> Primitives:
        """One primitive for each style.

        Parameters
        ----------
        style : array_like of shape (J,) or (m, J)
        extrapolate : bool, default False
            Allow styles outside the demonstrated range: the box between `lowest` and `highest`. Its corners need
            not have been demonstrated either.

        Raises
        ------
        SpecificationError
            Styles of another number of parameters, not finite, or outside the range.
        """
        s = self._as_styles(style)
        outside = ~self._inside(s)
        if not extrapolate and outside.any():
            i = int(np.argmax(outside.any(axis=1)))
            j = int(np.argmax(outside[i]))
            raise SpecificationError(
                f"style {i}: expected parameter {j} within the demonstrated range "
                f"[{self.lowest[j]:.3g}, {self.highest[j]:.3g}], got {s[i, j]:.3g}; choose a style inside, demonstrate "
                "such a movement, or pass extrapolate=True"
            )
        theta = self.mean + np.tensordot(s, self.basis, axes=1)
        durations = self.duration * np.exp(s @ self.tempo_basis)
        return from_numbers(self.dmp, theta, durations, self.label, self.recorded_as)

    def interpolate(self, style_a: ArrayLike, style_b: ArrayLike, n: int, extrapolate: bool = False) -> Primitives:
        """`n` primitives at even steps from one style to another, both included; errors as in `primitive`."""
        check_count("n", n, 2)
        a, b = self._as_styles(style_a), self._as_styles(style_b)
        if len(a) != 1 or len(b) != 1:
            raise SpecificationError(f"expected one style at each end, got {len(a)} and {len(b)}")
        return self.primitive(np.linspace(a[0], b[0], n), extrapolate)

    def style_of(self, movements: MovementsLike) -> StyleEstimate:
        """Recover styles by least squares: the style whose movement is closest in the metric.

        Parameters
        ----------
        movements : Primitives, or movements as `DMP.learn` takes them
            Place and tempo do not matter.

        Returns
        -------
        StyleEstimate
            Styles, residuals and whether they are inside the demonstrated range.

        Raises
        ------
        SpecificationError
            Primitives of another specification or dimension than the demonstrations'.
        """
        primitives = movements if isinstance(movements, Primitives) else self.dmp.learn(movements)
        if primitives.dmp != self.dmp:
            raise SpecificationError(
                f"expected primitives of the model's own specification, {self.dmp}, got {primitives.dmp}; pass the "
                "movements themselves and they are learned with it"
            )
        if primitives.n_dims != len(self.mean):
            raise SpecificationError(f"expected movements of {len(self.mean)} dimensions, got {primitives.n_dims}")
        ours = None if self.recorded_as is None else self.recorded_as.moving
        check_alike([ours, primitives.moving_channels], "movement")
        rest = compared(self.metric, self.dmp, to_numbers(primitives) - self.mean)
        styles = rest @ (self.directions / np.sum(self.directions**2, axis=1, keepdims=True)).T  # they are orthogonal
        residuals = np.linalg.norm(rest - styles @ self.directions, axis=1)
        return StyleEstimate(styles, residuals, np.all(self._inside(styles), axis=1))

    def _as_styles(self, style: ArrayLike) -> Array:
        s = np.atleast_2d(as_numbers(style, "style"))
        if s.ndim != 2 or s.shape[1] != self.n_styles:
            raise SpecificationError(
                f"expected style of shape ({self.n_styles},) or (m, {self.n_styles}), got shape {np.shape(style)}"
            )
        if not np.isfinite(s).all():
            i = int(np.argmin(np.isfinite(s).all(axis=1)))
            raise SpecificationError(f"style {i}: expected finite numbers, got {s[i].tolist()}")
        return s

    def _inside(self, s: Array) -> NDArray[np.bool_]:
        slack = _SLACK * (self.highest - self.lowest)
        return (s >= self.lowest - slack) & (s <= self.highest + slack)

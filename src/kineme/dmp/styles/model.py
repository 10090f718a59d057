"""The styles in which several demonstrations differ: movements as points of a space of few dimensions, back and forth.

Source: T. Matsubara, S. Hyon and J. Morimoto, "Learning Parametric Dynamic Movement Primitives from Multiple
Demonstrations", Neural Networks 24(5), 2011; the paper's reference [6]. From there: f is a sum of few basis targets,
the leading singular vectors over the demonstrations, and start and goal follow from the style by regression. Our
choices: the mean is taken out first, so that style zero is the average; initial velocity and duration follow from the
style as well; and by default the path is decomposed (``metric="path"``), for f is dominated by accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.operators import forcing_matrix
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.styles import parameters
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array, as_numbers, check_choice, check_count, check_number

METRICS = ("path", "forcing")


def compared(metric: str, dmp: DMP, theta: Array) -> Array:
    """Rows (n, d T) of what the styles explain: paths minus their start, or f times its scale, per sqrt(T)."""
    if metric == "path":
        matrix = parameters.path_matrix(dmp, dmp.n_points)
        matrix[-3] -= 1.0
    else:
        matrix = np.vstack((forcing_matrix(dmp, dmp.n_points).T, np.zeros((3, dmp.n_points))))
    return parameters.map_rows(theta, matrix / np.sqrt(dmp.n_points)).reshape(len(theta), -1)


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

    - `styles` (n, J): of the demonstrations; each column has mean 0 and mean square 1.
    - `singular_values` (min(n, d T),): of all styles that could be told apart, not of the J kept ones only.
    - `recorded_as`: channels of the recordings, where they are known; see `channels`.
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
        """Channels of the recordings, where they are known; see `Demonstrations.channels`."""
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
        return parameters.from_numbers(self.dmp, theta, durations, self.label, self.recorded_as)

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

        Raises
        ------
        SpecificationError
            Primitives of another specification or dimension than the demonstrations'.
        """
        ours = None if self.recorded_as is None else self.recorded_as.moving
        remedy = "; pass the movements themselves and they are learned with it"
        primitives = parameters.of_kind(movements, self.dmp, len(self.mean), ours, "the model's own", remedy)
        rest = compared(self.metric, self.dmp, parameters.to_numbers(primitives) - self.mean)
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


def learn_styles(
    primitives: Primitives | MovementsLike,
    n_styles: int | None = None,
    *,
    variance: float | None = None,
    metric: str = "path",
) -> StyleModel:
    """Find the J directions in which the demonstrations differ most.

    With X the rows of what the metric compares, minus their mean, ``X = U S V^T`` is cut after J terms. The styles of
    the demonstrations are the columns of U times ``sqrt(n)``; each number of the primitives is regressed on them.
    Neither sign nor order depends on the order of demonstrations: the largest change that a style makes is positive.

    Parameters
    ----------
    primitives : Primitives, or movements as `DMP.learn` takes them
        n demonstrations of one movement; what is not learned yet is learned as ``DMP()`` does.
    n_styles : int, optional
        Number J of style parameters.
    variance : float, optional
        Or the share of the variance to explain, by the fewest styles that do; 0.95 if neither is given.
    metric : {"path", "forcing"}, default "path"
        What should be told apart well: paths relative to their start, or forcing terms times their scale.

    Raises
    ------
    TrajectoryError
        Fewer than two demonstrations, or all the same.
    SpecificationError
        More styles than the demonstrations can tell apart; both `n_styles` and `variance`; a parameter out of range.
    """
    primitives = parameters.as_primitives(primitives)
    check_choice("metric", metric, list(METRICS))
    if len(primitives) < 2:
        raise TrajectoryError(f"expected at least 2 demonstrations to learn styles from, got {len(primitives)}")
    theta = parameters.to_numbers(primitives)
    mean = theta[0] + np.mean(theta - theta[0], axis=0)
    U, S, Vt = np.linalg.svd(compared(metric, primitives.dmp, theta - mean), full_matrices=False)
    X, n = compared(metric, primitives.dmp, theta), len(theta)
    rank = int(np.sum(max(X.shape) * np.finfo(float).eps * np.linalg.norm(X) < S))  # the others are rounding
    J = _n_styles(S, rank, n_styles, variance)
    sign = np.sign(np.take_along_axis(Vt[:J], np.argmax(np.abs(Vt[:J]), axis=1)[:, None], axis=1))
    styles = U[:, :J] * sign[:, 0] * np.sqrt(n)
    tempo = np.log(primitives.durations / primitives.durations[0])
    return StyleModel(
        dmp=primitives.dmp,
        metric=metric,
        styles=styles,
        singular_values=S,
        mean=mean,
        # Least squares on orthogonal regressors, styles.T @ styles = n.
        basis=np.tensordot(styles, theta - mean, axes=(0, 0)) / n,
        duration=float(primitives.durations[0] * np.exp(tempo.mean())),
        tempo_basis=styles.T @ (tempo - tempo.mean()) / n,
        directions=sign * Vt[:J] * S[:J, None] / np.sqrt(n),
        label=parameters.shared_label(primitives),
        recorded_as=parameters.shared_recording(primitives),
    )


def _n_styles(S: Array, rank: int, n_styles: int | None, variance: float | None) -> int:
    if rank == 0:
        raise TrajectoryError(
            "expected demonstrations that differ in shape, got copies of one movement (place and tempo are no style); "
            "use average, or demonstrate more of the variety"
        )
    if n_styles is not None and variance is not None:
        raise SpecificationError(f"expected either n_styles or variance, got {n_styles!r} and {variance!r}")
    if n_styles is not None:
        check_count("n_styles", n_styles, 1)
        if n_styles > rank:
            raise SpecificationError(
                f"expected n_styles of at most {rank}, the number of independent differences between the "
                f"demonstrations, got {n_styles}; demonstrate more of the variety or ask for fewer"
            )
        return n_styles
    share = 0.95 if variance is None else variance
    check_number("variance", share, above=0.0)
    if share > 1:
        raise SpecificationError(f"expected variance to be at most 1, a share, got {variance!r}")
    explained = np.cumsum(S**2) / np.sum(S**2)
    return min(rank, int(np.searchsorted(explained, share * (1 - 1e-12))) + 1)

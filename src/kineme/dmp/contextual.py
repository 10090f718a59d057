"""Movements as a function of the task's parameters, as a scikit-learn estimator.

Every smoother here is linear in the demonstrated values y (n,): ``y(c) = w(c) y``, with the same weights for all that a
primitive consists of. With K the covariance of the demonstrations and P their trend, [1, c],

    Q = K^-1 - K^-1 P (P' K^-1 P)^-1 P' K^-1,    w(c) = k(c)' Q + p(c)' (P' K^-1 P)^-1 P' K^-1,

and what the others say about demonstration i is off by ``(Q y)_i / Q_ii`` (O. Dubrule, "Cross Validation of Kriging in
a Unique Neighborhood", Mathematical Geology 15(6), 1983). Least squares is K = I with k(c) = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.styles.parameters import as_primitives, map_rows, path_matrix, to_numbers, with_numbers
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import LARGEST, Array, as_numbers, check_choice, check_number

_SLACK = 1e-9  # of the range: a demonstrated parameter is inside, whatever the rounding
_ALONE = 1e-9  # of the leverage: a demonstration that differs from all others alone

LENGTH_SCALES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
NOISES = (1e-8, 1e-6, 1e-4, 1e-2, 1e-1)

_AS_GOOD, _EXACT = 1.05, 1e-6  # times the least error; times that of ignoring the parameters
REGRESSIONS = ("auto", "linear", "gaussian-process")


class Contextual(BaseEstimator):
    """One primitive for each value of the task's parameters c, learned from demonstrations of some values.

    All that a path depends on linearly, ``theta = [W, x0, g, tau v0]``, and ``ln tau`` are regressed on c, so that
    ``f(s, c) = sum_i psi_i(s) w_i(c) / sum_i psi_i(s)`` is one regression over phase and parameters (Stulp et
    al. 2013), and start, goal and duration follow the task as the shape does (Ude et al. 2010).

    Parameters
    ----------
    dmp : DMP, optional
        How demonstrations are learned; by default ``DMP()``.
    regression : {"auto", "linear", "gaussian-process"}, default "auto"
        Linear in c, or that and a Gaussian process around it; by default linear, unless the process predicts
        demonstrations that are left out better by more than 5 %.
    length_scale : float, optional
        Of the Gaussian process, in standard deviations of the demonstrated parameters; by default the best of some.
    noise : float, optional
        Variance between demonstrations of equal parameters, as a share of the process's; by default the best of some.

    Attributes
    ----------
    dmp_ : DMP
    primitives_ : Primitives
        The n demonstrations.
    parameters_ : ndarray of shape (n, k)
    smoother_ : Smoother
        The regression in force, with its length scale and noise.
    leave_one_out_errors_ : ndarray of shape (n,)
        Root mean square distance between each demonstration and what the others say about its parameters, over the path
        at equal phase, in the unit of the movements.
    leave_one_out_error_ : float
        Their root mean square. It chose the regression, so it is a little smaller than the error of a new task.
    errors_ : dict
        The same of the best of each regression that was tried, and of "average", which ignores the parameters.

    References
    ----------
    A. Ude, A. Gams, T. Asfour and J. Morimoto, "Task-Specific Generalization of Discrete and Periodic Dynamic Movement
    Primitives", IEEE Transactions on Robotics 26(5), 2010: theirs is locally weighted in the shape and a Gaussian
    process in goal and duration; here one regression has both.
    F. Stulp, G. Raiola, A. Hoarau, S. Ivaldi and O. Sigaud, "Learning Compact Parameterized Skills with a Single
    Regression", Humanoids 2013.

    Examples
    --------
    >>> import kineme, numpy as np
    >>> u = np.linspace(0, 1, 100)
    >>> heights = np.array([0.1, 0.2, 0.3, 0.4])
    >>> demos = [np.column_stack((u, h * np.sin(np.pi * u))) for h in heights]
    >>> model = kineme.dmp.Contextual().fit(demos, parameters=heights)
    >>> round(float(model.primitive(0.37).rollout().positions[0, :, 1].max()), 3)
    0.37
    """

    def __init__(
        self,
        dmp: DMP | None = None,
        regression: str = "auto",
        length_scale: float | None = None,
        noise: float | None = None,
    ) -> None:
        self.dmp = dmp
        self.regression = regression
        self.length_scale = length_scale
        self.noise = noise

    def fit(self, movements: Primitives | MovementsLike, parameters: ArrayLike) -> Self:
        """Learn the demonstrations and how they depend on the parameters.

        Parameters
        ----------
        movements : Primitives, or movements as `DMP.learn` takes them
            n demonstrations, more than k + 1.
        parameters : array_like of shape (n,) or (n, k)
            The task of each, in any unit.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used, too few of them, or parameters of another number or shape, not finite, equal
            in all demonstrations or in all but one, or depending on each other.
        SpecificationError
            A parameter of the estimator out of its range.
        """
        check_choice("regression", self.regression, REGRESSIONS)
        if not isinstance(self.dmp, DMP | None):
            raise SpecificationError(f"expected dmp to be a kineme.DMP, got {type(self.dmp).__name__}")
        for name in ("length_scale", "noise"):
            check_number(name, getattr(self, name), above=0.0, optional=True)
        primitives = as_primitives(movements, self.dmp)
        if self.dmp is not None and primitives.dmp != self.dmp:
            raise SpecificationError(f"expected primitives of the specification {self.dmp}, got {primitives.dmp}")
        C = demonstrated_parameters(parameters, len(primitives))
        self.center_, self.scale_ = C.mean(axis=0), C.std(axis=0)
        X = (C - self.center_) / self.scale_
        Y = _compressed_paths(primitives)
        tried = candidates(self.length_scale, self.noise)
        names = list(tried) if self.regression == "auto" else [self.regression]
        best = {
            name: min((solve(smoother, X) for smoother in tried[name]), key=lambda s: _rms(s.left_out(Y)))
            for name in names
        }
        self.errors_ = {name: _rms(best[name].left_out(Y)) for name in names}
        self.errors_["average"] = _rms(solve(Smoother("average"), X).left_out(Y))
        enough = max(_AS_GOOD * min(self.errors_[name] for name in names), _EXACT * self.errors_["average"])
        self._solved = best[next(name for name in names if self.errors_[name] <= enough)]  # the simplest come first
        self.smoother_ = self._solved.smoother
        self.leave_one_out_errors_ = self._solved.left_out(Y)
        self.leave_one_out_error_ = _rms(self.leave_one_out_errors_)
        self.dmp_, self.primitives_, self.parameters_ = primitives.dmp, primitives, C
        return self

    def primitive(self, parameters: ArrayLike, extrapolate: bool = False) -> Primitives:
        """One primitive for each of m tasks, to be used as any others.

        Parameters
        ----------
        parameters : float, or array_like of shape (k,) or (m, k); with one parameter (m,), too
        extrapolate : bool, default False
            Allow parameters outside the demonstrated range: the box between the smallest and the largest of each. Its
            corners need not have been demonstrated either.

        Raises
        ------
        SpecificationError
            Parameters outside the demonstrated range; the message says how far.
        TrajectoryError
            Parameters of another number than the demonstrated ones, or not finite.
        """
        check_is_fitted(self, "primitives_")
        k = self.parameters_.shape[1]
        C = as_numbers(parameters, "parameters")
        C = C.reshape(-1, 1) if k == 1 and C.ndim < 2 else np.atleast_2d(C)
        if C.ndim != 2 or C.shape[1] != k or not len(C):
            raise TrajectoryError(f"expected parameters of shape ({k},) or (m, {k}), got shape {np.shape(parameters)}")
        C = _finite(C)
        if not extrapolate:
            check_range(C, self.parameters_)
        w = self._solved.weights((C - self.center_) / self.scale_)
        theta = np.tensordot(w, to_numbers(self.primitives_), axes=1)
        durations = np.exp(w @ np.log(self.primitives_.durations))
        return with_numbers(self.primitives_, theta, durations)


def _compressed_paths(primitives: Primitives) -> Array:
    """N numbers for each of n paths, whose distances are root mean squares over the path."""
    theta = to_numbers(primitives)
    paths = map_rows(theta - theta.mean(axis=0), path_matrix(primitives.dmp, primitives.dmp.n_points))
    rows = paths.reshape(len(paths), -1) / np.sqrt(primitives.dmp.n_points)
    return np.asarray(np.linalg.qr(rows.T, mode="r")).T


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


@dataclass(frozen=True)
class Smoother:
    """Regression of numbers on parameters.

    "average" has no dependence, "linear" is least squares of [1, c], and "gaussian-process" has the same trend and the
    covariance ``exp(-|c - c'|^2 / (2 l^2))`` around it, of parameters in units of their standard deviation.
    """

    name: str
    length_scale: float | None = None  # l
    noise: float | None = None

    def __str__(self) -> str:
        if self.length_scale is None:
            return self.name
        return f"{self.name}, length scale {self.length_scale:g}, noise {self.noise:g}"


def candidates(length_scale: float | None, noise: float | None) -> dict[str, list[Smoother]]:
    """Name -> the smoothers of that name."""
    lengths = LENGTH_SCALES if length_scale is None else (float(length_scale),)
    noises = NOISES if noise is None else (float(noise),)
    processes = [Smoother("gaussian-process", *settings) for settings in product(lengths, noises)]
    return {"linear": [Smoother("linear")], "gaussian-process": processes}


@dataclass(frozen=True, eq=False)
class Solved:
    """A smoother for n demonstrations of tasks (n, k), parameters in standard deviations."""

    smoother: Smoother
    tasks: Array
    Q: Array  # (n, n)
    trend: Array  # (k + 1 or 1, n), from y to the coefficients of the trend

    def weights(self, tasks: Array) -> Array:
        """w(c), shape (m, n), for tasks (m, k)."""
        return _covariance(self.smoother, tasks, self.tasks) @ self.Q + _trend(self.smoother, tasks) @ self.trend

    def left_out(self, Y: Array) -> Array:
        """Return the distances (n,) of the rows of Y (n, p) from what the others say."""
        return np.asarray(np.linalg.norm(self.Q @ Y, axis=1) / np.diag(self.Q))


def solve(smoother: Smoother, tasks: Array) -> Solved:
    """The matrices of a smoother for tasks (n, k), more than [1, c] has columns."""
    P = _trend(smoother, tasks)
    K = _covariance(smoother, tasks, tasks) + (1.0 if smoother.noise is None else smoother.noise) * np.eye(len(tasks))
    factor = cho_factor(K)
    KP = cho_solve(factor, P)
    trend = np.linalg.solve(P.T @ KP, KP.T)
    return Solved(smoother, tasks, cho_solve(factor, np.eye(len(tasks))) - KP @ trend, trend)


def _trend(smoother: Smoother, tasks: Array) -> Array:
    ones = np.ones((len(tasks), 1))
    return ones if smoother.name == "average" else np.hstack((ones, tasks))


def _covariance(smoother: Smoother, A: Array, B: Array) -> Array:
    if smoother.length_scale is None:
        return np.zeros((len(A), len(B)))
    squares = np.sum((A[:, None] - B[None]) ** 2, axis=2)
    return np.exp(-squares / (2.0 * smoother.length_scale**2))


def demonstrated_parameters(parameters: ArrayLike, n: int) -> Array:
    """The parameters (n, k) of n demonstrations, as a copy."""
    C = as_numbers(parameters, "parameters")
    C = C[:, None] if C.ndim == 1 else C
    if C.ndim != 2 or len(C) != n or not C.shape[1]:
        raise TrajectoryError(
            f"expected parameters of shape ({n},) or ({n}, k), those of each demonstration, got shape "
            f"{np.shape(parameters)}"
        )
    C, k = _finite(C), C.shape[1]
    if n < k + 2:
        raise TrajectoryError(
            f"expected at least {k + 2} demonstrations for {k} parameters, so that one can be left out, got {n}"
        )
    deviations = C - C.mean(axis=0)
    lengths = np.linalg.norm(deviations, axis=0)
    still = lengths <= 1e-12 * np.linalg.norm(C, axis=0)
    if still.any():
        j = int(np.argmax(still))
        raise TrajectoryError(
            f"expected parameter {j} to differ between demonstrations, got {C[0, j]:g} in all; leave it out"
        )
    if np.linalg.matrix_rank(deviations / lengths, tol=1e-9) < k:
        raise TrajectoryError(f"expected {k} parameters of which none follows from the others; leave out those that do")
    # Without a demonstration that is alone with its parameter, the others say nothing about it.
    leverage = 1.0 / n + np.sum(np.linalg.qr(deviations / lengths)[0] ** 2, axis=1)
    if leverage.max() > 1.0 - _ALONE:
        raise TrajectoryError(
            f"expected parameters that differ independently in all demonstrations but one, too, so that it can be left "
            f"out, got demonstration {np.argmax(leverage)} alone with its own; demonstrate another one like it"
        )
    return C.copy()


def check_range(C: Array, shown: Array) -> None:
    """Refuse parameters (m, k) outside the box around the demonstrated ones (n, k)."""
    lowest, highest = shown.min(axis=0), shown.max(axis=0)
    beyond = np.maximum(np.maximum(lowest - C, C - highest), 0.0)
    outside = beyond > _SLACK * (highest - lowest)
    if outside.any():
        i = int(np.argmax(outside.any(axis=1)))
        j = int(np.argmax(outside[i]))
        share = 100.0 * beyond[i, j] / (highest[j] - lowest[j])
        raise SpecificationError(
            f"parameters {i}: expected parameter {j} within the demonstrated range [{lowest[j]:.6g}, "
            f"{highest[j]:.6g}], got {C[i, j]:.6g}, {beyond[i, j]:.3g} or {share:.3g} % of the range beyond it; "
            "demonstrate it, or pass extrapolate=True"
        )


def _finite(C: Array) -> Array:
    usable = np.abs(C) <= LARGEST
    if not usable.all():
        i = int(np.argmin(usable.all(axis=1)))
        raise TrajectoryError(f"parameters {i}: expected finite numbers up to {LARGEST:g}, got {C[i].tolist()}")
    return C

"""Movements as a function of the task's parameters, as a scikit-learn estimator."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from kineme.errors import SpecificationError
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.primitives.contextual.smoothers import Smoother, candidates, solve
from kineme.primitives.contextual.task_parameters import check_range, demonstrated_parameters, task_parameters
from kineme.primitives.discrete.dmp import DMP, Primitives
from kineme.primitives.styles.parameters import (
    as_primitives,
    from_numbers,
    map_rows,
    path_matrix,
    shared_label,
    shared_recording,
    to_numbers,
)
from kineme.validation import Array, check_choice, check_number

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
    >>> model = kineme.Contextual().fit(demos, parameters=heights)
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
        self._check()
        primitives = self._learned(movements)
        C = demonstrated_parameters(parameters, len(primitives))
        self.center_, self.scale_ = C.mean(axis=0), C.std(axis=0)
        X = _standardized(C, self.center_, self.scale_)
        Y = _compressed_paths(primitives)
        tried = candidates(self.length_scale, self.noise)
        names = list(tried) if self.regression == "auto" else [self.regression]
        best = {name: min((solve(one, X) for one in tried[name]), key=lambda s: _rms(s.left_out(Y))) for name in names}
        self.errors_ = {name: _rms(best[name].left_out(Y)) for name in names}
        self.errors_["average"] = _rms(solve(Smoother("average"), X).left_out(Y))
        self._solved = best[_simplest(names, self.errors_)]
        self.smoother_ = self._solved.smoother
        self.leave_one_out_errors_ = self._solved.left_out(Y)
        self.leave_one_out_error_ = _rms(self.leave_one_out_errors_)
        self.dmp_, self.primitives_, self.parameters_ = primitives.dmp, primitives, C
        return self

    def primitive(self, parameters: ArrayLike, extrapolate: bool = False) -> Primitives:
        """One primitive for each task.

        Parameters
        ----------
        parameters : float, or array_like of shape (k,) or (m, k); with one parameter (m,), too
        extrapolate : bool, default False
            Allow parameters outside the demonstrated range: the box between the smallest and the largest of each. Its
            corners need not have been demonstrated either.

        Returns
        -------
        Primitives
            m primitives: roll them out, describe them, control with them as with any others.

        Raises
        ------
        SpecificationError
            Parameters outside the demonstrated range; the message says how far.
        TrajectoryError
            Parameters of another number than the demonstrated ones, or not finite.
        """
        check_is_fitted(self, "primitives_")
        C = task_parameters(parameters, self.parameters_.shape[1])
        if not extrapolate:
            check_range(C, self.parameters_)
        w = self._solved.weights(_standardized(C, self.center_, self.scale_))
        theta = np.tensordot(w, to_numbers(self.primitives_), axes=1)
        durations = np.exp(w @ np.log(self.primitives_.durations))
        about = shared_recording(self.primitives_)
        return from_numbers(self.dmp_, theta, durations, shared_label(self.primitives_), about)

    def _check(self) -> None:
        check_choice("regression", self.regression, REGRESSIONS)
        if not isinstance(self.dmp, DMP | None):
            raise SpecificationError(f"expected dmp to be a kineme.DMP, got {type(self.dmp).__name__}")
        for name in ("length_scale", "noise"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), above=0.0)

    def _learned(self, movements: Primitives | MovementsLike) -> Primitives:
        primitives = as_primitives(movements, self.dmp)
        if self.dmp is not None and primitives.dmp != self.dmp:
            raise SpecificationError(f"expected primitives of the specification {self.dmp}, got {primitives.dmp}")
        return primitives


def _compressed_paths(primitives: Primitives) -> Array:
    """N numbers for each of n paths, whose distances are root mean squares over the path."""
    theta = to_numbers(primitives)
    paths = map_rows(theta - theta.mean(axis=0), path_matrix(primitives.dmp, primitives.dmp.n_points))
    rows = paths.reshape(len(paths), -1) / np.sqrt(primitives.dmp.n_points)
    return np.asarray(np.linalg.qr(rows.T, mode="r")).T


def _simplest(names: list[str], errors: dict[str, float]) -> str:
    """The first name that is as good as the best; the simplest come first."""
    enough = max(_AS_GOOD * min(errors[name] for name in names), _EXACT * errors["average"])
    return next(name for name in names if errors[name] <= enough)


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _standardized(C: Array, center: Array, scale: Array) -> Array:
    return (C - center) / scale

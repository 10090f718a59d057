"""The styles in which several demonstrations differ, by a singular value decomposition.

Source: T. Matsubara, S. Hyon and J. Morimoto, "Learning Parametric Dynamic Movement Primitives from Multiple
Demonstrations", Neural Networks 24(5), 2011; the paper's reference [6].

Taken from there: f is a sum of few basis targets, the leading singular vectors over the demonstrations, each times a
style parameter; one style is shared by all dimensions; where the movement starts and ends follows from the
style by regression. Our choices: the mean is taken out first, so that style zero is the average and two kinds
need one style, not two; the initial velocity and the duration follow from the style as well; and by default what is
decomposed is the path that the forcing term makes (``metric="path"``) and not f itself (``metric="forcing"``, theirs),
because f is dominated by accelerations and their noise.
"""

from __future__ import annotations

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.styles.metrics import METRICS, compared
from kineme.dmp.styles.model import StyleModel
from kineme.dmp.styles.parameters import as_primitives, shared_label, shared_recording, to_numbers
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.validation import Array, check_choice, check_count, check_number


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

    Returns
    -------
    StyleModel
        The sign of a style is such that the largest change that it makes is positive, so neither sign nor
        order depends on the order of the demonstrations.

    Raises
    ------
    TrajectoryError
        Fewer than two demonstrations, or all the same.
    SpecificationError
        More styles than the demonstrations can tell apart; both `n_styles` and `variance`; a parameter out of range.
    """
    primitives = as_primitives(primitives)
    check_choice("metric", metric, list(METRICS))
    if len(primitives) < 2:
        raise TrajectoryError(f"expected at least 2 demonstrations to learn styles from, got {len(primitives)}")
    theta = to_numbers(primitives)
    mean = theta[0] + np.mean(theta - theta[0], axis=0)
    U, S, Vt = np.linalg.svd(compared(metric, primitives.dmp, theta - mean), full_matrices=False)
    J = _n_styles(S, _rank(S, compared(metric, primitives.dmp, theta)), n_styles, variance)
    n = len(theta)
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
        label=shared_label(primitives),
        recorded_as=shared_recording(primitives),
    )


def _rank(S: Array, X: Array) -> int:
    """How many singular values are more than rounding."""
    return int(np.sum(max(X.shape) * np.finfo(float).eps * np.linalg.norm(X) < S))


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

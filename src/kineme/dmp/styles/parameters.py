"""The numbers that a movement depends on linearly, and the way back to primitives.

Over the phase u = t / tau a movement is linear in ``theta = [W, x0, g, tau v0]`` (N + 3 numbers for each dimension):

    x(u) = Phi W + (1 - goal) x0 + goal g + velocity tau v0,

with the decode matrices of `kineme.dmp.discrete.operators`. So the mean of many theta makes the mean of the
paths, and a covariance of theta the covariance of the path. This holds for the weights times the formulation's scale,
W, and not for the weights w themselves: in the original formulation the mean of ``w = W / (g - x0)`` belongs to no mean
path, and one demonstration with g close to x0 would drown all others. Where the demonstrations are one shape in several
sizes the two agree.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.operators import Response, decoder
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.recorded_as import RecordedAs
from kineme.errors import TrajectoryError
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array


def to_numbers(primitives: Primitives) -> Array:
    """The numbers theta of each primitive, shape (n, d, N + 3)."""
    check_primitives(primitives)
    tangents = primitives.velocities * primitives.durations[:, None]  # dx/du at the start
    rest = np.stack((primitives.starts, primitives.goals, tangents), axis=2)
    return np.concatenate((primitives.scaled_weights, rest), axis=2)


def check_primitives(primitives: Any) -> None:
    """Refuse movements that are not learned yet, and rhythms and poses, which are no such numbers."""
    if not isinstance(primitives, Primitives):
        raise TrajectoryError(
            f"expected kineme.dmp.Primitives, got {type(primitives).__name__}; learn movements first, "
            "kineme.DMP().learn(movements), and take the tangent of pose primitives"
        )


def as_primitives(movements: Primitives | MovementsLike, dmp: DMP | None = None) -> Primitives:
    """Primitives as they are; movements as `dmp`, by default ``DMP()``, learns them. Rhythms and poses are refused."""
    if isinstance(movements, Batch):
        check_primitives(movements)
    return movements if isinstance(movements, Primitives) else (dmp or DMP()).learn(movements)


def from_numbers(
    dmp: DMP, theta: Array, durations: Array, label: Any = None, about: RecordedAs | None = None
) -> Primitives:
    """Primitives from theta (n, d, N + 3) and tau (n,) [s]; all of them get `label`, unless it is None, and `about`."""
    path = map_rows(theta, path_matrix(dmp, dmp.n_points))
    labels: NDArray[Any] | None = None if label is None else label_array([label] * len(theta))
    return Primitives(
        dmp,
        scaled_weights=np.ascontiguousarray(theta[:, :, :-3]),
        starts=theta[:, :, -3].copy(),
        goals=theta[:, :, -2].copy(),
        velocities=theta[:, :, -1] / durations[:, None],
        durations=durations,
        extents=np.ptp(path, axis=2),
        labels=labels,
        recorded_as=about,
    )


def path_matrix(dmp: Specification, n_samples: int, derivative: int = 0) -> Array:
    """From theta to the path at `n_samples` even phases, or to its derivative in u; shape (N + 3, n_samples)."""
    return response_matrix(decoder(dmp, n_samples), derivative)


def response_matrix(response: Response, derivative: int = 0) -> Array:
    """The same at the times of a response, shape (N + 3, T)."""
    goal = response.goal[derivative]
    start = -goal if derivative else 1.0 - goal
    return np.vstack((response.Phi[derivative].T, start, goal, response.velocity[derivative]))


def map_rows(theta: Array, matrix: Array) -> Array:
    """``theta @ matrix``, shape (n, d, n_samples), as one product: a stack would become as many small ones."""
    return (theta.reshape(-1, theta.shape[2]) @ matrix).reshape(*theta.shape[:2], matrix.shape[1])


def shared_recording(primitives: Primitives) -> RecordedAs | None:
    """Return the common channels of primitives, without the steps of discrete ones: those are of one movement each."""
    return None if primitives.recorded_as is None else replace(primitives.recorded_as, steps=None)


def shared_label(primitives: Primitives) -> Any:
    """The label that all primitives have, or None."""
    labels = primitives.labels
    return labels[0] if labels is not None and (labels == labels[0]).all() else None

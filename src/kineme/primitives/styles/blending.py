"""Two averages blended into one: at each time the product of their Gaussians, each to the power of its activation.

A. Paraschos, C. Daniel, J. Peters and G. Neumann, "Probabilistic Movement Primitives", NIPS 2013, Section 2.2: with the
activations a and b of two primitives at a time and their means and covariances of the position there,

    Sigma = (a Sigma_1^-1 + b Sigma_2^-1)^-1,    mean = Sigma (a Sigma_1^-1 mean_1 + b Sigma_2^-1 mean_2).

Positions at one time say nothing about how they vary together over time. Our choice is ``sqrt(a) Sigma Sigma_1^-1``
times the deviations of the one and ``sqrt(b) Sigma Sigma_2^-1`` times those of the other, which has this Sigma at each
time and the deviations of one primitive where it is alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.primitives.discrete.operators import encoder
from kineme.primitives.discrete.specification import Specification
from kineme.primitives.styles.parameters import map_rows, path_matrix
from kineme.validation import Array, as_numbers

_FLOOR = 1e-3  # of the typical deviation, added to all: where nobody varies the activations alone decide


class Blended(NamedTuple):
    """Numbers of the mean, and the factor of their covariance."""

    theta: Array  # (1, d, N + 3)
    factor: Array  # (r1 + r2, d, N + 3)


def as_activation(activation: ArrayLike, n_points: int) -> Array:
    """A number or numbers at even times as (T,) numbers from 0 to 1."""
    a = np.atleast_1d(as_numbers(activation, "activation"))
    if a.ndim != 1 or not len(a) or not ((a >= 0.0) & (a <= 1.0)).all():
        raise SpecificationError(f"expected activation to be numbers from 0 to 1, of shape (S,), got {activation!r}")
    return np.interp(np.linspace(0.0, 1.0, n_points), np.linspace(0.0, 1.0, len(a)), a)


def blended(
    dmp: Specification, one: tuple[Array, Array], other: tuple[Array, Array], activation: Array, floor: float
) -> Blended:
    """Blend two averages, each (theta (1, d, N + 3), factor (r, d, N + 3)), with `activation` (T,) of the other.

    `floor` is the deviation below which all positions count as equally certain, in the unit of the movements.
    """
    matrix = path_matrix(dmp, len(activation))
    means = [map_rows(theta, matrix)[0].T for theta, _ in (one, other)]  # (T, d)
    deviations = [map_rows(factor, matrix).transpose(2, 0, 1) for _, factor in (one, other)]  # (T, r, d)
    a = np.stack((1.0 - activation, activation))[:, :, None, None]
    size = np.sqrt(sum(float(np.mean(np.sum(x**2, axis=1))) for x in deviations) / 2.0)
    least = max(_FLOOR * size, floor) ** 2 * np.eye(means[0].shape[1])
    precisions = np.stack([np.linalg.inv(x.transpose(0, 2, 1) @ x + least) for x in deviations])  # (2, T, d, d)
    gains = np.linalg.inv(np.sum(a * precisions, axis=0)) @ precisions  # Sigma Sigma_i^-1
    mean = sum((a[i] * gains[i] @ means[i][:, :, None])[:, :, 0] for i in (0, 1))
    paths = [deviations[i] @ (np.sqrt(a[i]) * gains[i]).transpose(0, 2, 1) for i in (0, 1)]
    return Blended(
        encoded(dmp, np.asarray(mean)[None].transpose(0, 2, 1)),
        encoded(dmp, np.concatenate(paths, axis=1).transpose(1, 2, 0)),
    )


def encoded(dmp: Specification, paths: Array) -> Array:
    """Theta (n, d, N + 3) of paths (n, d, T) at even times: learning is linear."""
    relative = paths - paths[:, :, :1]
    operator = encoder(dmp, paths.shape[2])
    weights, velocity = relative @ operator.weights, relative @ operator.velocity
    return np.concatenate((weights, np.stack((paths[:, :, 0], paths[:, :, -1], velocity), axis=2)), axis=2)

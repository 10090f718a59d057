"""Limit cycles changed as little as possible so that they pass points at some phases.

On the limit cycle ``x - b`` is linear in the weights, so points at phases phi_k ask for ``A W = e`` with A the rows of
the periodic response there, and the change with the least mean square acceleration that grants it is one small solve,
as of discrete movements (`kineme.dmp.discrete.modulate`). One row more is the mean over the cycle: it stays 0,
for the baseline is where it was asked to be.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from kineme.dmp.discrete.changes import loose_changes
from kineme.dmp.discrete.extrapolation import Changed, warn_changed, warn_far
from kineme.dmp.discrete.per_movement import broadcast_length
from kineme.dmp.discrete.rollout import Change
from kineme.dmp.discrete.via_points import Span, ViaLike, ViaPoints, via_points
from kineme.dmp.rhythmic.harmonics import as_real, waves
from kineme.dmp.rhythmic.operators import even_phases, limit_cycle
from kineme.dmp.rhythmic.rollout import RhythmicRollout
from kineme.dmp.rhythmic.specification import RhythmicSpecification
from kineme.errors import SpecificationError
from kineme.validation import Array

PHASES = Span(
    2.0 * np.pi,
    True,
    "via=[(phase, point), ...] or [((begin, end), points), ...] with phases from 0 to below 2 pi",
    "phase {:.3g}",
    "a phase, or a begin and a later end, from 0 to below 2 pi, got {}",
)
_PER_BASIS = 4  # phases of a change for each basis function


def modulated(movement: RhythmicRollout, via: ViaLike | ViaPoints | None) -> RhythmicRollout:
    """The movement on the limit cycle that passes the via points; see `RhythmicPrimitives.rollout`.

    Raises
    ------
    SpecificationError, TrajectoryError
        As `via_points`; an amplitude of 0.
    """
    if via is None:
        return movement
    dmp = movement.primitives.dmp
    asked = via if isinstance(via, ViaPoints) else via_points(via, movement.baselines.shape[1], span=PHASES)
    n = broadcast_length(len(movement), {"via": asked.points}, "movements")
    movement = movement if len(movement) == n else movement[np.zeros(n, dtype=np.intp)]
    if not movement.ratio.all():
        raise SpecificationError(
            "expected an amplitude other than 0 with via points, got 0: what was learned does not move; leave out via="
        )
    observed = np.vstack((_path(dmp, 2.0 * np.pi * asked.times), limit_cycle(dmp)[:, 0].real))
    own = movement.primitives.scaled_weights * movement.ratio[:, None, None]
    errors = -(own @ observed.T)  # (n, d, K + 1)
    errors[:, :, :-1] += asked.points.transpose(0, 2, 1) - movement.baselines[:, :, None]
    errors[:, :, -1] = 0.0
    rows, stretch = errors.reshape(-1, errors.shape[2]), np.append(asked.stretch.astype(np.float64), 0.0)
    extents, looks = 2.0 * np.abs(movement.ratio * movement.primitives.amplitudes), _looks(dmp)
    warn_far(extents, asked, errors, span=PHASES)
    found = loose_changes(looks, smoothness_factor(dmp), observed, rows, stretch)
    change = Change(found.reshape(*errors.shape[:2], -1), np.eye(dmp.n_basis))
    left = errors - change.coefficients @ observed.T if asked.stretch.any() else None
    warn_changed(extents, asked, errors, Changed(change, left, looks))
    return replace(movement, change=change.coefficients)


@lru_cache(maxsize=32)
def smoothness_factor(dmp: RhythmicSpecification) -> Array:
    """Factor (N, N) of a covariance of the weights under which changes with small accelerations are likely.

    What has no acceleration, a shift of the whole cycle, counts as its first harmonic does.
    """
    bend = _path(dmp, even_phases(_PER_BASIS * dmp.n_basis), 2)
    shift = (2.0 * np.pi) ** 2 * limit_cycle(dmp)[:, 0].real
    precision = bend.T @ bend / len(bend) + np.outer(shift, shift)
    values, vectors = np.linalg.eigh(precision)
    return np.asarray((vectors / np.sqrt(np.maximum(values, 0.0) + 1e-8 * np.trace(precision) / dmp.n_basis)).T)


@lru_cache(maxsize=32)
def _looks(dmp: RhythmicSpecification) -> Array:
    return _path(dmp, even_phases(_PER_BASIS * dmp.n_basis)).T


def _path(dmp: RhythmicSpecification, phases: Array, order: int = 0) -> Array:
    """From weights to x - b at phases (k,) of the limit cycle, or to a derivative in u: (k, N)."""
    response = limit_cycle(dmp)
    harmonics = np.arange(response.shape[1])
    return np.asarray(waves(phases, len(harmonics) - 1) @ as_real(response * (2j * np.pi * harmonics) ** order).T)

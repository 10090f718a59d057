"""Movements on the limit cycle and towards it, in a batch: any baseline, amplitude, period, phase and start.

On the limit cycle ``x - b`` is linear in the weights, so via points are met as by discrete movements
(`kineme.dmp.discrete.modulate`); the mean over the cycle stays 0, for the baseline is where it was asked to be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.batch import Batch
from kineme.dmp.discrete import via_points
from kineme.dmp.discrete.modulate import Changed, loose_changes, warn_changed, warn_far
from kineme.dmp.discrete.rollout import BaseRollout, Change
from kineme.dmp.rhythmic.encode import SAMPLES_PER_PERIOD
from kineme.dmp.rhythmic.operators import RhythmicSpecification, as_real, even_phases, limit_cycle, waves
from kineme.dmp.spring_damper import transitions
from kineme.errors import SpecificationError
from kineme.validation import Array, check_count, check_number, check_samples

PHASES = via_points.Span(
    2.0 * np.pi,
    True,
    "via=[(phase, point), ...] or [((begin, end), points), ...] with phases from 0 to below 2 pi",
    "phase {:.3g}",
    "a phase, or a begin and a later end, from 0 to below 2 pi, got {}",
)
_PER_BASIS = 4  # phases of a change for each basis function


@dataclass(frozen=True, eq=False, repr=False)
class RhythmicRollout(BaseRollout):
    """n generated movements of T samples each, computed when asked for; see `BaseRollout`.

    A movement is its limit cycle, a Fourier series, plus the free motion of the spring-damper from the state off the
    cycle: ``x = b + a x_cycle(phi) + e^(A u) (z0 - z_cycle)``.
    """

    ratio: Array  # (n,), amplitude over the learned one
    baselines: Array  # (n, d)
    periods: Array  # (n,)
    phases: Array  # (n,), of the first sample
    start: Array | None  # (1 or n, d); None on the cycle
    velocity: Array | None  # (1 or n, d), per second
    n_periods: float
    n_samples: int
    change: Array | None = None  # (n, d, N) of the weights in force: via points

    def __len__(self) -> int:
        return len(self.baselines)

    @property
    def times(self) -> Array:
        """Times of the samples (n, T), from 0 [s]."""
        return self.periods[:, None] * self._u

    def least_period(self, velocity: ArrayLike | None = None, acceleration: ArrayLike | None = None) -> Array:
        """The least period (n,) [s] in which the same path stays within limits; see `Rollout.least_duration`."""
        fixed = self.velocity is not None and bool(self.velocity.any())
        return self._least(self.periods, self.n_periods, fixed, velocity, acceleration)

    @property
    def _weights(self) -> tuple[Array, Array]:
        """The weights in force (1 or n, d, N), and what is to be multiplied by the cycle that they make (n,)."""
        own = self.primitives.row("scaled_weights")
        if self.change is None:
            return own, self.ratio
        return own * self.ratio[:, None, None] + self.change, np.ones(len(self))

    @property
    def _u(self) -> Array:
        return np.linspace(0.0, self.n_periods, self.n_samples)

    def _derivative(self, order: int) -> Array:
        u, dmp = self._u, self.primitives.dmp
        weights, ratio = self._weights
        result = cycle(dmp, weights, ratio, (self.phases, 2 * np.pi * u), order)
        if self.start is not None or self.velocity is not None:
            at_start = np.zeros(1)
            on_cycle = [cycle(dmp, weights, ratio, (self.phases, at_start), k)[:, :, 0] for k in (0, 1)]
            offset = 0.0 if self.start is None else self.start - self.baselines - on_cycle[0]
            push = 0.0 if self.velocity is None else self.velocity * self.periods[:, None] - on_cycle[1]
            off_cycle = np.stack(np.broadcast_arrays(offset, push, on_cycle[0])[:2], axis=2)
            free = transitions(dmp.K, dmp.D, u)  # (T, 2, 2)
            result = result + off_cycle @ (free[:, 0], free[:, 1], -dmp.K * free[:, 0] - dmp.D * free[:, 1])[order].T
        scaled = result / self.periods[:, None, None] ** order if order else result + self.baselines[:, :, None]
        return np.asarray(scaled.transpose(0, 2, 1))


def cycle(dmp: RhythmicSpecification, weights: Array, ratio: Array, when: tuple[Array, Array], order: int) -> Array:
    """The x - b (n, d, T), or a derivative in u, on the limit cycle, at `when`: phases (n,), radians past them (T,)."""
    (phases, turn), response = when, limit_cycle(dmp)
    harmonics = np.arange(response.shape[1])
    response = response * (2j * np.pi * harmonics) ** order
    synthesis = waves(turn, len(harmonics) - 1).T
    if (phases == phases[0]).all():
        series = weights @ (as_real(response * np.exp(1j * phases[0] * harmonics)) @ synthesis)
    else:
        series = as_real(weights @ response * np.exp(1j * phases[:, None, None] * harmonics)) @ synthesis
    return np.asarray(ratio[:, None, None] * series)


def rollout(
    primitives: Batch, options: dict[str, ArrayLike | None], n_periods: float, rate: float | None, n_samples: int | None
) -> RhythmicRollout:
    """Check the options and broadcast them over the primitives; see `RhythmicPrimitives.rollout`."""
    vectors = ("baseline", "start", "velocity")
    given = {
        name: via_points.per_movement(option, name, primitives.n_dims if name in vectors else None)
        for name, option in options.items()
    }
    n = via_points.broadcast_length(len(primitives), given)
    check_number("n_periods", n_periods, above=0.0)
    periods = via_points.filled(given["period"], primitives.row("periods"), n)
    via_points.check_durations("period", periods)
    return RhythmicRollout(
        primitives,
        via_points.filled(given["amplitude"], primitives.row("amplitudes"), n) / primitives.row("amplitudes"),
        via_points.filled(given["baseline"], primitives.row("baselines"), n),
        periods,
        via_points.filled(given["phase"], np.zeros(1), n),
        given["start"],
        given["velocity"],
        float(n_periods),
        _samples(primitives.dmp, float(n_periods), periods, rate, n_samples),
    )


def _samples(
    dmp: RhythmicSpecification, n_periods: float, periods: Array, rate: float | None, n_samples: int | None
) -> int:
    if rate is not None and n_samples is not None:
        raise SpecificationError("expected either rate or n_samples, got both")
    if rate is not None:
        check_number("rate", rate, above=0.0)
        least = SAMPLES_PER_PERIOD / float(periods.min())
        if rate < least:
            raise SpecificationError(
                f"expected a rate of at least {least:.3g} Hz, that is {SAMPLES_PER_PERIOD} samples per period, got "
                f"{rate:g} Hz"
            )
        wanted = float(periods.max()) * n_periods * rate * (1 - 1e-12) + 1
        return max(2, check_samples(wanted, dmp.n_basis, "rate times periods"))
    if n_samples is None:
        return max(2, check_samples(n_periods * dmp.n_points * (1 - 1e-12) + 1, dmp.n_basis, "n_periods"))
    return check_samples(check_count("n_samples", n_samples, 2), dmp.n_basis, "n_samples")


def modulated(movement: RhythmicRollout, via: via_points.ViaLike | via_points.ViaPoints | None) -> RhythmicRollout:
    """The movement on the limit cycle that passes the via points; see `RhythmicPrimitives.rollout`."""
    if via is None:
        return movement
    dmp = movement.primitives.dmp
    targets = via_points.via_points(via, movement.baselines.shape[1], span=PHASES)
    n = via_points.broadcast_length(len(movement), {"via": targets.points}, "movements")
    movement = movement if len(movement) == n else movement[np.zeros(n, dtype=np.intp)]
    if not movement.ratio.all():
        raise SpecificationError(
            "expected an amplitude other than 0 with via points, got 0: what was learned does not move; leave out via="
        )
    observed = np.vstack((_path(dmp, 2.0 * np.pi * targets.times), limit_cycle(dmp)[:, 0].real))
    own = movement.primitives.row("scaled_weights") * movement.ratio[:, None, None]
    errors = -(own @ observed.T)  # (n, d, K + 1)
    errors[:, :, :-1] += targets.points.transpose(0, 2, 1) - movement.baselines[:, :, None]
    errors[:, :, -1] = 0.0
    rows, stretch = errors.reshape(-1, errors.shape[2]), np.append(targets.stretch.astype(np.float64), 0.0)
    extents, looks = 2.0 * np.abs(movement.ratio * movement.primitives.row("amplitudes")), _looks(dmp)
    warn_far(extents, targets, errors, span=PHASES)
    weights = loose_changes(looks, smoothness_factor(dmp), observed, rows, stretch)
    change = Change(weights.reshape(*errors.shape[:2], -1), np.eye(dmp.n_basis))
    left = errors - change.coefficients @ observed.T if targets.stretch.any() else None
    warn_changed(extents, targets, errors, Changed(change, left, looks))
    return replace(movement, change=change.coefficients)


@lru_cache(maxsize=32)
def smoothness_factor(dmp: RhythmicSpecification) -> Array:
    """That of discrete movements (N, N); a shift of the cycle, without acceleration, counts as its first harmonic."""
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

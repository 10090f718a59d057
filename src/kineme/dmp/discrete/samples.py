"""How many samples a rollout has, and when the last one is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.discrete.specification import Specification
from kineme.errors import SpecificationError
from kineme.validation import Array, check_count, check_number, check_samples

_LONGEST = 10.0  # durations after which a movement that has not settled is given up
_SETTLING_SAMPLES = 400


def sampled(movement: Rollout, rate: float | None, n_samples: int | None, settle: float | None) -> Rollout:
    """The movement with the samples that the options of `Primitives.rollout` ask for."""
    dmp = movement.primitives.dmp
    end = 1.0 if settle is None else settled_end(movement, settle)
    if rate is not None and n_samples is not None:
        raise SpecificationError("expected either rate or n_samples, got both")
    if rate is not None:
        n_samples = samples_at_rate(rate, movement.durations * end, dmp)
    elif n_samples is None:
        n_samples = math.ceil(end * (dmp.n_points - 1)) + 1
    n_samples = check_samples(check_count("n_samples", n_samples, 2), dmp.n_basis, "n_samples")
    return replace(movement, n_samples=n_samples, end=end)


def samples_at_rate(rate: float, durations: Array, dmp: Specification) -> int:
    """Samples per movement so that none is sampled more coarsely than `rate` [Hz]."""
    check_number("rate", rate, above=0.0)
    wanted = float(durations.max()) * rate * (1 - 1e-12) + 1
    n_samples = check_samples(wanted, dmp.n_basis, "rate times duration")
    least = math.ceil(2 * math.sqrt(dmp.K)) + 1
    if n_samples < least:
        raise SpecificationError(
            f"expected a rate of at least {(least - 1) / float(durations.max()):.3g} Hz to follow the dynamics, that "
            f"is two samples in each time constant duration / sqrt(K) of the spring, got {rate:g} Hz"
        )
    return n_samples


def settled_end(movement: Rollout, tolerance: float) -> float:
    """Time, in durations from 1 on, at which every movement stays within `tolerance` of its goal."""
    check_number("settle", tolerance, above=0.0)
    far = replace(movement, n_samples=_SETTLING_SAMPLES, end=_LONGEST)
    goals = (
        movement.goals[:, None] + np.linspace(0.0, _LONGEST, _SETTLING_SAMPLES)[:, None] * movement.goal_steps[:, None]
    )
    outside = (np.abs(far.positions - goals) > tolerance).any(axis=(0, 2))
    last = int(np.flatnonzero(outside)[-1]) if outside.any() else 0
    if last == _SETTLING_SAMPLES - 1:
        raise SpecificationError(
            f"expected the movement to come within {tolerance:g} of its goal in {_LONGEST:g} durations, it does "
            "not; raise the tolerance, the stiffness or the damping"
        )
    return max(1.0, (last + 1) * _LONGEST / (_SETTLING_SAMPLES - 1))

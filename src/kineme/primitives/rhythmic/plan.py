"""A limit cycle as the plan that a controller steps through."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.primitives.control.options import check_one, one_vector
from kineme.primitives.control.plan import MISSED, Plan, ViaPlaces
from kineme.primitives.discrete.via_points import ViaLike, via_points
from kineme.primitives.rhythmic.learned import RhythmicLearned
from kineme.primitives.rhythmic.modulate import PHASES, modulated
from kineme.primitives.rhythmic.rollout import rollout
from kineme.validation import Array

_LONGEST_STEP = 1000.0  # periods in one step: the forcing is followed all the way


def plan_of(
    primitive: RhythmicLearned, options: dict[str, ArrayLike | None], via: ViaLike | None = None
) -> tuple[Plan, float]:
    """The plan of one limit cycle and its amplitude, with the options of `rollout` checked for one movement.

    A rhythm is a discrete movement whose shape repeats, without coupling, and whose goal is the baseline.
    """
    check_one(len(primitive))
    d, dmp = primitive.n_dims, primitive.dmp
    vectors = {name: one_vector(name, options[name], d) for name in ("baseline", "start", "velocity")}
    asked = None if via is None else via_points(via, d, span=PHASES)
    movement = modulated(rollout(primitive, options | vectors, 1.0, None, n_samples=2), asked)
    check_one(len(movement))
    origin, tau = movement.baselines[0].copy(), float(movement.periods[0])
    gain, ones, weights = float(movement.ratio[0]), np.ones(d), primitive.scaled_weights[0]
    size = 2.0 * abs(gain) * float(primitive.amplitudes[0])
    if movement.change is not None:
        weights = weights + movement.change[0] / gain  # a new amplitude scales the whole cycle

    def shape(u: Array) -> Array:
        forcing = dmp.basis.design(2 * np.pi * u) @ weights.T
        return np.column_stack((forcing, np.zeros(len(u))))

    plan = Plan(
        dmp.K,
        dmp.D,
        shape,
        n_gaps=dmp.n_basis,
        ratio=lambda goal: ones,
        origin=origin,
        goal=np.zeros(d),
        state=np.vstack((movement.positions[0, 0] - origin, movement.velocities[0, 0] * tau)),
        duration=tau,
        settle=0.0,
        n_positions=d,
        begin=float(movement.phases[0] / (2 * np.pi) % 1.0),
        periodic=True,
        longest_step=_LONGEST_STEP,
        via=None if asked is None else ViaPlaces(asked.times, asked.points[0] - origin, MISSED * size),
    )
    return plan, gain

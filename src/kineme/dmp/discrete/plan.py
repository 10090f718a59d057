"""A discrete movement as the plan that a controller steps through."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.batch import Batch
from kineme.dmp.control.plan import MISSED, Plan, ViaPlaces, check_one, one_vector
from kineme.dmp.discrete.modulate import modulated
from kineme.dmp.discrete.rollout import Rollout, rollout
from kineme.dmp.discrete.via_points import ViaLike, ViaPoints, via_points
from kineme.validation import check_number

_SETTLED = 1e-3  # of the demonstration's largest extent


def plan_of(  # noqa: PLR0913, PLR0917 - one parameter per option
    primitive: Batch,
    start: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    duration: float | None = None,
    velocity: ArrayLike | None = None,
    via: ViaLike | None = None,
    end_velocity: ArrayLike | None = None,
    position_limits: tuple[ArrayLike, ArrayLike] | None = None,
) -> Plan:
    """The plan of one primitive, with the options of `Primitives.rollout` checked for one movement."""
    check_one(len(primitive))
    if duration is not None:
        check_number("duration", duration, above=0.0)
    d = primitive.n_dims
    movement = rollout(
        primitive,
        one_vector("start", start, d),
        one_vector("goal", goal, d),
        duration,
        one_vector("velocity", velocity, d),
    )
    targets = None if via is None else via_points(via, d)
    movement = modulated(movement, targets, one_vector("end_velocity", end_velocity, d), position_limits)
    return plan_along(movement, d, targets)


def plan_along(movement: Rollout, n_positions: int, via: ViaPoints | None) -> Plan:
    """The plan of one generated movement through via points, with that many positions, others behind them."""
    check_one(len(movement))
    primitive, own = movement.primitives, movement.change is None
    dmp, d, extents = primitive.dmp, primitive.n_dims, primitive.row("extents")
    x0, tau = movement.starts[0].copy(), float(movement.durations[0])
    learned = primitive.row("goals") - primitive.row("starts") if own else movement.goals - movement.starts
    columns = slice(0, n_positions or None)
    mixing = np.zeros((dmp.n_basis + 1, d + 1))
    mixing[:-1, :-1], mixing[-1, -1] = (primitive.row("scaled_weights") if own else movement.weights)[0].T, 1.0

    return Plan(
        dmp,
        mixing,
        ratio=lambda goal: np.array(dmp.system.ratio(goal[None], learned, extents)[0]),
        origin=x0,
        goal=movement.goals[0] - x0,
        state=np.vstack((np.zeros(d), movement.velocities_at_start[0] * tau)),
        duration=tau,
        settle=_SETTLED * float(extents.max()),
        n_positions=n_positions,
        via=None
        if via is None
        else ViaPlaces(via.times, via.points[0, :, columns] - x0[columns], MISSED * float(extents.max())),
    )

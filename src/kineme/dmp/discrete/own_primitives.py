"""Generated movements as primitives: what was asked for becomes what they do by themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kineme.dmp.discrete.learned import Learned
from kineme.dmp.discrete.rollout import Rollout
from kineme.errors import SpecificationError


def own_primitives(movement: Rollout) -> Learned:
    """The movements as n primitives of their own: each with this start, goal, velocity, duration and weights.

    Raises
    ------
    SpecificationError
        A goal that moves.
    """
    if movement.goal_velocities is not None and movement.goal_velocities.any():
        raise SpecificationError(
            "expected movements to goals at rest, got goal_velocity= other than 0: primitives know no goals that move; "
            "give it to their rollout, or to controller.step, or use end_velocity= to go on at the goal"
        )
    some = movement.primitives
    some = some if len(some) == len(movement) else some[np.zeros(len(movement), dtype=np.intp)]
    weights = some.scaled_weights * movement.ratio[:, :, None]
    if movement.change is not None:
        weights += movement.change.coefficients @ movement.change.directions
    return replace(
        some,
        scaled_weights=weights,
        starts=movement.starts.copy(),
        goals=movement.goals.copy(),
        velocities=movement.velocities_at_start.copy(),
        durations=movement.durations.copy(),
    )

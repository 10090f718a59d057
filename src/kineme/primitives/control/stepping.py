"""Which twin carries a movement on, decided once."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from kineme.primitives.control.advance import advance
from kineme.primitives.control.obstacles import ObstacleAvoidance
from kineme.primitives.control.plan import Influences, Plan
from kineme.primitives.control.shape_table import shape_table
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

Advance = Callable[[Array, float, float, Influences], Array]

_A_LONG_LIFE = 10**12  # operations: a controller is made to run for many steps, however small each of them is


def stepper(plan: Plan, avoidance: ObstacleAvoidance) -> Advance:
    """The function ``advance(state, u, du, influences)`` for this plan.

    Compiled, unless ``KINEME_COMPILED=never``: what that costs - Numba's import, loading or building the machine code,
    tabulating the shape - is spent here, so that no step waits for it.
    """
    return _compiled(plan, avoidance) if use_compiled(_A_LONG_LIFE) else partial(advance, plan, avoidance)


def _compiled(plan: Plan, avoidance: ObstacleAvoidance) -> Advance:
    compiled = compiled_module("kineme.primitives.control._compiled")
    table, d = tuple(shape_table(plan)), plan.n_dims
    spring = (plan.K, plan.D, plan.intervals)
    steering = (float(avoidance.gamma), float(avoidance.beta), avoidance.fading, plan.rounding)

    def advance(state: Array, u: float, du: float, influences: Influences) -> Array:
        motion = np.empty((3, d))
        # Numba takes a plain tuple apart faster than a named one.
        compiled.advance(spring, table, steering, state, u, du, tuple(influences), motion)
        return motion

    row, nowhere = np.zeros(d), np.zeros((0, plan.n_positions))
    advance(np.zeros((2, d)), 0.0, 0.0, Influences(row, row, row, row, nowhere, nowhere))
    return advance

"""What discrete movements are asked for and rhythms are not: refused, with what to ask for instead."""

from __future__ import annotations

from collections.abc import Mapping

from kineme.errors import SpecificationError

_INSTEAD = {
    "goal": "a rhythm goes around its baseline: give baseline=",
    "duration": "a rhythm has no end: give period=, of one cycle, and n_periods=",
    "end_velocity": "a rhythm has no end: on its cycle give via= points, off it the initial velocity=",
    "goal_velocity": "a rollout goes around a baseline at rest: give goal_velocity= to controller.step",
    "position_limits": "a rhythm is not kept within limits: a smaller amplitude=, another baseline= or via= points are",
    "settle": "a rhythm never settles: give n_periods=",
}


def refuse_others(what: str, asked: Mapping[str, object]) -> None:
    """Refuse options that a rhythm does not have.

    Raises
    ------
    SpecificationError
        An option of discrete movements.
    TypeError
        Another name, as of any function.
    """
    for name, value in asked.items():
        if name not in _INSTEAD:
            raise TypeError(f"{what}() got an unexpected keyword argument {name!r}")
        if value is not None:
            raise SpecificationError(f"expected no {name}= for a rhythm; {_INSTEAD[name]}")

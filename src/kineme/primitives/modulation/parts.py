"""The movements that others are made of, and stretches of them: what users give, checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.alike import check_alike
from kineme.primitives.discrete.dmp import Primitives
from kineme.primitives.discrete.rollout import Rollout

#: What to do with parts that are none.
_REMEDIES = {
    "AveragePrimitive": "; pass its primitive, or what it does: average.rollout(via=...)",
    "RhythmicPrimitives": "; a rhythm has no end: record or generate as much of it as is to be moved, and learn that",
    "PosePrimitives": "; orientations are not added: join or blend positions, or learn what several rollouts make",
    "PoseRollout": "; orientations are not added: join or blend positions, or learn what several rollouts make",
    "RhythmicRollout": "; a rhythm has no end: learn what was generated, kineme.DMP().learn(rollout)",
}


def moving(parts: Sequence[Primitives | Rollout]) -> list[Primitives]:
    """All parts as primitives of the same number of movements."""
    if isinstance(parts, (Primitives, Rollout)) or not isinstance(parts, Sequence) or not len(parts):
        raise TrajectoryError(f"expected several movements, as [reach, pour], got {parts!r}")
    for i, one in enumerate(parts):
        if not isinstance(one, (Primitives, Rollout)):
            what, remedy = type(one).__name__, _REMEDIES.get(type(one).__name__, "")
            raise TrajectoryError(f"expected Primitives or Rollout as part {i}, got {what}{remedy}")
    moving = [one if isinstance(one, Primitives) else Primitives.from_rollout(one) for one in parts]
    n = max(len(one) for one in moving)
    for i, one in enumerate(moving):
        if one.n_dims != moving[0].n_dims:
            raise TrajectoryError(f"part {i}: expected {moving[0].n_dims} dimensions as in part 0, got {one.n_dims}")
        if len(one) not in (1, n):
            raise TrajectoryError(f"part {i}: expected one movement or {n}, got {len(one)}")
    check_alike([one.moving_channels for one in moving])
    return [one if len(one) == n else one[np.zeros(n, dtype=np.intp)] for one in moving]


def within(stretch: tuple[float, float], name: str) -> tuple[float, float]:
    """A stretch (begin, end) as shares of the duration."""
    try:
        begin, end = (float(one) for one in stretch)
    except (TypeError, ValueError) as error:
        raise SpecificationError(f"expected {name}=(begin, end), shares of the duration, got {stretch!r}") from error
    if not 0.0 <= begin < end <= 1.0:
        raise SpecificationError(
            f"expected {name} to be 0 <= begin < end <= 1, shares of the duration, got {stretch!r}"
        )
    return begin, end

"""The movements that others are made of, and stretches of them: what users give, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.dmp.pose.pose_rollout import PoseRollout
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.alike import check_alike

_OF_POSES = "; poses are joined with poses, and neither blended nor coupled: learn their positions alone"
#: What to do with parts that are none.
_REMEDIES = {
    "AveragePrimitive": "; pass its primitive, or what it does: average.rollout(via=...)",
    "RhythmicPrimitives": "; a rhythm has no end: record or generate as much of it as is to be moved, and learn that",
    "PosePrimitives": _OF_POSES,
    "PoseRollout": _OF_POSES,
    "RhythmicRollout": "; a rhythm has no end: learn what was generated, kineme.DMP().learn(rollout)",
}


@overload
def moving(parts: Sequence[Primitives | Rollout]) -> list[Primitives]: ...
@overload
def moving(parts: Sequence[Any], poses: bool) -> list[Primitives] | list[PosePrimitives]: ...
def moving(parts: Sequence[Any], poses: bool = False) -> list[Primitives] | list[PosePrimitives]:
    """All parts as primitives of the same number of movements; all of poses where that is possible and the first is."""
    if (
        isinstance(parts, (Primitives, Rollout, PosePrimitives, PoseRollout))
        or not isinstance(parts, Sequence)
        or not len(parts)
    ):
        raise TrajectoryError(f"expected several movements, as [reach, pour], got {parts!r}")
    poses = poses and isinstance(parts[0], (PosePrimitives, PoseRollout))
    expected = (PosePrimitives, PoseRollout) if poses else (Primitives, Rollout)
    for i, one in enumerate(parts):
        if not isinstance(one, expected):
            what, remedy = type(one).__name__, _REMEDIES.get(type(one).__name__, "")
            names = " or ".join(known.__name__ for known in expected)
            raise TrajectoryError(f"expected {names} as part {i}, got {what}{remedy}")
    own: Any = PosePrimitives if poses else Primitives
    moving: Any = [one if isinstance(one, own) else own.from_rollout(one) for one in parts]
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

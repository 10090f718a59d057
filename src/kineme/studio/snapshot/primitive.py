"""One primitive as plain data: what a page needs to let it move."""

from __future__ import annotations

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.studio.snapshot.movements import movement_parts
from kineme.studio.snapshot.snapshot import Snapshot


def snapshot_of_primitive(primitive: Primitives | PosePrimitives) -> Snapshot | None:
    """A batch of one, for `openPrimitive` of the runtime; None if not every column is a position.

    Angles, orientations and discrete values are written in other columns than those that move, which the runtime does
    not know.
    """
    if isinstance(primitive, PosePrimitives) or any(one.kind != "position" for one in primitive.channels or ()):
        return None
    return movement_parts(primitive, learns=False)

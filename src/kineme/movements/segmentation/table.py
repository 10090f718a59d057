"""The table of segmentation methods."""

from __future__ import annotations

from typing import Any, Protocol

from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.change_points import ChangePoints
from kineme.movements.segmentation.motion import Motion
from kineme.movements.segmentation.rest import Rest
from kineme.movements.segmentation.speed_minima import SpeedMinima


class Segmenter(Protocol):
    """A segmentation method: a frozen record of its parameters."""

    @property
    def resolution(self) -> float:
        """Share of the peak speed that has to be told from rest."""
        ...

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, none at the ends."""
        ...

    def pieces(self, motion: Motion) -> Rows:
        """The piece of each movement, rows (n, 2), disjoint and in order; `segment` narrows them to their motion."""
        ...


#: Name -> method.
SEGMENTERS: dict[str, type[Any]] = {"rest": Rest, "speed": SpeedMinima, "change-points": ChangePoints}

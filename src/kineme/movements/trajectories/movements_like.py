"""What is taken for one movement, and for many: the types of public signatures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from kineme.movements.trajectories.trajectory import Trajectory


@runtime_checkable
class HasDemonstrations(Protocol):
    """Whatever holds movements and hands them out: recordings that were read, a segmentation, a rollout."""

    @property
    def demonstrations(self) -> Sequence[Trajectory]:
        """The movements, as `Demonstrations`."""
        ...


#: One movement: a `Trajectory`, or positions of shape (T, d) or (T,), evenly sampled over one second.
MovementLike = Trajectory | ArrayLike

#: Whatever `Demonstrations.of` takes: Demonstrations, recordings that were read, a segmentation, a rollout; one
#: movement; one array of shape (n, T, d); a data frame; or a list of any of these. A list is typed as one of objects:
#: to a type checker that is what a list of a rollout and recordings holds.
MovementsLike = HasDemonstrations | MovementLike | Sequence[object]

"""Base class of records that hold `Demonstrations`: they iterate and index as these do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, overload

from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.presented import Presented, Samples
from kineme.movements.trajectories.trajectory import Trajectory


class MovementSequence(Presented):
    """A sequence of the movements in `demonstrations`, a field or property of the subclass."""

    if TYPE_CHECKING:  # read-only here

        @property
        def demonstrations(self) -> Demonstrations:
            """The movements."""
            ...

    @property
    def _samples(self) -> Samples:
        return self.demonstrations._samples

    def __iter__(self) -> Iterator[Trajectory]:
        return iter(self.demonstrations)

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int] | NDArray[Any]) -> Demonstrations: ...
    def __getitem__(self, index: Any) -> Trajectory | Demonstrations:
        """One `Trajectory` for an integer; `Demonstrations` for a slice, a mask or a list of indices."""
        return self.demonstrations[index]

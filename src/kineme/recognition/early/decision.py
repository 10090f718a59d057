"""The decision for a label during a stream, with hysteresis."""

from __future__ import annotations

from dataclasses import dataclass, field

from kineme.errors import SpecificationError
from kineme.validation import check_number


@dataclass
class Decision:
    """Decide for a label after it has been confident for a while; change it only for one that is so for longer.

    Parameters
    ----------
    confidence : float
        Needed to decide, above 0.5 and below 1: two labels never have it at the same time.
    patience : float
        How long it must be held, as a share of the time since the stream began; twice as long to change a decision.
    """

    confidence: float = 0.9
    patience: float = 0.05
    label: int | None = field(default=None, init=False)
    _candidate: int | None = field(default=None, init=False)
    _since: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        check_number("confidence", self.confidence, above=0.5)
        check_number("patience", self.patience, least=0.0)
        if self.confidence >= 1:
            raise SpecificationError(f"expected confidence below 1, got {self.confidence!r}")

    def clear(self) -> None:
        """Undecided again."""
        self.label = self._candidate = None

    def update(self, elapsed: float, leader: int, share: float) -> int | None:
        """The decided label after the leader's share of the evidence at a time since the start."""
        if share < self.confidence or leader == self.label:
            self._candidate = None
            return self.label
        if leader != self._candidate:
            self._candidate, self._since = leader, elapsed
        needed = self.patience * elapsed * (1 if self.label is None else 2)
        if elapsed - self._since >= needed and (elapsed > self._since or self.patience == 0):
            self.label, self._candidate = leader, None
        return self.label

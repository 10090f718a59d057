"""A sum of ten million small steps that is as good as one product."""

from __future__ import annotations


class RunningSum:
    """Neumaier's compensated sum: what rounding loses is kept and added back.

    A. Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher Summen", ZAMM 54, 1974.
    """

    __slots__ = ("_lost", "_sum")

    def __init__(self) -> None:
        self._sum, self._lost = 0.0, 0.0

    def add(self, step: float) -> None:
        """Add a step of 0 or more."""
        total = self._sum + step
        self._lost += (self._sum - total) + step if self._sum >= step else (step - total) + self._sum
        self._sum = total

    @property
    def value(self) -> float:
        """The sum."""
        return self._sum + self._lost

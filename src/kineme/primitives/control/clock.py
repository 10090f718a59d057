"""Time and phase of a movement under control, without drift over millions of steps."""

from __future__ import annotations

import math


class RunningSum:
    """Neumaier's compensated sum: what rounding loses is kept and added back.

    A. Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher Summen", ZAMM 54, 1974.
    """

    __slots__ = ("_lost", "_sum")

    def __init__(self, start: float = 0.0) -> None:
        self._sum, self._lost = start, 0.0

    def add(self, step: float) -> None:
        """Add a step of 0 or more."""
        total = self._sum + step
        self._lost += (self._sum - total) + step if self._sum >= step else (step - total) + self._sum
        self._sum = total

    def take_whole(self) -> int:
        """Subtract the whole part, which rounds nothing, and return it."""
        whole = math.floor(self.value)
        self._sum -= whole
        return whole

    @property
    def value(self) -> float:
        """The sum."""
        return self._sum + self._lost


class Clock:
    """Seconds and phase since the start.

    The phase is normalized time u; that of a rhythm counts from `begin` and stays below 1, so that it is as exact after
    a million periods as in the first.

    Attributes
    ----------
    time : float
        Seconds since the start.
    u : float
        The phase, of a rhythm within its period.
    progress : float
        The phase since the start.
    """

    __slots__ = ("_begin", "_periodic", "_phase", "_seconds", "_turns", "progress", "time", "u")

    def __init__(self, begin: float, periodic: bool) -> None:
        self._seconds, self._phase = RunningSum(), RunningSum(begin)
        self._begin, self._periodic, self._turns = begin, periodic, 0
        self.time, self.u, self.progress = 0.0, begin, 0.0

    def add_time(self, dt: float) -> None:
        """Let dt [s] pass."""
        self._seconds.add(dt)
        self.time = self._seconds.value

    def add_phase(self, du: float) -> None:
        """Let the phase go on by du."""
        self._phase.add(du)
        self.u = self.progress = self._phase.value
        if self._periodic:
            if self.u >= 1.0:
                self._turns += self._phase.take_whole()
                self.u = self._phase.value
            self.progress = self._turns + self.u - self._begin

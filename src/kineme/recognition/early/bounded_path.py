"""The samples of a stream that may never end, in bounded memory."""

from __future__ import annotations

import numpy as np

from kineme.validation import Array


class BoundedPath:
    """Every sample while there is room; then averages of 2, 4, 8, ... consecutive samples, over the whole stream.

    Averages, because they keep the noise down that leaving samples out would fold into the path. The last sample is
    always kept as it came.
    """

    def __init__(self, capacity: int, n_dims: int) -> None:
        self._rows = np.empty((capacity + 1, n_dims + 1))  # time, position; one more for the last sample
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._count, self.per_row, self._pending = 0, 1, 0
        self._sum = np.zeros(self._rows.shape[1])
        self.last: Array | None = None

    def append(self, time: float, position: Array) -> None:
        """Add one sample."""
        row = np.concatenate(([time], position))
        self.last = row
        self._sum += row
        self._pending += 1
        if self._pending < self.per_row:
            return
        if self._count == len(self._rows) - 1:
            self._halve()
            if self._pending < self.per_row:
                return
        self._rows[self._count] = self._sum / self._pending
        self._count += 1
        self._sum[:] = 0.0
        self._pending = 0

    def _halve(self) -> None:
        even = self._count // 2 * 2
        self._rows[: even // 2] = 0.5 * (self._rows[0:even:2] + self._rows[1:even:2])
        self._count, self.per_row = even // 2, 2 * self.per_row

    def kept(self) -> Array:
        """Times and positions (k, 1 + d); they share memory, and are valid until the next sample."""
        if self.last is None or self.per_row == 1:
            return self._rows[: self._count]
        if self._count and self._rows[self._count - 1, 0] >= self.last[0]:
            return self._rows[: self._count]
        self._rows[self._count] = self.last
        return self._rows[: self._count + 1]

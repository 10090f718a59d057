"""What comes in a stream, in the coordinates that were learned, sample by sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.movements.channels.channel import Channels, recorded_names
from kineme.movements.channels.incremental import IncrementalCoordinates
from kineme.recognition.early.live_state import LiveStatus
from kineme.validation import Array


class Samples:
    """Checks times and positions that arrive, and converts recorded columns as `as_learned` does whole movements.

    The first sample of a movement tells whether its rows are recorded columns or coordinates; the others are as wide.
    """

    def __init__(self, channels: Channels | None, n_dims: int) -> None:
        self._n_dims = n_dims
        self._n_columns = n_dims if channels is None else len(recorded_names(channels))
        plain = channels is None or all(one.kind == "position" for one in channels)
        self._coordinates = None if channels is None or plain else IncrementalCoordinates(channels)
        self.clear()

    def clear(self) -> None:
        """Forget the movement; the next sample begins a new one."""
        self._width: int | None = None
        self._last = -np.inf
        if self._coordinates is not None:
            self._coordinates.clear()

    def take(self, t: ArrayLike, x: ArrayLike) -> tuple[Array, Array, LiveStatus, int]:
        """Times (k,) and coordinates (k, d) that can be used, what is wrong with others, and how many those are.

        Of a call in a wrong shape one is counted.
        """
        try:
            times, rows = np.atleast_1d(np.asarray(t, dtype=float)), np.asarray(x, dtype=float)
            rows = rows.reshape(len(times), -1) if np.ndim(t) == 0 else rows
        except (TypeError, ValueError, OverflowError):
            times, rows = np.empty(0), np.empty((0, 0))
        widths = (self._n_dims, self._n_columns) if self._width is None else (self._width,)
        if times.ndim != 1 or rows.ndim != 2 or len(rows) != len(times) or rows.shape[1] not in widths:
            return np.empty(0), np.empty((0, self._n_dims)), LiveStatus.WRONG_SHAPE, 1
        kept, status = self._usable(times, rows)
        if kept.any():
            self._width, self._last = rows.shape[1], float(times[kept][-1])
        return times[kept], self._converted(rows[kept]), status, int((~kept).sum())

    def _usable(self, times: Array, rows: Array) -> tuple[NDArray[np.bool_], LiveStatus]:
        """Which samples are finite, later than those before, and have quaternions of norm 1."""
        status = LiveStatus(0)
        finite = np.isfinite(times) & np.isfinite(rows).all(axis=1)
        unit = self._are_unit(rows)
        kept, last = np.zeros(len(times), dtype=bool), self._last
        for k, time in enumerate(times.tolist()):
            if not finite[k]:
                status |= LiveStatus.NOT_FINITE
            elif time <= last:
                status |= LiveStatus.TIME_NOT_INCREASING
            elif not unit[k]:
                status |= LiveStatus.NOT_UNIT
            else:
                kept[k], last = True, time
        return kept, status

    def _converts(self, rows: Array) -> IncrementalCoordinates | None:
        return self._coordinates if rows.shape[1] == self._n_columns else None

    def _are_unit(self, rows: Array) -> NDArray[np.bool_]:
        made = self._converts(rows)
        return np.ones(len(rows), dtype=bool) if made is None else made.usable(rows)

    def _converted(self, rows: Array) -> Array:
        made = self._converts(rows)
        return rows if made is None or not len(rows) else made.take(rows)

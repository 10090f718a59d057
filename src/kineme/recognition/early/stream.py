"""Recognition while a movement is still under way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.movements.channels.channel import Channels, is_plain, recorded_names
from kineme.movements.channels.incremental import IncrementalCoordinates
from kineme.movements.preparation.pauses import cut_pauses
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import Answer
from kineme.recognition.early.decision import Decision
from kineme.recognition.early.evidence import describe_begun, log_evidence
from kineme.recognition.early.hypotheses import Hypotheses
from kineme.recognition.early.live_state import Guess, LiveState, LiveStatus
from kineme.recognition.early.prefixes import Prefixes, smoother
from kineme.runtime.compiled import load_compiled
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import N_POINTS
from kineme.similarity.references import References
from kineme.validation import MIN_SAMPLES, Array

N_REMAINING = 20  # samples of the predicted path


CAPACITY = 4096  # samples that are kept one by one


class Live:
    """Follow one movement, sample by sample; `Recognizer.stream` makes it.

    Each update compares the movement so far with the beginnings of every stored movement, at a cost that does not
    depend on how long the stream has been running. Nothing that arrives raises; what cannot be used is skipped,
    counted and flagged. Up to 4096 samples are kept as they came, more as averages, so memory is bounded.
    """

    def __init__(
        self,
        comparison: Comparison,
        references: References,
        hypotheses: Hypotheses,
        decision: Decision,
        recognize: Callable[[Trajectory], Answer],
    ) -> None:
        self._comparison = comparison
        self._references = references
        self._hypotheses = hypotheses
        self._decision = decision
        self._recognize = recognize
        self._path = BoundedPath(CAPACITY, comparison.n_dims)
        self._samples = Samples(comparison.channels, comparison.n_dims)
        self._classes = references.classes.tolist()
        self.reset()
        self._rehearse()

    def _rehearse(self) -> None:
        """Recognize a stored movement once: loading code on first use would delay the stream by 0.3 s."""
        load_compiled()
        example = self._references.demonstrations[np.zeros(1, dtype=np.intp)]
        self.update(example.times, example.positions)
        self.reset()

    @property
    def channels(self) -> Channels | None:
        """What the recorded columns are that `update` takes; None if that is not known."""
        return self._comparison.channels

    def reset(self) -> None:
        """Forget the movement; the next sample begins a new one."""
        self._path.clear()
        self._samples.clear()
        self._decision.clear()
        self.skipped = 0
        self._leader, self._progress = -1, 0.0

    def update(self, t: ArrayLike, x: ArrayLike) -> LiveState:
        """Take in one sample, or a block of them.

        Parameters
        ----------
        t : float or array_like of shape (k,)
            Time stamps [s], increasing.
        x : array_like of shape (d,) or (k, d)
            Positions; or the recorded columns of the `channels`, in their order, quaternions and grippers too, which
            are converted as those of a whole movement.
        """
        status = self._take_in(t, x)
        if self._path.per_row > 1:
            status |= LiveStatus.AVERAGED
        kept = self._path.kept()
        if len(kept) < MIN_SAMPLES or not np.ptp(kept[:, 1:], axis=0).any():
            return self._nothing(status | LiveStatus.TOO_SHORT)
        with single_threaded_blas():  # held once, not for each of many small products
            return self._estimate(kept, status)

    def finish(self) -> Answer:
        """The answer of `Recognizer.recognize` to the whole movement.

        Raises
        ------
        TrajectoryError
            Fewer than four samples could be used.
        """
        return self._recognize(self.movement())

    def movement(self) -> Trajectory:
        """The movement so far, as `finish` recognizes it: without what was skipped, and averaged beyond 4096 samples.

        Raises
        ------
        TrajectoryError
            Fewer than four samples could be used.
        """
        kept = self._path.kept()
        whole = Demonstrations([Trajectory(kept[:, 0].copy(), kept[:, 1:].copy())])
        if self.channels is not None and is_plain(self.channels):  # converted already, and averaged since
            whole = Demonstrations.of_movements(replace(whole.movements, channels=self.channels))
        return whole[0]

    def _take_in(self, t: ArrayLike, x: ArrayLike) -> LiveStatus:
        times, positions, status, skipped = self._samples.take(t, x)
        for time, position in zip(times.tolist(), positions, strict=True):
            self._path.append(time, position)
        self.skipped += skipped
        return status

    def _estimate(self, kept: Array, status: LiveStatus) -> LiveState:
        elapsed = float(kept[-1, 0] - kept[0, 0])
        times, positions = _without_pauses(kept)
        even = self._smooth(times, positions)
        so_far = describe_begun(self._hypotheses, even, kept[:1, 1:], times[-1:] - times[0])
        evidence = log_evidence(self._hypotheses, so_far)
        shares = self._hypotheses.shares(evidence)[0]
        order = np.argsort(-shares[:-1], kind="stable")
        leader = int(order[0])
        decided = self._decision.update(elapsed, leader, float(shares[leader]))
        shown = leader if decided is None else decided
        ahead = forecast(self._hypotheses, evidence[0], shown, so_far.prefixes, float(so_far.durations[0]))
        self._progress = max(ahead.progress, self._progress if shown == self._leader else 0.0)
        self._leader = shown
        path = kept[-1, 1:] + ahead.path
        return LiveState(
            tuple(Guess(self._classes[c], float(shares[c])) for c in order.tolist()),
            float(shares[-1]),
            None if decided is None else self._classes[decided],
            min(self._progress, 1.0),
            path,
            path[-1],
            float(kept[-1, 0]) + ahead.seconds,
            self.skipped,
            status | (LiveStatus.UNDECIDED if decided is None else LiveStatus.DECIDED),
        )

    def _smooth(self, times: Array, positions: Array) -> Array:
        """The samples so far, at even times and smoothed like the stored movements: (1, d, T)."""
        targets = np.linspace(times[0], times[-1], N_POINTS)
        even = np.stack([np.interp(targets, times, column - column[0]) for column in positions.T])
        cutoff = self._comparison.cutoff
        return np.asarray(even if cutoff is None else even @ smoother(float(cutoff)).T)[None]

    def _nothing(self, status: LiveStatus) -> LiveState:
        status |= LiveStatus.UNDECIDED
        return LiveState((), 1.0, None, 0.0, None, None, math.nan, self.skipped, status)


def _without_pauses(kept: Array) -> tuple[Array, Array]:
    """Times and positions of samples (k, 1 + d), as those of stored movements are described."""
    times, positions = np.ascontiguousarray(kept[:, 0]), np.ascontiguousarray(kept[:, 1:])
    cut = cut_pauses(times, positions, np.array([0, len(kept)]))
    return (times, positions) if cut is None else cut[:2]


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


class Forecast(NamedTuple):
    """Progress, seconds left, and the remaining path relative to the present position, (20, d)."""

    progress: float
    seconds: float
    path: Array


def forecast(stored: Hypotheses, evidence: Array, label: int, begun: Prefixes, duration: float) -> Forecast:
    """Progress and time left on average over a class's hypotheses, the path from its best one.

    Parameters
    ----------
    evidence : ndarray of shape (m * G,)
        Logarithms, see `log_evidence`.
    label : int
        Index of the class.
    duration : float
        Time since the start [s].

    Notes
    -----
    If `duration` is the share e of the demonstrated time, ``duration (1 - e) / e`` is left. The remaining part of the
    stored path is turned and sized as the beginning was, and put to where the movement is now.
    """
    G = len(stored.progress)
    end = int(stored.first[label + 1]) if label + 1 < len(stored.first) else len(stored.durations)
    own = np.arange(int(stored.first[label]) * G, end * G)
    logs = evidence[own]
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    elapsed = np.maximum(stored.prefixes.elapsed[own], 1e-3)
    best = int(own[logs.argmax()])
    movement = best // G
    path = stored.paths[movement]
    times = np.linspace(0.0, 1.0, path.shape[1])
    remaining_times = np.linspace(stored.prefixes.elapsed[best], 1.0, N_REMAINING)
    remaining = np.stack([np.interp(remaining_times, times, row) for row in path])
    remaining = remaining - remaining[:, :1]
    R = stored.procrustes.rotations(begun.positions, stored.prefixes.positions[best : best + 1])[0]
    size = begun.sizes[0] / stored.prefixes.sizes[best] if stored.prefixes.sizes[best] > 0 else 1.0
    return Forecast(
        float(weights @ np.tile(stored.progress, len(own) // G)),
        float(weights @ ((1.0 - elapsed) / elapsed)) * duration,
        size * (R @ remaining).T,
    )


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

"""Recognition while a movement is still under way, and the decision for a label, with hysteresis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, recorded_names
from kineme.movements.channels.incremental import IncrementalCoordinates
from kineme.movements.preparation.glitches import without_glitches
from kineme.movements.preparation.pauses import cut_pauses
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import Answer
from kineme.recognition.early.earlier import Earlier, earlier, remembered, with_earlier
from kineme.recognition.early.evidence import describe_begun, log_evidence
from kineme.recognition.early.hypotheses import ALLOWANCE, Hypotheses, Prefixes, smoother
from kineme.recognition.early.live_state import Guess, LiveState, LiveStatus
from kineme.reporting.text import counted
from kineme.runtime.compiled import load_compiled
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import N_POINTS
from kineme.validation import LARGEST_POSITION, LARGEST_STAMP, MIN_SAMPLES, Array, check_number

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
        self._stored = self._hypotheses = hypotheses
        self._earlier: list[Earlier] = []
        self._decision = decision
        self._recognize = recognize
        self._path = BoundedPath(CAPACITY, comparison.n_dims)
        self._incoming = Samples(comparison.channels, comparison.n_dims)
        self._classes = references.classes.tolist()
        self.reset()
        # A stored movement is recognized now: loading code on first use would delay the stream by 0.3 s.
        load_compiled()
        example = references.demonstrations[np.zeros(1, dtype=np.intp)]
        self.update(example.times, example.positions)
        self.reset()

    @property
    def channels(self) -> Channels | None:
        """Channels of the recorded columns that `update` takes; None if they are not known."""
        return self._comparison.channels

    def reset(self, person: bool = False) -> None:
        """Forget the movement; the next sample begins a new one.

        Parameters
        ----------
        person : bool, default False
            Forget the movements that `next` remembers, too: another person goes on.
        """
        if person:
            self._hypotheses, self._earlier = self._stored, []
        self._path.clear()
        self._incoming.clear()
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
        times, positions, status, skipped = self._incoming.take(t, x)
        for time, position in zip(times.tolist(), positions, strict=True):
            self._path.append(time, position)
        self.skipped += skipped
        if self._path.per_row > 1:
            status |= LiveStatus.AVERAGED
        samples = self._path.kept()
        if len(samples) < MIN_SAMPLES or not np.ptp(samples[:, 1:], axis=0).any():
            status |= LiveStatus.TOO_SHORT | LiveStatus.UNDECIDED
            return LiveState((), 1.0, None, 0.0, None, None, math.nan, self.skipped, status)
        with single_threaded_blas():  # held once, not for each of many small products
            return self._estimate(samples, status)

    def finish(self, until: float | None = None) -> Answer:
        """Return the answer of `Recognizer.recognize` to the whole movement.

        Parameters
        ----------
        until : float, optional
            Stamp after which samples do not count [s]: where a rest shows that the movement is over, its beginning.

        Raises
        ------
        TrajectoryError
            Fewer than four samples could be used.
        """
        return self._recognize(self.movement(until))

    def next(self) -> Answer:
        """Return the answer of `finish`, and begin the next movement by the same person.

        A movement that the answer names with the confidence at which the stream decides is remembered, the last three
        of each class: the beginnings of the next ones are compared with it, too, and the demonstrations count as larger
        and slower by the median ratio of the person's movements to them. What `finish` and `next` answer to a whole
        movement does not depend on it. See `kineme.recognition.early.earlier`.

        Raises
        ------
        TrajectoryError
            Fewer than four samples could be used. `reset` begins the next movement then.
        """
        answer = self.finish()
        self.remember(answer)
        self.reset()
        return answer

    def remember(self, answer: Answer, until: float | None = None) -> None:
        """Remember the movement for the next ones by the same person, as `next` does; `reset` begins them.

        `answer` and `until` are those of `finish`: who waits for the answer need not wait for this.
        """
        if answer.label is not None and answer.confidence >= self._decision.confidence:
            label = self._classes.index(answer.label)
            own = earlier(self._stored, self._comparison.checked([self.movement(until)]), label)
            self._earlier = remembered(self._earlier, own)
            self._hypotheses = with_earlier(self._stored, self._earlier)

    def movement(self, until: float | None = None) -> Trajectory:
        """Return the movement so far, as `finish` recognizes it: without what was skipped, averaged after 4096 samples.

        Raises
        ------
        TrajectoryError
            Fewer than four samples could be used.
        """
        samples = self._path.kept()
        if until is not None:
            samples = samples[samples[:, 0] <= until]
        if len(samples) < MIN_SAMPLES:
            skipped = f" and {counted(self.skipped, 'sample')} skipped" if self.skipped else ""
            raise TrajectoryError(
                f"expected a movement of at least {MIN_SAMPLES} samples since the stream began it, got {len(samples)}"
                f"{skipped}; update it with more first, or drop these by reset()"
            )
        movement = Demonstrations([Trajectory(samples[:, 0].copy(), samples[:, 1:].copy())])
        if self.channels is not None and is_plain(self.channels):  # converted already, and averaged since
            movement = Demonstrations.of_movements(replace(movement.movements, channels=self.channels))
        return movement[0]

    def _estimate(self, samples: Array, status: LiveStatus) -> LiveState:
        elapsed = float(samples[-1, 0] - samples[0, 0])
        recorded = np.ascontiguousarray(samples[:, 1:])
        clean = np.ascontiguousarray(samples[:, 0]), without_glitches(recorded, np.array([0, len(samples)]))
        times, positions = _without_pauses(*clean, ALLOWANCE)
        how, unpaused = self._comparison.specification, _without_pauses(*clean)
        even = _smooth(times, positions, how.cutoff)
        whole = _smooth(*unpaused, how.cutoff)
        if how.are_signals(positions.shape[1]):
            unpaused = _without_pauses(*clean, rests=False)
        details = _smooth(*unpaused, how.detailed_cutoff) if how.detailed else whole
        so_far = describe_begun(self._hypotheses, even, samples[:1, 1:], times[-1:] - times[0], (whole, details))
        evidence = log_evidence(self._hypotheses, so_far)
        shares = self._hypotheses.shares(evidence)[0]
        order = np.argsort(-shares[:-1], kind="stable")
        leader = int(order[0])
        decided = self._decision.update(elapsed, leader, float(shares[leader]))
        shown = leader if decided is None else decided
        ahead = forecast(self._hypotheses, evidence[0], shown, so_far.prefixes, float(so_far.durations[0]))
        self._progress = max(ahead.progress, self._progress if shown == self._leader else 0.0)
        self._leader = shown
        path = samples[-1, 1:] + ahead.path
        return LiveState(
            tuple(Guess(self._classes[c], float(shares[c])) for c in order.tolist()),
            float(shares[-1]),
            None if decided is None else self._classes[decided],
            min(self._progress, 1.0),
            path,
            path[-1],
            float(samples[-1, 0]) + ahead.seconds,
            self.skipped,
            status | (LiveStatus.UNDECIDED if decided is None else LiveStatus.DECIDED),
        )


def _smooth(times: Array, positions: Array, cutoff: float | None) -> Array:
    """Return the samples so far, at even times and smoothed like the stored movements: (1, d, T)."""
    targets = np.linspace(times[0], times[-1], N_POINTS)
    even = np.stack([np.interp(targets, times, column - column[0]) for column in positions.T])
    return np.asarray(even if cutoff is None else even @ smoother(float(cutoff)).T)[None]


def _without_pauses(
    times: Array, positions: Array, allowance: float = 1.0, *, rests: bool = True
) -> tuple[Array, Array]:
    """Return times (k,) and positions (k, d), as those of stored movements are described."""
    cut = cut_pauses(times, positions, np.array([0, len(times)]), allowance, rests=rests)
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
            even = self._count // 2 * 2
            self._rows[: even // 2] = 0.5 * (self._rows[0:even:2] + self._rows[1:even:2])
            self._count, self.per_row = even // 2, 2 * self.per_row
            if self._pending < self.per_row:
                return
        self._rows[self._count] = self._sum / self._pending
        self._count += 1
        self._sum[:] = 0.0
        self._pending = 0

    def kept(self) -> Array:
        """Return times and positions (k, 1 + d); they share memory, and are valid until the next sample."""
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
    """Return progress and time left on average over a class's hypotheses, the path from its best one.

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
        plain = channels is None or all(channel.kind == "position" for channel in channels)
        self._coordinates = None if channels is None or plain else IncrementalCoordinates(channels)
        self.clear()

    def clear(self) -> None:
        """Forget the movement; the next sample begins a new one."""
        self._width: int | None = None
        self._last = -np.inf
        if self._coordinates is not None:
            self._coordinates.clear()

    def take(self, t: ArrayLike, x: ArrayLike) -> tuple[Array, Array, LiveStatus, int]:
        """Return times (k,) and coordinates (k, d) that can be used, what is wrong with others, and how many those are.

        Of a call in a wrong shape one is counted.
        """
        try:
            # What is masked is no number, and is skipped as others that are none.
            t, x = (np.ma.filled(v.astype(float), np.nan) if np.ma.isMaskedArray(v) else v for v in (t, x))
            times, rows = np.atleast_1d(np.asarray(t, dtype=float)), np.asarray(x, dtype=float)
            rows = rows.reshape(len(times), -1) if np.ndim(t) == 0 else rows
        except (TypeError, ValueError, OverflowError):
            times, rows = np.empty(0), np.empty((0, 0))
        widths = (self._n_dims, self._n_columns) if self._width is None else (self._width,)
        if times.ndim != 1 or rows.ndim != 2 or len(rows) != len(times) or rows.shape[1] not in widths:
            return np.empty(0), np.empty((0, self._n_dims)), LiveStatus.WRONG_SHAPE, 1
        coordinates = self._coordinates if rows.shape[1] == self._n_columns else None
        unit = np.ones(len(rows), dtype=bool) if coordinates is None else coordinates.usable(rows)
        usable, status = self._usable(times, rows, unit)
        if usable.any():
            self._width, self._last = rows.shape[1], float(times[usable][-1])
        positions = rows[usable]
        if coordinates is not None and len(positions):
            positions = coordinates.take(positions)
        return times[usable], positions, status, int((~usable).sum())

    def _usable(self, times: Array, rows: Array, unit: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], LiveStatus]:
        """Tell which samples are in range, later than those before, and have quaternions of norm 1 (`unit`)."""
        status = LiveStatus(0)
        finite = (np.abs(times) <= LARGEST_STAMP) & (np.abs(rows) <= LARGEST_POSITION).all(axis=1)
        usable, last = np.zeros(len(times), dtype=bool), self._last
        for k, time in enumerate(times.tolist()):
            if not finite[k]:
                status |= LiveStatus.NOT_FINITE
            elif time <= last:
                status |= LiveStatus.TIME_NOT_INCREASING
            elif not unit[k]:
                status |= LiveStatus.NOT_UNIT
            else:
                usable[k], last = True, time
        return usable, status


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
        """Forget the decision."""
        self.label = self._candidate = None

    def update(self, elapsed: float, leader: int, share: float) -> int | None:
        """Return the decided label after the leader's share of the evidence at a time since the start."""
        if not share >= self.confidence or leader == self.label:  # of NaN, too
            self._candidate = None
            return self.label
        if leader != self._candidate:
            self._candidate, self._since = leader, elapsed
        needed = self.patience * elapsed * (1 if self.label is None else 2)
        if elapsed - self._since >= needed and (elapsed > self._since or self.patience == 0):
            self.label, self._candidate = leader, None
        return self.label

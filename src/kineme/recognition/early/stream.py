"""Recognition while a movement is still under way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from kineme.comparison.comparison import Comparison
from kineme.comparison.describe import N_POINTS
from kineme.comparison.references import References
from kineme.movements.channels.channel import Channels, is_plain
from kineme.movements.preparation.pauses import cut_pauses
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import Answer
from kineme.recognition.early.bounded_path import BoundedPath
from kineme.recognition.early.decision import Decision
from kineme.recognition.early.evidence import describe_begun, log_evidence
from kineme.recognition.early.forecast import forecast
from kineme.recognition.early.hypotheses import Hypotheses
from kineme.recognition.early.live_state import Guess, LiveState, LiveStatus
from kineme.recognition.early.prefixes import smoother
from kineme.recognition.early.samples import Samples
from kineme.runtime.compiled import load_compiled
from kineme.runtime.parallel import single_threaded_blas
from kineme.validation import MIN_SAMPLES, Array

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

"""Monitoring of a movement that is executed: inside what was shown of it, or not, and since when.

The demonstrations p(s) are compared at equal phase s, the share of their length that is done. Of each phase the mean
and the covariance C(s) are known of two things together: the position, and the displacement over the last eighth of the
path, which tells a push that the position alone hides where demonstrations differ. The distance of an execution is

    a = sqrt(e' C(s)^-1 e),    e = [x - mean x(s), dx - mean dx(s)]    (P. C. Mahalanobis, 1936),

at the phase that an open-end alignment by dynamic programming finds (P. Tormene et al., "Matching incomplete time
series with dynamic time warping", Artificial Intelligence in Medicine 45, 2009): from one step of the path to the next
the phase stays, or goes on by up to three steps, and what is long past is forgotten. Time does not count, so a movement
may wait, or be slow. In trials on strokes and gestures by other people the displacement doubled the pushes that are
noticed; size and orientation fitted to the beginning, or the rest conditioned on what was executed, noticed fewer.

The largest distance of an execution is compared with that of demonstrations that were left out (V. Vovk, A. Gammerman,
G. Shafer, "Algorithmic Learning in a Random World", Springer 2005, chapter 4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.coordinates import turns_beyond
from kineme.movements.preparation.resample import resample_by_arc_length
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.conformal import check_error_rate
from kineme.recognition.early.live_state import LiveState, LiveStatus
from kineme.recognition.early.stream import CAPACITY, BoundedPath, Live, Samples
from kineme.validation import LARGEST_POSITION, Array, check_number

Phases = NDArray[np.intp]

N_PHASES = 64  # of a path; a step is the mean length over this
_LAG = 8  # steps of the displacement
_DENSE = 4 * N_PHASES  # samples that demonstrations are followed by: at most one step each, up to four mean lengths
_BEAM = 60.0  # cost above that of the best alignment, up to which one goes on
_FORWARD = 3  # phases that one step may go on by
_BEGINNING = 4  # phases at which an execution may begin
_FORGETTING = 0.8  # of the cost of an alignment, at each step
_OWN, _COMMON = 0.1, 0.02  # of the variance at a phase, and of its mean over phases: added in all directions
_PRIOR, _SPREAD = 2.0, 0.1  # demonstrations that are added, and their standard deviation in sizes of the movement
_FOLDS = 20  # without groups
_GUESS, _MARGIN = 2.0, 1.5  # threshold from one demonstration; times the largest distance of two to too few


class Spread(NamedTuple):
    """Mean and covariance C of position and displacement at P = 64 even shares of the length."""

    mean: Array  # (P, 2 d)
    whitening: Array  # W with W' W = C^-1, lower triangular, (P, 2 d, 2 d)
    log_determinants: Array  # of C, (P,)

    @property
    def step(self) -> float:
        """Length of the mean path between two phases, in the unit of the movements."""
        positions = self.mean[:, : self.mean.shape[1] // 2]
        return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()) / N_PHASES


@dataclass(frozen=True, eq=False)
class Corridor:
    """What was shown of a movement at each phase, and the distances that demonstrations reach that were left out.

    - `spread`: mean and covariance.
    - `threshold`, `end_threshold`: the largest distance inside what was shown; and from the end, where one has ended.
    - `least_end`: the least phase at which one has ended.
    - `calibrated`: tells whether at most about a share `error_rate` of such movements exceed the threshold. Else it is
      a guess: fewer than ``1 / error_rate - 1`` demonstrations were there.
    - `relative`: tells whether positions count from the first sample of an execution.
    """

    spread: Spread
    threshold: float = _GUESS
    end_threshold: float = _GUESS
    least_end: float = 0.8
    error_rate: float = 0.05
    calibrated: bool = False
    relative: bool = True


def corridor(
    paths: Array,
    groups: Sequence[Any] | None = None,
    error_rate: float = 0.05,
    noise: float = 0.0,
    relative: bool = True,
) -> Corridor:
    """Return what paths show, with thresholds that hold for paths of other groups.

    Parameters
    ----------
    paths : ndarray of shape (n, T, d)
        Even samples of each demonstration, from where an execution would begin.
    groups : sequence of n, optional
        Who showed each: those of one group are left out together. By default each is on its own, in at most 20 folds.
    error_rate : float, default 0.05
        Share of executions like the demonstrations that are called outside.
    noise : float, default 0.0
        Standard deviation of measured positions, in their unit.

    Raises
    ------
    SpecificationError
        An error rate outside 0 to 1, a negative noise.
    TrajectoryError
        No path.
    """
    check_error_rate(error_rate)
    check_number("noise", noise, least=0.0)
    n = len(paths)
    if not n:
        raise TrajectoryError("expected at least one demonstration to monitor by, got none")
    rows = np.ascontiguousarray(paths.transpose(0, 2, 1))
    even = resample_by_arc_length(rows, N_PHASES).transpose(0, 2, 1)
    dense = resample_by_arc_length(rows, _DENSE).transpose(0, 2, 1)
    folds = np.arange(n) % min(n, _FOLDS) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
    if len(np.unique(folds)) == 1:  # one demonstration, or one person: nothing can be said of other people
        folds = np.arange(n) % min(n, _FOLDS)
    scores = np.full((3, n), np.nan)
    for fold in np.unique(folds) if n > 1 else ():
        own = folds == fold
        scores[:, own] = _follow(_fit(even[~own], noise), dense[own])
    limits = [_limit(scores[0], error_rate), _limit(scores[1], error_rate), float(scores[2].min())]
    calibrated = math.ceil((n + 1) * (1.0 - error_rate) - 1e-9) <= n
    if n == 1:
        limits = [_GUESS, _GUESS, Corridor.least_end]
    elif not calibrated:
        limits[:2] = [_MARGIN * limit for limit in limits[:2]]
    threshold, end_threshold, least_end = limits
    spread = _fit(even, noise)
    return Corridor(spread, threshold, end_threshold, least_end, error_rate, calibrated, relative)


def _limit(scores: Array, error_rate: float) -> float:
    """Return the score that one more exceeds with probability `error_rate`, or the largest of too few (n,)."""
    rank = math.ceil((len(scores) + 1) * (1.0 - error_rate) - 1e-9)
    return float(np.sort(scores)[min(rank, len(scores)) - 1])


def _with_displacement(path: Array) -> Array:
    """Return positions (..., P, d) and displacements over the last `_LAG` of them: (..., P, 2 d)."""
    before = path[..., np.maximum(np.arange(path.shape[-2]) - _LAG, 0), :]
    return np.concatenate((path, path - before), axis=-1)


def _fit(paths: Array, noise: float) -> Spread:
    """Return mean and covariance at each phase, of paths (n, P, d)."""
    n, _, d = paths.shape
    features = _with_displacement(paths)
    mean = features.mean(axis=0)
    deviations = (features - mean).transpose(1, 2, 0)  # (P, 2 d, n)
    size = float(np.linalg.norm(np.ptp(mean[:, :d], axis=0)))
    total = n - 1 + _PRIOR
    covariance = deviations @ deviations.transpose(0, 2, 1) / total
    halves = np.diagonal(covariance, axis1=1, axis2=2).reshape(-1, 2, d).mean(axis=2)  # (P, 2)
    added = _OWN * halves + _COMMON * halves.mean(axis=0) + _PRIOR / total * (_SPREAD * size) ** 2
    added += noise**2 * np.array([1.0, 2.0])
    covariance += np.repeat(added, d, axis=1)[:, :, None] * np.eye(2 * d)
    factor = np.linalg.cholesky(covariance)
    log_determinants = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    return Spread(mean, np.linalg.inv(factor), log_determinants)


def _begin(n: int) -> Array:
    """Return costs (n, P) of phases before anything is executed."""
    phases = np.arange(N_PHASES)
    return np.tile(np.where(phases < _BEGINNING, 0.2 * phases, np.inf), (n, 1))


def _advance(shown: Spread, costs: Array, features: Array) -> tuple[Array, Phases, Array]:
    """Align one step more, with features (n, 2 d).

    Return the cost of each phase (n, P), infinite where no alignment leads that is worth going on; the nearest phase
    (n,); and the squared distance there (n,).
    """
    worth = np.flatnonzero((costs < _BEAM).any(axis=0))
    near = slice(int(worth[0]), min(int(worth[-1]) + _FORWARD + 1, N_PHASES))
    reached = costs[:, near].copy()
    for j in range(1, min(_FORWARD, reached.shape[1] - 1) + 1):
        np.minimum(reached[:, j:], costs[:, near][:, :-j], out=reached[:, j:])
    errors = features[:, None] - shown.mean[near]
    whitened = np.matmul(shown.whitening[near], errors[..., None])[..., 0]
    squares = np.einsum("npk,npk->np", whitened, whitened)
    reached = _FORGETTING * reached + 0.5 * (squares + shown.log_determinants[near])
    rows, best = np.arange(len(reached)), reached.argmin(axis=1)
    after = np.full(costs.shape, np.inf)
    after[:, near] = reached - reached[rows, best][:, None]
    return after, best + near.start, squares[rows, best]


def _follow(shown: Spread, paths: Array) -> tuple[Array, Array, Array]:
    """Return of dense paths (n, T, d) the largest distance, the distance from the end at the end, and the last phase.

    The loop over samples takes all paths at once.
    """
    n, n_samples = paths.shape[:2]
    step = shown.step
    last = paths[:, 0].copy()
    recent = np.tile(last[:, None], (1, _LAG + 1, 1))
    costs, phases, largest = _advance(shown, _begin(n), np.hstack((last, np.zeros_like(last))))
    for t in range(1, n_samples):
        gaps = paths[:, t] - last
        lengths = np.sqrt(np.einsum("nd,nd->n", gaps, gaps))
        moved = np.flatnonzero(lengths >= step)
        if not len(moved):
            continue
        last[moved] += gaps[moved] * (step / lengths[moved, None])
        recent[moved, :-1] = recent[moved, 1:]
        recent[moved, -1] = last[moved]
        features = np.hstack((last[moved], last[moved] - recent[moved, 0]))
        costs[moved], phases[moved], squares = _advance(shown, costs[moved], features)
        largest[moved] = np.maximum(largest[moved], squares)
    ends = np.hstack((paths[:, -1], paths[:, -1] - recent[:, 0]))
    return np.sqrt(largest), _end_distance(shown, ends), phases / (N_PHASES - 1)


def _end_distance(shown: Spread, features: Array) -> Array:
    """Return the distance (n,) of features (n, 2 d) from those at the end."""
    return np.asarray(np.linalg.norm((features - shown.mean[-1]) @ shown.whitening[-1].T, axis=1))


def _by_arc_length(demos: Demonstrations) -> Array:
    """Return positions at even shares of the length, relative to the first: (n, `_DENSE`, d).

    Linear, as executions are followed: a spline through stamps that are far apart leads elsewhere.
    """
    positions, offsets = demos.positions, demos.offsets
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    steps[offsets[1:-1] - 1] = steps.max()  # between movements
    lengths = np.concatenate(([0.0], np.cumsum(steps)))
    targets = np.linspace(lengths[offsets[:-1]], lengths[offsets[1:] - 1], _DENSE, axis=1)
    rows = np.stack([np.interp(targets, lengths, column) for column in positions.T], axis=2)
    return np.asarray(rows - rows[:, :1])


def jitter(movements: MovementsLike) -> float:
    """Return the standard deviation of the noise of samples, in the unit of positions, from their third differences."""
    demos = Demonstrations.of(movements)
    thirds = np.abs(np.diff(demos.positions, 3, axis=0))
    return float(np.median(thirds)) / (0.6745 * math.sqrt(20.0)) if len(thirds) else 0.0


class MonitorState(NamedTuple):
    """An execution so far.

    - `time`: stamp of the last sample that could be used [s]; NaN before the first.
    - `phase`: share of the mean path that is done, 0 to 1, at the nearest phase.
    - `distance`: from the mean there, in standard deviations of the demonstrations (Mahalanobis, of position and
      displacement). It changes with each step of a 64th of the path; where nothing moves it stays.
    - `deviation`: the same of the position, in the unit of the movements.
    - `largest`: the largest distance so far.
    - `threshold`: the largest distance inside what was shown.
    - `since`: stamp at which a distance was first above the threshold [s]; NaN while none was.
    - `calibrated`: tells whether the threshold keeps the error rate; see `Corridor`.
    - `skipped`: samples that could not be used so far.
    - `status`: what was wrong with the samples of this update.
    """

    time: float
    phase: float
    distance: float
    deviation: float
    largest: float
    threshold: float
    since: float
    calibrated: bool
    skipped: int
    status: LiveStatus

    @property
    def inside(self) -> bool:
        """Tell whether the movement is inside what was shown, now."""
        return self.distance <= self.threshold

    @property
    def in_words(self) -> str:
        """Words for a person: inside, or outside since when and how far."""
        if math.isnan(self.time):
            return "nothing yet"
        words = "inside what was shown" if self.inside else "outside what was shown"
        if not math.isnan(self.since):
            words += f", first left at {self.since:.2f} s"
        words += f": {self.distance:.1f} standard deviations (up to {self.threshold:.1f}), {self.deviation:.3g} away"
        return words if self.calibrated else f"{words}; uncalibrated"


class Execution(NamedTuple):
    """A movement that is over: where it ended, and its last state.

    - `ended`: tells whether it ended where such movements end, as far along the path and as near to its end as they do.
    - `end_distance`: from the mean at the end, in standard deviations, up to the corridor's `end_threshold`.
    - `end_deviation`: the same of the position, in the unit of the movements.
    """

    ended: bool
    end_distance: float
    end_deviation: float
    state: MonitorState

    @property
    def inside(self) -> bool:
        """Tell whether it never left what was shown."""
        return math.isnan(self.state.since)

    @property
    def in_words(self) -> str:
        """Words for a person."""
        where = "ended where such movements end" if self.ended else "did not end where such movements end"
        return f"{where}, {self.end_deviation:.3g} from it; {self.state.in_words}"


class Monitor:
    """Follow one execution of a movement, sample by sample; `kineme.ActionLibrary.monitor` or `of` makes it.

    Nothing that arrives raises; what cannot be used is skipped, counted and flagged, as by `Live`. Where the corridor
    is in absolute positions, angles with one of `periods` (d,) are taken in the turn in which it begins.
    """

    def __init__(
        self,
        shown: Corridor,
        channels: Channels | None = None,
        stream: Callable[[], Live] | None = None,
        periods: Array | None = None,
    ) -> None:
        self.shown = shown
        self._periods = np.full(shown.spread.mean.shape[1] // 2, np.inf) if periods is None else periods
        self._step, n_dims = shown.spread.step, shown.spread.mean.shape[1] // 2
        self._stream = stream
        self._live: Live | None = None
        self._incoming = Samples(channels, n_dims)
        self._path = BoundedPath(CAPACITY, n_dims)
        self._distances = BoundedPath(CAPACITY, 1)
        self.reset()

    @classmethod
    def of(
        cls,
        movements: MovementsLike,
        groups: Sequence[Any] | None = None,
        *,
        error_rate: float = 0.05,
        noise: float | None = None,
        stream: Callable[[], Live] | None = None,
    ) -> Monitor:
        """Monitor by demonstrations of one movement, wherever an execution begins.

        Parameters
        ----------
        movements, groups, error_rate
            As for `ActionLibrary.learn` and `corridor`.
        noise : float, optional
            Standard deviation of measured positions, in their unit; by default the jitter of the demonstrations.
        stream : callable, optional
            Makes the stream that `recognize` asks, as ``recognizer.stream``.

        Raises
        ------
        SpecificationError
            Groups of another number, an error rate outside 0 to 1, a negative noise.
        """
        demos = Demonstrations.of(movements)
        if groups is not None and len(groups) != len(demos):
            raise SpecificationError(f"expected a group for each of {len(demos)} movements, got {len(groups)}")
        shown = corridor(_by_arc_length(demos), groups, error_rate, jitter(demos) if noise is None else noise)
        return cls(shown, demos.channels, stream)

    def reset(self) -> None:
        """Forget the execution; the next sample begins a new one."""
        for part in (self._incoming, self._path, self._distances):
            part.clear()
        self._costs = _begin(1)
        self._origin: Array | None = None
        self._last = np.empty(0)
        self._recent: list[Array] = []
        self._state = MonitorState(
            math.nan, 0.0, 0.0, 0.0, 0.0, self.shown.threshold, math.nan, self.shown.calibrated, 0, LiveStatus(0)
        )

    def update(self, t: ArrayLike, x: ArrayLike) -> MonitorState:
        """Take in one sample, or a block of them.

        Parameters
        ----------
        t : float or array_like of shape (k,)
            Time stamps [s], increasing.
        x : array_like of shape (d,) or (k, d)
            Positions, or the recorded columns, as for `Live.update`.
        """
        times, positions, status, skipped = self._incoming.take(t, x)
        self._state = self._state._replace(status=status, skipped=self._state.skipped + skipped)
        for time, position in zip(times.tolist(), positions, strict=True):
            self._path.append(time, position)
            self._take(time, np.clip(position, -LARGEST_POSITION, LARGEST_POSITION))
        return self._state

    def _take(self, time: float, position: Array) -> None:
        """Go as many steps towards a position as fit, and measure the distance at each."""
        if self._origin is None:
            begin = self.shown.spread.mean[0, : len(position)]
            self._origin = position if self.shown.relative else turns_beyond(position[None], begin, self._periods)[0]
            self._last = position - self._origin
            self._recent = [self._last] * (_LAG + 1)
            self._measure(time)
            return
        start = self._last
        gap = position - self._origin - start
        length = math.sqrt(float(gap @ gap))
        n_steps = min(length / self._step, N_PHASES) if self._step > 0 else 0.0  # of a jump, longer ones
        for k in range(1, int(n_steps) + 1):
            self._last = start + gap * (k / n_steps)
            self._recent = [*self._recent[1:], self._last]
            self._measure(time)
        self._state = self._state._replace(time=time)

    def _measure(self, time: float) -> None:
        """Advance the alignment to the last step."""
        features = np.concatenate((self._last, self._last - self._recent[0]))
        self._costs, phases, squares = _advance(self.shown.spread, self._costs, features[None])
        best, distance = int(phases[0]), math.sqrt(float(squares[0]))
        gap = self._last - self.shown.spread.mean[best, : len(self._last)]
        state = self._state
        left = distance > self.shown.threshold and math.isnan(state.since)
        self._state = state._replace(
            time=time,
            phase=best / (N_PHASES - 1),
            distance=distance,
            deviation=math.sqrt(float(gap @ gap)),
            largest=max(state.largest, distance),
            since=time if left else state.since,
        )
        self._distances.append(self._state.phase, np.array([distance]))

    def recognize(self) -> LiveState:
        """Tell which symbol of the library the movement so far looks like: `LiveState`, with `ranked` and `unknown`.

        It compares with all symbols, which takes milliseconds: ask when the movement is outside.

        Raises
        ------
        SpecificationError
            The monitor was made without a stream, or the library has a single movement.
        """
        if self._stream is None:
            raise SpecificationError(
                "expected a monitor that knows other symbols, got one of demonstrations alone; make it with "
                "ActionLibrary.monitor, or pass stream=recognizer.stream"
            )
        if self._live is None:
            self._live = self._stream()
        self._live.reset()
        samples = self._path.kept()
        return self._live.update(samples[:, 0], samples[:, 1:])

    def finish(self) -> Execution:
        """Tell whether the movement ended where such movements end; the monitor goes on until `reset`.

        Raises
        ------
        TrajectoryError
            No sample could be used.
        """
        if self._origin is None or self._path.last is None:
            raise TrajectoryError("expected at least one sample before the end, got none that can be used")
        position = self._path.last[1:] - self._origin
        features = np.concatenate((position, position - self._recent[0]))
        distance = float(_end_distance(self.shown.spread, features[None])[0])
        deviation = float(np.linalg.norm(position - self.shown.spread.mean[-1, : len(position)]))
        ended = distance <= self.shown.end_threshold and self._state.phase >= self.shown.least_end - 1e-9
        return Execution(ended, distance, deviation, self._state)

    def plot(self) -> Any:
        """Draw the distance over the phase, and the threshold: a figure of matplotlib."""
        from kineme.recognition.answer_figure import draw_distances

        return draw_distances(self._distances.kept().copy(), self.shown.threshold)

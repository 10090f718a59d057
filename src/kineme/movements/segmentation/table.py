"""Methods of segmentation, and their table: rests, minima of speed, and change points of the velocity.

They look at the smoothed positions of a recording, its speed over time, and the share of noise in it. Bouts are runs of
samples in motion, found with hysteresis; onset and end of a movement lie within its piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.coordinates import columns_of_kinds
from kineme.movements.preparation.glitches import without_glitches, without_jumps
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.sampling import runs
from kineme.validation import Array, check_count, check_number

_LEVEL = 0.05  # threshold, as a share of the movement's own peak speed
_STILL = 1e-3  # of the same: speed at rest in a recording without noise
_BLUR = 0.25  # time that smoothing moves a crossing outward, in cycles at the cutoff
_REACH = 0.1  # longest extrapolation of an onset, as a share of the movement

Rows = NDArray[np.intp]

_SMOOTHINGS = 40  # at most: peak speed and smoothing depend on each other, and are found by iteration
_STEP = 0.7  # smallest ratio of one cutoff to the next
#: Share of the mean squared speed of the motion that smoothing has to leave. With noise of 0.03 of a movement's extent
#: `spot` finds 0.78 of the solids and 0.92 of the strokes of other people; without this share next to none of them.
_MOTION_LEFT = 0.85
_SLOWEST = 2.0  # cycles per recording: the lowest cutoff
_PEAK_PATH = 0.9  # of the path is covered below the peak speed
_MIN_SAMPLES = 8  # two movements of four samples
_GAP = 10  # typical steps: a longer one is a gap
_NOISE_EXTENTS = 4.0  # a smoothed recording rests if its extent is less than this many standard deviations of noise

_MIN_REST, _MIN_BETWEEN = 0.035, 0.1  # of the typical duration of a movement
_ROUNDS = 10  # at most: the typical movement gets longer with every pause that is no rest


@dataclass(frozen=True)
class Rest:
    """Cut in the middle of every rest.

    The recording rests where its speed stays below a share of the robust peak speed; a movement is a run above that
    share which reaches twice the share somewhere (hysteresis, so that noise near the threshold does not cut it).

    Parameters
    ----------
    speed : float, default 0.05
        Share of the recording's peak speed below which it rests. A movement that never exceeds twice this share is
        missed: lower it for recordings with both slow and fast movements.
    min_rest : float, optional
        A shorter rest is a pause within a movement [s]; by default 0.035 of the typical movement, which
        is as long as it is without these pauses. Measured between extrapolated ends, so that a smooth reversal is not a
        rest, however slow it is.
    min_movement : float, optional
        A shorter movement is a twitch within a rest [s]; by default a tenth of the typical movement.

    Notes
    -----
    Half of the moving time is spent in movements at least as long as the typical one. Defaults that are shares of it
    make the cuts independent of tempo; fix them in seconds when you know the task.
    """

    speed: float = 0.05
    min_rest: float | None = None
    min_movement: float | None = None

    def __post_init__(self) -> None:
        check_number("speed", self.speed, above=0.0, below=0.5)
        for name in ("min_rest", "min_movement"):
            check_number(name, getattr(self, name), least=0.0, optional=True)

    @property
    def resolution(self) -> float:
        """Share of the peak speed that must be distinguished from rest."""
        return self.speed

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        bouts, last_enough = self._bouts(motion)
        bouts = bouts[last_enough]
        return (bouts[:-1, 1] + bouts[1:, 0]) // 2

    def pieces(self, motion: Motion) -> Rows:
        """The piece of each movement: it ends in the middle of the rests beside it, or between it and a twitch."""
        bouts, last_enough = self._bouts(motion)
        middles = (bouts[:-1, 1] + bouts[1:, 0]) // 2
        return consecutive(middles, len(motion.times))[last_enough]

    def _bouts(self, motion: Motion) -> tuple[Rows, NDArray[np.bool_]]:
        """Runs of motion, rows (n, 2), and which of them are movements."""
        low = max(self.speed * motion.peak, 2.0 * motion.noise)
        bouts = moving_bouts(motion.speed, low, 2.0 * low)
        if not len(bouts):  # motion so slow and even that no bout reaches the upper threshold
            return np.array([[0, len(motion.times)]]), np.array([True])
        # A rest is measured between extrapolated ends: a smooth reversal is no rest, however long it is slow.
        bouts = onset_rows(motion, consecutive((bouts[:-1, 1] + bouts[1:, 0]) // 2, len(motion.times)))
        bouts = self._without_pauses(bouts, motion)
        lasting = durations_of(bouts, motion.times)
        least = _MIN_BETWEEN * typical_duration(lasting) if self.min_movement is None else self.min_movement
        return bouts, lasting >= least

    def _without_pauses(self, bouts: Rows, motion: Motion) -> Rows:
        if self.min_rest is not None:
            return merge_across(bouts, motion.times, self.min_rest)
        for _ in range(_ROUNDS):
            before = len(bouts)
            typical = typical_duration(durations_of(bouts, motion.times))
            bouts = merge_across(bouts, motion.times, _MIN_REST * typical)
            if len(bouts) == before:
                break
        return bouts


_FLOOR = 0.02  # of the peak speed: lower speeds count as equally slow
_MIN_MOVEMENT = 0.1  # of the typical piece


@dataclass(frozen=True)
class SpeedMinima:
    """Cut at minima of speed, and optionally at corners taken without slowing down.

    A minimum counts where the speed falls below a share of the lower one of the two peaks beside it: a prominence
    in the logarithm of speed, so that slow and fast, small and large movements are cut alike.

    Parameters
    ----------
    depth : float, default 0.33
        The share. People slow down in bends, too (speed falls with the cube root of curvature): a larger share cuts
        there.
    turn : float, optional
        Also cut where the direction turns by more than this angle [rad] within ``span``; by default nowhere.
    span : float, default 0.02
        Length over which directions before and after are taken, as a share of the recording's extent.
    min_movement : float, optional
        Smallest distance between cuts [s]; by default a tenth of the typical piece.
    """

    depth: float = 0.33
    turn: float | None = None
    span: float = 0.02
    min_movement: float | None = None
    resolution: ClassVar[float] = 2.0 * _FLOOR

    def __post_init__(self) -> None:
        for name in ("depth", "span"):
            check_number(name, getattr(self, name), above=0.0, below=1.0)
        if self.turn is not None:
            check_number("turn", self.turn, above=0.0)
            if self.turn >= np.pi:
                raise SpecificationError(f"expected turn below pi, got {self.turn!r}; angles are in radians")
        check_number("min_movement", self.min_movement, least=0.0, optional=True)

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        from scipy.signal import find_peaks  # it takes long to load, and most commands cut nothing

        t = motion.clock
        even = np.linspace(0.0, t[-1], len(t))
        slowness = np.interp(even, t, -np.log(motion.speed + max(_FLOOR * motion.peak, 2.0 * motion.noise)))
        least = -np.log(self.depth)
        cuts = find_peaks(slowness, prominence=least)[0]
        if self.turn is not None:  # on the same scale: a corner of exactly `turn` counts as just deep enough
            corners = (
                least * turning(motion, self.span * float(np.linalg.norm(np.ptp(motion.positions, axis=0)))) / self.turn
            )
            corners = np.interp(even, t, corners)
            cuts = np.union1d(cuts, find_peaks(corners, height=least, distance=3)[0])
            slowness = np.maximum(slowness - slowness.min(), corners)
        if self.min_movement is not None:
            apart = float(self.min_movement)
        else:
            apart = _MIN_MOVEMENT * typical_duration(np.diff(even[np.concatenate(([0], cuts, [-1]))]))
        chosen = _apart(cuts, slowness[cuts], apart * (len(t) - 1) / t[-1])
        rows = np.searchsorted(t, even[chosen])
        return np.unique(rows[(rows > 0) & (rows < len(t) - 1)])

    def pieces(self, motion: Motion) -> Rows:
        """The pieces between cuts, rows (n, 2)."""
        return consecutive(self.inner_cuts(motion), len(motion.times))


def turning(motion: Motion, span: float) -> Array:
    """Angle [rad] between the directions over the path lengths `span` before and after each sample, shape (T,)."""
    x = motion.positions
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1)))

    def at(s: Array) -> Array:
        return np.column_stack([np.interp(s, length, column) for column in x.T])

    before, after = x - at(length - span), at(length + span) - x
    product = np.einsum("ij,ij->i", before, after)
    norms = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    inside = (length > span) & (length < length[-1] - span) & (norms > 0)
    cosine = np.divide(product, norms, out=np.ones_like(norms), where=inside)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _apart(cuts: Rows, strength: Array, distance: float) -> Rows:
    """Keep the strongest cuts, none closer than `distance` samples to a stronger one."""
    is_far = np.zeros(len(cuts), dtype=bool)
    for i in np.argsort(-strength, kind="stable"):
        is_far[i] = not (np.abs(cuts[is_far] - cuts[i]) < distance).any()
    return cuts[is_far]


_MOST_POINTS = 10_000
_MIN_POINTS = 5  # even points per piece


@dataclass(frozen=True)
class ChangePoints:
    """Cut at change points of the velocity: kernel change-point detection, PELT or dynamic programming.

    The velocity, in peak speeds, is taken at ``n_points`` even times and cut so that the sum of squared distances to
    each piece's mean, in the feature space of a Gaussian kernel, is smallest. Rest, motion there and motion back are
    three regimes; within a bend the velocity changes continuously, and cuts there mean little.

    Parameters
    ----------
    penalty : float, default 0.1
        Cost of one more cut: larger means fewer cuts. Its unit is the cost of one characteristic time, ``sqrt(mean
        squared speed / mean squared acceleration)``, spent unlike the rest of the piece; so neither the tempo nor the
        length of the recording matters. Not used with ``n_pieces``.
    n_pieces : int, optional
        The number of pieces, if it is known; pieces at rest count.
    n_points : int, default 1000
        Time resolution; the cost grows with its square. At most 10,000.

    References
    ----------
    S. Arlot, A. Celisse, Z. Harchaoui, "A kernel multiple change-point algorithm via model selection", Journal of
    Machine Learning Research 20, 2019.
    """

    penalty: float = 0.1
    n_pieces: int | None = None
    n_points: int = 1000
    resolution: ClassVar[float] = 0.05

    def __post_init__(self) -> None:
        check_number("penalty", self.penalty, above=0.0)
        check_count("n_points", self.n_points, 2 * _MIN_POINTS, most=_MOST_POINTS)
        if self.n_pieces is not None:
            check_count("n_pieces", self.n_pieces, 1)
            if self.n_pieces * _MIN_POINTS > self.n_points:
                raise SpecificationError(
                    f"expected n_points of at least {_MIN_POINTS} per piece, got {self.n_points} for "
                    f"{self.n_pieces} pieces"
                )

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        t = motion.clock
        even = np.linspace(0.0, t[-1], self.n_points)
        velocity = np.gradient(motion.positions, motion.times - motion.times[0], axis=0) / motion.peak
        signal = np.column_stack([np.interp(even, t, column) for column in velocity.T])
        try:
            import ruptures  # type: ignore[import-untyped, import-not-found, unused-ignore]
        except ImportError:
            raise SpecificationError(
                'expected the library ruptures for by="change-points", found none; '
                'pip install "kineme[segmentation]", or choose by="rest" or by="speed"'
            ) from None
        detector = ruptures.KernelCPD(kernel="rbf", min_size=_MIN_POINTS, params={"gamma": 1.0}).fit(signal)
        if self.n_pieces == 1:
            return np.zeros(0, dtype=np.intp)
        if self.n_pieces is not None:
            breakpoints = detector.predict(n_bkps=self.n_pieces - 1)
        else:
            acceleration = np.gradient(velocity, t, axis=0)
            characteristic = np.sqrt((velocity**2).sum() / (acceleration**2).sum())
            breakpoints = detector.predict(pen=self.penalty * float(characteristic) / even[1])
        rows = np.searchsorted(t, even[np.array(breakpoints[:-1], dtype=np.intp)])
        return np.unique(rows[(rows > 0) & (rows < len(t) - 1)])

    def pieces(self, motion: Motion) -> Rows:
        """The pieces between cuts that move most of the time, rows (n, 2)."""
        pieces = consecutive(self.inner_cuts(motion), len(motion.times))
        fast = motion.speed > 2.0 * max(self.resolution * motion.peak, 2.0 * motion.noise)
        return pieces[2 * np.add.reduceat(fast, pieces[:, 0], dtype=np.intp) > pieces[:, 1] - pieces[:, 0]]


class Segmenter(Protocol):
    """A segmentation method: a frozen record of its parameters."""

    @property
    def resolution(self) -> float:
        """Share of the peak speed that has to be told from rest."""

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, none at the ends."""

    def pieces(self, motion: Motion) -> Rows:
        """The piece of each movement, rows (n, 2), disjoint and in order; `segment` narrows them to their motion."""


#: Name -> method.
SEGMENTERS: dict[str, type[Any]] = {"rest": Rest, "speed": SpeedMinima, "change-points": ChangePoints}


@dataclass(frozen=True, eq=False)
class Motion:
    """A recording, smoothed as much as its noise requires."""

    times: Array  # shape (T,)
    clock: Array  # shape (T,); times from 0 on, in which a gap counts as ten typical steps
    positions: Array  # shape (T, d); smoothed
    speed: Array  # shape (T,); norm of the derivative of the smoothed positions [unit/s]
    # Robust peak speed: nine tenths of the path are covered at lower speed. Weighted by path, not by time, so that
    # long rests do not lower it.
    peak: float
    noise: float  # root mean square speed of the noise that remains after smoothing [unit/s]
    cutoff: float  # cutoff frequency of the smoothing [Hz]
    steps: Array  # shape (T, k); discrete columns, as recorded


def observe(recording: Trajectory, resolution: float) -> Motion:
    """Smooth a recording until the speed of its noise is a quarter of ``resolution * peak``; return its motion.

    White noise of variance sigma^2 per dimension, sampled at rate r, passes the smoothing spline (see `Smooth`) of
    cutoff c [Hz] with a speed of variance ``(pi^3 / sqrt 2) sigma^2 c^3 / r`` per dimension: the integral of
    ``(2 pi nu)^2 (2 sigma^2 / r) / (1 + (nu / c)^4)^2``. The largest c that keeps this below the limit is taken, so a
    clean recording is hardly smoothed, and no cutoff in hertz assumes how fast people or robots move. Where this would
    smooth the motion away with the noise, more noise is left, and what is slower than twice that noise counts as rest.
    Glitches and jumps are taken out first, see `without_jumps`: a step of 100 m would be most of the path, and all else
    would be at rest beside its speed. The resolution is the speed that must be distinguished from rest, as a share of
    the peak.

    A pause may have no samples. The rate is that of the samples without such gaps, each of which counts as ten typical
    steps, and a recording rests in a gap across which it hardly moves.
    """
    who = f"recording {recording.name!r}" if recording.name else "recording"
    if len(recording) < _MIN_SAMPLES:
        raise TrajectoryError(f"{who}: expected at least {_MIN_SAMPLES} samples to cut, got {len(recording)}")
    t = recording.times - recording.times[0]
    steps = np.diff(t)
    longest = _longest_step(steps)
    recorded = without_glitches(recording.positions, np.array([0, len(t)]))
    positions = without_jumps(recorded, steps, longest)
    variance = noise_variance(positions)
    clock, gaps = np.append(0.0, np.cumsum(np.minimum(steps, longest))), np.flatnonzero(steps > longest)
    rate = (len(t) - 1) / clock[-1]
    passed = np.pi**3 / np.sqrt(2) * variance / rate
    slowest, cutoff = _SLOWEST / clock[-1], rate / 4.0
    # `Smooth` takes the mean rate: the same penalty is that of a cutoff lower by the fourth root of their ratio.
    cycles = recording.duration * (clock[-1] / recording.duration) ** 0.25
    demos = Demonstrations([Trajectory(recording.times, positions)])
    dt, most, before = np.gradient(t), 0.0, None
    for _ in range(_SMOOTHINGS):
        smooth = Smooth(cutoff * cycles).apply(demos).positions
        speed = np.linalg.norm(np.gradient(smooth, t, axis=0), axis=1)
        across = np.linalg.norm(smooth[gaps + 1] - smooth[gaps], axis=1) / steps[gaps]
        for beside in (gaps, gaps + 1):
            speed[beside] = np.minimum(speed[beside], across)
        peak = weighted_quantile(speed, speed * dt, _PEAK_PATH)  # of the path
        noise = float(np.sqrt(passed * cutoff**3))
        energy = float(np.average(speed**2, weights=dt)) - noise**2  # of the motion without noise
        if before is not None and energy < _MOTION_LEFT * most:  # less noise would cost motion
            smooth, speed, peak, noise, cutoff = before
            break
        if noise**2 < energy:
            most, before = max(most, energy), (smooth, speed, peak, noise, cutoff)
        aim = resolution * peak / 4.0
        if noise <= 1.05 * aim or cutoff <= slowest:
            break
        cutoff = max((aim**2 / passed) ** (1.0 / 3.0), slowest, _STEP * cutoff)
    extent, sigma = float(np.linalg.norm(np.ptp(smooth, axis=0))), float(np.sqrt(variance))
    if extent <= max(_NOISE_EXTENTS * sigma, 1e-12 * np.abs(positions).max()):
        raise TrajectoryError(
            f"{who}: expected some movement, got {recording.duration:.3g} s at rest: the smoothed positions stay "
            f"within {extent:.3g}, the noise is {sigma:.3g}; check the dimensions and the unit of the recording"
        )
    if positions is not recorded:  # only the speed is without jumps: a gripper that opens at once has another level
        smooth = Smooth(cutoff * cycles).apply(Demonstrations([Trajectory(recording.times, recorded)])).positions
    return Motion(recording.times, clock, smooth, speed, peak, noise, cutoff, steps_of(recording))


def _longest_step(steps: Array) -> float:
    """Return how long a step between two samples may be before it is a gap: typically, ten of them take no longer.

    The median of ten together: samples may come in bursts.
    """
    t = np.append(0.0, np.cumsum(steps))
    k = min(_GAP, len(steps))
    return max(float(np.median(t[k:] - t[:-k])), _GAP * float(np.median(steps)))


def steps_of(recording: Trajectory) -> Array:
    """Return the discrete columns (T, k) of a recording; none of one whose channels are not known."""
    return recording.recorded[:, columns_of_kinds(recording.channels or (), "discrete")]


def noise_deviations(positions: Array) -> Array:
    """Return the standard deviation (d,) of white noise on (T, d) positions.

    The median size of third differences, to which neither smooth paths nor jumps contribute, is 0.6745 sqrt(20) of it.
    """
    sizes = np.median(np.abs(np.diff(positions, n=3, axis=0)), axis=0)
    return np.asarray(sizes / (0.6745 * np.sqrt(20.0)))


def noise_variance(positions: Array) -> float:
    """Return the variance of white noise on (T, d) positions, summed over dimensions."""
    return float((noise_deviations(positions) ** 2).sum())


def moving_bouts(speed: Array, low: float, high: float) -> Rows:
    """Runs of samples faster than `low` that exceed `high` somewhere: rows (n, 2), first and one past the last."""
    rows = runs(speed > low)
    if not len(rows):
        return rows
    fastest = np.maximum.reduceat(np.append(speed, 0.0), rows.ravel())[::2]
    return rows[fastest > high]


def typical_duration(durations: Array) -> float:
    """The duration such that half of the moving time lies in bouts at least as long; twitches hardly change it."""
    return weighted_quantile(durations, durations, 0.5)


def weighted_quantile(values: Array, weights: Array, share: float) -> float:
    """The value up to which values have that share of all weights."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, share * total[-1])]])


def merge_across(bouts: Rows, times: Array, gap: float) -> Rows:
    """Merge bouts that are at most `gap` seconds apart."""
    starts, ends = times[bouts[:, 0]], times[bouts[:, 1] - 1]
    apart = np.flatnonzero(starts[1:] - ends[:-1] > gap)
    return np.column_stack((bouts[np.append(0, apart + 1), 0], bouts[np.append(apart, len(bouts) - 1), 1]))


def durations_of(bouts: Rows, times: Array) -> Array:
    """Duration of each bout [s]."""
    return np.asarray(times[bouts[:, 1] - 1] - times[bouts[:, 0]])


def consecutive(inner_cuts: Rows, n_samples: int) -> Rows:
    """The pieces between cuts: rows (n, 2) that cover all samples."""
    edges = np.concatenate(([0], inner_cuts, [n_samples]))
    return np.column_stack((edges[:-1], edges[1:]))


def onset_rows(motion: Motion, pieces: Rows) -> Rows:
    """Narrow pieces (n, 2) to their motion.

    A movement starts smoothly, so a threshold on the speed detects it late: a minimum-jerk movement reaches 5 % of its
    peak speed after 6 % of its duration. Speed at first grows about as the square of the time since the onset, so the
    onset is extrapolated: it lies as far before the crossing of a level as that lies before the crossing of four times
    the level, but not within rest. Smoothing moves the crossings outward: with cutoff c, the extrapolated onset of a
    minimum-jerk movement by 0.1 / c, that of a movement at full speed from the start by 0.4 / c. The mean of the two,
    0.25 / c, is subtracted. The end is found in the same way, backward in time.
    """
    if not len(pieces):  # np.maximum.reduceat needs a piece
        return pieces
    begin = _crossings(motion, motion.times, motion.speed, pieces)
    backward = len(motion.times) - pieces[:, ::-1]
    end = _crossings(motion, -motion.times[::-1], motion.speed[::-1], backward[::-1])
    return np.column_stack((begin, len(motion.times) - end[::-1]))


def _crossings(motion: Motion, t: Array, speed: Array, pieces: Rows) -> Rows:
    """First row of the motion in each piece; pieces are increasing and disjoint; t and speed may be reversed."""
    piece_of = np.searchsorted(pieces[:, 0], np.arange(len(t)), side="right") - 1
    inside = (piece_of >= 0) & (np.arange(len(t)) < pieces[np.maximum(piece_of, 0), 1])
    peaks = np.maximum.reduceat(np.where(inside, speed, 0.0), pieces[:, 0])
    level = np.maximum(_LEVEL * peaks, 2.0 * motion.noise)
    row = np.arange(len(t))
    higher = _first(inside & (speed >= np.minimum(4.0 * level, 0.9 * peaks)[piece_of]), pieces)
    before = inside & (row < higher[piece_of])
    first = _last(before & (speed < level[piece_of]), pieces) + 1  # earlier crossings may be noise at rest
    reach = np.minimum(t[higher] - t[first], _REACH * (t[pieces[:, 1] - 1] - t[first]))
    onset = np.searchsorted(t, t[first] - reach + _BLUR / motion.cutoff, side="right") - 1
    after_gap = np.append(False, np.diff(t) > _longest_step(np.diff(t)))  # a slow gap is rest, too
    still = _last(before & (speed < np.where(after_gap, level[piece_of], _STILL * peaks[piece_of])), pieces)
    return np.clip(np.maximum(onset, still), pieces[:, 0], higher)


def _last(where: NDArray[np.bool_], pieces: Rows) -> Rows:
    """Last row of each piece where the condition holds, else the row before it."""
    rows = np.maximum.reduceat(np.where(where, np.arange(len(where)), -1), pieces[:, 0])
    return np.maximum(rows, pieces[:, 0] - 1)


def _first(where: NDArray[np.bool_], pieces: Rows) -> Rows:
    """First row of each piece where the condition holds, else its first row."""
    rows = np.minimum.reduceat(np.where(where, np.arange(len(where)), len(where)), pieces[:, 0])
    return np.asarray(np.where(rows < pieces[:, 1], rows, pieces[:, 0]))

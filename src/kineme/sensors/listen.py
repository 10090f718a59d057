"""Recognize the movements in a stream of samples while they come, whatever protocol brings them: `Listener`, `listen`.

Nothing that a sensor sends raises. What cannot be used is left out, said in a sentence, and counted.
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from kineme.errors import KinemeError, TrajectoryError
from kineme.library.library import ActionLibrary
from kineme.movements.channels.channel import recorded_names
from kineme.movements.channels.column_match import Columns, columns_like, columns_recorded
from kineme.movements.channels.coordinates import lengths_of
from kineme.movements.channels.detect import name_of
from kineme.movements.channels.incremental import IncrementalCoordinates
from kineme.movements.segmentation.table import noise_deviations
from kineme.movements.trajectories.labels import Label
from kineme.recognition.answer import Answer, Certainty
from kineme.reporting.text import counted, first_names, printable
from kineme.sampling import evenly_spaced
from kineme.validation import LARGEST, Array

UNKNOWN = "unknown"
_POLL = 0.05  # seconds that a source waits for samples, so that Ctrl-C and silence are noticed
_MEASURED = 200  # movements whose size and duration are looked at
_LONGEST = 3.0  # times as long as any demonstration: a movement that does not rest ends then
_STOPPED = 2.0  # seconds without samples that are said
_AGAIN = 5.0  # seconds until the same thing is said again
_LATENCIES = 10_000  # that are remembered
_RECENT = 10_000  # samples within a rest that are looked at, of a sensor whose clock stands almost still
_RUN, _RUNS = 16, 64  # samples of which noise is measured, and such runs that are remembered
_QUIET = 0.2  # share of the runs that rest, at least: while a hand moves, its motion looks like noise, too
_MOST_NOISE = 0.1  # of the size of a movement
_WATCHED = 3.0  # seconds in which what moves as far as where movements begin, but slower, is said


class Block(NamedTuple):
    """Samples that came together, and what was wrong with others: a kind, by which it is counted, and a sentence."""

    times: Array  # (k,), stamps [s]
    rows: Array  # (k, m), the columns of the source
    notes: Sequence[tuple[str, str]] = ()
    own_stamps: bool = True  # of when it was measured; else of when it came


NOTHING = Block(np.empty(0), np.empty((0, 0)))


class Source(Protocol):
    """A stream of samples."""

    @property
    def columns(self) -> Columns | None:
        """Names and units of what it measures; None before it is there."""

    def receive(self, timeout: float) -> Block:
        """Wait up to `timeout` seconds for samples, and return those that have come."""

    def close(self) -> None:
        """Leave the stream."""


class Symbol(NamedTuple):
    """A movement with a name: under way, when the name is decided, and again when it is over."""

    name: str  # "unknown" if it is like no symbol
    is_over: bool
    certainty: Certainty
    confidence: float  # as `Answer.confidence`; of a movement under way, the share of the evidence
    start: float  # stamp of its first sample [s]
    end: float  # of its last one; of a movement under way, when it is expected to end
    time: float  # of the sample that decided

    def to_dict(self) -> dict[str, object]:
        """Return it as plain data that JSON can hold."""
        return self._asdict() | {"end": self.end if math.isfinite(self.end) else None}


class Sink(Protocol):
    """A receiver of symbols."""

    def send(self, symbol: Symbol) -> None:
        """Hand a symbol on, without waiting for whoever reads it."""

    def close(self) -> None:
        """Say no more."""


@dataclass(frozen=True)
class Rests:
    """Borders of movements in a stream, by the extent of the largest coordinate in the time of a rest, as a length."""

    size: float  # extent of a usual movement, see `lengths_of`
    longest: float  # duration after which a movement ends although nothing rests [s]
    rest: float = 0.3  # a movement is over when nothing has moved for so long [s]
    silence: float = 0.5  # or when there is no sample for so long by the stamps [s]
    patience: float = 2.0  # or none has come for so long, of samples with stamps of their own, which may come in groups
    sets_out: float = 0.08  # share of the size that is moved where a movement begins
    rests: float = 0.03  # and that is not moved where it ends


class Noise:
    """Noise of a stream at rest, as large as in the quieter of its last runs of samples."""

    def __init__(self, n_dims: int, most: float) -> None:
        self._most = most
        self._run = deque[Array](maxlen=_RUN)
        self._new = 0  # samples since the last run
        self._deviations = deque[Array](maxlen=_RUNS)
        self.deviation = np.zeros(n_dims)

    def take(self, coordinates: Array) -> None:
        """Take in a sample (d,)."""
        self._run.append(coordinates)
        self._new += 1
        if self._new >= _RUN:
            self._new = 0
            self._deviations.append(noise_deviations(np.array(self._run)))
            self.deviation = np.minimum(np.quantile(self._deviations, _QUIET, axis=0), self._most)

    def extent(self, n_samples: int) -> Array:
        """Return an extent (d,) that so many samples of noise hardly exceed.

        The largest of n is about ``sqrt(2 ln n)`` deviations from the mean, and so is the least.
        """
        return np.asarray(self.deviation * 2.0 * math.sqrt(2.0 * math.log(max(n_samples, 2))))


class Summary:
    """Counts of what came and what was recognized, and seconds from each deciding sample to its symbol."""

    def __init__(self) -> None:
        self.samples = 0
        self.symbols: Counter[str] = Counter()  # of movements that are over
        self.problems: Counter[str] = Counter()  # kind -> how often
        self.latencies: deque[float] = deque(maxlen=_LATENCIES)

    def lines(self) -> list[str]:
        """Return it in sentences."""
        names = ", ".join(f"{printable(name)} {count}" for name, count in self.symbols.most_common(20))
        lines = [
            f"{counted(self.samples, 'sample')}, {counted(self.symbols.total(), 'movement')}{names and ': '}{names}"
        ]
        if self.latencies:
            median, worst = (1e3 * float(value) for value in np.quantile(self.latencies, (0.5, 1.0)))
            lines.append(f"from a sample to its symbol: {median:.1f} ms (median), {worst:.1f} ms at most")
        return lines + [f"{kind}: {counted(count, 'time')}" for kind, count in self.problems.most_common()]


class Listener:
    """Find the movements in a stream by its rests, and name them by a library, while they come.

    `tell` takes sentences about what went wrong, the same kind at most every five seconds. `choose`: columns of the
    stream, by names or numbers from 0, in the order of the library's; by default by their names. What others teach the
    library meanwhile is known from the next movement on.
    """

    def __init__(
        self,
        library: ActionLibrary,
        tell: Callable[[str], None],
        rest: float = 0.3,
        choose: Sequence[str] = (),
    ) -> None:
        self._library, self._tell, self._choose = library, tell, choose
        self.summary = Summary()
        self._live, self._version = library.stream(), library.version
        ids = library.ids()
        movements = library.movements(ids=ids[evenly_spaced(len(ids), _MEASURED)])
        example = movements[0]
        self._live.update(example.times, example.recorded)
        self._live.remember(self._live.finish())  # code is loaded now, not when the first movement ends
        self._live.reset(person=True)
        channels = self._live.channels
        n_dims = library.n_dims or 0
        self._lengths = np.ones(n_dims) if channels is None else lengths_of(channels)  # else degrees hide meters
        size = float(np.median([(np.ptp(movement.positions, axis=0) * self._lengths).max() for movement in movements]))
        self.rests = Rests(size, _LONGEST * float(movements.durations.max()) + rest, rest)
        self._wanted = None if channels is None else columns_recorded(channels)
        self._width = n_dims if channels is None else len(recorded_names(channels))
        self._coordinates = None if channels is None else IncrementalCoordinates(channels)
        self._connected: Columns | None = None  # of which it was said what is taken in which unit
        self._said: dict[str, float] = {}
        self._noise = Noise(n_dims, _MOST_NOISE * size)
        self._recent = np.empty((0, 1 + self._width + n_dims))  # of the last moments: stamp, row, coordinates
        self._watched: tuple[float, Array, Array] | None = None  # since when, and between which coordinates, it is slow
        self._began: float | None = None  # of the movement under way
        self._decided: Label | None = None
        self._pending: list[tuple[float, Array]] = []  # samples of it that the recognizer has not taken yet
        self._answer: tuple[float, Answer] | None = None  # with its end, before it is sure that it is over
        self._stopped = False
        self._last_time, self._last_arrival = -math.inf, -math.inf
        self._own_stamps = True
        self._ahead = -math.inf  # the most that stamps have been ahead of the clock of arrivals [s]

    def note(self, kind: str, sentence: str) -> None:
        """Count a problem, and say it unless that kind was said just now; an empty kind is news, not counted."""
        if not kind:
            self._tell(sentence)
            return
        self.summary.problems[kind] += 1
        now = time.monotonic()
        if now - self._said.get(kind, -math.inf) >= _AGAIN:
            self._said[kind] = now
            self._tell(f"{kind}: {sentence}")

    def take(self, block: Block, columns: Columns | None, arrival: float) -> Iterator[Symbol]:
        """Take in what a source received by the `arrival` on this clock [s], and yield the symbols that it decides."""
        for kind, sentence in block.notes:
            self.note(kind, sentence)
        times, rows = self._usable(block, columns or Columns((), ()))
        silent = arrival - self._last_arrival
        if not len(times):
            patience = self.rests.patience if self._own_stamps else self.rests.silence
            lost = float(block.times[-1]) - self._last_time if len(block.times) else 0.0  # samples that cannot be used
            if self._began is not None and (silent > patience or lost > self.rests.silence):
                yield from self._end(self._last_time, self._last_time)
            if not self._stopped and _STOPPED < silent < math.inf:
                self._stopped = True
                self.note("stream stopped", f"no samples for {silent:.1f} s; waiting for more")
            return
        self._own_stamps = block.own_stamps
        if self._stopped:
            self._stopped = False
            self.note("stream returned", f"after {silent:.1f} s")
        yield from self._follow(times, rows, arrival)

    def _usable(self, block: Block, columns: Columns) -> tuple[Array, Array]:
        """Return the stamps and rows of a block that can be used, as the library has them."""
        if not len(block.times):
            return block.times, block.rows
        self.summary.samples += len(block.times)
        try:
            rows = self._as_learned(block.rows, columns)
        except KinemeError as error:
            self.note("other columns", f"{error}; its samples are left out")
            return NOTHING.times, NOTHING.rows
        good = np.isfinite(block.times) & (np.abs(rows) <= LARGEST).all(axis=1)  # of NaN this is false
        if not good.all():
            self.note("not finite", "samples with NaN, infinity or numbers beyond 1e100 are left out")
        if self._coordinates is not None:
            unit = self._coordinates.usable(rows)
            if not unit[good].all():
                self.note("no rotation", "samples with a quaternion that is not of norm 1 are left out")
            good &= unit
        return block.times[good], rows[good]

    def refusal(self, columns: Columns) -> str:
        """Say why samples of these columns cannot be used; empty of those that can."""
        try:
            self._as_learned(np.zeros((1, len(columns.heads))), columns)
        except KinemeError as error:
            return str(error)
        return ""

    def _as_learned(self, rows: Array, columns: Columns) -> Array:
        """Return rows in the columns, the order and the units of the library."""
        heads, units = columns
        if self._choose:
            places = [int(name) if name.isdigit() else heads.index(name) if name in heads else -1
                      for name in self._choose]  # fmt: skip
            if not all(0 <= place < len(heads) for place in places):
                raise TrajectoryError(f"expected the columns {', '.join(self._choose)}, got {first_names(heads, 12)}")
            rows, units = rows[:, places], tuple(units[place] for place in places)
        wanted = self._wanted
        by_name = wanted is not None and not (self._choose or columns.are_nameless or wanted.are_nameless)
        if not by_name and rows.shape[1] != self._width:
            names = "" if wanted is None else f" ({first_names(wanted.heads, 12)})"
            raise TrajectoryError(
                f"expected {counted(self._width, 'value')} a sample{names}, as the library has them, got "
                f"{rows.shape[1]}; choose them with --columns"
            )
        if wanted is None:
            return rows
        ours = columns if by_name else Columns(wanted.heads, units)
        try:
            taken = columns_like(rows, ours, wanted, known_units=False)
        except TrajectoryError as error:
            raise TrajectoryError(f"{error}; choose others with --columns") from error
        if columns != self._connected:
            self._connected, said = columns, dict(zip(ours.names, ours.units, strict=True))
            columns_in = zip(wanted.heads, wanted.names, wanted.units, strict=True)
            if unsaid := [f"{name_of(head)} [{unit}]" for head, name, unit in columns_in if unit and not said[name]]:
                self.note("", f"the stream says no units; taken as {first_names(unsaid, 12)}, as in the library")
        return taken

    def _follow(self, times: Array, rows: Array, arrival: float) -> Iterator[Symbol]:
        """Follow samples that can be used: one by one for the borders of movements, those between them at once."""
        self._last_arrival = arrival
        if self._ahead == -math.inf:
            self._ahead = float(times[-1]) - arrival
        for k, t in enumerate(times.tolist()):
            step = t - self._last_time
            if -self.rests.silence <= step <= 0.0:
                self.note("not later", "samples that are not later than the one before are left out")
                continue
            if step < 0.0 or (self.rests.silence < step < math.inf and t - arrival > self._ahead + self.rests.silence):
                self.note("clock jumped", f"by {step:+.3g} s; the movement under way is dropped")
                self._forget()
                self._ahead = t - arrival
            elif step > self.rests.silence:
                if self._began is not None:
                    self.note("gap", f"no samples for {step:.1f} s; the movement under way ends before")
                    yield from self._end(self._last_time, t)
                self._forget()  # else the way across the gap is motion, and a movement begins before it
            self._last_time = t
            extent = self._remember(t, rows[k])
            if self._began is None:
                self._await(t, extent)
                continue
            self._pending.append((t, rows[k]))
            rested = self._rest()
            if rested < 0.5 * self.rests.rest:
                self._answer = None
            elif self._answer is None:  # ahead, so that nobody waits for it once the rest is long enough
                yield from self._update()
                self._answer = self._recognized(t - rested)
            if rested >= self.rests.rest:
                yield from self._end(t - rested, t)
            elif t - self._began > self.rests.longest:
                self.note("no rest", f"a movement is cut after {self.rests.longest:.1f} s; does the sensor tremble?")
                yield from self._end(t, t)
        self._ahead = max(self._ahead, self._last_time - arrival)
        yield from self._update()

    def _rest(self) -> float:
        """Return for how long nothing has moved [s], and forget the samples before."""
        back = self._recent[::-1, 1 + self._width :]
        extents = np.maximum.accumulate(back) - np.minimum.accumulate(back) - self._noise.extent(len(back))
        near = max(int((extents.max(axis=1) <= self.rests.rests * self.rests.size).sum()), 1)
        self._recent = self._recent[len(back) - near :]
        return float(self._recent[-1, 0] - self._recent[0, 0])

    def _remember(self, t: float, row: Array) -> float:
        """Keep a sample for as long as a rest takes, and return how far anything has moved since, besides by noise."""
        moved = row[None] if self._coordinates is None else self._coordinates.take(row[None])
        moved = moved * self._lengths
        sample = np.concatenate(([t], row, moved[0]))[None]
        old = max(int((self._recent[:, 0] <= t - self.rests.rest).sum()) - 1, len(self._recent) - _RECENT, 0)
        self._recent = np.concatenate((self._recent[old:], sample))
        self._noise.take(moved[0])
        extents = np.ptp(self._recent[:, 1 + self._width :], axis=0) - self._noise.extent(len(self._recent))
        return float(extents.max())

    def _await(self, t: float, extent: float) -> None:
        """Begin a movement where something moves far enough, and say it of what does so too slowly."""
        enough = self.rests.sets_out * self.rests.size
        if extent > enough:
            self._begin()
            return
        at = self._recent[-1, 1 + self._width :]
        since, low, high = self._watched or (t, at, at)
        self._watched = since, np.minimum(low, at), np.maximum(high, at)
        if t - since > _WATCHED:
            self._watched = None
            if float((high - low - self._noise.extent(_RECENT)).max()) > enough:
                share = f"{100 * self.rests.sets_out:g} % of the size of those of the library"
                self.note(
                    "no movement",
                    f"something moves, but a movement begins with {share} in {self.rests.rest:g} s; move faster or "
                    "larger, or choose a longer --rest",
                )

    def _begin(self) -> None:
        """Begin a movement with the samples from the last one on that is still near where the window begins."""
        moved = np.abs(self._recent[:, 1 + self._width :] - self._recent[0, 1 + self._width :])
        moved = (moved - 0.5 * self._noise.extent(len(self._recent))).max(axis=1)
        first = max(int(np.flatnonzero(moved > self.rests.rests * self.rests.size)[0]) - 1, 0)
        self._pending = [(float(sample[0]), sample[1 : 1 + self._width]) for sample in self._recent[first:]]
        self._began, self._decided, self._watched = self._pending[0][0], None, None
        self._live.reset()

    def _update(self) -> Iterator[Symbol]:
        """Hand what is pending to the recognizer, and yield the symbol if one is decided anew."""
        if self._began is None or not self._pending:
            return
        times, rows = zip(*self._pending, strict=True)
        self._pending = []
        state = self._live.update(times, np.array(rows))
        if state.label is None or state.label == self._decided or not state.ranked:
            return
        self._decided = state.label
        share = {guess.label: guess.confidence for guess in state.ranked}[state.label]
        yield Symbol(str(state.label), False, "looks like", share, self._began, state.arrival, times[-1])

    def _recognized(self, end: float) -> tuple[float, Answer] | None:
        """Return the end of the movement under way with the answer to it; None of fewer than four samples."""
        try:
            return end, self._live.finish(until=end)
        except TrajectoryError:
            return None

    def _end(self, end: float, decided: float) -> Iterator[Symbol]:
        """End the movement under way at a stamp, as is decided at another one [s], and yield its symbol."""
        if self._answer is None or end - self._answer[0] > self.rests.rest:
            yield from self._update()
            self._answer = self._recognized(end)
        ended, began = self._answer, self._began
        if ended is None or began is None:
            self.note("too short", "a movement of fewer than four samples is left out")
        else:
            end, answer = ended
            name = UNKNOWN if answer.label is None else str(answer.label)
            self.summary.symbols[name] += 1
            yield Symbol(name, True, answer.certainty, answer.confidence, began, end, decided)
            self._live.remember(answer, end)
        try:
            if self._version != (version := self._library.version):
                self._live, self._version = self._library.stream(), version
        except KinemeError as error:  # of a library that holds no symbols any more, for example
            self.note("library", f"{error}; movements are named as before")
        self._forget()

    def _forget(self) -> None:
        """Forget the movement under way and the samples before; the clock and the turns of angles begin anew."""
        self._began, self._pending, self._answer, self._watched = None, [], None, None
        self._recent = self._recent[:0]
        if self._coordinates is not None:
            self._coordinates.clear()


def listen(listener: Listener, source: Source, sinks: Sequence[Sink], seconds: float = math.inf) -> Summary:
    """Hand on the symbols of a source until Ctrl-C, or for some seconds; sinks and source are closed at the end.

    A sink that fails is said, and the others go on.
    """
    until = time.monotonic() + seconds
    with ExitStack() as stack:
        for close in (source.close, *(sink.close for sink in sinks)):
            stack.callback(close)
        try:
            while (left := until - time.monotonic()) > 0.0:
                block, arrival = source.receive(min(_POLL, left)), time.monotonic()
                for symbol in listener.take(block, source.columns, arrival):
                    for sink in sinks:
                        try:
                            sink.send(symbol)
                        except BrokenPipeError:  # nobody reads the standard output any more
                            raise
                        except OSError as error:
                            listener.note("not sent", f"{error}")
                    listener.summary.latencies.append(time.monotonic() - arrival)
        except KeyboardInterrupt:
            pass
    return listener.summary

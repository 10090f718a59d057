"""The audit of a set of episodes: measured one after the other, then compared, and said in words.

Signals are read once and not kept. In memory remain some hundred numbers of each episode; ways and stretches of time
are spooled to a temporary file.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.audit import calibrate
from kineme.audit.checks import CHECKS, Check
from kineme.audit.motion import FEWEST_FRAMES, PATH, motion_of, path_of
from kineme.errors import DataError
from kineme.movements.episodes import Episode
from kineme.recognition.conformal import check_error_rate
from kineme.reporting.text import counted, first_names, shortened
from kineme.validation import Array

_IN_MEMORY = 256 * 2**20  # bytes of ways and stretches, beyond which they go to the disk
_REASONS = 6  # of an episode, at most
_LEAST_REASON = 3.0  # evidence: one good episode in twenty has as much, of each check
_RANKED = 10  # episodes that are listed although nothing calibrates them
_LONGEST = 300  # letters that are kept of the problems of an episode
_LEAST_EVIDENCE = 0.3
_SIDES: dict[str, Callable[[Array], Array]] = {"upper": np.positive, "lower": np.negative, "both": np.abs}
_NONE = np.empty(0, dtype=np.float32)
_SHARED = 0.5  # share of the episodes beyond which a contradiction is one of the set

#: Why an episode is listed -> what that promises.
KINDS = {
    "contradiction": "It contradicts what the data set declares: certain, whatever the others are like.",
    "outlying": "Far beyond what the others do: of those listed, about the error rate are false alarms.",
    "unusual": "Among the most unusual of the others: of good episodes, the error rate or less are.",
    "ranked": "Among the most unusual of too few to say more.",
}


class Reason(NamedTuple):
    """Something unusual about an episode."""

    check: str
    words: str
    channel: str  # that it is about; empty of all
    start: float  # [s]
    end: float
    evidence: float  # minus the log of the share of good episodes, about; infinite of a contradiction


class Finding(NamedTuple):
    """An episode that is listed."""

    episode: int
    task: str | None
    place: str
    seconds: float
    kind: str  # a key of `KINDS`
    p_value: float  # 0 of a contradiction
    evidence: float
    reasons: tuple[Reason, ...]  # the strongest first


@dataclass(frozen=True, eq=False)
class Audit:
    """Result of `audit_episodes`; where nothing is calibrated, the ten most unusual are "ranked", and not flagged."""

    numbers: NDArray[np.int64]  # (n,), of all episodes; the arrays below are in the same order
    seconds: float
    tasks: int
    error_rate: float  # stated share of good episodes that are flagged by chance
    by_chance: int  # episodes that this makes here, at most; 0 where there are too few to calibrate anything
    p_values: Array
    evidence: Array
    flagged: NDArray[np.bool_]
    findings: tuple[Finding, ...]  # contradictions first, then the most unusual
    of_the_set: tuple[str, ...]  # contradictions and remarks that more than half of the episodes share; they flag none

    @property
    def calibrated(self) -> bool:
        """Tell if there are enough episodes for the stated rate."""
        return self.by_chance > 0


class Measurement(NamedTuple):
    """Numbers of one episode, which its comparison with others takes; not its signals."""

    number: int
    seconds: float
    task: str | None
    place: str
    fps: float
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    names: tuple[str, ...]  # of its channels; none without motion that can be compared
    sizes: tuple[int, ...]  # numbers of values of the checks that measure an episode alone
    values: NDArray[np.float32]  # of these checks, one after the other
    drawn: NDArray[np.float32]  # its way (d * 64), and the stretch of each value [s]


def measure_episode(episode: Episode) -> Measurement:
    """Measure one episode alone."""
    motion, problems = motion_of(episode), tuple(shortened(problem, _LONGEST) for problem in episode.problems)
    if motion is None:
        seconds = len(episode) / episode.fps if episode.fps > 0 else 0.0
        few = f"has {counted(len(episode), 'frame')} of motion; at least {FEWEST_FRAMES} are needed"
        problems = problems or (few,)
        about = episode.task, episode.place, episode.fps, problems, episode.notes
        return Measurement(episode.number, seconds, *about, (), (), _NONE, _NONE)
    with np.errstate(all="ignore"):  # damaged values are huge
        measures = [check.measure(motion) for check in CHECKS if check.measure is not None]
    values = np.concatenate([measure.values for measure in measures]).astype(np.float32)
    spans = np.concatenate([measure.spans for measure in measures]).astype(np.float32)
    sizes = tuple(len(measure.values) for measure in measures)
    drawn = np.concatenate([path_of(motion).ravel(), spans.ravel()]).astype(np.float32)
    about = episode.task, episode.place, episode.fps, problems, episode.notes
    return Measurement(episode.number, motion.seconds, *about, motion.names, sizes, values, drawn)


class _Measured:
    """All that is kept of the episodes while they are read."""

    def __init__(self) -> None:
        self.episodes: list[Measurement] = []  # without what is spooled
        self.problems: dict[int, str] = {}
        self.unusable: list[int] = []  # episodes without motion that can be compared
        self.notes: list[str] = []  # on the set
        self.remarks: Counter[str] = Counter()  # of the reader, on single episodes
        self.names: tuple[str, ...] | None = None  # of the channels, those of the first episode that has some
        self.sizes: tuple[int, ...] = ()  # values of each check
        self.rows = bytearray()  # float32, of `sizes` values each
        self.width = 0  # numbers that are spooled of each episode: `Measurement.drawn`, zeros where there are none
        self.spool = tempfile.SpooledTemporaryFile(max_size=_IN_MEMORY)  # noqa: SIM115 - lives as long as the audit

    def add(self, episode: Measurement) -> None:
        """Add an episode; of what belongs to none, which has a negative number, keep the problems."""
        if episode.number < 0:
            self.notes += episode.problems
            return
        at, is_usable, problem = len(self.episodes), bool(episode.names), "; ".join(episode.problems)
        if is_usable and self.names is None:
            self.names = episode.names
        elif is_usable and episode.names != self.names:
            channels = f"has the channels {first_names(episode.names, 3)}; others {first_names(self.names or (), 3)}"
            problem, is_usable = problem or channels, False
        if problem:
            self.problems[at] = shortened(problem, _LONGEST)
        if not is_usable:
            self.unusable.append(at)
        self.remarks.update(episode.notes)
        self.episodes.append(episode._replace(problems=(), notes=(), names=(), sizes=(), values=_NONE, drawn=_NONE))
        self._keep(episode if is_usable else None, at)

    def close(self) -> None:
        """Remove the temporary file."""
        self.spool.close()

    def _keep(self, episode: Measurement | None, at: int) -> None:
        if episode is not None and not self.width:
            self.sizes, self.width = episode.sizes, len(episode.drawn)
            for _ in range(at):
                self._keep(None, at)
        none = np.full(sum(self.sizes), np.nan, dtype=np.float32), np.zeros(self.width, dtype=np.float32)
        values, drawn = none if episode is None else (episode.values, episode.drawn)
        self.rows += values.tobytes()
        self.spool.write(drawn.tobytes())

    def _drawn(self, row: int) -> NDArray[np.float32]:
        self.spool.seek(4 * row * self.width)
        return np.frombuffer(self.spool.read(4 * self.width), dtype=np.float32)

    def ways(self, rows: NDArray[np.intp]) -> Array:
        """Return the ways (m, d, 64) of some episodes."""
        d = len(self.names or ())
        chosen = [self._drawn(int(row))[: d * PATH] for row in rows]
        return np.array(chosen, dtype=np.float64).reshape(len(rows), d, PATH)

    def stretch(self, row: int, value: int) -> tuple[float, float]:
        """Return the stretch [s] of a value of an episode."""
        first = len(self.names or ()) * PATH + 2 * value
        start, end = self._drawn(row)[first : first + 2].tolist()
        return start, end

    def values(self) -> list[Array]:
        """Return the values (n, k) of each check that measures an episode alone."""
        table = np.frombuffer(self.rows, dtype=np.float32).reshape(len(self.episodes), sum(self.sizes))
        return np.split(table, np.cumsum(self.sizes)[:-1], axis=1)


class _Compared(NamedTuple):
    """A check over the whole set."""

    check: Check
    values: Array  # (n, k)
    columns: NDArray[np.intp]  # (n,), the value that is the most unusual
    evidence: Array  # (n,); of exact checks infinite where they contradict
    first: int  # index of the stretch of its first value; -1 if it has none


def audit_episodes(
    episodes: Iterable[Episode], error_rate: float = 0.05, progress: Callable[[int], object] | None = None
) -> Audit:
    """Find the episodes of a data set that are unlike the others, or contradict it; see `kineme.audit.calibrate`.

    Episodes are read once. With fewer than ``1 / error_rate`` only contradictions are flagged, and the others ranked.
    `progress` is called with the episodes done since the last call, twice for each: measured, compared.
    """
    return audit_measured(map(measure_episode, episodes), error_rate, progress)


def audit_measured(
    measurements: Iterable[Measurement], error_rate: float = 0.05, progress: Callable[[int], object] | None = None
) -> Audit:
    """Compare episodes that are measured already; as `audit_episodes`."""
    check_error_rate(error_rate)
    with closing(_Measured()) as measured:
        for episode in measurements:
            measured.add(episode)
            if progress is not None:
                progress(1)
        if not measured.episodes:
            raise DataError("expected a data set with episodes, got one without; see if its download is complete")
        return _audited(measured, error_rate, progress or (lambda done: None))


def _audited(measured: _Measured, error_rate: float, progress: Callable[[int], object]) -> Audit:
    """Compare what was measured, and list what is unusual."""
    episodes = measured.episodes
    tasks = calibrate.tasks_of([episode.task for episode in episodes])
    compared = list(_compared(measured, tasks, progress)) if measured.names else []
    broken, of_the_set = _contradictions(measured, compared)
    soft = [row.evidence for row in compared if row.check.side != "exact"]
    evidence = np.stack(soft, axis=1) if soft else np.zeros((len(broken), 0))
    ranking = calibrate.rank(evidence, ~broken, error_rate)
    flagged = broken | ((ranking.p_values <= error_rate + 1e-12) | ranking.outlying) & (ranking.by_chance > 0)
    return Audit(
        np.array([episode.number for episode in episodes]), sum(episode.seconds for episode in episodes),
        len({episode.task for episode in episodes if episode.task}) or 1, error_rate, ranking.by_chance,
        np.where(broken, 0.0, ranking.p_values), ranking.evidence, flagged,
        _findings(measured, compared, broken, ranking, flagged, tasks), of_the_set,
    )  # fmt: skip


def _compared(measured: _Measured, tasks: calibrate.Groups, say: Callable[[int], object]) -> Iterator[_Compared]:
    """Yield the checks with their evidence."""
    alone = [check for check in CHECKS if check.measure is not None]
    values = dict(zip([check.name for check in alone], measured.values(), strict=True))
    extents = np.nanmedian(values["above"] - values["below"], axis=0).astype(np.float64)
    usable = np.ones(len(measured.episodes), dtype=np.bool_)
    usable[measured.unusable] = False
    groups = {by_task: calibrate.groups_of(tasks, fewest) for by_task, fewest in calibrate.ENOUGH.items()}
    ways = calibrate.unlike(measured.ways, extents, [rows[usable[rows]] for rows in tasks], len(usable), say)
    values |= {"unlike": ways[:, :1], "task": ways[:, 1:]}
    unit, stretch = np.where(extents > 0, extents, 1.0), 0
    for check in CHECKS:
        own = values[check.name]
        first, stretch = (stretch, stretch + own.shape[1]) if check.measure else (-1, stretch)
        if check.side == "exact":
            wrong = np.where(own[:, 0] > 0, np.inf, 0.0)
            yield _Compared(check, own, np.zeros(len(own), dtype=np.intp), wrong, first)
            continue
        scaled = calibrate.centered(own / np.tile(unit, own.shape[1] // len(unit)) if check.relative else own, tasks)
        among = groups[check.by_task]
        columns = calibrate.evidence_of(_SIDES[check.side](scaled), among, check.least)
        evidence = calibrate.evidence_of(columns.max(axis=1, keepdims=True), among, _LEAST_EVIDENCE)[:, 0]
        yield _Compared(check, own, columns.argmax(axis=1), evidence, first)


def _contradictions(measured: _Measured, compared: list[_Compared]) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return which episodes contradict themselves (n,), and what more than half of the set does, which flags none."""
    n = len(measured.episodes)
    broken, of_the_set = np.zeros(n, dtype=np.bool_), list(measured.notes)
    of_the_set += [remark for remark, count in measured.remarks.items() if count > _SHARED * n]
    for row in compared:
        if row.check.side != "exact":
            continue
        wrong = np.isinf(row.evidence)
        if wrong.mean() > _SHARED and n > 1:
            first = int(wrong.argmax())
            words = row.check.words.format(
                value=float(np.median(row.values[wrong, 0])), fps=measured.episodes[first].fps,
                problems=measured.problems.get(first, ""),
            )  # fmt: skip
            of_the_set.append(f"{row.check.name}: in {wrong.sum():,} of {counted(n, 'episode')}, {words}")
            row.evidence[:] = 0.0
        broken |= np.isinf(row.evidence)
    broken[list(measured.unusable)] = True
    return broken, tuple(of_the_set)


def _findings(
    measured: _Measured,
    compared: list[_Compared],
    broken: NDArray[np.bool_],
    ranking: calibrate.Ranking,
    flagged: NDArray[np.bool_],
    tasks: calibrate.Groups,
) -> tuple[Finding, ...]:
    order = np.lexsort((-ranking.evidence, ~broken))
    listed = order[flagged[order]]
    if not (flagged & ~broken).any():
        listed = np.concatenate([listed, order[~flagged[order] & (ranking.evidence[order] > 0)][:_RANKED]])
    task_of = np.empty(len(broken), dtype=np.intp)
    for task, rows in enumerate(tasks):
        task_of[rows] = task
    usual: dict[tuple[str, int], Array] = {}

    def reason(row: _Compared, at: int) -> Reason:
        column, rows = int(row.columns[at]), tasks[task_of[at]]
        if len(rows) < calibrate.FEWEST_OF_TASK:
            rows = np.arange(len(broken))
        if (row.check.name, rows[0]) not in usual:
            usual[row.check.name, rows[0]] = np.nanmedian(row.values[rows], axis=0)
        names, heads = measured.names or ("",), row.check.columns
        size = max(1, row.values.shape[1] // len(heads))
        channel = names[column % len(names)] if "{channel}" in row.check.words else ""
        words = row.check.words.format(
            value=row.check.shown(float(row.values[at, column])), problems=measured.problems.get(at, ""),
            usual=row.check.shown(float(usual[row.check.name, rows[0]][column])),
            channel=channel, column=heads[column // size], fps=measured.episodes[at].fps,
        )  # fmt: skip
        start, end = 0.0, measured.episodes[at].seconds
        if row.first >= 0:
            start, end = measured.stretch(at, row.first + column)
        return Reason(row.check.name, words, channel, start, end, float(row.evidence[at]))

    def finding(at: int) -> Finding:
        episode = measured.episodes[at]
        by_evidence = sorted(compared, key=lambda row: -row.evidence[at])
        least = min(_LEAST_REASON, by_evidence[0].evidence[at]) if by_evidence else 0.0
        reasons = [reason(row, at) for row in by_evidence if row.evidence[at] >= least > 0]
        if at in measured.problems and not any(reason.check == "problems" for reason in reasons):
            reasons = [Reason("problems", measured.problems[at], "", 0.0, episode.seconds, np.inf), *reasons]
        kind = "contradiction" if broken[at] else "outlying" if ranking.outlying[at] else "unusual"
        return Finding(
            episode.number, episode.task, episode.place, episode.seconds,
            kind if flagged[at] else "ranked", 0.0 if broken[at] else float(ranking.p_values[at]),
            float(ranking.evidence[at]), tuple(reasons[:_REASONS]),
        )  # fmt: skip

    return tuple(finding(int(at)) for at in listed)

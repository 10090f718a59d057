"""Kinds of movements in the episodes of robot data, without any example: boundaries, kinds, what follows what, names.

Each episode is cut on its own, by `kineme.movements.segmentation.work`. The pieces of all episodes are then divided
into kinds, by `kineme.anchoring.kinds`; of many, those of a sample of episodes. Three samples of each piece are kept in
memory meanwhile, so that the length of episodes does not matter.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.grammar import Grammar, estimate_grammar, in_order, most_probable, posterior
from kineme.anchoring.kinds import Kinds, describe_pieces, excursions, learn_kinds, log_densities
from kineme.errors import DataError, KinemeError
from kineme.io.reading.episode_recordings import heads_of
from kineme.io.writing.annotations import Annotation
from kineme.library.learn import learn
from kineme.library.proposals import NamedProposal, discovered_ids, store_proposals
from kineme.library.storage import changes, read
from kineme.library.storage.store import Store
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.detect import find_channels
from kineme.movements.episodes import LARGEST, LATEST, STATE, Episode, default_features, even_stamps, head_of
from kineme.movements.segmentation.work import Work, at_rest, boundaries, interpolated, roles_of
from kineme.movements.trajectories.as_learned import of_columns
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.runtime.parallel import single_threaded_blas
from kineme.validation import MIN_SAMPLES, Array

_CUES = ("gripper", "contact", "object")  # roles of columns of other features that help to find boundaries
_LEARNED = 3000  # pieces that kinds are learned from, about
_VARIANCE = 0.95  # share of that of the joints that their principal axes hold, at least
_MIN_MEMBERS = 3  # movements of a kind
_HOLD = 0.3  # of the episodes of a task hold a kind that belongs to it, at least
_FOLLOW = 0.1  # of a kind's movements follow what is listed, at least
_LONGEST = 40  # letters of a proposed name
_AT_ONCE = 256  # episodes whose movements are stored in one change
_COMMON_WORDS = frozenset(
    {"a", "an", "and", "at", "from", "in", "into", "it", "its", "of", "off", "on", "onto", "out", "over", "the", "then",
     "to", "up", "with"}
)  # fmt: skip


class Segment(NamedTuple):
    """A movement in an episode."""

    episode: int  # its number
    place: str  # where it is stored, see `Episode.place`
    start: float  # [s] by the clock of the episode
    end: float
    kind: int | None  # index of its kind; None if that has too few
    confidence: float  # probability of the kind
    density: float  # log density of its features: the larger, the more typical it is
    intervals: tuple[tuple[float, float], tuple[float, float]]  # from when to when start, and end, may lie [s]
    origin: float  # first stamp of the episode [s]


class Kind(NamedTuple):
    """Movements that are alike, over all episodes."""

    name: str  # that is proposed
    times: int
    seconds: float  # mean duration
    follows: tuple[tuple[str, float], ...]  # what comes before it, "begin" too, and in what share of the times
    tasks: tuple[str, ...]  # those that it belongs to


@dataclass(frozen=True, eq=False)
class Discovery:
    """Kinds of movements in episodes, in the order in which they usually come."""

    kinds: tuple[Kind, ...]
    segments: tuple[Segment, ...]
    grammar: Grammar
    episodes: int
    seconds: float
    problems: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """Return plain data without the segments: what stays small, however many episodes there are."""
        return {
            "kinds": [kind._asdict() | {"follows": dict(kind.follows)} for kind in self.kinds],
            "grammar": self.grammar.to_dict(),
            "movements": len(self.segments),
            "alone": sum(segment.kind is None for segment in self.segments),
            "episodes": self.episodes,
            "seconds": self.seconds,
            "problems": list(self.problems),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, with a row for each segment."""
        names = {None: None} | {k: kind.name for k, kind in enumerate(self.kinds)}
        return self.summary() | {"segments": [each._asdict() | {"kind": names[each.kind]} for each in self.segments]}


class Observation(NamedTuple):
    """Movements of one episode, without rests."""

    number: int
    place: str
    task: str
    origin: float  # first stamp [s]
    seconds: float
    edges: Array  # (n, 2) start and end [s]
    intervals: Array  # (n, 2, 2) as in `Segment`
    paths: NDArray[np.float32]  # (n, 3, d) the state at the begin, in the middle, at the end


@single_threaded_blas()  # kinds have few features: a second thread mostly waits, and takes ten times as long
def discover(
    episodes: Iterable[Episode], feature: str | None = None, how: Work | None = None, n_learned: int = _LEARNED
) -> Discovery:
    """Find the kinds of movements in episodes, which are read once, with names that their tasks propose.

    They are described by a `feature`, see `state_of`; columns of grippers, contacts and objects in others help to find
    boundaries. They are learned from about `n_learned` pieces, and all are assigned to them.
    """
    observations: list[Observation] = []
    problems: list[str] = []
    columns: tuple[str, ...] | None = None
    for episode in episodes:
        try:
            names, state = state_of(episode, feature)
            if columns not in (None, names):
                raise DataError(f"expected the columns {', '.join(columns or ())} as before, got {', '.join(names)}")
            observations.append(observe(episode, names, state, how))
        except KinemeError as error:
            problems.append(f"{episode.label}: {error}")
            continue
        columns = names
    if columns is None or not any(len(each.edges) for each in observations):
        reason = f"; the first problem: {problems[0]}" if problems else ""
        raise DataError(f"expected episodes with movements, got none that has any{reason}")
    features, n_axes = features_of(observations, columns)
    starts = np.cumsum([0, *(len(each.edges) for each in observations)])
    share = min(1.0, n_learned / starts[-1])
    # Not evenly spaced ones: tasks may take turns.
    order = np.random.default_rng(0).permutation(len(observations))
    sample = np.sort(order[: max(1, round(share * len(observations)))])
    rows = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in sample])
    kinds = learn_kinds(features[rows], np.diff(starts)[sample].tolist(), 3 * n_axes)
    units = excursions(kinds, n_axes)
    segments = [
        segment
        for observation, first in zip(observations, starts.tolist(), strict=False)
        for segment in label(observation, features[first : first + len(observation.edges)], kinds, units)
    ]
    return _named(segments, observations, problems)


def state_of(episode: Episode, feature: str | None = None) -> tuple[tuple[str, ...], Array]:
    """Return the heads and values (T, d) of a feature, by default `default_features`, without columns of NaN."""
    chosen = (
        (feature,) if feature else default_features({name: values.shape[1] for name, values in episode.signals.items()})
    )
    if not chosen or chosen[0] not in episode.signals:
        raise DataError(
            f"expected the feature {(chosen or (STATE,))[0]}, got {', '.join(episode.signals) or 'none'}; say which "
            "one, in the shell with --feature"
        )
    values = np.concatenate([_numbers(episode, name) for name in chosen], axis=1)
    usable = np.flatnonzero(np.isfinite(values).any(axis=0))
    if not len(usable):
        raise DataError(f"expected finite numbers in {', '.join(chosen)}, got none")
    heads = [head for name in chosen for head in _heads(episode, name)]
    return tuple(heads[k] for k in usable.tolist()), values[:, usable]


def times_of(episode: Episode) -> Array:
    """Return the stamps of an episode [s]; where they agree with the declared rate, repeat or go back, those of it."""
    times = np.asarray(even_stamps(episode.times, episode.fps), dtype=np.float64)
    if len(times) < MIN_SAMPLES or not np.isfinite(times).all() or not (np.diff(times) > 0).all():
        if not episode.fps > 1 / LATEST or len(times) < MIN_SAMPLES:
            raise DataError(
                f"expected {MIN_SAMPLES} frames or more with stamps that increase, or a declared rate, got "
                f"{len(times)} frames"
            )
        return np.arange(len(times)) / episode.fps
    return times


def observe(episode: Episode, names: Sequence[str], state: Array, how: Work | None = None) -> Observation:
    """Cut an episode, and return its movements with three samples of the state (T, d) in each."""
    times = times_of(episode)
    heads, values = [*names], [state]
    for feature in episode.signals:
        several = _heads(episode, feature)
        if feature.startswith("observation.") and not {*several[:1]} & {*names}:
            roles = roles_of(several)
            chosen = np.sort(np.concatenate([roles[role] for role in _CUES]))
            heads += [several[k] for k in chosen]
            values.append(_numbers(episode, feature)[:, chosen])
    columns = np.concatenate(values, axis=1)
    cuts = boundaries(times, columns, heads, how)
    edges = np.concatenate((times[:1], cuts.times, times[-1:]))
    intervals = np.concatenate((times[[[0, 0]]], cuts.intervals, times[[[-1, -1]]]))
    moving = np.flatnonzero(~at_rest(times, columns, heads, edges))
    spans = np.column_stack((edges[moving], edges[moving + 1]))
    at = np.column_stack((spans[:, 0], spans.mean(axis=1), spans[:, 1]))
    paths = interpolated(at, times, state)
    between = np.stack((intervals[moving], intervals[moving + 1]), axis=1)
    origin, seconds = float(times[0]), float(times[-1] - times[0])
    task = episode.task or ""
    return Observation(episode.number, episode.place, task, origin, seconds, spans, between, paths.astype(np.float32))


def features_of(observations: Sequence[Observation], columns: Sequence[str]) -> tuple[Array, int]:
    """Return features (n, f) of all movements, and the number of principal axes of the arm's joints.

    Joints in standard deviations, along the principal axes that hold 95 % of their variance, as `describe_pieces` has
    them; then each gripper at the begin and at the end, in shares of its range; and the logarithm of the duration.
    """
    paths = np.concatenate([each.paths for each in observations]).astype(np.float64)
    spans = np.concatenate([each.edges for each in observations])
    roles = roles_of(columns)
    arm, gripper = paths[:, :, roles["arm"]], paths[:, :, roles["gripper"]]
    points = arm.reshape(-1, arm.shape[2])
    spread = points.std(axis=0)
    moving = spread > 1e-9 * max(1e-300, spread.max(initial=0.0))
    if not moving.any():
        raise DataError(f"expected joints or positions that move among {', '.join(columns)}, got none")
    points = (points[:, moving] - points[:, moving].mean(axis=0)) / spread[moving]
    variances, axes = np.linalg.eigh(points.T @ points / len(points))
    shares = np.cumsum(variances[::-1]) / variances.sum()
    n_axes = int(np.searchsorted(shares, _VARIANCE)) + 1
    joints = (points @ axes[:, ::-1][:, :n_axes]).reshape(len(paths), 3, n_axes)
    extents = np.maximum(np.ptp(gripper, axis=(0, 1)), np.finfo(float).tiny)
    openings = (gripper[:, [0, 2]] - gripper.min(axis=(0, 1))) / extents
    lasting = np.log(spans[:, 1] - spans[:, 0])
    return np.column_stack((describe_pieces(joints), openings.reshape(len(paths), -1), lasting)), n_axes


def label(observation: Observation, features: Array, kinds: Kinds, units: Sequence[tuple[int, int]]) -> list[Segment]:
    """Return the movements of an episode with their kinds; those of `units` joined, as kinds of their own behind."""
    if not len(features):
        return []
    densities = log_densities(kinds.means, kinds.roots, features)
    labels = most_probable(kinds.grammar, densities).tolist()
    probabilities = np.minimum(posterior(kinds.grammar, densities).probabilities, 1.0)
    segments: list[Segment] = []
    pair = {unit: len(kinds) + k for k, unit in enumerate(units)}
    for i, kind in enumerate(labels):
        (start, end), (begin, stop) = observation.edges[i].tolist(), observation.intervals[i].tolist()
        certainty, density = float(probabilities[i, kind]), float(densities[i, kind])
        last = segments[-1] if segments else None
        if last is not None and (joined := pair.get((labels[i - 1], kind))) is not None and last.kind == labels[i - 1]:
            segments[-1] = last._replace(
                end=end, kind=joined, confidence=min(last.confidence, certainty), density=last.density + density,
                intervals=(last.intervals[0], tuple(stop)),
            )  # fmt: skip
            continue
        segments.append(Segment(observation.number, observation.place, start, end, kind, certainty, density,
                                (tuple(begin), tuple(stop)), observation.origin))  # fmt: skip
    return segments


def _named(segments: Sequence[Segment], observations: Sequence[Observation], problems: Sequence[str]) -> Discovery:
    """Number the kinds in the order in which they come, leave those of few movements out, and propose names."""
    times = Counter(segment.kind for segment in segments)
    by_episode: dict[int, list[str]] = {}
    for segment in segments:
        if times[segment.kind] >= _MIN_MEMBERS:
            by_episode.setdefault(segment.episode, []).append(str(segment.kind))
    if not by_episode:
        raise DataError(
            f"expected {_MIN_MEMBERS} movements of one kind or more, got {len(segments)} movements that are all unlike "
            "each other; give more episodes"
        )
    order = in_order([*by_episode.values()])
    number = {int(name): k for k, name in enumerate(order)}
    segments = [segment._replace(kind=number.get(segment.kind)) for segment in segments]  # type: ignore[arg-type]
    tasks = {each.number: each.task for each in observations}
    own: list[list[Segment]] = [[] for _ in order]
    for segment in segments:
        if segment.kind is not None:
            own[segment.kind].append(segment)
    episodes = Counter(tasks.values())
    of_tasks = []
    for several in own:
        holding = Counter(tasks[episode] for episode in {segment.episode for segment in several})
        of_tasks.append(tuple(sorted(task for task, n in holding.items() if n >= _HOLD * episodes[task])))
    names = propose_names(of_tasks, {*tasks.values()})
    grammar = estimate_grammar([[names[number[int(name)]] for name in path] for path in by_episode.values()], names)
    before = grammar.counts / np.maximum(grammar.counts.sum(axis=0), 1.0)
    kinds = []
    for k, several in enumerate(own):
        likely = [i for i in np.argsort(-before[:, k], kind="stable").tolist() if before[i, k] >= _FOLLOW]
        follows = tuple(([*names, "begin"][i], float(before[i, k])) for i in likely)
        lasting = float(np.mean([segment.end - segment.start for segment in several]))
        kinds.append(Kind(names[k], len(several), lasting, follows, of_tasks[k]))
    seconds = sum(each.seconds for each in observations)
    return Discovery(tuple(kinds), tuple(segments), grammar, len(observations), seconds, tuple(problems))


def propose_names(of_tasks: Sequence[Sequence[str]], tasks: Iterable[str]) -> tuple[str, ...]:
    """Return a name for each kind from the tasks that it belongs to: the words that these, and no others, have.

    A kind of one task alone is called as the task. Several with the same words are counted; kinds that all tasks have,
    or whose tasks have no word of their own, are "motion 1" and so on.
    """
    stems = []
    for own in of_tasks:
        others = {task for task in tasks if task not in own}
        shared = set.intersection(*({*_words(task)} for task in own)) if own else set()
        shared -= {word for task in others for word in _words(task)} | _COMMON_WORDS
        words = [word for word in _words(own[0]) if word in shared] if own and others else []
        alone = own[0].strip() if len(own) == 1 else ""
        stem = alone if alone and (words or not others) else " ".join(dict.fromkeys(words))
        stems.append(stem[:_LONGEST].rstrip() or "motion")
    counts, counted = Counter(stems), Counter[str]()
    names = []
    for stem in stems:
        counted[stem] += 1
        names.append(f"{stem} {counted[stem]}" if counts[stem] > 1 or stem == "motion" else stem)
    return tuple(names)


def annotations_of(discovery: Discovery, recording: str) -> list[Annotation]:
    """Return the movements as annotations of a recording of that name, by the names that are proposed.

    The p-value of a movement is the share of its kind whose density is as low or lower; the uncertainty of its edges is
    half of the longer interval.
    """
    densities: dict[int | None, list[float]] = {}
    for segment in discovery.segments:
        densities.setdefault(segment.kind, []).append(segment.density)
    ranked = {kind: np.sort(values) for kind, values in densities.items()}
    return [
        Annotation(
            recording, segment.place, segment.start, segment.end,
            None if segment.kind is None else discovery.kinds[segment.kind].name,
            float(np.searchsorted(ranked[segment.kind], segment.density, side="right") / len(ranked[segment.kind])),
            segment.confidence, segment.origin, 0.5 * float(np.ptp(segment.intervals, axis=1).max()),
        )
        for segment in discovery.segments
    ]  # fmt: skip


def store_discovery(
    store: Store,
    episodes: Iterable[Episode],
    discovery: Discovery,
    feature: str | None = None,
    progress: Callable[[int], object] | None = None,
) -> int:
    """Store the movements of a discovery, read from the episodes again, and propose its kinds; return the version.

    Movements without a symbol that earlier discoveries brought, and this one does not have, are deleted. One undo takes
    back all of it.
    """
    earlier = discovered_ids(store)
    held, version = np.setdiff1d(read.all_ids(store), earlier), store.version
    made: int | None = None  # last version that this call made
    by_episode: dict[int, list[Segment]] = {}
    for segment in discovery.segments:
        if segment.kind is not None:
            by_episode.setdefault(segment.episode, []).append(segment)
    ids: list[int] = []
    stored: list[Segment] = []
    pending: list[tuple[Segment, Array, Array]] = []
    columns: tuple[str, ...] = ()
    channels: Channels | None = None  # of the first movements: a gripper that rests in others is none of steps

    def flush() -> None:
        nonlocal channels, made
        if not pending:
            return
        segments, times, states = zip(*pending, strict=True)
        names = [f"{segment.place}[{segment.start:.2f}-{segment.end:.2f} s]" for segment in segments]
        demos = Demonstrations.from_arrays(states, None, times, names)
        channels = channels or find_channels(columns, demos.positions, demos.offsets, {})
        report = learn(store, of_columns(demos, channels), continues=made)
        made = report.version if report.version > version else made
        ids.extend(report.ids.tolist())
        stored.extend(segments)
        pending.clear()

    for n, episode in enumerate(episodes, 1):
        if own := by_episode.get(episode.number):
            columns, state = state_of(episode, feature)
            times = times_of(episode)
            state = interpolated(times, times, state)
            for segment in own:
                rows = slice(*np.searchsorted(times, (segment.start - 1e-9, segment.end + 1e-9)).tolist())
                if rows.stop - rows.start >= MIN_SAMPLES:
                    pending.append((segment, times[rows], state[rows]))
        if n % _AT_ONCE == 0:
            flush()
        if progress is not None:
            progress(n)
    flush()
    keys = np.array(ids, dtype=np.int64)
    stale = np.intersect1d(np.setdiff1d(earlier, keys), read.unlabeled_ids(store))
    if len(stale):
        made = changes.delete_movements(store, stale, continues=made)
    proposals = []
    for k, kind in enumerate(discovery.kinds):
        members = [i for i, segment in enumerate(stored) if segment.kind == k]
        if members:
            medoid = max(members, key=lambda i: stored[i].density)
            certainty = float(np.mean([stored[i].confidence for i in members]))
            proposals.append(NamedProposal(kind.name, np.unique(keys[members]), int(keys[medoid]), certainty))
    return store_proposals(store, proposals, np.intersect1d(held, keys).tolist(), made)


def _heads(episode: Episode, feature: str) -> tuple[str, ...]:
    """Name the columns of a feature as `kineme.read_recordings` does: ``observation.state`` by its entries alone."""
    if feature == STATE:
        return heads_of(episode)[feature]
    return tuple(head_of(feature, entry) for entry in episode.names[feature])


def _numbers(episode: Episode, feature: str) -> Array:
    values = np.asarray(episode.signals[feature], dtype=np.float64)
    return np.where(np.abs(values) <= LARGEST, values, np.nan)


def _words(task: str) -> list[str]:
    return re.findall(r"\w+", task.lower())

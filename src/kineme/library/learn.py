"""Learn movements: describe new ones and store them in batches, each of which is one version.

An undo takes back all batches of one call, unless somebody else has changed the library between them.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.merge_files import Source as File
from kineme.library.commit import Batch, Committed, commit, find_stored, serialize_new
from kineme.library.serialize import check, evenly_sampled, relative_times, stored_times
from kineme.library.storage.channels import other_columns, to_bytes
from kineme.library.storage.read import count
from kineme.library.storage.source import Source
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import check_name
from kineme.movements.channels.channel import (
    in_words,
    is_plain,
    learned_names,
    recorded_names,
    same_columns,
)
from kineme.movements.channels.column_match import columns_recorded, may_be
from kineme.movements.tables.layout import listed
from kineme.movements.trajectories.as_learned import as_recorded, by_names, of_columns
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements, in_coordinates
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array
from kineme.validation import describe as name_of

_BITS = 24  # of a duration that count
_DECIMALS = 3  # of a quaternion at the start of a movement, where it only tells movements apart

Progress = Callable[[int, int], object]

_BATCH_MOVEMENTS = 8192
_SMALL_BATCH = 2048  # fewer movements are split into four batches: one is written while the next one is described
_BATCH_SAMPLES = 2_000_000


@dataclass(frozen=True, eq=False)
class LearnReport:
    """The result of learning.

    Attributes
    ----------
    added, known : int
        Number of movements that were stored, and of those that were stored before.
    symbols : tuple of str
        Names of new symbols.
    ids : ndarray of shape (n,)
        Ids of the movements in the given order; for movements stored before, the existing id.
    version : int
        Version that this call made, the last one of several; where nothing changed, the one that it found.
    """

    added: int
    known: int
    symbols: tuple[str, ...]
    ids: NDArray[np.int64]
    version: int

    def __repr__(self) -> str:
        return f"LearnReport(added={self.added}, known={self.known}, symbols={self.symbols!r}, version={self.version})"


def learn(  # noqa: PLR0913, PLR0917 - those of `ActionLibrary.learn`
    store: Store,
    movements: MovementsLike,
    labels: Sequence[Any] | None = None,
    source: Source | Sequence[Source | None] | None = None,
    places: Sequence[Any] | None = None,
    progress: Progress | None = None,
    groups: Sequence[Any] | None = None,
) -> LearnReport:
    """Store new movements; see `ActionLibrary.learn`."""
    store.check_writable()
    found = store.version
    demos = _in_columns_of(store, Demonstrations.of(movements))
    _check_dimensions(store, demos)
    check(demos)
    names = _as_names(demos, "label", demos.labels if labels is None else labels)
    people = _as_names(demos, "group", groups)
    sources = _as_sources(source, len(demos))
    where = _as_places(places, sources)
    reports: list[Committed] = []
    with ThreadPoolExecutor(1, "kineme-library") as pool:
        pending: Future[Committed] | None = None
        done, version = 0, None
        for start, stop in _ranges(demos):
            rows = slice(start, stop)
            batch = _prepared(store, _part(demos, start, stop), (names[rows], people[rows], sources[rows], where[rows]))
            if pending is not None:  # one batch is written while the next one is described
                reports.append(pending.result())
                version = reports[-1].version or version
                done = _tell(progress, done + len(reports[-1].ids), len(demos))
            pending = pool.submit(commit, store, batch, version)
        if pending is not None:
            reports.append(pending.result())
            _tell(progress, done + len(reports[-1].ids), len(demos))
    return LearnReport(
        sum(one.added for one in reports),
        sum(len(one.ids) - one.added for one in reports),
        tuple(dict.fromkeys(name for one in reports for name in one.symbols)),
        np.concatenate([one.ids for one in reports]),
        max((one.version for one in reports if one.version is not None), default=found),
    )


def _prepared(store: Store, demos: Demonstrations, given: tuple[Any, Any, Any, Any]) -> Batch:
    """A batch ready to be committed; only what is new is serialized."""
    even = evenly_sampled(demos)
    batch = Batch(demos, digests(demos, even), exact_digests(demos, even), *given)
    with store.reading() as connection:
        stored = find_stored(connection, batch)
    new = [i for i in range(len(demos)) if stored.id_of(batch, i) is None]
    if new:
        serialize_new(store, demos, batch, new)
    return batch


def _tell(progress: Progress | None, done: int, total: int) -> int:
    if progress is not None:
        progress(done, total)
    return done


def _ranges(demos: Demonstrations) -> Iterator[tuple[int, int]]:
    """Ranges of movements for batches, limited by movements and samples; each has at least one movement."""
    start, n = 0, len(demos)
    most = min(_BATCH_MOVEMENTS, max(_SMALL_BATCH, -(-n // 4)))
    while start < n:
        limit = int(np.searchsorted(demos.offsets, demos.offsets[start] + _BATCH_SAMPLES, side="right")) - 1
        stop = min(max(limit, start + 1), start + most, n)
        yield start, stop
        start = stop


def _part(demos: Demonstrations, start: int, stop: int) -> Demonstrations:
    """Consecutive movements, sharing the samples."""
    whole, first, last = demos.movements, demos.offsets[start], demos.offsets[stop]
    return Demonstrations.of_movements(
        Movements(
            whole.positions[first:last],
            whole.offsets[start : stop + 1] - first,
            whole.durations[start:stop],
            None if whole.times is None else whole.times[first:last],
            None,
            None if whole.names is None else whole.names[start:stop],
            whole.dimensions,
            whole.channels,
            None if whole.recorded is None else whole.recorded[first:last],
        )
    )


def _in_columns_of(store: Store, demos: Demonstrations) -> Demonstrations:
    """Columns without channels, or of the same names, as those of the library; generated ones as they are learned.

    Raises
    ------
    TrajectoryError
        Other names, or units that cannot be converted.
    """
    ours, n_dims = store.channels, store.n_dims
    if demos.channels is None:
        known = ours is not None and demos.n_dims == len(recorded_names(ours))
        return of_columns(demos, ours) if ours is not None and known else demos
    if ours is None and n_dims == demos.n_dims > len(learned_names(demos.channels)):
        return as_recorded(demos)
    if ours is not None and not same_columns(demos.channels, ours):
        here, there = columns_recorded(demos.channels), columns_recorded(ours)
        if {*here.names} == {*there.names}:  # in other orders, units or kinds, as a gripper that moves in steps
            return by_names(demos, ours)
        if len(here.heads) == len(there.heads) and not may_be(demos.channels, ours):
            raise TrajectoryError(
                f"expected the columns {listed(there.heads)} as {_others(store)} of the library in {store.folder}, got "
                f"{listed(here.heads)}; choose the columns, in the shell with --columns, or make another library"
            )
    return Demonstrations.of_movements(in_coordinates(demos.movements), demos.steps)


def _check_dimensions(store: Store, demos: Demonstrations) -> None:
    n_dims = store.n_dims
    if n_dims is not None and n_dims != demos.n_dims:
        raise TrajectoryError(
            f"expected movements of {n_dims} dimensions as {_others(store)} of the library in {store.folder}, "
            f"got {demos.n_dims}; choose the columns, in the shell with --columns, or make another library"
        )
    ours = store.channels
    if (
        n_dims is None
        or same_columns(ours, demos.channels)
        or all(is_plain(one or ()) for one in (ours, demos.channels))
    ):
        return
    raise TrajectoryError(
        f"expected movements recorded as {in_words(ours)}, as {_others(store)} of the library in {store.folder}, got "
        f"{in_words(demos.channels)}; choose the columns and say their kinds, in the shell with --columns and --kind"
    )


def _others(store: Store) -> str:
    """The movements that new ones must be like; a library that is empty now keeps its earlier versions."""
    return "all others" if count(store) else "those of earlier versions, which can be restored,"


def _as_names(demos: Demonstrations, what: str, given: Any) -> list[str | None]:
    """The name of each movement's symbol, from its "label", or of who showed it, its "group"; None without."""
    if given is None:
        return [None] * len(demos)
    plain = _one_each(what, given, len(demos))
    for i, one in enumerate(plain):
        if isinstance(one, (list, tuple, dict, np.ndarray)) or (isinstance(one, float) and math.isnan(one)):
            named = "the action" if what == "label" else "who showed it"
            raise TrajectoryError(
                f"{name_of(i, demos.names)}: expected a {what} that is text or a number, got {one!r}; "
                f"name {named}, or pass None where it has no name"
            )
    known = {one: None if one is None else check_name(str(one)) for one in dict.fromkeys(plain)}
    return [known[one] for one in plain]


def _one_each(what: str, given: Any, n: int) -> list[Any]:
    """A user's list with one item per movement; a single text is refused."""
    many = f"one {what} for each of the {n} movements"
    try:
        size = -1 if isinstance(given, (str, bytes)) else len(given)
    except TypeError:
        size = -1
    if size != n:
        raise TrajectoryError(f"expected {many}, got {size if size >= 0 else repr(given)}")
    return given.tolist() if isinstance(given, np.ndarray) else list(given)


def _as_sources(source: Source | Sequence[Source | None] | None, n: int) -> list[Source | None]:
    if source is None or isinstance(source, Source):
        return [source] * n
    sources = _one_each("source, or one", source, n)
    for one in sources:
        if one is not None and not isinstance(one, Source):
            raise TrajectoryError(f"expected sources to be kineme.library.storage.source.Source or None, got {one!r}")
    return sources


def _as_places(places: Sequence[Any] | None, sources: list[Source | None]) -> list[str | None]:
    """The position of each movement in its source; if not given, duplicates are found by their samples alone."""
    if places is None:
        return [None] * len(sources)
    places = _one_each("place", places, len(sources))
    _check_apart(places, sources)
    return [None if place is None else str(place) for place in places]


def _check_apart(places: Sequence[Any], sources: list[Source | None]) -> None:
    """Refuse two movements at one position of a source: the second would count as a copy of the first."""
    first_at: dict[tuple[int, str], int] = {}
    for i, (place, source) in enumerate(zip(places, sources, strict=True)):
        if source is not None and place is not None and first_at.setdefault((id(source), str(place)), i) != i:
            raise TrajectoryError(
                f"expected a place of its own in {source.path!r} for each movement, got {place!r} for movements "
                f"{first_at[id(source), str(place)]} and {i}; name them apart"
            )


def digests(demos: Demonstrations, even: NDArray[np.bool_]) -> list[int]:
    """BLAKE2b of each movement's positions, other columns and times from its start, as 64-bit numbers; without names.

    They are of the numbers that will be read: a movement that is read and learned again has the same one. The
    probability that any two of a million different movements have the same digest is 3e-8.
    """
    starts = np.repeat(demos.positions[demos.offsets[:-1]], demos.lengths, axis=0)
    positions = starts + (demos.positions - starts).astype(np.float32)
    times = None if even.all() else _times_as_read(demos, even)
    mantissas, exponents = np.frexp(demos.durations)  # even stamps say the duration but for rounding
    durations = np.ldexp(np.rint(mantissas * 2.0**_BITS), exponents)
    return _hashed(demos.offsets, positions, durations, times, even, _other_columns(demos))


def exact_digests(demos: Demonstrations, even: NDArray[np.bool_]) -> list[int]:
    """The same of the numbers as they come, which libraries of earlier versions hold."""
    recorded = demos.movements.recorded
    others = None if recorded is None else to_bytes(recorded, demos.offsets, demos.channels or ())
    times = None if even.all() else relative_times(demos)
    return _hashed(demos.offsets, demos.positions, demos.durations, times, even, others)


def _hashed(
    offsets: NDArray[np.intp],
    positions: Array,
    durations: Array,
    times: Array | None,
    even: NDArray[np.bool_],
    others: list[bytes] | None,
) -> list[int]:
    blob, row = np.ascontiguousarray(positions).data.cast("B"), 8 * positions.shape[1]
    stamps = None if times is None else times.data.cast("B")
    lasting = durations.tobytes()
    parts = []
    for i, (a, b) in enumerate(pairwise(offsets.tolist())):
        digest = hashlib.blake2b(blob[a * row : b * row], digest_size=8)
        digest.update(lasting[8 * i : 8 * i + 8] if stamps is None or even[i] else stamps[8 * a : 8 * b])
        if others is not None:
            digest.update(others[i])
        parts.append(digest.digest())
    return np.frombuffer(b"".join(parts), np.int64).tolist()


def _other_columns(demos: Demonstrations) -> list[bytes] | None:
    """Of each movement what its positions do not say: the steps of discrete columns, and how it is turned at its start.

    A quaternion that is read has norm 1 again, and so other last digits than were stored: they are left out.
    """
    recorded, channels = demos.movements.recorded, demos.channels or ()
    if recorded is None:
        return None
    others = other_columns(channels)
    kinds = [one.kind for one in channels for _ in one.columns]
    steps = recorded[:, [k for k in others if kinds[k] == "discrete"]].astype(np.float32)
    turned = recorded[demos.offsets[:-1]][:, [k for k in others if kinds[k] == "orientation"]].round(_DECIMALS) + 0.0
    return [one.tobytes() + steps[a:b].tobytes() for one, (a, b) in zip(turned, pairwise(demos.offsets), strict=True)]


def _times_as_read(demos: Demonstrations, even: NDArray[np.bool_]) -> Array:
    """Times from the start of each movement, of those that are stored as `read.movements` gives them."""
    relative, offsets = relative_times(demos), demos.offsets.tolist()
    for i in np.flatnonzero(~even).tolist():
        a, b = offsets[i : i + 2]
        stored = stored_times(relative[a:b])
        read = np.frombuffer(stored, np.float32 if len(stored) == 4 * (b - a) else np.float64)
        relative[a:b] = (demos.times[a] + read) - demos.times[a]
    return relative


def learn_recordings(  # noqa: PLR0913, PLR0917 - those of `ActionLibrary.learn`
    store: Store,
    recordings: Recordings,
    options: Mapping[str, Any] | None = None,
    labels: Sequence[str | None] | None = None,
    progress: Progress | None = None,
    root: str | PurePath = "",
    groups: Sequence[str | None] | None = None,
) -> LearnReport:
    """Store the recordings of `kineme.io.reading.recordings.read_recordings`.

    Parameters
    ----------
    store : Store
        The library, ``ActionLibrary.store``.
    recordings : Recordings
    options : mapping, optional
        Options of the reader. The same file read with other options is another source.
    labels : sequence of n str or None, optional
        Names of symbols; by default each movement's own label.
    progress : callable, optional
        As for `ActionLibrary.learn`.
    root : str or Path, optional
        Folder that was read; stored before the names of the files.
    groups : sequence of n str or None, optional
        As for `ActionLibrary.learn`.
    """
    now = datetime.now(UTC).isoformat(timespec="seconds")
    told = {name: value for name, value in (options or {}).items() if value is not None}
    files = {one.path: _source(one, PurePath(root) / one.path, told, now) for one in recordings.sources}
    return learn(
        store,
        recordings.demonstrations,
        list(recordings.labels) if labels is None else labels,
        [files[one.path] for one in recordings.sources],
        places=[one.place for one in recordings.sources],
        progress=progress,
        groups=groups,
    )


def _source(one: File, path: PurePath, told: Mapping[str, Any], now: str) -> Source:
    return Source(path.as_posix(), one.sha256, one.size, path.suffix.lower().lstrip("."), told, now)

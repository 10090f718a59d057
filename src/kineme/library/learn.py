"""Learn movements: describe new ones and store them in batches, each of which is one version.

An undo takes back all batches of one call, unless somebody else has changed the library between them.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError, TrajectoryError
from kineme.io.reading.merge_files import Recordings
from kineme.library import commit
from kineme.library.storage.source import Source
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import check_name, check_symbol
from kineme.movements.channels.channel import in_words, is_plain, learned_names, recorded_names, same_columns
from kineme.movements.channels.column_match import are_unknown, columns_recorded, may_be
from kineme.movements.channels.coordinates import columns_of_kinds
from kineme.movements.tables.layout import listed
from kineme.movements.tables.table import as_name
from kineme.movements.trajectories.as_learned import as_recorded, by_names, of_columns
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import in_coordinates
from kineme.movements.trajectories.trajectory import MovementsLike
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

    - `added`, `duplicates`: number of movements that were stored, and of those that were stored before.
    - `symbols`: names of new ones.
    - `ids` (n,): of the movements in the given order; for movements stored before, the existing id.
    - `version`: that this call made, the last one of several; where nothing changed, the one that it found.
    """

    added: int
    duplicates: int
    symbols: tuple[str, ...]
    ids: NDArray[np.int64] = field(repr=False)
    version: int


def learn(  # noqa: PLR0913, PLR0917 - those of `ActionLibrary.learn`
    store: Store,
    movements: MovementsLike,
    labels: Sequence[Any] | None = None,
    source: Source | Sequence[Source | None] | None = None,
    places: Sequence[Any] | None = None,
    progress: Progress | None = None,
    groups: Sequence[Any] | None = None,
    continues: int | None = None,
) -> LearnReport:
    """Store new movements; see `ActionLibrary.learn`. `continues` is the version that the same call made before."""
    store.check_writable()
    before = store.version
    demos, described = _described(store, movements, labels, source, places, groups)
    reports: list[commit.Committed] = []
    done = 0
    for report in commit_batches(store, described, continues):
        reports.append(report)
        done += len(report.ids)
        if progress is not None:
            progress(done, len(demos))
    return LearnReport(
        sum(report.added for report in reports),
        sum(len(report.ids) - report.added for report in reports),
        tuple(dict.fromkeys(name for report in reports for name in report.symbols)),
        np.concatenate([report.ids for report in reports]),
        max((report.version for report in reports if report.version is not None), default=before),
    )


def _described(
    store: Store,
    movements: MovementsLike,
    labels: Sequence[Any] | None,
    source: Source | Sequence[Source | None] | None,
    places: Sequence[Any] | None,
    groups: Sequence[Any] | None,
) -> tuple[Demonstrations, Iterator[commit.Batch]]:
    """Return movements in the columns of the library, and batches of them; refuse what cannot be stored."""
    demos = in_columns_of(store, Demonstrations.of(movements))
    check_channels(store, demos)
    commit.check(demos)
    names = as_names(demos, "label", demos.labels if labels is None else labels)
    people = as_names(demos, "group", groups)
    sources, where = _as_origins(source, places, len(demos))
    return demos, (
        commit.Batch(
            part, digests(part, commit.evenly_sampled(part)), names[rows], people[rows], sources[rows], where[rows]
        )
        for rows in batches(demos.lengths, min(_BATCH_MOVEMENTS, max(_SMALL_BATCH, -(-len(demos) // 4))))
        for part in [Demonstrations.of_movements(demos.movements.between(rows.start, rows.stop))]
    )


def batches(lengths: NDArray[np.intp], most: int = _BATCH_MOVEMENTS) -> Iterator[slice]:
    """Yield ranges of movements of these lengths, limited by movements and samples; each has at least one movement."""
    start, n, ends = 0, len(lengths), np.cumsum(lengths)
    while start < n:
        limit = int(np.searchsorted(ends, ends[start] - lengths[start] + _BATCH_SAMPLES, side="right"))
        stop = min(max(limit, start + 1), start + most, n)
        yield slice(start, stop)
        start = stop


def commit_batches(
    store: Store, several: Iterable[commit.Batch], continues: int | None = None
) -> Iterator[commit.Committed]:
    """Commit batches one after the other: one is written while what is new in the next one is serialized.

    An undo takes back all of them. Of a batch that has all of its rows already, none is made.
    """
    with ThreadPoolExecutor(1, "kineme-library") as pool:
        pending: Future[commit.Committed] | None = None
        version = continues
        for batch in several:
            with store.reading() as connection:
                stored = commit.find_stored(connection, batch)
            new = [i for i in range(len(batch.digests)) if stored.id_of(batch, i) is None]
            if batch.tables:
                batch.row_of = {i: i for i in new}
            elif new:  # only these are serialized
                commit.serialize_new(store, batch.demos, batch, new)
            if pending is not None:
                report = pending.result()
                version = report.version or version
                yield report
            pending = pool.submit(commit.commit, store, batch, version)
        if pending is not None:
            yield pending.result()


def in_columns_of(store: Store, demos: Demonstrations) -> Demonstrations:
    """Convert columns without channels, or of the same names, to those of the library; generated ones as learned."""
    ours, n_dims = store.channels, store.n_dims
    if demos.channels is None:
        fits = ours is not None and demos.n_dims == len(recorded_names(ours))
        return of_columns(demos, ours) if ours is not None and fits else demos
    if ours is None and n_dims == demos.n_dims > len(learned_names(demos.channels)):
        return as_recorded(demos)
    if ours is not None and not same_columns(demos.channels, ours):
        here, there = columns_recorded(demos.channels), columns_recorded(ours)
        if {*here.names} == {*there.names}:  # in other orders, units or kinds, as a gripper that moves in steps
            return by_names(demos, ours)
        if len(here.heads) == len(there.heads) and not may_be(demos.channels, ours):
            raise TrajectoryError(
                f"expected the columns {listed(there.heads)} as {_others(store)} of the library in {store.folder}, got "
                f"{listed(here.heads)}; choose the columns, in the shell with --columns (--feature of kineme "
                "discover), or make another library"
            )
        if len(here.heads) == len(there.heads) and are_unknown(demos.channels):  # as without channels
            return of_columns(demos, ours)
    return Demonstrations.of_movements(in_coordinates(demos.movements), demos.steps)


def check_channels(store: Store, demos: Demonstrations) -> None:
    """Refuse another number of dimensions, or channels of other kinds, than the library holds."""
    n_dims = store.n_dims
    if n_dims is not None and n_dims != demos.n_dims:
        raise TrajectoryError(
            f"expected movements of {n_dims} dimensions as {_others(store)} of the library in {store.folder}, "
            f"got {demos.n_dims}; choose the columns, in the shell with --columns (--feature of kineme "
            "discover), or make another library"
        )
    store.specification.comparison.procrustes(demos.n_dims)  # refuses columns that cannot be its points
    ours = store.channels
    if (
        n_dims is None
        or same_columns(ours, demos.channels)
        or all(is_plain(channels or ()) for channels in (ours, demos.channels))
    ):
        return
    raise TrajectoryError(
        f"expected movements recorded as {in_words(ours)}, as {_others(store)} of the library in {store.folder}, got "
        f"{in_words(demos.channels)}; choose the columns and say their kinds, in the shell with --columns and --kind, "
        "or make another library"
    )


def _others(store: Store) -> str:
    """Return the movements that new ones must be like; a library that is empty now keeps its earlier versions."""
    return "all others" if store.counts.movements else "those of earlier versions, which can be restored,"


def as_names(demos: Demonstrations, what: str, given: Any) -> list[str | None]:
    """Return the name of each movement's symbol, from its "label", or of who showed it, its "group"; None without."""
    if given is None:
        return [None] * len(demos)
    values = _one_each(what, given, len(demos))
    remedy = f"name {'the action' if what == 'label' else 'who showed it'}, or pass None where it has no name"
    names: dict[Any, str | None] = {None: None}
    check = check_symbol if what == "label" else check_name
    for i, name in enumerate(values):
        if isinstance(name, (list, tuple, dict, np.ndarray)) or (isinstance(name, float) and math.isnan(name)):
            raise TrajectoryError(
                f"{name_of(i, demos.names)}: expected a {what} that is text or a number, got {name!r}; {remedy}"
            )
        try:
            names[name] = names[name] if name in names else check(as_name(name))
        except SpecificationError as error:
            raise SpecificationError(f"{name_of(i, demos.names)}: {error}; {remedy}") from None
    return [names[name] for name in values]


def _one_each(what: str, given: Any, n: int) -> list[Any]:
    """Return a user's list with one item per movement; a single text is refused."""
    try:
        size = -1 if isinstance(given, (str, bytes)) else len(given)
    except TypeError:
        size = -1
    if size != n:
        got = size if size >= 0 else repr(given)
        raise TrajectoryError(f"expected one {what} for each of the {n} movements, got {got}")
    return given.tolist() if isinstance(given, np.ndarray) else list(given)


def _as_origins(
    source: Source | Sequence[Source | None] | None, places: Sequence[Any] | None, n: int
) -> tuple[list[Source | None], list[str | None]]:
    """Return the source of each movement and its position there, at which no other movement may be."""
    sources: list[Source | None] = (
        [source] * n if source is None or isinstance(source, Source) else _one_each("source, or one", source, n)
    )
    for item in sources:
        if item is not None and not isinstance(item, Source):
            raise TrajectoryError(f"expected sources to be kineme.library.storage.source.Source or None, got {item!r}")
    where = [None] * n if places is None else _one_each("place", places, n)
    first_at: dict[tuple[int, str], int] = {}
    for i, (place, origin) in enumerate(zip(where, sources, strict=True)):
        if origin is not None and place is not None and first_at.setdefault((id(origin), str(place)), i) != i:
            raise TrajectoryError(
                f"expected a place of its own in {origin.path!r} for each movement, got {place!r} for movements "
                f"{first_at[id(origin), str(place)]} and {i}; name them apart"
            )
    return sources, [None if place is None else str(place) for place in where]


def digests(demos: Demonstrations, even: NDArray[np.bool_]) -> list[int]:
    """Compute BLAKE2b of what will be read of each movement, but its name, as 64-bit numbers.

    So a movement that is read and learned again has the same one. Two of a million others share one at p = 3e-8.
    """
    starts = np.repeat(demos.positions[demos.offsets[:-1]], demos.lengths, axis=0)
    positions = starts + (demos.positions - starts).astype(np.float32)
    times = None
    if not even.all():
        times, offsets = commit.relative_times(demos), demos.offsets.tolist()
        for i in np.flatnonzero(~even).tolist():  # as `read.movements` gives them
            a, b = offsets[i : i + 2]
            stored = commit.stored_times(times[a:b])
            read = np.frombuffer(stored, np.float32 if len(stored) == 4 * (b - a) else np.float64)
            times[a:b] = (demos.times[a] + read) - demos.times[a]
    mantissas, exponents = np.frexp(demos.durations)  # even stamps say the duration but for rounding
    lasting = np.ldexp(np.rint(mantissas * 2.0**_BITS), exponents).tobytes()
    others = _other_columns(demos)
    blob, row = np.ascontiguousarray(positions).data.cast("B"), 8 * positions.shape[1]
    stamps = None if times is None else times.data.cast("B")
    parts = []
    for i, (a, b) in enumerate(pairwise(demos.offsets.tolist())):
        digest = hashlib.blake2b(blob[a * row : b * row], digest_size=8)
        digest.update(lasting[8 * i : 8 * i + 8] if stamps is None or even[i] else stamps[8 * a : 8 * b])
        if others is not None:
            digest.update(others[i])
        parts.append(digest.digest())
    return np.frombuffer(b"".join(parts), np.int64).tolist()


def _other_columns(demos: Demonstrations) -> list[bytes] | None:
    """Return what the positions of each movement do not say: steps of discrete columns, and the turn at its start.

    A quaternion that is read has norm 1 again, and so other last digits than were stored: they are left out.
    """
    recorded, channels = demos.movements.recorded, demos.channels or ()
    if recorded is None:
        return None
    steps = recorded[:, columns_of_kinds(channels, "discrete")].astype(np.float32)
    turned = recorded[demos.offsets[:-1]][:, columns_of_kinds(channels, "orientation")].round(_DECIMALS) + 0.0
    return [
        start.tobytes() + steps[a:b].tobytes() for start, (a, b) in zip(turned, pairwise(demos.offsets), strict=True)
    ]


def source_at(options: Mapping[str, Any], root: str | PurePath = "") -> Callable[[str, str, int], Source]:
    """Return a function from name, checksum and bytes of a file in a folder to its source, as it is read now."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    chosen = {name: value for name, value in options.items() if value is not None}

    def source(name: str, sha256: str, size: int) -> Source:
        path = PurePath(root) / name
        return Source(path.as_posix(), sha256, size, path.suffix.lower().lstrip("."), chosen, now)

    return source


def learn_recordings(  # noqa: PLR0913, PLR0917 - those of `ActionLibrary.learn`
    store: Store,
    recordings: Recordings,
    options: Mapping[str, Any] | None = None,
    labels: Sequence[str | None] | None = None,
    progress: Progress | None = None,
    root: str | PurePath = "",
    groups: Sequence[str | None] | None = None,
) -> LearnReport:
    """Store recordings that were read with these options, as `ActionLibrary.learn`: with others it is another source.

    `root` is the folder that was read, stored before the names of files. Labels are by default those of the movements.
    """
    sources, places = _origins_of(recordings, options, root)
    labels = list(recordings.labels) if labels is None else labels
    return learn(store, recordings.demonstrations, labels, sources, places, progress, groups)


def stored_ids(
    store: Store, recordings: Recordings, options: Mapping[str, Any] | None = None, root: str | PurePath = ""
) -> NDArray[np.int64]:
    """Return the ids (n,) of recordings in the library, below 0 of those that `learn_recordings` would add."""
    _, described = _described(store, recordings.demonstrations, None, *_origins_of(recordings, options, root), None)
    return np.concatenate([np.array(commit.stored_ids(store, batch), dtype=np.int64) for batch in described])


def _origins_of(
    recordings: Recordings, options: Mapping[str, Any] | None, root: str | PurePath
) -> tuple[list[Source], list[str]]:
    of_file = source_at(options or {}, root)
    files = {file.path: of_file(file.path, file.sha256, file.size) for file in recordings.sources}
    return [files[file.path] for file in recordings.sources], [file.place for file in recordings.sources]

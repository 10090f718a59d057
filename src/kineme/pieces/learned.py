"""The parts of `kineme learn` in a library: in its columns, in the order of the archive, each movement once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError, TrajectoryError
from kineme.io.reading.formats import root_of
from kineme.io.reading.recordings import check_asked, how_to_read
from kineme.library.commit import Batch, Committed, check, evenly_sampled
from kineme.library.learn import as_names, batches, check_channels, commit_batches, digests, in_columns_of, source_at
from kineme.library.storage.store import Store
from kineme.movements.channels.channel import Channel, Channels, is_plain, recorded_names, same_columns
from kineme.movements.channels.column_match import columns_like, columns_recorded
from kineme.movements.trajectories.as_learned import by_names
from kineme.pieces.archive import address_of, is_remote, path_at
from kineme.pieces.described import check_rows, checksum_of, heads_of_text, movements_of_rows, rows_by_table
from kineme.pieces.gather import Asked

Tables = Callable[..., Iterable[Any]]  # columns, by default all -> the rows of part after part

_ROWS = 8192  # that are committed together, about


class Heads(NamedTuple):
    """The columns of a file."""

    n_dims: int
    channels: Channels | None
    aside: tuple[str, ...]  # columns that were left aside
    sensors: frozenset[str]  # that the name of the file names

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.n_dims if self.channels is None else len(recorded_names(self.channels))

    @property
    def names(self) -> frozenset[str]:
        """Names of the columns without their units; none where they have no names."""
        columns = columns_recorded(self.channels or ())
        return frozenset() if columns.are_nameless else frozenset(columns.names)

    def unlike(self, most: Heads, by_number: bool) -> str | None:
        """Say what keeps a file from being read with those of these columns; None if nothing does."""
        if self.width != most.width:
            return f"{self.width} dimensions where most have {most.width}"
        if self.sensors != most.sensors and not by_number:
            return "the file of another sensor by its name than most files; read them apart"
        if self.names == most.names and self.channels is not None and most.channels is not None:
            try:  # their units may be those of other quantities
                columns_like(np.ones((1, self.width)), columns_recorded(self.channels), columns_recorded(most.channels))
            except TrajectoryError as error:
                return str(error)
            return None
        if self.names == most.names or ((by_number or not self.names) and is_plain(most.channels or ())):
            return None
        here, there = (", ".join(recorded_names(heads.channels or ())) for heads in (self, most))
        return f"{f'the columns {here}' if self.names else 'no names of columns'} where most files have {there}"


@dataclass(frozen=True)
class Survey:
    """All parts together, by what their rows say of files."""

    heads: Mapping[str, Heads]  # text of the columns of files -> what it says
    unlike: Mapping[str, str | None]  # the same texts -> what keeps files from being learned, or None
    most: Heads  # the columns of most movements, in which all are learned
    learned: Channels | None  # the channels of these; None if files have columns without names
    sources: Mapping[str, tuple[str, int]]  # name of a data set -> checksum and bytes; those of files are in their rows
    rows: int  # movements
    people: Sequence[str]  # who showed them
    notes: tuple[str, ...]  # what a person should know of the columns

    def is_described(self, heads: Heads) -> bool:
        """Tell whether a file is described in the columns that are learned."""
        plain = self.learned is None and is_plain(heads.channels or ())
        return heads.n_dims == self.most.n_dims and (plain or same_columns(heads.channels, self.learned))


def survey(tables: Tables, asked: Asked, problems: Sequence[str] = ()) -> Survey:
    """Read what parts say of files. Raises `DataError`: an option names a column that no file has, or nobody."""
    counts: Counter[str] = Counter()
    paths: Counter[str] = Counter()
    files: dict[str, list[str]] = {}
    people: set[str] = set()
    for rows in tables(["heads", "files", "path", "person"]):
        _count(rows, counts, paths)
        people.update(rows.column("person").drop_null().unique().to_pylist())
        for row in rows.select(["path", "files"]).drop_null().to_pylist():
            files.setdefault(row["path"], []).append(row["files"])
    if not counts:
        first = f"; the first problem: {problems[0]}" if problems else ""
        raise DataError(f"expected movements in the parts, got none{first}")
    layout = how_to_read(asked.options["reading"]).layout
    heads, most, reasons, notes = _compared(counts, paths, layout.by_number)
    where = ", ".join(asked.archives)
    of_files = [(each.aside, recorded_names(each.channels or ())) for each in heads.values()]
    check_asked(layout, of_files, bool(people), where)
    if asked.options.get("by_person") and not people:
        raise DataError(
            f"expected {where} to say who showed its movements, by folders person/label/recording or an array people "
            "in an archive, got neither; name them with --person"
        )
    others = any(each.names != most.names and reasons[text] is None for text, each in heads.items())
    sources = {path: checksum_of(several) for path, several in files.items()}
    return Survey(
        heads, reasons, most, None if others else most.channels, sources, counts.total(), sorted(people), notes
    )


def _count(rows: Any, counts: Counter[str], paths: Counter[str]) -> None:
    """Add the movements and the files of rows to those of their columns."""
    for group in rows.group_by(["heads", "path"], use_threads=False).aggregate([([], "count_all")]).to_pylist():
        counts[group["heads"]] += group["count_all"]
        paths[group["heads"]] += 1


def _compared(
    counts: Counter[str], paths: Counter[str], by_number: bool
) -> tuple[dict[str, Heads], Heads, dict[str, str | None], tuple[str, ...]]:
    """Return what texts of columns say, the columns of most, what keeps files from being read with these, and notes."""
    heads = {text: Heads(*heads_of_text(text)) for text in counts}
    most, notes = _most([(heads[text], n, paths[text]) for text, n in counts.items()])
    return heads, most, {text: each.unlike(most, by_number) for text, each in heads.items()}, notes


def inspected_alike(tables: Tables, asked: Asked, problems: list[str]) -> tuple[Any, str]:
    """Return the rows of an inspection of files in the columns of most, and these; others are added to the problems."""
    import pyarrow as pa
    from pyarrow import compute

    counts, paths = Counter[str](), Counter[str]()
    for part in tables(["heads", "path"]):
        _count(part, counts, paths)
    if not counts:
        return None, ""
    heads, most, reasons, _ = _compared(counts, paths, how_to_read(asked.options["reading"]).layout.by_number)
    units = sorted(map(str, columns_recorded(most.channels or ()).units))
    for text, each in heads.items():
        if reasons[text] is None and sorted(map(str, columns_recorded(each.channels or ()).units)) != units:
            reasons[text] = "other units than most files have; inspect it apart"
    unlike = pa.array([text for text, reason in reasons.items() if reason is not None], pa.string())
    parts, files = [], dict[str, str]()
    for part in tables():
        is_unlike = compute.is_in(part.column("heads"), unlike)
        names = part.filter(is_unlike).select(["path", "heads"]).to_pydict()
        files |= zip(names["path"], names["heads"], strict=True)
        parts.append(part.filter(compute.invert(is_unlike)).drop_columns(["heads", "path", "place"]))
    problems += [f"{path}: {reasons[text]}" for path, text in files.items()]
    columns = ", ".join(recorded_names(most.channels or ())) or f"{most.width} columns"
    return pa.concat_tables(parts, promote_options="permissive"), columns


def _most(counts: list[tuple[Heads, int, int]]) -> tuple[Heads, tuple[str, ...]]:
    """Return the columns of most, from how many movements and files have each, and notes on kinds that differ.

    By the dimensions of most movements, then the names of most files, as recordings of one set. A column that moves in
    some files is not discrete; other kinds are those of most.
    """

    def frequent(of: Callable[[Heads], Any], among: Sequence[tuple[Heads, int, int]], by_files: bool = True) -> Any:
        totals: Counter[Any] = Counter()
        for heads, n_movements, n_files in among:
            totals[of(heads)] += n_files if by_files else n_movements
        return totals.most_common(1)[0][0]

    width = frequent(lambda heads: heads.width, counts, by_files=False)
    alike = [each for each in counts if each[0].width == width]
    named = [each for each in alike if each[0].names] or alike
    names, sensors = frequent(lambda heads: (heads.names, heads.sensors), named)
    same = [each for each in alike if (each[0].names, each[0].sensors) == (names, sensors)]
    base = frequent(lambda heads: heads.channels, same)
    if base is None:
        return Heads(width, None, (), sensors), ()
    kinds: dict[str, Counter[str]] = {}
    periods: dict[str, set[float]] = {}
    for heads, _, n in same:
        for channel in heads.channels or ():
            if channel.kind != "orientation":
                (name,) = columns_recorded((channel,)).names
                kinds.setdefault(name, Counter())[channel.kind] += n
                periods.setdefault(name, set()).add(np.inf if channel.period == 0 else channel.period or 0.0)
    notes = []

    def merged(channel: Channel) -> Channel:
        (name, *others) = columns_recorded((channel,)).names
        if others:
            return channel
        moving = [kind for kind, _ in kinds[name].most_common() if kind != "discrete"]
        kind = moving[0] if moving else "discrete"
        if len(kinds[name]) > 1:
            notes.append(
                f"{channel.name} is {' or '.join(sorted(kinds[name]))} by pieces, and read as {kind}; say --kind"
            )
        period = max(periods[name])
        known = channel._replace(kind=kind)
        return known if channel.period is None else known._replace(period=0.0 if period == np.inf else period)

    channels = tuple(map(merged, base))
    return Heads(sum(len(channel.coordinates) for channel in channels), channels, (), sensors), tuple(notes)


def learned(
    store: Store, tables: Tables, asked: Asked, of: Survey, problems: list[str]
) -> Iterator[tuple[list[str | None], Committed]]:
    """Store the movements of all parts, and yield the labels of each batch with what came of it.

    What is not in the columns of the library is described again. Files that do not fit are added to the problems.
    """
    store.check_writable()
    if store.specification.to_json() != asked.options["specification"]:
        raise DataError(
            f"expected the library in {store.folder} to describe movements as its parts do, got another specification; "
            "run kineme learn once more with --force"
        )
    labels: list[list[str | None]] = []

    def described() -> Iterator[Batch]:
        unlike: set[str] = set()
        source_of = _sources(asked, of)
        is_ours = store.n_dims is None or (
            store.n_dims == of.most.n_dims
            and (same_columns(store.channels, of.learned) or (store.channels is None and is_plain(of.learned or ())))
        )
        for rows in _blocks(tables, of):
            text = rows.column("heads")[0].as_py()
            if (reason := of.unlike[text]) is not None:
                for path in rows.column("path").unique().to_pylist():
                    if path not in unlike:
                        problems.append(f"{path}: {reason}")
                        unlike.add(path)
                continue
            batch = _batch(store, rows, of.heads[text], of, is_ours)
            origins = list(zip(*(_texts(rows, name) for name in ("path", "sha256", "size")), strict=True))
            sources = {origin: source_of(*origin) for origin in dict.fromkeys(origins)}
            batch.sources = [sources[origin] for origin in origins]
            labels.append(batch.labels)
            yield batch

    for committed in commit_batches(store, described()):
        yield labels.pop(0), committed


def _texts(rows: Any, name: str) -> list[Any]:
    return list(rows.column(name).to_pylist())


def _batch(store: Store, rows: Any, heads: Heads, of: Survey, is_ours: bool) -> Batch:
    """Return movements to be stored, without their sources: as they are described, or in the columns of the library."""
    is_same = of.is_described(heads)
    own = of.learned if is_same else heads.channels
    check_rows(rows, store.specification, heads.n_dims, own)
    demos = movements_of_rows(rows, heads.n_dims, own)
    if not is_same:
        demos = by_names(demos, of.most.channels or ())
        demos = demos.of_movements(replace(demos.movements, channels=of.learned))
    if not is_ours:
        demos = in_columns_of(store, demos)
    check_channels(store, demos)
    labels, people = as_names(demos, "label", _texts(rows, "label")), as_names(demos, "group", _texts(rows, "person"))
    if is_same and is_ours:
        return Batch(demos, _texts(rows, "digest"), labels, people, [], _texts(rows, "place"), rows_by_table(rows))
    check(demos)
    return Batch(demos, digests(demos, evenly_sampled(demos)), labels, people, [], _texts(rows, "place"))


def _sources(asked: Asked, of: Survey) -> Callable[[str, str, int], Any]:
    """Return a function from name, checksum and bytes of a file to its source, as `learn_recordings` says it."""
    first = asked.archives[0]
    several = len(asked.archives) > 1
    root = Path() if several or is_remote(first) else root_of(path_at(first))
    of_file = source_at(asked.options["reading"], root)

    def source(name: str, sha256: str, size: int) -> Any:
        own = of_file(name, *of.sources.get(name, (sha256, size)))
        return replace(own, path=address_of(first, name)) if is_remote(first) and not several else own

    return source


def _blocks(tables: Tables, of: Survey) -> Iterator[Any]:
    """Yield rows of all parts in their order, some thousand at a time, all of the same columns."""
    import pyarrow as pa

    held: list[Any] = []
    n = 0
    for rows in tables():
        held.append(rows.replace_schema_metadata(None))
        n += rows.num_rows
        if n >= _ROWS:
            yield from _cut(pa.concat_tables(held), of)
            held, n = [], 0
    if held:
        yield from _cut(pa.concat_tables(held), of)


def _cut(rows: Any, of: Survey) -> Iterator[Any]:
    texts = rows.column("heads").combine_chunks().dictionary_encode()
    heads = [of.heads[text] for text in texts.dictionary.to_pylist()]
    alike_in = [
        (of.unlike[text], None if of.is_described(each) else each.channels)
        for text, each in zip(texts.dictionary.to_pylist(), heads, strict=True)
    ]
    codes = np.array([alike_in.index(each) for each in alike_in])[texts.indices.to_numpy()]
    ends = [*(np.flatnonzero(np.diff(codes)) + 1).tolist(), len(codes)]
    for first, stop in zip([0, *ends[:-1]], ends, strict=True):
        alike = rows.slice(first, stop - first)
        for part in batches(alike.column("samples").to_numpy()):
            yield alike.slice(part.start, part.stop - part.start)

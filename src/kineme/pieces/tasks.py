"""Commands over pieces: the table of what each writes for a piece, and the rows of its parts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from kineme.audit.run import Measurement, measure_episode
from kineme.errors import DataError, KinemeError
from kineme.io.arrays.robot_sets import HDF5, ZARR, free_number, in_order, robot_episodes
from kineme.io.inspection.inspect import Measures, measures_of
from kineme.io.reading.episodes import read_episodes
from kineme.io.records import Problem
from kineme.io.writing.annotations import Annotation
from kineme.library.annotate import annotate_by
from kineme.library.library import ActionLibrary
from kineme.library.recognize import some_of_each_symbol
from kineme.library.storage.source import known_sources
from kineme.movements.episodes import Episode
from kineme.movements.tables.layout import Known
from kineme.pieces.archive import local_copy
from kineme.pieces.described import described, heads_of
from kineme.pieces.run import Job, Source, recordings_of
from kineme.pieces.shards import Reduction, read_reduction
from kineme.recognition.answer import KnownClasses

Options = Mapping[str, Any]


class Learned(NamedTuple):
    """What a process knows of a library, prepared once for all pieces."""

    classes: KnownClasses
    known: Known


@lru_cache(maxsize=1)
def learned_at(folder: str, version: int, at: str) -> Learned:
    """Return the symbols of a library as they were at a version, made at that time, whatever is learned meanwhile."""
    with ActionLibrary(folder, read_only=True) as library, library.at(version) as past:
        if any(last.at != at for last in past.history()[-1:]):
            raise DataError(
                f"expected version {version} of {folder} that was made at {at}, got another one, as of a backup that "
                "was put back; run the command again"
            )
        return Learned(some_of_each_symbol(past.store), known_sources(past.store))


def annotated(source: Source, options: Options) -> Iterator[Any]:
    """Yield a row for each stretch of motion, as `kineme annotate` finds it."""
    import pyarrow as pa

    learned = learned_at(options["library"], *options["library_version"])
    for recordings in recordings_of(source, options["reading"], learned.known):
        try:
            report = annotate_by(learned.classes, recordings, options["error_rate"])
        except KinemeError as error:  # other columns than learned, as one file among many has them
            source.problems.append(Problem(recordings.sources[0].path, None, str(error)))
            continue
        source.problems.extend(report.problems)
        wanted = options.get("symbols")
        rows = [note for note in report.annotations if wanted is None or note.symbol in wanted]
        if rows:
            yield pa.Table.from_pylist([vars(note) for note in rows], annotation_schema())


def annotation_schema() -> Any:
    """Return the columns of annotations."""
    import pyarrow as pa

    kinds = {"str": pa.string(), "float": pa.float64(), "str | None": pa.string()}
    return pa.schema([(name, kinds[str(kind)]) for name, kind in Annotation.__annotations__.items()])


def measurements(source: Source, options: Options) -> Iterator[Any]:
    """Yield a row for each episode with what an audit compares; a file that cannot be read is one with a problem."""
    import pyarrow as pa

    schema = measurement_schema()
    for unit in source.piece.units:
        if not unit.marker and ("/" in unit.name or PurePosixPath(unit.name).suffix.lower() not in (*HDF5, *ZARR)):
            continue
        try:
            with local_copy(unit) as folder:
                path = folder / unit.name
                read = partial(read_episodes, numbers=source.piece.numbers) if unit.marker else robot_episodes
                for episode in read(path, rate=options.get("rate")):
                    row = measure_episode(episode)
                    source.counts["recordings"] += episode.number >= 0
                    source.counts["seconds"] += row.seconds
                    yield pa.Table.from_pylist([{"file": unit.shown, **row._asdict()}], schema)
        except DataError as error:
            if unit.marker:
                source.problems.append(Problem(unit.shown, None, str(error)))
            else:
                unread = measure_episode(Episode(0, np.empty(0), {}, {}, problems=(str(error),), place=unit.shown))
                yield pa.Table.from_pylist([{"file": unit.shown, **unread._asdict()}], schema)


def measurement_schema() -> Any:
    """Return the columns of measurements of episodes."""
    import pyarrow as pa

    kinds = {
        "number": pa.int64(), "seconds": pa.float64(), "fps": pa.float64(), "sizes": pa.list_(pa.int32()),
        "values": pa.list_(pa.float32()), "drawn": pa.list_(pa.float32()), "problems": pa.list_(pa.string()),
        "notes": pa.list_(pa.string()), "names": pa.list_(pa.string()),
    }  # fmt: skip
    return pa.schema([(name, kinds.get(name, pa.string())) for name in ("file", *Measurement._fields)])


def measured(table: Any) -> Iterator[tuple[str, Measurement]]:
    """Yield the file of each row of a table, and its measurement."""
    for row in table.to_pylist():
        file = row.pop("file")
        texts = {name: tuple(row[name]) for name in ("problems", "notes", "names", "sizes")}
        arrays = {name: np.array(row[name], dtype=np.float32) for name in ("values", "drawn")}
        yield file, Measurement(**(row | texts | arrays))


def numbered(rows: Iterable[tuple[str, Measurement]]) -> Iterator[Measurement]:
    """Yield episodes with the numbers and places that `read_episodes` gives them, in its order, sorted in memory."""
    rows = iter(rows)
    first = next(rows, None)
    if first is None or not first[0].lower().endswith(HDF5):
        yield from (episode for _, episode in chain([] if first is None else [first], rows))
        return
    ordered = sorted([first, *rows], key=lambda row: in_order(PurePosixPath(row[0]).stem))
    several = len({file for file, _ in ordered}) > 1
    taken, number = set[int](), 0
    for file, episode in ordered:
        alone = episode.place == file  # in its file
        number = free_number(episode.number if (alone and episode.seconds) or not several else number, taken)
        place = episode.place if alone or not several else f"{file}/{episode.place}"
        yield episode._replace(number=number, place=place)
        number += 1


def inspections(source: Source, options: Options) -> Iterator[Any]:
    """Yield a row for each movement: its label, length, sampling rate, gaps and extent."""
    import pyarrow as pa

    for recordings in recordings_of(source, options["reading"]):
        measures = measures_of(recordings)._asdict()
        columns = {name: pa.array(values.tolist() if name == "labels" else values) for name, values in measures.items()}
        columns["labels"] = columns["labels"].cast(pa.string())
        heads, sources = heads_of(recordings), recordings.sources
        yield pa.table({
            "path": [each.path for each in sources], "place": [each.place for each in sources],
            **columns, "heads": [heads[each.path] for each in sources],
        })  # fmt: skip


def inspected(table: Any) -> Measures:
    """Return the measures in the rows of a table."""
    columns = {name: table.column(name).to_numpy(zero_copy_only=False) for name in Measures._fields}
    return Measures(**(columns | {"labels": columns["labels"].astype(object)}))


@lru_cache(maxsize=1)
def reduction_at(folder: str, library: str) -> tuple[Reduction, Known]:
    """Return what all shards of a folder have in common, and the columns of the library that they are made for."""
    with ActionLibrary(library, read_only=True) as opened:
        return read_reduction(Path(folder)), known_sources(opened.store)


def features(source: Source, options: Options) -> Iterator[Any]:
    """Yield a row for each movement: its features as the library compares them, for `pieces.search`."""
    reduction, known = reduction_at(options["shards"], options["library"])
    for recordings in recordings_of(source, options["reading"], known):
        try:
            yield reduction.table(recordings)
        except KinemeError as error:  # other columns than learned
            source.problems.append(Problem(recordings.sources[0].path, None, str(error)))


class Task(NamedTuple):
    """A command over pieces."""

    work: Callable[[Source, Options], Iterable[Any]]  # source, all options -> tables
    takes: frozenset[str]  # options, besides those of reading
    ending: str = ".parquet"
    schema: Callable[[], Any] | None = None  # of its rows, where other ones are refused before they are gathered


#: Name -> command over pieces.
TASKS: dict[str, Task] = {
    "annotate": Task(annotated, frozenset({"error_rate"}), schema=annotation_schema),
    "find": Task(annotated, frozenset({"error_rate", "symbols"}), schema=annotation_schema),
    "audit": Task(measurements, frozenset({"rate", "error_rate"}), schema=measurement_schema),
    "inspect": Task(inspections, frozenset()),
    "features": Task(features, frozenset({"shards", "bases"}), ending=".arrow"),
    "learn": Task(described, frozenset({"label", "no_labels", "person", "by_person", "several", "specification"})),
}


PLACES = ("library", "shards")  # options that say where something is, which makes no difference to parts


def job_of(task: str, output: str, options: Options) -> Job:
    """Return the job of a task with its options, which are plain data."""
    if task not in TASKS:
        raise DataError(
            f"expected a command over pieces ({', '.join(TASKS)}), got {task!r:.40}; a later kineme may know it"
        )
    row = TASKS[task]
    if unknown := sorted(set(options) - row.takes - {"reading", "library", "library_id", "library_version"}):
        raise DataError(f"expected options of {task} ({', '.join(sorted(row.takes)) or 'none'}), got {unknown[0]!r}")
    said = {name: value for name, value in options.items() if name not in PLACES}
    return Job(task, partial(_work, task, dict(options)), output, said, row.ending)


def _work(task: str, options: Options, source: Source) -> Iterable[Any]:
    """Call the work of a task, found by name where a process begins anew."""
    return TASKS[task].work(source, options)


def plain(options: Options) -> dict[str, Any]:
    """Return options of reading as JSON holds them, without those that are not given."""
    given = {name: value for name, value in sorted(options.items()) if value is not None}
    return dict(json.loads(json.dumps(given)))

"""Recordings of a piece, described as a library stores them, so that gathering them is writing alone.

A part has one row for each movement: where it comes from, what is said of it, and its rows of the tables of a library.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.reading.column_order import sensors_of
from kineme.io.reading.formats import Entry, as_text
from kineme.io.reading.merge_files import Recordings, each_person
from kineme.io.reading.pieces import read_entry
from kineme.io.reading.recordings import HowToRead, how_to_read, read_entries
from kineme.io.records import Problem
from kineme.library.commit import Tables, check, evenly_sampled, serialize
from kineme.library.learn import as_names, batches, digests
from kineme.library.storage.channels import channels_of_text, channels_to_text, other_columns, with_channels
from kineme.library.storage.read import times_of
from kineme.library.storage.specification import Specification
from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.pieces.archive import local_copy
from kineme.pieces.planning import Piece
from kineme.pieces.run import Source, noted

#: Table of a library -> the columns of a part that are its columns, without the key.
BLOBS = {
    "raw": ("start", "positions", "times"),
    "primitive": ("boundary", "weights"),
    "feature": ("features",),
    "recorded": ("recorded",),
}

Options = Mapping[str, Any]


def described(source: Source, options: Options) -> Iterator[Any]:
    """Yield rows of the movements of a piece, described by the specification of a library."""
    specification = Specification.from_json(options["specification"], Path(options["library"]))
    for recordings, people, files in _recordings(source, options):
        demos = recordings.demonstrations
        check(demos)
        label = options.get("label")
        labels = [None if options.get("no_labels") else own if label is None else label for own in recordings.labels]
        said = as_names(demos, "label", labels), as_names(demos, "group", people)
        heads = heads_of(recordings)
        for rows in batches(demos.lengths * demos.n_dims):  # numbers, which memory holds
            part = Demonstrations.of_movements(demos.movements.between(rows.start, rows.stop))
            origins = recordings.sources[rows]
            even = evenly_sampled(part)
            yield _table({
                "path": [each.path for each in origins], "place": [each.place for each in origins],
                "sha256": [each.sha256 for each in origins], "size": [each.size for each in origins],
                "files": [files, *[None] * (len(part) - 1)], "heads": [heads[each.path] for each in origins],
                "name": part.names, "label": said[0][rows], "person": said[1][rows],
                "digest": digests(part, even), "samples": part.lengths, "duration": part.durations,
                "t0": np.zeros(len(part)) if part.movements.times is None else part.times[part.offsets[:-1]],
            }, serialize(part, even, specification))  # fmt: skip


def _table(columns: Mapping[str, Any], tables: Tables) -> Any:
    import pyarrow as pa

    kinds = {"size": pa.int64(), "digest": pa.int64(), "samples": pa.int64(), "duration": pa.float64()}
    arrays = {name: pa.array(values, kinds.get(name, pa.string())) for name, values in columns.items() if name != "t0"}
    arrays["t0"] = pa.array(columns["t0"], pa.float64())
    for table, names in BLOBS.items():
        blobs = zip(*tables[table], strict=True) if table in tables else [[None] * len(columns["t0"])]
        arrays |= {name: pa.array(values, pa.binary()) for name, values in zip(names, blobs, strict=True)}
    return pa.table(arrays)


def _recordings(
    source: Source, options: Options
) -> Iterator[tuple[Recordings, Sequence[str | None] | None, str | None]]:
    """Yield the recordings of a piece with who showed them, and of a data set the checksums of its files."""
    how = how_to_read(options["reading"])
    with ExitStack() as copies:
        folders = [copies.enter_context(local_copy(unit)) for unit in source.piece.units]
        entries = [
            Entry(folder / unit.name, Path(unit.name), unit.shown)
            for folder, unit in zip(folders, source.piece.units, strict=True)
        ]
        files = None if source.piece.numbers is None else _checksums(source.piece, folders[0])
        for recordings in noted(source, _read(entries, how, source.piece.numbers)):
            people = recordings.people
            if options.get("person") is not None:
                if people is not None:
                    raise DataError("expected --person, or people that the recordings name, got both")
                people = [options["person"]] * len(recordings)
            elif options.get("by_person"):
                people = each_person(Path() if options.get("several") else folders[0], recordings.sources)
            yield recordings, people, files


def _read(entries: Sequence[Entry], how: HowToRead, numbers: range | None) -> Iterator[Recordings | Problem]:
    """Yield files as one set of recordings; one by one, if one that is unlike the others can be read alone."""
    if numbers is not None:
        yield from read_entry(entries[0], how, numbers)
        return
    together = _set_of(entries, how)
    there = {source.path for source in together.sources} if isinstance(together, Recordings) else set[str]()
    alone = [_set_of([entry], how) for entry in entries if entry.name not in there]
    if not any(isinstance(each, Recordings) for each in alone):
        yield from alone if isinstance(together, Problem) else [together]
    elif there:
        yield from (_set_of([entry], how) for entry in entries)
    else:
        yield from alone


def _set_of(entries: Sequence[Entry], how: HowToRead) -> Recordings | Problem:
    try:
        return read_entries(entries, how._replace(join=False))
    except (KinemeError, OSError) as error:
        name = entries[0].name
        return Problem(name, None, str(error).removeprefix(f"{entries[0].path}: ").removeprefix(f"{name}: "))


def heads_of(recordings: Recordings) -> dict[str, str]:
    """Return name of a file -> the columns that it is read in, as a text that is the same for files alike."""
    channels = recordings.demonstrations.channels
    columns = {
        "n_dims": recordings.demonstrations.n_dims,
        "channels": None if channels is None else channels_to_text(channels),
        "aside": sorted({name for how, _ in recordings.detected for name in how.ignored}),
    }
    paths = dict.fromkeys(source.path for source in recordings.sources)
    return {path: json.dumps(columns | {"sensors": sorted(sensors_of(path))}) for path in paths}


def _checksums(piece: Piece, folder: Path) -> str:
    """Return name -> [SHA-256, bytes] of the files that begin in a piece, as JSON; a file alone is named "."."""
    checksums, unit = {}, piece.units[0]
    for file in unit.files:
        if file.name != piece.begun:
            path = folder / unit.name / file.name if unit.is_archive else folder / file.name
            with path.open("rb") as opened:
                inside = path.relative_to(folder / unit.name).as_posix()
                checksums[as_text(inside)] = [hashlib.file_digest(opened, "sha256").hexdigest(), file.size]
    return json.dumps(checksums)


def heads_of_text(text: str) -> tuple[int, Channels | None, tuple[str, ...], frozenset[str]]:
    """Return what is said of the columns of a file: n_dims, channels, columns left aside, sensors in its name."""
    said = json.loads(text)
    channels = None if said["channels"] is None else channels_of_text(said["channels"], said["n_dims"], Path("a part"))
    return int(said["n_dims"]), channels, tuple(said["aside"]), frozenset(said["sensors"])


def checksum_of(texts: Iterable[str]) -> tuple[str, int]:
    """Return the checksum of a data set, or file, as a reader of all of it computes it, and its bytes."""
    files: dict[str, tuple[str, int]] = {}
    for text in texts:
        files.update(json.loads(text))
    if "." in files:
        return files["."]
    names = sorted(files, key=lambda name: PurePosixPath(name).parts)
    lines = "".join(f"{files[name][0]}  {name}\n" for name in names)
    return hashlib.sha256(lines.encode()).hexdigest(), sum(size for _, size in files.values())


def check_rows(rows: Any, specification: Specification, n_dims: int, channels: Channels | None) -> None:
    """Refuse rows of a part whose bytes are not as many as a library stores."""
    from pyarrow import compute

    n = rows.column("samples").to_numpy()
    expected: dict[str, Any] = {
        "start": 8 * n_dims, "positions": 4 * n_dims * n, "boundary": 8 * 4 * n_dims,
        "weights": 4 * n_dims * specification.dmp.n_basis, "features": 4 * sum(specification.widths(n_dims)),
    }  # fmt: skip
    if others := len(other_columns(channels or ())):
        expected["recorded"] = 4 * others * n
    lengths = {name: compute.binary_length(rows.column(name)).fill_null(-1).to_numpy() for name in expected}
    stamps = compute.binary_length(rows.column("times")).fill_null(0).to_numpy()
    fits = (stamps == 0) | (stamps == 4 * n) | (stamps == 8 * n)
    if not (fits.all() and all((lengths[name] == size).all() for name, size in expected.items())):
        raise DataError(
            "expected a part with rows as kineme learn writes them, got others; learn once more with --force"
        )


def rows_by_table(rows: Any) -> Tables:
    """Return the rows of the tables of a library, without their keys."""
    tables: Tables = {
        table: list(zip(*(rows.column(name).to_pylist() for name in names), strict=True))
        for table, names in BLOBS.items()
    }
    if rows.column("recorded").null_count:
        del tables["recorded"]
    return tables


def movements_of_rows(rows: Any, n_dims: int, channels: Channels | None) -> Demonstrations:
    """Return the movements of rows that have been checked, as a library returns what it stores."""
    lengths = rows.column("samples").to_numpy()
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    starts, relative = (
        np.frombuffer(b"".join(rows.column(name).to_pylist()), kind).reshape(-1, n_dims)
        for name, kind in (("start", np.float64), ("positions", np.float32))
    )
    positions = np.asarray(relative + np.repeat(starts, lengths, axis=0), dtype=np.float64)
    t0, durations = (rows.column(name).to_numpy() for name in ("t0", "duration"))
    stamps = {i: blob for i, blob in enumerate(rows.column("times").to_pylist()) if blob is not None}
    times = times_of(stamps, offsets, t0, durations) if stamps or t0.any() else None
    stored = Movements(positions, offsets, durations, times, None, tuple(rows.column("name").to_pylist()))
    if channels is not None:
        stored = with_channels(stored, channels, list(enumerate(rows.column("recorded").to_pylist())))
    return Demonstrations.of_movements(stored)

"""Shards: feature rows and reduced features of the movements of an archive, in files that are mapped into memory.

A shard is one uncompressed file of Arrow IPC, ``part-*.arrow``, with a row for each movement: where it comes from, its
feature rows, and their reduced features. What all shards of a folder have in common lies beside them in ``bases.npz``:
the bases of the reduced features, and the comparison with its widths and weights, fitted to the library once.
"""

from __future__ import annotations

import hashlib
import json
import mmap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, KinemeError
from kineme.io.reading.merge_files import Recordings
from kineme.io.records import needs
from kineme.library.calibration_cache import sample_comparison
from kineme.library.members import members_of
from kineme.library.storage import read
from kineme.library.storage.channels import channels_of_text, channels_to_text
from kineme.library.storage.specification import Specification
from kineme.library.storage.store import Store
from kineme.reporting.atomic import whole_file
from kineme.runtime.compiled import compiled_always
from kineme.sampling import evenly_spaced
from kineme.similarity.bounds import fit_bases, reduce_features
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import feature_rows
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from kineme.validation import Array

BASES, PATTERN = "bases.npz", "part-*.arrow"
TASK = "features"
BATCH = 65_536  # rows of a record batch
_SAMPLE = 2000  # movements that the bases are fitted to
_ABOUT, _BASES = b"kineme", b"kineme.bases"  # keys of the metadata of a shard
_SPOILED = (OSError, ValueError, LookupError, TypeError, EOFError, BadZipFile, AttributeError, OverflowError)


@dataclass(frozen=True, eq=False)
class Reduction:
    """What all shards of a folder have in common."""

    library: str  # id of that which it was fitted to
    specification: ComparisonSpecification  # of the feature rows of shards
    bases: tuple[Array, ...]  # of what is compared sample by sample, see `similarity.bounds.fit_bases`
    comparison: Comparison  # of those representations of the specification that have a weight

    @cached_property
    def digest(self) -> str:
        """The checksum of the bases, which every shard names."""
        return bases_digest(self.bases)

    def columns(self) -> list[slice]:
        """Return where in the reduced features of a movement those of each representation are, two norms last."""
        ends = np.cumsum([0, *(self.comparison.n_dims * basis.shape[1] + 2 for basis in self.bases)]).tolist()
        return [slice(first, last) for first, last in pairwise(ends)]

    def table(self, recordings: Recordings) -> Any:
        """Return the shard of recordings, whose columns become those of the library; see `shard_table`."""
        demos = self.comparison.checked(recordings, "recordings")
        return shard_table(self.specification, self.bases, replace(recordings, demonstrations=demos))


def bases_digest(bases: Sequence[Array]) -> str:
    """Return the SHA-256 of bases, in hexadecimal."""
    digest = hashlib.sha256(repr([basis.shape for basis in bases]).encode())
    for basis in bases:
        digest.update(np.ascontiguousarray(basis, dtype="<f8").tobytes())
    return digest.hexdigest()


def fit_reduction(store: Store) -> Reduction:
    """Fit bases to the movements of a library, and the comparison to those that show a symbol.

    Raises `SpecificationError`: a library in which no movement shows a symbol, so that widths are unknown.
    """
    comparison, how = sample_comparison(store, members := members_of(store)), store.specification.comparison
    sample = members.ids[evenly_spaced(len(members.ids), _SAMPLE)]
    bases = fit_bases(read.feature_blocks(store, sample, how.by_rows), store.n_dims or 0)
    return Reduction(store.id, how.with_points(store.channels), bases, comparison)


def write_reduction(folder: Path, reduction: Reduction) -> Path:
    """Write ``bases.npz`` into a folder; one that says the same stays as it is, another one is refused."""
    path, comparison = folder / BASES, reduction.comparison
    if path.exists():
        if read_reduction(folder).digest != reduction.digest:
            raise DataError(
                f"expected shards of one set of bases in {folder}, got {BASES} of another; take a new folder"
            )
        return path
    channels, mixing = comparison.channels, comparison.procrustes.mixing
    numbers = map(reduction.specification.representations.index, comparison.representations)
    about = {
        "library": reduction.library,
        "n_dims": comparison.n_dims,
        "selected": list(numbers),
        "channels": None if channels is None else channels_to_text(channels),
        **Specification(reduction.specification).to_json(),
    }
    arrays: dict[str, Any] = {f"basis {r}": basis for r, basis in enumerate(reduction.bases)}
    arrays |= {"widths": comparison.similarity.widths, "about": np.array(json.dumps(about))}
    if comparison.similarity.weights is not None:
        arrays["weights"] = comparison.similarity.weights
    if mixing is not None:
        arrays["mixing"] = np.array(mixing)
    with whole_file(path, replace=False) as beside, beside.open("wb") as file:
        np.savez(file, **arrays)
    return path


def shared_reduction(folder: Path, store: Store, *, renew: bool = False) -> Reduction:
    """Return what ``bases.npz`` in a folder says; written first if there is none, or `renew` asks for another.

    All jobs that begin at once get the same: that of the first one that has written it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if renew:
        (folder / BASES).unlink(missing_ok=True)
    if not (folder / BASES).exists():
        with suppress(FileExistsError), compiled_always():
            write_reduction(folder, fit_reduction(store))
    reduction = read_reduction(folder)
    if reduction.library != store.id:
        raise DataError(
            f"expected shards of this library in {folder}, got {BASES} of another one; take a new folder, or say "
            "--force to make all of them again"
        )
    return reduction


def read_reduction(folder: Path) -> Reduction:
    """Return what ``bases.npz`` in a folder says. Raises `DataError`: there is none, or it is damaged."""
    path = folder / BASES
    if not path.is_file():
        raise DataError(
            f"expected a folder of shards with {BASES}, {folder} has none; write one by: kineme features ARCHIVE "
            f"--library LIBRARY -o {folder}"
        )
    try:
        with np.load(path, allow_pickle=False) as arrays:
            held = {name: arrays[name] for name in arrays.files}
        return _reduction_of(held, path)
    except (KinemeError, *_SPOILED) as error:
        raise DataError(
            f"expected {path} to hold bases and a comparison, got something else ({error}); write the shards again"
        ) from error


def _reduction_of(held: Mapping[str, NDArray[Any]], path: Path) -> Reduction:
    about = json.loads(str(held["about"]))
    d, n_bases = int(about["n_dims"]), sum(name.startswith("basis ") for name in held)
    specification = Specification.from_json(about, path).comparison
    channels = None if about["channels"] is None else channels_of_text(about["channels"], d, path)
    procrustes = specification.procrustes(d)
    if "mixing" in held:
        procrustes = replace(procrustes, mixing=tuple(map(tuple, held["mixing"].tolist())))
    chosen = tuple(specification.representations[r] for r in about["selected"])
    widths, weights = held["widths"], held.get("weights")
    bases = tuple(held[f"basis {r}"] for r in range(n_bases))
    fitting = [basis.shape[0] == how.n_points for basis, how in zip(bases, specification.by_rows, strict=True)]
    if not all(fitting) or not all(np.allclose(basis.T @ basis, np.eye(basis.shape[1])) for basis in bases):
        raise ValueError("bases that are not orthonormal, or of other representations")
    if widths.shape != (len(chosen),) or not (np.isfinite(widths) | np.isposinf(widths)).all() or (widths <= 0).any():
        raise ValueError("widths that are none")
    if weights is not None and (
        weights.shape != widths.shape or not np.isclose(weights.sum(), 1) or (weights < 0).any()
    ):
        raise ValueError("weights that are none")
    similarity = AveragedSimilarity(procrustes, widths, specification.mean, weights)
    comparison = Comparison(chosen, specification.normalization, specification.cutoff, similarity, channels)
    return Reduction(str(about["library"]), specification, bases, comparison)


def shard_table(specification: ComparisonSpecification, bases: Sequence[Array], recordings: Recordings) -> Any:
    """Return a `pyarrow.Table` with a row for each of the recordings, which are in the coordinates of the library.

    Columns: `path` (str), `place` (str), `label` (str or null), `start` and `duration` [s], `rows` (the feature rows of
    `ComparisonSpecification.stored_rows`) and `reduced` (values, square and residual norm of each representation
    compared sample by sample), both in single precision.
    """
    with needs("pyarrow", "write shards", "parquet"):
        import pyarrow as pa
    demos = recordings.demonstrations
    blocks = feature_rows(demos, specification)
    reduced = reduce_features(tuple(bases), blocks[: len(bases)], demos.n_dims)
    parts = [part for each in reduced for part in (each.values, each.squares[:, None], each.residual_norms[:, None])]
    numbers: dict[str, Array] = {"rows": np.concatenate(blocks, axis=1), "reduced": np.concatenate(parts, axis=1)}
    sources = recordings.sources
    texts = {name: [getattr(source, name) for source in sources] for name in ("path", "place", "label")}
    columns: dict[str, Any] = {name: pa.array(values, pa.string()) for name, values in texts.items()}
    columns["path"] = columns["path"].dictionary_encode()
    columns |= {"start": pa.array(demos.times[demos.offsets[:-1]]), "duration": pa.array(demos.durations)}
    for name, values in numbers.items():
        flat = pa.array(np.ascontiguousarray(values, dtype=np.float32).ravel())
        columns[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    return pa.table(columns).replace_schema_metadata({_BASES: bases_digest(bases)})


def write_arrow(path: Path, table: Any) -> None:
    """Write a table as a file of Arrow that can be mapped into memory: it holds but one dictionary for each column."""
    import pyarrow as pa

    table = table.unify_dictionaries().combine_chunks()
    with pa.OSFile(str(path), "wb") as sink, pa.ipc.new_file(sink, table.schema) as writer:
        writer.write_table(table, BATCH)


def write_shard(path: Path, tables: Sequence[Any], about: Mapping[str, Any] | None = None) -> int:
    """Write tables of `shard_table` as one shard, atomically; return the number of its rows.

    `about` is what the shard says of itself besides its task, as plain data.
    """
    import pyarrow as pa

    with whole_file(path) as beside:
        merged = pa.concat_tables(tables)
        said = {_ABOUT: json.dumps({"task": TASK} | dict(about or {})), **(merged.schema.metadata or {})}
        write_arrow(beside, merged.replace_schema_metadata(said))
    return int(merged.num_rows)


@dataclass(frozen=True, eq=False)
class Shard:
    """A file that is mapped into memory: rows are read where they are used."""

    path: Path
    batches: tuple[Any, ...]  # pyarrow.RecordBatch
    mapped: Any  # mmap.mmap of the file

    def __len__(self) -> int:
        return sum(batch.num_rows for batch in self.batches)

    @cached_property
    def _ends(self) -> NDArray[np.intp]:
        return np.cumsum([batch.num_rows for batch in self.batches])

    @cached_property
    def numbers(self) -> dict[str, list[NDArray[np.float32]]]:
        """Numbers of the columns of lists, (rows, width), batch by batch, without a copy."""
        columns = {name: [batch.column(name) for batch in self.batches] for name in ("rows", "reduced")}
        return {
            name: [column.flatten().to_numpy().reshape(len(column), -1) for column in parts]
            for name, parts in columns.items()
        }

    def advise(self, advice: str) -> None:
        """Tell the system how the file is going to be read, "RANDOM" or "SEQUENTIAL", where it can be told."""
        if hasattr(mmap, f"MADV_{advice}"):
            self.mapped.madvise(getattr(mmap, f"MADV_{advice}"))

    def will_need(self, rows: NDArray[np.intp]) -> None:
        """Begin to read the numbers of some rows, all at once, where the system can be told."""
        if not hasattr(mmap, "MADV_WILLNEED"):
            return
        base = np.frombuffer(self.mapped, np.uint8).ctypes.data
        which = np.searchsorted(self._ends, rows, side="right")
        first = np.concatenate(([0], self._ends))
        for blocks in self.numbers.values():
            for b, row in zip(which, rows, strict=True):
                block = blocks[b]
                begin = block.ctypes.data - base + int(row - first[b]) * block.strides[0]
                aligned = begin // mmap.PAGESIZE * mmap.PAGESIZE
                self.mapped.madvise(mmap.MADV_WILLNEED, aligned, begin + block.strides[0] - aligned)

    def take(self, rows: NDArray[np.intp], name: str) -> Any:
        """Return a column at some rows: lists as an array (k, width), others as a list."""
        which = np.searchsorted(self._ends, rows, side="right")
        first = np.concatenate(([0], self._ends))
        if (blocks := self.numbers.get(name)) is not None:
            return np.stack([blocks[b][row - first[b]] for b, row in zip(which, rows, strict=True)])
        values: list[Any] = [None] * len(rows)
        for b in np.unique(which).tolist():
            places = np.flatnonzero(which == b)
            taken = self.batches[b].column(name).take((rows[places] - first[b]).tolist()).to_pylist()
            for place, value in zip(places.tolist(), taken, strict=True):
                values[place] = value
        return values


@contextmanager
def _arrow(path: Path) -> Iterator[Any]:
    """Context manager: the package pyarrow; what it raises on damaged bytes becomes a `DataError`."""
    with needs("pyarrow", "read shards", "parquet"):
        import pyarrow as pa
    try:
        yield pa
    except (pa.ArrowException, *_SPOILED) as error:
        reason = " ".join(str(error).split())[:200]
        raise DataError(
            f"expected {path} to be a shard of features, got another or a damaged file ({reason}); remove it, and "
            "write it again by kineme features"
        ) from error


def open_shard(path: Path, reduction: Reduction) -> Shard:
    """Map a shard into memory. Raises `DataError`: it is damaged, or was made with other bases or another library."""
    with _arrow(path) as pa:
        with path.open("rb") as opened:
            mapped = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)
            file = pa.ipc.open_file(pa.BufferReader(pa.py_buffer(mapped)))
            metadata = file.schema.metadata or {}
            about = json.loads(metadata.get(_ABOUT, b"{}"))
            digest = metadata.get(_BASES, str(about.get("bases", "")).encode()).decode()
            if file.num_record_batches and len(file.schema):
                batches = tuple(file.get_batch(b) for b in range(file.num_record_batches))
            else:  # of a piece in which nothing could be read
                return Shard(path, (), mapped)
        if about.get("task") != TASK:
            raise ValueError(f"a file of the task {about.get('task')!r}")
        _check_columns(pa, batches, reduction)
    if digest != reduction.digest or about.get("library", reduction.library) != reduction.library:
        raise DataError(
            f"expected {path} to be made with the bases beside it, got a shard of other bases or another library; "
            "keep the shards of one library in one folder"
        )
    shard = Shard(path, batches, mapped)
    shard.advise("RANDOM")  # a few rows of each: what lies beside them is not read
    return shard


def _check_columns(pa: Any, batches: Sequence[Any], reduction: Reduction) -> None:
    rows_width = reduction.comparison.n_dims * sum(each.n_points for each in reduction.specification.stored_rows)
    widths = {"rows": rows_width, "reduced": reduction.columns()[-1].stop}
    kinds = dict.fromkeys(("place", "label"), pa.string()) | dict.fromkeys(("start", "duration"), pa.float64())
    kinds |= {name: pa.list_(pa.float32(), width) for name, width in widths.items()}
    for batch in batches:
        for name, kind in kinds.items():
            if not batch.schema.field(name).type.equals(kind):
                raise ValueError(f"{batch.schema.field(name).type} in the column {name}, where {kind} was expected")
        if not pa.types.is_string(batch.schema.field("path").type.value_type):
            raise ValueError("paths that are no texts")
        for name in ("path", "place", "label", "start", "duration"):
            batch.column(name).validate(full=True)
        for name in ("path", "place", "start", "duration", *widths):
            if batch.column(name).null_count:
                raise ValueError(f"rows without {name}")
        for name, width in widths.items():
            if len(batch.column(name).flatten()) != width * batch.num_rows:
                raise ValueError(f"a column {name} of another length")

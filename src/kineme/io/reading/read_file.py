"""Read one file: hashed, and parsed into checked movements; failures become problems."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.limits import check_expanded
from kineme.io.reading.check_block import check_block, sentinels_as_missing
from kineme.io.reading.formats import FORMATS, OUTSIDE, Format, as_text, data_set_of, leads_out
from kineme.io.records import Problem
from kineme.movements.channels.column_match import in_one_unit, numbers_by_name, with_unit
from kineme.movements.channels.detect import unit_of
from kineme.movements.tables.columns import excluded_numbers
from kineme.movements.tables.layout import Block, Detected, Known, Layout, Parsed, listed

#: Exceptions of readers on invalid files; RecursionError is too deep nesting.
_UNREADABLE = (
    KinemeError, ValueError, KeyError, TypeError, AttributeError, EOFError, OSError, ArithmeticError, RecursionError,
    MemoryError
)  # fmt: skip

_SPREADSHEETS = frozenset({".xlsx", ".xlsm", ".xls", ".ods", ".numbers"})
_NOWHERE = "expected a file, got a link that leads nowhere; delete it, or restore what it leads to"
NO_MOVEMENTS = Block(np.empty((0, 0)), None, np.zeros(1, np.intp), [], [])


class FileRead(NamedTuple):
    """The result for one file: its problems, its movements, none where it cannot be read, and how they were read."""

    path: str  # relative to the folder that is read
    problems: list[Problem]
    detected: Detected = Detected("", "", (), None, "", "")
    block: Block = NO_MOVEMENTS
    sha256: str = ""
    size: int = 0
    mtime: float = 0.0
    person: str | None = None  # who showed the movements, where the name of the file says it

    @property
    def n_dims(self) -> int:
        """Number of coordinates."""
        return self.block.positions.shape[1]

    def without_movements(self, reason: str) -> FileRead:
        """Return the file as one that cannot be read, with one problem more."""
        return self._replace(block=NO_MOVEMENTS, problems=[*self.problems, Problem(self.path, None, reason)])

    def renamed(self, name: str) -> FileRead:
        """Return the file under the name that it has in the result, also in its problems."""
        return self._replace(path=name, problems=[problem._replace(file=name) for problem in self.problems])


def read_file(path: Path, relative: Path, layout: Layout, follow_links: bool = False) -> FileRead:
    """Read a file, or a folder that is one data set, called `relative` in the result; it need not exist any more."""
    unread = FileRead(as_text(relative), [])
    try:
        parts, form = _parts(path, relative, follow_links)
        statuses = [os.stat(part) for part in parts]
        if not all(stat.S_ISREG(status.st_mode) for status in statuses):  # reading a pipe would wait forever
            raise DataError("expected a file, got a pipe or a device")
        if form.read_path is None:
            check_expanded(statuses[0].st_size)
            data = path.read_bytes()
    except (OSError, MemoryError, DataError) as error:
        nowhere = path.is_symlink() and not os.path.exists(path)
        return unread.without_movements(_NOWHERE if nowhere else _plainly(error))
    if form.read_path is None:
        return read_bytes(data, relative, layout, statuses[0].st_mtime)
    size, mtime = sum(status.st_size for status in statuses), max(status.st_mtime for status in statuses)
    read = parsed_file(partial(form.read_path, path), form, relative, layout)
    try:
        checksum = _sha256(parts, path) if read.block.labels else ""
    except OSError as error:  # it was there a moment ago
        return unread.without_movements(_plainly(error))
    return read._replace(sha256=checksum, size=size, mtime=mtime)


def read_bytes(data: bytes, relative: Path, layout: Layout, mtime: float = 0.0) -> FileRead:
    """Read the content of a file of that name."""
    form = format_of(relative)
    assert form.read_bytes is not None  # else its path is read; the standard input is CSV
    read = parsed_file(partial(form.read_bytes, data), form, relative, layout)
    return read._replace(sha256=hashlib.sha256(data).hexdigest(), size=len(data), mtime=mtime)


def parsed_file(parse: Callable[[Layout], Parsed], form: Format, relative: Path, layout: Layout) -> FileRead:
    """Check what a reader returns, or return the problem with it."""
    name = as_text(relative)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # overflow gives infinity, which is reported later
            if layout.rows and not form.has_lines:
                raise DataError("expected text, of which each line is a movement, got another format; leave out rows")
            parsed = select_columns(parse, layout)
            detected, block, left_out, named_alone, _ = (
                parsed if layout.every is None else in_blocks(parsed, layout.every)
            )
            block, sentinels = sentinels_as_missing(block, detected.columns)
            if layout.measured_in is not None:
                detected = with_unit(detected, block, layout.measured_in, layout.kinds or {})
            detected, block = in_one_unit(detected._replace(sentinels=sentinels), block)
            block, problems = check_block(block, name, layout, detected.columns)
        folder, stem = as_text(relative.parent.name), as_text(relative.stem)
        counts = bool(folder) and stem.isdecimal() and len(block.labels) == 1  # the recordings of a label
        label = stem if form.label_is_stem and not counts else folder or None
        labels = [label if own is None or (folder and named_alone) else _storable(own) for own in block.labels]
        people = block.people and [None if person is None else _storable(person) for person in block.people]
    except _UNREADABLE as error:
        return FileRead(name, []).without_movements(_plainly(error))
    bare = Block(block.positions, block.times, block.offsets, labels, block.places)  # releases the bytes of the file
    block = replace(bare, people=people, repairs=block.repairs)
    problems += [Problem(name, None, _storable(" ".join(reason.splitlines()))) for reason in left_out]
    return FileRead(name, problems, detected, block)


def _parts(path: Path, relative: Path, follow_links: bool) -> tuple[list[Path], Format]:
    data_set = data_set_of(path)
    if data_set is None:
        return [path], format_of(relative)
    parts = data_set.files(path)
    if not follow_links and (outside := [part for part in parts if leads_out(part, path)]):
        raise DataError(f"{as_text(outside[0].relative_to(path))} is {OUTSIDE}")
    return parts, data_set.format


def _sha256(parts: Sequence[Path], path: Path) -> str:
    """Return the checksum of a file; of a data set, that of the names and the checksums of its files."""
    checksums = []
    for part in parts:
        with part.open("rb") as file:
            checksums.append(hashlib.file_digest(file, "sha256").hexdigest())
    if parts == [path]:
        return checksums[0]
    names = [as_text(part.relative_to(path)) for part in parts]
    lines = [f"{checksum}  {name}\n" for checksum, name in zip(checksums, names, strict=True)]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def format_of(path: Path) -> Format:
    """Return the row of `FORMATS` for a file's extension."""
    form = FORMATS.get(path.suffix.lower())
    if path.suffix.lower() in _SPREADSHEETS:
        raise DataError(f"expected a table of text, got the spreadsheet {path.name}; save its sheet as .csv")
    if form is None:
        raise DataError(f"expected a file ending in one of {', '.join(FORMATS)}, got {path.suffix or 'no ending'!r}")
    return form


def _storable(label: str) -> str:
    """Return a label without lone surrogates, which JSON can hold but which cannot be encoded as UTF-8."""
    return label.encode("utf-8", "backslashreplace").decode("utf-8")


def _plainly(error: BaseException) -> str:
    got = f"no entry {error}" if isinstance(error, KeyError) else str(error) or type(error).__name__
    reason = f"expected times and positions, got {got}"
    if isinstance(error, KinemeError):
        reason = str(error)
    elif isinstance(error, MemoryError):
        reason = "expected a file that fits into the memory; split it"
    elif isinstance(error, OSError):
        reason = f"expected a file that can be read, got: {error.strerror or error}"
    elif isinstance(error, RecursionError):
        reason = "expected times and positions, got lists within lists within lists, too many to be arrays"
    return " ".join(reason.splitlines())


def in_blocks(parsed: Parsed, every: int) -> Parsed:
    """Cut each movement of a file into movements of `every` samples."""
    block = parsed.block
    lengths = np.diff(block.offsets)
    if (odd := np.flatnonzero(lengths % every)).size:
        i = int(odd[0])
        where = f" in movement {block.places[i]}" if block.places[i] else ""
        raise DataError(
            f"expected blocks of {every} samples, got {lengths[i]} samples{where}: {lengths[i] // every} blocks and "
            f"{lengths[i] % every} more; give the right number, or repair the file"
        )
    counts = lengths // every
    owners = np.repeat(np.arange(len(lengths)), counts).tolist()
    numbers = (np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)).tolist()
    places = [f"{block.places[i]}/{k}" if block.places[i] else str(k) for i, k in zip(owners, numbers, strict=True)]
    cut = replace(
        block,
        offsets=np.arange(len(owners) + 1) * every,
        labels=[block.labels[i] for i in owners],
        places=places,
        people=block.people and [block.people[i] for i in owners],
    )
    detected = parsed.detected._replace(layout=f"{parsed.detected.layout}, blocks of {every} samples")
    return parsed._replace(detected=detected, block=cut)


def select_columns(parse: Callable[[Layout], Parsed], layout: Layout) -> Parsed:
    """Parse a file, and keep the columns that are asked for, or those of the movements to compare with."""
    names = layout.reference.columns if layout.reference is not None and layout.coordinates is None else ()
    if names and not any(name.isdecimal() for name in names):
        try:
            return _without_excluded(parse(replace(layout, columns=names)), layout)
        except KinemeError:
            pass  # it has other columns, which may be compared in their order
    parsed = parse(layout)
    if layout.reference is not None and layout.by_number:
        return _named_as(_without_excluded(parsed, layout), layout.reference)
    heads = parsed.detected.columns
    places = numbers_by_name(heads, names)
    lost = [name for name, place in zip(names, places, strict=True) if place is None]
    if names and not lost and len(names) < len(heads):  # in other units, which their heads end in
        chosen = tuple(heads[place] for place in places if place is not None)
        return _without_excluded(parse(replace(layout, columns=chosen)), layout)
    if 0 < len(lost) < len(names) != len(heads):
        raise DataError(
            f"expected the columns of the library, got none of {listed(lost)} but {listed(heads)}; record them too, or "
            "choose as many others with columns=, in the shell --columns"
        )
    return _without_excluded(parsed, layout)


def _without_excluded(parsed: Parsed, layout: Layout) -> Parsed:
    """Return a file without the columns that are excluded or, unless they were chosen, hold nothing."""
    detected, block = parsed.detected, parsed.block
    heads = detected.columns
    by_name = [column for column in layout.excluded if isinstance(column, str) and not column.isdecimal()]
    dropped = excluded_numbers(heads, by_name if parsed.without_excluded else layout.excluded)
    if layout.coordinates is None and len(block.positions):
        nothing = np.flatnonzero(np.isnan(block.positions[0]))
        dropped |= {*nothing[np.isnan(block.positions[:, nothing]).all(axis=0)].tolist()}
    if not dropped:
        return parsed
    columns = [k for k in range(len(heads)) if k not in dropped]
    if not columns:
        raise DataError(
            f"expected columns with numbers besides those that are excluded, got {listed(heads)}; exclude fewer"
            if layout.excluded
            else f"expected numbers in the columns {listed(heads)}, got none"
        )
    return take_columns(parsed, columns)


def take_columns(parsed: Parsed, chosen: Sequence[int]) -> Parsed:
    """Return a file with some of its coordinates, in that order; the others are ignored."""
    detected, block = parsed.detected, parsed.block
    others = {*range(len(detected.columns))} - {*chosen}
    detected = detected._replace(
        columns=tuple(detected.columns[k] for k in chosen),
        measured_in=detected.measured_in and tuple(detected.measured_in[k] for k in chosen),
        ignored=(*detected.ignored, *(detected.columns[k] for k in sorted(others))),
    )
    return parsed._replace(detected=detected, block=replace(block, positions=block.positions[:, chosen]))


def _named_as(parsed: Parsed, others: Known) -> Parsed:
    """Return a file with the names of as many columns of the movements to compare with, in its own units."""
    detected = parsed.detected
    names = next((heads for heads in (others.columns, others.moving) if len(heads) == len(detected.columns)), None)
    if names is None:
        return parsed
    units = detected.measured_in or tuple(unit_of(head) or "" for head in detected.columns)
    return parsed._replace(detected=detected._replace(columns=names, measured_in=units))

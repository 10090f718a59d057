"""Labels beside a long recording, in CSV, JSON or of ELAN and Audacity, and the recording cut into movements."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded, read_limited
from kineme.io.reading.merge_files import Recordings, Source, demonstrations_of, notes_on_values
from kineme.io.records import NO_SYMBOLS, UNKNOWN, Problem
from kineme.movements.tables.time_stamps import TIME_UNITS
from kineme.reporting.text import counted, text_in
from kineme.units import UNITS, converted, split_head, unit_named
from kineme.validation import MIN_SAMPLES, Array, stays

#: Share of a stretch that may lie outside its recording: somebody who labels to the end rounds it up.
_OUTSIDE = 0.1

_TIMES = "|".join(sorted(map(re.escape, TIME_UNITS), key=len, reverse=True))
_UNIT = rf"(\b|_({_TIMES})$)"
_START = re.compile(rf"(start|begin|onset|from){_UNIT}|(start|begin)[ _]?time")
_END = re.compile(rf"(end|stop|offset|to){_UNIT}|(end|stop)[ _]?time")
_LAST_WORD = re.compile(rf"(?<![.a-zµμ])({_TIMES})\W*$")  # that of hh:mm:ss.ms says how a clock is written
_COUNTED = re.compile(r"\b(frame|sample|index|idx|row)s?\b")  # what is no time without a rate
#: Heads of labels; the first that a table has is taken, as others may be numbers of rows, or who wrote them.
_LABELS = (
    "label", "labels", "symbol", "annotation", "annotations", "gesture", "action", "activity", "behavior", "category",
    "class", "event", "text", "value", "name",
)  # fmt: skip
_RECORDINGS, _PLACES = frozenset({"recording", "file", "path"}), frozenset({"place"})
_CLOCK = re.compile(r"(?:(\d+):)?(\d+):(\d+(?:[.,]\d+)?)")
_NOTHING = NO_SYMBOLS | {"none", "nan", "null"}  # labels that say that there is none


class LabelRow(NamedTuple):
    """A row of a table of labels."""

    start: float  # [s], and so is the end
    end: float
    label: str | None
    # recording and place: which recording, and which movement of it; empty where the table does not say
    recording: str
    place: str
    line: int  # row of the table, from 1
    text: str = ""  # what stands for the label in the table


class Heads(NamedTuple):
    """Columns of a table of labels by their roles, the units of start and end, and whether ELAN wrote the heads."""

    start: int
    end: int
    label: int
    recording: int | None
    place: int | None
    units: tuple[str, str]
    of_elan: bool
    unknown: int | None = None


def heads_of(cells: Sequence[str]) -> Heads | None:
    """Return the roles of the columns of a table with these heads; None if they are none."""
    names = [cell.strip().strip('"#').strip().lower() for cell in cells]
    either = [[k for k, name in enumerate(names) if wanted.match(name)] for wanted in (_START, _END)]
    starts, ends = ([k for k in some if _is_time(names[k])] for some in either)
    if all(either) and not (starts and ends):
        odd = next(k for some in either for k in some if not _is_time(names[k]))
        raise DataError(
            f"expected start and end in a unit of time (s, ms, us, ns, min, h), got {cells[odd].strip()!r}; divide "
            "frames or samples by the rate, and name the unit in brackets"
        )
    if not starts or not ends:
        return None
    start, end = (min(some, key=lambda k: "hh:mm" in names[k]) for some in (starts, ends))
    labeled = [names.index(name) for name in _LABELS if name in names]
    others = [k for k, name in enumerate(names) if k not in {*starts, *ends} and not name.startswith("duration")]
    aside = _RECORDINGS | _PLACES
    labels = labeled or [k for k in others if names[k] and names[k] not in aside]
    if len(labels) != 1 and not labeled:
        raise DataError(f"expected one column of labels beside start and end, got {list(cells)}; call it label")
    recording, place, unknown = (
        next((k for k, name in enumerate(names) if name in wanted), None)
        for wanted in (_RECORDINGS, _PLACES, {UNKNOWN})
    )
    units = _unit_of(names[start]), _unit_of(names[end])
    return Heads(start, end, labels[0], recording, place, units, "time - " in names[start], unknown)


def _is_time(name: str) -> bool:
    """Tell whether a head of a start or an end says no other unit than of time."""
    unit = unit_named(split_head(name)[1] or "")
    return _COUNTED.search(name) is None if unit is None else unit.quantity == "time"


def _unit_of(name: str) -> str:
    """Return the unit of the times below a head in lower case: in brackets, or its last word; else seconds."""
    unit, word = unit_named(split_head(name)[1] or ""), _LAST_WORD.search(name)
    if unit is not None and unit.quantity == "time":
        return unit.symbol
    return word[1] if word else "s"


def heads_of_cells(cells: Sequence[str]) -> Heads | None:
    """Find the columns of a table without heads: start, end and label in this order; None if there are none."""
    clocks = [k for k, cell in enumerate(cells) if ":" in cell and seconds_of(cell) is not None]
    numbers = [k for k, cell in enumerate(cells[:-1]) if ":" not in cell and seconds_of(cell) is not None]
    times = clocks if len(clocks) > 1 else numbers
    return Heads(times[0], times[1], len(cells) - 1, None, None, ("s", "s"), True) if len(times) > 1 else None


def row_of(cells: Sequence[str], heads: Heads, line: int) -> LabelRow:
    """Return a row as a record."""
    if len(cells) <= max(heads.start, heads.end, heads.label):
        raise DataError(f"line {line}: expected start, end and label, got {list(cells)}")
    times = []
    for k, unit in zip((heads.start, heads.end), heads.units, strict=True):
        time = seconds_of(cells[k])  # of mm:ss.sss whatever the unit is
        is_clock = time is None or ":" in cells[k]
        times.append(math.nan if time is None else time if is_clock else converted(time, UNITS[unit], UNITS["s"]))
    start, end = map(float, times)
    if not end >= start:  # one of no length, as a mark of Audacity, is outside of every recording
        raise DataError(
            f"line {line}: expected a start and an end after it, got {cells[heads.start]!r} and {cells[heads.end]!r}"
        )
    recording, place = (
        "" if k is None or k >= len(cells) else text_in(cells[k].strip()) for k in (heads.recording, heads.place)
    )
    text = text_in(cells[heads.label].strip())
    # Where kineme wrote that the motion is known, symbols may have names that say elsewhere that there is none.
    is_known = heads.unknown is not None and cells[heads.unknown : heads.unknown + 1] in (["false"], ["False"])
    nothing = NO_SYMBOLS if is_known else _NOTHING
    return LabelRow(start, end, None if text.lower() in nothing else text, recording, place, line, text)


def seconds_of(cell: str) -> float | None:
    """Return a time as seconds or as hh:mm:ss.sss; None if it is neither."""
    text = cell.strip()
    if clock := _CLOCK.fullmatch(text):
        hours, minutes, seconds = clock.groups()
        return 3600.0 * int(hours or 0) + 60.0 * int(minutes) + float(seconds.replace(",", "."))
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


_SKIPPED = ("\\", '"#', "#")  # frequencies of Audacity, and what ELAN says of the media
_CELL = 200  # bytes that a character of a table may take in Python, at most
_EXPECTED = "expected a table with columns start, end and label"
_MILLISECONDS = Heads(0, 1, 2, None, None, ("ms", "ms"), True)


class LabelTable(NamedTuple):
    """Labels beside a recording."""

    name: str  # of the file
    rows: tuple[LabelRow, ...]
    # Whether times count from the first sample, as in ELAN and Audacity; else they are by the recording's clock.
    since_start: bool


def read_labels(path: Path) -> LabelTable:
    """Read the labels in a file; a `DataError` names the file, and the line if there is one.

    ``.eaf`` is a document of ELAN, ``.json`` a list of objects; anything else a table. Without heads, as Audacity and
    ELAN export tables, the first two times are start and end, and the last column is the label.
    """
    with path.open("rb") as file:
        data = read_limited(file)
    readers = {".eaf": _elan, ".json": _json}
    try:
        check_expanded(_CELL * len(data) if path.suffix.lower() in readers else 10 * len(data), "a table of labels")
        rows, since_start = readers.get(path.suffix.lower(), _table)(data)
        if not rows:
            raise DataError(f"{_EXPECTED}, got no labels")
    except (DataError, ValueError, RecursionError, csv.Error, ElementTree.ParseError) as error:
        raise DataError(f"labels {path}: {error}") from error
    return LabelTable(str(path), tuple(rows), since_start)


def _table(data: bytes) -> tuple[list[LabelRow], bool]:
    text = data.decode("utf-8-sig")
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith(_SKIPPED)), "")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=max("\t;,", key=first.count))
    cells = [(reader.line_num, row) for row in reader if any(row) and not row[0].startswith(("\\", "#"))]
    if not cells:
        return [], False
    if heads := heads_of(cells[0][1]):
        return [row_of(row, heads, k) for k, row in cells[1:]], heads.of_elan
    plain = heads_of_cells(cells[0][1])
    if plain is None:
        raise DataError(f"{_EXPECTED}, got {first[:80]!r}")
    return [row_of(row, plain, k) for k, row in cells], True


def _json(data: bytes) -> tuple[list[LabelRow], bool]:
    rows = json.loads(data)
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise DataError("expected a list of objects with start, end and label, got something else")
    names = list(dict.fromkeys(str(name) for row in rows for name in row))
    heads = heads_of(names)
    if heads is None:
        raise DataError(f"expected objects with start, end and label, got {names[:20]}")
    cells = [["" if row.get(name) is None else str(row[name]) for name in names] for row in rows]
    return [row_of(texts, heads, k) for k, texts in enumerate(cells, 1)], False


def _elan(data: bytes) -> tuple[list[LabelRow], bool]:
    root = ElementTree.fromstring(data)
    slots = {slot.get("TIME_SLOT_ID"): slot.get("TIME_VALUE", "") for slot in root.iter("TIME_SLOT")}
    tiers = {tier.get("TIER_ID", ""): tier.findall(".//ALIGNABLE_ANNOTATION") for tier in root.iter("TIER")}
    aligned = {name: annotations for name, annotations in tiers.items() if annotations}
    name = "symbol" if "symbol" in aligned else next(iter(aligned), None)
    if name is None:
        return [], True
    if name != "symbol" and len(aligned) > 1:
        raise DataError(
            f"expected one tier with annotations, or one named symbol, got {list(aligned)}; delete the others"
        )
    rows = []
    for k, annotation in enumerate(aligned[name], 1):
        times = [slots.get(annotation.get(f"TIME_SLOT_REF{i}"), "") for i in (1, 2)]
        rows.append(row_of([*times, annotation.findtext("ANNOTATION_VALUE") or ""], _MILLISECONDS, k))
    return rows, True


class Stretch(NamedTuple):
    """A row of a table of labels in the samples of its recording."""

    recording: int  # index among the recordings
    # start and stop: first sample, and one past the last
    start: int
    stop: int
    row: LabelRow


def stretches_of(
    recordings: Recordings, table: LabelTable, root: Path | None = None
) -> tuple[list[Stretch], list[Problem]]:
    """Return the stretches of recordings below `root` that a table labels, and the problems with its other rows.

    A stretch begins and ends at the samples nearest to its times. Those by the recording's clock that all lie outside
    of it, and would fit counted from its first sample, are taken so. A stretch outside of its recording, of fewer than
    four samples, at the same place, or labeled twice is a problem, and so are rows of recordings that are not there.
    """
    demos, rows = recordings.demonstrations, table.rows
    if len(demos) > 1 and not any(row.recording or row.place for row in rows):
        raise DataError(
            f"expected labels {table.name} beside one recording, got {len(demos)}; say which row is of which in "
            "columns recording and place"
        )
    stretches: list[Stretch] = []
    paths = {source.path for source in recordings.sources}
    meant = _meant(dict.fromkeys(row.recording for row in rows), paths, root)
    # The rows of which several recordings may be meant, one problem for each name.
    lines_of_names = {row.recording: row.line for row in reversed(table.rows)}
    problems = _of_none(table, recordings.sources, meant)
    for name, several in meant.items():
        if len(several) > 1:
            said = (
                f"expected one recording {name}, got {', '.join(several)}; write its folder in the column recording too"
            )
            problems.append(Problem(table.name, lines_of_names[name], said))
    by_place: dict[str, list[LabelRow]] = {}
    for row in rows:
        if len(meant[row.recording]) < 2:
            by_place.setdefault(row.place, []).append(row)
    for i, source in enumerate(recordings.sources):
        first, last = demos.offsets[i : i + 2]
        near = [*by_place.get("", ()), *(by_place.get(source.place, ()) if source.place else ())]
        own = [row for row in near if _is_of(row, source, meant)]
        times = demos.movements.stamps[first:last]
        since = table.since_start or _counts_from_start(own, times)
        lines: dict[tuple[int, int], int] = {}  # stretch -> line that labels it
        for row in own:
            origin = float(times[0]) if since else 0.0
            start, stop = _samples(row, times, origin)
            path = demos.positions[first + start : first + stop]
            outside = max(times[0] - origin - row.start, 0.0) + max(row.end + origin - times[-1], 0.0)
            if stop - start < MIN_SAMPLES or outside > _OUTSIDE * (row.end - row.start):
                reason = (
                    f"expected at least {MIN_SAMPLES} samples, and nine tenths, of the time between {row.start:.2f} "
                    f"and {row.end:.2f} s in {source.path}; it lasts from {times[0] - origin:.2f} to "
                    f"{times[-1] - origin:.2f} s"
                )
                problems.append(Problem(table.name, row.line, reason))
            elif stays(path[:1], np.ptp(path, axis=0, keepdims=True)).all():
                reason = (
                    f"expected a movement between {row.start:.2f} and {row.end:.2f} s in {source.path}, got "
                    f"{stop - start} samples at the same place"
                )
                problems.append(Problem(table.name, row.line, reason))
            elif (line := lines.setdefault((start, stop), row.line)) != row.line:
                reason = f"expected one label for a stretch, line {line} has it too"
                problems.append(Problem(table.name, row.line, reason))
            else:
                stretches.append(Stretch(i, start, stop, row))
    return stretches, problems


def labeled_pieces(recordings: Recordings, table: LabelTable, root: Path | None = None) -> Recordings:
    """Return the stretches of recordings that a table labels, see `stretches_of`, as movements of their own."""
    stretches, problems = stretches_of(recordings, table, root)
    if not stretches:
        raise DataError(
            f"expected labels {table.name} within {recordings.sources[0].path}, found none"
            + (f"; the first that is none: {problems[-1]}" if problems else "")
        )
    pieces = cut_stretches(recordings, stretches)
    return replace(pieces, problems=(*recordings.problems, *problems))


def cut_stretches(recordings: Recordings, stretches: Sequence[Stretch]) -> Recordings:
    """Return stretches of recordings as movements with the labels of their rows."""
    demos, sources, samples = recordings.demonstrations, [], []
    movements = demos.movements
    for stretch in stretches:
        source, first = recordings.sources[stretch.recording], int(demos.offsets[stretch.recording])
        times = movements.stamps[first : int(demos.offsets[stretch.recording + 1])]
        place = _place(source, times, stretch.start, stretch.stop)
        sources.append(source._replace(place=place, label=stretch.row.label))
        samples.append(np.arange(first + stretch.start, first + stretch.stop))
    # What is learned of orientations and angles begins anew in each.
    offsets, rows = np.concatenate(([0], np.cumsum([*map(len, samples)]))), np.concatenate(samples)
    positions = np.ascontiguousarray((demos.positions if movements.channels is None else demos.recorded)[rows])
    cut = demonstrations_of(
        positions, movements.stamps[rows], offsets, sources, movements.channels, movements.dimensions
    )
    of_whole = {*notes_on_values(recordings)}
    others = [note for note in recordings.notes if note not in of_whole]
    pieces = replace(recordings, demonstrations=cut, sources=tuple(sources))
    return replace(pieces, notes=(*others, *notes_on_values(pieces)))


def _of_none(table: LabelTable, sources: Sequence[Source], meant: Mapping[str, Sequence[str]]) -> list[Problem]:
    lost = [row for row in table.rows if not any(_is_of(row, source, meant) for source in sources)]
    if not lost:
        return []
    wanted = f"{lost[0].recording} {lost[0].place}".strip()
    more = f", and {counted(len(lost) - 1, 'row')} more" if len(lost) > 1 else ""
    alike = {PurePosixPath(source.path).name for source in sources} & {PurePosixPath(lost[0].recording).name}
    folders = "; where its folders have other names now, correct them in the table" if alike else ""
    reason = f"expected a recording {wanted} among those that are read, found none{more}{folders}"
    return [Problem(table.name, lost[0].line, reason)]


def _meant(names: Iterable[str], paths: Collection[str], root: Path | None) -> dict[str, list[str]]:
    """Give the recordings that names may mean: those of the name, else in folders below, else ends of longer paths.

    Of several longer paths that end in the same recording, that is meant which agrees with it most.
    """
    meant: dict[str, list[str]] = {"": []}
    longer: dict[str, dict[str, float]] = {}
    for name in filter(None, names):
        meant[name] = [name] if name in paths else sorted(path for path in paths if path.endswith(f"/{name}"))
        if not meant[name]:
            agreement, path = max((_agreement(name, path, root), path) for path in paths)
            longer.setdefault(path, {})[name] = agreement
    for path, agreements in longer.items():
        best = max(agreements.values())
        if best == math.inf or (best > 0 and [*agreements.values()].count(best) == 1):
            meant |= {name: [path] for name, agreement in agreements.items() if agreement == best}
    return meant


def _agreement(recording: str, path: str, root: Path | None) -> float:
    """Return how many names at the end of a longer path are those of a recording; inf for all, and 0 if it is another.

    A table may have moved with its recordings: then its paths begin at the top, and lead nowhere.
    """
    names = tuple(name for name in reversed(PurePosixPath(recording).parts) if name not in {"/", ".."})
    own = PurePosixPath(path).parts[::-1]
    if names[: len(own)] != own:
        return 0
    folders = [path] if root is None else [os.path.abspath(root / path), os.path.realpath(root / path)]  # also of links
    same = max(k for k in range(len(names) + 1) for each in folders if Path(each).parts[::-1][:k] == names[:k])
    if same == len(names):
        return math.inf
    moved = PureWindowsPath(recording).anchor and not os.path.exists(recording)
    return same if root is None or moved else 0


def _is_of(row: LabelRow, source: Source, meant: Mapping[str, Sequence[str]]) -> bool:
    if row.place and row.place != source.place:
        return False
    return not row.recording or source.path in meant[row.recording]


def _counts_from_start(rows: Sequence[LabelRow], times: Array) -> bool:
    """Tell whether no stretch is within the recording by its clock, and all are counted from its first sample."""
    duration = float(times[-1] - times[0])
    outside = all(row.end < times[0] or row.start > times[-1] for row in rows)
    return outside and all(row.start >= 0.0 and row.end <= duration * (1.0 + 1e-6) for row in rows)


def _samples(row: LabelRow, times: Array, origin: float) -> tuple[int, int]:
    """Find the samples from the nearest to the start to the nearest to the end: first, and one past the last."""
    half = 0.5 * float(np.median(np.diff(times)))
    start = int(np.searchsorted(times, origin + row.start - half))
    return start, int(np.searchsorted(times, origin + row.end + half))


def _place(source: Source, times: Array, start: int, stop: int) -> str:
    ends = (np.format_float_positional(times[k], precision=4, trim="-") for k in (start, stop - 1))
    return f"{source.place} {'-'.join(ends)} s".strip()

"""The record of what happens when in a recording, the table of its writers, and which of them writes to a path."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from kineme.errors import DataError
from kineme.io.lerobot.info import read_info
from kineme.io.reading.formats import FORMATS, format_at
from kineme.io.reading.pieces import is_episodic
from kineme.io.records import UNKNOWN, needs
from kineme.io.ros.add_topic import copy_with_topic
from kineme.io.ros.choose import bag_contents
from kineme.io.writing.write_movement import Movement, distinct_stems
from kineme.movements.episodes import number_at
from kineme.reporting.atomic import whole_file, whole_folder, write_atomically
from kineme.reporting.text import as_cell, printable

HEADS = ("recording", "place", "start", "end", "symbol", "p_value", "confidence", "unknown", "uncertainty")


@dataclass(frozen=True)
class Annotation:
    """A stretch of motion in a recording, and the symbol that it shows."""

    recording: str  # as `kineme.io.reading.merge_files.Source.path` names it
    place: str  # which movement of the file, such as the number of an episode; empty if the file holds but one
    start: float  # time stamp of the first sample [s], by the clock of the recording
    end: float  # that of the last one
    symbol: str | None  # None: motion that is like no symbol
    p_value: float  # share of movements of known symbols that would be as novel or more
    confidence: float  # probability that the symbol is right if the library has it; if unknown, 1 minus `p_value`
    origin: float = 0.0  # time stamp of the first sample of the recording [s]
    uncertainty: float = math.nan  # half of the 95 % interval of start and end, of the less certain one [s]

    @property
    def unknown(self) -> bool:
        """True if the motion is like no symbol."""
        return self.symbol is None

    @property
    def span(self) -> tuple[float, float]:
        """Start and end in seconds since the first sample, as programs for videos count them."""
        return self.start - self.origin, self.end - self.origin


def as_row(annotation: Annotation) -> dict[str, Any]:
    """Return an annotation as plain data, in the order of `HEADS`; numbers that nobody knows are None."""
    row = {head: getattr(annotation, head) for head in HEADS}
    unknown = [head for head in ("p_value", "uncertainty") if not math.isfinite(row[head])]
    return row | dict.fromkeys(unknown)


def to_csv(annotations: Sequence[Annotation]) -> bytes:
    """Write a row for each annotation; the symbol of unknown motion is empty, times are by the recording's clock."""

    def cell(value: Any) -> str:
        if isinstance(value, bool):
            return "true" if value else "false"
        return as_cell(value) if isinstance(value, str) else "" if value is None else str(value)

    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADS)
    table.writerows(map(cell, as_row(annotation).values()) for annotation in annotations)
    return text.getvalue().encode("utf-8", "backslashreplace")


def stream_csv(path: Path, parts: Iterable[Sequence[Annotation]]) -> Path:
    """Write `to_csv` of many annotations, some at a time."""
    with whole_file(path) as beside, beside.open("wb") as file:
        file.write(to_csv([]))
        for annotations in parts:
            file.write(to_csv(annotations).partition(b"\n")[2])
    return path


def stream_json(path: Path, parts: Iterable[Sequence[Annotation]]) -> Path:
    """Write a list of objects, one for each annotation, some at a time; the symbol of unknown motion is null."""
    with whole_file(path) as beside, beside.open("wb") as file:
        before = "["
        for annotation in chain.from_iterable(parts):
            text = json.dumps([as_row(annotation)], ensure_ascii=False, allow_nan=False, indent=1)
            file.write((before + text[1:-2]).encode("utf-8", "backslashreplace"))
            before = ","
        file.write(b"[]\n" if before == "[" else b"\n]\n")
    return path


def write_audacity(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write ``start TAB end TAB label`` lines, in seconds since the first sample, as File > Import > Labels reads."""
    rows = [(*note.span, UNKNOWN if note.symbol is None else " ".join(note.symbol.split())) for note in annotations]
    lines = [f"{start:.6f}\t{end:.6f}\t{symbol}\n" for start, end, symbol in rows]
    return write_atomically(path, "".join(lines).encode("utf-8", "backslashreplace"))


_DOCUMENT = {
    "xmlns:xsi": "http://www.w3.org/2001/XMLSchema-instance",
    "xsi:noNamespaceSchemaLocation": "http://www.mpi.nl/tools/elan/EAFv3.0.xsd",
    "AUTHOR": "", "FORMAT": "3.0", "VERSION": "3.0",
}  # fmt: skip
_ASSOCIATION = "Symbolic_Association"
_MEANING = "1-1 association with a parent annotation"

#: Tiers below that of the symbols: one annotation each for every annotation of it.
_DEPENDENT: dict[str, Callable[[Annotation], str]] = {
    "p-value": lambda annotation: f"{annotation.p_value:.3g}",
    "confidence": lambda annotation: f"{annotation.confidence:.3g}",
}


def write_elan(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a document with the tier ``symbol`` and, below it, tiers with p-values and confidences, in milliseconds."""
    root = Element("ANNOTATION_DOCUMENT", _DOCUMENT, DATE=datetime.now(UTC).isoformat(timespec="seconds"))
    SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    order = SubElement(root, "TIME_ORDER")
    tier = SubElement(root, "TIER", LINGUISTIC_TYPE_REF="symbol", TIER_ID="symbol")
    for k, annotation in enumerate(annotations, 1):
        # Start and end, at least a millisecond apart.
        start, end = (round(1000 * time) for time in annotation.span)
        if start < 0:
            raise DataError(
                f"expected annotations that start after the first sample of {annotation.recording}, got one at "
                f"{start / 1000} s"
            )
        end = max(end, start + 1)
        slots = {f"TIME_SLOT_REF{i}": f"ts{2 * k - 2 + i}" for i in (1, 2)}
        for slot, value in zip(slots.values(), (start, end), strict=True):
            SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(value))
        ids = {"ANNOTATION_ID": f"a{k}"} | slots
        aligned = SubElement(SubElement(tier, "ANNOTATION"), "ALIGNABLE_ANNOTATION", ids)
        symbol = UNKNOWN if annotation.symbol is None else printable(annotation.symbol)
        SubElement(aligned, "ANNOTATION_VALUE").text = symbol
    for number, (name, text) in enumerate(_DEPENDENT.items(), 1):
        below = SubElement(root, "TIER", LINGUISTIC_TYPE_REF="number", PARENT_REF="symbol", TIER_ID=name)
        for k, annotation in enumerate(annotations, 1):
            if (number_text := text(annotation)) == "nan":  # a person named it
                continue
            ids = {"ANNOTATION_ID": f"a{number * len(annotations) + k}", "ANNOTATION_REF": f"a{k}"}
            referring = SubElement(SubElement(below, "ANNOTATION"), "REF_ANNOTATION", ids)
            SubElement(referring, "ANNOTATION_VALUE").text = number_text
    plain = {"GRAPHIC_REFERENCES": "false"}
    SubElement(root, "LINGUISTIC_TYPE", plain, LINGUISTIC_TYPE_ID="symbol", TIME_ALIGNABLE="true")
    by_number = {"CONSTRAINTS": _ASSOCIATION, "LINGUISTIC_TYPE_ID": "number", "TIME_ALIGNABLE": "false"}
    SubElement(root, "LINGUISTIC_TYPE", plain | by_number)
    SubElement(root, "CONSTRAINT", DESCRIPTION=_MEANING, STEREOTYPE=_ASSOCIATION)
    indent(root, " ")
    return write_atomically(path, tostring(root, "UTF-8", xml_declaration=True) + b"\n")


TOPIC = "/kineme/annotations"
_SECOND = 10**9  # ns


def is_bag(source: Path) -> bool:
    """Tell whether it is a bag of ROS, a file or a folder."""
    form = format_at(source)
    return form is not None and form.contents is bag_contents


def write_bag(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a copy of a bag with the topic `TOPIC`: messages of std_msgs/String with JSON, all others byte for byte.

    A message is stamped with the end of its movement. Ends by a clock that the time of recording does not know, such as
    that of a simulation, count from the first sample as the time of recording counts from the first message.
    """
    assert source is not None  # see `writer_of`

    def texts(first: int, last: int) -> list[tuple[int, str]]:
        inside = all(first - _SECOND <= note.end * _SECOND <= last + _SECOND for note in annotations)
        spans = [(note.end, 0) if inside else (note.end - note.origin, first) for note in annotations]
        stamps = [max(0, shift + round(time * _SECOND)) for time, shift in spans]
        return [(stamp, _json(note)) for stamp, note in zip(stamps, annotations, strict=True)]

    with whole_folder(path) if source.is_dir() else whole_file(path) as beside:
        copy_with_topic(source, beside, TOPIC, texts)
    return path


def write_lerobot(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a copy of a data set of LeRobot whose frames name the motions of their episode; in Lance, itself, too.

    Where `path` is the data set itself, and it is stored in Lance, the names are a new version of its frames.
    """
    with needs("pyarrow", "write Parquet", "parquet"):
        from kineme.io.lerobot.copy import copy_in_lance, copy_with_motions, name_in_place
        from kineme.io.lerobot.motions import Motion
    assert source is not None  # see `writer_of`
    motions: dict[int, list[Motion]] = {}
    for note in annotations:
        number = number_at(note.place)
        if number is None:
            raise DataError(f"expected annotations of episodes, got one of {note.place!r}")
        certainty = note.p_value, note.confidence, note.uncertainty
        motion = Motion(number, note.start, note.end, note.symbol, *certainty)
        motions.setdefault(number, []).append(motion)
    if is_in_place(path, [source]):
        name_in_place(source, motions)
        return path
    copy = copy_in_lance if read_info(source).storage == "lance" else copy_with_motions
    with whole_folder(path) as beside:
        copy(source, beside, motions)
    return path


def is_in_place(path: Path, sources: Sequence[Path]) -> bool:
    """Tell whether annotations to write to `path` become a version of the only recording: of a data set in Lance."""
    return (
        len(sources) == 1
        and path.resolve() == sources[0].resolve()
        and is_episodic(sources[0])
        and read_info(sources[0]).storage == "lance"
    )


def copied_as_read(path: Path | None, sources: Sequence[Path], name: str | None = None) -> Callable[[], None]:
    """Return a check that refuses to copy files to `path` that changed since; to be called before they are read.

    It does nothing where nothing is copied, and for data sets in Lance, which have versions.
    """
    copies = path is not None and writer_of(path, name, sources).copies is not None
    has_versions = copies and is_episodic(sources[0]) and read_info(sources[0]).storage == "lance"
    paths = sources[0].rglob("*") if copies and sources[0].is_dir() else sources if copies else ()
    states = {file: _state(file) for file in paths if file.is_file() and not has_versions}

    def check() -> None:
        for file, state in states.items():
            if _state(file) != state:
                raise DataError(
                    f"expected recordings that no program changes meanwhile, {file} was "
                    f"{'changed' if file.exists() else 'removed'} after it was read; nothing was written, run it again "
                    "when the other program is done"
                )

    return check


def _state(file: Path) -> tuple[int, int] | None:
    """Return size [bytes] and time of the last change [ns]; None of a file that is not there."""
    known = file.stat() if file.exists() else None
    return known and (known.st_size, known.st_mtime_ns)


def check_bag(path: Path, source: Path) -> None:
    """Refuse a path where no copy of that bag can be written, before the bag is read."""
    _check_apart(path, source)
    if source.is_dir():
        _check_new_folder(path, source)
    elif path.suffix.lower() != source.suffix.lower():
        raise DataError(
            f"expected a path that ends in {source.suffix} for a copy of {source.name}, got {path.name}; or write a "
            "table: .csv or .json"
        )


def check_lerobot(path: Path, source: Path) -> None:
    """Refuse a path where no copy of that data set can be written, or a data set that is damaged."""
    if is_in_place(path, [source]):
        return
    read_info(source)
    _check_apart(path, source)
    _check_new_folder(path, source)


def _check_apart(path: Path, source: Path) -> None:
    data = source.resolve()
    if path.resolve() == data or data in path.resolve().parents:
        raise DataError(f"expected another path for the copy than the recording {source} or one inside, got {path}")


def _check_new_folder(path: Path, source: Path) -> None:
    """Refuse a folder with files, which is never written over: nobody knows whose they are."""
    if path.suffix.lower() in FORMATS:
        raise DataError(f"expected the name of a folder for a copy of the folder {source}, got {path.name}")
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise DataError(
            f"expected a new folder for the copy of {source}, {path} is there; name another, or remove it: a "
            "folder is never written over, with --force neither"
        )


def _json(annotation: Annotation) -> str:
    row = as_row(annotation)
    del row["recording"]  # the copy is the recording
    lost = {head: None for head, value in row.items() if isinstance(value, float) and not math.isfinite(value)}
    return json.dumps(row | lost, ensure_ascii=False)


class Writer(NamedTuple):
    """A format of annotations."""

    # It takes the path to write, the annotations in order of recordings and time, and the recording that they are of,
    # None where there are several. It writes a whole file or folder or nothing, and returns its path.
    write: Callable[[Path, Sequence[Annotation], Path | None], Path]
    endings: tuple[str, ...]  # endings of paths that ask for it
    several: bool = True  # whether one file holds the annotations of several movements. Else there is a file for each.
    # Whether it writes a copy of a recording, given by its path, with the annotations inside. A path without ending
    # asks for the first writer that says so of the recording.
    copies: Callable[[Path], bool] | None = None
    # It takes the path to write and that recording, and raises a `DataError` if no copy can be written there.
    check: Callable[[Path, Path], None] | None = None
    # It writes the same of the parts of many annotations, of which one is in memory at a time.
    stream: Callable[[Path, Iterable[Sequence[Annotation]]], Path] | None = None


#: Name -> format.
WRITERS: dict[str, Writer] = {
    "csv": Writer(lambda path, notes, _: stream_csv(path, [notes]), (".csv",), stream=stream_csv),
    "json": Writer(lambda path, notes, _: stream_json(path, [notes]), (".json",), stream=stream_json),
    "elan": Writer(write_elan, (".eaf",), several=False),
    "audacity": Writer(write_audacity, (".txt",), several=False),
    "bag": Writer(write_bag, (".bag", ".mcap", ".db3"), copies=is_bag, check=check_bag),
    "lerobot": Writer(write_lerobot, (), copies=is_episodic, check=check_lerobot),
}


def writer_of(path: Path, name: str | None, sources: Sequence[Path]) -> Writer:
    """Return the writer of that name; without a name, by the ending of the path, or by the only recording."""
    if name is not None:
        writer = WRITERS[name]
    else:
        fitting = [writer for writer in WRITERS.values() if _fits(writer, path, sources)]
        if not fitting:
            endings = ", ".join(end for writer in WRITERS.values() for end in writer.endings)
            raise DataError(
                f"expected a path ending in one of {endings}, got {str(path)!r}; or name the format, one of "
                f"{', '.join(WRITERS)}; only one data set of LeRobot, or one bag in a folder, is copied into a folder"
            )
        writer = fitting[0]
    if writer.copies is not None and not (len(sources) == 1 and writer.copies(sources[0])):
        raise DataError(
            f"expected one recording that can be copied with its annotations to {str(path)!r}, got "
            f"{', '.join(map(str, sources))}; write a table: .csv or .json"
        )
    return writer


def _fits(writer: Writer, path: Path, sources: Sequence[Path]) -> bool:
    if path.suffix.lower() in writer.endings:
        return writer.copies is None or len(sources) != 1 or writer.copies(sources[0])
    return not path.suffix and writer.copies is not None and len(sources) == 1 and writer.copies(sources[0])


def targets_of(
    path: Path, sources: Sequence[Path], movements: Sequence[Movement], name: str | None = None
) -> dict[Path, list[Movement]]:
    """Return the files to write, and the movements whose annotations each of them holds.

    The path is a file, or a folder where a format, whose key of `WRITERS` is `name`, holds one movement in a file.
    """
    writer = writer_of(path, name, sources)
    if writer.check is not None:
        writer.check(path, sources[0])
    if writer.several or path.suffix.lower() in writer.endings:
        if len(movements) > 1 and not writer.several:
            raise DataError(
                f"expected one movement to annotate in {path.name}, got {len(movements)}; name a folder, and the format"
            )
        return {path: list(movements)}
    stems = distinct_stems(movements)
    return {path / f"{stem}{writer.endings[0]}": [key] for stem, key in zip(stems, movements, strict=True)}


def write_annotations(
    path: Path,
    annotations: Sequence[Annotation],
    sources: Sequence[Path],
    name: str | None = None,
    movements: Sequence[Movement] | None = None,
) -> list[Path]:
    """Write annotations of recordings, as `targets_of` says, and return what was written; a folder is created."""
    groups: dict[Movement, list[Annotation]] = {key: [] for key in movements or ()}
    for annotation in annotations:
        groups.setdefault((annotation.recording, annotation.place), []).append(annotation)
    targets = targets_of(path, sources, list(groups), name)
    if any(target.parent != path.parent for target in targets):
        path.mkdir(parents=True, exist_ok=True)
    write, source = writer_of(path, name, sources).write, sources[0] if len(sources) == 1 else None
    return [
        write(target, [annotation for key in keys for annotation in groups[key]], source)
        for target, keys in targets.items()
    ]

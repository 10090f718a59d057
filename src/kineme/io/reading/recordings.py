"""Read recorded movements from a folder or a file of any format, see `kineme.io.reading.formats`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from string import Formatter
from typing import Any, NamedTuple

from kineme.errors import DataError, SpecificationError, warn
from kineme.io.limits import max_file_bytes
from kineme.io.reading.formats import Entry, as_text, data_set_of, entries_of, in_words, name_of, root_of
from kineme.io.reading.join_files import Placed, join_files, notes_on_clocks
from kineme.io.reading.merge_files import Recordings, merge_files, notes_on_gaps, notes_on_values
from kineme.io.reading.read_file import FileRead, format_of, read_bytes, read_file
from kineme.io.records import Problem
from kineme.movements.preparation.trim import TrimRest
from kineme.movements.tables.columns import excluded_numbers
from kineme.movements.tables.layout import FILL_GAPS, Column, Known, Layout, listed
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory

#: Fields of a pattern that say something; others only stand for text that differs.
LABEL, PERSON = "label", "person"
_NUMBER = "n"  # of digits only
TASK, FOLDER = "task", "folder"
_EXAMPLE = "{person}_{label}_{n}.csv"

Progress = Callable[[Sequence[Path]], Iterable[Path]]


def read_recordings(  # noqa: PLR0913 - one parameter per question that a table of samples may leave open
    path: str | Path | Sequence[str | Path],
    *,
    time: Column | None = None,
    columns: Column | Sequence[Column] | None = None,
    movement: Column | Sequence[Column] | None = None,
    label: Column | None = None,
    units: str | float | None = None,
    skip: str = "movement",
    kinds: Mapping[str, str] | None = None,
    topic: str | Sequence[str] | None = None,
    frame: str | Sequence[str] | None = None,
    person: Column | None = None,
    label_pattern: str | None = None,
    label_by: str | int | None = None,
    trim: bool = False,
    follow_links: bool = False,
    exclude: Column | Sequence[Column] | None = None,
    fill_gaps: float = FILL_GAPS,
    rows: bool = False,
    every: int | None = None,
    measured_in: str | None = None,
    join_files: bool = False,
    progress: Progress | None = None,
) -> Recordings:
    """Read all movements of a folder, a file, a data set that is a folder, or of several of them.

    In a folder, a movement that carries no label itself has the name of its file's innermost folder; files directly
    in the folder that is read have none. Hidden files are passed over. What cannot be read is listed, the rest is
    read. A file that would take more memory than `kineme.io.limits` allows is not read.

    Parameters
    ----------
    path : str or Path or sequence of them
        A folder, a file of a format in `kineme.io.reading.formats.FORMATS`, or a folder of `DATA_SETS` there.
        A pattern such as ``"optitrack/*.csv"`` stands for what it matches. The names of several are as they are given,
        and what cannot be read among them is listed.
    time, label : str or int, optional
        Columns of a table, by head or counted from 0. By default they are found by their heads.
    columns, movement : str or int or sequence of them, optional
        Columns of the coordinates, and of what tells movements apart. What several heads begin with, before a dot,
        stands for all of them: ``"wrist"`` for ``wrist.x`` and ``wrist.y``; where no head has the name, ``*`` stands
        for any text and ``?`` for any character, in all columns but times: ``"LASI*"``, ``"*_x"``.
    units : {"s", "ms", "us", "ns"} or float, optional
        Unit of the time stamps, or its length in seconds. By default told by the head or by the stamps' size. As a
        number it is also the step between samples of files without time stamps.
    skip : {"movement", "sample"}, default "movement"
        Whether a repeated sample, or one with missing values that are not filled, costs its whole movement or is left
        out alone. Both are reported.
    kinds : mapping, optional
        What columns are, where their heads and values do not say it: ``{"gripper": "discrete", "q1": "angle",
        "a,b,c,d": "xyzw"}``, the last one a quaternion in that order; also ``"position"``; see
        `Demonstrations.channels`. As in `columns`, what several heads begin with stands for all of them.
    topic : str or sequence of str, optional
        Topics of ROS bags; of several, the others are interpolated to the stamps of the first. By default the only
        one that can be read.
    frame : str or sequence of str, optional
        Frames of ROS bags as ``"parent:child"``: the pose of the child in the parent, composed of the transforms.
    person : str or int, optional
        Column of a table that names who showed a movement; another movement begins where it changes. People are in
        `Recordings.people`.
    label_pattern : str, optional
        File names that say the label, who showed the movements, or both: ``"{person}_{label}_{n}.csv"``. Text outside
        the braces is taken literally, ``{n}`` is a number, other fields are passed over, and each takes as little as it
        can. With slashes it is compared with folders too: ``"{person}/{label}_{n}.csv"``. A file that it does not match
        is a problem. People are in `Recordings.people`.
    label_by : {"task", "folder"} or int, optional
        ``"task"``: the label in the recording, as the tasks of LeRobot, and never a folder; ``"folder"``: the innermost
        folder, whatever the file says; a number: the folder so many levels up, 1 for the innermost.
    trim : bool, default False
        Whether the rests before and after each movement are left out, by `TrimRest` with its default tolerance. Rest is
        told by what is learned: a gripper that closes at rest is left out with it.
    follow_links : bool, default False
        Whether links that lead out of the folder are read; else they are problems. Links within it always are read.
    exclude : str or int or sequence of them, optional
        Columns that are left aside, named as in `columns`; files that do not have them are read nevertheless.
    fill_gaps : float, default 0.2
        Longest gap of a column that is filled, from the value before to the value after it [s]; 0 fills none. Values
        are interpolated by Akima's cubic polynomials, orientations by turning evenly, and discrete channels keep the
        value before. At its ends a movement is cropped to where all columns have values, unless that would cost half
        of it. `Source` says of each movement what was filled and cropped.
    rows : bool, default False
        Whether each line of a text file is one movement: a label, then the coordinates of its samples, one sample after
        the other. `columns` names the coordinates of a sample, ``("x", "y")`` where a line goes on x, y, x, y, and
        `label` the column of the label. `units` is the step between samples.
    every : int, optional
        Number of samples of a movement, where a file holds one after the other without a mark between them.
    measured_in : str, optional
        Unit of the coordinates of which the file says none: ``"mm"`` of positions, ``"deg"`` of angles.
    join_files : bool, default False
        Whether the files of a folder that lie on one clock, as those of a phone's sensors, are one recording, see
        `kineme.io.reading.join_files`. Its label is the folder around that of the files.
    progress : callable, optional
        Wraps the list of files, to show how far the reading is.

    Raises
    ------
    DataError
        Nothing there, or nothing in it that can be read, the message gives the first problem; or a column to exclude
        that no file has.
    SpecificationError
        An unknown unit or choice, a gap that is no number of seconds, a label pattern that cannot be understood, or a
        limit of memory that is no number.
    """
    layout = Layout(
        time, columns, movement, label, units, skip, kinds, topic, frame, person,
        exclude=exclude, fill_gaps=fill_gaps, rows=rows, every=every, measured_in=measured_in,
    )  # fmt: skip
    how = HowToRead(layout, NameRule(label_pattern, label_by), follow_links, trim, join_files)
    paths = [Path(path)] if isinstance(path, (str, Path)) else [Path(each) for each in path]
    return read_paths(paths, how, progress=progress)


class HowToRead(NamedTuple):
    """What `read_recordings` is told by its options."""

    layout: Layout
    rule: NameRule
    follow_links: bool = False
    trim: bool = False
    join: bool = False  # whether the files of a folder are one recording


def how_to_read(options: Mapping[str, Any], reference: Known | None = None) -> HowToRead:
    """Return how to read by options, named as those of `read_recordings` or of the shell; None are not given.

    What is not asked for is as in the `reference`, what a library has learned, where a file has it.
    """
    chosen = {name.removesuffix("_column"): value for name, value in options.items()}
    rule = NameRule(chosen.pop("label_pattern", None), chosen.pop("label_by", None))
    switches = [bool(chosen.pop(name, False)) for name in ("follow_links", "trim", "join_files")]
    for name in ("fill_gaps", "rows"):  # libraries store what was given
        if chosen.get(name) is None:
            chosen.pop(name, None)
    chosen["kinds"] = dict(chosen.get("kinds") or ()) or None
    return HowToRead(Layout(**chosen, reference=reference), rule, *switches)


def read_paths(
    paths: Sequence[Path],
    how: HowToRead,
    progress: Progress | None = None,
    standard_input: tuple[str, bytes] | None = None,
) -> Recordings:
    """Read recordings as `read_recordings` does, and the standard input as a file of some name."""
    max_file_bytes()
    layout, rule = how.layout, how.rule
    if rule.label_by is not None and layout.label is not None:
        raise SpecificationError("expected label or label_by, not both")
    if rule.names_person and layout.person is not None:
        raise SpecificationError("expected person, a column, or {person} in label_pattern, not both")
    entries, problems = entries_of(paths, how.follow_links)
    recordings = read_entries(entries, how, progress, standard_input, paths, problems)
    given = [] if standard_input is None else [Path(standard_input[0])]
    check_asked(layout, heads_of(recordings), recordings.people is not None, in_words([*paths, *given]))
    return replace(recordings, notes=(*recordings.notes, *notes_on_values(recordings)))


def read_entries(
    entries: Sequence[Entry],
    how: HowToRead,
    progress: Progress | None = None,
    standard_input: tuple[str, bytes] | None = None,
    where: Sequence[Path] = (),
    problems: Sequence[Problem] = (),
) -> Recordings:
    """Read files and data sets that are listed already; `where` says in messages what was given."""
    layout, rule, follow_links, trim, join = how
    read: list[FileRead] = []
    places = list(where) or [Path(entry.name) for entry in entries]
    if standard_input is not None:
        name, data = Path(standard_input[0]), standard_input[1]
        read.append(rule.apply(read_bytes(data, name, layout), name))
        places.append(name)
    by_path = {entry.path: entry for entry in entries}
    parts = layout
    if join:  # their columns are chosen when they are side by side
        reference = layout.reference and replace(layout.reference, columns=())
        parts = replace(layout, columns=None, exclude=None, reference=reference)

    def placed(path: Path, layout: Layout) -> Placed:
        entry = by_path[path]
        relative = Path(entry.relative.name) if rule.label_by == TASK else entry.relative
        read = read_file(path, relative, layout, follow_links)
        return read.renamed(entry.name), entry._replace(relative=relative)

    files = [placed(path, parts) for path in (by_path if progress is None else progress(list(by_path)))]
    notes = () if join else notes_on_clocks(files)
    if join:
        joined = join_files(files, layout)
        beside = {entry.path for _, entry in joined} - {*by_path}  # folders that are one recording
        alone = {entry.path for _, entry in joined if entry.path in by_path and entry.path.parent not in beside}
        files = [
            placed(entry.path, layout) if parts != layout and entry.path in alone else (file, entry)
            for file, entry in joined
        ]
    read += [rule.apply(file, entry.path) for file, entry in files]
    recordings = merge_files(read, in_words(places), layout, problems)
    recordings = replace(recordings, notes=(*recordings.notes, *notes))
    return trimmed(recordings) if trim else recordings


Heads = tuple[tuple[str, ...], tuple[str, ...]]  # columns that are left aside, and those that are read


def heads_of(recordings: Recordings) -> list[Heads]:
    """Return the heads of the columns of files."""
    return [(how.ignored, how.columns) for how, _ in recordings.detected]


def check_asked(layout: Layout, heads: Sequence[Heads], has_people: bool, where: str) -> None:
    """Refuse a column to exclude, or one of people, that no file at `where` has: it is most likely misspelled."""
    aside, read = (sorted({name for file in heads for name in file[k]}) for k in (0, 1))
    for column in layout.excluded:
        if not isinstance(column, int) and not column.isdecimal() and not excluded_numbers(aside, [column]):
            raise DataError(f"expected columns like {column!r} to exclude, got none but {listed(read)}")
    if layout.person is not None and not has_people:
        raise DataError(
            f"expected a column {layout.person!r} of a table that names people, found none in {where}; "
            "say who showed them with label_pattern=, in the shell also with --by-person or --person"
        )


def trimmed(recordings: Recordings) -> Recordings:
    """Return recordings without the rests at both ends of each movement, see `TrimRest`."""
    moving = TrimRest().apply(recordings.demonstrations)
    return replace(recordings, demonstrations=Demonstrations.of_movements(moving))


def read_recording(path: str | Path) -> Trajectory:
    """Read a file that holds one movement, in any format of `kineme.io.reading.formats.FORMATS`.

    Raises `DataError`: the file is not what its name says, or holds several movements; the message names the line.
    Raises `FileNotFoundError`: there is no such file. Raises `TrajectoryError`: the numbers are no movement, see
    `Trajectory`.
    """
    path = Path(path)
    if data_set_of(path) is None:
        format_of(path)
    path.stat()
    layout = Layout()
    read = read_file(path, name_of(path), layout)
    for problem in read.problems:
        raise problem.error(str(problem._replace(file=str(path))))
    recordings = merge_files([read], str(path), layout)
    for problem in recordings.problems:
        raise problem.error(str(problem._replace(file=str(path))))
    if len(recordings) > 1:
        raise DataError(f"expected one movement in {path}, got {len(recordings)}; read them with read_recordings")
    for note in notes_on_gaps(recordings) + notes_on_values(recordings):
        warn(f"{path}: {note}", UserWarning, 2)
    named = replace(recordings.demonstrations.movements, names=(str(name_of(path)),), labels=None)
    return Demonstrations.of_movements(named)[0]


def paths_of(paths: Sequence[Path], recordings: Recordings) -> list[Path]:
    """List files and data sets that recordings were read from at these paths; none for the standard input."""
    root = root_of(*(path for path in paths if str(path) != "-"))
    return [root / name for name in dict.fromkeys(source.path for source in recordings.sources)]


class Part(NamedTuple):
    """Text that stands as it is, and the field behind it, or None at the end."""

    text: str
    field: str | None


@dataclass(frozen=True)
class NameRule:
    """The origin of labels, if not the recording or its innermost folder."""

    label_pattern: str | None = None  # both as in `read_recordings`
    label_by: str | int | None = None

    def __post_init__(self) -> None:
        by, fields = self.label_by, {part.field for part in self.parts}
        is_level = isinstance(by, int) and not isinstance(by, bool) and by >= 1
        if not (by is None or by in {TASK, FOLDER} or is_level):
            raise SpecificationError(f"expected label_by to be 'task', 'folder' or a level from 1, got {by!r}")
        if self.label_pattern is not None and not fields & {LABEL, PERSON}:
            raise self._not_understood("it has neither {label} nor {person}")
        if by is not None and LABEL in fields:
            raise SpecificationError("expected label_by or {label} in label_pattern, not both")

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The pattern, cut at its fields."""
        try:
            cut = list(Formatter().parse(self.label_pattern or ""))
        except ValueError as error:
            raise self._not_understood(str(error)) from error
        named = [name for _, name, _, _ in cut if name is not None]
        if any(spec or conversion or not (name or "a").isidentifier() for _, name, spec, conversion in cut):
            raise self._not_understood("a field is a word in braces")
        if "" in named or len(set(named)) < len(named):
            raise self._not_understood("each field has a name of its own")
        merged = [Part("", None)]
        for text, name, _, _ in cut:  # doubled braces end a part without a field
            before = merged.pop() if merged[-1].field is None else Part("", None)
            merged += [Part(before.text + text, name), Part("", None)][: 1 if name is None else 2]
        if any(not part.text for part in merged[1:-1]):
            raise self._not_understood("there is no text between two fields")
        return tuple(merged)

    @property
    def names_person(self) -> bool:
        """True if the pattern says who showed the movements."""
        return PERSON in {part.field for part in self.parts}

    def apply(self, read: FileRead, path: Path) -> FileRead:
        """Return a file with the labels that its path says; one that the pattern does not match is a problem."""
        if not read.block.labels:
            return read
        by_folder, person = self.label_by not in {None, TASK}, None
        label = _folder(path, 1 if self.label_by == FOLDER else int(self.label_by or 1)) if by_folder else None
        if self.label_pattern is not None:
            depth = self.label_pattern.count("/") + 1
            name = "/".join(_parts(path, depth)[-depth:])
            fields = match(self.parts, name)
            if fields is None:
                return read.without_movements(
                    f"expected a name like {self.label_pattern}, as the label pattern says, got {name}"
                )
            label, person = fields.get(LABEL, label), fields.get(PERSON)
        if label is None and not by_folder:
            return read._replace(person=person)
        block = replace(read.block, labels=[label] * len(read.block.labels))
        return read._replace(block=block, person=person)

    def _not_understood(self, why: str) -> SpecificationError:
        return SpecificationError(
            f"expected a file name with fields in braces as label_pattern, such as {_EXAMPLE}, got "
            f"{self.label_pattern!r}; {why}"
        )


def match(parts: tuple[Part, ...], name: str) -> dict[str, str] | None:
    """Return the text of each field, none of them empty or with a slash; None if the name is not like the pattern."""

    @cache  # so that no name takes more than the square of its length
    def fields(k: int, start: int) -> tuple[str, ...] | None:
        text, field = parts[k]
        if not name.startswith(text, start):
            return None
        start += len(text)
        if field is None:
            return () if start == len(name) else None
        for end in range(start + 1, len(name) + 1):
            last = name[end - 1]
            if last == "/" or (field == _NUMBER and not last.isdecimal()):
                return None
            more = fields(k + 1, end)
            if more is not None:
                return (name[start:end], *more)
        return None

    values = fields(0, 0)
    return None if values is None else dict(zip([part.field for part in parts if part.field], values, strict=True))


def _folder(path: Path, up: int) -> str | None:
    """Return the name of the folder so many levels up, or None above the topmost."""
    names = _parts(path, up + 1)
    return names[-1 - up] if len(names) > up else None


def _parts(path: Path, n: int) -> list[str]:
    """Return the names of a path; of as much of the whole path as has n of them."""
    parts = [part for part in path.parts if part not in {path.anchor, ".", ".."}]
    if len(parts) < n or ".." in path.parts:
        absolute = Path(os.path.abspath(path))
        parts = [part for part in absolute.parts if part != absolute.anchor]
    return [as_text(part) for part in parts]

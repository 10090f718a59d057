"""Read recordings for a command: the options for the columns, and the standard input."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from kineme.cli.options import READING, SPECIFICATION, Finite, Parsed, given_options, opened, under
from kineme.cli.output import progress, write
from kineme.reporting.text import first_names, printable

_some = partial(first_names, most=6)  # columns that a sentence names
STANDARD_INPUT = "standard input.csv"


class Recording(click.Path):
    """A file, a folder or a pattern of them; of commands that work in pieces, the URI of an archive, too."""

    def __init__(self, allow_dash: bool = True) -> None:
        super().__init__(allow_dash=allow_dash, path_type=Path)

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """The path; of an empty text none, since it would mean the current folder. A URI stays a text."""
        if str(value) == "":
            self.fail("expected a file or a folder, got an empty name; the current folder is .", param, ctx)
        if "://" in str(value) and not Path(value).exists():  # a path would lose a slash
            if not any(option.name == "shard" for option in ctx.command.params):
                self.fail(f"expected a file or folder of this machine, got {value}; copy it first", param, ctx)
            return str(value)
        return super().convert(value, param, ctx)


def _unit(text: str) -> str | float:
    """The name of a unit of time, or its length in seconds."""
    try:
        return float(text)
    except ValueError:
        return text


def _level(text: str) -> str | int:
    if text in {"task", "folder"}:
        return text
    if not text.isdecimal() or int(text) < 1:
        raise ValueError(f"expected task, folder or a level from 1, the innermost, got {text!r}")
    return int(text)


def _heads(text: str) -> tuple[str, ...]:
    """Columns separated by commas, as heads or as numbers counted from 0; a head with a comma stands in quotes."""
    return tuple(part.strip() for row in csv.reader([text], skipinitialspace=True) for part in row or [""])


def _kind(text: str) -> tuple[str, str]:
    """Columns and their kind, as ``gripper=discrete`` or ``a,b,c,d=xyzw``."""
    columns, mark, kind = text.rpartition("=")
    if not mark or not columns:
        raise ValueError(f"expected columns and their kind, as gripper=discrete, got {text!r}")
    return columns.strip(), kind.strip()


_HEADS, _UNIT = Parsed("a,b,...", _heads), Parsed("s|ms|us|ns|SECONDS", _unit)


def _or_none(ctx: Any, param: Any, value: tuple[Any, ...]) -> tuple[Any, ...] | None:
    """None where an option is not given: libraries store those that are."""
    return value or None


#: Add the options for what is read of a file; by default that is detected. They stand in the help of `kineme inspect`.
layout_options = under(
    READING,
    click.option("--time", metavar="COLUMN", help="Column of the time stamps."),
    click.option(
        "--columns", type=_HEADS, help="Columns of the coordinates; * and ? stand for any text and any character.",
    ),
    click.option("--exclude", type=_HEADS, help="Columns that are left aside, named as for --columns."),
    click.option("--movement", type=_HEADS, help="Columns that distinguish the movements of a table."),
    click.option("--label-column", metavar="COLUMN", help="Column of the labels."),
    click.option("--person-column", metavar="COLUMN", help="Column of who showed the movements of a table."),
    click.option("--units", type=_UNIT, help="Unit of the time stamps, by name or in seconds."),
    click.option("--measured-in", metavar="UNIT", help="Unit where files say none: mm of positions, deg of angles."),
    click.option(
        "--skip", type=click.Choice(["movement", "sample"]), default="movement", show_default=True,
        help="What is dropped for a repeated sample, or for missing values that are not filled.",
    ),
    click.option(
        "--fill-gaps", type=Finite(0), metavar="SECONDS",
        help="Longest gap of a column that is filled, 0 for none.  [default: 0.2]",
    ),
    click.option(
        "--kind", "kinds", type=Parsed("COLUMNS=KIND", _kind), multiple=True, callback=_or_none,
        help="What columns are: position, angle, discrete; of four, wxyz or xyzw, a quaternion. May be repeated.",
    ),
    click.option("--topic", multiple=True, callback=_or_none, help="Topic of a ROS bag; several are put side by side."),
    click.option(
        "--frame", multiple=True, callback=_or_none, metavar="PARENT:CHILD",
        help="Pose of one frame of a ROS bag in another.",
    ),
    click.option(
        "--label-pattern", metavar="PATTERN",
        help="File names that say label and person, as {person}_{label}_{n}.csv; {n} is a number.",
    ),
    click.option(
        "--label-by", type=Parsed("task|folder|LEVEL", _level),
        help="Label by the task of LeRobot, by the innermost folder, or by the folder so many levels up.",
    ),
    click.option(
        "--rows", is_flag=True, default=None,
        help="Each line of a text file is a movement: a label, then x, y, x, y, ... with --columns x,y.",
    ),
    click.option(
        "--every", type=click.IntRange(4), metavar="SAMPLES",
        help="Samples of a movement, where a file holds one after the other.",
    ),
    click.option(
        "--join-files", is_flag=True, default=None,
        help="The files of a folder that lie on one clock, as a phone's sensors, are one recording.",
    ),
    click.option("--follow-links", is_flag=True, help="Also read links that lead out of the folder."),
    click.option("--trim", is_flag=True, help="Leave out the rests before and after each movement."),
)  # fmt: skip

#: Names of the parameters that `layout_options` adds.
LAYOUT_OPTIONS: tuple[str, ...] = tuple(one.name for one in click.command()(layout_options(lambda: None)).params)


def recordings_argument(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the argument RECORDINGS: one or more files, folders and patterns of them."""
    return click.argument("recordings", nargs=-1, required=True, type=Recording())(command)


def read(paths: Path | Sequence[Path], options: dict[str, Any], library: Any = None) -> Any:
    """Read recordings from files, folders, patterns of them, and - the standard input, with the `layout_options`."""
    from kineme.io.limits import read_limited
    from kineme.io.reading.recordings import read_paths

    several = [paths] if isinstance(paths, Path) else list(paths)
    files = [path for path in several if str(path) != "-"]
    given = None if len(files) == len(several) else (STANDARD_INPUT, read_limited(sys.stdin.buffer))
    reading = partial(progress, desc="reading", unit="file")
    return read_paths(files, _how(options, library), reading, given)


def pieces(paths: Sequence[Path], options: dict[str, Any], library: Any, places: Any = None) -> Any:
    """Read recordings piece by piece: all at once, unless all are data sets that are read some episodes at a time."""
    if _data_sets(paths) is None:
        yield read(paths, options, library)
        return
    yield from files_of(paths, options, library, places)


def files_of(paths: Sequence[Path], options: dict[str, Any], library: Any, places: Any = None) -> Any:
    """Read recordings file by file, data sets some episodes at a time; what cannot be read is a problem among them.

    Files that are joined are read all at once.
    """
    from kineme.io.reading.pieces import read_pieces

    if any(str(path) == "-" for path in paths):
        raise click.UsageError("expected files or folders to search, got the standard input")
    if options.get("join_files") and _data_sets(paths) is None:  # files of a folder are one recording
        return iter([read(paths, options, library)])
    return read_pieces(paths, _how(options, library), places)


def seconds_of(paths: Sequence[Path]) -> float | None:
    """The declared length of data sets that are read some episodes at a time; None of other recordings."""
    from kineme.io.lerobot.info import read_episodes, read_info

    folders = _data_sets(paths)
    if folders is None:
        return None
    infos = [(folder, read_info(folder)) for folder in folders]
    return sum(float(read_episodes(folder, info).lengths.sum()) / info.fps for folder, info in infos)


def _data_sets(paths: Sequence[Path]) -> list[Path] | None:
    """The data sets that are read some episodes at a time; None where other recordings are among the paths."""
    from kineme.io.reading.formats import expanded
    from kineme.io.reading.pieces import is_episodic

    folders = [path for given in paths for path in expanded(given)]
    return folders if all(map(is_episodic, folders)) else None


def _how(options: dict[str, Any], library: Any) -> Any:
    """What the `layout_options` say, with what the library has learned."""
    from kineme.io.reading.recordings import how_to_read

    reference = None
    if library is not None:
        from kineme.library.storage.source import known_sources

        reference = known_sources(library.store)
    return how_to_read(options, reference)


def notes_beside(parsed: Any, options: dict[str, Any], learned: Any) -> list[str]:
    """A sentence for each thing to know of recordings beside those of a library, whose channels are `learned`."""
    from kineme.io.reading.merge_files import notes_on_gaps
    from kineme.movements.channels.channel import recorded_names
    from kineme.movements.tables.layout import AS_KNOWN

    sentences = [
        f"Read {how.layout.removesuffix(AS_KNOWN)}, as the movements of the library; say --topic or --frame for others"
        for how in dict(parsed.detected)
        if how.layout.endswith(AS_KNOWN)
    ]
    columns = None if options["columns"] or learned is None else recorded_names(learned)
    aside = sorted(
        {name for detected in dict(parsed.detected) if detected.columns == columns for name in detected.ignored if name}
    )
    if aside:
        sentences.append(
            f"Read the columns of the library alone, {_some(columns or ())}, without {_some(aside)}; say --columns for "
            "others"
        )
    sentences += notes_on_gaps(parsed) + _differences(learned, parsed.demonstrations.channels)
    return [*sentences, *parsed.notes]


def problem_lines(problems: Any, lost: str = "not read: ") -> list[str]:
    """A line for each problem: what was lost, or that samples alone were."""
    return [f"{'read but for samples: ' if problem.samples else lost}{printable(problem)}" for problem in problems]


def read_source(options: dict[str, Any]) -> Any:
    """The primitive of a symbol, a recording or a file, with the recording that it is of."""
    source = options["source"]
    if _is_symbol(source, options["folder"]):
        if given := given_options((*LAYOUT_OPTIONS, *SPECIFICATION, "index")):
            raise click.UsageError(
                f"expected {given[0]} with a recording, got it with {printable(source)}, a symbol of a library: its "
                f"columns and primitives are those that it was learned with; say {given[0]} to kineme learn"
            )
        from kineme.library.grounding import learned_of

        with opened(options["folder"]) as library:
            if source not in library and Path(source).is_file():
                raise click.UsageError(
                    f"expected a symbol of the library with --library, got {printable(source)}, a file; leave "
                    "--library out for a recording or a saved primitive"
                )
            return learned_of(library.store, source)
    from kineme.dmp.discrete.dmp import DMP
    from kineme.dmp.generation.generate import SAVED, Learned, learn_one, load_saved

    if source != "-" and not Path(source).exists():
        raise FileNotFoundError(
            f"expected a recording or a saved primitive, found no file {printable(source)}; "
            "for a symbol, name its --library"
        )
    if Path(source).suffix.lower() == SAVED:
        return Learned(_chosen(load_saved(Path(source)), options))
    dmp = DMP(**{name: options[name] for name in SPECIFICATION})
    recordings = read(Path(source), {name: options[name] for name in LAYOUT_OPTIONS})
    for note in recordings.notes:
        write(f"note: {printable(note)}", err=True)
    return learn_one(_chosen(recordings, options), dmp)


def name_of_source(options: dict[str, Any]) -> str:
    """The name of the symbol, or that of the file without its ending."""
    source = options["source"]
    if not _is_symbol(source, options["folder"]):
        return Path(source).stem
    with opened(options["folder"]) as library:
        return next((symbol.name for symbol in library.symbols() if symbol.id == source), str(source))


def _chosen(several: Any, options: dict[str, Any]) -> Any:
    """The one that is asked for by --index, or the only one."""
    n, index = len(several), options["index"]
    if index is None and n > 1:
        raise click.UsageError(f"expected one movement, {printable(options['source'])} holds {n}; choose with --index")
    if index is not None and index >= n:
        raise click.BadParameter(f"{printable(options['source'])} holds {n}, counted from 0", param_hint="--index")
    return several[index or 0]


def _is_symbol(source: str, folder: Any) -> bool:
    """Tell whether SOURCE is a symbol: with --library always; with one from the environment, unless a file exists."""
    given = click.get_current_context().get_parameter_source("folder")
    return folder is not None and (given != ParameterSource.ENVIRONMENT or not Path(source).exists())


def _differences(learned: Any, asked: Any) -> list[str]:
    """A sentence for each way in which recordings have other names or units than the library; kinds are alike."""
    from kineme.movements.channels import detect

    def name_of(channel: Any) -> str:
        return detect.name_of(channel.name).lower()

    if learned is None or not any(channel.coordinates for channel in learned):
        return []
    if asked is None:
        return [
            "The recordings do not agree in the names of their columns, which are taken in their order as those of the "
            f"library: {_some([channel.name for channel in learned])}"
        ]
    moving = [[channel for channel in channels if channel.coordinates] for channels in (asked, learned)]
    by_name = {name_of(channel): channel for channel in moving[0]}
    if all(name_of(channel) in by_name for channel in moving[1]):
        moving[0] = [by_name[name_of(channel)] for channel in moving[1]]
    pairs = list(zip(*moving, strict=False))
    sentences = []
    if other := [pair for pair in pairs if name_of(pair[0]) != name_of(pair[1])]:
        here, there = (_some([pair[k].name for pair in other]) for k in (0, 1))
        sentences.append(f"Columns are compared in their order: {here} of the recordings with {there} of the library")
    if units := [pair for pair in pairs if None not in (pair[0].unit, pair[1].unit) and pair[0].unit != pair[1].unit]:
        here, there = (_some([f"{pair[k].name} in {pair[k].unit}" for pair in units]) for k in (0, 1))
        sentences.append(f"Units are converted: {here} in the recordings, {there} in the library")
    if silent := [pair[0].name for pair in pairs if pair[0].unit is None and pair[1].unit is not None]:
        sentences.append(
            f"The recordings do not say the unit of {_some(silent)}, which is taken for that of the library"
        )
    return sentences

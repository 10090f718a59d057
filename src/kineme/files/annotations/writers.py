"""The table of writers of annotations, and which of them writes to a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError
from kineme.files.annotations.annotation import Annotation
from kineme.files.annotations.audacity import write_audacity
from kineme.files.annotations.copies import check_bag, check_lerobot, is_bag, is_lerobot, write_bag, write_lerobot
from kineme.files.annotations.elan import write_elan
from kineme.files.annotations.tables import write_csv, write_json
from kineme.files.file_names import Movement, distinct_stems

#: It takes the path to write, the annotations in order of recordings and time, and the recording that they are of as
#: the user named it, None where there are several. It writes a whole file or folder or nothing, and returns its path.
Write = Callable[[Path, Sequence[Annotation], Path | None], Path]


class Writer(NamedTuple):
    """A format of annotations.

    Attributes
    ----------
    write : callable
        See `Write`.
    endings : tuple of str
        Endings of paths that ask for it.
    several : bool
        Whether one file holds the annotations of several movements. Else there is a file for each.
    copies : callable, optional
        Whether it writes a copy of a recording, given by its path, with the annotations inside. A path without ending
        asks for the first writer that says so of the recording.
    check : callable, optional
        It takes the path to write and that recording, and raises a `DataError` if no copy can be written there.
    """

    write: Write
    endings: tuple[str, ...]
    several: bool = True
    copies: Callable[[Path], bool] | None = None
    check: Callable[[Path, Path], None] | None = None


#: Name -> format.
WRITERS: dict[str, Writer] = {
    "csv": Writer(write_csv, (".csv",)),
    "json": Writer(write_json, (".json",)),
    "elan": Writer(write_elan, (".eaf",), several=False),
    "audacity": Writer(write_audacity, (".txt",), several=False),
    "bag": Writer(write_bag, (".bag", ".mcap", ".db3"), copies=is_bag, check=check_bag),
    "lerobot": Writer(write_lerobot, (), copies=is_lerobot, check=check_lerobot),
}


def writer_of(path: Path, name: str | None, sources: Sequence[Path]) -> Writer:
    """The writer of that name; without a name, by the ending of the path, or by the only recording.

    Raises
    ------
    DataError
        Nothing says what to write, or a copy of several recordings is asked for.
    """
    if name is not None:
        found = WRITERS[name]
    else:
        fitting = [one for one in WRITERS.values() if _fits(one, path, sources)]
        if not fitting:
            endings = ", ".join(end for one in WRITERS.values() for end in one.endings)
            raise DataError(
                f"expected a path ending in one of {endings}, got {str(path)!r}; or name the format, one of "
                f"{', '.join(WRITERS)}"
            )
        found = fitting[0]
    if found.copies is not None and not (len(sources) == 1 and found.copies(sources[0])):
        raise DataError(
            f"expected one recording that can be copied with its annotations to {str(path)!r}, got "
            f"{', '.join(map(str, sources))}; write a table: .csv or .json"
        )
    return found


def _fits(writer: Writer, path: Path, sources: Sequence[Path]) -> bool:
    if path.suffix.lower() in writer.endings:
        return writer.copies is None or len(sources) != 1 or writer.copies(sources[0])
    return not path.suffix and writer.copies is not None and len(sources) == 1 and writer.copies(sources[0])


def targets_of(
    path: Path, sources: Sequence[Path], movements: Sequence[Movement], name: str | None = None
) -> dict[Path, list[Movement]]:
    """The files to write, and the movements whose annotations each of them holds.

    Parameters
    ----------
    path : Path
        A file; a folder where a format holds one movement in a file, and the format is named.
    sources : sequence of Path
        The recordings, as the user named them.
    movements : sequence of Movement
        All movements that are annotated.
    name : str, optional
        Key of `WRITERS`.

    Raises
    ------
    DataError
        See `writer_of`; several movements for one file of a format that holds one.
    """
    writer = writer_of(path, name, sources)
    if writer.check is not None:
        writer.check(path, sources[0])
    if writer.several:
        return {path: list(movements)}
    if path.suffix.lower() in writer.endings:
        if len(movements) > 1:
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
    """Write annotations of recordings in the format that the name, the ending or the recording asks for.

    `path`, `sources`, `movements` and `name` are those of `targets_of`; by default the movements are those that have
    annotations. A folder is created where there is a file for each movement.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    DataError
        See `targets_of`.
    OSError
        A file that cannot be written.
    """
    groups: dict[Movement, list[Annotation]] = {key: [] for key in movements or ()}
    for one in annotations:
        groups.setdefault((one.recording, one.place), []).append(one)
    targets = targets_of(path, sources, list(groups), name)
    if any(target.parent != path.parent for target in targets):
        path.mkdir(parents=True, exist_ok=True)
    write, source = writer_of(path, name, sources).write, sources[0] if len(sources) == 1 else None
    return [write(target, [one for key in keys for one in groups[key]], source) for target, keys in targets.items()]

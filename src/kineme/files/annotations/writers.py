"""The table of writers of annotations, and which of them writes to a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError
from kineme.files.annotations.annotation import Annotation
from kineme.files.annotations.audacity import write_audacity
from kineme.files.annotations.elan import write_elan
from kineme.files.annotations.tables import write_csv, write_json

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
    """

    write: Write
    endings: tuple[str, ...]
    several: bool = True
    copies: Callable[[Path], bool] | None = None


#: Name -> format.
WRITERS: dict[str, Writer] = {
    "csv": Writer(write_csv, (".csv",)),
    "json": Writer(write_json, (".json",)),
    "elan": Writer(write_elan, (".eaf",), several=False),
    "audacity": Writer(write_audacity, (".txt",), several=False),
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


def write_annotations(
    path: Path, annotations: Sequence[Annotation], sources: Sequence[Path], name: str | None = None
) -> list[Path]:
    """Write annotations of recordings in the format that the name, the ending or the recording asks for.

    Parameters
    ----------
    path : Path
        A file; a folder, which is created, where there is a file for each movement.
    annotations : sequence of Annotation
    sources : sequence of Path
        The recordings, as the user named them.
    name : str, optional
        Key of `WRITERS`.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    DataError
        See `writer_of`; several movements for one file of a format that holds one.
    OSError
        A file that cannot be written.
    """
    writer = writer_of(path, name, sources)
    if writer.several:
        return [writer.write(path, annotations, sources[0] if len(sources) == 1 else None)]
    groups = by_movement(annotations)
    if path.suffix.lower() in writer.endings:
        if len(groups) > 1:
            raise DataError(
                f"expected annotations of one movement for {path.name}, got those of {len(groups)}; name a folder, and "
                "the format"
            )
        return [writer.write(path, annotations, sources[0])]
    path.mkdir(parents=True, exist_ok=True)
    return [writer.write(file, groups[key], None) for key, file in files_of(path, list(groups), writer).items()]


def by_movement(annotations: Sequence[Annotation]) -> dict[tuple[str, str], list[Annotation]]:
    """The annotations of each movement, by recording and place."""
    groups: dict[tuple[str, str], list[Annotation]] = {}
    for one in annotations:
        groups.setdefault((one.recording, one.place), []).append(one)
    return groups


def files_of(folder: Path, keys: Sequence[tuple[str, str]], writer: Writer) -> dict[tuple[str, str], Path]:
    """A file of its own for each movement, named like ``long.eaf``, ``session-3.eaf``."""
    files: dict[tuple[str, str], Path] = {}
    taken: set[str] = set()
    for recording, place in keys:
        stem = "-".join(filter(None, (*Path(recording).with_suffix("").parts, place)))
        stem = "".join(mark if mark.isalnum() or mark in "-_." else "_" for mark in stem).strip(".") or "recording"
        name, k = stem, 1
        while name.lower() in taken:
            k += 1
            name = f"{stem}-{k}"
        taken.add(name.lower())
        files[recording, place] = folder / f"{name}{writer.endings[0]}"
    return files

"""The tables of formats, file extension -> reader, and of folders that are one data set; and the files to read."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from glob import glob, has_magic
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError
from kineme.io.arrays.arrays import POSITIONS, arrays_movements, has_known_names
from kineme.io.arrays.bodies import body_movements
from kineme.io.arrays.json_trees import json_lines_movements, json_messages, json_movements
from kineme.io.arrays.matlab import mat_movements
from kineme.io.arrays.npz import Npz, array_of_npy
from kineme.io.arrays.robot_sets import ENDS, hdf5_or_robot_movements, zarr_movements
from kineme.io.arrays.rows import row_movements, series_movements
from kineme.io.arrays.tree_movements import nested, tree_movements
from kineme.io.arrays.zarr_arrays import FORMAT_3
from kineme.io.lerobot.info import MARKER
from kineme.io.motion_capture.readers import read_bvh_table, read_c3d_table, read_mvnx_table
from kineme.io.records import Contents, Problem, needs
from kineme.io.ros.bags import check_records
from kineme.io.ros.choose import bag_contents
from kineme.io.ros.read_bag import read_bag
from kineme.io.tables.text_table import read_text_table
from kineme.movements.tables.columns import Roles
from kineme.movements.tables.layout import Layout, Parsed
from kineme.movements.tables.table import Table, table_movements
from kineme.reporting.text import first_names

OUTSIDE = "a link that leads out of the folder; to read it, say follow_links=True, in the shell --follow-links"

_NAMED = 3  # paths that a message names


class Format(NamedTuple):
    """The reader of a format: of the bytes of a file, or of its path, never both."""

    read_bytes: Callable[[bytes, Layout], Parsed] | None = None
    # Keeps only what it returns, so that files may be larger than the memory; it alone checks the limits of memory.
    read_path: Callable[[Path, Layout], Parsed] | None = None
    label_is_stem: bool = False  # whether the name of the file is the label of its movements
    # What a file holds besides what is read of it, for formats that hold more than one recording.
    contents: Callable[[Path], list[Contents]] | None = None
    has_lines: bool = False  # whether it is text, of which each line may be a movement


class DataSet(NamedTuple):
    """A folder that is one source: its files have a meaning only together."""

    marker: str  # path of the file that makes a folder such a data set
    # Patterns of file names in the folder, one of which must be there too; empty if the marker is enough.
    beside: tuple[str, ...]
    parts: tuple[str, ...]  # patterns of the files that are read; their bytes identify the source
    format: Format  # it reads the path of the folder
    says: bytes = b""  # what is among the first bytes of the marker, where other programs write files of that name

    def files(self, folder: Path) -> list[Path]:
        """Return the files that are read, sorted; hidden ones are passed over."""
        paths = {path for pattern in (self.marker, *self.parts) for path in folder.glob(pattern) if path.is_file()}
        relative = sorted(path.relative_to(folder) for path in paths)
        return [folder / path for path in relative if not any(part.startswith(".") for part in path.parts)]


def _read_text(data: bytes, layout: Layout) -> Parsed:
    if layout.rows:
        return row_movements(data, layout)
    return table_movements(*read_text_table(data, layout), layout, "CSV")


def _of_tables(read: Callable[[bytes, Layout], tuple[Table, Roles]], kind: str) -> Callable[[bytes, Layout], Parsed]:
    return lambda data, layout: table_movements(*read(data, layout), layout, kind)


def read_parquet(data: bytes | Path, layout: Layout, part: range | None = None) -> Parsed:
    """Read a file of Parquet, or of a path the movements that begin in some groups of its rows."""
    with needs("pyarrow", "read Parquet", "parquet"):
        from kineme.io.tables.parquet import read_parquet_table
    return table_movements(*read_parquet_table(data, layout, part), layout, "Parquet")


def _read_lerobot(folder: Path, layout: Layout) -> Parsed:
    with needs("pyarrow", "read Parquet", "parquet"):
        from kineme.io.lerobot.read import lerobot_movements
    return lerobot_movements(folder, layout)


def _read_npz(data: bytes, layout: Layout) -> Parsed:
    arrays = Npz(data, Path("it"))
    if (parsed := body_movements(arrays, layout, "NPZ")) is not None:
        return parsed
    if has_known_names(arrays):
        return arrays_movements(arrays, layout, "NPZ")
    return tree_movements(nested(arrays), layout, "NPZ")


def _read_npy(data: bytes, layout: Layout) -> Parsed:
    array = array_of_npy(data, Path("it"))
    if array.dtype.names:  # a table, as of pandas' to_records
        return tree_movements({name: array[name] for name in array.dtype.names}, layout, "NPY")
    return arrays_movements({POSITIONS[0]: array}, layout, "NPY")


def _read_mcap(path: Path, layout: Layout) -> Parsed:
    return read_bag(path, layout) if check_records(path) == b"ros2" else json_messages(path, layout)


_BAG = Format(read_path=read_bag, contents=bag_contents)

#: File ending -> format. A reader raises a `DataError` or any `ValueError`, `KeyError` or `TypeError`.
FORMATS: dict[str, Format] = {
    ".csv": Format(_read_text, has_lines=True),
    ".tsv": Format(_read_text, has_lines=True),
    ".txt": Format(_read_text, has_lines=True),
    ".npz": Format(_read_npz),
    ".json": Format(json_movements),
    ".jsonl": Format(json_lines_movements),
    ".ndjson": Format(json_lines_movements),
    ".npy": Format(_read_npy),
    ".parquet": Format(read_parquet),
    ".mat": Format(mat_movements, label_is_stem=True),
    ".h5": Format(read_path=hdf5_or_robot_movements),
    ".hdf5": Format(read_path=hdf5_or_robot_movements),
    ".zip": Format(read_path=zarr_movements),
    ".ts": Format(series_movements, has_lines=True),
    ".bvh": Format(_of_tables(read_bvh_table, "BVH")),
    ".c3d": Format(_of_tables(read_c3d_table, "C3D")),
    ".trc": Format(_read_text),
    ".mot": Format(_read_text),
    ".sto": Format(_read_text),
    ".mvnx": Format(_of_tables(read_mvnx_table, "MVNX")),
    ".bag": _BAG,
    ".db3": _BAG,
    ".mcap": Format(read_path=_read_mcap, contents=bag_contents),
}

_HEAD = 4096  # bytes of a marker that are read to know it

#: Folders that are one source.
DATA_SETS: tuple[DataSet, ...] = (
    DataSet(
        MARKER,
        ("data", "frames.lance"),
        ("meta/*.jsonl", "meta/*.parquet", "meta/episodes/*/*.parquet", "data/*/*.parquet", "frames.lance/data/*"),
        Format(read_path=_read_lerobot),
    ),
    DataSet(
        f"{ENDS}/.zarray",
        ("data",),
        # Not the frames of cameras, which take minutes to read.
        (f"{ENDS}/*", "data/*pos/*", "data/*state/*", "data/*action/*", "data/*angle/*", "data/*width/*"),
        Format(read_path=zarr_movements),
    ),
    DataSet(FORMAT_3, (ENDS,), (), Format(read_path=zarr_movements)),  # refused with what to do
    DataSet("metadata.yaml", ("*.db3*", "*.mcap*"), ("*.db3*", "*.mcap*"), _BAG, b"rosbag2_bagfile_information"),
)


def data_set_of(folder: Path) -> DataSet | None:
    """Return the row of `DATA_SETS` for a folder; None for a folder of files and for what is no folder."""
    for data_set in DATA_SETS:
        with suppress(OSError):
            marker = folder / data_set.marker
            others = (path for pattern in data_set.beside for path in folder.glob(pattern))
            if not marker.is_file() or (data_set.beside and not any(others)):
                continue
            with marker.open("rb") as file:
                if data_set.says in file.read(_HEAD):
                    return data_set
    return None


def format_at(path: Path) -> Format | None:
    """Return the format of a data set, or of a file by its ending; None for a folder of files and other endings."""
    if (data_set := data_set_of(path)) is not None:
        return data_set.format
    return None if path.is_dir() else FORMATS.get(path.suffix.lower())


class Entry(NamedTuple):
    """A file, or a folder that is one data set."""

    path: Path
    relative: Path  # in the folder that was given; the name alone of what was given itself
    name: str  # in the result: with the path that was given, where several were


def entries_of(paths: Sequence[Path], follow_links: bool = False) -> tuple[list[Entry], list[Problem]]:
    """Return all files of files, folders and patterns such as ``optitrack/*.csv``, each once, and problems."""
    entries: dict[Path, Entry] = {}
    problems: list[Problem] = []
    alone = is_alone(paths)
    for path in (path for given in paths for path in expanded(given)):
        if _is_folder_of_files(path):
            files, odd = files_under(path, follow_links)
            new = [(file, file.relative_to(path)) for file in files]
            problems += odd if alone else [problem._replace(file=as_text(path / problem.file)) for problem in odd]
        elif path.exists() or path.is_symlink():
            new = [(path, name_of(path))]
        elif len(paths) == 1:
            raise DataError(f"expected a file or folder of recordings, found nothing at {str(path)!r}")
        else:
            problems.append(Problem(as_text(path), None, "expected a file or folder of recordings, found nothing"))
            continue
        for file, relative in new:
            entries.setdefault(file, Entry(file, relative, as_text(relative if alone else file)))
    return list(entries.values()), problems


def expanded(path: Path) -> list[Path]:
    """List the matches of a pattern, sorted, or itself; a file that has the name of a pattern is meant itself."""
    if not has_magic(str(path)) or path.exists() or path.is_symlink():
        return [path]
    return [Path(match) for match in sorted(glob(str(path), recursive=True))] or [path]


def is_alone(paths: Sequence[Path]) -> bool:
    """Tell whether one file or folder is given, so that names are those in it."""
    return len(paths) == 1 and expanded(paths[0]) == [paths[0]]


def root_of(*paths: Path) -> Path:
    """Give the folder that names of sources are relative to; of several paths, it is the working folder."""
    if not is_alone(paths):
        return Path()
    return paths[0] if _is_folder_of_files(paths[0]) else paths[0].parent


def name_of(path: Path) -> Path:
    """Return the name of a file or a data set; of the current folder too."""
    return Path(path.name or path.resolve().name)


def in_words(paths: Sequence[Path]) -> str:
    """Return the paths for a message."""
    return first_names(paths, _NAMED)


def _is_folder_of_files(path: Path) -> bool:
    return path.is_dir() and data_set_of(path) is None


def files_under(folder: Path, follow_links: bool = False) -> tuple[list[Path], list[Problem]]:
    """Return all files that are not hidden, sorted, and the problems with links and folders.

    A folder that is one data set stands for all of its files. Links to folders are followed last, and no folder is
    entered twice. A link that leads out of the folder is a problem, and followed only with `follow_links`: a folder
    from elsewhere must not make the program read other files of this machine.
    """
    files: list[Path] = []
    problems: list[Problem] = []
    visited: set[tuple[int, int]] = set()
    folders, links = deque([folder]), deque[Path]()
    while folders or links:
        here = folders.popleft() if folders else links.popleft()
        try:
            status = here.stat()
            if (status.st_dev, status.st_ino) in visited:
                continue
            visited.add((status.st_dev, status.st_ino))
            if here != folder and data_set_of(here) is not None:
                files.append(here)
                continue
            entries = sorted(os.scandir(here), key=lambda entry: entry.name)
        except OSError as error:
            problems.append(Problem(as_text(here.relative_to(folder)), None, f"the folder cannot be listed, {error}"))
            continue
        for entry in entries:
            path = here / entry.name
            if entry.name.startswith("."):
                continue
            if entry.is_symlink() and not follow_links and leads_out(path, folder):
                problems.append(Problem(as_text(path.relative_to(folder)), None, OUTSIDE))
            elif not _is_folder(entry):
                files.append(path)
            else:
                (links if entry.is_symlink() else folders).append(path)
    return sorted(files, key=lambda path: path.relative_to(folder).parts), problems


def leads_out(link: Path, folder: Path) -> bool:
    """Tell whether the target of a link exists and lies outside the folder."""
    target, top = os.path.realpath(link), os.path.realpath(folder)
    return os.path.exists(target) and os.path.commonpath([target, top]) != top


def _is_folder(entry: os.DirEntry[str]) -> bool:
    """Tell whether a path is a folder; False if unknown, as for a link to itself: reading it as a file reports why."""
    with suppress(OSError):
        return entry.is_dir()
    return False


def as_text(path: Path | str) -> str:
    r"""Give a path with forward slashes; bytes that are not UTF-8 are escaped as ``\xff``, so that it can be stored."""
    plain = path.as_posix() if isinstance(path, Path) else path
    return plain.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")

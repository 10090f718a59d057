"""What an archive holds, from its listing alone, and copies of a part of it: on this machine or in an object store."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatch
from functools import lru_cache
from pathlib import Path, PurePosixPath
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from urllib.parse import unquote

from kineme.errors import DataError, SpecificationError
from kineme.io.reading.formats import DATA_SETS, DataSet, Entry, as_text, data_set_of, entries_of, is_alone
from kineme.io.records import Problem, needs
from kineme.reporting.atomic import FULL

_REMOTE = re.compile(r"[a-zA-Z][a-zA-Z0-9+.-]+://")
_CHUNK = 2**22  # bytes that are copied at a time
_HEAD = 4096  # bytes of a marker that tell a data set
_PRIVATE = re.compile(r"://[^/@]*@")  # a name and password in a URI
_STORES = re.compile(r"(s3|gs|gcs|abfss?)://", re.I)  # with buckets, which pyarrow opens


class File(NamedTuple):
    """A file as a listing shows it."""

    name: str  # relative to its archive, or to the data set that the archive is, with slashes; of one file, its name
    size: int  # bytes
    stamp: str  # changes when the file does: nanoseconds of its last modification


class Unit(NamedTuple):
    """What is read as one: a file, or a folder that is one data set."""

    archive: str  # as it was given
    name: str  # relative to the archive; its own name where it is the archive
    files: tuple[File, ...]
    marker: str = ""  # of a data set: the row of `DATA_SETS` that it is
    is_archive: bool = False
    shown: str = ""  # its name in results, which can be stored; with the archive where several are given


def is_remote(archive: str) -> bool:
    """Tell whether an archive lies in another system that its URI names, as ``s3://bucket/fleet``, not ``file://``."""
    return bool(_REMOTE.match(archive)) and not archive.startswith("file://")


def path_at(archive: str) -> Path:
    """Return the path of an archive of this machine."""
    return Path(unquote(archive.removeprefix("file://")) if archive.startswith("file://") else archive)


def address_of(archive: str, name: str) -> str:
    """Return the URI of a file or data set in an archive of a store, without options of the store."""
    base = archive.partition("?")[0].rstrip("/")
    return base if base.endswith(f"/{name}") else f"{base}/{name}"


def check_apart(output: str | Path, archives: Sequence[str]) -> None:
    """Refuse a folder of parts within an archive, whose files would become recordings of it."""
    folder = Path(output).resolve()
    for archive in archives:
        if not is_remote(archive) and path_at(archive).resolve() in (folder, *folder.parents):
            raise SpecificationError(
                f"expected a folder for the parts outside of the archive {archive}, got {output}; its files would be "
                "read as recordings"
            )


def units_of(archives: Sequence[str], follow_links: bool = False) -> tuple[list[Unit], list[Problem]]:
    """List what is to be read in archives, once each and sorted by name, and what cannot be listed."""
    units: list[Unit] = []
    problems: list[Problem] = []
    listed: set[Path] = set()
    several = len(archives) > 1
    for archive in dict.fromkeys(archives):
        if is_remote(archive):
            for unit in _remote_units(archive):
                units.append(unit._replace(shown=address_of(archive, unit.name) if several else unit.name))
            continue
        path = path_at(archive)
        entries, odd = entries_of([path], follow_links)
        if not is_alone([path]):
            raise DataError(f"expected a file or folder, got the pattern {archive!r}; name the folder that holds them")
        problems += [problem._replace(file=as_text(path / problem.file)) for problem in odd] if several else odd
        for entry in entries:
            if entry.path in listed:
                continue
            listed.add(entry.path)
            shown = as_text(entry.path) if several else entry.name
            try:
                units.append(_local_unit(archive, entry)._replace(shown=shown))
            except OSError as error:
                problems.append(Problem(shown, None, f"expected a file, got {error.strerror or error}"))
    if not units and not problems:
        raise DataError(f"expected recordings in {', '.join(archives)}, found none")
    return units, problems


def _local_unit(archive: str, entry: Entry) -> Unit:
    status = os.stat(entry.path)
    if not stat.S_ISDIR(status.st_mode):
        name = entry.relative.as_posix()
        return Unit(archive, name, (File(name, status.st_size, str(status.st_mtime_ns)),))
    data_set = data_set_of(entry.path)
    paths = [entry.path] if data_set is None else data_set.files(entry.path)
    is_archive = data_set is not None and entry.path == path_at(archive)
    files = []
    for path in paths:
        status = os.stat(path)
        inside = path.relative_to(entry.path)
        relative = inside if is_archive else entry.relative / inside
        files.append(File(relative.as_posix(), status.st_size, str(status.st_mtime_ns)))
    marker = "" if data_set is None else data_set.marker
    return Unit(archive, entry.relative.as_posix(), tuple(files), marker, is_archive)


@contextmanager
def local_copy(unit: Unit) -> Iterator[Path]:
    """Context manager: a folder that holds a unit under its name; of a store, a temporary one with copies."""
    archive = unit.archive
    if not is_remote(archive):
        path = path_at(archive)
        yield path.absolute().parent if unit.is_archive or not path.is_dir() else path
        return
    system, base = _open(archive)
    with TemporaryDirectory(prefix="kineme-") as folder:
        for file in unit.files:
            target = _within(Path(folder) / unit.name if unit.is_archive else Path(folder), file.name)
            target.parent.mkdir(parents=True, exist_ok=True)
            _copy(system, _path_of(base, file.name, archive), target, file)
        yield Path(folder)


def opened(unit: Unit) -> Any:
    """Return what pyarrow reads some of: the path of the one file of a unit, or the file opened in its store."""
    if not is_remote(unit.archive):
        return path_at(unit.archive) / unit.name if path_at(unit.archive).is_dir() else path_at(unit.archive)
    system, base = _open(unit.archive)
    return system.open_input_file(_path_of(base, unit.name, unit.archive))


def _within(folder: Path, name: str) -> Path:
    """Return the path of a name in a folder; names are data, and lead nowhere else."""
    parts = PurePosixPath(name).parts
    if not parts or ".." in parts or PurePosixPath(name).is_absolute():
        raise DataError(f"expected a name within the archive, got {name!r}")
    return folder.joinpath(*parts)


def _path_of(base: str, name: str, archive: str) -> str:
    alone = PurePosixPath(base).name == name  # an archive that is one file
    return base if alone and not archive.endswith("/") else f"{base.rstrip('/')}/{name}"


def _copy(system: Any, path: str, target: Path, file: File) -> None:
    try:
        with system.open_input_stream(path) as source, target.open("wb") as copy:
            copyfileobj(source, copy, _CHUNK)
    except FileNotFoundError as error:
        raise DataError(f"expected {file.name} in the archive, it has vanished since it was listed") from error
    except OSError as error:
        if error.errno in FULL:  # here, not in the store
            raise
        raise DataError(f"expected to read {file.name}, the store refuses ({_reason(error)})") from error
    if target.stat().st_size != file.size:
        raise DataError(f"expected {file.size:,} bytes of {file.name}, got {target.stat().st_size:,}; read it again")


def _reason(error: BaseException) -> str:
    return _hidden(" ".join(str(error).split()))[:200]


def _hidden(text: str) -> str:
    """Return a text without names and passwords in URIs."""
    return _PRIVATE.sub("://", text)


@lru_cache(maxsize=16)
def _open(archive: str) -> tuple[Any, str]:
    """Return the file system of a URI and the path in it: of pyarrow, or of what fsspec knows."""
    if _PRIVATE.search(archive):
        raise SpecificationError(
            f"expected a URI without a name and password, which would be written to files, got {_hidden(archive)}; say "
            "them as the store asks for it, such as in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
        )
    with needs("pyarrow", f"read {archive}", "parquet"):
        from pyarrow import ArrowException, fs
    try:
        system, path = fs.FileSystem.from_uri(archive)
        return system, path
    except (ArrowException, OSError, ValueError) as error:
        refused = error
    is_known = bool(_STORES.match(archive)) and not isinstance(refused, NotImplementedError)  # pyarrow without it
    reason = f"expected a URI that pyarrow opens, got {archive}: {_reason(refused)}"
    if is_known and "?" in archive:  # options, which fsspec would take for a part of the path
        raise SpecificationError(reason) from refused
    try:
        import fsspec

        system, path = fsspec.core.url_to_fs(archive)
    except ImportError as error:
        if is_known:
            raise SpecificationError(reason) from refused
        raise DataError(
            f"expected a package that opens {archive}, got none ({_reason(refused)}); pip install fsspec and "
            "the package that it names"
        ) from error
    except (ValueError, OSError) as error:
        raise SpecificationError(f"expected the URI of an archive, got {archive}: {_reason(error)}") from error
    return fs.PyFileSystem(fs.FSSpecHandler(system)), path


def _remote_units(archive: str) -> list[Unit]:
    from pyarrow import ArrowException, fs

    system, base = _open(archive)
    try:
        (top,) = system.get_file_info([base.rstrip("/")])
        found = [top]
        if top.type != fs.FileType.File:
            found = system.get_file_info(fs.FileSelector(base, recursive=True, allow_not_found=True))
        bucket = base.partition("/")[0]
        if not found and _STORES.match(archive) and system.get_file_info([bucket])[0].type == fs.FileType.NotFound:
            raise DataError(f"expected the bucket {bucket!r} of {archive}, the store has none of this name")
    except (ArrowException, OSError) as error:
        raise DataError(f"expected to list {archive}, the store refuses ({_reason(error)})") from error
    names: dict[str, File] = {}
    for info in found:
        if info.type != fs.FileType.File:
            continue
        name = info.base_name if info is top else info.path.removeprefix(base.rstrip("/")).lstrip("/")
        if any(part.startswith(".") for part in name.split("/")):
            continue
        changed = info.mtime_ns
        names[name] = File(name, info.size, "" if changed is None else str(changed))
    return sorted(_grouped(archive, names, system, base), key=lambda unit: unit.name)


def _grouped(archive: str, names: dict[str, File], system: Any, base: str) -> Iterator[Unit]:
    """Yield the data sets and the files outside of them, of a listing by names."""
    taken: set[str] = set()
    folders: dict[str, DataSet] = {}
    for data_set in DATA_SETS:
        for name in names:
            if name == data_set.marker or name.endswith(f"/{data_set.marker}"):
                folder = name[: -len(data_set.marker)].rstrip("/")
                if folder not in folders and _fits(data_set, folder, names, system, _path_of(base, name, archive)):
                    folders[folder] = data_set
    for folder in sorted(folders, key=len):  # a data set within another is a part of it
        prefix = f"{folder}/" if folder else ""
        inside = {name for name in names if name.startswith(prefix) and name not in taken}
        if not inside:
            continue
        data_set = folders[folder]
        patterns = (data_set.marker, *data_set.parts)
        files = [names[name] for name in sorted(inside) if _matches(name[len(prefix) :], patterns)]
        taken |= inside
        yield Unit(archive, folder or PurePosixPath(base).name, tuple(files), data_set.marker, not folder)
    for name in sorted(set(names) - taken):
        yield Unit(archive, name, (names[name],))


def _fits(data_set: DataSet, folder: str, names: dict[str, File], system: Any, marker: str) -> bool:
    """Tell whether the files beside a marker make a folder a data set; of some, the marker must say so."""
    prefix = f"{folder}/" if folder else ""
    first = {name[len(prefix) :].split("/")[0] for name in names if name.startswith(prefix)}
    if data_set.beside and not any(fnmatch(name, pattern) for name in first for pattern in data_set.beside):
        return any(name.startswith(f"{prefix}{other}/") for name in names for other in data_set.beside)
    if not data_set.says:
        return True
    with system.open_input_stream(marker) as file:
        return data_set.says in file.read(_HEAD)


def _matches(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether a path has the form of one of the patterns, whose * stands for a part of one name."""
    parts = name.split("/")
    return any(
        len(parts) == len(wanted) and all(map(fnmatch, parts, wanted))
        for wanted in (pattern.split("/") for pattern in patterns)
    )

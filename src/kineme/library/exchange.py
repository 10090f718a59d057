"""A whole library as one file, and back: every row of every table, with all versions."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from kineme.errors import DataError
from kineme.library.connection import FILE, check_kind, connect
from kineme.library.faults import in_plain_words
from kineme.library.placing import placed
from kineme.library.store import Store
from kineme.library.verify import verify


def export(store: Store, path: str | Path) -> Path:
    """Write the library, with all its versions, to one new file; it is there as a whole or not at all.

    Libraries with the same rows give the same bytes.

    Raises
    ------
    DataError
        The file exists; the disk is full; the library's structure is damaged. Rows with a wrong checksum are copied as
        they are: `verify` finds them, and `import_` refuses them.
    """
    target = Path(path)
    with _new(target) as beside:
        with closing(connect(store.path, "ro", store.wait)) as connection:
            connection.execute("VACUUM INTO ?", (str(beside),))
        with closing(connect(beside, "rw", store.wait)) as copy:
            copy.execute("PRAGMA schema_version = 1")  # counts how often a file was compacted: no content
    return target


def import_(path: str | Path, folder: str | Path, wait: float = 10.0) -> Path:
    """Make a library in `folder` of a file that `export` wrote, once every byte of it has been checked.

    Raises
    ------
    DataError
        There is a library already; the file is no export, is a library in use, is damaged, or of a later schema
        version.
    """
    source, target = Path(path), Path(folder) / FILE
    if not source.is_file():
        raise DataError(f"expected an exported library at {source}, found no file there")
    log = source.with_name(f"{source.name}-wal")
    if log.exists() and log.stat().st_size:  # the newest changes are there, and the file alone would be an older state
        raise DataError(
            f"expected an exported library, got {source} with changes beside it in {log.name}; export it, and import "
            "that file"
        )
    Path(folder).mkdir(parents=True, exist_ok=True)
    with _new(target) as beside:
        shutil.copyfile(source, beside)
        with in_plain_words(source, wait), closing(connect(beside, "rw", wait)) as copy:
            check_kind(copy, source)
            copy.execute("PRAGMA journal_mode = WAL")
        _check(beside, source, wait)
    return target


def _check(beside: Path, source: Path, wait: float) -> None:
    store = Store(beside, read_only=True, wait=wait)
    try:
        problems = verify(store)
    finally:
        store.close()
    if problems:
        raise DataError(
            f"expected {source} as it was exported, got damaged bytes ({len(problems)} problems, the first: "
            f"{problems[0]}); nothing was imported: export it again, or take it from a backup"
        )


@contextmanager
def _new(target: Path) -> Iterator[Path]:
    """As `placed`, with errors that users can act on."""
    if not target.parent.is_dir():
        raise DataError(f"expected a folder {target.parent} to write {target.name} into, there is none; create it")
    try:
        with in_plain_words(target, 0.0), placed(target) as beside:
            yield beside
    except FileExistsError as error:
        raise DataError(f"expected a new file, but {target} is there already; choose another, or move it") from error

"""Export a library to one file and import it: every row of every table, with all versions."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from kineme.errors import DataError
from kineme.library.storage import connection as sqlite
from kineme.library.storage.address import Address, as_location
from kineme.library.storage.rows import damage
from kineme.library.storage.safety import defend_foreign, limited
from kineme.library.storage.schema import SCHEMA_VERSION
from kineme.library.storage.store import Store
from kineme.library.storage.verify import verify


def export(store: Store, path: str | Path) -> Path:
    """Write the library, with all its versions, to one new file, atomically; equal rows give equal bytes.

    Rows with a wrong checksum are copied as they are: `verify` finds them, and `import_` refuses them.
    """
    target = Path(path)
    with _new(target) as beside:
        with store.database(beside) as connection:
            _copy(connection, store, beside)
        with closing(sqlite.connect(beside, "rw", store.wait)) as copy:
            copy.execute("PRAGMA schema_version = 1")  # a counter of VACUUM, which is not content
    return target


def _copy(connection: sqlite3.Connection, store: Store, beside: Path) -> None:
    try:
        connection.execute("VACUUM INTO ?", (str(beside),))
    except sqlite3.IntegrityError as error:  # two rows with one key
        raise damage(f"every row of {store.path} once", f"damaged bytes ({error})") from error
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode != sqlite3.SQLITE_INTERRUPT:  # of the new file
            raise
        with sqlite.in_plain_words(store.path, store.wait):
            raise


def import_(path: str | Path, folder: str | Path | Address, wait: float = 10.0) -> Path | Address:
    """Create a library in `folder`, or at an address, from a file of `export`, which may come from anywhere.

    Every byte and value of a copy is checked, by a connection on which nothing in the file can run.
    """
    source, location = Path(path), as_location(folder)
    if isinstance(location, Address):
        from kineme.library.storage.postgres_store import move_in

        with TemporaryDirectory() as checked:
            import_(source, checked, wait)
            with closing(Store(Path(checked) / sqlite.FILE, read_only=True, wait=wait)) as store:
                return move_in(store, location)
    target = location / sqlite.FILE
    if not source.is_file():
        got = "something else" if source.exists() else "no file"
        raise DataError(f"expected an exported library at {source}, found {got} there")
    if logs := sqlite.logs_of(source):  # they contain changes; the file alone is an older state
        raise DataError(
            f"expected an exported library, got {source} with changes beside it in {logs[0].name}; export it, and "
            "import that file"
        )
    location.mkdir(parents=True, exist_ok=True)
    sqlite.check_alone(target)
    with _new(target) as beside:
        # Refuse a file that would fill the disk; a sparse file may be larger than its disk.
        size, free = source.stat().st_size, shutil.disk_usage(target.parent).free
        if size > free:
            raise DataError(
                f"expected room for the {size:,} bytes of {source} in {target.parent}, got {free:,}; free some"
            )
        shutil.copyfile(source, beside)
        with _named(beside, source), sqlite.in_plain_words(source, wait):
            _check_structure(beside, source, wait)
            with closing(sqlite.connect(beside, "rw", wait)) as copy:
                if sqlite.check_kind(copy, source) < SCHEMA_VERSION:
                    sqlite.migrate(copy, source)
                copy.execute("PRAGMA journal_mode = WAL")
            with closing(Store(beside, read_only=True, wait=wait)) as store:
                problems = verify(store, pages=False)
            if problems:
                raise _refusal(source, len(problems), str(problems[0]))
    return target


def _check_structure(beside: Path, source: Path, wait: float) -> None:
    """Refuse definitions that are not ours, and pages that do not form tables, before rows are read."""
    with closing(sqlite.connect(beside, "ro", wait)) as copy, limited(copy, beside):
        defend_foreign(copy, beside)
        sqlite.check_kind(copy, source)
        verdict = copy.execute("PRAGMA integrity_check(1)").fetchone()[0]
        if verdict != "ok":
            raise _refusal(source, 1, f"the file: {' '.join(verdict.split())}")


def _refusal(source: Path, n: int, first: str) -> DataError:
    shown = "1 problem" if n == 1 else f"{n} problems, the first"
    return DataError(
        f"expected {source} as it was exported, got damaged bytes, or values that no library holds ({shown}: {first}); "
        "nothing was imported: export it again, or take it from a backup that you trust"
    )


@contextmanager
def _named(beside: Path, source: Path) -> Iterator[None]:
    """Let errors name the user's file, not the copy that is checked."""
    try:
        yield
    except DataError as error:
        if str(beside) not in str(error):
            raise
        raise DataError(str(error).replace(str(beside), str(source))) from error


@contextmanager
def _new(target: Path) -> Iterator[Path]:
    """Return `new_database`, with errors for users."""
    if not target.parent.is_dir():
        raise DataError(f"expected a folder {target.parent} to write {target.name} into, there is none; create it")
    try:
        with sqlite.in_plain_words(target, 0.0), sqlite.new_database(target) as beside:
            yield beside
    except FileExistsError as error:
        raise DataError(f"expected a new file, but {target} is there already; choose another, or move it") from error

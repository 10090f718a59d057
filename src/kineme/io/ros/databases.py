"""What bags in SQLite need of their own: names that SQLite takes, and the log of what is not in the database yet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

_MEAN_MORE = frozenset("?#%")


@contextmanager
def plain_name(path: Path, ending: str) -> Iterator[Path]:
    """The path, or a link to it: the name of a database is an address to SQLite, where these characters mean more."""
    files = [one for kind in ("*.db3*", "*.mcap*") for one in path.glob(kind)] if not ending else [path]
    if ending not in ("", ".db3") or not _MEAN_MORE & set("".join(map(str, files))):
        yield path
        return
    plain = str.maketrans(dict.fromkeys(_MEAN_MORE, "_"))
    with TemporaryDirectory() as folder:
        for one in files:
            (Path(folder) / one.name.translate(plain)).symlink_to(one.resolve())
        if ending:
            yield Path(folder) / path.name.translate(plain)
            return
        about = (path / "metadata.yaml").read_text(encoding="utf-8")
        for one in files:
            about = about.replace(one.name, one.name.translate(plain))
        (Path(folder) / "metadata.yaml").write_text(about, encoding="utf-8")
        yield Path(folder)


def logs_beside(path: Path) -> list[str]:
    """What is left out of a bag in SQLite: the log of a recording that was cut off, which holds its last messages."""
    files = sorted(path.glob("*.db3")) if path.is_dir() else [path] if path.suffix.lower() == ".db3" else []
    logs = [(one, one.with_name(f"{one.name}-wal")) for one in files]
    return [
        f"{log.name}: messages that are not in the database yet; to add them, open it once: sqlite3 {one.name} "
        "'PRAGMA wal_checkpoint(TRUNCATE)'"
        for one, log in logs
        if log.is_file() and log.stat().st_size
    ]

"""A temporary folder for as long as this process runs; those of processes that were killed are deleted."""

from __future__ import annotations

import os
import shutil
import stat
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

_PREFIX = "kineme-studio-"
_NEW = 60.0  # seconds in which a folder may be made and not locked yet


class OwnFolder:
    """A new folder, locked for as long as the process runs, however it ends."""

    def __init__(self) -> None:
        _delete_left(Path(gettempdir()))
        self._folder = TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
        self.path = Path(self._folder.name)
        self._handle = _locked(self.path)

    def close(self) -> None:
        """Delete it."""
        self._folder.cleanup()
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


def _delete_left(where: Path) -> None:
    """Delete folders of this user that no process holds."""
    for path in where.glob(f"{_PREFIX}*"):
        with suppress(OSError):  # another process was faster
            known = path.lstat()
            own = stat.S_ISDIR(known.st_mode) and (not hasattr(os, "getuid") or known.st_uid == os.getuid())
            if own and time.time() - known.st_mtime > _NEW and (handle := _locked(path)) is not None:
                shutil.rmtree(path, ignore_errors=True)
                os.close(handle)


def _locked(path: Path) -> int | None:
    """A handle that locks a folder until it is closed; None where another process has it, or locks do not exist."""
    if os.name != "posix":
        return None
    import fcntl

    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle

"""Files that clients sent: kept for a while, read in a process of their own."""

from __future__ import annotations

import asyncio
import json
import math
import os
import re
import secrets
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from threading import Lock
from typing import Any
from urllib.parse import unquote

from kineme.errors import DataError
from kineme.io.reading.merge_files import Recordings
from kineme.studio.server.read_upload import REFUSED, load
from kineme.studio.server.refusals import MissingError

_PREFIX = "kineme-studio-"
_NEW = 60.0  # seconds in which a folder may be made and not locked yet

SECONDS = 60.0  # to read one file
BYTES = 2 * 2**30  # of memory for it
HELD = 2**30  # bytes of what was read from all files
PERIOD = 0.2  # seconds between looks whether anybody waits
_READERS = 2  # files that are read at once
_MOST_FILES = 8  # files
_LONGEST = 200  # bytes of a name


class Uploads:
    """The last few files that were sent; forgotten when the studio ends."""

    def __init__(self, seconds: float = SECONDS, memory: int = BYTES, held: int = HELD) -> None:
        self.seconds, self.memory, self.held = seconds, memory, held
        self.readers = asyncio.Semaphore(_READERS)
        self._folder = OwnFolder()
        self._files: dict[str, Path] = {}
        self.options: dict[str, dict[str, Any]] = {}  # of the reader, where a person chose them for a file
        self.previews: dict[str, dict[str, Any] | None] = {}  # see `table_preview`
        self._read: dict[tuple[str, tuple[str, ...]], Recordings] = {}  # by the chosen columns
        self._turn = Lock()

    def close(self) -> None:
        """Delete them."""
        self._folder.close()

    async def receive(self, name: str, chunks: AsyncIterator[bytes]) -> str:
        """Keep a file under the key that is returned; `name` is percent-encoded, its ending says the format."""
        key = secrets.token_hex(8)
        path = self._folder.path / key / plain_name(name)
        try:
            path.parent.mkdir()
            with path.open("wb") as file:
                async for chunk in chunks:
                    file.write(chunk)
        except BaseException as error:  # refused as too large, or the client has gone
            shutil.rmtree(path.parent, ignore_errors=True)
            if isinstance(error, OSError):
                raise DataError(
                    f"expected to keep the file in {self._folder.path}, got: {error.strerror}; free some space there, "
                    "or set TMPDIR to another folder before the studio is started"
                ) from error
            raise
        with self._turn:
            self._files[key] = path
            for old in list(self._files)[:-_MOST_FILES]:
                shutil.rmtree(self._files.pop(old).parent, ignore_errors=True)
                self.options.pop(old, None), self.previews.pop(old, None)
                self._read = {which: read for which, read in self._read.items() if which[0] != old}
        return key

    def recordings(self, key: str, columns: Sequence[str] = (), check: Callable[[], object] = bool) -> Recordings:
        """Read a file that was sent, in these columns or those found; `check` raises where nobody waits any more."""
        path, chosen, options = self.path(key), tuple(columns), self.options.get(key, {})
        read = self._read.get((key, chosen))
        if read is None:
            read = self._read_apart(path, {**options, "columns": list(chosen)} if chosen else options, check)
            with self._turn:
                # Of each file it is kept as it is, and in the columns chosen last.
                if key in self._files and options == self.options.get(key, {}):
                    for old in [which for which in self._read if which[0] == key and which[1] and chosen]:
                        self._read.pop(old)
                    self._read[key, chosen] = read
                while len(self._read) > 1 and sum(map(_bytes, self._read.values())) > self.held:
                    self._read.pop(next(iter(self._read)))
        return read

    def path(self, key: str) -> Path:
        """Return the file that was sent; a MissingError if it is forgotten."""
        if (path := self._files.get(key)) is None:
            raise MissingError(
                f"expected one of the last {_MOST_FILES} recordings that were sent, got another; send it again"
            )
        return path

    def read_as(self, key: str, options: dict[str, Any], check: Callable[[], object] = bool) -> Recordings:
        """Read a file with options of the reader from now on; where they are refused, it is read as before."""
        read = self._read_apart(self.path(key), options, check)
        with self._turn:
            if key in self._files:
                self.options[key] = options
                self._read = {which: other for which, other in self._read.items() if which[0] != key}
                self._read[key, ()] = read
        return read

    def _read_apart(self, path: Path, options: dict[str, object], check: Callable[[], object]) -> Recordings:
        result = path.with_name(f"{secrets.token_hex(4)}.npz")
        command = [sys.executable, "-m", "kineme.studio.server.read_upload", str(path), str(result)]
        command += [str(self.memory), str(math.ceil(2 * self.seconds))]
        remedy = "send a part of it, or learn it with kineme learn"
        try:
            code = _run(command, json.dumps(options), self.seconds, check)
            if (preview := result.with_suffix(".json")).exists():
                with self._turn:
                    if (key := path.parent.name) in self._files:  # of one that is forgotten meanwhile nobody would
                        self.previews[key] = json.loads(preview.read_text(encoding="utf-8"))
            if code == REFUSED:
                raise DataError(result.read_text(encoding="utf-8").replace(f"{path.parent}/", ""))
            if code:
                raise DataError(f"expected a recording, reading {path.name} ended with code {code}")
            if result.stat().st_size > self.held:
                most = f"at most {self.held / 2**20:.0f} MB of numbers"
                raise DataError(f"expected a recording of {most}, {path.name} holds more; {remedy}")
            return load(result)
        except TimeoutError:
            within = f"expected a recording that is read within {self.seconds:g} s"
            raise DataError(f"{within}, {path.name} takes longer; {remedy}") from None
        finally:
            for file in (result, result.with_suffix(".json")):
                file.unlink(missing_ok=True)


def _run(command: Sequence[str], given: str, seconds: float, check: Callable[[], object]) -> int:
    """Return the exit code of a child process, which is ended after so many seconds, and where `check` raises."""
    end, pipe = time.monotonic() + seconds, subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as child:
        try:
            pending: str | None = given
            while True:
                with suppress(subprocess.TimeoutExpired):
                    child.communicate(pending, timeout=min(PERIOD, max(end - time.monotonic(), 0.0)))
                    return child.returncode
                pending = None  # once: the child process gets what was not written yet all the same
                check()
                if time.monotonic() >= end:
                    raise TimeoutError
        finally:
            child.kill()  # if it has not ended


def _bytes(read: Recordings) -> int:
    movements = read.demonstrations.movements
    arrays = (movements.positions, movements.times, movements.recorded)
    return sum(array.nbytes for array in arrays if array is not None)


def plain_name(name: str) -> str:
    """Return the name of a file without folders and without what a file system may not take."""
    last = re.split(r"[/\\]", unquote(name))[-1]
    plain = re.sub(r"[^\w.\-()+ ]", "_", last).strip(" ").encode()[-_LONGEST:].decode(errors="ignore")
    return f"_{plain}" if plain.startswith((".", "-")) or not plain else plain


class OwnFolder:
    """A new folder, locked for as long as the process runs, however it ends."""

    def __init__(self) -> None:
        for path in Path(gettempdir()).glob(f"{_PREFIX}*"):  # of this user, that no process holds
            with suppress(OSError):  # another process was faster
                status = path.lstat()
                own = stat.S_ISDIR(status.st_mode) and (not hasattr(os, "getuid") or status.st_uid == os.getuid())
                if own and time.time() - status.st_mtime > _NEW and (handle := _locked(path)) is not None:
                    shutil.rmtree(path, ignore_errors=True)
                    os.close(handle)
        self._folder = TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
        self.path = Path(self._folder.name)
        self._handle = _locked(self.path)

    def close(self) -> None:
        """Delete it."""
        self._folder.cleanup()
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


def _locked(path: Path) -> int | None:
    """Lock a folder until the returned handle is closed; None where another process has it, or without locks."""
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

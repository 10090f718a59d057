"""Files that clients sent: kept for a while, read in a process of their own."""

from __future__ import annotations

import json
import re
import secrets
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import NamedTuple
from urllib.parse import unquote

from kineme.errors import DataError
from kineme.files.merge_files import Recordings
from kineme.studio.server.read_upload import REFUSED, load
from kineme.studio.server.refusals import MissingError

SECONDS = 60.0  # to read one file
BYTES = 2 * 2**30  # of memory
PERIOD = 0.2  # seconds between looks whether anybody waits
_KEPT = 8  # files
_LONGEST = 120  # characters of a name


def _go_on() -> None:
    """Whoever asked still waits."""


class Upload(NamedTuple):
    """A file that was sent, and what it held, by the columns that were asked for."""

    path: Path
    read: dict[tuple[str, ...], Recordings]


class Uploads:
    """The last few files that were sent; forgotten when the studio ends."""

    def __init__(self, seconds: float = SECONDS, memory: int = BYTES) -> None:
        self.seconds, self.memory = seconds, memory
        self._folder = TemporaryDirectory(prefix="kineme-studio-", ignore_cleanup_errors=True)
        self._kept: dict[str, Upload] = {}
        self._turn = Lock()

    def close(self) -> None:
        """Delete them."""
        self._folder.cleanup()

    async def receive(self, name: str, chunks: AsyncIterator[bytes]) -> str:
        """Keep a file under the key that is returned; `name` is percent-encoded, its ending says the format."""
        key = secrets.token_hex(8)
        path = Path(self._folder.name) / key / plain_name(name)
        path.parent.mkdir()
        try:
            with path.open("wb") as file:
                async for chunk in chunks:
                    file.write(chunk)
        except BaseException:  # refused as too large, or the client has gone
            path.unlink()
            raise
        with self._turn:
            self._kept[key] = Upload(path, {})
            old = list(self._kept)[:-_KEPT]
            gone = [self._kept.pop(one).path for one in old]
        for one in gone:
            one.unlink(missing_ok=True)
        return key

    def recordings(self, key: str, columns: Sequence[str] = (), check: Callable[[], object] = _go_on) -> Recordings:
        """What a file holds, in these columns or in those that are found.

        `check` is called again and again, and raises where nobody waits any more.

        Raises
        ------
        MissingError
            It was not sent, or too long ago.
        DataError
            It cannot be read, takes too long or too much memory.
        """
        upload = self._kept.get(key)
        if upload is None:
            raise MissingError(
                f"expected one of the last {_KEPT} recordings that were sent, got another; send it again"
            )
        asked = tuple(columns)
        if asked not in upload.read:
            upload.read[asked] = self._read(upload.path, {"columns": list(asked)} if asked else {}, check)
        return upload.read[asked]

    def _read(self, path: Path, options: dict[str, object], check: Callable[[], object]) -> Recordings:
        result = path.with_name(f"{secrets.token_hex(4)}.npz")
        command = [sys.executable, "-m", "kineme.studio.server.read_upload", str(path), str(result), str(self.memory)]
        try:
            code = _run(command, json.dumps(options), self.seconds, check)
            if code == REFUSED:
                raise DataError(result.read_text(encoding="utf-8").replace(f"{path.parent}/", ""))
            if code:
                raise DataError(f"expected a recording, reading {path.name} ended with code {code}")
            return load(result)
        except TimeoutError:
            raise DataError(
                f"expected a recording that is read within {self.seconds:g} s, {path.name} takes longer; "
                "send a part of it, or learn it with kineme learn"
            ) from None
        finally:
            result.unlink(missing_ok=True)


def _run(command: Sequence[str], given: str, seconds: float, check: Callable[[], object]) -> int:
    """The exit code of a child process; it is ended after so many seconds (TimeoutError), and where `check` raises."""
    end, pipe = time.monotonic() + seconds, subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as child:
        try:
            told: str | None = given
            while True:
                with suppress(subprocess.TimeoutExpired):
                    child.communicate(told, timeout=min(PERIOD, max(end - time.monotonic(), 0.0)))
                    return child.returncode
                told = None  # once: what was not written yet is kept
                check()
                if time.monotonic() >= end:
                    raise TimeoutError
        finally:
            child.kill()  # if it has not ended


def plain_name(name: str) -> str:
    """The name of a file without folders and without what a file system may not take."""
    last = re.split(r"[/\\]", unquote(name))[-1]
    plain = re.sub(r"[^\w.\-()+ ]", "_", last).strip(" ")[-_LONGEST:]
    return f"_{plain}" if plain.startswith((".", "-")) or not plain else plain

"""Who reads from a connection that threads share: it must not be closed before they have finished."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Condition, get_ident

from kineme.errors import DataError


class Readers:
    """The threads that read from a library, until it is closed.

    SQLite frees what a statement needs when its connection is closed, also while another thread is in the middle of
    it, which ends the process.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._changed = Condition()
        self._reading: dict[tuple[int, int], int] = {}  # (process, thread) -> how many times over it reads
        self.closed = False

    @contextmanager
    def one_more(self) -> Iterator[None]:
        """Keep the library open while this lasts; a thread may enter it again.

        Raises
        ------
        DataError
            It was closed, and this thread was not reading before.
        """
        me = os.getpid(), get_ident()
        with self._changed:
            if me not in self._reading:
                self.check_open()
            self._reading[me] = self._reading.get(me, 0) + 1
        try:
            yield
        finally:
            with self._changed:
                self._reading[me] -= 1
                if not self._reading[me]:
                    del self._reading[me]
                    self._changed.notify_all()

    def check_open(self) -> None:
        """Refuse a library that was closed."""
        if self.closed:
            raise DataError(f"expected an open library, got {self._path}, which has been closed; open it again")

    def close(self) -> None:
        """Let nobody begin any more, and wait for the other threads that read."""
        with self._changed:
            self.closed = True
            self._changed.wait_for(lambda: not self._others())

    def _others(self) -> bool:
        """In a child, the threads of its parent do not count: they are not there."""
        me = os.getpid(), get_ident()
        return any(one != me and one[0] == me[0] for one in self._reading)

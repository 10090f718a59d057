"""Open Sound Control (OSC): numbers of messages as samples, symbols as messages, over UDP.

OSC 1.0 has no names or units for its arguments and no signature: whoever reaches the port can send.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.records import needs
from kineme.movements.channels.column_match import Columns
from kineme.sensors.listen import NOTHING, Block, Symbol

LOOPBACK, PORT = "127.0.0.1", 9000
_LARGEST = 65_536  # bytes of a datagram
_MOST = 1000  # samples and notes that are read at once, and those of one datagram more
_MOST_VALUES = 1000  # of a sample
_MOST_FLOAT = float(np.finfo(np.float32).max)  # that a message holds


class OscSource:
    """Samples from messages to one address, as ``/hand 0.1 0.2 0.3``, by default that of the first with numbers.

    `stamped`: the first number of a message is its time [s]; else samples have the time at which they come. A
    `DataError` says that python-osc is not installed, or that the port is taken.
    """

    def __init__(self, port: int = PORT, host: str = LOOPBACK, address: str | None = None, stamped: bool = False):
        with needs("python-osc", "read OSC", "osc"):
            import pythonosc.osc_packet  # noqa: F401
        self._address, self._stamped = address, stamped
        self._opened = time.monotonic()  # stamps count from here: numbers of OSC have seven digits
        self.columns: Columns | None = None
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise DataError(f"expected a free UDP port, {port} of {host} is not: {error}; choose --port") from error

    @property
    def port(self) -> int:
        """UDP port that it listens at."""
        return int(self._socket.getsockname()[1])

    def receive(self, timeout: float) -> Block:
        """Wait for a datagram, and return the samples of all that are there."""
        times, rows, notes = list[float](), list[list[float]](), list[tuple[str, str]]()
        with suppress(TimeoutError, BlockingIOError):
            while len(rows) + len(notes) < _MOST:
                self._socket.settimeout(0.0 if rows or notes else timeout)
                datagram = self._socket.recv(_LARGEST)
                now = time.monotonic() - self._opened
                try:
                    for row in self._rows(datagram, notes):
                        times.append(row.pop(0) if self._stamped else now)
                        rows.append(row)
                except Exception:  # whatever a parser raises on hostile bytes
                    notes.append(("no OSC", f"a datagram of {len(datagram):,} bytes is left out"))
        return Block(np.array(times), np.array(rows), notes) if rows else NOTHING._replace(notes=notes)

    def _rows(self, datagram: bytes, notes: list[tuple[str, str]]) -> Iterator[list[float]]:
        """Yield the numbers of each message to the address, as many as in the first one."""
        from pythonosc.osc_packet import OscPacket

        for _, message in OscPacket(datagram).messages:
            values = list(message)
            is_row = 0 < len(values) - self._stamped <= _MOST_VALUES
            is_row = is_row and all(type(value) in {int, float} for value in values)
            if self._address is None and is_row:
                self._address = message.address
                notes.append(("", f"listening to the address {message.address!r}, with {len(values)} numbers"))
            if message.address != self._address:
                notes.append(("other address", f"messages to {message.address!r} are left out; --address chooses"))
                continue
            width = len(values) - self._stamped
            if self.columns is None and is_row:
                self.columns = Columns(tuple(f"value{k}" for k in range(width)), (None,) * width)
            if not is_row or self.columns is None or width != len(self.columns.heads):
                expected = "numbers" if self.columns is None else f"{len(self.columns.heads)} numbers"
                notes.append(("other values", f"expected {expected} in {self._address!r}, got {len(values)} values"))
                continue
            yield [float(value) for value in values]

    def close(self) -> None:
        """Free the port."""
        self._socket.close()


class OscSink:
    """Symbols as messages to a UDP port: ``/kineme/symbol`` of movements that are over, ``/kineme/begins`` before.

    Their arguments are the name, how sure it is in a word, the confidence, and the stamps of start, of end and of the
    sample that decided [s], 0 where it is not known.
    """

    def __init__(self, send_to: tuple[str, int], same_clock: bool = False) -> None:
        with needs("python-osc", "send OSC", "osc"):
            from pythonosc.udp_client import SimpleUDPClient
        self._client: Any = SimpleUDPClient(*send_to)

    def send(self, symbol: Symbol) -> None:
        """Send a message; nobody need listen."""
        address = "/kineme/symbol" if symbol.is_over else "/kineme/begins"
        seconds = np.nan_to_num((symbol.start, symbol.end, symbol.time), posinf=0.0, neginf=0.0)
        numbers = np.clip((symbol.confidence, *seconds), -_MOST_FLOAT, _MOST_FLOAT).tolist()
        self._client.send_message(address, [symbol.name, symbol.certainty, *numbers])

    def close(self) -> None:
        """Close the socket."""
        self._client._sock.close()

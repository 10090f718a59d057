"""The protocols that bring samples and take symbols away: Lab Streaming Layer (LSL) and Open Sound Control (OSC).

Streams of LSL say labels and units. OSC 1.0 has no names or units for its arguments and no signature: whoever reaches
the UDP port can send.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.records import damaged_as, needs
from kineme.movements.channels.column_match import Columns
from kineme.reporting.text import first_names
from kineme.sensors.listen import NOTHING, Block, Sink, Source, Symbol

#: Streams of this machine alone are looked for, and none is announced to others.
_LOCAL = "[log]\nlevel = -3\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n[ports]\nIPv6 = disable\n"
_TEXT = 3  # format of channels that hold texts
_MOST_CHANNELS = 1000
_SYNCHRONIZED = 5.0  # seconds that the first comparison of clocks may take

LOOPBACK, PORT = "127.0.0.1", 9000
_LARGEST = 65_536  # bytes of a datagram
_MOST = 1000  # samples and notes that are read at once, and those of one datagram more
_MOST_VALUES = 1000  # of a sample
_MOST_FLOAT = float(np.finfo(np.float32).max)  # that a message holds


def _load(lan: bool) -> Any:
    """Load the library of LSL; its settings hold for the process. Those that a user names in LSLAPICFG stay."""
    with damaged_as("expected the library of LSL beside pylsl", RuntimeError), needs("pylsl", "speak LSL", "lsl"):
        import pylsl
    if not lan and "LSLAPICFG" not in os.environ:
        pylsl.set_config_content(_LOCAL)
    return pylsl


class LslSource:
    """Samples of the first usable stream of a name or a type, looked for until it is there, and again when it has gone.

    Stamps are those of the sender, in the clock of this machine. With `lan`, other machines are asked, too. `refusal`
    says of columns why they cannot be used, nothing of those that can.
    """

    def __init__(
        self, name: str | None = None, kind: str | None = None, lan: bool = False,
        refusal: Callable[[Columns], str] = lambda _: "",
    ) -> None:  # fmt: skip
        self._lsl = _load(lan)
        self._wanted = {key: value for key, value in (("name", name), ("type", kind)) if value is not None}
        self._refusal = refusal
        self._streams = self._lsl.ContinuousResolver()
        self._refused = set[str]()  # streams of which it was said why they are left out
        self._waits = False  # said that there is no stream
        self._inlet: Any = None
        self.columns: Columns | None = None

    def receive(self, timeout: float) -> Block:
        """Wait for samples of the stream, or for the stream."""
        if self._inlet is None:
            notes = self._connect()
            if self._inlet is None:
                time.sleep(timeout)
            return NOTHING._replace(notes=notes)
        try:
            rows, times = self._inlet.pull_chunk(timeout=timeout, min_samples=1, as_numpy=True)
        except RuntimeError:  # all its errors are such
            self._inlet = None
            return NOTHING._replace(notes=[("stream lost", "looking for it again")])
        return Block(np.asarray(times, dtype=float), np.asarray(rows, dtype=float))

    def _connect(self) -> list[tuple[str, str]]:
        """Take the first stream that can be used, and return what is to be said of it, or of those that cannot."""
        streams = [
            info for info in self._streams.results()
            if all(getattr(info, key)() == value for key, value in self._wanted.items())
            and (self._wanted or info.channel_format() != _TEXT)  # markers of others are no news
        ]  # fmt: skip
        if not streams and not self._waits:
            self._waits = True
            wanted = " and ".join(f"{key} {value!r}" for key, value in self._wanted.items()) or "numbers"
            return [("no stream", f"waiting for one with {wanted}")]
        self._refused &= {info.uid() for info in streams}
        reasons = list[str]()
        for stream in streams:
            if stream.uid() in self._refused:
                continue
            inlet = self._lsl.StreamInlet(stream, max_buflen=10, processing_flags=self._lsl.proc_clocksync)
            try:
                info = inlet.info(timeout=_SYNCHRONIZED)
                if why := self._unfit(info):
                    self._refused.add(stream.uid())
                    reasons.append(f"{why}; the stream {info.name()!r} is left out")
                    continue
                inlet.open_stream(timeout=_SYNCHRONIZED)
                inlet.time_correction(timeout=_SYNCHRONIZED)  # the first sample would wait for it
            except RuntimeError:
                return [("no stream", f"{stream.name()!r}, which was there, did not answer")]
            self._inlet, self.columns, self._waits = inlet, _columns(info), False
            names = [other.name() for other in streams if other is not stream]
            others = f"; {first_names(names, 6)} left out, --name chooses" if names else ""
            rate = f" at {info.nominal_srate():g} samples per second" if info.nominal_srate() else ""
            heads = first_names(self.columns.heads, 12)
            return [("", f"listening to {info.name()!r} of type {info.type()!r}, {heads}{rate}{others}")]
        return [("other columns", "; ".join(reasons))] if reasons else []  # one note: of a kind one is said at a time

    def _unfit(self, info: Any) -> str:
        """Say why a stream cannot be used; empty of one that can."""
        if info.channel_format() == _TEXT:
            return "expected numbers, got texts"
        if info.channel_count() > _MOST_CHANNELS:
            return f"expected at most {_MOST_CHANNELS:,} channels, got {info.channel_count():,}"
        return self._refusal(_columns(info))

    def close(self) -> None:
        """Leave the stream."""
        if self._inlet is not None:
            self._inlet.close_stream()


def _columns(info: Any) -> Columns:
    """Return labels and units of a stream from its description, numbers where it has none."""
    heads, units = list[str](), list[str | None]()
    channel = info.desc().child("channels").child("channel")
    for k in range(info.channel_count()):
        heads.append(channel.child_value("label") or f"value{k}")
        units.append(channel.child_value("unit") or None)
        channel = channel.next_sibling("channel")
    heads = [head if heads.count(head) == 1 else f"value{k}" for k, head in enumerate(heads)]
    return Columns(tuple(heads), tuple(units))


class LslSink:
    """Symbols as the stream "kineme" of type "Markers": of movements that are over their names, or all as JSON.

    The stamp is that of the sample that decided, if the samples come by LSL, else the time at which it is sent.
    """

    def __init__(self, names: bool = False, lan: bool = False, same_clock: bool = False) -> None:
        lsl = _load(lan)
        info = lsl.StreamInfo("kineme", "Markers", 1, lsl.IRREGULAR_RATE, lsl.cf_string, f"kineme-{os.getpid()}")
        info.desc().append_child("channels").append_child("channel").append_child_value("label", "symbol")
        self._outlet = lsl.StreamOutlet(info)
        self._names, self._same_clock = names, same_clock

    def send(self, symbol: Symbol) -> None:
        """Push a marker; nobody need listen."""
        if symbol.is_over or not self._names:
            text = symbol.name if self._names else json.dumps(symbol.to_dict(), ensure_ascii=False)
            self._outlet.push_sample([text], symbol.time if self._same_clock else 0.0)

    def close(self) -> None:
        """End the stream, once its last marker had time to leave."""
        if self._outlet is not None and self._outlet.have_consumers():
            time.sleep(0.1)
        self._outlet = None


class OscSource:
    """Samples from messages to one address, as ``/hand 0.1 0.2 0.3``, by default that of the first with numbers.

    `stamped`: the first number of a message is its time [s]; else samples have the time at which they come. `refusal`
    says of columns why they cannot be used, nothing of those that can: such messages choose neither the address nor how
    many numbers are expected. A `DataError` says that python-osc is not installed, or that the port is taken.
    """

    def __init__(
        self, port: int = PORT, host: str = LOOPBACK, address: str | None = None, stamped: bool = False,
        refusal: Callable[[Columns], str] = lambda _: "",
    ) -> None:  # fmt: skip
        with needs("python-osc", "read OSC", "osc"):
            import pythonosc.osc_packet  # noqa: F401
        self._address, self._stamped, self._refusal = address, stamped, refusal
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
        if not rows:
            return NOTHING._replace(notes=notes)
        return Block(np.array(times), np.array(rows), notes, own_stamps=self._stamped)

    def _rows(self, datagram: bytes, notes: list[tuple[str, str]]) -> Iterator[list[float]]:
        """Yield the numbers of each message to the address, as many as in the first one that can be used."""
        from pythonosc.osc_packet import OscPacket

        for _, message in OscPacket(datagram).messages:
            values = list(message)
            width = len(values) - self._stamped
            is_row = 0 < width <= _MOST_VALUES and all(type(value) in {int, float} for value in values)
            if self.columns is None and is_row and self._address in {None, message.address}:
                columns = Columns(tuple(f"value{k}" for k in range(width)), (None,) * width)
                if why := self._refusal(columns):
                    notes.append(("other columns", f"{why}; this message to {message.address!r} is left out"))
                    continue
                if self._address is None:
                    notes.append(("", f"listening to the address {message.address!r}, with {len(values)} numbers"))
                self._address, self.columns = message.address, columns
            if message.address != self._address:
                notes.append(("other address", f"messages to {message.address!r} are left out; --address chooses"))
                continue
            if not is_row or self.columns is None or width != len(self.columns.heads):
                n = "" if self.columns is None else f"{len(self.columns.heads) + self._stamped} "
                notes.append(("other values", f"expected {n}numbers in {self._address!r}, got {len(values)} values"))
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


class Adapter(NamedTuple):
    """Ways in and out by one protocol; options are the names of arguments."""

    source: Callable[..., Source]
    takes: tuple[str, ...]
    sink: Callable[..., Sink]
    gives: tuple[str, ...]


ADAPTERS = {
    "lsl": Adapter(LslSource, ("name", "kind", "lan", "refusal"), LslSink, ("names", "lan")),
    "osc": Adapter(OscSource, ("port", "host", "address", "stamped", "refusal"), OscSink, ("send_to",)),
}

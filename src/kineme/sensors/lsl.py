"""Lab Streaming Layer (LSL): samples of a stream with its labels and units, symbols as a stream of markers."""

from __future__ import annotations

import json
import os
import time
from typing import Any

import numpy as np

from kineme.io.records import damaged_as, needs
from kineme.movements.channels.column_match import Columns
from kineme.sensors.listen import NOTHING, Block, Symbol

#: Streams of this machine alone are looked for, and none is announced to others.
_LOCAL = "[log]\nlevel = -3\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n[ports]\nIPv6 = disable\n"
_TEXT = 3  # format of channels that hold texts
_MOST_CHANNELS = 1000
_SYNCHRONIZED = 5.0  # seconds that the first comparison of clocks may take


def _load(lan: bool) -> Any:
    """Load the library of LSL; its settings hold for the process. Those that a user names in LSLAPICFG stay."""
    with damaged_as("expected the library of LSL beside pylsl", RuntimeError), needs("pylsl", "speak LSL", "lsl"):
        import pylsl
    if not lan and "LSLAPICFG" not in os.environ:
        pylsl.set_config_content(_LOCAL)
    return pylsl


class LslSource:
    """Samples of the first stream of a name or a type, looked for until it is there, and again when it has gone.

    Stamps are those of the sender, in the clock of this machine. With `lan`, other machines are asked, too.
    """

    def __init__(self, name: str | None = None, kind: str | None = None, lan: bool = False) -> None:
        self._lsl = _load(lan)
        self._wanted = {key: value for key, value in (("name", name), ("type", kind)) if value is not None}
        self._streams = self._lsl.ContinuousResolver()
        self._inlet: Any = None
        self.columns: Columns | None = None

    def receive(self, timeout: float) -> Block:
        """Wait for samples of the stream, or for the stream."""
        if self._inlet is None:
            return self._connect(timeout)
        try:
            rows, times = self._inlet.pull_chunk(timeout=timeout, min_samples=1, as_numpy=True)
        except RuntimeError:  # all its errors are such
            self._inlet = None
            return NOTHING._replace(notes=[("stream lost", "looking for it again")])
        return Block(np.asarray(times, dtype=float), np.asarray(rows, dtype=float))

    def _connect(self, timeout: float) -> Block:
        streams = [
            info for info in self._streams.results()
            if info.channel_format() != _TEXT and info.channel_count() <= _MOST_CHANNELS
            and all(getattr(info, key)() == value for key, value in self._wanted.items())
        ]  # fmt: skip
        if not streams:
            time.sleep(timeout)
            wanted = " and ".join(f"{key} {value!r}" for key, value in self._wanted.items()) or "numbers"
            return NOTHING._replace(notes=[("no stream", f"waiting for one with {wanted}")])
        inlet = self._lsl.StreamInlet(streams[0], max_buflen=10, processing_flags=self._lsl.proc_clocksync)
        try:
            inlet.open_stream(timeout=_SYNCHRONIZED)
            inlet.time_correction(timeout=_SYNCHRONIZED)  # the first sample would wait for it
            info = inlet.info(timeout=_SYNCHRONIZED)
        except RuntimeError:
            return NOTHING._replace(notes=[("no stream", "the one that was there did not answer")])
        self._inlet, self.columns = inlet, _columns(info)
        others = f", {len(streams) - 1} more would do" if len(streams) > 1 else ""
        rate = f" at {info.nominal_srate():g} samples per second" if info.nominal_srate() else ""
        named = (
            f"listening to {info.name()!r} of type {info.type()!r}, {', '.join(self.columns.heads[:12])}{rate}{others}"
        )
        return NOTHING._replace(notes=[("", named)])

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

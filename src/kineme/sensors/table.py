"""The protocols that bring samples and take symbols away, with the options of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kineme.sensors.listen import Sink, Source
from kineme.sensors.lsl import LslSink, LslSource
from kineme.sensors.osc import OscSink, OscSource


class Adapter(NamedTuple):
    """Ways in and out by one protocol; options are the names of arguments."""

    source: Callable[..., Source]
    takes: tuple[str, ...]
    sink: Callable[..., Sink]
    gives: tuple[str, ...]


ADAPTERS = {
    "lsl": Adapter(LslSource, ("name", "kind", "lan"), LslSink, ("names", "lan")),
    "osc": Adapter(OscSource, ("port", "host", "address", "stamped"), OscSink, ("send_to",)),
}

"""Open Sound Control on loopback, by the real library: samples in, symbols out, and hostile datagrams."""

from __future__ import annotations

import math
import socket
import threading

import numpy as np
import pytest
from sensor_samples import make_library, take

from kineme.errors import DataError
from kineme.sensors import protocols
from kineme.sensors.listen import Listener, Symbol, listen
from kineme.sensors.protocols import OscSink, OscSource

pythonosc = pytest.importorskip("pythonosc", reason="no python-osc; pip install python-osc")
from pythonosc.dispatcher import Dispatcher  # noqa: E402
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder  # noqa: E402
from pythonosc.osc_message_builder import OscMessageBuilder  # noqa: E402
from pythonosc.osc_server import BlockingOSCUDPServer  # noqa: E402
from pythonosc.udp_client import SimpleUDPClient  # noqa: E402


@pytest.fixture
def source():
    source = OscSource(port=0)
    yield source
    source.close()


@pytest.fixture
def sender_to():
    """A function that makes a client of a source; its socket is closed at the end."""
    clients = []

    def sender(source):
        clients.append(SimpleUDPClient("127.0.0.1", source.port))
        return clients[-1]

    yield sender
    for client in clients:
        client._sock.close()


def _received(source, count=1):
    """Blocks until so many samples or notes have come."""
    times, rows, notes = [], [], []
    for _ in range(100):
        block = source.receive(0.1)
        times += block.times.tolist()
        rows += block.rows.tolist()
        notes += block.notes
        if len(rows) + len(notes) >= count:
            break
    return times, rows, notes


def test_numbers_of_the_first_address_are_samples(source, sender_to):
    sender = sender_to(source)
    sender.send_message("/hello", ["text"])
    sender.send_message("/hand", [0.5, 2, -1.25])
    sender.send_message("/hand", [1.0, 2.0, 3.0])
    sender.send_message("/foot", [1.0, 2.0, 3.0])
    times, rows, notes = _received(source, 5)
    assert rows == [[0.5, 2.0, -1.25], [1.0, 2.0, 3.0]]
    assert 0.0 < times[0] < times[1] < 60.0
    assert source.columns.are_nameless
    assert [kind for kind, _ in notes] == ["other address", "", "other address"]
    assert "'/foot'" in notes[-1][1]


def test_a_wrong_number_of_values_or_texts_are_left_out_and_said(source, sender_to):
    sender = sender_to(source)
    for values in ([1.0, 2.0], [1.0, 2.0, 3.0], [1.0, "b"], [], [True, 2.0], [3.0, math.nan]):
        sender.send_message("/hand", values)
    _, rows, notes = _received(source, 7)
    assert [row[0] for row in rows] == [1.0, 3.0]
    assert np.isnan(rows[1][1])
    assert [kind for kind, _ in notes][1:] == ["other values"] * 4
    assert notes[1][1] == "expected 2 numbers in '/hand', got 3 values"


def test_a_message_of_too_many_numbers_does_not_choose_the_address(source, sender_to):
    sender = sender_to(source)
    sender.send_message("/wide", [0.0] * 1001)
    sender.send_message("/hand", [1.0, 2.0])
    assert _received(source, 3)[1] == [[1.0, 2.0]]


def test_a_flood_of_messages_is_read_in_parts(source, sender_to, monkeypatch):
    monkeypatch.setattr(protocols, "_MOST", 50)
    bundle, message = OscBundleBuilder(IMMEDIATELY), OscMessageBuilder("/foot")
    for _ in range(40):
        bundle.add_content(message.build())
    for _ in range(5):
        sender_to(source).send(bundle.build())
    assert [len(source.receive(5.0).notes) for _ in range(3)] == [80, 80, 40]


def test_stamps_are_the_first_number_where_that_is_said(sender_to):
    source = OscSource(port=0, address="/hand", stamped=True)
    sender_to(source).send_message("/hand", [12.5, 1.0, 2.0])
    assert _received(source)[:2] == ([12.5], [[1.0, 2.0]])
    sender_to(source).send_message("/hand", [13.0, 1.0, 2.0, 3.0])
    assert _received(source)[2] == [("other values", "expected 3 numbers in '/hand', got 4 values")]
    source.close()


def test_messages_in_bundles_are_read(source, sender_to):
    message = OscMessageBuilder("/hand")
    message.add_arg(1.0)
    message.add_arg(2.0)
    inner, bundle = OscBundleBuilder(IMMEDIATELY), OscBundleBuilder(IMMEDIATELY)
    inner.add_content(message.build())
    bundle.add_content(inner.build())
    sender_to(source).send(bundle.build())
    assert _received(source, 2)[1] == [[1.0, 2.0]]


_BUNDLE = b"#bundle\0" + b"\0" * 7 + b"\1"
HOSTILE = {
    "nothing": b"",
    "noise": bytes(range(256)),
    "an address without an end": b"/hand",
    "types without values": b"/hand\0\0\0,ffff\0\0\0",
    "a type that is none": b"/hand\0\0\0,?\0\0\0\0\0\0",
    "text that is no UTF-8": b"/\xff\xfe\0,s\0\0\xff\xff\xff\0",
    "a blob of two gigabytes": b"/hand\0\0\0,b\0\0\x7f\xff\xff\xff",
    "a bundle of a negative size": _BUNDLE + b"\xff\xff\xff\xff",
    "a bundle that is cut": _BUNDLE + b"\0\0\0\x10/hand",
    "bundles in bundles": b"".join(
        _BUNDLE + (20 * (2000 - k)).to_bytes(4, "big") for k in range(2000)
    ),
    "brackets": b"/hand\0\0\0," + b"[" * 2000 + b"\0\0\0",
}  # fmt: skip


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_datagram_is_left_out_and_the_next_sample_is_read(source, kind, sender_to):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(HOSTILE[kind], ("127.0.0.1", source.port))
        _, rows, notes = _received(source)
        assert rows == []
        assert {name for name, _ in notes} <= {"no OSC", "other address", "other values"}
    sender_to(source).send_message("/hand", [1.0, 2.0])
    assert _received(source, 2)[1] == [[1.0, 2.0]]


def test_it_listens_to_this_machine_alone_and_says_that_a_port_is_taken(source):
    assert source._socket.getsockname()[0] == "127.0.0.1"
    with pytest.raises(DataError, match=f"expected a free UDP port, {source.port} of 127.0.0.1 is not"):
        OscSource(port=source.port)


def test_symbols_go_out_as_messages():
    heard, dispatcher = [], Dispatcher()
    dispatcher.set_default_handler(lambda *message: heard.append(message))
    with BlockingOSCUDPServer(("127.0.0.1", 0), dispatcher) as server:
        sink = OscSink(server.server_address)
        sink.send(Symbol("wave", False, "looks like", 0.75, 1.5, math.nan, 2.0))
        sink.send(Symbol("größer", True, "sure", 1.0, 1.5, 2.5, 2.75))
        sink.send(Symbol("late", False, "looks like", 0.5, 1e39, math.inf, -1e300))
        server.handle_request()
        server.handle_request()
        server.handle_request()
        sink.close()
    most = float(np.finfo(np.float32).max)  # numbers of OSC have 32 bits
    assert heard == [
        ("/kineme/begins", "wave", "looks like", 0.75, 1.5, 0.0, 2.0),
        ("/kineme/symbol", "größer", "sure", 1.0, 1.5, 2.5, 2.75),
        ("/kineme/begins", "late", "looks like", 0.5, most, 0.0, -most),
    ]


def test_movements_that_are_sent_are_named_over_loopback(tmp_path, sender_to):
    """All samples of a movement at once, with their times; what cannot be used comes first."""
    heard, told, rows, done = [], [], take("GShape"), threading.Event()

    def send():
        sender.send_message("/status", [1.0, 0.0])
        sender.send_message("/hand", [1.0, 2.0, 3.0, 4.0])
        for k, row in enumerate(rows.tolist()):
            sender.send_message("/hand", [k / 100, *row])
            done.wait(0.001)

    class Heard:
        def send(self, symbol):
            heard.append(symbol)
            if symbol.is_over:
                raise KeyboardInterrupt

        def close(self):
            done.set()

    with make_library(tmp_path / "actions") as library:
        listener = Listener(library, told.append)
        stamped = OscSource(port=0, stamped=True, refusal=listener.refusal)
        sender = sender_to(stamped)
        sending = threading.Thread(target=send)
        sending.start()
        listen(listener, stamped, [Heard()], 60.0)
        sending.join()
    assert [symbol.name for symbol in heard if symbol.is_over] == ["GShape"]
    assert listener.summary.problems["other columns"] == 2
    assert told[:2] == [
        "other columns: expected 2 values a sample, as the library has them, got 1; choose them with --columns; this "
        "message to '/status' is left out",
        "listening to the address '/hand', with 3 numbers",
    ]

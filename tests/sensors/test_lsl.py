"""Lab Streaming Layer on loopback, by the real library: samples with labels and units in, markers out."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
import uuid

import numpy as np
import pytest
from sensor_samples import RATE, make_library, take

from kineme.sensors.listen import Listener, Symbol
from kineme.sensors.protocols import LslSink, LslSource

pylsl = pytest.importorskip("pylsl", reason="no pylsl; pip install pylsl", exc_type=(ImportError, RuntimeError))


def _outlet(name, labels=("x", "y"), unit="mm", source_id="", rate=RATE):
    info = pylsl.StreamInfo(name, "MoCap", len(labels), rate, pylsl.cf_double64, source_id or name)
    channels = info.desc().append_child("channels")
    for label in labels:
        channels.append_child("channel").append_child_value("label", label).append_child_value("unit", unit)
    return pylsl.StreamOutlet(info)


@pytest.fixture
def name():
    """A name that no other stream of this machine has."""
    return f"hand-{uuid.uuid4().hex}"


def _connected(source):
    notes = []
    for _ in range(100):
        notes += source.receive(0.1).notes
        if source.columns is not None:
            return notes
    raise AssertionError(f"no stream was found: {notes}")


def _rows(source, count, seconds=10.0):
    times, rows, until = [], [], time.monotonic() + seconds
    while len(rows) < count and time.monotonic() < until:
        block = source.receive(0.1)
        times += block.times.tolist()
        rows += block.rows.tolist()
    return times, rows


def test_a_stream_is_found_by_its_name_with_labels_units_and_stamps(name):
    source = LslSource(name=name)
    assert [kind for kind, _ in source.receive(0.05).notes] == ["no stream"]
    outlet = _outlet(name)
    notes = _connected(source)
    assert notes[-1] == ("", f"listening to {name!r} of type 'MoCap', x, y at 100 samples per second")
    assert source.columns == (("x", "y"), ("mm", "mm"))
    now = pylsl.local_clock()
    outlet.push_sample([1.0, 2.0], now)
    outlet.push_sample([math.nan, 3.0], now + 0.01)
    times, rows = _rows(source, 2)
    assert times == pytest.approx([now, now + 0.01], abs=0.005)
    np.testing.assert_equal(rows, [[1.0, 2.0], [math.nan, 3.0]])
    source.close()


def _notes(source, until, seconds=20.0):
    """What it says until one of its sentences has these words."""
    notes, end = [], time.monotonic() + seconds
    while time.monotonic() < end and not any(until in sentence for _, sentence in notes):
        notes += source.receive(0.02).notes
    return notes


def test_a_stream_of_texts_is_said_and_none_is_waited_for_once(name):
    """It was as if there were no stream, counted with each look."""
    outlet, source = _outlet(name), LslSource(name=name, kind="EEG")
    texts = pylsl.StreamOutlet(pylsl.StreamInfo(name, "EEG", 1, 0, pylsl.cf_string, name + "t"))
    assert _notes(source, "texts") + _notes(source, "never", 0.3) == [
        ("no stream", f"waiting for one with name {name!r} and type 'EEG'"),
        ("other columns", f"expected numbers, got texts; the stream {name!r} is left out"),
    ]
    assert source.columns is None
    source.close()
    del outlet, texts


def test_of_several_streams_the_one_that_can_be_used_is_taken(name):
    """Whichever answered first was taken, and its samples were left out to the end."""
    eye = _outlet(name, ("x", "y", "z"), source_id=name + "e")
    source = LslSource(name=name, refusal=lambda columns: "expected 2" if len(columns.heads) != 2 else "")
    assert _notes(source, "left out")[-1] == ("other columns", f"expected 2; the stream {name!r} is left out")
    hand = _outlet(name, source_id=name + "h")
    (listening,) = _notes(source, "listening")
    assert listening[1].endswith(f"x, y at 100 samples per second; {name} left out, --name chooses")
    assert source.columns.heads == ("x", "y")
    source.close()
    del eye, hand


def test_columns_without_labels_or_with_one_twice_have_numbers(name):
    outlet, source = _outlet(name, ("", "x", "x", "y"), unit=""), LslSource(name=name)
    _connected(source)
    assert source.columns == (("value0", "value1", "value2", "y"), (None,) * 4)
    source.close()
    del outlet


def test_a_stream_that_is_gone_and_comes_again_is_read_on(name):
    source, outlet = LslSource(name=name), _outlet(name)
    _connected(source)
    outlet.push_sample([1.0, 2.0])
    assert _rows(source, 1)[1] == [[1.0, 2.0]]
    del outlet
    time.sleep(0.3)
    outlet = _outlet(name)
    rows, until = [], time.monotonic() + 20.0
    while not rows and time.monotonic() < until:
        outlet.push_sample([3.0, 4.0])
        rows = _rows(source, 1, 0.2)[1]
    assert rows[0] == [3.0, 4.0]
    source.close()


def test_movements_are_named_and_markers_say_so_with_the_stamp_of_the_sample(tmp_path, name):
    source, outlet, sink = LslSource(name=name), _outlet(name), LslSink(same_clock=True)
    markers = pylsl.StreamInlet(pylsl.resolve_bypred("type='Markers' and name='kineme'", timeout=10)[0])
    markers.open_stream(timeout=10)
    _connected(source)
    rows, begun = take("Sine"), pylsl.local_clock()
    with make_library(tmp_path / "actions") as library:
        listener = Listener(library, print)
        for k, row in enumerate(rows):
            outlet.push_sample(row, begun + k / RATE)
            for symbol in listener.take(source.receive(1.0), source.columns, begun + k / RATE):
                sink.send(symbol)
    said = []
    while not said or not said[-1][0]["is_over"]:
        sample, stamp = markers.pull_sample(timeout=10)
        assert sample, said
        said.append((json.loads(sample[0]), stamp))
    assert said[-1][0]["name"] == "Sine"
    assert said[-1][1] == pytest.approx(said[-1][0]["time"], abs=1e-3)
    sink.close()
    source.close()


def test_markers_may_be_the_names_of_ended_movements_alone():
    sink = LslSink(names=True)
    markers = pylsl.StreamInlet(pylsl.resolve_bypred("type='Markers' and name='kineme'", timeout=10)[0])
    markers.open_stream(timeout=10)
    sink.send(Symbol("wave", False, "looks like", 0.9, 1.0, 2.0, 1.5))
    sink.send(Symbol("größer", True, "sure", 1.0, 1.0, 2.0, 2.3))
    assert markers.pull_sample(timeout=10)[0] == ["größer"]
    sink.close()


_SOCKETS = """
import os
from kineme.sensors.protocols import LslSink, LslSource
source, sink = LslSource(name="nobody"), LslSink()
source.receive(0.5)
own = set()
for name in os.listdir("/proc/self/fd"):
    try:
        own.add(os.readlink(f"/proc/self/fd/{name}")[8:-1])  # socket:[inode]
    except OSError:
        pass
for line in list(open("/proc/self/net/udp"))[1:] + list(open("/proc/self/net/udp6"))[1:]:
    fields = line.split()
    if fields[9] in own and fields[1].endswith(":40BB"):
        print(fields[1])
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="no /proc")
def test_streams_are_announced_to_this_machine_alone():
    """Port 16571 is where LSL answers who looks for streams."""
    environment = {key: value for key, value in os.environ.items() if key != "LSLAPICFG"}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run(
        [sys.executable, "-c", _SOCKETS], env=environment, capture_output=True, text=True, check=True, timeout=60
    )
    assert set(done.stdout.split()) == {"0100007F:40BB"}

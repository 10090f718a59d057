"""Streams of any protocol: where movements begin and end, what they are called, and what cannot be used."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_samples import RATE, make_library, session, take

import kineme
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.column_match import Columns
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import of_channels
from kineme.sensors import listen as listening
from kineme.sensors.listen import NOTHING, Block, Listener, Summary, Symbol, listen
from soaking import examples, slow

PLAIN = Columns(("value0", "value1"), (None, None))


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    with make_library(tmp_path_factory.mktemp("listening") / "actions") as library:
        yield library


class Heard:
    """A listener, what it tells, and the symbols of what it is fed."""

    def __init__(self, library, **options):
        self.told, self.symbols = [], []
        self.listener = Listener(library, self.told.append, **options)
        self.clock, self.stamp = 1000.0, 50.0

    def feed(self, rows, columns=PLAIN, block=20):
        """Rows at 100 Hz, so many at once."""
        for k in range(0, len(rows), block):
            part = rows[k : k + block]
            stamps = self.stamp + np.arange(1, len(part) + 1) / RATE
            self.stamp, self.clock = stamps[-1], self.clock + len(part) / RATE
            self.take(Block(stamps, part), columns)
        return self

    def take(self, block, columns=PLAIN):
        self.symbols += self.listener.take(block, columns, self.clock)

    def wait(self, seconds):
        """Nothing comes for so long."""
        for _ in range(round(seconds / 0.05)):
            self.clock, self.stamp = self.clock + 0.05, self.stamp + 0.05
            self.take(NOTHING)
        return self

    @property
    def ended(self):
        return [symbol.name for symbol in self.symbols if symbol.is_over]


@pytest.mark.parametrize("block", [slow(1), 2, 400])
def test_movements_between_rests_are_named_before_and_when_they_are_over(library, block):
    heard = Heard(library).feed(session("GShape", "WShape"), block=block)
    names = [symbol.name for symbol in heard.symbols if symbol.is_over and symbol.certainty != "new"]
    assert names == ["GShape", "WShape"]
    assert sum(heard.listener.summary.symbols.values()) == len(heard.ended)
    if block <= 2:
        first = next(k for k, symbol in enumerate(heard.symbols) if symbol.name == "GShape")
        assert not heard.symbols[first].is_over
        assert heard.symbols[first].certainty == "looks like"


def test_a_sensor_that_trembles_rests_too(library):
    """The extent of white noise in the time of a rest was motion: every movement was cut at the longest duration."""
    rows = session("GShape", "WShape")
    size = np.ptp(take("Sine"), axis=0).max()
    heard = Heard(library).feed(rows + 0.01 * size * np.random.default_rng(0).normal(size=rows.shape))
    names = [symbol.name for symbol in heard.symbols if symbol.is_over and symbol.certainty != "new"]
    assert names == ["GShape", "WShape"]
    assert "no rest" not in heard.listener.summary.problems


def test_degrees_do_not_hide_meters(tmp_path):
    """Movements of half a meter were none beside a wrist that turns by 60 degrees."""
    channels = (
        *(Channel(axis, "position", (axis,), "m") for axis in "xy"),
        Channel("wrist", "angle", ("wrist",), "deg"),
    )
    demos = kineme.load_lasa(["Sine"])[:3]
    paths = [np.column_stack((demo.positions / 100, np.linspace(0.0, 60.0, len(demo)))) for demo in demos]
    learned = of_channels(Demonstrations.from_arrays(paths).movements, channels)
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(Demonstrations.of_movements(learned), ["Sine"] * len(demos))
        rows = np.column_stack((take("Sine") / 100, np.zeros(len(take("Sine")))))
        heard = Heard(library).feed(rows, Columns(("x", "y", "wrist"), ("m", "m", "deg")))
    assert "Sine" in heard.ended


def test_what_is_too_slow_to_begin_a_movement_is_said(library):
    """It was missed without a word."""
    rows = take("Sine")
    slow_rows = 0.3 * np.column_stack(
        [np.interp(np.arange(0.0, len(rows), 0.3), np.arange(len(rows)), x) for x in rows.T]
    )
    heard = Heard(library).feed(slow_rows)
    assert not heard.ended
    assert len(heard.told) == 1
    assert heard.told[0].startswith("no movement: something moves, but a movement begins with 8 % of the size")
    size = np.ptp(rows, axis=0).max()
    trembling = 0.01 * size * np.random.default_rng(0).normal(size=(700, 2))
    assert not Heard(library).feed(rows[:1] + trembling).told


def test_start_and_end_are_those_of_the_motion_and_the_decision_comes_a_rest_later(library):
    heard = Heard(library).feed(take("Sine", rest=1.0))
    (symbol,) = [symbol for symbol in heard.symbols if symbol.is_over]
    moving = len(take("Sine", rest=0.0)) / RATE
    assert symbol.start == pytest.approx(51.0, abs=0.25)
    assert symbol.end == pytest.approx(51.0 + moving, abs=0.35)
    assert 0.25 < symbol.time - symbol.end < 0.5
    assert symbol.to_dict()["name"] == "Sine"


def test_a_stream_that_stops_ends_the_movement_and_says_so_and_that_it_returned(library):
    heard = Heard(library).feed(take("CShape")[:-90], block=5)
    assert not heard.ended  # it moves still
    heard.wait(1.0)
    assert not heard.ended  # its samples may come still, as a group
    heard.wait(2.0)
    assert heard.ended == ["CShape"]
    assert [sentence.split(":")[0] for sentence in heard.told] == ["stream stopped"]
    heard.feed(take("CShape"), block=5)
    assert heard.ended == ["CShape", "CShape"]
    assert heard.told[1].startswith("stream returned: after 3.0")


def test_a_gap_ends_the_movement_before_it(library):
    heard = Heard(library).feed(take("GShape")[:-60])
    heard.stamp, heard.clock = heard.stamp + 3.0, heard.clock + 3.0
    heard.feed(take("Sine"))
    assert heard.ended == ["GShape", "Sine"]
    assert any(sentence.startswith("gap: no samples for 3.0 s") for sentence in heard.told)


def test_a_movement_begins_behind_the_gap_in_which_a_hand_was_gone(library):
    """The way across the gap, while nothing was under way, was taken for the first motion."""
    heard, begins = Heard(library).feed(take("GShape")), []
    for name in ("Sine", "WShape"):
        heard.wait(1.5)
        begins.append(heard.stamp)
        heard.feed(take(name)[60:])
    ended = [symbol for symbol in heard.symbols if symbol.is_over]
    assert [symbol.name for symbol in ended] == ["GShape", "Sine", "WShape"]
    assert all(symbol.start > begin for symbol, begin in zip(ended[1:], begins, strict=True))


def test_samples_that_come_in_groups_are_taken_by_their_stamps(library):
    """Each group was a movement of its own, and a gap within one a clock that jumped."""
    heard = Heard(library)
    rows = np.concatenate((take("GShape")[:-60], take("Sine")))
    stamps = heard.stamp + np.arange(1, len(rows) + 1) / RATE
    stamps[-len(take("Sine")) :] += 1.0
    for came in np.arange(stamps[0] + 1.5, stamps[-1] + 3.0, 1.5):
        for _ in range(29):
            heard.clock += 0.05
            heard.take(NOTHING)
        heard.clock += 0.05
        group = (stamps >= came - 1.5) & (stamps < came)
        heard.take(Block(stamps[group], rows[group]))
    assert heard.ended == ["GShape", "Sine"]
    assert [sentence[:26] for sentence in heard.told] == ["gap: no samples for 1.0 s;"]


def test_samples_without_stamps_of_their_own_end_a_movement_at_once(library):
    heard = Heard(library)
    heard.take(Block(heard.stamp + np.arange(400) / RATE, take("CShape")[:400], own_stamps=False))
    assert heard.wait(0.7).ended


@pytest.mark.parametrize("by", [-3600.0, -2.0, 900.0])
def test_a_clock_that_jumps_drops_the_movement_under_way_and_the_next_one_is_named(library, by):
    heard = Heard(library).feed(take("GShape")[:300])
    heard.stamp += by
    heard.feed(take("Sine"))
    assert heard.ended == ["Sine"]
    assert any(sentence.startswith(f"clock jumped: by {by + 1 / RATE:+.3g} s") for sentence in heard.told)


def test_samples_that_cannot_be_used_are_left_out_counted_and_said_once(library):
    rows = take("Sine")
    rows[150:160] = np.nan
    rows[200, 0] = np.inf
    rows[201, 1] = 1e200
    heard = Heard(library).feed(rows, block=1)
    assert heard.ended == ["Sine"]
    assert heard.listener.summary.problems["not finite"] == 12
    assert len(heard.told) == 1
    heard.take(Block(np.array([heard.stamp - 0.01, heard.stamp]), rows[-2:]))
    assert heard.listener.summary.problems["not later"] == 2


def test_only_nan_under_way_is_silence(library):
    heard = Heard(library).feed(take("CShape")[:-90], block=5).feed(np.full((100, 2), np.nan))
    assert heard.ended == ["CShape"]


def test_columns_are_found_by_names_units_or_as_chosen(tmp_path):
    shapes = kineme.load_lasa(["GShape", "Sine"])
    for movement in (shapes[k] for k in (0, 1, 2, 7, 8, 9)):
        columns = np.column_stack((movement.times, movement.positions))
        path = tmp_path / "recordings" / str(movement.label) / f"{movement.times[-1]:.5f}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, columns, delimiter=",", header="time,x [mm],y [mm]", comments="")
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(kineme.read_recordings(tmp_path / "recordings"))
        rows = take("GShape")
        turned = np.column_stack((rows[:, 1] / 1000, np.zeros(len(rows)), rows[:, 0] / 1000))
        by_name = Heard(library).feed(turned, Columns(("y", "other", "x"), ("m", None, "m")))
        assert by_name.ended == ["GShape"]
        chosen = Heard(library, choose=("b", "0")).feed(turned, Columns(("a", "c", "b"), ("m", None, "m")))
        assert chosen.ended == ["GShape"]
        assert not by_name.told + chosen.told
        silent = Heard(library).feed(turned, Columns(("y", "other", "x"), (None,) * 3))
        assert silent.told == ["the stream says no units; taken as x [mm], y [mm], as in the library"]
        missing = Heard(library).feed(turned[:5], Columns(("a", "c", "b"), (None,) * 3))
        assert "expected the column 'x" in missing.told[0]
        assert "choose others with --columns" in missing.told[0]
        wrong = Heard(library, choose=("d",)).feed(turned[:5], Columns(("a", "c", "b"), (None,) * 3))
        assert wrong.told == ["other columns: expected the columns d, got a, c, b; its samples are left out"]
        nameless = Heard(library).feed(turned, Columns(("value0", "value1", "value2"), (None,) * 3))
        assert "expected 2 values a sample" in nameless.told[0]
        assert nameless.listener.summary.samples == len(turned)


def test_a_sensor_that_never_rests_is_cut_and_said(library):
    t = np.arange(0.0, 60.0, 1.0 / RATE)
    shaking = 20.0 * np.column_stack((np.sin(9.0 * t), np.cos(7.0 * t)))
    heard = Heard(library).feed(shaking, block=10)
    assert len(heard.ended) > 1
    assert any(sentence.startswith("no rest") for sentence in heard.told)


def test_what_others_teach_is_known_from_the_next_movement_on(tmp_path):
    library = make_library(tmp_path / "actions")
    heard = Heard(library)
    worm = kineme.load_lasa(["Worm"])
    heard.feed(take("Worm"))
    assert heard.ended[-1] == "unknown"
    library.learn(worm[[0, 1, 2, 3]])
    heard.feed(take("Sine")).feed(take("Worm"))
    assert heard.ended[-1] == "Worm"
    library.close()


def test_a_library_that_is_emptied_meanwhile_names_movements_as_before(tmp_path):
    with make_library(tmp_path / "actions") as library:
        heard = Heard(library)
        for symbol in library.symbols():
            library.delete(symbol.name)
        heard.feed(take("Sine")).feed(take("CShape"))
        assert [name for name in heard.ended if name != "unknown"] == ["Sine", "CShape"]
        assert heard.told[0].startswith("library: expected")
        assert heard.told[0].endswith("movements are named as before")


def test_a_person_is_remembered_by_movements_that_are_over(library, monkeypatch):
    """As `Live.next` does; the rest behind a movement is none of it."""
    heard, ends = Heard(library), []
    remember = heard.listener._live.remember
    monkeypatch.setattr(heard.listener._live, "remember", lambda *given: ends.append(given[1]) or remember(*given))
    heard.feed(take("Sine")).feed(take("CShape"))
    assert ends == [symbol.end for symbol in heard.symbols if symbol.is_over]
    assert len(ends) > 1


def test_a_clock_that_stands_almost_still_takes_no_more_memory(library, monkeypatch):
    monkeypatch.setattr(listening, "_RECENT", 50)
    heard = Heard(library)
    heard.take(Block(50.0 + 1e-9 * np.arange(300), np.zeros((300, 2))))
    assert len(heard.listener._recent) <= 51


def test_the_symbol_of_a_movement_that_ended_waits_for_no_recognition(library):
    """It was recognized while the rest was still short."""
    heard, calls = Heard(library), []
    finish = heard.listener._live.finish
    heard.listener._live.finish = lambda until=None: calls.append(until) or finish(until)
    for row in take("WShape"):
        before = len(calls)
        heard.feed(row[None])
        if heard.ended:
            break
    assert heard.ended == ["WShape"]
    assert 0 < len(calls) == before
    assert calls[-1] == heard.symbols[-1].end  # the rest is no part of it


@settings(max_examples=examples(6, 60), deadline=None)
@given(st.data())
def test_nothing_that_comes_raises(library, data):
    heard = Heard(library)
    numbers = st.floats(width=32) | st.floats() | st.just(0.0)
    for _ in range(data.draw(st.integers(1, 6))):
        k, m = data.draw(st.integers(0, 5)), data.draw(st.integers(0, 4))
        values = st.lists(numbers, min_size=k * (m + 1), max_size=k * (m + 1))
        block = np.array(data.draw(values), dtype=float).reshape(k, m + 1)
        names = Columns(tuple(f"value{j}" for j in range(m)), (None,) * m)
        heard.clock += data.draw(st.floats(0.0, 10.0))
        heard.take(Block(block[:, 0], block[:, 1:]), names)
    heard.feed(session("Sine")).wait(1.0)
    assert heard.ended[-1] == "Sine" or heard.told


class Recorded:
    """A source that has all samples, and what became of a sink."""

    columns = PLAIN

    def __init__(self, rows, interrupts=False):
        self.rows, self.at, self.interrupts, self.closed, self.sent = rows, 0, interrupts, False, []

    def receive(self, timeout):
        if self.at >= len(self.rows):
            if self.interrupts:
                raise KeyboardInterrupt
            time.sleep(timeout)
            return NOTHING
        rows = self.rows[self.at : self.at + 5]
        self.at += 5
        return Block((self.at + np.arange(len(rows))) / RATE, rows)

    def send(self, symbol):
        self.sent.append(symbol)

    def close(self):
        self.closed = True


class Broken(Recorded):
    error = OSError("no route to host")

    def send(self, symbol):
        raise self.error


def test_it_ends_when_nobody_reads_the_standard_output_any_more(library):
    source, broken = Recorded(take("Sine")), Broken([])
    broken.error = BrokenPipeError()
    with pytest.raises(BrokenPipeError):
        listen(Listener(library, print), source, [broken], 20.0)
    assert source.closed
    assert broken.closed


def test_ctrl_c_ends_with_a_summary_and_everything_is_closed_and_a_sink_that_fails_is_said(library):
    told = []
    source, sink, broken = Recorded(take("Sine"), interrupts=True), Recorded([]), Broken([])
    summary = listen(Listener(library, told.append), source, [broken, sink])
    assert [symbol.name for symbol in sink.sent if symbol.is_over] == ["Sine"]
    assert (source.closed, sink.closed, broken.closed) == (True, True, True)
    assert summary.symbols == {"Sine": 1}
    assert "no route to host" in told[0]
    lines = summary.lines()
    assert lines[0] == f"{len(source.rows):,} samples, 1 movement: Sine 1"
    assert lines[1].startswith("from a sample to its symbol: ")
    assert len(summary.latencies) == len(sink.sent)


def test_it_ends_after_some_seconds(library):
    began = time.monotonic()
    assert listen(Listener(library, print), Recorded([]), [], 0.2).lines() == ["0 samples, 0 movements"]
    assert 0.1 < time.monotonic() - began < 5.0


def test_a_summary_is_plain_words():
    summary = Summary()
    summary.samples = 1
    assert summary.lines() == ["1 sample, 0 movements"]
    unfinished = Symbol("a", False, "looks like", 0.9, 0.0, math.nan, 1.0)
    assert unfinished.to_dict()["end"] is None

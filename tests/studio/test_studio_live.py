"""Movements under way, over the websocket."""

from __future__ import annotations

import asyncio
import json
import sqlite3
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from studio_samples import LIVE, make_library, request_of, samples

from kineme import ActionLibrary, Recognizer
from kineme.errors import DataError, SpecificationError, TrajectoryError
from kineme.studio.page.write_page import library_page
from kineme.studio.server.live_socket import MOST, Follower, Sources, _Client, parsed_samples
from kineme.studio.server.studio import Changes, Studio
from kineme.studio.snapshot import DRAWN
from movement_samples import draw_shapes, turn


def _said(socket, kind):
    """The next message of a kind, past those of changes."""
    while kind not in (message := socket.receive_json()):
        assert set(message) <= {"changed", "state"}, message
    return message[kind]


def _draw(socket, k, seed=99, step=6):
    rows = samples(k, seed)
    for start in range(0, len(rows), step):
        socket.send_json({"samples": rows[start : start + step]})
        state = _said(socket, "state")
    return state


def test_a_drawing_is_named_while_it_is_drawn_and_at_its_end(client, folder):
    with client.websocket_connect(LIVE) as socket:
        state = _draw(socket, 2)
        assert state["ranked"][0]["label"] == state["label"] == "kind 2"
        assert state["progress"] > 0.8
        assert 0 <= state["unknown"] < 0.5
        assert state["arrival"] == pytest.approx(1.5, abs=0.3)
        assert np.shape(state["path"]) == (20, 2)
        socket.send_json({"finish": True})
        answer = _said(socket, "answer")
        assert answer["label"] == "kind 2"
        assert answer["nearest"][0]["index"] in {7, 8, 9}
        assert _draw(socket, 1)["label"] == "kind 1"  # after the end another one begins
        socket.send_json({"reset": True})
        assert _draw(socket, 3)["label"] == "kind 3"


def test_a_message_of_several_words_is_done_samples_first_and_then_its_end(client):
    later = (np.array(samples(1)) + np.array([10.0, 0.0, 0.0])).tolist()
    with client.websocket_connect(LIVE) as socket:
        for samples_first, samples_then in ((samples(2), later), (samples(3), samples(0))):
            socket.send_json({"finish": True, "samples": samples_first, "reset": False})
            socket.send_json({"samples": samples_then, "reset": True, "finish": True})
        socket.send_json({"name": 7})  # refused, so that whoever waits for an answer more gets an error
        assert [_said(socket, "answer")["label"] for _ in range(4)] == ["kind 2", "kind 1", "kind 3", "kind 0"]
        assert "expected a name" in _said(socket, "error")


def test_states_are_those_of_a_stream_of_the_library_that_expects_another_tempo(client, folder):
    rows = np.array(samples(1)) * [0.4, 1, 1]
    with ActionLibrary(folder, read_only=True) as library:
        ours = library.stream(early=DRAWN).update(rows[:30, 0], rows[:30, 1:])
        strict = library.stream().update(rows[:30, 0], rows[:30, 1:])
        page = library_page(library, "the same")[1]
    assert abs(ours.ranked[0].confidence - strict.ranked[0].confidence) > 0.05
    assert page.header["early"]["duration_spread"] == DRAWN.duration_spread
    with client.websocket_connect(LIVE) as socket:
        socket.send_json({"samples": rows[:30].tolist()})
        state = _said(socket, "state")
    assert [candidate["label"] for candidate in state["ranked"]] == [candidate.label for candidate in ours.ranked]
    assert state["ranked"][0]["confidence"] == pytest.approx(ours.ranked[0].confidence)
    assert state["ranked"][0]["probability"] == pytest.approx(ours.ranked[0].confidence / (1 - ours.unknown))
    assert state["certainty"] == ours.certainty
    assert state["progress"] == pytest.approx(ours.progress)
    assert np.array(state["path"]) == pytest.approx(ours.path)


def test_points_that_turn_together_are_named_while_they_move(tmp_path, open_studio, monkeypatch):
    """As by a stream of the library, turned in space; a page of such a library is refused in words."""
    monkeypatch.setenv("KINEME_COMPILED", "never")
    R = np.kron(np.eye(2), turn(0.5, 3))
    movement, recognizer = draw_shapes([1, 1, 1], 6, spread=0.2)[1], Recognizer(classifier="nearest-each", points=2)
    with ActionLibrary(tmp_path / "hands", create=True, recognizer=recognizer) as library:
        library.learn(draw_shapes([2, 1, 1], 6))
        ours = library.stream(early=DRAWN).update(movement.times, movement.positions @ R.T)
        with pytest.raises(SpecificationError, match="got 6 dimensions, which cannot be drawn"):
            library_page(library, "hands")
    with open_studio(tmp_path / "hands").websocket_connect(LIVE) as socket:
        socket.send_json({"samples": np.column_stack((movement.times, movement.positions @ R.T)).tolist()})
        state = _said(socket, "state")
    assert state["ranked"][0]["label"] == movement.label
    assert state["ranked"][0]["confidence"] == pytest.approx(ours.ranked[0].confidence)
    assert np.array(state["path"]) == pytest.approx(ours.path)


NONSENSE = [
    "",
    "{",
    "[]",
    "null",
    "7",
    '"samples"',
    "{}",
    '{"samples": null}',
    '{"samples": []}',
    '{"samples": [1, 2]}',
    '{"samples": [[]]}',
    '{"samples": [[0]]}',
    '{"samples": [["0", 1, 2]]}',
    '{"samples": [[0, true, 2]]}',
    '{"samples": [[0, null, 2]]}',
    '{"samples": [[0, NaN, 2]]}',
    '{"samples": [[0, 1e999, 2]]}',
    '{"samples": [[0, 1e200, 2]]}',
    '{"samples": [[0, 1, 2], [1, 2]]}',
    '{"samples": [[0, 1' + "0" * 500 + ", 2]]}",
    '{"reset": 1}',
    '{"finish": "yes"}',
    '{"samples": [[9, 1, 2]], "finish": "yes"}',
    '{"finish": true, "samples": [[0]]}',
    '{"__proto__": 1}',
    '{"name": 7}',
    '{"name": "  "}',
    '{"name": "' + "x" * 101 + '"}',
    '{"name": "\\ud800"}',
    "[" * 50_000,
    '{"samples": ' + json.dumps([[0, 1, 2]] * 10_001) + "}",
]


def test_nonsense_is_answered_in_a_sentence_and_the_stream_goes_on(client):
    with client.websocket_connect(LIVE) as socket:
        _draw(socket, 0)
        for text in NONSENSE:
            socket.send_text(text)
            assert "expected" in _said(socket, "error"), text
        socket.send_bytes(b"\xff\x00")
        assert "expected" in _said(socket, "error")
        socket.send_json({"finish": True})
        assert _said(socket, "answer")["label"] == "kind 0"


def test_samples_that_do_not_fit_are_skipped_and_counted(client):
    with client.websocket_connect(LIVE) as socket:
        _draw(socket, 0)
        socket.send_json({"samples": [[0.1, 5, 5], [1.7, 1, 2]]})
        state = _said(socket, "state")
        assert state["skipped"] >= 1
        socket.send_json({"samples": [[2.0, 1, 2, 3]]})
        state = _said(socket, "state")
        assert any("skipped" in sentence for sentence in state["status"])
        socket.send_json({"finish": True})
        assert _said(socket, "answer")["ranked"]


def test_samples_of_other_widths_behind_each_other_are_taken_in_one_by_one(client):
    with client.websocket_connect(LIVE) as socket:
        rows = samples(0)
        for k in range(0, 60, 6):  # faster than they are answered: some wait together
            socket.send_json({"samples": rows[k : k + 6]})
            socket.send_json({"samples": [[*row, 0.0] for row in rows[k : k + 6]]})
        socket.send_json({"finish": True})
        assert _said(socket, "answer")["ranked"][0]["label"] == "kind 0"


def test_too_little_to_answer_is_said(client):
    with client.websocket_connect(LIVE) as socket:
        socket.send_json({"samples": [[0, 0, 0], [0.1, 1, 1]]})
        state = _said(socket, "state")
        assert (state["ranked"], state["progress"], state["arrival"], state["path"]) == ([], 0.0, None, [])
        socket.send_json({"finish": True})
        assert "at least 4" in _said(socket, "error")
        socket.send_json({"finish": True})
        assert _said(socket, "answer") is None


def test_what_was_named_is_known_to_the_next_drawing(client):
    with client.websocket_connect(LIVE) as socket:
        before = _draw(socket, 9)
        assert "new" not in {candidate["label"] for candidate in before["ranked"]}
        client.post("/api/library/movements", json=request_of(9, label="new"))
        assert _said(socket, "changed") == 2
        socket.send_json({"reset": True})
        _until_warm(client, 2)
        assert _draw(socket, 9, seed=5)["ranked"][0]["label"] == "new"


def _until_warm(client, version):
    end = time.monotonic() + 300
    while client.app.state.studio.warm != version:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_after_a_change_what_knew_the_library_before_answers_until_the_new_one_is_ready(client, monkeypatch):
    studio, makes, may_make = client.app.state.studio, Studio.stream, threading.Event()

    def slow(studio):
        assert may_make.wait(300)
        return makes(studio)

    with client.websocket_connect(LIVE) as socket:
        _draw(socket, 2)
        socket.send_json({"finish": True})
        _said(socket, "answer")
        monkeypatch.setattr(Studio, "stream", slow)
        version = client.post("/api/library/movements", json=request_of(9, label="new")).json()["version"]
        rows = samples(9, 5)
        for start in range(0, 36, 6):
            socket.send_json({"samples": rows[start : start + 6]})
            assert {candidate["label"] for candidate in _said(socket, "state")["ranked"]} <= {
                f"kind {k}" for k in range(4)
            }
        may_make.set()
        _until_warm(client, version)
        socket.send_json({"samples": rows[36:42]})
        state = _said(socket, "state")
        assert state["ranked"][0]["label"] == "new"  # of all samples so far
        with ActionLibrary(studio.library.folder, read_only=True) as library:
            ours = library.stream(early=DRAWN)
            for start in range(0, 42, 6):
                some = np.array(rows[start : start + 6])
                expected = ours.update(some[:, 0], some[:, 1:])
        assert state["progress"] == pytest.approx(expected.progress)
        may_make.clear()
        client.post("/api/library/movements", json=request_of(8, label="another"))
        socket.send_json({"reset": True})
        socket.send_json({"samples": samples(8, 5)})
        assert "another" not in {candidate["label"] for candidate in _said(socket, "state")["ranked"]}
        socket.send_json({"finish": True})
        may_make.set()
        assert _said(socket, "answer")["ranked"][0]["label"] == "another"


def test_what_is_deleted_while_a_movement_is_under_way_is_no_answer_to_it(client):
    symbols = {symbol["name"]: symbol["id"] for symbol in client.get("/api/library").json()["symbols"]}
    rows = samples(2)
    with client.websocket_connect(LIVE) as socket:
        for name, key in symbols.items():  # the last of them leaves nothing to recognize
            socket.send_json({"samples": rows[:40]})
            _said(socket, "state")
            client.delete(f"/api/library/symbols/{key}")
            socket.send_json({"samples": rows[40:]})
            socket.send_json({"finish": True})
            answer = _said(socket, "answer")
            assert answer is None or name not in {candidate["label"] for candidate in answer["ranked"]}
        assert answer is None


def test_eight_names_are_told_of_many(tmp_path, open_studio):
    with open_studio(make_library(tmp_path / "many", symbols=10, members=1)).websocket_connect(LIVE) as socket:
        assert len(_draw(socket, 2, step=30)["ranked"]) == 8


def test_a_disk_that_cannot_be_read_is_said_and_read_again(client, monkeypatch):
    def fail(library, **_):
        raise DataError("expected a disk")

    with client.websocket_connect(LIVE) as socket:
        with monkeypatch.context() as broken:
            broken.setattr(ActionLibrary, "stream", fail)
            socket.send_json({"samples": samples(1)[:6]})
            assert _said(socket, "error") == "expected a disk"
        assert _draw(socket, 1)["ranked"][0]["label"] == "kind 1"


def test_in_an_empty_library_drawings_are_taken_and_nothing_is_said(tmp_path, open_studio):
    client = open_studio(tmp_path / "new")
    with client.websocket_connect(LIVE) as socket:
        state = _draw(socket, 1)
        assert (state["ranked"], state["label"], state["unknown"]) == ([], None, None)
        socket.send_json({"finish": True})
        assert _said(socket, "answer") is None


def test_changes_of_others_are_told_to_everyone(client, folder):
    with client.websocket_connect(LIVE) as first, client.websocket_connect(LIVE) as two:
        for socket in (first, two):
            socket.send_json({"watch": True})
        with ActionLibrary(folder) as other:
            other.rename("kind 1", "elsewhere")
        assert _said(first, "changed") == _said(two, "changed") == 2


def test_own_changes_are_looked_at_at_once(client):
    changes = client.app.state.changes
    changes.period = 60.0
    with client.websocket_connect(LIVE) as socket:
        for k in (20, 21):  # the first look may have begun with the old period
            version = client.post("/api/library/movements", json=request_of(k, label=str(k))).json()["version"]
            assert _said(socket, "changed") == version


def test_clients_that_leave_are_forgotten(client):
    listeners = client.app.state.changes._listeners
    for _ in range(5):
        with client.websocket_connect(LIVE) as socket:
            socket.send_json({"samples": samples(1)})
    deadline = time.perf_counter() + 300
    while listeners and time.perf_counter() < deadline:
        time.sleep(0.01)
    assert not listeners


def test_each_client_has_its_own_stream(client):
    with client.websocket_connect(LIVE) as first, client.websocket_connect(LIVE) as two:
        a, b = samples(0), samples(3)
        for start in range(0, 60, 10):
            first.send_json({"samples": a[start : start + 10]})
            two.send_json({"samples": b[start : start + 10]})
        for socket in (first, two):
            socket.send_json({"finish": True})
        best = [_said(socket, "answer")["ranked"][0]["label"] for socket in (first, two)]
        assert best == ["kind 0", "kind 3"]


def test_samples_are_numbers_in_rows():
    assert parsed_samples([[0, 1.5, 2]]).tolist() == [[0.0, 1.5, 2.0]]
    with pytest.raises(TrajectoryError, match="rows of different lengths"):
        parsed_samples([[0, 1], [0, 1, 2]])


def test_a_client_that_does_not_read_delays_nobody_and_is_told_the_newest_version_in_the_end():
    async def told() -> list[str]:
        sent: list[str] = []
        reads = asyncio.Event()

        async def send_text(text: str) -> None:
            await reads.wait()
            sent.append(text)

        client = _Client(SimpleNamespace(send_text=send_text), None, Sources())
        for version in (3, 4, 5):
            client.tell_of(version)  # returns at once: the next client is told
            await asyncio.sleep(0)
        reads.set()
        while not sent or sent[-1] != '{"changed": 5}':
            await asyncio.sleep(0)
        return sent

    assert asyncio.run(told()) == ['{"changed": 3}', '{"changed": 5}']


def _shown(socket, done):
    """What a page was told of one source, put together, once that is what is waited for."""
    seen = {"samples": []}
    while not done(seen):
        message = socket.receive_json()
        if "source" in message:
            new = message["source"]
            before = seen["samples"] if new.get("movement") == seen.get("movement") else []
            seen = {**new, "samples": [*before, *new.get("samples", [])]}
    return seen


def test_pages_are_shown_the_movements_of_programs_and_not_those_of_pages(client):
    with client.websocket_connect(LIVE) as page, client.websocket_connect(LIVE) as hand:
        page.send_json({"watch": True})
        hand.send_json({"name": " hand <b>tracker</b> "})
        assert _shown(page, lambda seen: "name" in seen)["name"] == "hand <b>tracker</b>"
        state = _draw(hand, 2)
        seen = _shown(page, lambda seen: len(seen["samples"]) == 60)
        assert seen["samples"] == samples(2)
        assert (seen["state"], seen["ended"]) == (state, None)
        with client.websocket_connect(LIVE) as late:  # it sees the movement from its begin
            late.send_json({"watch": True})
            assert _shown(late, lambda seen: seen["samples"])["samples"] == samples(2)
        hand.send_json({"finish": True})
        answer = _said(hand, "answer")
        assert _shown(page, lambda seen: seen.get("ended"))["ended"] == {"answer": answer}
        hand.send_json({"reset": True})
        _draw(hand, 1)
        assert _shown(page, lambda seen: len(seen["samples"]) == 60)["samples"] == samples(1)
        _draw(page, 3)  # a page: not shown to itself, nor to others
        hand.close()
        assert _shown(page, lambda seen: seen.get("gone"))["id"] == seen["id"]
        assert not client.app.state.sources.sources


def test_samples_that_a_stream_skips_are_not_shown_and_of_a_long_movement_the_last_ones_are():
    sources = Sources()
    source, page = sources.add(), Follower(sources)
    source.update(np.array([[0.0, 1, 2], [0.2, 1, 3], [0.1, 9, 9], [0.2, 9, 9], [0.3, 1, 4]]), {})
    assert page.news()[0]["samples"] == [[0.0, 1, 2], [0.2, 1, 3], [0.3, 1, 4]]
    source.update(np.array([[0.4, 1, 2, 3]]), {})
    source.update(np.array([[0.3, 9, 9], [0.5, 1, 5]]), {})
    assert page.news()[0]["samples"] == [[0.5, 1, 5]]
    assert page.news() == []
    source.update(np.column_stack((1 + np.arange(MOST), np.ones((MOST, 2)))), {})
    assert len(page.news()[0]["samples"]) == len(Follower(sources).news()[0]["samples"]) == MOST


def test_what_a_program_sends_last_is_told_although_it_has_gone():
    sources = Sources()
    source, page, late = sources.add(), Follower(sources), Follower(sources)
    assert page.news()[0]["samples"] == []
    source.update(np.array([[0.0, 1, 2]]), {})
    source.end({"answer": None})
    sources.remove(source)
    last, gone = page.news()
    assert (last["samples"], last["ended"]) == ([[0.0, 1, 2]], {"answer": None})
    assert gone == {"id": 1, "gone": True}
    assert page.news() == late.news() == []


def test_a_movement_that_is_over_is_shown_until_the_next_one_begins():
    sources = Sources()
    source = sources.add()
    source.end({"answer": None})  # of nothing
    assert source.ended is None
    row = np.array([[0.0, 1, 2]])
    source.update(row, {"n": 1})
    source.end({"error": "too short"})
    source.end({"answer": None})
    source.reset()
    assert (source.movement, source.ended) == (1, {"error": "too short"})
    source.update(row, {"n": 2})
    assert (source.movement, source.ended, len(source.samples)) == (2, None, 1)
    source.reset()
    assert (source.movement, source.samples) == (3, [])


def test_a_page_that_does_not_read_delays_no_program_and_is_told_all_of_it_in_the_end():
    async def told() -> tuple[list[dict], int]:
        sent: list[str] = []
        reads = asyncio.Event()

        async def send_text(text: str) -> None:
            await reads.wait()
            sent.append(text)

        sources = Sources()
        page = _Client(SimpleNamespace(send_text=send_text), None, sources)
        await page._answer("watch", None)
        source = sources.add()
        for k in range(500):
            source.update(np.array([[k, 1.0, 2.0]]), {"k": k})  # returns at once
            await asyncio.sleep(0)
        reads.set()
        while sum(len(json.loads(text)["source"]["samples"]) for text in sent if "source" in text) < 500:
            await asyncio.sleep(0.01)
        return [json.loads(text) for text in sent if "source" in text], len(sent)

    messages, n = asyncio.run(told())
    assert n <= 4  # not one for each sample
    assert messages[-1]["source"]["state"] == {"k": 499}
    rows = [row for message in messages for row in message["source"]["samples"]]
    assert rows == [[k, 1.0, 2.0] for k in range(500)]


def test_changes_are_told_again_after_the_library_could_not_be_read():
    versions = iter([1, sqlite3.OperationalError("a lock of another kind"), DataError("gone"), 2])

    class Library:
        @property
        def version(self):
            if isinstance(now := next(versions, 2), Exception):
                raise now
            return now

    async def told() -> list[int]:
        heard: list[int] = []
        warmed: list[None] = []
        studio = SimpleNamespace(library=Library(), warm_up=lambda: warmed.append(None))
        changes = Changes(studio, period=0.001)
        changes.listen(heard.append)
        watching = asyncio.create_task(changes.watch())
        async with asyncio.timeout(10):
            while not heard:
                assert not watching.done()
                await asyncio.sleep(0.001)
        await asyncio.sleep(0.01)  # the same version is told once
        watching.cancel()
        assert len(warmed) == 1
        return heard

    assert asyncio.run(told()) == [2]


@pytest.mark.parametrize("n_turns", range(6))
def test_a_change_just_before_the_end_does_not_hold_up_the_end(n_turns):
    """Of the event loop, between the change and the cancellation."""

    async def ends():
        changes = Changes(SimpleNamespace(library=SimpleNamespace(version=1), warm_up=None), period=60.0)
        watching = asyncio.create_task(changes.watch())
        await asyncio.sleep(0.01)
        changes.look()
        for _ in range(n_turns):
            await asyncio.sleep(0)
        watching.cancel()
        done, _ = await asyncio.wait([watching], timeout=5)
        return bool(done)

    assert asyncio.run(ends())

"""Files that are sent to the studio: read apart, searched, learned."""

from __future__ import annotations

import asyncio
import io
import os
import signal
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest
from studio_samples import BEARER, drawing

from kineme import ActionLibrary
from kineme.errors import DataError
from kineme.io.reading.recordings import read_recordings
from kineme.studio.server import app, read_upload, recording_routes, uploads
from kineme.studio.server import studio as work_module
from kineme.studio.server.refusals import MissingError
from soaking import slow


def _table(*kinds, rest=0.6, heads="t,x,y", clock=0.0):
    """A recording of drawings with rests between, and when each begins and ends, from its first sample on."""
    times, rows, spans, now, at = [], [], [], 0.0, np.zeros(2)
    for k in kinds:
        still = np.arange(0, rest, 0.025)
        times += list(now + still)
        rows += [at] * len(still)
        now += rest
        t, x = drawing(k, seed=50)
        spans.append((now, now + t[-1]))
        times += list(now + t)
        rows += list(at + x - x[0])
        now, at = now + t[-1] + 0.025, at + x[-1] - x[0]
    text = io.StringIO()
    np.savetxt(text, np.column_stack((np.add(times, clock), rows)), "%.6f", ",", header=heads, comments="")
    return text.getvalue().encode(), spans


def _send(client, data, name="drawn.csv"):
    return client.post("/api/recordings", content=data, headers={"X-File-Name": name})


def test_a_recording_is_read_searched_corrected_and_learned(client):
    data, spans = _table(0, 2, 1, clock=1e6)
    read = _send(client, data, "my%20drawing%20%E2%82%AC.csv")
    assert read.status_code == 200, read.text
    read = read.json()
    assert (len(read["tables"]), read["problems"]) == (1, [])
    table = read["tables"][0]
    assert [channel["name"] for channel in table["channels"]] == ["x", "y"]
    assert table["rate"] == pytest.approx(40, rel=0.1)
    plot = read["plots"][0]
    assert [column["name"] for column in plot["columns"]] == ["x", "y"]
    assert len(plot["times"]) == len(plot["columns"][0]["values"]) <= 1000
    assert (plot["times"][0], plot["times"][-1]) == (0, pytest.approx(table["duration"]))
    answer = client.post(f"/api/recordings/{read['recording']}/spotted", json={}).json()
    named = [span for span in answer["spans"] if span["label"]]
    assert {span["label"] for span in named} <= {"kind 0", "kind 1", "kind 2"}
    assert len(named) >= 2
    assert all(0 <= span["begin"] < span["end"] <= table["duration"] + 1e-9 for span in answer["spans"])
    assert answer["rests"]
    corrected = [{"begin": a, "end": b, "label": "mine"} for a, b in spans[:2]]
    corrected += [{"begin": spans[2][0], "end": spans[2][1], "label": None}]
    body = {"table": table["name"], "channels": ["x", "y"], "spans": corrected}
    learned = client.post(f"/api/recordings/{read['recording']}/learn", json=body)
    assert learned.status_code == 200, learned.text
    assert len(learned.json()["ids"]) == 3
    shown = client.get("/api/library").json()
    assert {symbol["name"]: symbol["n_members"] for symbol in shown["symbols"]}["mine"] == 2
    assert shown["unlabeled"] == 1
    again = client.post(f"/api/recordings/{read['recording']}/learn", json=body).json()
    assert again["ids"] == learned.json()["ids"]


def test_other_columns_are_read_where_they_are_asked_for(client):
    data, _ = _table(0, 1, heads="t,a,b")
    key = _send(client, data).json()["recording"]
    spotted = client.post(f"/api/recordings/{key}/spotted", json={"channels": ["a", "b"]})
    assert spotted.status_code == 200
    answer = client.post(f"/api/recordings/{key}/spotted", json={"channels": ["a"]})
    assert answer.status_code == 400
    wrong = client.post(f"/api/recordings/{key}/spotted", json={"channels": ["none"]})
    assert wrong.status_code == 400
    assert "none" in wrong.json()["error"]
    assert client.post(f"/api/recordings/{key}/spotted", json={"table": "none"}).status_code == 400


def test_a_refused_choice_says_what_can_be_done_in_the_studio(client):
    key = _send(client, _table(0)[0]).json()["recording"]
    answer = client.post(f"/api/recordings/{key}/learn", json={"channels": ["x"]})
    assert answer.json()["error"].endswith("got 1; choose other channels, or make another library")


def test_labels_of_a_file_are_taken(client):
    rows = ["movement,t,x,y,label"]
    for i, (k, label) in enumerate(((5, "wave"), (6, "nod"), (5, "wave"), (7, ""))):
        t, x = drawing(k, seed=60 + i)
        rows += [f"{i},{a:.6f},{b:.6f},{c:.6f},{label}" for a, (b, c) in zip(t, x, strict=True)]
    read = _send(client, "\n".join(rows).encode()).json()
    assert [table["label"] for table in read["tables"]] == ["wave", "nod", "wave", None]
    learned = client.post(f"/api/recordings/{read['recording']}/learn", json={"channels": ["x", "y"]})
    assert learned.status_code == 200, learned.text
    assert len(learned.json()["ids"]) == 4
    shown = client.get("/api/library").json()
    members = {symbol["name"]: symbol["n_members"] for symbol in shown["symbols"]}
    assert (members["wave"], members["nod"], shown["unlabeled"]) == (2, 1, 1)
    assert client.post(f"/api/recordings/{read['recording']}/learn", json={"spans": []}).status_code == 422


@pytest.mark.soak
def test_of_each_file_the_columns_asked_for_last_are_kept(client):
    data, _ = _table(0, 1, heads="t,a,b")
    cached, keys = client.app.state.studio.uploads._read, [_send(client, data).json()["recording"] for _ in range(2)]
    for columns in (["a"], ["b"], ["b", "a"]):
        client.app.state.studio.uploads.recordings(keys[0], columns)
    assert list(cached) == [(keys[0], ()), (keys[1], ()), (keys[0], ("b", "a"))]


def test_what_is_read_apart_is_what_is_read_here(tmp_path):
    for name, data in (("a.csv", _table(0, 1)[0]), ("pose.csv", _poses()[0])):
        path = tmp_path / name
        path.write_bytes(data)
        direct = read_recordings(path)
        read_upload.save(direct, tmp_path / "there.npz")
        again = read_upload.load(tmp_path / "there.npz")
        for a, b in zip(direct.demonstrations, again.demonstrations, strict=True):
            assert np.array_equal(a.positions, b.positions)
            assert np.array_equal(a.times, b.times)
            assert np.array_equal(a.recorded, b.recorded)
            assert a.channels == b.channels
        assert direct.sources == again.sources


def _poses(*kinds, heads="t,x,y,qw,qx,qy,qz", rest=0.6):
    """A recording that turns as it moves, with rests between, and when each movement begins and ends."""
    times, rows, spans, now = [], [], [], 0.0
    for k in kinds or (1,):
        t, x = drawing(k, seed=50)
        still = np.arange(0, rest, 0.025)
        moves = np.concatenate((np.repeat(x[:1], len(still), axis=0), x)) - x[0]
        half = 0.3 * np.column_stack((moves, moves[:, 0] * moves[:, 1]))
        angle = np.linalg.norm(half, axis=1, keepdims=True)
        rows.append(np.column_stack((moves, np.cos(angle), np.sinc(angle / np.pi) * half)))
        times.append(now + np.concatenate((still, rest + t)))
        spans.append((now + rest, now + rest + t[-1]))
        now += rest + t[-1] + 0.025
    text = io.StringIO()
    np.savetxt(
        text, np.column_stack((np.concatenate(times), np.concatenate(rows))), "%.9f", ",", header=heads, comments=""
    )
    return text.getvalue().encode(), spans


@pytest.mark.parametrize("head", ["q", slow("orientation.")])
def test_orientations_that_are_chosen_by_their_channel_are_those_of_the_reader(
    tmp_path, open_studio, head, monkeypatch
):
    monkeypatch.setenv("KINEME_COMPILED", "never")  # to compile for four dimensions would take longer than all else
    client = open_studio(tmp_path / "poses")
    four = [head + axis for axis in "wxyz"]
    data, spans = _poses(0, 1, 2, heads=",".join(("t", "x", "y", *four)))
    read = _send(client, data).json()
    channels = read["tables"][0]["channels"]
    assert [(channel["kind"], channel["columns"]) for channel in channels[2:]] == [("orientation", four)]
    chosen = [channels[k]["name"] for k in (2, 0)]  # not all of them, and in another order
    body = {"channels": chosen, "spans": [{"begin": a, "end": b, "label": f"k{i}"} for i, (a, b) in enumerate(spans)]}
    learned = client.post(f"/api/recordings/{read['recording']}/learn", json=body)
    assert learned.status_code == 200, learned.text
    (tmp_path / "a.csv").write_bytes(data)
    (recording,) = read_recordings(tmp_path / "a.csv", columns=[*four, "x"]).demonstrations
    library = client.app.state.studio.library
    assert library.channels == recording.channels
    for movement, (begin, end) in zip(library.movements(), spans, strict=True):
        inside = (recording.times >= begin - 1e-9) & (recording.times <= end + 1e-9)
        np.testing.assert_allclose(movement.recorded, recording.recorded[inside], atol=1e-6)
    other = _send(client, _poses(1, 0, heads=",".join(("t", "x", "y", *four)))[0], "b.csv").json()["recording"]
    for choice in ({"channels": chosen}, {}):
        spotted = client.post(f"/api/recordings/{other}/spotted", json=choice).json()["spans"]
        assert [span["label"] for span in spotted] == ["k1", "k0"]


FILES = {
    "empty.csv": b"",
    "text.csv": b"hello\nworld\n",
    "zeros.mat": bytes(1000),
    "bomb.npz": b"PK\x03\x04" + bytes(100),
    "deep.json": b"[" * 200_000,
    "x.exe": b"MZ",
    "none": b"1,2,3\n",
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_hold_no_movement_are_refused_in_a_sentence(client, name):
    answer = _send(client, FILES[name], name)
    assert answer.status_code == 400
    assert "expected" in answer.json()["error"]
    assert "/tmp" not in answer.json()["error"]
    assert client.get("/api/library").status_code == 200


NAMES = [
    "../../etc/passwd",
    "..%2f..%2fx.csv",
    "C:\\x.csv",
    ".hidden.csv",
    "a\x01b.csv",
    "-rf.csv",
    "%00.csv",
    "",
    " ",
    "\u540d" * 130 + ".csv",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files_lead_nowhere(name):
    plain = uploads.plain_name(name)
    assert Path(plain).name == plain
    assert plain not in {"", ".", ".."}
    assert not plain.startswith((".", "-"))
    assert "\0" not in plain
    assert len(plain.encode()) < 255


def test_reading_ends_where_it_takes_too_long_or_too_much(tmp_path):
    data = b"t,x,y\n" + b"".join(b"%d,1.25,2.5\n" % k for k in range(200_000))  # more than a process has at hand
    for options, words in (({"seconds": 0.05}, "read within 0.05 s"), ({"memory": 1000}, "expected|ended with code")):
        files = uploads.Uploads(**options)
        key = _received(files, data)
        with pytest.raises(DataError, match=words):
            files.recordings(key)
        files.close()


def _received(files, data, name="a.csv"):
    async def chunks():
        yield data

    return asyncio.run(files.receive(name, chunks()))


def test_the_last_eight_are_kept():
    files = uploads.Uploads()
    keys = [_received(files, b"x") for _ in range(10)]
    with pytest.raises(MissingError, match="one of the last 8 recordings"):
        files.recordings(keys[0])
    assert len(list(files._folder.path.rglob("*.csv"))) == 8
    files.close()
    assert not files._folder.path.exists()


def test_folders_of_studios_that_were_killed_are_deleted_and_those_of_others_are_not(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    running = uploads.OwnFolder()
    left, new, other = (tmp_path / name for name in ("kineme-studio-left", "kineme-studio-new", "else"))
    for folder in (left, new, other):
        folder.mkdir()
        (folder / "sent.csv").write_text("1")
    (tmp_path / "kineme-studio-link").symlink_to(other)
    for folder in (left, other, running.path):
        os.utime(folder, (1, 1))
    second = uploads.OwnFolder()
    assert {path.name for path in tmp_path.iterdir()} == {
        *("kineme-studio-new", "kineme-studio-link", "else"),
        *(running.path.name, second.path.name),
    }
    assert (other / "sent.csv").exists()
    running.close()
    second.close()


def test_a_file_that_does_not_come_whole_leaves_nothing_and_is_no_error(client, caplog):
    async def send(path):
        parts = iter([{"type": "http.request", "body": b"t,x", "more_body": True}, {"type": "http.disconnect"}])

        async def receive():
            return next(parts)

        async def answer(_):
            pass

        headers = [(name.lower().encode(), value.encode()) for name, value in (BEARER | {"Host": "localhost"}).items()]
        scope = {"type": "http", "method": "POST", "path": path, "query_string": b"", "headers": headers}
        await client.app(scope | {"http_version": "1.1", "raw_path": path.encode(), "root_path": ""}, receive, answer)

    client.portal.call(send, "/api/recordings")
    assert not list(client.app.state.studio.uploads._folder.path.iterdir())
    assert "Traceback" not in caplog.text


def _gone(after):
    """A request whose client goes after so many looks."""
    looks = iter(range(1000))

    async def is_disconnected():
        return next(looks) >= after

    return SimpleNamespace(is_disconnected=is_disconnected)


def test_a_child_that_reads_is_ended_where_nobody_waits(tmp_path, monkeypatch):
    monkeypatch.setattr(work_module, "PERIOD", 0.02)
    files, children = uploads.Uploads(seconds=60), []
    key = _received(files, b"t,x,y\n")
    popen = subprocess.Popen

    def sleeping(command, **how):
        children.append(popen(["sleep", "3600"], **how))
        return children[0]

    monkeypatch.setattr(uploads.subprocess, "Popen", sleeping)
    work = work_module.Work()
    with ThreadPoolExecutor(1) as pool:
        waiting = work_module.while_wanted(_gone(2), pool, work, lambda: files.recordings(key, check=work.check))
        with pytest.raises(work_module.StoppedError):
            asyncio.run(waiting)
    assert children[0].returncode == -signal.SIGKILL
    files.close()


def test_a_search_says_how_far_it_is_and_ends_where_another_one_begins(client, monkeypatch):
    key = _send(client, _table(0, 1)[0]).json()["recording"]
    path = f"/api/recordings/{key}/spotted"
    assert client.get(path).json() == {"share": None}
    seen, begun = [], Event()
    real = recording_routes.annotate_by

    def slow(classes, recording, error_rate, progress):
        if begun.is_set():
            return real(classes, recording, error_rate, progress)
        begun.set()
        for k in range(1000):
            progress(0.001 * k * recording.demonstrations.durations[0])
            seen.append(client.get(path).json()["share"])
        raise AssertionError

    monkeypatch.setattr(recording_routes, "annotate_by", slow)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(client.post, path, json={})
        begun.wait(300)
        while len(seen) < 3:
            time.sleep(0.01)
        second = client.post(path, json={})
        assert first.result(300).status_code == 499
    assert second.status_code == 200
    assert seen[:3] == pytest.approx([0, 0.001, 0.002])
    assert client.get(path).json() == {"share": None}


def test_a_disk_that_is_full_is_said():
    files = uploads.Uploads()
    files.close()  # the folder is gone: nothing can be kept in it
    with pytest.raises(DataError, match="free some space there"):
        _received(files, b"x")


@pytest.mark.soak
def test_what_was_read_is_held_up_to_a_limit_and_read_again_then(monkeypatch):
    files = uploads.Uploads(held=20_000)
    small, large = (_received(files, _table(*kinds)[0]) for kinds in ((0,), range(12)))
    a = files.recordings(small)
    assert files.recordings(small) is a
    b = files.recordings(small, ("x", "y"))
    monkeypatch.setattr(files, "held", 3000)
    with pytest.raises(DataError, match="MB of numbers"):
        files.recordings(large)
    monkeypatch.setattr(files, "held", 4000)
    assert files.recordings(small, ("y", "x")).demonstrations.n_dims == 2
    assert b not in files._read.values()
    files.close()


def test_recordings_of_others_are_not_there(client):
    for key in ("x", "..", "0" * 16):
        assert client.post(f"/api/recordings/{key}/spotted", json={}).status_code == 404


def test_a_recording_that_is_too_large_is_refused(client, monkeypatch):
    monkeypatch.setattr(app, "FILE_BYTES", 1000)

    def parts():
        for _ in range(10):
            yield b"1,2\n" * 100

    assert _send(client, b"1,2\n" * 1000).status_code == 413
    assert _send(client, parts()).status_code == 413
    folder = client.app.state.studio.uploads._folder.path
    assert not [path for path in folder.rglob("*") if path.is_file()]


def test_recordings_are_read_but_not_learned_for_reading_only(folder, open_studio):
    client = open_studio(folder, read_only=True)
    data, spans = _table(0)
    key = _send(client, data).json()["recording"]
    assert client.post(f"/api/recordings/{key}/spotted", json={}).status_code == 200
    body = {"spans": [{"begin": spans[0][0], "end": spans[0][1], "label": "x"}]}
    assert client.post(f"/api/recordings/{key}/learn", json=body).status_code == 403


def test_spans_outside_of_the_recording_are_refused(client):
    data, spans = _table(0)
    key = _send(client, data).json()["recording"]
    good = {"begin": spans[0][0], "end": spans[0][1], "label": "x"}
    for span in ({"begin": 90, "end": 99}, {"begin": 1.0, "end": 0.5}, {"begin": 0, "end": 1e-6}):
        for others in ([], [good]):
            answer = client.post(f"/api/recordings/{key}/learn", json={"spans": [*others, {**span, "label": "x"}]})
            assert answer.status_code == 400, answer.text
    with ActionLibrary(client.app.state.studio.library.folder, read_only=True) as library:
        assert "x" not in library

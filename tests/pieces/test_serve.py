"""`kineme serve`: its answers are those of one process, what is sent wrongly is refused, and who dies is started."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from importlib.resources import files
from pathlib import Path

import httpx
import jsonschema
import numpy as np
import pytest
import shard_samples as samples

from kineme.errors import DataError, SpecificationError
from kineme.library.library import ActionLibrary
from kineme.pieces.processes import Process, Processes, UnavailableError
from kineme.pieces.search import as_dict, open_shards
from kineme.studio.server.nearest import SearchOptions, create_search_app, serve_search

TOKEN = "a-token-for-tests-only"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
JSON = {"Content-Type": "application/json"}
SCHEMA = json.loads(files("kineme").joinpath("pieces/nearest.schema.json").read_text())


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    folder = tmp_path_factory.mktemp("serve")
    library = samples.library(folder / "library")
    paths, labels = samples.movements(400, seed=4)
    return library, samples.shards(folder / "shards", samples.reduction_of(library), paths, 4, labels=labels)


class Served:
    """The command in a process of its own."""

    def __init__(self, library, shards, *more, errors=subprocess.PIPE):
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        source = str(Path(__file__).parents[2] / "src")
        command = [sys.executable, "-m", "kineme", "serve", "--library", library, "--shards", shards, "--port", port]
        environment = os.environ | {"PYTHONPATH": source, "KINEME_STUDIO_TOKEN": TOKEN}
        self.process = subprocess.Popen(
            list(map(str, [*command, *more])), env=environment, stdout=subprocess.PIPE, stderr=errors, text=True
        )
        self.said = [self.process.stdout.readline() for _ in range(3)]
        self.address = f"http://127.0.0.1:{port}"

    def post(self, body, **headers):
        content = body if isinstance(body, bytes) else json.dumps(body).encode()
        return httpx.post(f"{self.address}/nearest", content=content, headers=BEARER | JSON | headers, timeout=60)

    def health(self):
        return httpx.get(f"{self.address}/health", headers=BEARER, timeout=60).json()

    def end(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.communicate(timeout=30)


@pytest.fixture(scope="module")
def served(folders):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KINEME_NUM_THREADS", "2")
        served = Served(*folders, "--processes", "2")
    yield served
    served.process.kill()
    served.process.communicate()


def _body(movement, **more):
    return {"positions": movement.tolist(), "times": np.linspace(0, 1.5, len(movement)).tolist(), **more}


def test_the_answers_are_those_of_one_process(served, folders):
    library, shards = folders
    paths, _ = samples.movements(3, seed=9)
    opened = open_shards(shards)
    with ActionLibrary(library, read_only=True) as known:
        expected = as_dict(opened, 50, opened.nearest(paths, 5, 50), known.recognize(paths))
    answer = served.post({"movements": [_body(path) for path in paths], "n": 5, "candidates": 50})
    assert (answer.status_code, answer.json()) == (200, expected)
    jsonschema.validate(answer.json(), SCHEMA)
    assert [each["recognized"]["label"] for each in answer.json()["answers"]] == [
        near[0].label for near in opened.nearest(paths, 1)
    ]


def test_one_movement_and_without_recognition(served):
    path = samples.movements(400, seed=4)[0][77]
    answer = served.post({"positions": path.tolist(), "recognize": False, "n": 1}).json()
    jsonschema.validate(answer, SCHEMA)
    assert answer["movements"] == 400
    assert answer["answers"][0]["recognized"] is None
    near = answer["answers"][0]["nearest"][0]
    assert (near["path"], near["place"], near["start"]) == ("file 0025.csv", "2", 77.0)


def test_it_says_where_it_is_and_what_it_searches(served):
    assert re.fullmatch(r"400 movements of .*shards at http://127\.0\.0\.1:\d+/nearest\n", served.said[0])
    health = served.health()
    assert (health["movements"], health["shards"], len(health["processes"])) == (400, 4, 2)


def test_many_clients_are_answered_alike(served):
    paths, _ = samples.movements(12, seed=10)
    alone = [served.post(_body(path, n=3, recognize=False)).json() for path in paths]
    answers = [None] * len(paths)

    def ask(i):
        answers[i] = served.post(_body(paths[i], n=3, recognize=False)).json()

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(len(paths))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == alone


FLAT = np.zeros((10, 2))
MOVING = samples.movements(1)[0][0]


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        (b"{", 422, "JSON"),
        (b"\xff\xfe", 422, ""),
        ([], 422, ""),
        ({}, 400, "one movement"),
        ({"movements": []}, 422, "movements"),
        ({"movements": [_body(MOVING)], **_body(MOVING)}, 400, "one movement"),
        (_body(MOVING, n=0), 422, "n"),
        (_body(MOVING, n=20, candidates=10), 400, "candidates"),
        (_body(MOVING, other=1), 422, "other"),
        (_body(np.pad(MOVING, ((0, 0), (0, 1)))), 400, "2 dimensions"),
        ({"positions": [[0, 0], [1, 1], [2], [3, 3]]}, 400, "equally many"),
        ({"positions": [[0, 0], [1, None], [2, 2], [3, 3]]}, 422, "positions"),
        ({**_body(MOVING), "times": [0, 1]}, 400, "time"),
        ({**_body(MOVING), "times": [0.0] * len(MOVING)}, 400, "time"),
    ],
)
def test_what_is_sent_wrongly_is_refused(served, body, status, words):
    answer = served.post(body)
    assert answer.status_code == status
    assert words in answer.json()["error"]


def test_a_body_that_is_too_large_is_refused(served):
    answer = served.post(b'{"positions": [' + b"[0,0]," * 2_000_000 + b"[0,0]]}")
    assert (answer.status_code, "at most 8 MB" in answer.json()["error"]) == (413, True)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Authorization": "Bearer wrong"}, 401),
        ({"Host": "evil.example"}, 403),
        ({"Origin": "http://evil.example"}, 403),
    ],
)
def test_who_may_not_ask_is_refused(served, headers, status):
    answer = served.post(_body(MOVING), **headers)
    assert answer.status_code == status
    assert "error" in answer.json()
    assert httpx.get(f"{served.address}/health").status_code == 401


def test_a_client_that_goes_away_leaves_others_alone(served):
    body = json.dumps(_body(MOVING)).encode()
    host, port = served.address.removeprefix("http://").split(":")
    for sent in (body, body[: len(body) // 2]):
        with socket.create_connection((host, int(port))) as client:
            head = f"POST /nearest HTTP/1.1\r\nHost: {host}:{port}\r\nAuthorization: Bearer {TOKEN}"
            head += f"\r\nContent-Length: {len(body)}\r\nContent-Type: application/json"
            client.sendall(head.encode() + b"\r\n\r\n" + sent)
    assert served.post(_body(MOVING)).status_code == 200


def test_a_process_that_dies_is_started_again_and_the_request_answered(served):
    expected = served.post(_body(MOVING)).json()
    before = served.health()["processes"]
    os.kill(before[0], signal.SIGKILL)
    late = time.monotonic() + 10
    while before[0] in served.health()["processes"]:
        assert time.monotonic() < late
    answer = served.post(_body(MOVING))
    assert (answer.status_code, answer.json()) == (200, expected)
    after = served.health()["processes"]
    assert len(after) == 2
    assert before[0] not in after


@pytest.mark.soak
def test_a_terminal_shows_how_far_indexes_are(folders, tmp_path):
    shutil.copytree(folders[1], tmp_path / "shards", ignore=shutil.ignore_patterns("search-*"))
    termios = pytest.importorskip("termios")
    ours, theirs = os.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    with open(ours, "rb", buffering=0) as terminal:
        served = Served(folders[0], tmp_path / "shards", errors=theirs)
        os.close(theirs)
        os.set_blocking(ours, False)
        shown = terminal.read(65536) or b""
        served.process.send_signal(signal.SIGINT)
        served.process.communicate(timeout=30)
    assert b"indexing: " in shown
    assert b"/400 [" in shown
    assert "400 movements" in served.said[0]


def test_it_ends_with_its_processes(folders):
    served = Served(*folders, "--processes", "1")
    pid = served.health()["processes"][0]
    _, errors = served.end()
    assert (served.process.returncode, errors) == (0, "")
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_processes_that_cannot_live_make_a_search_unavailable(folders, monkeypatch):
    library, folder = folders
    shards = open_shards(folder)

    def die(self):
        raise EOFError

    with Processes(shards, 1) as processes, ActionLibrary(library, read_only=True) as known:
        _, queries = shards.described(MOVING[None])
        assert len(processes.candidates(queries, 5)[0].rows) == 5
        processes.stop()
        monkeypatch.setattr(Process, "start", die)
        with pytest.raises(UnavailableError, match="ended twice"):
            processes.candidates(queries, 5)
        app = create_search_app(shards, processes, known, TOKEN)

        async def ask():
            transport = httpx.ASGITransport(app)
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost", headers=BEARER) as client:
                return await client.post("/nearest", json=_body(MOVING))

        answer = asyncio.run(ask())
    assert (answer.status_code, "ended twice" in answer.json()["error"]) == (503, True)


def test_a_process_says_what_is_wrong_with_its_shards(tmp_path):
    with pytest.raises(DataError, match=r"bases\.npz"):
        Process(tmp_path, 100, [0], 1).start()


def _fail(*_):
    os.kill(os.getpid(), signal.SIGINT)  # ends the server, so that the test fails


def test_an_address_of_a_network_needs_a_token(folders, monkeypatch):
    monkeypatch.delenv("KINEME_STUDIO_TOKEN", raising=False)
    with pytest.raises(SpecificationError, match="KINEME_STUDIO_TOKEN with --host 0"):
        serve_search(SearchOptions(*folders, host="0.0.0.0", port=0), _fail)


@pytest.mark.soak
def test_shards_of_another_library_are_refused(folders, tmp_path):
    other = samples.library(tmp_path / "other", n=30)
    with pytest.raises(SpecificationError, match="another one"):
        serve_search(SearchOptions(other, folders[1], port=0), _fail)

"""The files of the page: what is sent of them, and what is not sent twice."""

from __future__ import annotations

import socket
from contextlib import closing
from pathlib import Path

import pytest

from kineme.studio import javascript, web
from kineme.studio.server import serve

WEB, RUNTIME = (Path(package.__file__).parent for package in (web, javascript))


@pytest.mark.parametrize(
    ("path", "file", "kind"),
    [
        ("/", WEB / "index.html", "text/html; charset=utf-8"),
        ("/draw/view.js", WEB / "draw" / "view.js", "text/javascript; charset=utf-8"),
        ("/runtime/rollout.js", RUNTIME / "rollout.js", "text/javascript; charset=utf-8"),
    ],
)
def test_a_file_is_sent_whole_and_only_once(client, path, file, kind):
    answer = client.get(path)
    assert (answer.status_code, answer.content, answer.headers["content-type"]) == (200, file.read_bytes(), kind)
    assert answer.headers["cache-control"] == "no-cache"
    tag = {"If-None-Match": answer.headers["etag"]}
    again = client.get(path, headers=tag)
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["content-security-policy"] == answer.headers["content-security-policy"]
    assert client.get("/app.js", headers=tag).status_code == 200  # the tag is another file's
    head = client.head(path)
    assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", str(len(answer.content)))


@pytest.mark.parametrize("path", ["/", "/runtime/runtime.js", "/vendor/scene.min.js"])
def test_files_are_for_those_who_know_the_token(client, path):
    assert client.get(path).status_code == 200
    assert client.get(path, headers={"Authorization": ""}).status_code == 401
    assert client.get(path, headers={"Host": "evil.example"}).status_code == 403
    assert client.get(path, headers={"Origin": "http://evil.example"}).status_code == 403
    assert client.post(path).status_code in {404, 405}


def test_the_library_is_not_sent_twice_and_anew_after_a_change(client):
    answer = client.get("/api/library")
    tag = {"If-None-Match": answer.headers["etag"]}
    assert (client.get("/api/library", headers=tag).status_code, answer.headers["cache-control"]) == (304, "no-store")
    client.post("/api/library/undo")
    changed = client.get("/api/library", headers=tag)
    assert (changed.status_code, changed.json()["version"]) == (200, answer.json()["version"] + 1)


def test_small_answers_do_not_wait_to_be_sent_together():
    with closing(serve._bound(serve.LOOPBACK, 0)) as listening, socket.create_connection(listening.getsockname()) as _:
        connection, _ = listening.accept()
        with closing(connection):
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)

"""A phone as a wand: who may ask what of its server, what is shown of its movements, and when it ends."""

from __future__ import annotations

import hashlib
import json
import socket
import ssl
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from ipaddress import ip_address

import httpx
import numpy as np
import pytest
from studio_samples import BEARER, Served, drawing

pytest.importorskip("segno", reason="segno is not installed")
pytest.importorskip("cryptography", reason="cryptography is not installed")

from kineme.errors import DataError, SpecificationError
from kineme.studio.server import connections, wand

LOOPBACK = {"host": "127.0.0.1"}


@pytest.fixture
def studio(folder):
    studio = Served(folder)
    yield studio
    studio.end()


class Asked:
    """A studio that listens for a phone, and a phone that trusts its certificate."""

    def __init__(self, studio, **more):
        self.studio = httpx.Client(base_url=studio.address, headers=BEARER, timeout=60)
        self.answer = self.studio.post("/api/wand", json=LOOPBACK | more).json()
        self.url, _, self.token = self.answer["address"].partition("?token=")
        self.port = httpx.URL(self.url).port
        unverified = ssl._create_unverified_context()  # browsers ask the person
        self.phone = httpx.Client(base_url=self.url, verify=unverified, timeout=60)

    def close(self):
        self.studio.close()
        self.phone.close()

    def tell(self, **message):
        headers = {"Authorization": f"Bearer {self.token}", "Origin": self.url.rstrip("/")}
        return self.phone.post("/api/samples", json={"id": "a phone"} | message, headers=headers)

    def listens(self, port=None):
        with suppress(OSError), closing(socket.create_connection(("127.0.0.1", port or self.port), timeout=5)):
            return True
        return False


@pytest.fixture
def ask():
    """A function that asks a studio to listen for a phone."""
    with ExitStack() as opened:
        yield lambda studio, **more: opened.enter_context(closing(Asked(studio, **more)))


@pytest.fixture
def asked(studio, ask):
    return ask(studio)


def _drawn(k, seed=99):
    """A drawing in heights of a canvas, as a phone sends it."""
    times, positions = drawing(k, seed=seed)
    return np.column_stack((times, positions)).tolist()


def test_nothing_listens_before_a_person_asks(studio):
    assert httpx.get(f"{studio.address}/api/wand", headers=BEARER).json() == {
        "address": None,
        "picture": None,
        "fingerprint": None,
    }
    assert httpx.post(f"{studio.address}/api/wand", json=LOOPBACK).status_code == 401
    elsewhere = BEARER | {"Origin": "https://elsewhere.example"}
    assert httpx.post(f"{studio.address}/api/wand", json=LOOPBACK, headers=elsewhere).status_code == 403


def test_the_fingerprint_is_that_of_the_certificate_and_the_picture_holds_the_address(asked):
    import segno

    shown = ssl.get_server_certificate(("127.0.0.1", asked.port))
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(shown)).hexdigest().upper()
    assert asked.answer["fingerprint"].replace(":", "") == digest
    same = segno.make(asked.answer["address"], error="m").svg_data_uri(
        border=4, dark="#000", light="#fff", omitsize=True
    )
    assert asked.answer["picture"] == same
    trusted = ssl.create_default_context(cadata=shown)  # and it is one of this address
    assert httpx.get(asked.answer["address"], verify=trusted, follow_redirects=True).status_code == 200


@pytest.mark.parametrize("height", [1.0, 100.0])
def test_a_movement_of_a_phone_is_shown_and_named(studio, ask, height):
    from websockets.sync.client import connect

    asked, drawn = ask(studio, height=height), _drawn(1)
    with connect(studio.address.replace("http", "ws") + "/api/live", additional_headers=BEARER) as page:
        page.send('{"watch": true}')
        assert asked.tell(begin=True, samples=drawn[:40]).json().keys() == {"label", "certainty"}
        said = asked.tell(samples=drawn[40:], finish=True).json()
        samples, source = [], {}
        while not source.get("ended"):
            source = json.loads(page.recv(60)).get("source", {})
            samples += source.get("samples", [])
        assert (source["name"], said["label"]) == ("phone", "kind 1")
        assert {name: source["ended"]["answer"][name] for name in said} == said
        np.testing.assert_allclose(samples, np.array(drawn) * [1, height, height])
        asked.studio.delete("/api/wand")
        assert json.loads(page.recv(60))["source"]["gone"]


def test_a_movement_that_was_not_ended_is_forgotten_when_another_begins(asked):
    asked.tell(begin=True, samples=_drawn(3)[:50])
    assert asked.tell(begin=True, samples=_drawn(2), finish=True).json()["label"] == "kind 2"


def test_a_library_in_space_gets_a_plane(studio, ask):
    asked = ask(studio, n_dims=3)
    phone = asked.tell(begin=True, samples=_drawn(1), finish=True)
    assert phone.status_code == 200  # of other dimensions than the library: nothing is known of it
    assert phone.json()["label"] is None


def test_without_the_token_there_is_nothing(asked):
    for token in ("", "?token=wrong", f"?token={asked.token}x"):
        refused = asked.phone.get(f"/{token}", headers={"Accept": "text/html"})
        assert (refused.status_code, "Use a phone" in refused.text) == (401, True)
        assert asked.phone.get(f"/wand/wand.js{token}").status_code == 401
        assert asked.phone.post(f"/api/samples{token}", json={"id": "x"}).status_code == 401
    assert asked.phone.get("/", headers={"Host": "studio.example"}).status_code == 403
    assert asked.phone.get("/", headers=BEARER).status_code == 401  # the token of the studio


def test_its_token_opens_the_page_and_nothing_of_the_studio(studio, asked):
    opened = asked.phone.get("/", params={"token": asked.token})
    cookie = opened.headers["set-cookie"]
    assert opened.status_code == 303
    assert all(part in cookie for part in ("HttpOnly", "SameSite=Strict", "Secure"))
    for path in ("/", "/wand/wand.js", "/wand.css", "/tokens.css", "/parts/stroke.js"):
        answer = asked.phone.get(path)
        assert (answer.status_code, len(answer.content) > 100) == (200, True), path
    for path in (
        "/index.html",
        "/app.js",
        "/api/library",
        "/api/live",
        "/api/openapi.json",
        "/../wand.html",
        "/etc/passwd",
    ):
        assert asked.phone.get(path).status_code == 404, path
    assert asked.phone.request("DELETE", "/api/samples", headers={"Origin": asked.url.rstrip("/")}).status_code == 404
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    key = {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    assert asked.phone.get("/api/live", headers=upgrade | key).status_code == 404
    assert httpx.get(f"{studio.address}/?token={asked.token}").status_code == 401


def test_a_page_of_another_site_sends_nothing(asked):
    asked.phone.get("/", params={"token": asked.token})  # the cookie is there
    for origin in ("https://elsewhere.example", "null", asked.url.rstrip("/") + "0"):
        assert asked.phone.post("/api/samples", json={"id": "x"}, headers={"Origin": origin}).status_code == 403
    assert (
        asked.phone.post("/api/samples", json={"id": "x"}, headers={"Sec-Fetch-Site": "cross-site"}).status_code == 403
    )


NONSENSE = [
    b"",
    b"{",
    b"[]",
    b"[" * 60_000,
    b'{"id": 1}',
    b'{"id": ""}',
    b'{"id": "x", "samples": [[0, 1]]}',
    b'{"id": "x", "samples": [[0, 1, 1e400]]}',
    b'{"id": "x", "samples": "many"}',
    b'{"id": "x", "samples": [' + b"[0, 1, 2]," * 8_000 + b"[0, 1, 2]]}",
]


def test_nonsense_is_refused_in_a_sentence_and_the_phone_goes_on(asked):
    headers = {"Authorization": f"Bearer {asked.token}"}
    for body in NONSENSE:
        answer = asked.phone.post("/api/samples", content=body, headers=headers)
        assert (answer.status_code, "expected" in answer.json()["error"]) == (400, True), body[:40]
    assert asked.tell(begin=True, samples=_drawn(2), finish=True).json()["label"] == "kind 2"
    assert "expected" not in asked.tell(begin=True, samples=_drawn(2)[:1], finish=True).text  # too short
    for k in range(3):
        asked.tell(id=f"another {k}")
    assert "at most" in asked.tell(id="a fifth").json()["error"]


@pytest.mark.parametrize(("body", "said"), [(b"1\r\n{\r\n", b"got nothing"), (b"20000\r\n" + 2**17 * b" ", b"at most")])
def test_a_body_that_stops_arriving_or_never_ends_is_given_up(asked, monkeypatch, body, said):
    monkeypatch.setattr(wand, "_SECONDS", 0.5)
    context = ssl._create_unverified_context()
    with socket.create_connection(("127.0.0.1", asked.port)) as plain, context.wrap_socket(plain) as phone:
        head = f"POST /api/samples HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {asked.token}\r\n"
        phone.sendall(f"{head}Transfer-Encoding: chunked\r\n\r\n".encode() + body)
        phone.settimeout(60)
        assert said in phone.recv(4096) + phone.recv(4096)


def test_whoever_does_not_begin_to_speak_is_closed(studio, ask, monkeypatch):
    monkeypatch.setattr(wand, "_SECONDS", 0.2)
    with closing(socket.create_connection(("127.0.0.1", ask(studio).port))) as silent:
        silent.settimeout(60)
        with suppress(ConnectionError):
            assert silent.recv(1) == b""


def test_a_flood_of_connections_leaves_the_studio_free_and_ends(studio, asked, monkeypatch):
    monkeypatch.setattr(connections, "HEAD_SECONDS", 1.0)
    with ExitStack() as opened:
        for _ in range(300):  # none of them begins to speak
            with suppress(OSError):
                opened.enter_context(socket.create_connection(("127.0.0.1", asked.port), timeout=1))
        accepted = asked.studio.get("/api/library").status_code  # the studio answers meanwhile
        assert accepted == 200
    deadline = time.monotonic() + 60
    while True:  # and the phone again, once they are gone
        with suppress(httpx.HTTPError):
            assert asked.tell().status_code == 200
            break
        assert time.monotonic() < deadline
        time.sleep(0.2)


def test_no_more_connections_are_open_than_a_few(monkeypatch):
    monkeypatch.setattr(wand, "_MOST_SOCKETS", 2)
    with closing(wand.listening_at(ip_address("127.0.0.1"))) as listening, ExitStack() as opened:
        for _ in range(3):
            opened.enter_context(socket.create_connection(listening.getsockname()))
        first, _ = listening.accept()
        second, _ = listening.accept()
        with pytest.raises(ConnectionAbortedError):
            listening.accept()
        first.close()
        opened.enter_context(socket.create_connection(listening.getsockname()))
        with closing(listening.accept()[0]), closing(second):
            pass


def test_it_ends_when_the_person_ends_it_or_asks_anew(asked):
    assert asked.listens()
    before = asked.answer["address"]
    anew = asked.studio.post("/api/wand", json=LOOPBACK).json()
    assert anew["address"] != before
    assert asked.tell().status_code == 401 if httpx.URL(anew["address"]).port == asked.port else not asked.listens()
    assert asked.studio.get("/api/wand").json() == anew
    assert asked.studio.delete("/api/wand").json()["address"] is None
    assert not asked.listens()
    assert asked.studio.get("/api/wand").json()["address"] is None


def test_of_several_that_are_asked_for_at_once_one_listens(asked):
    def anew(_):
        answer = httpx.post(asked.studio.base_url.join("/api/wand"), json=LOOPBACK, headers=BEARER, timeout=60)
        return httpx.URL(answer.json()["address"]).port

    with ThreadPoolExecutor(4) as pool:
        ports = set(pool.map(anew, range(8)))
    last = httpx.URL(asked.studio.get("/api/wand").json()["address"]).port
    assert [port for port in ports if asked.listens(port)] == [last]


def test_it_ends_when_nothing_has_moved_for_a_while_and_with_the_studio(folder, ask, monkeypatch):
    monkeypatch.setattr(wand, "LOOKS", 0.05)
    studio = Served(folder)
    asked = ask(studio)
    asked.tell()
    monkeypatch.setattr(wand, "IDLE", 0.1)
    deadline = time.monotonic() + 60
    while asked.listens():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert asked.studio.get("/api/wand").json()["address"] is None
    monkeypatch.setattr(wand, "IDLE", 600.0)
    last = ask(studio)
    assert last.listens()
    studio.end()
    assert not last.listens()


def test_a_phone_that_says_nothing_has_gone(studio, ask, monkeypatch):
    from websockets.sync.client import connect

    monkeypatch.setattr(wand, "LOOKS", 0.05)
    asked = ask(studio)
    with connect(studio.address.replace("http", "ws") + "/api/live", additional_headers=BEARER) as page:
        page.send('{"watch": true}')
        asked.tell()
        assert json.loads(page.recv(60))["source"]["name"] == "phone"
        monkeypatch.setattr(wand, "AWAY", 0.1)
        assert json.loads(page.recv(60))["source"]["gone"]


PUBLIC = ["0.0.0.0", "::", "8.8.8.8", "2001:4860:4860::8888", "224.0.0.1", "::ffff:0.0.0.0", "::ffff:8.8.8.8"]


@pytest.mark.parametrize("host", PUBLIC)
def test_only_addresses_of_local_networks_are_listened_at(asked, host):
    with pytest.raises(SpecificationError, match="in a local network"):
        wand.listening_at(ip_address(host))
    assert asked.studio.post("/api/wand", json={"host": host}).status_code == 400
    for name in ("localhost", "", "x" * 999, 5.5):
        assert asked.studio.post("/api/wand", json={"host": name}).status_code == 422


def test_an_address_of_another_machine_is_refused():
    with pytest.raises(DataError, match=r"expected an address of this machine, got 192\.168\.254\.253"):
        wand.listening_at(ip_address("192.168.254.253"))


def test_without_a_network_the_person_is_told(monkeypatch):
    def unreachable(*_):
        raise OSError("Network is unreachable")

    monkeypatch.setattr(wand.socket.socket, "connect", unreachable)
    with pytest.raises(DataError, match="expected this machine to be in a network"):
        wand.local_address()

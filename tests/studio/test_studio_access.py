"""Who may ask the studio what, and what nobody may."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from starlette.websockets import WebSocketDisconnect
from studio_samples import BEARER, LIVE, TOKEN, request_of

from kineme.cli import main
from kineme.studio.server import access, app
from kineme.studio.server.studio import Studio

READS = ["/api/library", "/api/library/history", "/", "/index.html", "/api/openapi.json", "/nothing"]


@pytest.fixture
def client(shared_client):
    """One for all tests: what is refused changes nothing."""
    return shared_client


@pytest.mark.parametrize("path", READS)
def test_without_the_token_nothing_is_answered(client, path):
    for headers in ({}, {"Authorization": "Bearer "}, {"Authorization": f"Basic {TOKEN}"}, {"Cookie": "kineme_=x"}):
        answer = client.get(path, headers={"Authorization": "", **headers})
        assert answer.status_code == 401
        assert "open the address that kineme studio printed" in answer.json()["error"]


@pytest.mark.parametrize("token", ["", "x", TOKEN[:-1], TOKEN + "x", TOKEN.upper(), "\xe4", "%00"])
def test_a_wrong_token_opens_nothing(client, token):
    for path in ("/", "/api/library"):
        assert client.get(path, params={"token": token}, headers={"Authorization": ""}).status_code == 401


def test_the_address_with_the_token_sets_a_cookie_that_scripts_and_other_sites_cannot_use(client):
    bare = {"Authorization": ""}
    answer = client.get("/", params={"token": TOKEN}, headers=bare, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert client.get("/api/library", headers=bare).status_code == 200  # the client kept it


def test_two_studios_on_one_machine_have_cookies_of_their_own():
    """Browsers send a cookie to every port of a host."""
    assert access.Guard(None, TOKEN).cookie == access.Guard(None, TOKEN).cookie != access.Guard(None, "other").cookie


def test_the_address_of_the_browser_opens_once_and_does_not_hold_the_token(folder, open_studio):
    client, bare, once = (
        open_studio(folder, once="a-code-for-tests"),
        {"Authorization": ""},
        {"once": "a-code-for-tests"},
    )
    for path, code in (
        ("/", ""),
        ("/", "another"),
        ("/api/library", "a-code-for-tests"),
        ("/index.html", once["once"]),
    ):
        assert client.get(path, params={"once": code}, headers=bare).status_code == 401
    answer = client.get("/", params=once, headers=bare, follow_redirects=False)
    assert (answer.status_code, TOKEN in answer.headers["set-cookie"]) == (303, True)
    assert client.get("/api/library", headers=bare).status_code == 200
    client.cookies.clear()
    assert client.get("/", params=once, headers=bare).status_code == 401
    assert client.get("/", params={"once": ""}, headers=bare).status_code == 401


def test_other_users_of_the_machine_do_not_see_the_token(monkeypatch):
    opened = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("kineme.studio.server.serve.serve", lambda options, ready: ready("/?token=T", "/?once=C"))
    result = CliRunner().invoke(main, ["studio", "-l", "actions"])
    assert (result.exit_code, opened, "/?token=T" in result.output) == (0, ["/?once=C"], True)


@pytest.mark.parametrize(("site", "status"), [("cross-site", 200), (None, 200), ("none", 303), ("same-origin", 303)])
def test_a_link_on_another_page_opens_it_too(client, site, status):
    """A browser that another site led here does not send the cookie along a redirect, but from a page of our own."""
    headers = {"Authorization": "", "Accept": "text/html,*/*"} | ({} if site is None else {"Sec-Fetch-Site": site})
    answer = client.get("/", params={"token": TOKEN}, headers=headers, follow_redirects=False)
    assert answer.status_code == status
    assert answer.headers.get("refresh", "0; url=/") == "0; url=/"
    assert ("refresh" in answer.headers) == (status == 200)
    assert (answer.headers["cache-control"], answer.content) == ("no-store", b"")
    assert "SameSite=Strict" in answer.headers["set-cookie"]


def test_a_browser_without_the_token_is_told_so_on_a_page(client):
    headers = {"Authorization": "", "Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}
    for path, more, status, said in (
        ("/", {}, 401, "It expected the token"),
        ("/?token=old", {}, 401, "copy the whole of it"),
        ("/", {"Host": "<b>.example"}, 403, "&lt;b&gt;.example"),
    ):
        answer = client.get(path, headers=headers | more)
        assert (answer.status_code, answer.headers["content-type"]) == (status, "text/html; charset=utf-8")
        assert said in answer.text
        assert not [text for text in ("<script", TOKEN, "<b>", "style=") if text in answer.text]
    assert client.get("/api/library", headers={"Authorization": ""}).json()["error"].startswith("expected the token")
    posted = client.post("/api/library/undo", headers=headers)
    assert posted.json()["error"].startswith("expected the token")


def test_addresses_with_many_fields_are_refused_as_others_are(client):
    fields = "&".join(f"a{k}=1" for k in range(30))
    assert client.get(f"/?{fields}", headers={"Authorization": ""}).status_code == 401
    assert client.get(f"/?{fields}").status_code == 200


def test_tokens_in_addresses_open_nothing_but_the_page(client):
    assert client.get("/api/library", params={"token": TOKEN}, headers={"Authorization": ""}).status_code == 401


NAMES = [
    "evil.example", "evil.example:8420", "127.0.0.1.evil.example", "localhost.evil.example", "", "[", "10.0.0.9",
    "evil.example@localhost", "evil.example:8420@127.0.0.1:8420", "localhost@evil.example", "localhost/@evil.example",
    "localhost:8420:1", "[::1", "localhost#.evil.example", "localhost evil.example",
]  # fmt: skip


@pytest.mark.parametrize("host", NAMES)
def test_a_name_that_was_pointed_here_is_refused(client, host):
    for path in ("/", "/api/library"):
        answer = client.get(path, headers={"Host": host})
        assert answer.status_code == 403
        assert "expected the address that kineme studio printed" in answer.json()["error"]


@pytest.mark.parametrize(
    "host", ["localhost", "localhost:9000", "127.0.0.1", "[::1]:8420", "LOCALHOST:8420", "127.0.0.2", "[0:0::1]"]
)
def test_every_name_of_the_loopback_is_ours(client, host):
    assert client.get("/api/library", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize("host", ["192.168.0.9:8420", "[fe80::1]:8420", "robot.local", "127.0.0.1"])
def test_on_a_network_addresses_are_ours_and_names_that_were_given(folder, open_studio, host):
    client = open_studio(folder, hosts=("0.0.0.0", "robot.local"))
    assert client.get("/api/library", headers={"Host": host}).status_code == 200
    assert client.get("/api/library", headers={"Host": "evil.example"}).status_code == 403


def test_the_names_of_this_machine_are_known():
    assert access.own_names("0.0.0.0")[0] == "0.0.0.0"
    assert all(access.own_names("0.0.0.0"))


ORIGINS = ["http://evil.example", "null", "http://127.0.0.1:3000", "file://", "https://localhost:8420", "http://", ""]


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_page_of_another_site_neither_writes_nor_reads_nor_listens(client, origin):
    headers = {"Origin": origin}
    version = client.get("/api/library").json()["version"]
    assert client.post("/api/library/undo", headers=headers).status_code == 403
    assert client.get("/api/library", headers=headers).status_code == 403
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(LIVE, headers=headers):
        pass
    assert client.get("/api/library").json()["version"] == version


def test_the_own_page_and_programs_may_write(client):
    for headers in ({}, {"Origin": "http://127.0.0.1:8420"}, {"Sec-Fetch-Site": "same-origin"}):
        answer = client.post("/api/library/movements", json=request_of(7, label="new"), headers=headers)
        assert answer.status_code == 200


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_forms_and_images_of_other_sites_write_nothing(client, site):
    headers = {"Sec-Fetch-Site": site, "Content-Type": "text/plain"}
    assert client.post("/api/library/undo", headers=headers, content="{}").status_code == 403


def test_websockets_want_the_token_too(client):
    with client.websocket_connect(LIVE):
        pass
    for headers in ({"Authorization": ""}, {"Authorization": "Bearer x"}):
        with pytest.raises(WebSocketDisconnect), client.websocket_connect(LIVE, headers=headers):
            pass
    with client.websocket_connect(f"{LIVE}?token={TOKEN}", headers={"Authorization": ""}):
        pass


@pytest.mark.parametrize("path", ["/", "/api/library", "/nothing", "/style.css"])
def test_every_answer_tells_browsers_to_keep_to_this_server(client, path):
    headers = client.get(path).headers
    policy = dict(part.strip().partition(" ")[::2] for part in headers["content-security-policy"].split(";"))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["base-uri"] == policy["form-action"] == "'none'"
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-frame-options"] == "DENY"
    assert headers["cross-origin-resource-policy"] == headers["cross-origin-opener-policy"] == "same-origin"


def test_nobody_writes_into_the_policy(client):
    for host in ("127.0.0.1:1; script-src *", "127.0.0.1:1,x", "127.0.0.1:1 *"):
        assert "*" not in client.get("/", headers={"Host": host}).headers["content-security-policy"]


def test_secrets_are_compared_in_constant_time(client, monkeypatch):
    compared = []
    monkeypatch.setattr(access.hmac, "compare_digest", lambda a, b: compared.append((a, b)))
    assert client.get("/", params={"token": "x"}, headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 401
    assert {token for token, _ in compared} == {b"", b"x", TOKEN.encode()}
    assert {secret for _, secret in compared} == {TOKEN.encode()}


def test_refusals_tell_it_too(client):
    assert "content-security-policy" in client.get("/", headers={"Authorization": ""}).headers


@pytest.mark.parametrize(
    "path",
    ["/../app.py", "/%2e%2e/app.py", "/..%2fserver/app.py", "//etc/passwd", "/__init__.py", "/web/index.html"],
)
def test_no_other_file_is_served(client, path):
    assert client.get(path).status_code in {400, 404}


def _chunks(n):
    yield b'{"times": ['
    for _ in range(n):
        yield b"0," * 2**19


@pytest.mark.parametrize("announced", [True, False])
def test_bodies_that_are_too_large_are_refused_before_they_are_held(client, announced):
    body = b" " * (app.JSON_BYTES + 1) if announced else _chunks(20)
    answer = client.post("/api/recognize", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 413
    assert "expected at most 8 MB" in answer.json()["error"]


BODIES = {
    "no JSON": "{",
    "deep": "[" * 100_000,
    "another kind": "[1]",
    "text": json.dumps({"times": "abc", "positions": []}),
    "NaN": '{"times": [0, 1, 2, 3, NaN], "positions": [[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]]}',
    "infinite": '{"times": [0, 1, 2, 3, 1e999], "positions": [[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]]}',
    "ragged": json.dumps({"times": [0, 1, 2, 3], "positions": [[0, 0], [1, 1], [2], [3, 3]]}),
    "short": json.dumps({"times": [0, 1], "positions": [[0, 0], [1, 1]]}),
    "lengths": json.dumps({"times": [0, 1, 2, 3, 4], "positions": [[0, 0], [1, 1], [2, 2], [3, 3]]}),
    "backwards": json.dumps({"times": [3, 2, 1, 0], "positions": [[0, 0], [1, 1], [2, 2], [3, 3]]}),
    "in space": json.dumps({"times": [0, 1, 2, 3], "positions": [[0, 0, 0], [1, 1, 1], [2, 2, 1], [3, 3, 1]]}),
    "unknown field": json.dumps({**request_of(1), "labels": ["x"]}),
    "name": json.dumps(request_of(1, label="a\0b")),
    "half a character": '{"label": "\\ud800", ' + json.dumps(request_of(1))[1:],
    "huge": json.dumps({"times": [0, 1, 2, 3], "positions": [[0, 0], [1, 10**400], [2, 2], [3, 3]]}),
}


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("path", ["/api/library/movements", "/api/recognize"])
def test_nonsense_is_refused_in_a_sentence_and_changes_nothing(client, path, body):
    version = client.get("/api/library").json()["version"]
    answer = client.post(path, content=BODIES[body].encode(), headers={"Content-Type": "application/json"})
    assert 400 <= answer.status_code < 500, answer.text
    assert "expected" in answer.json()["error"] or "JSON" in answer.json()["error"] or "body" in answer.json()["error"]
    assert client.get("/api/library").json()["version"] == version


def _texts(schema, every):
    """What a schema says of each text in it."""
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield from _texts(every[schema["$ref"].rpartition("/")[2]], every)
        if schema.get("type") == "string" and "enum" not in schema:
            yield schema
        schema = list(schema.values())
    for part in schema if isinstance(schema, list) else ():
        yield from _texts(part, every)


def test_texts_are_limited_and_hold_whole_characters(client):
    """A limit makes both so; JSON can hold half of a character, which no answer, file or library can."""
    described = client.get("/api/openapi.json").json()
    for path, methods in described["paths"].items():
        for operation in methods.values():
            body = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
            assert all("maxLength" in text for text in _texts(body, described["components"]["schemas"])), path
    body, kind = json.dumps({"what": {"symbol": "\ud800"}}), {"Content-Type": "application/json"}
    half = client.post("/api/rollout", content=body, headers=kind)
    assert (half.status_code, "what.symbol" in half.json()["error"]) == (422, True)


WRITES = [
    ("post", "/api/library/movements", request_of(5, label="x")),
    ("post", "/api/library/movements/assign", {"ids": [1], "symbol": "x"}),
    ("post", "/api/library/movements/delete", {"ids": [1]}),
    ("post", "/api/library/symbols/merge", {"ids": ["x"], "into": "y"}),
    ("post", "/api/library/symbols/x/rename", {"name": "y"}),
    ("post", "/api/library/symbols/x/describe", {"text": "y"}),
    ("post", "/api/library/symbols/x/split", {"ids": [1], "name": "y"}),
    ("delete", "/api/library/symbols/x", None),
    ("post", "/api/library/undo", {}),
    ("post", "/api/library/example", {"name": "letters"}),
]


def test_for_reading_only_every_change_is_refused(folder, open_studio):
    client = open_studio(folder, read_only=True)
    before = client.get("/api/library").json()
    assert (before["read_only"], before["can_undo"]) == (True, False)
    for method, path, body in WRITES:
        answer = client.request(method, path, json=body)
        assert answer.status_code == 403, path
        assert "without --read-only" in answer.json()["error"]
    assert client.post("/api/recognize", json=request_of(2)).json()["label"] == "kind 2"
    assert client.get("/api/library").json() == before


READING = {f"/{path}" for path in ("recognize", "why", "rollout", "primitive", "export", "recordings", "wand")}
READING |= {f"/robots/{act}" for act in ("move", "export", "follow")}
READING |= {f"/recordings/{{key}}/{act}" for act in ("spotted", "read", "shapes", "annotations")} | {
    "/episodes/{key}/spans"
}


def test_every_other_route_that_does_not_only_read_is_refused_too(folder, open_studio):
    client, writing = open_studio(folder, read_only=True), set()
    for path, methods in client.get("/api/openapi.json").json()["paths"].items():
        if path.removeprefix("/api") not in READING:
            writing |= {(method, path) for method in methods if method != "get"}
    assert len(writing) == len(WRITES) + 4  # of proposals, recordings and corrections
    for method, path in writing:
        assert client.request(method, path.replace("{key}", "x")).status_code == 403, path


def test_an_error_of_our_own_is_no_traceback_for_the_client(client, monkeypatch, caplog):
    def fail(self):
        raise RuntimeError("secret")

    monkeypatch.setattr(Studio, "view", fail)
    answer = client.get("/api/library/movements?symbol=x")
    assert answer.status_code == 500
    assert answer.json() == {"error": "internal error; details are in the server log"}
    assert caplog.text.count("RuntimeError: secret") == 1
    assert "script-src 'self'" in answer.headers["content-security-policy"]


def test_the_interface_is_described(client):
    described = client.get("/api/openapi.json").json()
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            assert operation.get("summary"), (method, path)
            assert operation.get("description"), (method, path)
            assert all(given.get("description") for given in operation.get("parameters", [])), (method, path)
            assert set(operation["responses"]) == {"200", "4XX", "5XX"}, (method, path)
            assert operation["responses"]["200"]["content"], (method, path)
    refused = client.post("/api/recognize", json={}).json()
    assert set(refused) == set(described["components"]["schemas"]["Refusal"]["properties"])
    assert described["security"] == [{name: []} for name in described["components"]["securitySchemes"]]
    assert BEARER["Authorization"].split()[1] not in json.dumps(described)

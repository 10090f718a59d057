"""The guard of the studio: who may ask needs the token, from this page or a program, under a name of this machine.

A web page of anybody may send requests to a server on this machine. It cannot know the token; nor can it use the cookie
of the studio's own page: browsers name the page that asks in ``Origin``, and a name that was pointed at this machine to
make its page this one, in ``Host``.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
import socket
from collections.abc import Mapping
from contextlib import suppress
from urllib.parse import parse_qs

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from kineme.studio.server.refusals import answer, refuse

_READING = frozenset({"GET", "HEAD", "OPTIONS"})
#: A name or an address, and a port: nothing else, as a user before an @, of which readers differ what the name is.
_HOST = re.compile(r"(?:\[(?P<address>[0-9A-Fa-f:.]+)\]|(?P<name>[\w.-]+))(?::\d*)?", re.ASCII)
_FRAMED = "/arm.html"  # the only page that the studio's page shows inside itself


class Guard:
    """Check every request and every websocket, and say with every answer what browsers may do with it.

    What opens the page `once` hides the token from other users, who see the address that a browser is started with.
    The hosts are names beside the loopback's under which the server may be asked; with one, any address.
    """

    def __init__(
        self, app: ASGIApp, token: str, once: str = "", hosts: tuple[str, ...] = (), command: str = "kineme studio"
    ) -> None:
        self.app, self.token, self._once, self.command = app, token, once, command
        self.names = {"localhost", *map(str.lower, hosts)}
        self.any_address = bool(hosts)
        self.cookie = "kineme_" + hashlib.sha256(token.encode()).hexdigest()[:12]  # two studios on one machine

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what may be asked."""
        if scope["type"] not in {"http", "websocket"}:
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        guarded = _with_headers(send, scope, headers.get("host", ""))
        if refusal := self._refusal(scope, headers):
            await refuse(scope, guarded, *refusal)
        elif _is_page(scope) and not {"token", "once"}.isdisjoint(_query(scope)):
            await self._set_cookie(guarded, headers, scope["scheme"] == "https")
        else:
            await self.app(scope, receive, guarded)

    def _refusal(self, scope: Scope, headers: Mapping[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if not self._is_ours(host):
            return 403, f"expected the address that {self.command} printed, got {host[:80]!r}; open that one"
        if not _same_origin(scope, headers):
            return 403, "expected a request of the studio's own page or of a program, got one of another page"
        if not self._knows_token(scope, headers):
            if self.command != "kineme studio":  # asked by programs, which send a header
                return 401, f"expected the token that {self.command} printed, as the header Authorization: Bearer TOKEN"
            text = "expected the token: open the address that kineme studio printed, with ?token= and what follows it"
            return 401, text
        return None

    def _is_ours(self, host: str) -> bool:
        if (parts := _HOST.fullmatch(host)) is None:
            return False
        name = (parts["address"] or parts["name"]).lower()
        try:
            address = ipaddress.ip_address(name)  # which nobody can point elsewhere
        except ValueError:
            return name in self.names
        return name in self.names or self.any_address or address.is_loopback

    def _knows_token(self, scope: Scope, headers: Mapping[str, str]) -> bool:
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        tokens = [bearer.strip()] if kind.lower() == "bearer" else []
        cookies = (part.partition("=") for part in headers.get("cookie", "").split(";"))
        tokens += [{name.strip(): value.strip() for name, _, value in cookies}.get(self.cookie, "")]
        if scope["type"] == "websocket" or scope["path"] == "/":
            tokens += _query(scope).get("token", [])
        if _is_among(tokens, self.token):
            return True
        used = bool(self._once) and _is_page(scope) and _is_among(_query(scope).get("once", []), self._once)
        if used:
            self._once = ""
        return used

    async def _set_cookie(self, send: Send, headers: Mapping[str, str], encrypted: bool) -> None:
        cookie = f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict" + "; Secure" * encrypted
        # Where a page of another site may have led a browser here, it follows a redirect without the cookie.
        site, is_page = headers.get("sec-fetch-site"), "text/html" in headers.get("accept", "")
        is_linked = is_page and site not in {"none", "same-origin"}
        status, way = (200, (b"refresh", b"0; url=/")) if is_linked else (303, (b"location", b"/"))
        sent = [way, (b"set-cookie", cookie.encode()), (b"cache-control", b"no-store"), (b"content-type", b"text/html")]
        await answer(send, status, sent, b"")


def own_names(host: str) -> tuple[str, ...]:
    """Names under which others may reach this machine, where it listens on `host`."""
    name = socket.gethostname()
    return host, name, f"{name}.local", socket.getfqdn()


def _is_page(scope: Scope) -> bool:
    return scope["type"] == "http" and scope["path"] == "/"


def _is_among(tokens: list[str], secret: str) -> bool:
    return any(hmac.compare_digest(token.encode(), secret.encode()) for token in tokens)


def _same_origin(scope: Scope, headers: Mapping[str, str]) -> bool:
    """Tell whether a request is of no page or of our own."""
    origin = headers.get("origin")
    if origin is not None:
        scheme, _, host = origin.partition("://")
        return scheme in {"http", "https"} and host.lower() == headers.get("host", "").lower()
    if scope["type"] == "http" and scope["method"] in _READING:
        return True
    return headers.get("sec-fetch-site", "none") in {"same-origin", "none"}


def _query(scope: Scope) -> dict[str, list[str]]:
    with suppress(ValueError):  # too many fields
        return parse_qs(scope["query_string"].decode("latin-1"), max_num_fields=20)
    return {}


def _with_headers(send: Send, scope: Scope, host: str) -> Send:
    """Allow browsers scripts, styles and requests of this server alone, and no page around it."""
    framed = scope["path"] == _FRAMED
    socket_of = f"ws://{host} wss://{host}" if all(mark.isalnum() or mark in ".-:[]" for mark in host) else ""
    policy = (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src 'self' blob:; "
        f"font-src 'self'; connect-src 'self' {socket_of}; frame-src 'self'; manifest-src 'self'; base-uri 'none'; "
        f"form-action 'none'; frame-ancestors {chr(39)}{'self' if framed else 'none'}{chr(39)}"
    )
    added = [
        (b"content-security-policy", policy.encode("latin-1")),
        (b"x-content-type-options", b"nosniff"),
        (b"x-frame-options", b"SAMEORIGIN" if framed else b"DENY"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-opener-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
        (b"cache-control", b"no-store" if scope["path"].startswith("/api/") else b"no-cache"),
    ]

    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = {name.lower() for name, _ in message["headers"]}
            missing = (header for header in added if header[0] not in own)
            message = {**message, "headers": [*message["headers"], *missing]}
        await send(message)

    return guarded

"""A phone as a wand: a second server on the local network, with one page and what that page sends.

It listens once a person has asked for it, at one local address, encrypted, under a token of its own, until that person
ends it or nothing moves for a while; all it tells is the name of what was drawn. The page sends requests, as browsers
of iPhones accept a self-signed certificate for these alone (WebKit bug 145819).
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import secrets
import socket
import ssl
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, FastAPI, Request
from pydantic import AfterValidator, BaseModel, Field
from starlette.types import Receive, Scope, Send

from kineme.errors import DataError, KinemeError, SpecificationError
from kineme.io.records import needs
from kineme.studio.server.access import Guard
from kineme.studio.server.connections import BACKLOG, LimitedConnection, config_of
from kineme.studio.server.live_socket import LiveSession, parsed_samples
from kineme.studio.server.records import Number, RequestBody, Text
from kineme.studio.server.refusals import answer, refuse

PORT = 8421  # unless it is taken
IDLE = 600.0  # seconds without a sample after which it ends
AWAY = 10.0  # seconds without a request after which a phone has gone
LOOKS = 0.5  # seconds between looks at both

_MOST_BYTES = 2**16  # of a request
_MOST_PHONES = 4  # at once
_MOST_SOCKETS = 64  # that are open at once; in the first step of encryption nobody has shown a token yet
_SECONDS = 5.0  # that this step may take, and the rest of a request
_HOURS = 24  # that the certificate is valid
_SERVER = "1.3.6.1.5.5.7.3.1"  # what it is for: phones want to be told
_KINDS = {"/": b"text/html; charset=utf-8", "css": b"text/css", "js": b"text/javascript"}
_PARTS = ("canvas", "elements", "lines", "stroke")
_FILES = ("wand.html", "tokens.css", "wand.css", "wand/wand.js", *(f"parts/{name}.js" for name in _PARTS))

Address = ipaddress.IPv4Address | ipaddress.IPv6Address

router = APIRouter(prefix="/api/wand", tags=["wand"])


class WandRequest(RequestBody):
    """An address of this machine, or None for the usual one; the canvas's height in units of the library."""

    host: Annotated[Text, AfterValidator(lambda text: str(ipaddress.ip_address(text)))] | None = None
    height: Number = Field(1.0, gt=0)
    n_dims: Literal[2, 3] = 2


class WandOut(BaseModel):
    """The address for a phone, its picture (QR code), and the fingerprint (SHA-256) of its certificate."""

    address: str | None = None
    picture: str | None = None
    fingerprint: str | None = None


@router.get("")
async def wand_of(request: Request) -> WandOut:
    """Return the address for a phone, if the person has asked for one."""
    wand: Wand | None = request.app.state.wand
    return WandOut() if wand is None else wand.shown


@router.post("")
async def open_wand(request: Request, wanted: WandRequest) -> WandOut:
    """Listen for a phone on the local network; what listened before ends."""
    close_wand(request.app)
    wand = Wand(request.app, wanted)
    await wand.open()
    close_wand(request.app)  # that another page has opened meanwhile
    request.app.state.wand = wand
    return wand.shown


@router.delete("")
async def end_wand(request: Request) -> WandOut:
    """Listen no more."""
    close_wand(request.app)
    return WandOut()


def close_wand(app: FastAPI) -> None:
    """End what listens for a phone, if anything does."""
    wand, app.state.wand = app.state.wand, None
    if wand is not None:
        wand.close()


class Wand:
    """A server with the page for phones, and the phones that are there, by the ids that their pages have."""

    def __init__(self, app: FastAPI, wanted: WandRequest) -> None:
        self.app, self.wanted = app, wanted
        self.host = ipaddress.ip_address(wanted.host or local_address())
        self.token = secrets.token_urlsafe(24)
        self.phones: dict[str, Phone] = {}
        web = files("kineme").joinpath("studio", "web")
        self._files = {f"/{name}": web.joinpath(*name.split("/")).read_bytes() for name in _FILES}
        self._files["/"] = self._files.pop("/wand.html")
        self._moved = asyncio.get_running_loop().time()

    async def open(self) -> None:
        """Listen from now on; raises as `listening_at` and `certificate_of` do."""
        with needs("segno", "draw the address for a phone", "studio"):
            import segno
        from uvicorn.server import ServerState

        context, fingerprint = certificate_of(self.host)
        config = config_of(Guard(self, self.token, hosts=(str(self.host),), command="the studio"))
        config.ws = "none"
        config.load()
        state, loop = ServerState(), asyncio.get_running_loop()
        listening = listening_at(self.host)
        self._server = await loop.create_server(
            lambda: LimitedConnection(config, state, {}, loop),
            sock=listening,
            ssl=context,
            ssl_handshake_timeout=_SECONDS,
            backlog=BACKLOG,
        )
        self._connections = state.connections
        host = f"[{self.host}]" if self.host.version == 6 else self.host
        address = f"https://{host}:{listening.getsockname()[1]}/?token={self.token}"
        picture = segno.make(address, error="m").svg_data_uri(border=4, dark="#000", light="#fff", omitsize=True)
        self.shown = WandOut(address=address, picture=picture, fingerprint=fingerprint)
        self._watching = asyncio.create_task(self._watch())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request that the guard let through."""
        path, method = scope["path"], scope["method"]
        kind = b"application/json"
        try:
            if path == "/api/samples" and method == "POST":
                async with asyncio.timeout(_SECONDS):
                    content = await self._content(receive)
                body = json.dumps(await self.hear(content)).encode()
            elif path in self._files and method == "GET":
                kind, body = _KINDS[path.rpartition(".")[2]], self._files[path]
            else:
                await refuse(scope, send, 404, "expected the page for phones, got another address; scan the code again")
                return
        except (KinemeError, TimeoutError) as error:
            await refuse(scope, send, 400, str(error) or "expected the rest of the request, got nothing")
        else:
            await answer(send, 200, [(b"content-type", kind)], body)

    async def _content(self, receive: Receive) -> dict[str, Any]:
        body, more = b"", True
        while more and len(body) <= _MOST_BYTES:
            message = await receive()
            body, more = body + message.get("body", b""), message.get("more_body", False)
        with suppress(ValueError, RecursionError):
            if isinstance(content := json.loads(body[: _MOST_BYTES + 1]), dict) and not more:
                return content
        raise DataError(f"expected JSON of at most {_MOST_BYTES:,} bytes, got something else; open the page again")

    def close(self) -> None:
        """Listen no more, and forget the phones."""
        self._watching.cancel()
        self._server.close()
        for connection in list(self._connections):
            connection.transport.abort()
        for name in list(self.phones):
            self.app.state.sources.remove(self.phones.pop(name).source)

    async def _watch(self) -> None:
        clock = asyncio.get_running_loop().time
        while clock() - self._moved < IDLE:
            await asyncio.sleep(LOOKS)
            for name in [name for name, phone in self.phones.items() if clock() - phone.heard > AWAY]:
                self.app.state.sources.remove(self.phones.pop(name).source)
        close_wand(self.app)

    async def hear(self, content: dict[str, Any]) -> dict[str, Any]:
        """Take in what the page of a phone sent, and return the name of its movement so far, or raise a DataError."""
        name = content.get("id")
        if not isinstance(name, str) or not 0 < len(name) <= 40:
            raise DataError("expected a message of the page for phones, got something else; open that page again")
        if name not in self.phones:
            if len(self.phones) >= _MOST_PHONES:
                raise DataError(f"expected at most {_MOST_PHONES} phones at once, got another one; close one of them")
            self.phones[name] = Phone(self.app, self.wanted)
        phone = self.phones[name]
        phone.heard = asyncio.get_running_loop().time()
        if content.get("samples"):
            self._moved = phone.heard
        return await phone.hear(content)


class Phone:
    """One phone: the stream of its movement, and what pages are shown of it."""

    def __init__(self, app: FastAPI, wanted: WandRequest) -> None:
        self._live, self._wanted, self.heard = app.state.studio.live, wanted, 0.0
        self._session, self.source = LiveSession(app.state.studio), app.state.sources.add()
        self._turn = asyncio.Lock()
        self.source.rename("phone")

    async def hear(self, content: dict[str, Any]) -> dict[str, Any]:
        """Take in a message: ``begin``, ``samples`` in heights of the canvas, ``finish``, each if it is there."""
        run = asyncio.get_running_loop().run_in_executor
        async with self._turn:
            said: dict[str, Any] = {}
            if content.get("begin") is True:
                self._session.reset()
                self.source.reset()
            if content.get("samples"):
                samples = parsed_samples(content["samples"])
                if samples.shape[1] != 3:
                    raise DataError("expected samples of a time, x and y, got others; open the page again")
                scale = np.repeat((1.0, self._wanted.height), (1, 2))
                samples = np.pad(samples * scale, ((0, 0), (0, self._wanted.n_dims - 2)))
                said = await run(self._live, self._session.update, samples)
                self.source.update(samples, said)
            if content.get("finish") is True:
                ended = await run(self._live, self._session.finish)
                self.source.end(ended)
                said = ended.get("answer") or {}
            return {name: said.get(name) for name in ("label", "certainty")}


class _FewSockets(socket.socket):
    """A socket that accepts no more connections than a few at once: others of the process stay free for the studio."""

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection, or close it at once, which asyncio takes as one that the other side has ended."""
        connection, address = super().accept()
        self.accepted = [other for other in getattr(self, "accepted", []) if other.fileno() >= 0]
        if len(self.accepted) >= _MOST_SOCKETS:
            connection.close()
            raise ConnectionAbortedError
        self.accepted.append(connection)
        return connection, address


def local_address() -> str:
    """Return the address of this machine in the network of its default route, without sending; else a DataError."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.connect(("192.0.2.1", 9))  # an address for documentation
        return str(probe.getsockname()[0])
    raise DataError(
        "expected this machine to be in a network, got none; connect it to the phone's network, or write its address"
    )


def listening_at(host: Address) -> socket.socket:
    """Open a socket that listens at an address of a local network that this machine has; else a KinemeError."""
    is_mapped = getattr(host, "ipv4_mapped", None) is not None  # of which Pythons differ whether it is global
    if host.is_global or host.is_unspecified or host.is_multicast or is_mapped:
        raise SpecificationError(
            f"expected the address of this machine in a local network, such as 192.168.1.20, got {host}; write that one"
        )
    listening = _FewSockets(socket.AF_INET6 if host.version == 6 else socket.AF_INET)
    try:
        with suppress(OSError):
            listening.bind((str(host), PORT))
        if listening.getsockname()[1] != PORT:
            listening.bind((str(host), 0))
        listening.listen(BACKLOG)
    except OSError as error:
        listening.close()
        raise DataError(f"expected an address of this machine, got {host}: {error.strerror}; correct it") from error
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listening


def certificate_of(host: Address) -> tuple[ssl.SSLContext, str]:
    """Make a certificate for an address, signed by itself, with a new key; return it for a server, and its SHA-256."""
    with needs("cryptography", "encrypt what a phone sends", "studio"):
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "kineme studio")])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=_HOURS))  # clocks of phones differ
        .not_valid_after(now + timedelta(hours=_HOURS))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(host)]), critical=False)
        .add_extension(x509.ExtendedKeyUsage([x509.ObjectIdentifier(_SERVER)]), critical=False)
        .sign(key, hashes.SHA256())
    )
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    encoding, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    private = key.private_bytes(encoding, form, serialization.NoEncryption())
    with TemporaryDirectory() as folder:  # that only this user can read
        path = Path(folder, "wand.pem")
        path.write_bytes(private + certificate.public_bytes(encoding))
        context.load_cert_chain(path)
    return context, certificate.fingerprint(hashes.SHA256()).hex(":").upper()

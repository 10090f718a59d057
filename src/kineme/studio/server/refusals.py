"""Answers to requests that are refused: a status and one sentence, as JSON."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from kineme.errors import KinemeError
from kineme.library.storage.connection import BusyError
from kineme.reporting.text import in_markup

# Bounded where they repeat: texts hold the names of other people's files and columns, of any length.
_CHANNELS = (
    r"(?:choose|select) the (?:columns|dimensions)\b.{0,80}?in the shell (?:with )?--columns(?: and --kind)?"
    r"(?: \(--feature [^)]{0,40}\))?"
)
_SMALLER = "make the movement smaller"
_WORDS = tuple(
    (re.compile(library), studio)
    for library, studio in (
        (_CHANNELS, "choose other channels"),
        (r"save np\.moveaxis\(array, 1, 2\), of one movement array\.T", "turn the array before it is saved"),
        (r"labels\.astype\(str\)", "plain text"),
        (
            r"choose the position \(columns=, .{0,20}--columns\), and give .{0,90}(?:, or say .{0,50}--joints\))?",
            "make a library of movements in the plane or in space; if these move the joints of an arm, execute them in "
            "the shell: kineme move with --joints",
        ),
        (r"choose another place \(--at\), free the orientation .{0,80}\(--scale\)", _SMALLER),
        (r"is it in millimeters\? .{0,40} --scale 0\.001 makes a movement so", _SMALLER),
        (r"choose another place \(--at\), orientation .{0,80}\(--rest\)", f"{_SMALLER}, or choose another arm"),
        (
            r"choose another goal \(--goal\) or start \(--at\) of the joints",
            "drag the goal in Move, or choose another arm",
        ),
        (r"slow it down \(timing='slowed', --slow-down\)", "tick 'Slow down where limits need it'"),
        (
            r"; [^;]*\bin the shell (?:with )?(--.*)",
            r"; change the file, or learn it in the shell: kineme learn with \1",
        ),
        (r"\((?:choose with )?\w{1,20}=[^()]{0,20}, (--[\w-]+)\)", r"(in the shell \1)"),
    )
)

_LOG = logging.getLogger("kineme.studio")


class MissingError(Exception):
    """Nothing of that name or number is there; 404."""


class ConflictError(Exception):
    """The library has changed meanwhile; 409."""


class StoppedError(Exception):
    """Nobody waits for the work any more; 499, which nobody reads."""


async def refuse(scope: Scope, send: Send, status: int, text: str) -> None:
    """Refuse a request, or a websocket before it is opened, without reading more of it."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": text[:100]})
        return
    as_page = scope["method"] == "GET" and any(
        name == b"accept" and b"text/html" in value for name, value in scope["headers"]
    )
    kind, body = (b"application/json", _plain(text))
    if as_page:  # for people who have opened an address by hand: nothing but words
        page = (
            '<!doctype html><html lang="en"><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width">'
            '<meta name="color-scheme" content="light dark"><title>kineme studio: not opened</title>'
            f"<h1>The studio was not opened</h1><p>It {in_markup(text.rstrip('.'))}.</p>"
            "<p>The address stands in the terminal in which <code>kineme studio</code> was started, that for a phone in"
            " the code under <em>Use a phone</em>; copy the whole of it. The token in it is another one each time.</p>"
            "</html>"
        )
        kind, body = b"text/html; charset=utf-8", page.encode()
    more = [(b"connection", b"close")] if status in {408, 413} else []  # the rest of the body is not read
    await answer(send, status, [(b"content-type", kind), *more], body)


class AnswersFailures:
    """Answer where the server itself fails: the framework would answer outside of the guard, without its headers."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on; what failed stands in the log alone."""
        begun = scope["type"] != "http"

        async def noted(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self.app(scope, receive, noted)
        except Exception:
            if begun:
                raise
            _LOG.exception("%s %s failed", scope["method"], scope["path"])
            text = _plain("internal error; details are in the server log")
            await answer(send, 500, [(b"content-type", b"application/json")], text)


async def answer(send: Send, status: int, headers: list[tuple[bytes, bytes]], body: bytes) -> None:
    """Send a whole answer."""
    length = (b"content-length", str(len(body)).encode())
    await send({"type": "http.response.start", "status": status, "headers": [*headers, length]})
    await send({"type": "http.response.body", "body": body})


def _plain(text: str) -> bytes:
    return json.dumps({"error": text}).encode()


def answer_errors(app: FastAPI) -> None:
    """Answer to errors with {"error": what was expected, what came, what to do}."""

    async def refusal(_: Request, error: Any) -> JSONResponse:
        kind = next(kind for kind in type(error).__mro__ if kind in _STATUSES)
        status, text = _STATUSES[kind](error)
        return JSONResponse({"error": text}, status)

    for kind in _STATUSES:
        app.add_exception_handler(kind, refusal)


def _first_problem(error: RequestValidationError) -> str:
    problem = error.errors()[0]
    where = ".".join(str(part) for part in problem["loc"] if part not in {"body", "query", "path"})
    return f"expected another value of {where or 'the request'}: {problem['msg']}"


#: Kind of error -> status and text of the answer.
_STATUSES: dict[type[Exception], Callable[[Any], tuple[int, str]]] = {
    KinemeError: lambda error: (503 if isinstance(error, BusyError) else 400, in_studio_words(str(error))),
    MissingError: lambda error: (404, str(error)),
    ConflictError: lambda error: (409, str(error)),
    PermissionError: lambda error: (403, str(error)),
    StoppedError: lambda error: (499, "expected somebody to wait for the answer; it was stopped"),
    RequestValidationError: lambda error: (422, _first_problem(error)),
    ClientDisconnect: lambda error: (400, "the rest of the request did not come"),  # nobody is there to read it
    HTTPException: lambda error: (error.status_code, str(error.detail)),
}


def in_studio_words(text: str) -> str:
    """Return a refusal with what can be done about it in the studio, or where else."""
    for library, studio in _WORDS:
        text = library.sub(studio, text)
    return text

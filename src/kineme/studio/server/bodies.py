"""Limits of what clients send: bytes, counted while they arrive, and seconds without any."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from kineme.studio.server.refusals import refuse

JSON_BYTES = 8 * 2**20
FILE_BYTES = 256 * 2**20
FILES = "/api/recordings"  # where files are sent to; anything else is JSON
SILENCE = 20.0  # seconds without a byte


class LimitedBodies:
    """Refuse requests that are too large or stop arriving: 413 and 408, whatever their head says."""

    def __init__(self, app: ASGIApp, silence: float = SILENCE) -> None:
        self.app, self.silence = app, silence

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with a limited `receive`; what is refused there is answered here."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        body = _Body(receive, FILE_BYTES if scope["path"] == FILES else JSON_BYTES, self.silence)

        async def unless_refused(message: Message) -> None:
            if body.refused is None:
                await send(message)

        if not body.is_announced_too_large(scope):
            with suppress(_RefusedError):
                await self.app(scope, body, unless_refused)
        if body.refused is not None:
            await refuse(scope, send, *body.refused)


class _RefusedError(Exception):
    """Ends the work on a request, unless that catches everything."""


class _Body:
    def __init__(self, receive: Receive, most: int, silence: float) -> None:
        self.receive, self.most, self.silence = receive, most, silence
        self.got, self.whole = 0, False
        self.refused: tuple[int, str] | None = None

    async def __call__(self) -> Message:
        if self.whole:  # what comes after the body is that the client has gone, whenever it does
            return await self.receive()
        try:
            async with asyncio.timeout(self.silence):
                message = await self.receive()
        except TimeoutError:
            self.refused = 408, f"expected the rest of the request, got nothing for {self.silence:g} s"
            raise _RefusedError from None
        self.got += len(message.get("body", b""))
        self.whole = not message.get("more_body", False)
        if self.got > self.most:
            self._refuse_size()
            raise _RefusedError
        return message

    def is_announced_too_large(self, scope: Scope) -> bool:
        """Whether the head of the request says so."""
        length = dict(scope["headers"]).get(b"content-length", b"0")
        if length.isdigit() and int(length[:20]) > self.most:
            self._refuse_size()
        return self.refused is not None

    def _refuse_size(self) -> None:
        self.refused = 413, f"expected at most {self.most // 2**20} MB, got more; send less at once"

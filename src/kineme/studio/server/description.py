"""The description of the interface: who may ask, and what every refusal looks like."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel, Field

ABOUT = """An action library: what movements are, what they are called, and how they go on.

Times are in seconds, positions in the unit of the library. Numbers that are not finite are null. The websocket
`/api/live` takes movements while they happen, and tells of every change of the library.
"""

_STATUSES = (
    "400: what is asked for makes no sense, 401: without the token, 403: for reading only, or from the page of another "
    "site, 404: not there, 408: the request stopped arriving, 409: the library was changed meanwhile, 413: too large, "
    "422: a field is wrong."
)


class Refusal(BaseModel):
    """Why nothing was done."""

    error: str = Field(description="What was expected, what came, and what to do.")


#: Of every route.
REFUSALS: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": Refusal, "description": _STATUSES},
    "5XX": {"model": Refusal, "description": "503: another process writes; try again. 500: the server failed."},
}

_TOKENS = {
    "bearer": {"type": "http", "scheme": "bearer", "description": "The token in the address that the studio prints."},
    "cookie": {"type": "apiKey", "in": "cookie", "name": "kineme_...", "description": "Set by `/?token=...`."},
}


class Described(FastAPI):
    """An application whose description says that it wants a token."""

    def openapi(self) -> dict[str, Any]:
        """The description, made once."""
        described = super().openapi()
        described["components"]["securitySchemes"] = _TOKENS
        described["security"] = [{name: []} for name in _TOKENS]
        return described

"""Where a library lies: in a folder, or in a schema of a database on a PostgreSQL server."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from kineme.errors import SpecificationError

_SCHEMA = "kineme"
_MAX_NAME = 63  # bytes, of which PostgreSQL drops the others without a word
_SERVER = re.compile(r"postgres(?:ql)?:/")  # one slash is left where a path was made of an address
_HIDDEN = "***"


@dataclass(frozen=True)
class Address:
    """The address of a library on a server; as text and in every message without its password."""

    #: As libpq takes it; a password that it lacks libpq reads from PGPASSWORD, a password file or a service.
    uri: str = field(repr=False)
    schema: str  # the namespace of the library's tables, one for each library
    shown: str

    def __str__(self) -> str:
        return self.shown

    @property
    def name(self) -> str:
        """The name of the library: that of its schema."""
        return self.schema

    def without_secrets(self, text: str) -> str:
        """Return a text, as of an error, without the password, however it is spelled there."""
        for secret in _secrets(self.uri):
            text = text.replace(secret, _HIDDEN).replace(unquote(secret), _HIDDEN)
        return text

    @classmethod
    def of(cls, text: str) -> Address:
        """Read ``postgresql://user@host:port/database?schema=name``; other parameters are those of libpq."""
        uri, mark, query = text.partition("?")
        parameters = [part for part in query.split("&") if part]
        schemas = [unquote(part.partition("=")[2]) for part in parameters if part.startswith("schema=")]
        others = [part for part in parameters if not part.startswith("schema=")]
        uri += mark * bool(others) + "&".join(others)
        schema = schemas[0] if schemas else _SCHEMA
        reserved = schema.startswith("pg_") or schema == "information_schema"
        if len(schemas) > 1 or not schema or "\0" in schema or len(schema.encode()) > _MAX_NAME or reserved:
            raise SpecificationError(
                f"expected one schema of 1 to {_MAX_NAME} bytes that is not PostgreSQL's own, got {schemas!r}; "
                "as in postgresql://user@host/database?schema=actions"
            )
        shown = uri
        for secret in _secrets(uri):
            shown = shown.replace(secret, _HIDDEN)
        if schema != _SCHEMA:
            shown += ("&" if others else "?") + f"schema={quote(schema, safe='')}"
        return cls(uri, schema, shown)


def _secrets(uri: str) -> list[str]:
    """Return the passwords in an address, as they are spelled there."""
    authority, _, query = uri.partition("://")[2].partition("?")
    user = authority.partition("/")[0].rpartition("@")[0]
    secrets = [user.partition(":")[2], *re.findall(r"(?:^|&)(?:ssl)?password=([^&]*)", query)]
    return sorted(filter(None, secrets), key=len, reverse=True)


def as_location(folder: Any) -> Path | Address:
    """Return the folder of a library that exists or is to be created, or its address on a server."""
    if isinstance(folder, Address):
        return folder
    name = os.fsdecode(folder) if isinstance(folder, str | os.PathLike) else ""
    if not name.strip() or "\0" in name:
        raise SpecificationError(f"expected the folder of a library, got {folder!r}; the current one is '.'")
    if _SERVER.match(name):
        if not isinstance(folder, str) or "://" not in name:
            raise SpecificationError(
                "expected the address of a library as text, postgresql://user@host/database, got a path of it; paths "
                "drop a slash"
            )
        return Address.of(name)
    return Path(name)

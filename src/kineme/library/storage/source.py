"""Sources of movements: a file as it was when it was read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Source:
    """A file of recordings.

    Parameters
    ----------
    path : str
        As given by the user; never opened again.
    sha256 : str
        Hash of its bytes. Equal bytes read with equal options are the same source, whatever their path.
    size : int
        In bytes.
    kind : str
        Format: "csv", "npz", ...
    options : mapping
        Options of the reader: columns, units; anything that JSON can represent.
    read_at : str
        Time, ISO 8601.
    """

    path: str
    sha256: str
    size: int
    kind: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    read_at: str = ""

    @classmethod
    def of_file(cls, path: str | Path, kind: str = "", options: Mapping[str, Any] | None = None) -> Source:
        """The source of a file as it is now."""
        with Path(path).open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
            size = file.tell()
        now = datetime.now(UTC).isoformat(timespec="seconds")
        return cls(str(path), sha256, size, kind or Path(path).suffix.lower().lstrip("."), dict(options or {}), now)

    @property
    def options_json(self) -> str:
        """The options as canonical JSON."""
        return json.dumps(dict(self.options), sort_keys=True)

"""Where movements come from: a file as it was when it was read."""

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
        As the user gave it; never opened again.
    sha256 : str
        Of its bytes. The same bytes read with the same options are the same source, wherever they lie.
    size : int
        In bytes.
    kind : str
        How it was read: "csv", "npz", ...
    options : mapping
        What the reader was told: columns, units; anything that JSON can hold.
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
        """Look at a file now."""
        with Path(path).open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
            size = file.tell()
        now = datetime.now(UTC).isoformat(timespec="seconds")
        return cls(str(path), sha256, size, kind or Path(path).suffix.lower().lstrip("."), dict(options or {}), now)

    @property
    def options_json(self) -> str:
        """The options in one spelling."""
        return json.dumps(dict(self.options), sort_keys=True)

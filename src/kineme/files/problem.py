"""What is wrong with a file, and where."""

from __future__ import annotations

from typing import NamedTuple

from kineme.errors import DataError, KinemeError


class Problem(NamedTuple):
    """Something that could not be read.

    `line` counts from 1; None if the file has no lines. `error` is the class that is raised if only this file is read.
    """

    file: str
    line: int | None
    reason: str
    error: type[KinemeError] = DataError

    @property
    def what(self) -> str:
        """Line and reason, without the file."""
        return f"line {self.line}: {self.reason}" if self.line else self.reason

    def __str__(self) -> str:
        return f"{self.file}{', ' if self.line else ': '}{self.what}"

"""Labels and people from the names of files and folders, as the caller says."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from string import Formatter
from typing import NamedTuple

from kineme.errors import SpecificationError
from kineme.io.reading.entries import as_text
from kineme.io.reading.read_file import FileRead
from kineme.io.records import Problem

#: Fields of a pattern that say something; others only stand for text that differs.
LABEL, PERSON = "label", "person"
_NUMBER = "n"  # of digits only
TASK, FOLDER = "task", "folder"
_EXAMPLE = "{person}_{label}_{n}.csv"


class Part(NamedTuple):
    """Text that stands as it is, and the field behind it, or None at the end."""

    text: str
    field: str | None


@dataclass(frozen=True)
class NameRule:
    """The origin of labels, if not the recording or its innermost folder.

    Attributes
    ----------
    label_pattern : str, optional
        A file name with fields in braces, as ``"{person}_{label}_{n}.csv"``. ``{label}`` is the label, ``{person}`` who
        showed the movements; other fields are passed over, and ``{n}`` is a number. Each takes as little as it can,
        and all other text is taken literally. With slashes it is compared with as many folders too.
    label_by : {"task", "folder"} or int, optional
        ``"task"``: the label in the recording alone, as the tasks of LeRobot; ``"folder"``: the innermost folder, also
        of a file that is given alone; a number: the folder so many levels up, 1 for the innermost.
    """

    label_pattern: str | None = None
    label_by: str | int | None = None

    def __post_init__(self) -> None:
        by, fields = self.label_by, {part.field for part in self.parts}
        is_level = isinstance(by, int) and not isinstance(by, bool) and by >= 1
        if not (by is None or by in {TASK, FOLDER} or is_level):
            raise SpecificationError(f"expected label_by to be 'task', 'folder' or a level from 1, got {by!r}")
        if self.label_pattern is not None and not fields & {LABEL, PERSON}:
            raise self._not_understood("it has neither {label} nor {person}")
        if by is not None and LABEL in fields:
            raise SpecificationError("expected label_by or {label} in label_pattern, not both")

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The pattern, cut at its fields."""
        try:
            cut = list(Formatter().parse(self.label_pattern or ""))
        except ValueError as error:
            raise self._not_understood(str(error)) from error
        named = [name for _, name, _, _ in cut if name is not None]
        if any(spec or conversion or not (name or "a").isidentifier() for _, name, spec, conversion in cut):
            raise self._not_understood("a field is a word in braces")
        if "" in named or len(set(named)) < len(named):
            raise self._not_understood("each field has a name of its own")
        merged = [Part("", None)]
        for text, name, _, _ in cut:  # doubled braces end a part without a field
            before = merged.pop() if merged[-1].field is None else Part("", None)
            merged += [Part(before.text + text, name), Part("", None)][: 1 if name is None else 2]
        if any(not part.text for part in merged[1:-1]):
            raise self._not_understood("there is no text between two fields")
        return tuple(merged)

    @property
    def names_person(self) -> bool:
        """True if the pattern says who showed the movements."""
        return PERSON in {part.field for part in self.parts}

    def apply(self, read: FileRead, path: Path) -> FileRead:
        """A file with the labels that its path says; one that the pattern does not match is a problem."""
        if read.block is None:
            return read
        label = _folder(path, 1 if self.label_by == FOLDER else self.label_by) if self._by_folder else None
        person = None
        if self.label_pattern is not None:
            depth = self.label_pattern.count("/") + 1
            name = "/".join(_parts(path, depth)[-depth:])
            fields = match(self.parts, name)
            if fields is None:
                reason = f"expected a name like {self.label_pattern}, as the label pattern says, got {name}"
                return read._replace(block=None, problems=[*read.problems, Problem(read.path, None, reason)])
            label, person = fields.get(LABEL, label), fields.get(PERSON)
        if label is None and not self._by_folder:
            return read._replace(person=person)
        block = replace(read.block, labels=[label] * len(read.block.labels))
        return read._replace(block=block, person=person)

    @property
    def _by_folder(self) -> bool:
        return self.label_by not in {None, TASK}

    def _not_understood(self, why: str) -> SpecificationError:
        return SpecificationError(
            f"expected a file name with fields in braces as label_pattern, such as {_EXAMPLE}, got "
            f"{self.label_pattern!r}; {why}"
        )


def match(parts: tuple[Part, ...], name: str) -> dict[str, str] | None:
    """The text of each field, none of them empty or with a slash; None if the name is not like the pattern."""

    @cache  # so that no name takes more than the square of its length
    def fields(k: int, start: int) -> tuple[str, ...] | None:
        text, field = parts[k]
        if not name.startswith(text, start):
            return None
        start += len(text)
        if field is None:
            return () if start == len(name) else None
        for end in range(start + 1, len(name) + 1):
            last = name[end - 1]
            if last == "/" or (field == _NUMBER and not last.isdecimal()):
                return None
            more = fields(k + 1, end)
            if more is not None:
                return (name[start:end], *more)
        return None

    values = fields(0, 0)
    return None if values is None else dict(zip([part.field for part in parts if part.field], values, strict=True))


def _folder(path: Path, level: str | int | None) -> str | None:
    """The name of the folder so many levels up, or None above the topmost."""
    up = int(level or 1)
    names = _parts(path, up + 1)
    return names[-1 - up] if len(names) > up else None


def _parts(path: Path, n: int) -> list[str]:
    """The names of a path; of as much of the whole path as has n of them."""
    parts = [part for part in path.parts if part not in {path.anchor, ".", ".."}]
    if len(parts) < n or ".." in path.parts:
        absolute = Path(os.path.abspath(path))
        parts = [part for part in absolute.parts if part != absolute.anchor]
    return [as_text(part) for part in parts]

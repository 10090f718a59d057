"""The numbers in messages of any type, by the definition in the bag, of which no program is made."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.io.ros.bags import Bag, Topic
from kineme.io.ros.damage import refused

_FORMATS = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_WIDEST, _DEEPEST, _LONGEST = 1000, 20, 200_000  # numbers in a row, types in types, characters of a definition
_ORIGIN = 4  # bytes in front of a message of ROS 2, from which on it is aligned


class Step(NamedTuple):
    """What stands next in a message: numbers of some formats, or a text, or elements that are no columns."""

    formats: str = ""
    heads: tuple[str, ...] = ()
    element: tuple[Step, ...] | None = None  # of a sequence, or of an array that is too long for columns
    length: int | None = None  # number of elements; None: the message says it


class Numbers(NamedTuple):
    """The numbers of a message, and the stamp of its header [ns]."""

    row: list[float]
    stamp: int


@dataclass(frozen=True)
class NumberFields:
    """Where the numbers of a type stand: columns by the path of their field, as ``angular_velocity.x``.

    Arrays of fixed size are columns as well, ``ranges.0``; texts and sequences of any length are passed over. The
    header is no column: it is the stamp.
    """

    type: str
    version: int  # of ROS
    steps: tuple[Step, ...]

    @cached_property
    def _all(self) -> list[str]:
        return [head for step in self.steps for head in step.heads]

    @cached_property
    def _kept(self) -> list[int]:
        return [k for k, head in enumerate(self._all) if not head.startswith("header.")]

    @cached_property
    def _stamp(self) -> tuple[int, int] | None:
        seconds, nanoseconds = _STAMP
        return (self._all.index(seconds), self._all.index(nanoseconds)) if nanoseconds in self._all else None

    @property
    def has_header(self) -> bool:
        """Whether messages tell their own time."""
        return self._stamp is not None

    @cached_property
    def heads(self) -> tuple[str, ...]:
        """The columns."""
        return tuple(self._all[k] for k in self._kept)

    def decode(self, raw: bytes) -> Numbers:
        """The numbers in the bytes of a message.

        Raises
        ------
        ValueError
            They are of another type, or cut off.
        """
        is_2 = self.version == 2
        if is_2 and (len(raw) < _ORIGIN or raw[0] != 0 or raw[1] > 1):
            raise ValueError(f"expected a {self.type}, got no bytes in CDR")
        row: list[float] = []
        try:
            end = _read(self.steps, raw, _ORIGIN if is_2 else 0, ">" if is_2 and not raw[1] else "<", is_2, row)
        except struct.error as error:
            raise ValueError(f"expected a {self.type}, got {len(raw)} bytes, which are too few") from error
        if not is_2 and end != len(raw):
            raise ValueError(f"expected a {self.type}, got {len(raw)} bytes for {end}")
        stamp = 0
        if self._stamp is not None:
            seconds, nanoseconds = (int(row[k]) for k in self._stamp)
            stamp = seconds * 1_000_000_000 + nanoseconds
        return Numbers([row[k] for k in self._kept], stamp)


def number_fields(bag: Bag, topic: Topic) -> NumberFields:
    """The numbers of a topic, by the definition in the bag or, where it holds none, by that of the standard type.

    Raises
    ------
    DataError
        No definition, a damaged one, one with texts of wide characters, or several that differ; or no numbers.
    """
    definitions = {one.msgdef.data: one.msgdef for one in topic.connections}
    where = f"topic {topic.name}: expected the definition of {topic.type}"
    if len(definitions) > 1:
        raise DataError(f"{where}, got several that differ; convert the topic to CSV")
    (text, definition), *_ = definitions.items()
    if len(text) > _LONGEST:
        raise DataError(f"{where} of at most {_LONGEST:,} characters, got {len(text):,}; convert the topic to CSV")
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    with refused(where, "convert the topic to CSV"):
        parse = (
            get_types_from_idl if definition.format.name == "IDL" else lambda text: get_types_from_msg(text, topic.type)
        )
        types = {**_standard(bag.version), **(parse(text) if text.strip() else {})}
        steps = tuple(_steps(types, topic.type, "", bag.version, _DEEPEST))
    fields = NumberFields(topic.type, bag.version, steps)
    if not fields.heads:
        raise DataError(f"topic {topic.name}: expected numbers in messages of {topic.type}, got none")
    return fields


def _standard(version: int) -> Mapping[str, Any]:
    from rosbags.typesys import Stores, get_typestore

    return dict(get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.LATEST).fielddefs)


def _steps(types: Mapping[str, Any], name: str, prefix: str, version: int, deep: int) -> list[Step]:
    """The steps of a type; numbers that follow each other are one step."""
    if not deep:
        raise DataError(f"expected types within types at most {_DEEPEST} deep, got more")
    steps: list[Step] = []
    for field, described in types[name][1]:
        for one in _steps_of_field(types, described, f"{prefix}{field}", version, deep):
            if one.formats and steps and steps[-1].formats:
                steps[-1] = Step(steps[-1].formats + one.formats, steps[-1].heads + one.heads)
            else:
                steps.append(one)
    return steps


def _steps_of_field(types: Mapping[str, Any], described: Any, path: str, version: int, deep: int) -> list[Step]:
    kind, about = described[0].name, described[1]
    if kind == "NAME":
        return _steps(types, about, f"{path}.", version, deep - 1)
    if kind == "BASE":
        base = about[0]
        if base == "string":
            return [Step()]
        if base not in _FORMATS:
            raise DataError(f"expected numbers and texts, got {base} in {path}")
        return [Step("b" if base == "byte" and version == 1 else _FORMATS[base], (path,))]
    inner, count = about
    element = _steps_of_field(types, inner, path, version, deep - 1)
    if kind == "SEQUENCE":
        return [Step(element=tuple(element))]
    width = sum(len(step.heads) for step in element)
    if not element or not 0 < width * count <= _WIDEST:
        return [Step(element=tuple(element), length=count)] if element else []
    return [step for k in range(count) for step in _steps_of_field(types, inner, f"{path}.{k}", version, deep - 1)]


def _read(steps: tuple[Step, ...], raw: bytes, at: int, order: str, aligned: bool, row: list[float]) -> int:
    """Read numbers into a row; where the message goes on."""
    for step in steps:
        if step.formats:
            layout = _layout(step.formats, (at - _ORIGIN) % 8 if aligned else -1, order)
            row += layout.unpack_from(raw, at)
            at += layout.size
            continue
        count = step.length
        if count is None:
            layout = _layout("I", (at - _ORIGIN) % 8 if aligned else -1, order)
            (count,) = layout.unpack_from(raw, at)
            at += layout.size
        if step.element is None:
            at += count
        elif len(step.element) == 1 and len(step.element[0].formats) == 1 and count:
            layout = _layout(step.element[0].formats, (at - _ORIGIN) % 8 if aligned else -1, order)
            at += layout.size + (count - 1) * struct.calcsize(f"={step.element[0].formats}")
        elif step.element:
            passed: list[float] = []
            for _ in range(count):
                at = _read(step.element, raw, at, order, aligned, passed)
                passed.clear()
        if at > len(raw):
            raise ValueError(f"expected {at} bytes, got {len(raw)}")
    return at


@lru_cache(maxsize=4096)
def _layout(formats: str, phase: int, order: str) -> struct.Struct:
    """Numbers in a row from an offset modulo 8 on, each at a multiple of its size; without padding for phase -1."""
    offset, padded = max(phase, 0), order
    for one in formats:
        size = struct.calcsize(f"={one}")
        gap = 0 if phase < 0 else -offset % size
        padded += "x" * gap + one
        offset += gap + size
    return struct.Struct(padded)

"""MVNX: recordings of Xsens MVN as XML, positions and orientations of segments and angles of joints for each frame.

Source: Xsens, "MVN User Manual", the section on MVNX. ``<subject frameRate="60">`` holds ``<segments>`` and
``<joints>``, which name what the numbers of each ``<frame time="16" type="normal">`` are of: ``<orientation>`` has
w, x, y, z and ``<position>`` x, y, z [m] of each segment, ``<jointAngle>`` three angles [deg] of each joint. Times are
in milliseconds.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from xml.parsers import expat

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.motion_capture.export_heads import STAMP, positive
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout, no_lines
from kineme.movements.tables.table import Table

_DEEPEST = 32
_MOST = 10_000  # segments and joints


class Quantity(NamedTuple):
    """A kind of numbers in a frame: whose, what columns are called, and their unit."""

    owners: str
    ends: tuple[str, ...]
    unit: str


#: Element of a frame -> what it holds. Those of segments are learned unless columns are chosen.
_QUANTITIES = {
    "position": Quantity("segment", tuple(f"position.{axis}" for axis in "xyz"), "m"),
    "orientation": Quantity("segment", tuple(f"orientation.{axis}" for axis in "wxyz"), ""),
    "jointAngle": Quantity("joint", tuple(f"angle.{axis}" for axis in "xyz"), "deg"),
}


class _Content:
    """The content that is gathered while the XML is parsed."""

    def __init__(self) -> None:
        self.rate = ""
        self.names: dict[str, list[str]] = {"segment": [], "joint": []}
        self.stamps: list[str] = []
        self.texts: dict[str, list[str]] = {name: [] for name in _QUANTITIES}
        self._path: list[str] = []
        self._is_normal = False
        self._text: list[str] | None = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        self._path.append(name)
        if len(self._path) > _DEEPEST:
            raise DataError(f"expected MVNX of at most {_DEEPEST} elements within each other, got more")
        if name == "subject":
            self.rate = attributes.get("frameRate", "")
        elif name in self.names and self._path[-2:-1] == [f"{name}s"]:
            self.names[name].append(attributes.get("label", f"{name} {len(self.names[name]) + 1}"))
            if len(self.names[name]) > _MOST:
                raise DataError(f"expected at most {_MOST:,} {name}s in MVNX, got more")
        elif name == "frame":
            self._is_normal = attributes.get("type", "normal") == "normal"
            if self._is_normal:
                self.stamps.append(attributes.get("time", ""))
        elif self._is_normal and name in _QUANTITIES and self._path[-2:-1] == ["frame"]:
            self._text = []

    def end(self, tag: str) -> None:
        name = self._path.pop()
        if self._text is not None and name in _QUANTITIES:
            texts = self.texts[name]
            texts += [""] * (len(self.stamps) - 1 - len(texts))  # frames before that lack it
            texts.append("".join(self._text))
            self._text = None
        elif name == "frame":
            self._is_normal = False

    def characters(self, text: str) -> None:
        if self._text is not None:
            self._text.append(text)


def read_mvnx_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """The columns of an MVNX file: ``Pelvis.position.x``, ``Pelvis.orientation.w``, ``jRightElbow.angle.x``, ...

    Unless columns are chosen, angles of joints are learned only where there are no segments. What a frame lacks is NaN.
    """
    check_expanded(3 * len(data))
    content = _parsed(data)
    count = len(content.stamps)
    if not count:
        raise DataError("expected frames of type 'normal' in an MVNX file, got none")
    heads, units, columns, faults = [STAMP], ["s"], [_times(content)], dict[int, str]()
    for name, quantity in _QUANTITIES.items():
        owners = content.names[quantity.owners]
        if not any(content.texts[name]) or not owners:
            continue
        width = len(owners) * len(quantity.ends)
        check_expanded(16 * count * width)
        heads += [f"{owner}.{end}" for owner in owners for end in quantity.ends]
        units += [quantity.unit] * width
        columns += [*_numbers(content.texts[name], count, (name, width), faults).T]
    if len(heads) == 1:
        raise DataError(f"expected {', '.join(_QUANTITIES)} in the frames of an MVNX file, got none of them")
    roles = choose_roles(heads, ("number",) * len(heads), layout)
    segments = tuple(k for k in roles.positions if ".angle." not in heads[k])
    if layout.coordinates is None and segments:
        others = tuple(k for k in roles.positions if k not in {*segments})
        roles = roles._replace(positions=segments, ignored=(*roles.ignored, *others))
    return Table(tuple(heads), columns, count, no_lines, faults, measured_in=units, maker="Xsens"), roles


def _parsed(data: bytes) -> _Content:
    content, parser = _Content(), expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = content.start, content.end
    parser.CharacterDataHandler = content.characters
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = _refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise DataError(f"expected an MVNX file, got something foreign, truncated or damaged ({error})") from error
    return content


def _refuse(*_: Any) -> None:
    raise DataError("expected MVNX without a document type, got one, which may hold entities that grow without bound")


def _times(content: _Content) -> Any:
    """Seconds, from the stamps of the frames [ms], or from the rate where these are missing or do not increase."""
    try:
        times = np.array([float(stamp) for stamp in content.stamps]) / 1e3
    except ValueError:
        times = np.zeros(len(content.stamps))
    rate = positive(content.rate)
    even = np.arange(len(times)) / (rate or 1.0)
    if rate is not None and np.abs(times - times[0] - even).max() <= 1e-3:  # stamps are whole milliseconds
        return even + times[0]
    if (np.diff(times) > 0).all():
        return times
    if rate is None:
        raise DataError(f"expected a frameRate in hertz or times of frames in an MVNX file, got {content.rate!r}")
    return even


def _numbers(texts: list[str], count: int, what: tuple[str, int], faults: dict[int, str]) -> Any:
    """The numbers (count, width) of all frames, NaN where a frame has none; other counts are faults of their frames."""
    name, width = what
    values = np.full((count, width), np.nan)
    for row, text in enumerate(texts):
        words = text.split()
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            faults[row] = f"expected numbers in {name!r}, got {text.strip()[:40]!r}"
            continue
        if len(numbers) == width:
            values[row] = numbers
        elif numbers:
            faults[row] = f"expected {width} numbers in {name!r}, got {len(numbers)}"
    return values

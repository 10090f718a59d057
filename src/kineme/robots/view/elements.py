"""Elements of a URDF: their numbers, origins and colors."""

from __future__ import annotations

import math
from xml.etree import ElementTree

Element = ElementTree.Element


def origin_of(given: Element) -> Element:
    """A copy of the origin of an element; at 0 what it does not say."""
    origin = given.find("origin")
    values = {name: [] if origin is None else numbers(origin.get(name), 3) for name in ("xyz", "rpy")}
    return ElementTree.Element("origin", {name: as_text(value or [0.0, 0.0, 0.0]) for name, value in values.items()})


def set_color(shape: Element, rgba: tuple[float, ...]) -> None:
    """Give a shape a color, unless it has one."""
    if shape.find("material") is None:
        material = ElementTree.SubElement(shape, "material", name="")
        ElementTree.SubElement(material, "color", rgba=as_text(list(rgba)))


def numbers(text: str | None, length: int) -> list[float]:
    """The finite numbers of an attribute; none of them where there are not as many as expected."""
    try:
        values = [float(word) for word in (text or "").split()]
    except ValueError:
        return []
    return values if len(values) == length and all(map(math.isfinite, values)) else []


def as_text(values: list[float]) -> str:
    """Numbers as an attribute."""
    return " ".join(f"{value:.9g}" for value in values)

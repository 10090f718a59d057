"""Elements of a URDF: their numbers, origins and colors."""

from __future__ import annotations

from xml.etree import ElementTree

from kineme.robots.models.numbers import finite_numbers

Element = ElementTree.Element


def origin_of(given: Element) -> Element:
    """A copy of the origin of an element; at 0 what it does not say."""
    origin = given.find("origin")
    values = {name: [] if origin is None else finite_numbers(origin.get(name), 3) for name in ("xyz", "rpy")}
    return ElementTree.Element("origin", {name: as_text(value or [0.0, 0.0, 0.0]) for name, value in values.items()})


def set_color(shape: Element, rgba: tuple[float, ...]) -> None:
    """Give a shape a color, unless it has one."""
    if shape.find("material") is None:
        material = ElementTree.SubElement(shape, "material", name="")
        ElementTree.SubElement(material, "color", rgba=as_text(list(rgba)))


def as_text(values: list[float]) -> str:
    """Numbers as an attribute."""
    return " ".join(f"{value:.9g}" for value in values)

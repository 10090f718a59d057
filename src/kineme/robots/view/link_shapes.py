"""The shapes of links, and the meshes that they need, as far as a page can hold and draw them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from kineme.robots.models.meshes import find_mesh
from kineme.robots.models.numbers import finite_numbers
from kineme.robots.view.elements import Element, as_text, origin_of, set_color

_LARGEST = 16_000_000  # bytes of all meshes of one page
_MESHES = {".stl": "stl", ".dae": "collada"}
_SHAPES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}


class Mesh(NamedTuple):
    """A mesh as the page holds it."""

    kind: str  # "stl" or "collada"
    content: bytes


class LinkShapes:
    """The shapes of one link after the other, and the meshes that they need."""

    def __init__(self, root: Element, path: Path) -> None:
        self.colors = {
            material.get("name"): color
            for material in root.findall("material")
            if (color := material.find("color")) is not None
        }
        self.path = path
        self.meshes: list[Mesh] = []
        self.without: list[str] = []  # links with shapes, none of which can be drawn
        self._numbers: dict[Path, int] = {}
        self._bytes = 0

    def of(self, link: Element) -> list[Element]:
        """The visual shapes of a link, or else its collision shapes; none where they cannot be drawn."""
        for tag in ("visual", "collision"):
            found = [shape for one in link.findall(tag) if (shape := self._shape(one)) is not None]
            if found:
                return found
        if link.find("visual") is not None or link.find("collision") is not None:
            self.without.append(str(link.get("name")))
        return []

    def _shape(self, given: Element) -> Element | None:
        geometry = given.find("geometry")
        shape = None if geometry is None or len(geometry) == 0 else self._geometry(geometry[0])
        if shape is None:
            return None
        made = ElementTree.Element("visual")
        made.append(origin_of(given))
        ElementTree.SubElement(made, "geometry").append(shape)
        color = given.find("material/color")
        if color is None and (material := given.find("material")) is not None:
            color = self.colors.get(material.get("name"))
        values = [] if color is None else finite_numbers(color.get("rgba"), 4)
        if values:
            set_color(made, tuple(min(max(value, 0.0), 1.0) for value in values))
        return made

    def _geometry(self, given: Element) -> Element | None:
        if given.tag == "mesh":
            number = self._mesh(given.get("filename", ""))
            if number is None:
                return None
            scale = finite_numbers(given.get("scale"), 3) or [1.0, 1.0, 1.0]
            return ElementTree.Element("mesh", filename=str(number), scale=as_text(scale))
        if given.tag not in _SHAPES:
            return None
        names, length = _SHAPES[given.tag]
        sizes = {name: finite_numbers(given.get(name), length) for name in names.split()}
        if not all(values and min(values) > 0 for values in sizes.values()):
            return None
        return ElementTree.Element(given.tag, {name: as_text(values) for name, values in sizes.items()})

    def _mesh(self, name: str) -> int | None:
        path = find_mesh(name, self.path)
        if path is None or path.suffix.lower() not in _MESHES:
            return None
        if path not in self._numbers:
            self._bytes += path.stat().st_size
            if self._bytes > _LARGEST:
                return None
            self._numbers[path] = len(self.meshes)
            self.meshes.append(Mesh(_MESHES[path.suffix.lower()], path.read_bytes()))
        return self._numbers[path]

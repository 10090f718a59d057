"""Shapes of links that lie in files of their own."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

_PREFIXES = ("package://", "model://", "file://")


def resolve_meshes(robot: ElementTree.Element, path: Path) -> list[str]:
    """Write the path of each collision mesh into the tree, and remove those that are not there; links without shape.

    ``package://NAME/...`` is looked for in every folder above the URDF, as ROS packages lie beside one another.
    """
    missing = []
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)  # nothing here looks at it, and its meshes need not be there
        for collision in link.findall("collision"):
            mesh = collision.find("geometry/mesh")
            if mesh is None:
                continue
            found = find_mesh(mesh.get("filename", ""), path)
            if found is None:
                link.remove(collision)
                missing.append(str(link.get("name")))
            else:
                mesh.set("filename", str(found))
    return missing


def find_mesh(name: str, path: Path) -> Path | None:
    """Where the mesh lies that the URDF at `path` calls `name`; None where it is not there."""
    within = next((name.removeprefix(prefix) for prefix in _PREFIXES if name.startswith(prefix)), name)
    folders = path.resolve().parents
    try:
        return next((folder / within for folder in folders if within and (folder / within).is_file()), None)
    except (OSError, ValueError):  # as a name that is too long
        return None

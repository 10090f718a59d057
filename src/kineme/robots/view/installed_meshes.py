"""What named arms look like: visual shapes of the package example-robot-data, where it is installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from kineme.errors import DataError
from kineme.robots.models.meshes import find_mesh
from kineme.robots.models.robot import Robot
from kineme.robots.models.table import FOLDER, MODELS
from kineme.robots.models.urdf import read_root
from kineme.robots.view.elements import Element

_PACKAGE = "example-robot-data"
_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"  # within what its wheel installs


def root_with_shapes(robot: Robot) -> Element:
    """The URDF of an arm; of an arm by name, with the shapes of its links in the package instead of ours.

    Its frames of links are those of the models here.
    """
    root = read_root(robot.source)
    model = MODELS.get(robot.name) if robot.source.parent == FOLDER else None
    folder = robots_folder() if model is not None and model.meshes else None
    if model is None or folder is None:
        return root
    path = folder / model.meshes
    try:
        shown = read_root(path)
    except DataError:  # of another release, without this arm
        return root
    links = {link.get("name"): link for link in shown.findall("link")}
    for mesh in shown.iterfind("link/visual/geometry/mesh"):
        found = find_mesh(mesh.get("filename", ""), path)
        mesh.set("filename", "" if found is None else str(found))
    for link in root.findall("link"):
        like = links.get(link.get("name"))
        if like is not None and like.find("visual") is not None:
            for visual in link.findall("visual"):
                link.remove(visual)
            link.extend(like.findall("visual"))
    root.extend(shown.findall("material"))
    return root


def robots_folder() -> Path | None:
    """Where the package has its robots; None where it is not installed."""
    try:
        folder = Path(str(distribution(_PACKAGE).locate_file(_ROBOTS)))
    except PackageNotFoundError:
        return None
    return folder if folder.is_dir() else None

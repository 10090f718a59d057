"""Arms by name look as the package example-robot-data shows them, where it is installed."""

from __future__ import annotations

import pytest
from view_samples import write_stl

from kineme.robots import load
from kineme.robots.view import write_view as module
from kineme.robots.view.write_view import shapes_of

_VISUAL = (
    '<visual><geometry><mesh filename="package://panda_description/meshes/{}.stl"/></geometry>'
    '<material name="snow"/></visual>'
)


@pytest.fixture
def robots(tmp_path, monkeypatch):
    """A folder of robots as the package has it, with a mesh for two of the links of the Panda."""
    home = tmp_path / "panda_description"
    (home / "urdf").mkdir(parents=True)
    write_stl(home / "meshes" / "base.stl")
    links = [("panda_link0", "base"), ("panda_link1", "lost"), ("panda_link2", "base"), ("panda_leftfinger", "base")]
    drawn = "".join(f'<link name="{name}">{_VISUAL.format(mesh)}</link>' for name, mesh in links)
    color = '<material name="snow"><color rgba="1 0.5 0.25 1"/></material>'
    (home / "urdf" / "panda.urdf").write_text(f'<robot name="panda">{color}{drawn}</robot>')
    monkeypatch.setattr(module, "robots_folder", lambda: tmp_path)
    return tmp_path


def test_links_of_a_named_arm_are_drawn_with_the_meshes_that_are_installed(robots):
    shapes = shapes_of(load("panda"))
    assert len(shapes.meshes) == 1  # held once, drawn twice
    assert shapes.urdf.count("<mesh") == 2
    assert shapes.urdf.count("1 0.5 0.25 1") == 2
    assert "<cylinder" in shapes.urdf  # links of which the package has none are as without it


def test_an_arm_of_a_file_is_drawn_as_its_file_says(robots, tmp_path):
    path = tmp_path / "panda.urdf"
    path.write_bytes(load("panda").source.read_bytes())
    assert not shapes_of(load(path, tip="panda_hand_tcp")).meshes


def test_an_arm_that_the_package_does_not_have_is_drawn_as_without_it(robots):
    assert not shapes_of(load("so101")).meshes
    assert not shapes_of(load("wam")).meshes

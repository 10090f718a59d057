"""Arms and movements for the tests of the page in which an arm moves."""

from __future__ import annotations

import struct

import numpy as np

from kineme.movements.trajectories.trajectory import Trajectory
from kineme.robots import load, move

#: Names that must not become markup, scripts, selectors or properties of objects.
HOSTILE = ("__proto__", "</script><script>alert(1)</script>", '"]<img src=x onerror=alert(2)>', "{{data}}<!--")

_MESH = '<visual><origin xyz="0 0 0.1"/><geometry><mesh filename="package://shapes/{}" scale="{}"/></geometry></visual>'
_CYLINDER = '  <visual><geometry><cylinder radius="0.04" length="0.2"/></geometry></visual>\n'


def arm(folder, visuals=(_CYLINDER,) * 4, names=("base", "upper", "lower", "tip")):
    """A URDF of three joints with those visual shapes, of which the third slides."""
    from xml.sax.saxutils import quoteattr

    links = [f"<link name={quoteattr(name)}>\n{visual}</link>" for name, visual in zip(names, visuals, strict=True)]
    axes, kinds = ("0 0 1", "0 1 0", "1 0 0"), ("revolute", "revolute", "prismatic")
    joints = [
        f'<joint name={quoteattr("to " + child)} type="{kind}"><origin xyz="0 0 0.3"/>'
        f"<parent link={quoteattr(parent)}/>"
        f'<child link={quoteattr(child)}/><axis xyz="{axis}"/>'
        '<limit lower="-2" upper="2" velocity="2" acceleration="20" effort="0"/></joint>'
        for parent, child, axis, kind in zip(names[:-1], names[1:], axes, kinds, strict=True)
    ]
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(links + joints)}</robot>', encoding="utf-8")
    return path


def mesh_visual(name):
    return _MESH.format(name, "0.001 0.001 0.001")


def write_stl(path):
    """One triangle of 100 mm."""
    corners = np.array([[0, 0, 1], [0, 0, 0], [100, 0, 0], [0, 100, 0]], dtype="<f4")
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", 1) + corners.tobytes() + b"\0\0")


def moved(path, force=False, **options):
    """Its three joints, there and on within 2 s."""
    u = np.linspace(0, 1, 80)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    positions = np.column_stack((0.8 * s, 0.5 + 0.4 * s, 0.2 * np.sin(2 * np.pi * s) * s))
    return move(Trajectory(times=2 * u, positions=positions), load(path, **options), space="joints", force=force)

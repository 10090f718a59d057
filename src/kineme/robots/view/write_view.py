"""A movement of an arm as one HTML page."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from kineme.reporting.atomic import write_atomically
from kineme.reporting.figures import BLUE, GRAY, GREEN, ORANGE
from kineme.reporting.text import counted, in_markup, printable
from kineme.robots.execution.preflight import preflight_table
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.planning.robot_movement import RobotMovement, duration_in_words
from kineme.robots.view.shapes import Shapes, shapes_of
from kineme.sampling import evenly_spaced
from kineme.validation import Array

MOST_SAMPLES = 3000  # of a page; between two of them the page interpolates

WIDTH, HEIGHT = 320.0, 84.0  # of a drawing, in its own units
_EDGE = 4.0  # above the upper limit and below the lower one
_POINTS = 400

_FOLDER = Path(__file__).parent
_SCENE = "vendor/scene.min.js"
_LICENSES = ("vendor/LICENSE-three.txt", "vendor/LICENSE-urdf-loader.txt")


def write_view(path: str | Path, movement: RobotMovement) -> Path:
    """Write a page in which the arm moves: one HTML file that opens in a browser without server and network.

    The page shows the arm with the visual shapes of its URDF, the path that was wanted and the one that is executed,
    each joint over time between its limits, and the preflight table. A slider scrubs, the space bar plays. Nothing is
    requested from anywhere: the content security policy of the page allows its own scripts by their hashes, and nothing
    else. Drawn with three.js and urdf-loader, which are in the page with their licenses.

    Parameters
    ----------
    path : str or Path
        Replaced if it is there.
    movement : RobotMovement
        From `move`.

    Returns
    -------
    Path

    Raises
    ------
    DataError
        The URDF file of the arm is no longer there.
    OSError
        The folder is missing, read-only or full.
    """
    return write_atomically(Path(path), view_page(movement).encode())


def view_page(movement: RobotMovement) -> str:
    """The text of the page."""
    shapes = shapes_of(movement.robot)
    scripts = {"scene": _asset(_SCENE), "viewer": _asset("page/viewer.js")}
    style = _asset("page/viewer.css")
    n_failed = len(movement.preflight.failed)
    checks = f"{counted(n_failed, 'check')} FAILED." if n_failed else "All checks passed."
    parts = {
        **scripts,
        "style": style,
        "policy": (
            f"default-src 'none'; script-src {' '.join(map(_hash, scripts.values()))}; style-src {_hash(style)}; "
            "img-src data:; base-uri 'none'; form-action 'none'"
        ),
        "title": in_markup(f"{movement.robot.name} moves"),
        "summary": in_markup(f"{duration_in_words(movement)}. {checks}"),
        "notes": _notes(movement, shapes.stand_ins),
        "charts": charts(movement),
        "preflight": _preflight(movement),
        "data": as_script_data(scene_data(movement, shapes)),
        "licenses": "\n\n".join(in_markup(_asset(name)) for name in _LICENSES),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], _asset("page/page.html"))


def _asset(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def _notes(movement: RobotMovement, stand_ins: tuple[str, ...]) -> str:
    notes = list(movement.robot.assumed)
    if stand_ins:
        why = "their meshes are not there, no STL or COLLADA files, or too large to be in this page"
        notes.append(f"drawn as cylinders up to the next joint: {', '.join(map(printable, stand_ins))}; {why}")
    if len(movement.trajectory) > MOST_SAMPLES:
        notes.append(f"{MOST_SAMPLES:,} of {len(movement.trajectory):,} samples are in this page")
    return "".join(f"<li>{in_markup(note)}</li>" for note in notes)


def _preflight(movement: RobotMovement) -> str:
    """Write the table of checks; rows of those that failed stand first and carry a class."""
    table = preflight_table(movement.preflight)
    rows = sorted(zip(movement.preflight.checks, table.rows, strict=True), key=lambda pair: pair[0].passed)
    heads = "".join(f'<th scope="col">{in_markup(head or "result")}</th>' for head in table.columns)
    lines = "".join(_row(cells, check.passed) for check, cells in rows)
    return f"<table><thead><tr>{heads}</tr></thead><tbody>\n{lines}</tbody></table><p>{in_markup(table.reading)}</p>"


def _row(cells: tuple[str, ...], passed: bool) -> str:
    opened = "<tr>" if passed else '<tr class="failed">'
    values = "".join(f"<td>{in_markup(cell)}</td>" for cell in cells[1:])
    return f'{opened}<th scope="row">{in_markup(cells[0])}</th>{values}</tr>\n'


def charts(movement: RobotMovement) -> str:
    """A figure for each joint, from its lower limit to its upper one, and for each discrete channel."""
    trajectory, robot = movement.trajectory, movement.robot
    columns = zip(trajectory.joints, trajectory.positions.T, robot.lower, robot.upper, robot.units, strict=True)
    figures = [_chart(movement, name, values, (low, high), unit) for name, values, low, high, unit in columns]
    return "\n".join(figures + [_chart(movement, name, values, None, "") for name, values in trajectory.steps.items()])


def _chart(movement: RobotMovement, name: str, values: Array, limits: tuple[float, float] | None, unit: str) -> str:
    times = movement.trajectory.times
    shown = evenly_spaced(len(times), _POINTS)
    low, high = (float(values.min()), float(values.max()))
    if limits is not None:
        low, high = min(low, limits[0]), max(high, limits[1])
    scale = (HEIGHT - 2 * _EDGE) / max(high - low, 1e-9)
    across = WIDTH / max(float(times[-1]), 1e-9)

    def y(value: Array) -> Array:
        return np.asarray(HEIGHT - _EDGE - scale * (value - low))

    x, drawn = times[shown] * across, y(values[shown])
    if limits is None:  # a value holds until the next one
        x, drawn = np.repeat(x, 2)[1:], np.repeat(drawn, 2)[:-1]
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, drawn, strict=True))
    levels = [float(y(np.asarray(limit))) for limit in limits or ()]
    lines = "".join(f'<line class="limit" x2="{WIDTH:g}" y1="{level:.1f}" y2="{level:.1f}"/>' for level in levels)
    range_text = "" if limits is None else f"limits {limits[0]:.3g} to {limits[1]:.3g} {unit}"
    extent = f"from {values.min():.3g} to {values.max():.3g} {unit}".strip()
    words = in_markup(f"{name} over time: {extent}{'; ' + range_text if range_text else ''}")
    return (
        f'<figure class="chart"><figcaption><span class="name">{in_markup(name)}</span> '
        f'<output data-unit="{unit}"></output></figcaption>'
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" preserveAspectRatio="none" role="img" aria-label="{words}">'
        f'<rect class="approach" width="{movement.begins * across:.1f}" height="{HEIGHT:g}"/>{lines}'
        f'<polyline class="joint" points="{line}"/><line class="cursor" y2="{HEIGHT:g}"/></svg>'
        f'<p class="limits">{range_text or "a discrete channel"}</p></figure>'
    )


def scene_data(movement: RobotMovement, shapes: Shapes) -> dict[str, Any]:
    """Times, joint positions [rad, m] and positions of the tip [m], rounded to a millionth."""
    trajectory = movement.trajectory
    sent = evenly_spaced(len(trajectory), MOST_SAMPLES)
    tip = kinematics(movement.robot, trajectory.positions)[0]
    wanted = np.empty((0, 3)) if movement.path is None else movement.path.positions
    return {
        "urdf": shapes.urdf,
        "meshes": [{"kind": mesh.kind, "content": b64encode(mesh.content).decode()} for mesh in shapes.meshes],
        "joints": shapes.joints,
        "tip": shapes.tip,
        "times": _rounded(trajectory.times[sent]),
        "positions": _rounded(trajectory.positions[sent]),
        "steps": [_rounded(values[sent]) for values in trajectory.steps.values()],
        "executed": _rounded(tip[sent]),
        "wanted": _rounded(wanted[evenly_spaced(len(wanted), MOST_SAMPLES)] if len(wanted) else wanted),
        "begins": round(movement.begins, 6),
        "start": _rounded(tip[movement.first]),
        "goal": _rounded(tip[-1]),
        "colors": {"executed": BLUE, "wanted": ORANGE, "approach": GRAY, "goal": GREEN},
    }


def _rounded(values: Array) -> Any:
    return np.round(values, 6).tolist()


def as_script_data(data: dict[str, Any]) -> str:
    """JSON that can stand in a script element: no ``<`` is left in it that could end the element."""
    return json.dumps(data, separators=(",", ":")).replace("<", r"\u003c")

"""A movement of an arm as one HTML page."""

from __future__ import annotations

import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

from kineme.output.atomic import write_atomically
from kineme.output.text import counted, in_markup, printable
from kineme.robots.checks.report import preflight_table
from kineme.robots.planning.robot_movement import RobotMovement, duration_in_words
from kineme.robots.view.charts import charts
from kineme.robots.view.scene_data import MOST_SAMPLES, as_script_data, scene_data
from kineme.robots.view.shapes import shapes_of

_FOLDER = Path(__file__).parent
_SCENE = "vendor/scene.min.js"
_LICENSES = ("vendor/LICENSE-three.txt", "vendor/LICENSE-urdf-loader.txt")


def write_view(path: str | Path, made: RobotMovement) -> Path:
    """Write a page in which the arm moves: one HTML file that opens in a browser without server and network.

    The page shows the arm with the visual shapes of its URDF, the path that was wanted and the one that is executed,
    each joint over time between its limits, and the preflight table. A slider scrubs, the space bar plays. Nothing is
    requested from anywhere: the content security policy of the page allows its own scripts by their hashes, and nothing
    else. Drawn with three.js and urdf-loader, which are in the page with their licenses.

    Parameters
    ----------
    path : str or Path
        Replaced if it is there.
    made : RobotMovement
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
    return write_atomically(Path(path), view_page(made).encode())


def view_page(made: RobotMovement) -> str:
    """The text of the page."""
    shapes = shapes_of(made.robot)
    scripts = {"scene": _asset(_SCENE), "viewer": _asset("page/viewer.js")}
    style = _asset("page/viewer.css")
    parts = {
        **scripts,
        "style": style,
        "policy": _policy(list(scripts.values()), style),
        "title": in_markup(f"{made.robot.name} moves"),
        "summary": in_markup(_summary(made)),
        "notes": _notes(made, shapes.stand_ins),
        "charts": charts(made),
        "preflight": _preflight(made),
        "data": as_script_data(scene_data(made, shapes)),
        "licenses": "\n\n".join(in_markup(_asset(name)) for name in _LICENSES),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _asset("page/page.html"))


def _asset(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _policy(scripts: list[str], style: str) -> str:
    allowed = " ".join(map(_hash, scripts))
    return (
        f"default-src 'none'; script-src {allowed}; style-src {_hash(style)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def _summary(made: RobotMovement) -> str:
    result = (
        "All checks passed." if made.preflight.passed else f"{counted(len(made.preflight.failed), 'check')} FAILED."
    )
    return f"{duration_in_words(made)}. {result}"


def _notes(made: RobotMovement, stand_ins: tuple[str, ...]) -> str:
    notes = list(made.robot.assumed)
    if stand_ins:
        why = "their meshes are not there, no STL or COLLADA files, or too large to be in this page"
        notes.append(f"drawn as cylinders up to the next joint: {', '.join(map(printable, stand_ins))}; {why}")
    if len(made.trajectory) > MOST_SAMPLES:
        notes.append(f"{MOST_SAMPLES:,} of {len(made.trajectory):,} samples are in this page")
    return "".join(f"<li>{in_markup(note)}</li>" for note in notes)


def _preflight(made: RobotMovement) -> str:
    """The table of checks; rows of those that failed stand first and carry a class."""
    table = preflight_table(made.preflight)
    rows = sorted(zip(made.preflight.checks, table.rows, strict=True), key=lambda pair: pair[0].passed)
    heads = "".join(f'<th scope="col">{in_markup(head or "result")}</th>' for head in table.columns)
    lines = "".join(_row(cells, check.passed) for check, cells in rows)
    return f"<table><thead><tr>{heads}</tr></thead><tbody>\n{lines}</tbody></table><p>{in_markup(table.reading)}</p>"


def _row(cells: tuple[str, ...], passed: bool) -> str:
    opened = "<tr>" if passed else '<tr class="failed">'
    values = "".join(f"<td>{in_markup(cell)}</td>" for cell in cells[1:])
    return f'{opened}<th scope="row">{in_markup(cells[0])}</th>{values}</tr>\n'

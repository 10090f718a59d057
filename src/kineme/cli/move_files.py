"""The files of ``kineme move``: refused before the work if they cannot be written, written after the checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import under
from kineme.cli.output import check_new, write_bytes
from kineme.cli.source import name_of_source
from kineme.output.text import printable

_NEW_FILE = click.Path(path_type=Path)

#: Option -> its short name if it has one, endings of its files, what it says about itself.
_FILES = {
    "output": (
        "-o",
        (".csv", ".npz", ".json", ".parquet"),
        "A .csv, .npz, .json or .parquet file; - for the screen, as CSV.",
    ),
    "ros1": (None, (".bag",), "A .bag of ROS 1 with JointTrajectory and JointState."),
    "ros2": (None, (".mcap", ""), "A .mcap, or a folder, of ROS 2 with the same."),
    "action_goal": (None, (".yaml", ".yml", ".json"), "A .yaml or .json file for ros2 action send_goal."),
    "plot": (None, (".png", ".svg", ".pdf"), "Path and joints beside their limits: a .png, .svg or .pdf file."),
    "view": (None, (".html", ".htm"), "An .html page in which the arm moves; opens in a browser, needs no network."),
}


def _file_option(name: str) -> Any:
    short, _, words = _FILES[name]
    names = [f"--{name.replace('_', '-')}", *([short] if short else [])]
    return click.option(*names, type=_NEW_FILE, help=words)


#: Add an option for each file that is written.
file_options = under("Output", *map(_file_option, _FILES))


def check_files(options: dict[str, Any]) -> None:
    """Refuse files that no writer writes, or that are there, before an arm is loaded.

    Raises
    ------
    click.UsageError
        The message names the option or the file.
    """
    for name, (_, endings, _) in _FILES.items():
        path = options[name]
        if path is None or (name == "output" and str(path) == "-"):
            continue
        if path.suffix.lower() not in endings:
            known = ", ".join(ending or "a folder" for ending in endings)
            raise click.BadParameter(
                f"expected {known}, got {path.suffix or 'no ending'}", param_hint=f"--{name.replace('_', '-')}"
            )
        if path.is_dir():
            raise click.UsageError(
                f"expected a new file or folder to write, {printable(path)} is a folder that is there"
            )
        if not path.absolute().parent.is_dir():
            raise click.UsageError(f"expected a folder to write {printable(path)} into, there is none; create it")
        check_new(path, options["overwrite"] or options["force"], options["source"], remedy="--overwrite")


def written_in_words(options: dict[str, Any]) -> str:
    """The files and folders that are asked for, in one line."""
    paths = [options[name] for name in (*_FILES, "lerobot") if options[name] is not None]
    named = ", ".join(str(path) for path in paths)
    return f"wrote {named}" if paths else "checked only, nothing written; name a file: -o joints.csv, --view arm.html"


def write_files(made: Any, options: dict[str, Any]) -> None:
    """Write what is asked for."""
    from kineme.robots.export.action_goal import write_action_goal
    from kineme.robots.export.bag import write_bag
    from kineme.robots.export.columns import encode_joints, write_joints

    trajectory = made.trajectory
    writers = {"output": write_joints, "ros1": write_bag, "ros2": write_bag, "action_goal": write_action_goal}
    for name, writer in writers.items():
        path = options[name]
        if path is None:
            continue
        if str(path) == "-":
            write_bytes(encode_joints(trajectory, ".json" if options["as_json"] else ".csv"))
        else:
            writer(path, trajectory)
    if options["plot"]:
        from kineme.output.figures import save_figure
        from kineme.robots.view.figure import draw_robot_movement

        save_figure(draw_robot_movement(made), options["plot"])
    if options["lerobot"]:
        from kineme.robots.export.lerobot import write_lerobot

        task = name_of_source(options)
        units = "percent" if options["joint_units"] == "percent" else "deg"
        write_lerobot(options["lerobot"], trajectory, task, options["fps"], made.robot, units)
    if options["view"]:
        from kineme.robots.view.write_view import write_view

        write_view(options["view"], made)

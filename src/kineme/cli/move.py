"""``kineme move``: a movement on the joints of an arm, checked before it is written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import (
    Finite,
    Numbers,
    SymbolName,
    force_option,
    json_option,
    library_option_of,
    specification_options,
    whole,
)
from kineme.cli.output import check_new, say, write, write_bytes
from kineme.cli.reading import layout_options
from kineme.cli.source import name_of_source, read_source

_OUTPUTS = ("output", "ros1", "ros2", "action_goal", "plot", "view")
_NEW_FILE = click.Path(path_type=Path)
_NEW_FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command(short_help="Move an arm: joints for a symbol or a recording, checked.")
@click.argument("source", type=SymbolName())
@library_option_of(required=False, words="Folder of the action library that SOURCE is a symbol of.")
@click.option("--robot", required=True, help="panda, ur5e, wam, so101, or a .urdf file.")
@click.option("--tip", help="Link that follows the movement.  [default: the end of the arm]")
@click.option("--at", type=Numbers(), help="Start in the frame of the robot.  [default: where the arm does it best]")
@click.option("--as-recorded", is_flag=True, help="Execute it where it was recorded: in the frame of the robot.")
@click.option("--goal", type=Numbers(), help="End in the frame of the robot.  [default: as demonstrated]")
@click.option("--duration", type=Finite(), help="Duration in seconds.  [default: as demonstrated]")
@click.option("--scale", type=Finite(), help="Meters for one unit of the recording.  [default: as its heads say]")
@click.option("--joints", is_flag=True, help="SOURCE moves the joints, not the tip.  [default: by its columns]")
@click.option("--plane", type=click.Choice(["xy", "xz", "yz"]), default="xy", show_default=True,
              help="Where the axes of a movement in the plane lie.")  # fmt: skip
@click.option("--orientation", type=Numbers(), help="Of the tip: w,x,y,z.  [default: as demonstrated, else as at rest]")
@click.option("--follow", type=click.Choice(["full", "axis", "free"]), default="full", show_default=True,
              help="How much of the orientation: all, the direction of the z axis of the tip, nothing.")  # fmt: skip
@click.option("--from", "start", type=Numbers(), help="Where the joints stand now.  [default: the rest posture]")
@click.option("--slow-down", is_flag=True, help="Slow the movement down as far as limits demand.")
@click.option("--fastest", is_flag=True, help="Pass the path in the least time that the limits allow.")
@click.option("--max-velocity", type=Finite(), help="Of every joint, below what the model allows.")
@click.option("--max-acceleration", type=Finite(), help="The same for accelerations.")
@click.option("--rate", type=Finite(), default=100.0, show_default=True, help="Samples per second.")
@click.option("--index", type=whole(0), help="Number of the movement in a file with several, from 0.")
@specification_options
@layout_options
@click.option("--output", "-o", type=_NEW_FILE, help="A .csv, .npz, .json or .parquet file; - for the screen, as CSV.")
@click.option("--ros1", type=_NEW_FILE, help="A .bag of ROS 1 with JointTrajectory and JointState.")
@click.option("--ros2", type=_NEW_FILE, help="A .mcap, or a folder, of ROS 2 with the same.")
@click.option("--lerobot", type=_NEW_FOLDER, help="A data set of LeRobot: a new one, or one to append an episode to.")
@click.option("--fps", type=Finite(), default=30.0, show_default=True, help="Frames per second of that data set.")
@click.option("--action-goal", type=_NEW_FILE, help="A .yaml or .json file for ros2 action send_goal.")
@click.option("--plot", type=_NEW_FILE, help="Path and joints beside their limits: a .png, .svg or .pdf file.")
@click.option(
    "--view", type=_NEW_FILE, help="An .html page in which the arm moves; opens in a browser, needs no network."
)
@json_option
@force_option
def move(**options: Any) -> None:
    """Move an arm as SOURCE: a symbol of a library, a recording, or a saved primitive (.kineme).

    Every trajectory is checked before it is written: limits of joints, velocities, accelerations and torques, jumps,
    singular postures, self-collision, and how well the tip follows. What fails a check is not written, unless
    --force is given. The trajectory begins with an approach from where the joints stand.

    As in:

    \b
    kineme move wave --library actions/ --robot panda --at 0.45,0.1,0.3 --goal 0.5,-0.2,0.4 -o wave_joints.csv
    kineme move wave --library actions/ --robot my_robot.urdf --tip tool0 --slow-down --ros2 wave.mcap
    """  # noqa: D301 - a backspace tells click to keep the lines
    from kineme.output.table import to_text
    from kineme.robots.checks.report import preflight_table
    from kineme.robots.models.robot import load

    if options["slow_down"] and options["fastest"]:
        raise click.UsageError("expected one of --slow-down and --fastest")
    for name in _OUTPUTS:
        check_new(options[name], options["force"], options["source"])
    robot = load(options["robot"], options["tip"], None, options["max_velocity"], options["max_acceleration"])
    made = _moved(robot, options)
    to_screen = str(options["output"]) == "-"
    for sentence in robot.assumed:
        write(f"note: {sentence}", err=True)
    if not to_screen:
        say(
            options["as_json"],
            _as_data(made),
            lambda: "\n".join([to_text(preflight_table(made.preflight)), _summary(made)]),
        )
    _write(made, options)


def _moved(robot: Any, options: dict[str, Any]) -> Any:
    from kineme.robots.planning.move import move as move_robot
    from kineme.robots.planning.refusal import InfeasibleError

    generated, space = _generated(robot, options)
    timing = "fastest" if options["fastest"] else "slowed" if options["slow_down"] else "generated"
    try:
        return move_robot(
            generated.movement,
            robot,
            space=space,
            orientation=options["orientation"],
            follow=options["follow"],
            plane=options["plane"],
            place="as given" if options["at"] or options["as_recorded"] or space == "joints" else "free",
            timing=timing,
            rate=options["rate"],
            start=options["start"],
            steps=generated.steps,
            force=options["force"],
        )
    except InfeasibleError as error:
        from kineme.output.table import to_text
        from kineme.robots.checks.report import preflight_table

        if error.preflight is not None:
            write(to_text(preflight_table(error.preflight)), err=True)
        raise


def _generated(robot: Any, options: dict[str, Any]) -> tuple[Any, str]:
    """The movement, of the tip [m] or of the joints, and which of the two."""
    from kineme.robots.planning.placed import placed
    from kineme.robots.planning.roles import space_of

    learned = read_source(options)
    space = "joints" if options["joints"] else space_of(learned.primitive.channels, learned.example, robot)
    if options["goal"] and not (options["at"] or options["as_recorded"] or space == "joints"):
        raise click.UsageError("expected --at with --goal: where the movement starts; or --as-recorded")
    generated = placed(
        learned,
        options["at"],
        options["goal"],
        options["duration"],
        scale=options["scale"],
        rate=options["rate"],
        joints=space == "joints",
        plane=options["plane"],
    )
    return generated, space


def _summary(made: Any) -> str:
    trajectory = made.trajectory
    slower = f", {made.factor:.3g} times as long as generated" if abs(made.factor - 1) > 1e-3 else ""
    return (
        f"{made.robot.name}: {trajectory.duration:.2f} s, of which {made.begins:.2f} s of approach{slower}; "
        f"{len(trajectory)} samples of {len(trajectory.joints)} joints"
    )


def _as_data(made: Any) -> dict[str, Any]:
    import math

    def known(value: Any) -> Any:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    checks = [{name: known(value) for name, value in one._asdict().items()} for one in made.preflight.checks]
    return {
        "robot": made.robot.name,
        "duration": made.trajectory.duration,
        "approach": made.begins,
        "factor": made.factor,
        "passed": made.preflight.passed,
        "checks": checks,
        "not_checked": list(made.preflight.unchecked),
    }


def _write(made: Any, options: dict[str, Any]) -> None:
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
        from kineme.robots.figure import draw_robot_movement

        save_figure(draw_robot_movement(made), options["plot"])
    if options["lerobot"]:
        from kineme.robots.export.lerobot import write_lerobot

        task = name_of_source(options)
        write_lerobot(options["lerobot"], trajectory, task, options["fps"], made.robot.name)
    if options["view"]:
        from kineme.robots.view.write_view import write_view

        write_view(options["view"], made)

"""``kineme move``: a movement on the joints of an arm, checked before it is written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, say, write, write_bytes
from kineme.cli.reading import layout_options, name_of_source, read_source
from kineme.reporting.text import printable

#: Option -> its short name if it has one, endings of its files, what it says about itself.
_FILES = {
    "output": (
        "-o",
        (".csv", ".npz", ".json", ".parquet"),
        "A .csv, .npz, .json or .parquet file; - for the screen, as CSV.",
    ),
    "ros1": (None, (".bag",), "A .bag of ROS 1 with JointTrajectory and JointState."),
    "ros2": (None, (".mcap", ""), "A .mcap, or a new folder, of ROS 2 with the same."),
    "action_goal": (None, (".yaml", ".yml", ".json"), "A .yaml or .json file for ros2 action send_goal."),
    "plot": (None, (".png", ".svg", ".pdf"), "Path and joints beside their limits: a .png, .svg or .pdf file."),
    "rerun": (None, (".rrd",), opts.RERUN),
    "view": (None, (".html", ".htm"), "An .html page in which the arm moves; opens in a browser, needs no network."),
}

#: Add an option for each file that is written.
file_options = opts.under(
    "Output",
    *(
        click.option(opts.flag_of(name), *([short] if short else []), type=click.Path(path_type=Path), help=words)
        for name, (short, _, words) in _FILES.items()
    ),
)


def check_files(options: dict[str, Any]) -> None:
    """Refuse files that no writer writes, or that are there, before an arm is loaded."""
    force, source = options["overwrite"] or options["force"], options["source"]
    for name, (_, endings, _) in _FILES.items():
        check_new(options[name], force, source, remedy="--overwrite", endings=endings, flag=opts.flag_of(name))


def write_files(movement: Any, options: dict[str, Any]) -> None:
    """Write what is asked for."""
    from kineme.robots import export_files

    trajectory = movement.trajectory
    writers = {
        "output": export_files.write_joints,
        "ros1": export_files.write_bag,
        "ros2": export_files.write_bag,
        "action_goal": export_files.write_action_goal,
    }
    for name, writer in writers.items():
        if name == "output" and str(options[name]) == "-":
            write_bytes(export_files.encode_joints(trajectory, ".json" if options["as_json"] else ".csv"))
        elif options[name] is not None:
            writer(options[name], trajectory)
    if options["plot"]:
        from kineme.reporting.figures import save_figure
        from kineme.robots.view.figure import draw_robot_movement

        save_figure(draw_robot_movement(movement), options["plot"])
    if options["rerun"]:
        from kineme.io.writing.rerun import write_rerun
        from kineme.robots.view.figure import robot_scene

        scene = robot_scene(movement, name_of_source(options))
        write_rerun(options["rerun"], [scene], replace=options["overwrite"] or options["force"])
    if options["lerobot"]:
        task, units = name_of_source(options), "percent" if options["joint_units"] == "percent" else "deg"
        export_files.write_lerobot(options["lerobot"], trajectory, task, options["fps"], movement.robot, units)
    if options["view"]:
        from kineme.robots.view.write_view import write_view

        write_view(options["view"], movement)


@click.command(cls=opts.GroupedCommand, short_help="Move an arm: joints for a symbol or a recording, checked.")
@opts.source_options
@opts.heading("Arm")
@click.option("--robot", required=True, help="panda, ur5e, wam, so101, or a .urdf file.")
@click.option("--tip", help="Link that follows the movement.  [default: the end of the arm]")
@click.option(
    "--from", "start", type=opts.NUMBERS, help="Where the joints stand now [rad].  [default: the rest posture]"
)
@click.option("--rest", type=opts.NUMBERS,
              help="Joints at rest [rad].  [default: of the model, of a file near mid-range]")  # fmt: skip
@click.option("--at", type=opts.NUMBERS,
              help="Start of the tip in the frame of the robot [m], or of joints, in the units and the order of their "
              "columns.  [default: where the arm does it best, joints as demonstrated]")  # fmt: skip
@click.option("--as-recorded", is_flag=True, help="Execute it where it was recorded: in the frame of the robot.")
@click.option("--scale", type=opts.Finite(), help="Meters for one unit of the recording.  [default: as its heads say]")
@click.option("--plane", type=click.Choice(["xy", "xz", "yz"]),
              help="Where the axes of a movement in the plane lie.  [default: as columns say, else xy]")  # fmt: skip
@click.option(
    "--orientation", type=opts.NUMBERS, help="Of the tip: w,x,y,z.  [default: as demonstrated, else as at rest]"
)
@click.option("--follow", type=click.Choice(["full", "axis", "free"]), default="full", show_default=True,
              help="How much of the orientation: all, the direction of the z axis of the tip, nothing.")  # fmt: skip
@click.option("--joints", is_flag=True, help="SOURCE moves the joints, not the tip.  [default: by its columns]")
@click.option("--joint-units", type=click.Choice(["deg", "rad", "percent"]),
              help="Of joints whose columns say no unit, and of --lerobot. percent: -100 to 100 between the limits of "
              "the URDF, as LeRobot calibrates.  [default: rad; of shoulder_pan.pos and --lerobot deg]")  # fmt: skip
@click.option("--max-velocity", type=opts.Finite(), help="Of every joint, below what the model allows.")
@click.option("--max-acceleration", type=opts.Finite(), help="The same for accelerations.")
@opts.heading("Movement")
@click.option("--goal", type=opts.NUMBERS, help="End, as --at.  [default: as demonstrated]")
@click.option("--duration", type=opts.Finite(), help="Duration in seconds.  [default: as demonstrated]")
@click.option("--slow-down", is_flag=True, help="Slow the movement down as far as limits demand.")
@click.option("--fastest", is_flag=True, help="Pass the path in the least time that the limits allow.")
@click.option("--rate", type=opts.Finite(), default=100.0, show_default=True, help="Samples per second.")
@opts.specification_options
@layout_options
@opts.heading("Output")
@file_options
@click.option("--lerobot", type=opts.FOLDER, help="A data set of LeRobot: a new one, or one to append an episode to.")
@click.option("--fps", type=opts.Finite(), default=30.0, show_default=True, help="Frames per second of that data set.")
@opts.json_option
@click.option("--overwrite", is_flag=True, help="Write over files that are there; never over the input.")
@click.option("--force", is_flag=True, help="Write what fails a check too, and over files that are there.")
def move(**options: Any) -> None:
    """Move an arm as SOURCE: a symbol of a library, a recording, or a saved primitive (.kineme).

    Every trajectory is checked before it is written: limits of joints, velocities, accelerations and torques, jumps,
    singular postures, self-collision, and how well the tip follows. What fails a check is not written, unless
    --force is given. The trajectory begins with an approach from where the joints stand. Without a file to write,
    the checks are printed and nothing else is done.

    As in:

    \b
    kineme move wave --library actions/ --robot panda --at 0.3,0.1,0.3 --goal 0.6,-0.1,0.3 -o wave_joints.csv
    kineme move wave --library actions/ --robot my_robot.urdf --tip tool0 --slow-down --ros2 wave.mcap
    """  # noqa: D301 - a backspace tells click to keep the lines
    from kineme.errors import heard_warnings
    from kineme.reporting.table import to_text
    from kineme.robots.execution.preflight import checks_as_data, preflight_table
    from kineme.robots.export_files import not_in_goal
    from kineme.robots.models.robot import load
    from kineme.robots.planning.robot_movement import InfeasibleError, duration_in_words

    if options["slow_down"] and options["fastest"]:
        raise click.UsageError("expected one of --slow-down and --fastest")
    check_files(options)
    robot = load(
        options["robot"], options["tip"], options["rest"], options["max_velocity"], options["max_acceleration"]
    )
    for sentence in robot.assumed:
        write(f"note: {sentence}", err=True)
    with heard_warnings() as heard:
        try:
            movement = _moved(robot, options)
        except InfeasibleError as error:
            if error.preflight is not None:
                write(to_text(preflight_table(error.preflight)), err=True)
            raise
        finally:
            for sentence in heard:
                write(f"note: {sentence}", err=True)
    report, on_screen = movement.preflight, str(options["output"]) == "-"
    n_samples, n_joints = movement.trajectory.positions.shape
    summary = f"{robot.name}: {duration_in_words(movement)}; {n_samples} samples of {n_joints} joints"
    data = {
        "robot": robot.name,
        "duration": movement.trajectory.duration,
        "approach": movement.begins,
        "factor": movement.factor,
        "assumed": list(robot.assumed),
        "passed": report.passed,
        "checks": checks_as_data(report),
        "not_checked": list(report.unchecked),
    }
    if not on_screen:
        say(options["as_json"], data, lambda: f"{to_text(preflight_table(report))}\n{summary}")
    if not report.passed:
        write(f"warning: checks FAILED: {len(report.failed)}; written because of --force", err=True)
    if options["action_goal"] is not None and (note := not_in_goal(movement.trajectory)):
        write(f"note: {note}", err=True)
    write_files(movement, options)
    if not options["as_json"] and not on_screen:
        named = ", ".join(str(options[name]) for name in (*_FILES, "lerobot") if options[name] is not None)
        nothing = "checked only, nothing written; name a file: -o joints.csv, --view arm.html"
        write(f"wrote {named}" if named else nothing)


def _moved(robot: Any, options: dict[str, Any]) -> Any:
    from kineme.robots.planning.generate_at import generate_at
    from kineme.robots.planning.move import move as move_robot
    from kineme.robots.planning.roles import space_of

    learned = read_source(options)
    space = "joints" if options["joints"] else space_of(learned.primitive.channels, learned.example, robot)
    if options["goal"] and not (options["at"] or options["as_recorded"] or space == "joints"):
        raise click.UsageError(
            "expected --at with --goal: where the movement starts; or --as-recorded; or --joints, where the columns "
            "are joints of the arm"
        )
    chosen = {name: options[name] for name in ("goal", "duration", "scale", "rate", "joint_units", "plane")}
    generated = generate_at(learned, options["at"], joints=robot if space == "joints" else None, **chosen)
    for sentence in generated.said:
        write(f"note: --{printable(sentence)}", err=True)
    is_placed = options["at"] or options["as_recorded"] or space == "joints"
    return move_robot(
        generated.movement,
        robot,
        space=space,
        place="as given" if is_placed else "free",
        timing="fastest" if options["fastest"] else "slowed" if options["slow_down"] else "generated",
        steps=generated.steps,
        continuous=generated.continuous,
        plane=generated.plane,
        **{name: options[name] for name in ("orientation", "follow", "rate", "start", "force")},
    )

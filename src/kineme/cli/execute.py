"""``kineme execute``: a plan on an arm, step by step, in a simulation or as joints that are checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, say, to_json
from kineme.reporting.text import printable

_SIMULATED = ("disturb", "noise", "seed", "replans", "planner", "stop_at_each_step", "plot", "view")  # of what moves


@click.command(cls=opts.GroupedCommand, short_help="Execute a plan on an arm, in a simulation.")
@click.argument("plan", type=opts.FILE)
@opts.library_option
@opts.heading("Arm")
@click.option("--robot", required=True, help="panda, ur5e, so101, or a .urdf file.")
@click.option("--tip", help="Link that follows the movement.  [default: the end of the arm]")
@click.option("--follow", type=click.Choice(["full", "axis", "free"]), default="full", show_default=True,
              help="How much of the orientation: all, the direction of the z axis of the tip, nothing.")  # fmt: skip
@click.option("--origin", type=opts.NUMBERS, default="0,0,0", show_default=True,
              help="Where the recordings have their origin in the frame of the robot [m].")  # fmt: skip
@opts.heading("Simulation")
@click.option("--simulate", is_flag=True, help="Execute it in MuJoCo.  [default: only check the joints of each step]")
@click.option("--disturb", multiple=True, help="push:0,30,0@1.5 [N, s]; cup:0.4,0.1,0.2@3 [m, s]; cup:gone@3; may "
              "be repeated.")  # fmt: skip
@click.option("--noise", type=opts.Finite(0), default=0.0, help="Standard deviation of measured positions [m].")
@click.option("--seed", type=opts.whole(0), default=0, help="Of that noise.")
@click.option("--replans", type=opts.whole(0, 100), default=3, show_default=True, help="Plans more, at most.")
@click.option("--planner", help="An engine of unified-planning that is installed, as aries.")
@click.option("--stop-at-each-step", is_flag=True, help="Stand after each step, also where the next may go on.")
@opts.heading("Output")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="A .json file for the report; without --simulate "
              "a new folder, also with --force, for it and the joints of each step, in CSV.")  # fmt: skip
@click.option("--plot", type=opts.FILE, help="Where the tip and the objects went: a .png, .svg or .pdf file.")
@click.option("--view", type=opts.FILE, help="The arm as it moves: a .gif file.")
@opts.json_option
@opts.force_option
def execute(plan: Path, folder: Any, output: Path | None, **options: Any) -> None:
    """Execute PLAN, a file of kineme plan, on an arm: each step as its nearest demonstration, within what was shown.

    With --simulate: before and after each step the state is looked at. An arm that is pushed stops; what is no more as
    the plan has it is planned anew. Without it nothing moves: the joints of all steps are planned and checked.

    Example: kineme execute plan.json --library actions/ --robot panda --simulate --disturb push:0,30,0@1.5 -o run.json
    """
    from kineme.planning.execution import check_steps
    from kineme.planning.plan import read_plan
    from kineme.reporting.table import to_text
    from kineme.robots.models.robot import load

    _check_options(plan, output, options)
    steps = read_plan(plan)
    robot = load(options["robot"], options["tip"])
    with opts.opened(folder) as library:
        execution = (
            _simulated(steps, library, robot, options)
            if options["simulate"]
            else check_steps(steps, library, robot, options["follow"], options["origin"])
        )
    written = _write(execution, robot, output, options)
    data = execution.to_dict() | {"written": [str(path) for path in written]}
    lines = (f"wrote {printable(path)}" for path in written)
    say(options["as_json"], data, lambda: "\n".join([to_text(execution.table()), *lines]))
    if not execution.reached and (options["simulate"] or any(a.status == "refused" for a in execution.attempts)):
        click.get_current_context().exit(1)


def _check_options(plan: Path, output: Path | None, options: dict[str, Any]) -> None:
    """Refuse options that do not go together, before anything is computed."""
    if not options["simulate"] and (useless := opts.given_options(_SIMULATED)):
        raise click.UsageError(f"expected --simulate with {', '.join(useless)}: without it nothing moves")
    report = (".json",) if options["simulate"] else ("",)
    check_new(output, options["force"], plan, endings=report, flag="--output")
    check_new(options["plot"], options["force"], plan, endings=(".png", ".svg", ".pdf"), flag="--plot")
    check_new(options["view"], options["force"], plan, endings=(".gif",), flag="--view")


def _simulated(plan: Any, library: Any, robot: Any, options: dict[str, Any]) -> Any:
    from functools import partial

    from kineme.planning.execution import execute as execute_plan
    from kineme.planning.plan import find_plan
    from kineme.planning.simulated import assume_flags, disturb, simulation_of

    world = simulation_of(plan, robot, options["noise"], options["seed"], options["origin"], options["follow"])
    disturb(world, options["disturb"])
    return execute_plan(
        plan, library, world, robot, replan=partial(find_plan, planner=options["planner"]),
        most_replans=options["replans"], done=assume_flags(world, plan), follow=options["follow"],
        origin=options["origin"], join=not options["stop_at_each_step"],
    )  # fmt: skip


def _write(execution: Any, robot: Any, output: Path | None, options: dict[str, Any]) -> list[Path]:
    from kineme.reporting.atomic import write_atomically

    report, written = f"{to_json(execution.to_dict())}\n".encode(), []
    if output is not None and options["simulate"]:
        written.append(write_atomically(output, report))
    elif output is not None:
        from kineme.robots.export_files import write_joints

        output.mkdir()
        for number, movement in enumerate(execution.movements, 1):
            written.append(write_joints(output / f"step-{number:02d}.csv", movement.trajectory))
        written.append(write_atomically(output / "report.json", report))
    if options["plot"]:
        from kineme.planning.figure import draw_execution
        from kineme.reporting.figures import save_figure

        written.append(save_figure(draw_execution(execution, robot), options["plot"]))
    if options["view"]:
        from kineme.planning.figure import write_moving

        written.append(write_moving(options["view"], execution, robot))
    return written

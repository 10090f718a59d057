"""``kineme skills``: the skills of a library for a language model, by the Model Context Protocol."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FOLDER, NUMBERS, SymbolName, library_option, opened
from kineme.cli.output import write


@click.command(short_help="Skills for a language model, over MCP.")
@library_option
@click.option("--robot", required=True, help="panda, ur5e, wam, so101, or a .urdf file.")
@click.option("--tip", help="Link that follows the movement.  [default: the end of the arm]")
@click.option("--from", "joints", type=NUMBERS, help="Where the joints stand now.  [default: the rest posture]")
@click.option("--symbol", "symbols", type=SymbolName(), multiple=True,
              help="Offer this symbol only; may be repeated.  [default: all]")  # fmt: skip
@click.option("--allow-execute", is_flag=True, help="Offer tools that move, each time after a person has approved.")
@click.option("--simulate", is_flag=True, help="What was approved moves an arm in MuJoCo.")
@click.option("--output", "-o", type=FOLDER, help="What was approved is written here, a goal for ROS 2 each.")
def skills(  # noqa: PLR0913, PLR0917 - one parameter per option
    folder: Any, robot: str, tip: str | None, joints: list[float] | None, symbols: tuple[str, ...],
    allow_execute: bool, simulate: bool, output: Path | None,
) -> None:  # fmt: skip
    """Serve the symbols of a library as tools of the Model Context Protocol (MCP), on standard input and output.

    A language model lists the skills, explains one, and previews it: the ranges of start, goal and duration that were
    demonstrated are the bounds in the schema of each tool, and what lies outside is refused. Nothing moves, and no tool
    exists that could, without --allow-execute. With it, the client asks the person before each movement; refused, not
    answered, or not asked for lack of a way, nothing moves. The library is only read.

    As in:

    \b
    kineme skills --library actions/ --robot panda
    kineme skills --library actions/ --robot panda --allow-execute --simulate
    kineme skills --library actions/ --robot panda --allow-execute --output goals/
    """  # noqa: D301 - a backspace tells click to keep the lines
    from kineme.planning.skills import SkillTools, serve_over_stdio
    from kineme.robots.models.robot import load

    if allow_execute != (simulate or output is not None) or (simulate and output is not None):
        raise click.UsageError("expected --allow-execute with one of --simulate and --output, or none of the three")
    arm = load(robot, tip)
    for sentence in arm.assumed:
        write(f"note: {sentence}", err=True)
    execute: Callable[..., str] | None = None
    if output is not None:
        output.mkdir(exist_ok=True)
        execute = written_to(output)
    if simulate:
        execute = simulated_by(arm, joints)
    if sys.stdin.isatty():
        write("waiting for a client on standard input: clients start this command themselves", err=True)
    with opened(folder) as library:
        serve_over_stdio(SkillTools(library, arm, execute, joints, symbols))


def written_to(folder: Path) -> Callable[..., str]:
    """Return what writes each movement into a new file of a folder, numbered on from those that are there."""
    from kineme.reporting.atomic import whole_file
    from kineme.robots.export_files import not_in_goal, write_action_goal

    def execute(name: str, movement: Any) -> str:
        numbers = [int(match[0]) for path in folder.iterdir() if (match := re.match(r"[0-9]{4,9}", path.name))]
        path = folder / f"{max(numbers, default=0) + 1:04d}-{name}.yaml"
        with whole_file(path, replace=False) as beside:
            write_action_goal(beside, movement.trajectory)
        note = not_in_goal(movement.trajectory)
        return (
            f"Wrote {path.name}, an action goal of {movement.trajectory.duration:.2f} s for ROS 2. The next movement "
            f"begins where this one ends: send them in order.{note and f' Note: {note}.'}"
        )

    return execute


def simulated_by(arm: Any, joints: list[float] | None) -> Callable[..., str]:
    """Return what moves an arm in MuJoCo that stands with these joints at first."""
    from kineme.robots.simulation import Simulation

    simulation = Simulation(arm, start=joints)
    return lambda name, movement: f"Executed {name} in simulation: {simulation.run(movement)!r}."

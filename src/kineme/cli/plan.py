"""``kineme plan``: symbols in an order that reaches a goal, each within what was shown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.operators import opened_domain
from kineme.cli.output import check_new, say, table, to_json
from kineme.reporting.text import counted, printable


@click.command(cls=opts.GroupedCommand, short_help="Find the symbols that reach a goal.")
@click.argument("domain", type=opts.FILE)
@click.argument("problem", type=opts.FILE, required=False)
@opts.library_option_of(
    required=False, words="Folder of the action library: says which demonstration each step follows."
)
@click.option("--state", type=opts.FILE, help="The state now: a table whose columns are those of the states.")
@click.option("--goal", help="The goal, instead of PROBLEM: (and (sweet cup) (sweet mug)).")
@click.option("--planner", help="An engine of unified-planning that is installed, as aries.")
@click.option("--timeout", type=opts.Finite(0.1), default=30.0, show_default=True, help="Seconds to plan.")
@opts.heading("Output")
@click.option("--output", "-o", type=opts.FILE, help="A .json file, which kineme execute reads, or an .xml file, a "
              "behavior tree.")  # fmt: skip
@opts.plot_option
@opts.json_option
@opts.force_option
def plan(domain: Path, problem: Path | None, folder: Any, output: Path | None, **options: Any) -> None:
    """Find the symbols of DOMAIN, a .pddl file of kineme operators, that reach a goal, each within what was shown.

    The goal and the facts now come from PROBLEM, a file in PDDL, or from --goal and --state. Where things are is told
    by --state; without it they are taken to be where they were shown.

    Example: kineme plan tea.pddl --state now.csv --goal "(and (sweet cup))" --library actions/ -o plan.json
    """
    from kineme.errors import SpecificationError
    from kineme.planning.plan import find_plan, plan_to_dict
    from kineme.planning.problem import problem_from_pddl, problem_of
    from kineme.planning.states import read_state

    if (problem is None) == (options["goal"] is None):
        raise click.UsageError("expected a problem in PDDL, or --goal, one of both")
    if output is not None and output.suffix.lower() not in (".json", ".xml"):
        raise click.BadParameter(f"expected .json or .xml, got {output.name}")
    for path in (output, options["plot"]):
        check_new(path, options["force"], domain, *([problem] if problem else []))
    state = None if options["state"] is None else read_state(options["state"])
    known = opened_domain(domain)
    if problem is not None:
        task = problem_from_pddl(known, problem.read_text(encoding="utf-8"), state)
    elif state is None:
        raise SpecificationError("expected the state now with --goal: give --state now.csv")
    else:
        task = problem_of(known, state, options["goal"])
    steps = find_plan(task, options["planner"], options["timeout"])
    follows = None if folder is None else _follow(folder, steps, options["plot"])
    data = plan_to_dict(steps) | {"written": [], "follows": follows}
    if output is not None:
        data["written"] = [str(_written(steps, data, output))]
    if options["plot"] and folder is None:
        raise click.UsageError("expected --library with --plot: the paths are those of its demonstrations")
    say(options["as_json"], data, lambda: _text(steps, data))


def _written(steps: Any, data: dict[str, Any], output: Path) -> Path:
    from kineme.planning.behavior_tree import plan_to_behavior_tree
    from kineme.reporting.atomic import write_atomically

    if output.suffix.lower() == ".xml":
        return write_atomically(output, plan_to_behavior_tree(steps).encode())
    plain = {name: value for name, value in data.items() if name not in ("written", "follows")}
    return write_atomically(output, f"{to_json(plain)}\n".encode())


def _follow(folder: Any, steps: Any, plot: Path | None) -> list[int | None]:
    """Return the movement that each step follows; draw the paths."""
    from kineme.planning.figure import draw_plan
    from kineme.planning.skill import nearest_demonstration, skill_of
    from kineme.reporting.figures import save_figure

    with opts.opened(folder) as library:
        skills = {step.operator: skill_of(library, step.operator) for step in steps.steps}
        follows = [
            int(skills[step.operator].movements[nearest_demonstration(skills[step.operator], step.start, step.goal)])
            if step.start
            else None
            for step in steps.steps
        ]
        if plot is not None:
            save_figure(draw_plan(steps, library), plot)
    return follows


def _text(steps: Any, data: dict[str, Any]) -> str:
    heads = ["step", "symbol", "arguments", "goal of the hand", "seconds"]
    rows = [
        [str(number), printable(step.operator), printable(" ".join(step.arguments.values())),
         ", ".join(f"{value:.3g}" for value in step.goal), f"{step.duration:.2f}"]
        for number, step in enumerate(steps.steps, 1)
    ]  # fmt: skip
    if data["follows"]:
        heads.append("as movement")
        rows = [[*row, str(movement or "")] for row, movement in zip(rows, data["follows"], strict=True)]
    lines = [table(tuple(heads), rows)] if rows else ["the goal holds already"]
    lines.append(f"{counted(len(steps), 'step')}, {steps.duration:.1f} s; planned by {printable(steps.planner)}")
    return "\n".join([*lines, *(f"wrote {printable(path)}" for path in data["written"])])

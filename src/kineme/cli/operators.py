"""``kineme operators`` and ``kineme plan``: what symbols need and do, learned from states, and an order to a goal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, say, table, to_json, write
from kineme.reporting.text import counted, first_names, printable

_FORMATS = {".pddl": "pddl", ".json": "json", ".xml": "behavior-tree"}


@click.command(cls=opts.GroupedCommand, short_help="Learn what symbols need and do, for a planner.")
@opts.library_option
@click.option("--states", type=click.Path(path_type=Path), help="A table of states beside the recordings, or a folder "
              "of them.  [default: the hand and grippers of the recordings alone]")  # fmt: skip
@click.option("--radius", type=opts.Finite(0, min_open=True), help="Of a place, in the unit of the recordings.  "
              "[default: where the distances of the hand from objects part into near and far]")  # fmt: skip
@click.option("--error-rate", type=opts.Finite(0, 0.25), default=0.02, show_default=True,
              help="Share of facts that a sensor gets wrong.")  # fmt: skip
@opts.heading("Output")
@click.option("--output", "-o", type=opts.FILE, help="A .pddl file, with a .json file beside it that kineme plan "
              "reads; the .json file alone; or an .xml file, a behavior tree.  [default: show a table]")  # fmt: skip
@click.option("--format", "form", type=click.Choice([*_FORMATS.values()]), help="Where the ending does not say it.")
@opts.json_option
@opts.force_option
def operators(folder: Any, states: Path | None, output: Path | None, form: str | None, **options: Any) -> None:
    """Learn an operator for each symbol of a library: its parameters, preconditions and effects, and what was shown.

    STATES is a table in CSV with a row for each moment: either columns movement (id or file) and moment (before or
    after), or time in the clock of the recordings, and file where there are several. Columns cup_x, cup_y, cup_z are
    the position of an object in the frame of the recordings; 0 and 1, yes and no or words say what else holds.

    What you change in the .pddl file survives learning again into it, with --force.

    Example: kineme operators --library actions/ --states states.csv -o tea.pddl
    """
    from kineme.planning.domain import domain_to_dict
    from kineme.planning.operators import learn_operators

    form = form or (_FORMATS.get(output.suffix.lower()) if output is not None else None)
    if output is not None and form is None:
        raise click.BadParameter(f"expected {', '.join(_FORMATS)}, got {output.name}; or say --format")
    beside = output.with_suffix(".json") if output is not None and form == "pddl" else None
    for path in (output, beside):
        check_new(path, options["force"], *([states] if states else []))
    with opts.opened(folder) as library:
        ids = {symbol.id for symbol in library.symbols()}
        edits = edits_of(output, ids) if output is not None and form != "behavior-tree" else []
        domain = learn_operators(
            library, states, radius=options["radius"], error_rate=options["error_rate"], edits=edits
        )
    written = [] if output is None else write_domain(domain, output, str(form))
    data = domain_to_dict(domain) | {"written": [str(path) for path in written]}
    say(options["as_json"], data, lambda: _domain_text(domain, data["written"]))


def write_domain(domain: Any, output: Path, form: str) -> list[Path]:
    """Write a domain; return the files."""
    from kineme.planning.behavior_tree import domain_to_behavior_tree
    from kineme.planning.domain import domain_to_dict, operator_schema
    from kineme.planning.pddl import domain_to_pddl
    from kineme.reporting.atomic import write_atomically

    if form == "behavior-tree":
        return [write_atomically(output, domain_to_behavior_tree(domain).encode())]
    schemas = {operator.name: operator_schema(domain, operator) for operator in domain.operators}
    plain = f"{to_json(domain_to_dict(domain) | {'schemas': schemas})}\n".encode()
    if form == "json":
        return [write_atomically(output, plain)]
    return [
        write_atomically(output, domain_to_pddl(domain, output.stem).encode()),
        write_atomically(output.with_suffix(".json"), plain),
    ]


def edits_of(path: Path, ids: set[str] | None = None) -> list[Any]:
    """Return a person's edits of a domain that is there: those it lists, and the changes of its PDDL.

    Where none of its symbols is among `ids`, those of a library, that one was built anew, and names count.
    """
    from kineme.planning.domain import read_domain
    from kineme.planning.pddl import edits_in, is_signed

    plain = path.with_suffix(".json")
    if not plain.is_file():
        return []
    domain = read_domain(plain)
    text = path.read_text(encoding="utf-8") if path.suffix == ".pddl" and path.is_file() else None
    changed = [] if text is None else edits_in(text, domain)
    if text and changed and not is_signed(text):
        write(f"note: all that differs from {printable(str(plain))} in {printable(str(path))} counts as changes of a "
              "person, since it does not say of which operators it was written", err=True)  # fmt: skip
    edits = [*domain.edits, *changed]
    if edits and ids is not None and ids.isdisjoint(operator.symbol_id for operator in domain.operators):
        write("note: no symbol of the domain before is in this library; its edits go by the names of symbols", err=True)
        return [edit._replace(symbol_id="") for edit in edits]
    return edits


def opened_domain(path: Path) -> Any:
    """Return the domain of a .pddl file, from the .json file beside it, with a person's changes of the PDDL."""
    from kineme.errors import DataError
    from kineme.planning.domain import edited, read_domain

    plain = path.with_suffix(".json")
    if not plain.is_file():
        raise DataError(f"expected {plain} beside {path}, with what was shown; kineme operators writes both")
    return edited(read_domain(plain), edits_of(path))


def _domain_text(domain: Any, written: list[str]) -> str:
    from kineme.planning.domain import kinds_in_words, unmade

    lines = []
    for operator in domain.operators:
        parameters = ", ".join(f"{each.name} ({kinds_in_words(each)})" for each in operator.parameters)
        lines.append(f"{operator.name}: {counted(len(operator.movements), 'movement')} of {parameters or 'nothing'}")
        lines.append(f"  needs {' '.join(map(str, operator.preconditions)) or 'nothing'}")
        effects = " ".join(map(str, operator.effects)) or "nothing"
        lines.append(f"  does  {effects if operator.usable else 'cannot tell: a planner does not get it'}")
        lines += [f"  note  {text}" for text in operator.cannot_tell]
    vocabulary = domain.vocabulary
    lines.append(f"a place is what lies within {vocabulary.radius:.3g} of its {first_names(vocabulary.axes, 8)}")
    kinds = {kind for operator in domain.operators for each in operator.parameters for kind in each.kinds}
    if vocabulary.fixtures + vocabulary.items and not any(kinds):
        lines.append("the hand is at no object in any movement: are positions in the frame and unit of the recordings?")
    lines += [f"column {name} is left out: {why}" for name, why in vocabulary.left_out.items()]
    never = sorted({row.predicate for operator in domain.operators for row in operator.evidence if not row.varied})
    if never:
        lines.append(f"never varied, so that nobody has seen whether it counts: {', '.join(never)}")
    lost = unmade(domain)
    if kept := len(domain.edits) - len(lost):
        lines.append(f"kept {counted(kept, 'edit')} of a person")
    lines += [
        f"an edit of a person applies to no operator: {edit.part} {printable(str(edit.literal))} of what was called "
        f"{printable(edit.operator)}"
        for edit in lost
    ]
    return "\n".join([*lines, *(f"wrote {path}" for path in written)])


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
    from kineme.planning.vocabulary import unit_notes

    if (problem is None) == (options["goal"] is None):
        raise click.UsageError("expected a problem in PDDL, or --goal, one of both")
    if output is not None and output.suffix.lower() not in (".json", ".xml"):
        raise click.BadParameter(f"expected .json or .xml, got {output.name}")
    for path in (output, options["plot"]):
        check_new(path, options["force"], domain, *([problem] if problem else []))
    state = None if options["state"] is None else read_state(options["state"])
    known = opened_domain(domain)
    for note in unit_notes(known.vocabulary, state or {}):
        write(f"note: {printable(note)}", err=True)
    if problem is not None:
        task = problem_from_pddl(known, problem.read_text(encoding="utf-8"), state)
    elif state is None:
        raise SpecificationError("expected the state now with --goal: give --state now.csv")
    else:
        task = problem_of(known, state, options["goal"])
    for note in task.notes:
        write(f"note: {note}", err=True)
    steps = find_plan(task, options["planner"], options["timeout"])
    follows = None if folder is None else _follow(folder, steps, options["plot"])
    data = plan_to_dict(steps) | {"written": [], "follows": follows}
    if output is not None:
        data["written"] = [str(_written(steps, data, output))]
    if options["plot"] and folder is None:
        raise click.UsageError("expected --library with --plot: the paths are those of its demonstrations")
    say(options["as_json"], data, lambda: _plan_text(steps, data))


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
        operators = {step.operator: steps.problem.domain.operator(step.operator) for step in steps.steps}
        skills = {name: skill_of(library, operator.symbol) for name, operator in operators.items()}
        follows = [
            int(skills[step.operator].movements[nearest_demonstration(skills[step.operator], step.start, step.goal)])
            if step.start
            else None
            for step in steps.steps
        ]
        if plot is not None:
            save_figure(draw_plan(steps, library), plot)
    return follows


def _plan_text(steps: Any, data: dict[str, Any]) -> str:
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

"""``kineme operators``: preconditions and effects of symbols for a planner, from states before and after."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FILE, Finite, GroupedCommand, force_option, heading, json_option, library_option, opened
from kineme.cli.output import check_new, say, to_json
from kineme.reporting.text import counted, first_names

_FORMATS = {".pddl": "pddl", ".json": "json", ".xml": "behavior-tree"}


@click.command(cls=GroupedCommand, short_help="Learn what symbols need and do, for a planner.")
@library_option
@click.option("--states", type=click.Path(path_type=Path), help="A table of states beside the recordings, or a folder "
              "of them.  [default: the hand and grippers of the recordings alone]")  # fmt: skip
@click.option("--radius", type=Finite(0, min_open=True), help="Of a place, in the unit of the recordings.  [default: "
              "where the distances of the hand from objects part into near and far]")  # fmt: skip
@click.option("--error-rate", type=Finite(0, 0.25), default=0.02, show_default=True,
              help="Share of facts that a sensor gets wrong.")  # fmt: skip
@heading("Output")
@click.option("--output", "-o", type=FILE, help="A .pddl file, with a .json file beside it that kineme plan reads; the "
              ".json file alone; or an .xml file, a behavior tree.  [default: show a table]")  # fmt: skip
@click.option("--format", "form", type=click.Choice([*_FORMATS.values()]), help="Where the ending does not say it.")
@json_option
@force_option
def operators(folder: Any, states: Path | None, output: Path | None, form: str | None, **options: Any) -> None:
    """Learn an operator for each symbol of a library: its parameters, preconditions and effects, and what was shown.

    STATES is a table in CSV with a row for each moment: either columns movement (id or file) and moment (before or
    after), or time in the clock of the recordings, and file where there are several. Columns cup_x, cup_y, cup_z are
    the position of an object in the frame of the recordings; 0 and 1, yes and no or words say what else holds.

    What you change in the .pddl file survives learning again into it, with --force.

    Example: kineme operators --library actions/ --states states.csv -o tea.pddl
    """
    from kineme.planning.domain import domain_to_dict, kinds_in_words
    from kineme.planning.operators import learn_operators

    form = form or (_FORMATS.get(output.suffix.lower()) if output is not None else None)
    if output is not None and form is None:
        raise click.BadParameter(f"expected {', '.join(_FORMATS)}, got {output.name}; or say --format")
    beside = output.with_suffix(".json") if output is not None and form == "pddl" else None
    for path in (output, beside):
        check_new(path, options["force"], *([states] if states else []))
    edits = edits_of(output) if output is not None and form != "behavior-tree" else []
    with opened(folder) as library:
        domain = learn_operators(
            library, states, radius=options["radius"], error_rate=options["error_rate"], edits=edits
        )
    written = [] if output is None else write_domain(domain, output, str(form))
    data = domain_to_dict(domain) | {"written": [str(path) for path in written]}
    say(options["as_json"], data, lambda: _text(domain, data["written"], kinds_in_words))


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


def edits_of(path: Path) -> list[Any]:
    """Return a person's edits of a domain that is there: those it lists, and the changes of its PDDL."""
    from kineme.planning.domain import read_domain
    from kineme.planning.pddl import edits_in

    plain = path.with_suffix(".json")
    if not plain.is_file():
        return []
    domain = read_domain(plain)
    changed = edits_in(path.read_text(encoding="utf-8"), domain) if path.suffix == ".pddl" and path.is_file() else []
    return [*domain.edits, *changed]


def opened_domain(path: Path) -> Any:
    """Return the domain of a .pddl file, from the .json file beside it, with a person's changes of the PDDL."""
    from kineme.errors import DataError
    from kineme.planning.domain import edited, read_domain

    plain = path.with_suffix(".json")
    if not plain.is_file():
        raise DataError(f"expected {plain} beside {path}, with what was shown; kineme operators writes both")
    return edited(read_domain(plain), edits_of(path))


def _text(domain: Any, written: list[str], kinds_in_words: Any) -> str:
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
    if domain.edits:
        lines.append(f"kept {counted(len(domain.edits), 'edit')} of a person")
    return "\n".join([*lines, *(f"wrote {path}" for path in written)])

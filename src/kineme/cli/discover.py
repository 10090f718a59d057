"""``kineme discover``: kinds of movements in the episodes of robot data, without any example."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import Finite, GroupedCommand, force_option, heading, json_option, library_option_of
from kineme.cli.output import check_new, progress, say, table
from kineme.reporting.text import counted, printable

_SHOWN = 3  # kinds that one follows, in the table
_PROBLEMS = 10  # that are printed one by one


@click.command(cls=GroupedCommand, short_help="Find kinds of movements in robot data without examples.")
@click.argument("dataset", type=click.Path(path_type=Path))
@library_option_of(
    required=False, words="Folder of the action library that the proposals are stored in; made if it is not there."
)
@click.option("--feature", help="Describe movements by this one.  [default: observation.state, or positions]")
@click.option("--penalty", type=Finite(), default=1.5, show_default=True,
              help="Log odds that a boundary costs: larger means fewer.")  # fmt: skip
@heading("Output")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="Write the movements of each episode: a .csv, .json, .eaf (ELAN) or .txt (Audacity) file, or a folder.",
)  # fmt: skip
@json_option
@force_option
def discover(dataset: Path, folder: Any, output: Path | None, **options: Any) -> None:
    """Find the kinds of movements in the episodes of DATASET, without any example.

    Episodes are cut where the arm slows down or turns, the gripper begins or ceases to move, contacts are made.
    Movements that are alike in direction and place, over all episodes, are one kind; what follows what tells kinds
    apart that look alike. Kinds of one task are called by its words. With --library they are stored as proposals, which
    a person names: in kineme studio, or by kineme anchor.

    Example: kineme discover lerobot_dataset/ --library actions/
    """
    from kineme.io.reading.episodes import read_episodes
    from kineme.io.writing.annotations import targets_of, write_annotations
    from kineme.library.discover import annotations_of, store_discovery
    from kineme.library.discover import discover as find
    from kineme.movements.segmentation.work import Work

    feature = options["feature"]
    if output is not None:
        for target in targets_of(output, [dataset], [(dataset.name, "")], None):
            check_new(target, options["force"], dataset)
    with progress(read_episodes(dataset), desc="cutting", unit="episode") as episodes:
        discovery = find(episodes, feature, Work(penalty=options["penalty"]))
    plain = discovery.to_dict() if options["as_json"] else discovery.summary()
    data = plain | {"written": [], "library": None, "version": None}
    if output is not None:
        notes = annotations_of(discovery, dataset.name)
        movements = [(note.recording, note.place) for note in notes]
        data["written"] = list(map(str, write_annotations(output, notes, [dataset], None, movements)))
    if folder is not None:
        with opened_to_discover(folder) as library, progress(total=discovery.episodes, desc="storing") as bar:
            version = store_discovery(
                library.store, read_episodes(dataset), discovery, feature, lambda done: bar.update(done - bar.n)
            )
        data |= {"library": str(folder), "version": version}
    say(options["as_json"], data, lambda: _text(data))


def opened_to_discover(folder: Any) -> Any:
    """Open the library in a folder; one that is new compares movements where they are, and in their size."""
    from kineme.library.library import ActionLibrary, is_library
    from kineme.recognition.recognizer import Recognizer

    if is_library(folder):
        return ActionLibrary(folder)
    return ActionLibrary(folder, create=True, recognizer=Recognizer(translation=False, scale="none", max_angle=0.0))


def _text(data: dict[str, Any]) -> str:
    rows = [
        (
            str(number),
            f"{kind['times']:,}",
            f"{kind['seconds']:.2f}",
            ", ".join(f"{printable(name)} {share:.0%}" for name, share in [*kind["follows"].items()][:_SHOWN]),
            printable(kind["name"]),
        )
        for number, kind in enumerate(data["kinds"], 1)
    ]
    title = (
        f"{counted(len(rows), 'kind')} among {counted(data['movements'], 'movement')} of "
        f"{counted(data['episodes'], 'episode')}, {data['seconds']:,.0f} s"
    )
    lines = [table(("kind", "times", "seconds", "follows", "proposed name"), rows, title)]
    if data["alone"]:
        lines.append(f"{counted(data['alone'], 'movement')} like no other")
    problems = data["problems"]
    lines += [f"not cut: {printable(problem)}" for problem in problems[:_PROBLEMS]]
    if len(problems) > _PROBLEMS:
        lines.append(f"not cut: {counted(len(problems) - _PROBLEMS, 'more episode')}")
    lines += [f"written to {printable(path)}" for path in data["written"]]
    if data["library"] is not None:
        lines.append(
            f"proposed in {printable(data['library'])}; name them by kineme anchor --library, or in kineme studio"
        )
    return "\n".join(lines)

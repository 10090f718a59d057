"""``kineme learn``: learn recordings into an action library."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FOLDER, GroupedCommand, force_option, json_option, library_option, opened
from kineme.cli.output import progress, say
from kineme.cli.pieces import how_divided, in_pieces, pieces_options
from kineme.cli.reading import layout_options, problem_lines, read, recordings_argument
from kineme.reporting.text import counted, printable

_SHOWN = 10  # problems that are listed


@click.command(cls=GroupedCommand, short_help="Store recordings in an action library.")
@recordings_argument
@library_option
@click.option("--label", help="Name of the symbol of all movements.  [default: the label in the file, or its folder]")
@click.option("--no-labels", is_flag=True, help="Store movements without labels, for kineme anchor.")
@click.option(
    "--labels", "table", type=click.Path(dir_okay=False, path_type=Path),
    help="Table with columns start, end and label, which cuts a long recording; also of ELAN or Audacity.",
)  # fmt: skip
@click.option("--person", help="Name of who showed all movements, where others will be recognized.")
@click.option(
    "--by-person",
    is_flag=True,
    help="Who showed a movement is the folder above that of its label, as in person/label/recording.csv, or the array "
    "people of an npz archive.",
)
@layout_options
@json_option
@click.option("--output", "-o", type=FOLDER, help="Of a large archive, the folder of the parts.")
@force_option
@pieces_options
def learn(recordings: tuple[Path, ...], folder: Any, **options: Any) -> None:
    """Learn RECORDINGS, files, folders or patterns of them, or - for CSV from the standard input, into a library.

    The library is created if it does not exist. In a folder, the name of the innermost folder is the label. Movements
    that are stored already are not stored again; what cannot be read is listed, and the rest is learned.

    Where several people show movements and others will be recognized, say who showed what, with --person,
    --person-column or --by-person: kineme recognize then knows how much people differ, and calls fewer movements of
    new ones unknown.

    A long recording is cut by a table of what happens when, with --labels: CSV, JSON, a document of ELAN or its
    tab-delimited export, or labels of Audacity. Stretches without label are stored without.

    With --workers, --scheduler or --shard, movements are described in parts, in the folder --output, and kineme gather
    stores them: the library is that of one process.

    Example: kineme learn recordings/ --library actions/
    """
    from kineme.errors import heard_warnings
    from kineme.io.inspection.inspect import notes_on_heads, notes_on_samples
    from kineme.io.reading.formats import root_of
    from kineme.library.learn import learn_recordings

    as_json, label, no_labels = options.pop("as_json"), options.pop("label"), options.pop("no_labels")
    person, by_person, table = options.pop("person"), options.pop("by_person"), options.pop("table")
    if label is not None and no_labels:
        raise click.UsageError("expected --label or --no-labels, not both")
    if person is not None and by_person:
        raise click.UsageError("expected --person or --by-person, not both")
    how, output, force = how_divided(options, recordings), options.pop("output"), options.pop("force")
    if how is not None:
        said = {"label": label, "no_labels": no_labels, "person": person, "by_person": by_person}
        asked = _of_pieces(recordings, said, options, table)
        in_pieces("learn", recordings, output, how, asked, folder, force=force, as_json=as_json)
        return
    if output is not None:
        raise click.UsageError("expected --output with --workers, --scheduler or --shard; the library is --library")
    parsed = read(recordings, options)
    root = root_of(*(path for path in recordings if str(path) != "-"))
    if table is not None:
        from kineme.io.reading.read_labels import labeled_pieces, read_labels

        parsed = labeled_pieces(parsed, read_labels(table), root)
    people = _people(root, parsed, person, by_person)
    labels = [None if no_labels else each if label is None else label for each in parsed.labels]
    with opened(folder, create=True) as library:
        before = library.version
        with progress(total=len(parsed), desc="learning", unit="movement") as bar, heard_warnings() as heard:
            report = learn_recordings(
                library.store, parsed, options, labels, lambda done, _: bar.update(done - bar.n), root, people
            )
        data = {
            "library": str(folder),
            "added": report.added,
            "duplicates": report.duplicates,
            "joined": joined_since(library, before) if report.duplicates else 0,
            **named_of(library, report.ids, labels),
            "symbols": list(report.symbols),
            "movements": len(library),
            "people": sorted({name for name in people or () if name is not None}),
            "version": report.version,
            "problems": list(map(str, parsed.problems)),
            "notes": [
                *parsed.notes,
                *heard,
                *notes_on_heads(parsed),
                *notes_on_samples(parsed),
                *_notes_on_order(library, parsed),
            ],
        }
    say(as_json, data, lambda: learned_text(data, problem_lines(parsed.problems, "left out ")))


def _notes_on_order(library: Any, recordings: Any) -> list[str]:
    """Say in which order named columns are taken by a library that was begun without names."""
    from kineme.movements.channels.channel import recorded_names
    from kineme.movements.channels.column_match import are_unknown
    from kineme.movements.tables.layout import listed

    channels = recordings.demonstrations.channels
    if library.channels is not None or channels is None or are_unknown(channels):
        return []
    return [
        f"the library was begun with columns without names: {listed(recorded_names(channels))} are taken in this order "
        "and unit; see that those of other recordings are the same, or make another library"
    ]


def _of_pieces(
    recordings: tuple[Any, ...], said: dict[str, Any], reading: dict[str, Any], table: Path | None
) -> dict[str, Any]:
    """The options of the parts of an archive, without those that are not given."""
    from kineme.io.reading.recordings import how_to_read

    if table is not None:
        raise click.UsageError(
            "expected --labels, which cuts one long recording, without --workers, --scheduler or --shard; learn the "
            "recording alone"
        )
    how = how_to_read(reading)
    if said["person"] is not None and (how.layout.person is not None or how.rule.names_person):
        raise click.UsageError("expected --person, or people from --person-column or --label-pattern, not both")
    given = {name: value for name, value in said.items() if value not in (None, False)}
    return given | {"reading": reading} | ({"several": True} if len(recordings) > 1 else {})


def _people(root: Path, recordings: Any, person: str | None, by_person: bool) -> list[str | None] | None:
    """List who showed each movement, as far as the options and the recordings say."""
    from kineme.errors import DataError
    from kineme.io.reading.merge_files import each_person

    if recordings.people is not None and person is not None:
        raise click.UsageError("expected --person, or people from --person-column or --label-pattern, not both")
    if not by_person:
        return recordings.people if person is None else [person] * len(recordings)
    people = each_person(root, recordings.sources)
    if not any(people):
        raise DataError(
            f"expected {recordings.sources[0].path} to say who showed its movements, by folders person/label/recording "
            "or an array people in an archive, got neither; name them with --person"
        )
    return people


def joined_since(library: Any, before: int) -> int:
    """Count stored movements that were unlabeled and got a symbol, since their copy has a label."""
    import numpy as np

    return len(np.setdiff1d(library.at(before).unlabeled(), library.unlabeled()))


def named_of(library: Any, ids: Any, labels: list[Any]) -> dict[str, Any]:
    """Count movements without symbol, and the labels that were not taken since a movement has another symbol."""
    from kineme.library.storage.read import names_of
    from kineme.library.storage.symbols import spellings

    names = names_of(library.store, ids)
    refused = Counter(
        (symbol, label)
        for symbol, label in zip(names, labels, strict=True)
        if symbol is not None and label is not None and symbol not in spellings(str(label))
    )
    return {
        "without_symbol": sum(name is None for name in names),
        "kept": [{"symbol": symbol, "label": label, "movements": n} for (symbol, label), n in refused.items()],
    }


def learned_text(data: dict[str, Any], problems: list[str]) -> str:
    """Say what was learned, what was not and why, and what to know of it."""
    new = f", {counted(len(data['symbols']), 'new symbol')}" if data["symbols"] else ""
    joined = f" ({data['joined']:,} joined the symbol of its label)" if data["joined"] else ""
    stored = f", {data['duplicates']:,} stored already{joined}" if data["duplicates"] else ""
    held = f"{printable(data['library'])} holds {counted(data['movements'], 'movement')}"
    people = data["people"]
    by = f", by {counted(len(people), 'person', 'people')}" if people else ""
    lines = [f"learned {counted(data['added'], 'movement')}{stored}{new}{by}; {held}"]
    for other in data["kept"]:
        lines.append(
            f"{counted(other['movements'], 'movement')} in {printable(other['symbol'])} already: the label "
            f"{printable(other['label'])} is not taken; kineme library rename, merge and split change symbols"
        )
    if n := data["without_symbol"]:
        verb = "has" if n == 1 else "have"
        lines.append(
            f"{counted(n, 'movement')} {verb} no symbol: say it with --label NAME, or find groups with kineme anchor"
        )
    lines += problems[:_SHOWN]
    if len(problems) > _SHOWN:
        lines.append(f"and {len(problems) - _SHOWN} more; kineme inspect lists them all")
    lines += [f"note: {printable(note)}" for note in data["notes"]]
    return "\n".join(lines)

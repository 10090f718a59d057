"""``kineme recognize`` and ``kineme why``: recognize recordings with the symbols of a library, and explain answers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, progress, say, table
from kineme.cli.reading import layout_options, notes_beside, problem_lines, read, recordings_argument
from kineme.reporting.text import printable

_AT_ONCE = 250  # movements recognized between two steps of the progress bar: fewer cost more each


@click.command(cls=opts.GroupedCommand, short_help="Recognize recordings with the symbols of a library.")
@recordings_argument
@opts.library_option
@opts.error_rate_option("Share of true movements that may be called unknown.")
@click.option("--top", type=opts.whole(1), default=3, show_default=True, help="Symbols listed per movement.")
@layout_options
@opts.json_option
def recognize(
    recordings: tuple[Path, ...], folder: Any, error_rate: float, top: int, as_json: bool, **options: Any
) -> None:
    """Recognize the movements in RECORDINGS: files, folders, patterns of them, or - for CSV from the standard input.

    A movement that is like no symbol is unknown. What cannot be read is listed.

    An answer is sure or probably a symbol, or looks like one; what is unknown is new. It never more than looks like a
    symbol where too few recordings, as one of each symbol, tell what is unknown: that then is a guess.

    --json adds the numbers: each movement has an answer in the form of Answer.to_dict. The confidence is the
    probability that the symbol is right if the movement is one of the library's; for an unknown movement it is the
    share of known movements that are less novel. The rule says which recordings decide what is unknown: those of the
    symbol (class), those of all symbols (pooled), or too few (guess); the promise says what follows. P-values are then
    a guess too.

    Example: kineme recognize *.csv --library actions/
    """
    with opts.opened(folder) as library:
        parsed = read(recordings, options, library)
        answers = _recognized(library, parsed.demonstrations, error_rate)
        notes = notes_beside(parsed, options, library.channels)
        ids = {symbol.name: symbol.id for symbol in library.symbols()}
    data = {
        "movements": [
            {
                "recording": source.path,
                "place": source.place,
                "id": None if answer.label is None else ids[answer.label],
                "answer": answer.to_dict(top),
            }
            for source, answer in zip(parsed.sources, answers, strict=True)
        ],
        "notes": notes,
        "problems": [str(problem) for problem in parsed.problems],
    }
    say(as_json, data, lambda: _text(data, error_rate, problem_lines(parsed.problems)))


def _recognized(library: Any, movements: Any, error_rate: float) -> list[Any]:
    """An answer for each movement, with a progress bar on a terminal."""
    answers: list[Any] = []
    with progress(total=len(movements), desc="recognizing", unit="movement") as bar:
        for start in range(0, len(movements), _AT_ONCE):
            answers += library.recognize(movements[start : start + _AT_ONCE], error_rate)
            bar.update(len(answers) - bar.n)
    return answers


def _text(data: dict[str, Any], error_rate: float, problems: list[str]) -> str:
    rows = []
    for movement in data["movements"]:
        answer, name = movement["answer"], f"{movement['recording']} {movement['place']}".strip()
        label, nearest = answer["label"], answer["nearest"][0]
        transform, relative = answer["transform"], ""
        if label is not None:
            degrees = round(math.degrees(transform["angle"])) + 0
            relative = f"×{transform['scale'][0]:.2g}, {degrees:+d}°, {transform['duration_ratio']:.2g} × as long"
        others = ", ".join(printable(candidate["label"]) for candidate in answer["ranked"])
        rows.append(
            (printable(name), "unknown" if label is None else printable(label), answer["certainty"], others,
             printable(nearest["name"] or nearest["index"]), relative)
        )  # fmt: skip
    heads = ("recording", "symbol", "how sure", "ranked", "most like", "relative to it")
    lines = [table(heads, rows), *map(printable, data["notes"])]
    if any(movement["answer"]["rule"] == "guess" for movement in data["movements"]):
        needed = math.ceil(1 / error_rate - 1 - 1e-9)
        lines.append(
            "Which movements are unknown is a guess: too few demonstrations tell how much movements of one symbol "
            "differ, so that nothing more than looks like a symbol; learn two or more of each symbol, "
            f"{needed} in all, to keep --error-rate {error_rate:g}"
        )
    return "\n".join(lines + problems)


@click.command(cls=opts.GroupedCommand, short_help="Explain what a movement is recognized as.")
@recordings_argument
@opts.library_option
@click.option("--index", type=opts.whole(0), help="Number of the movement among several, from 0.  [default: the first]")
@opts.error_rate_option("Share of true movements that may be called unknown.")
@layout_options
@click.option("--output", "-o", type=opts.FILE, help="The picture: a .png, .svg or .pdf file.")
@opts.json_option
@opts.force_option
def why(
    recordings: tuple[Path, ...], folder: Any, index: int | None, error_rate: float, as_json: bool, **options: Any
) -> None:
    """Explain what a movement in RECORDINGS is recognized as.

    The picture shows the movement over the most similar example of the library, and over that of the runner-up: moved,
    turned and sized as the library allows, and colored by how far the movement is from them. Of points, such as two
    hands, each is drawn apart, and each column where these are no points; of many those that differ most.

    Example: kineme why new.csv --library actions/ -o why.png
    """
    from kineme.reporting.figures import save_figure

    check_new(options["output"], options.pop("force"))
    output = options.pop("output")
    with opts.opened(folder) as library:
        parsed = read(recordings, options, library)
        movements = parsed.demonstrations
        n, i = len(movements), index or 0
        if i >= n:
            raise click.BadParameter(f"expected less than {n} movements, got {i}", param_hint="--index")
        explained = library.recognize(movements[i : i + 1], error_rate)[0].explain()
        notes = notes_beside(parsed, options, library.channels)
    if index is None and n > 1:
        notes = [f"This is the first of {n} movements; choose another with --index, or pass one file", *notes]
    if output is not None:
        save_figure(explained.plot(), output)
    source = parsed.sources[i]
    data = {"recording": source.path, "place": source.place, "explanation": explained.to_dict(), "notes": notes}
    lines = [f"{source.path} {source.place}".strip() + f": {explained.in_words}", *notes]
    say(as_json, data, lambda: "\n".join([*map(printable, lines), *problem_lines(parsed.problems)]))

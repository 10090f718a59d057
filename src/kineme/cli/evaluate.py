"""``kineme evaluate``: compare recognizers on data sets."""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FOLDER, GroupedCommand, force_option, given_options, whole
from kineme.cli.output import progress, write
from kineme.cli.reading import LAYOUT_OPTIONS, layout_options, read
from kineme.reporting.text import printable

# The names of the tables in kineme_experiments.evaluation, written out so that --help loads nothing; a test compares
# them.
PROTOCOL_NAMES = (
    "few-shot", "leave-one-out", "cross-validation", "robustness", "any-angle", "open-set", "earliness",
    "user-dependent", "user-independent", "open-set-by-person", "earliness-by-person", "spotting", "anchoring",
)  # fmt: skip
METHOD_NAMES = (
    "kineme", "paper", "paper-bio", "euclidean", "dtw", "dtw-path", "gak-svm", "minirocket", "point-cloud",
    "plus-cloud", "quick-cloud", "hmm",
)  # fmt: skip
#: Files that the commands write; those of an earlier run are replaced.
_EVALUATED = ("evaluation.html", "evaluation.json", "results.csv", "results.json", "ranks.png")
_REPRODUCED = ("report.html", "results.json", "tables.txt", "figure-*.*")
_QUICK_SPLITS, _QUICK_SHOTS, _SLOW = 2, (1, 3), {"gak-svm", "hmm", "dtw-path"}


@click.command(cls=GroupedCommand, short_help="Compare recognizers on data sets.")
@click.argument("data", nargs=-1, required=True)
@click.option("--protocol", "protocols", multiple=True, type=click.Choice(PROTOCOL_NAMES),
              help="Protocol; may be repeated.  [default: from user-dependent on where people are known; else those "
              "before, without leave-one-out and cross-validation]")  # fmt: skip
@click.option("--method", "methods", multiple=True, type=click.Choice(METHOD_NAMES),
              help="Method; may be repeated.  [default: all]")  # fmt: skip
@click.option("--splits", type=whole(1), default=10, show_default=True,
              help="Random splits per protocol, by person rounded up so that each has equally many.")  # fmt: skip
@click.option(
    "--shots",
    multiple=True,
    type=whole(1),
    help="Training movements per class; may be repeated.  [default: 1, 3, 5; by person 1, 2, 3, 4, 8]",
)
@click.option("--seed", type=whole(0), default=0, show_default=True, help="Seed of splits and perturbations.")
@click.option("--jobs", type=whole(1), default=None, help="Number of processes.  [default: one per processor]")
@click.option("--out", type=FOLDER, default="out/evaluation", show_default=True,
              help="Folder for evaluation.html and evaluation.json of each data set, and results.csv, results.json and "
              "ranks.png of all.")  # fmt: skip
@click.option(
    "--quick", is_flag=True, help="At most two splits, one and three shots, without gak-svm, hmm and dtw-path."
)
@layout_options
@force_option
def evaluate(data: tuple[str, ...], protocols: tuple[str, ...], methods: tuple[str, ...], **options: Any) -> None:
    """Evaluate recognition on DATA: lasa, lasa-letters, a folder of recordings, or a file.

    A folder has one folder of recordings per label, or one per person with those inside; a file is a table with a
    column of labels, or an npz archive with positions, times, offsets, labels and people. Compares the default
    recognizer with the paper's configuration and with other methods, under the same splits and perturbations. Several
    data sets get a folder each. Rivals that are not installed are reported and left out: pip install 'kineme[rivals]'.
    """
    from kineme.reporting.table import to_text
    from kineme.runtime.parallel import n_threads
    from kineme_experiments.evaluation.data import PACKAGED, load_data
    from kineme_experiments.evaluation.methods import METHODS
    from kineme_experiments.evaluation.protocols import PROTOCOLS
    from kineme_experiments.evaluation.run import Runner
    from kineme_experiments.evaluation.run import evaluate as run
    from kineme_experiments.evaluation.summary import summarize
    from kineme_experiments.evaluation.trials import Settings

    quick, out = options["quick"], options["out"]
    _check_own(out, _EVALUATED, "rows", options["force"])
    contenders = methods or tuple(name for name in METHODS if not (quick and name in _SLOW))
    splits = min(options["splits"], _QUICK_SPLITS) if quick else options["splits"]
    settings = Settings(splits, options["seed"], tuple(options["shots"]) or (_QUICK_SHOTS if quick else ()))
    if {*data} <= {*PACKAGED} and (given := given_options(LAYOUT_OPTIONS)):
        raise click.UsageError(f"expected {given[0]} with recordings, got it with {', '.join(data)} alone")
    reading = partial(read, options={name: options[name] for name in LAYOUT_OPTIONS})
    sets = _numbered([load_data(data_set, reading) for data_set in data])
    for data_set in sets:
        for name, reason in data_set.left_out.items():
            write(f"left out {name}: {reason}", err=True)
    runner = Runner(options["jobs"] or n_threads(), partial(_watched, "evaluating"))
    evaluations = []
    for data_set in sets:
        chosen = protocols or tuple(name for name, each in PROTOCOLS.items() if each.runs_by_default(data_set))
        name = data_set.name if len(sets) > 1 else ""
        evaluations.append(run(data_set, (chosen, contenders), settings, out / name, runner))
        _print(name, evaluations[-1])
    ranks = summarize([data_set.name for data_set in sets], evaluations, out).ranks
    write(ranks if isinstance(ranks, str) else to_text(ranks))
    write(f"\nopen {evaluations[0].files[0]}")


def _check_own(out: Path, patterns: tuple[str, ...], key: str, force: bool) -> None:
    """Refuse a folder with such files of others: beside those of an earlier run are results that have the `key`."""
    there = [path for pattern in patterns for path in sorted(out.glob(pattern))]
    results: Any = None
    with suppress(OSError, ValueError, RecursionError):
        results = json.loads((out / "results.json").read_bytes())
    if there and not force and not (isinstance(results, dict) and key in results):
        raise click.UsageError(
            f"expected a folder without other results, {printable(there[0])} is there and not of an earlier run; "
            "choose another folder with --out, or write over it with --force"
        )


def _numbered(sets: list[Any]) -> list[Any]:
    """Data sets with names of their own: those of one name are numbered."""
    names = [data_set.name for data_set in sets]
    return [
        data_set._replace(name=f"{name}-{names[: k + 1].count(name)}") if names.count(name) > 1 else data_set
        for k, (name, data_set) in enumerate(zip(names, sets, strict=True))
    ]


def _watched(words: str, items: Any, total: int) -> Any:
    return progress(items, total=total, desc=words, unit="part")


def _print(name: str, evaluation: Any) -> None:
    from kineme.reporting.table import to_text
    from kineme_experiments.evaluation.conclusions import verdict

    write("\n\n".join([name] * bool(name) + list(map(to_text, evaluation.tables))))
    for what, reason in (evaluation.results.absent | evaluation.results.skipped).items():
        write(f"{what}: {reason}")
    write(f"\n{verdict(evaluation.results)}\n")


@click.command(short_help="Reproduce the paper's tables and figures.")
@click.option("--out", type=FOLDER, default="out", show_default=True,
              help="Folder for report.html, results.json, tables.txt and the figures.")  # fmt: skip
@click.option("--draws", type=whole(1), default=None,
              help="Random draws of three demonstrations per shape.  [default: 12, with --quick 3]")  # fmt: skip
@click.option("--seed", type=whole(0), default=0, show_default=True, help="Seed of the draws.")
@click.option("--quick", is_flag=True, help="Fewer draws, coarse pictures, no SVM on the 26 shapes.")
@force_option
def reproduce(out: Path, draws: int | None, seed: int, quick: bool, force: bool) -> None:
    """Reproduce the paper on the LASA handwriting recordings.

    Prints Tables 1 to 4 beside the paper's numbers, what explains them, and the same on all 26 shapes; draws
    the counterparts of Figures 1 to 11.
    """
    from kineme_experiments.paper.run import reproduce as run

    _check_own(out, _REPRODUCED, "draw_by_draw", force)
    result = run(out, draws or (3 if quick else 12), seed, quick, partial(_watched, "reproducing"))
    from kineme.reporting.table import to_text

    write("\n\n".join(map(to_text, result.tables)))
    write(f"\n{len(result.files)} files in {out}; open {out / 'report.html'}")

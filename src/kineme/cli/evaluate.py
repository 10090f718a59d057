"""``kineme evaluate``: compare recognizers on a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import whole
from kineme.cli.output import write

# The names of the tables in kineme.experiments.evaluation, written out so that --help loads nothing; a test compares
# them.
PROTOCOL_NAMES = ("few-shot", "leave-one-out", "cross-validation", "robustness", "any-angle", "open-set", "earliness")
METHOD_NAMES = (
    "kineme", "paper", "paper-bio", "euclidean", "dtw", "gak-svm", "minirocket", "point-cloud", "hmm",
)  # fmt: skip
_QUICK_SPLITS = 2


@click.command(short_help="Compare recognizers on a data set.")
@click.argument("data")
@click.option("--protocol", "protocols", multiple=True, type=click.Choice(PROTOCOL_NAMES),
              help="Protocol; may be repeated.  [default: all but leave-one-out and cross-validation]")  # fmt: skip
@click.option("--method", "methods", multiple=True, type=click.Choice(METHOD_NAMES),
              help="Method; may be repeated.  [default: all]")  # fmt: skip
@click.option("--splits", type=whole(1), default=10, show_default=True, help="Random splits per protocol.")
@click.option("--shots", multiple=True, type=whole(1), default=(1, 3, 5), show_default=True,
              help="Training movements per class; may be repeated.")  # fmt: skip
@click.option("--seed", type=whole(0), default=0, show_default=True, help="Seed of splits and perturbations.")
@click.option("--jobs", type=whole(1), default=None, help="Number of processes.  [default: one per processor]")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default="out", show_default=True,
              help="Folder for evaluation.html and evaluation.json.")  # fmt: skip
@click.option("--quick", is_flag=True, help="At most two splits, without slow rivals.")
def evaluate(data: str, protocols: tuple[str, ...], methods: tuple[str, ...], **options: Any) -> None:
    """Evaluate recognition on DATA: lasa, lasa-letters, or a folder with one folder of recordings per label.

    Compares the default recognizer with the paper's configuration and with other methods, under the same splits and
    perturbations. Rivals that are not installed are reported and left out: pip install 'kineme[rivals]'.
    """
    from kineme.experiments.evaluation.data import load_data
    from kineme.experiments.evaluation.methods import METHODS
    from kineme.experiments.evaluation.protocols import PROTOCOLS, Settings
    from kineme.experiments.evaluation.run import Runner
    from kineme.experiments.evaluation.run import evaluate as run
    from kineme.output.table import to_text
    from kineme.runtime.parallel import n_threads

    quick = options["quick"]
    asked = protocols or tuple(name for name, one in PROTOCOLS.items() if one.by_default)
    contenders = methods or tuple(name for name, one in METHODS.items() if not (quick and one.slow))
    splits = min(options["splits"], _QUICK_SPLITS) if quick else options["splits"]
    settings = Settings(splits, options["seed"], tuple(options["shots"]))
    read = load_data(data)
    for name, reason in read.left_out.items():
        write(f"left out {name}: {reason}", err=True)
    done = run(read, (asked, contenders), settings, options["out"], Runner(options["jobs"] or n_threads(), _progress))
    write("\n\n".join(map(to_text, done.tables)))
    for name, reason in (done.results.absent | done.results.skipped).items():
        write(f"{name}: {reason}")
    write(f"\nopen {done.files[0]}")


def _progress(items: Any, total: int) -> Any:
    from tqdm import tqdm

    return tqdm(items, total=total, desc="evaluating", unit="part", leave=False, disable=None)

"""``kineme reproduce``: the paper's tables and figures."""

from __future__ import annotations

from pathlib import Path

import click

from kineme.cli.options import whole
from kineme.cli.output import write


@click.command(short_help="Reproduce the paper's tables and figures.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default="out", show_default=True,
              help="Folder for report.html, results.json, tables.txt and the figures.")  # fmt: skip
@click.option("--draws", type=whole(1), default=None,
              help="Random draws of three demonstrations per shape.  [default: 12, with --quick 3]")  # fmt: skip
@click.option("--seed", type=whole(0), default=0, show_default=True, help="Seed of the draws.")
@click.option("--quick", is_flag=True, help="Fewer draws, coarse pictures, no SVM on the 26 shapes.")
def reproduce(out: Path, draws: int | None, seed: int, quick: bool) -> None:
    """Reproduce the paper on the LASA handwriting recordings.

    Prints Tables 1 to 4 beside the paper's numbers, what explains them, and the same on all 26 shapes; draws
    the counterparts of Figures 1 to 11.
    """
    from tqdm import tqdm

    from kineme_experiments.paper.run import reproduce as run

    def progress(items, total):  # type: ignore[no-untyped-def]
        return tqdm(items, total=total, desc="reproducing", unit="part", leave=False, disable=None)

    result = run(out, draws or (3 if quick else 12), seed, quick, progress)
    from kineme.reporting.table import to_text

    write("\n\n".join(map(to_text, result.tables)))
    write(f"\n{len(result.files)} files in {out}; open {out / 'report.html'}")

"""All data sets of a run together: every value in one table, mean ranks and their diagram."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from kineme.reporting.atomic import write_atomically
from kineme.reporting.table import Table
from kineme_experiments.evaluation.conclusions import verdict
from kineme_experiments.evaluation.methods import METHODS
from kineme_experiments.evaluation.ranks import Ranks, rank_rows, rank_sentence
from kineme_experiments.evaluation.rows import Row, to_csv
from kineme_experiments.evaluation.run import Evaluation

_FORMAT = 1  # of results.json


class Summary(NamedTuple):
    """The table of mean ranks, or why there is none, and the files written."""

    ranks: Table | str
    files: list[Path]


def summarize(names: Sequence[str], evaluations: Sequence[Evaluation], out: Path) -> Summary:
    """Write ``results.csv``, ``results.json`` and, where methods can be ranked, ``ranks.png``.

    Parameters
    ----------
    names : sequence of str
        Of the data sets, one for each evaluation.
    evaluations : sequence of Evaluation
    out : Path
        An existing folder.
    """
    rows = [row for evaluation in evaluations for row in evaluation.rows]
    ranks = rank_rows(rows)
    content = {
        "format": _FORMAT,
        "conclusions": {name: verdict(one.results) for name, one in zip(names, evaluations, strict=True)},
        "ranks": ranks if isinstance(ranks, str) else ranks.numbers(),
        "columns": Row._fields,
        "rows": rows,
    }
    files = [
        write_atomically(out / "results.csv", to_csv(rows).encode()),
        write_atomically(out / "results.json", (json.dumps(content, ensure_ascii=False) + "\n").encode()),
    ]
    if isinstance(ranks, str):
        (out / "ranks.png").unlink(missing_ok=True)  # of an earlier run
        return Summary(ranks, files)
    from kineme.reporting.figures import encode_figure
    from kineme_experiments.evaluation.rank_figure import draw_ranks

    files.append(write_atomically(out / "ranks.png", encode_figure(draw_ranks(ranks), "png", dpi=200)))
    return Summary(_table(ranks), files)


def _table(ranks: Ranks) -> Table:
    lines = [(METHODS[name].title, f"{mean:.2f}") for name, mean in zip(ranks.methods, ranks.mean_ranks, strict=True)]
    return Table("Mean ranks", ("method", "mean rank"), lines, rank_sentence(ranks))

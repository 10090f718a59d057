"""The report: tables, figures, and conclusions, in one self-contained HTML file."""

from __future__ import annotations

from typing import Any

from kineme.experiments.evaluation.conclusions import MEASURES, columns, conclusion, verdict
from kineme.experiments.evaluation.data import DataSet
from kineme.experiments.evaluation.figures import draw_protocol
from kineme.experiments.evaluation.methods import METHODS
from kineme.experiments.evaluation.protocols import PROTOCOLS
from kineme.experiments.evaluation.rank_figure import draw_ranks
from kineme.experiments.evaluation.ranks import Ranks, rank_sentence
from kineme.experiments.evaluation.results import Results
from kineme.movements.trajectories.demonstrations import require_labels
from kineme.output.figures import encode_figure
from kineme.output.page import page, picture
from kineme.output.table import Table, mean_and_range, to_html
from kineme.output.text import in_markup

_MOST_COLUMNS, _WIDEST = 6, 120  # of a table with a method per row; characters of its heads


def make_tables(results: Results) -> dict[str, Table]:
    """Protocol -> table: a method per row, a condition and measure per column."""
    return {name: _table(name, results) for name in results.outcomes if results.conditions(name)}


def _table(protocol: str, results: Results) -> Table:
    outcomes = results.outcomes[protocol]
    shown = columns(protocol, results)
    several = len({measure for _, measure in shown}) > 1
    heads = [f"{one.label}: {MEASURES[measure]}" if several else one.label for one, measure in shown]
    rows = [
        (
            METHODS[method].title,
            *(_cell(outcome.get(condition, {}).get(measure), len(shown)) for condition, measure in shown),
        )
        for method, outcome in outcomes.items()
    ]
    # With many conditions, one row per condition is easier to read.
    cells = [("", *heads), *rows]
    if len(heads) > min(len(rows), _MOST_COLUMNS) or sum(map(len, heads)) > _WIDEST:
        cells = list(zip(*cells, strict=True))
    head = ("method" if cells[0][1:] == tuple(heads) else "condition", *cells[0][1:])
    chosen = PROTOCOLS[protocol]
    return Table(chosen.title, head, cells[1:], f"{chosen.description} {conclusion(protocol, results)}")


def _cell(values: list[float] | None, n_columns: int) -> str:
    if not values:
        return "-"
    return mean_and_range(values) if n_columns <= 6 else f"{sum(values) / len(values):.3f}"


def write_report(
    data: DataSet, results: Results, tables: dict[str, Table], ranks: Ranks | str, facts: dict[str, Any]
) -> str:
    """HTML with tables and figures; `ranks` is a text that says why where there are none."""
    parts = [f'<p class="lead">{in_markup(_lead(data))}</p>', f"<p>{in_markup(verdict(results))}</p>"]
    if isinstance(ranks, str):
        parts.append(f"<p>{in_markup(ranks)}</p>")
    else:
        parts.append(picture(encode_figure(draw_ranks(ranks), "svg"), rank_sentence(ranks)))
    for name, table in tables.items():
        drawn = draw_protocol(name, results)
        shown = "" if drawn is None else picture(drawn, f"{PROTOCOLS[name].title}: mean over splits.")
        parts.append(f"<h2>{in_markup(PROTOCOLS[name].title)}</h2>{to_html(table)}{shown}")
    missing = {METHODS[name].title: why for name, why in results.absent.items()}
    missing |= {PROTOCOLS[name].title: why for name, why in results.skipped.items()} | data.left_out
    if missing:
        rows: list[tuple[str, ...]] = list(missing.items())
        parts.append(f"<h2>Left out</h2>{to_html(Table('Methods, protocols, files', ('what', 'why'), rows))}")
    versions = facts["versions"]
    listed = {key: value for key, value in facts.items() if key != "versions"} | versions
    return page(f"kineme: evaluation on {data.name}", f"Recognition on {data.name}", "\n".join(parts), listed)


def _lead(data: DataSet) -> str:
    labels = set(require_labels(data.demonstrations).tolist())
    return (
        f"{len(data.demonstrations)} movements of {len(labels)} classes in {data.demonstrations.n_dims} dimensions. "
        "All methods see the same splits and the same perturbed movements. Numbers are means over splits, with their "
        "range where there is room. Rivals get positions that are centered, scaled, smoothed and even along the path; "
        "plain DTW gets them even in time."
    )

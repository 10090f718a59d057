"""The report: tables, figures, and where a rival is ahead, in one self-contained HTML file."""

from __future__ import annotations

from typing import Any

from kineme.experiments.evaluation.data import DataSet
from kineme.experiments.evaluation.figures import draw_protocol
from kineme.experiments.evaluation.methods import METHODS, OURS
from kineme.experiments.evaluation.protocols import PROTOCOLS
from kineme.experiments.evaluation.results import Results
from kineme.movements.trajectories.demonstrations import require_labels
from kineme.output.page import page, picture
from kineme.output.table import Table, mean_and_range, to_html
from kineme.output.text import in_markup

_MEASURES = {"accuracy": "accuracy", "auroc": "AUROC", "rejected": "unknown rejected"}


def make_tables(results: Results) -> dict[str, Table]:
    """Protocol -> table: a method per row, a condition and measure per column."""
    return {name: _table(name, results) for name in results.outcomes if results.conditions(name)}


def _table(protocol: str, results: Results) -> Table:
    outcomes = results.outcomes[protocol]
    columns = _columns(protocol, results)
    several = len({measure for _, measure in columns}) > 1
    heads = [f"{one.label}: {_MEASURES[measure]}" if several else one.label for one, measure in columns]
    rows = [
        (
            METHODS[method].title,
            *(_cell(outcome.get(condition, {}).get(measure), len(columns)) for condition, measure in columns),
        )
        for method, outcome in outcomes.items()
    ]
    # With many conditions, one row per condition is easier to read.
    cells = [("", *heads), *rows]
    if len(heads) > len(rows) or len(heads) > 6:
        cells = list(zip(*cells, strict=True))
    head = ("method" if cells[0][1:] == tuple(heads) else "condition", *cells[0][1:])
    chosen = PROTOCOLS[protocol]
    return Table(chosen.title, head, cells[1:], f"{chosen.description} {rivals_ahead(protocol, results)}")


def _columns(protocol: str, results: Results) -> list[tuple[Any, str]]:
    fullest = max(results.outcomes[protocol].values(), key=len)
    return [(condition, measure) for condition, measures in fullest.items() for measure in measures]


def _cell(values: list[float] | None, n_columns: int) -> str:
    if not values:
        return "-"
    return mean_and_range(values) if n_columns <= 6 else f"{sum(values) / len(values):.3f}"


def rivals_ahead(protocol: str, results: Results) -> str:
    """Where a rival's mean is above ours, among the rivals that took part; and which rivals did not."""
    if OURS not in results.outcomes[protocol]:
        return ""
    rivals = [name for name in results.outcomes[protocol] if name != OURS]
    if not rivals:
        return f"No rival took part. {_not_compared(results)}".rstrip()
    ahead = []
    for condition, measure in _columns(protocol, results):
        ours = results.mean(protocol, OURS, condition, measure)
        for rival in rivals:
            theirs = results.mean(protocol, rival, condition, measure)
            if ours is not None and theirs is not None and round(theirs, 3) > round(ours, 3):
                what = "" if measure == "accuracy" else f" in {_MEASURES[measure]}"
                ahead.append(f"{METHODS[rival].title}, {condition.label}{what} ({theirs:.3f} over {ours:.3f})")
    named = f"Ahead of kineme: {'; '.join(ahead)}."
    names = "; ".join(METHODS[rival].title for rival in rivals)
    none = f"No rival is ahead of kineme anywhere in this table. Rivals here: {names}."
    return f"{named if ahead else none} {_not_compared(results)}".rstrip()


def _not_compared(results: Results) -> str:
    """The rivals that the conclusion leaves out, and why."""
    absent = [f"{METHODS[name].title} ({why})" for name, why in results.absent.items() if name != OURS]
    return f"Not compared: {'; '.join(absent)}." if absent else ""


def write_report(data: DataSet, results: Results, tables: dict[str, Table], facts: dict[str, Any]) -> str:
    """HTML with tables and figures."""
    parts = [f'<p class="lead">{in_markup(_lead(data))}</p>']
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
        "range where there is room. Rivals get positions that are centered and scaled."
    )

"""Run an evaluation: every method in every split of every protocol, in processes; then report and numbers."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple

from kineme.movements.trajectories.demonstrations import require_labels
from kineme.reporting.atomic import write_atomically
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.figures import encode_figure, new_figure
from kineme.reporting.page import page, picture
from kineme.reporting.table import Table, to_html
from kineme.reporting.text import in_markup
from kineme_experiments.evaluation.conclusions import MEASURES, best_rival, columns, conclusion, sentences
from kineme_experiments.evaluation.conditions import Condition
from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.methods import METHODS, OURS
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.evaluation.rank_figure import draw_ranks
from kineme_experiments.evaluation.ranks import Ranks, rank_rows, rank_sentence
from kineme_experiments.evaluation.results import Results, collect
from kineme_experiments.evaluation.rows import Row, make_rows
from kineme_experiments.evaluation.score_split import Scores, does, score_split
from kineme_experiments.evaluation.trials import TASKS, Settings
from kineme_experiments.ranges import mean_and_range

_BLACK = "#222222"
_AXES = {
    "shots": "movements per class",
    "shift": "shift [extents]",
    "scale": "scale [doublings]",
    "rotation": "rotation within ± [°]",
    "warp": "warp [std of log speed]",
    "noise": "noise [% of extent]",
    "together": "all together [level]",
    "path": "path seen [%]",
}
_STYLES = dict(
    zip(
        METHODS,
        [(BLUE, "-"), (PURPLE, "-"), (PURPLE, "--"), (GRAY, "-"), (ORANGE, "-"), (ORANGE, ":"), (ORANGE, "--"),
         (GREEN, "-"), (GREEN, "--"), (_BLACK, "-"), (_BLACK, "--"), (GRAY, "--")],
        strict=True,
    )
)  # fmt: skip

_MOST_COLUMNS, _WIDEST = 6, 120  # of a table with a method per row; characters of its heads

_FORMAT = 1  # of evaluation.json
_PACKAGES = ("kineme", "numpy", "scipy", "scikit-learn", "dtaidistance", "tslearn", "aeon", "dollarpy", "hmmlearn")


class Job(NamedTuple):
    """One method in one split of one protocol."""

    protocol: str
    method: str
    split: int


class Evaluation(NamedTuple):
    """The result of a run: tables, results, every value as a row, and the files written."""

    tables: list[Table]
    results: Results
    rows: list[Row]
    files: list[Path]


def evaluate(
    data: DataSet, plan: tuple[Sequence[str], Sequence[str]], settings: Settings, out: Path, runner: Runner
) -> Evaluation:
    """Compute everything and write ``evaluation.html`` and ``evaluation.json``.

    Parameters
    ----------
    data : DataSet
    plan : tuple of two sequences
        Names of protocols, and of methods.
    settings : Settings
    out : Path
        Folder for the files; created if it does not exist.
    runner : Runner
        Number of processes, and how to show progress.

    Raises
    ------
    OSError
        The folder cannot be written; checked before the work begins.
    """
    out.mkdir(parents=True, exist_ok=True)
    TemporaryFile(dir=out).close()  # a folder that cannot be written fails now, not after the work
    began = time.perf_counter()
    demos = data.demonstrations
    absent = {name: why for name in plan[1] if (why := METHODS[name].unavailable())}
    skipped = {name: why for name in plan[0] if (why := PROTOCOLS[name].unsuitable(data))}
    for name in set(plan[0]) - set(skipped):
        task = PROTOCOLS[name].task
        if not any(does(method, task) for method in plan[1]):
            skipped[name] = f"none of the methods can {TASKS[task].words}"
    jobs = _jobs(data, plan, settings, {*absent, *skipped})
    scores = dict(runner.progress(runner.run(data, jobs, settings), total=len(jobs)))
    ordered = {job: scores[job] for job in jobs}
    results, rows = collect(ordered, absent, skipped), make_rows(data, ordered)
    facts = {
        "data": data.name,
        "movements": len(demos),
        **settings._asdict(),
        "shots": list(settings.shots) or "each protocol's own",
        "versions": _versions(),
    }
    return _write(data, (results, rows), facts, out, time.perf_counter() - began)


def _jobs(data: DataSet, plan: tuple[Sequence[str], Sequence[str]], settings: Settings, without: set[str]) -> list[Job]:
    return [
        Job(protocol, method, split)
        for method in plan[1]
        if method not in without
        for protocol in plan[0]
        if protocol not in without and does(method, PROTOCOLS[protocol].task)
        for split in range(PROTOCOLS[protocol].n_splits(data, settings))
    ]


class Runner(NamedTuple):
    """How jobs are run: in this process, or side by side in others; `progress` is as `tqdm.tqdm`."""

    processes: int
    progress: Callable[..., Any]

    def run(self, data: DataSet, jobs: list[Job], settings: Settings) -> Iterator[tuple[Job, list[Scores]]]:
        """(job, its scores) as they come."""
        if self.processes == 1:
            yield from ((job, score_split(data, *job, settings)) for job in jobs)
            return
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(self.processes, context, _init_worker, (data,)) as pool:
            waiting = {pool.submit(_run_job, job, settings): job for job in jobs}
            for future in as_completed(waiting):
                yield waiting[future], future.result()


_shared: dict[str, DataSet] = {}  # the data of a worker process


def _init_worker(data: DataSet) -> None:
    """Prepare a worker process; it has one core, so neither kineme nor BLAS should start more threads."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    os.environ["KINEME_NUM_THREADS"] = "1"
    os.environ.setdefault("KINEME_COMPILED", "always")  # each job is small; together they repay loading Numba
    _shared["data"] = data


def _run_job(job: Job, settings: Settings) -> list[Scores]:
    return score_split(_shared["data"], *job, settings)


def _write(
    data: DataSet, found: tuple[Results, list[Row]], facts: dict[str, Any], out: Path, seconds: float
) -> Evaluation:

    results, rows = found
    tables = make_tables(results)
    html = write_report(data, results, tables, rank_rows(rows), facts)
    numbers = {"format": _FORMAT, **facts, "left_out": data.left_out, **results.numbers()}
    numbers["seconds"] = {"whole": round(seconds, 2), **results.seconds()}
    text = json.dumps(numbers, indent=1, ensure_ascii=False) + "\n"
    files = [
        write_atomically(out / "evaluation.html", html.encode()),
        write_atomically(out / "evaluation.json", text.encode()),
    ]
    return Evaluation(list(tables.values()), results, rows, files)


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


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
    drawings = {name: drawn for name in tables if (drawn := draw_protocol(name, results)) is not None}
    pictures = {name: picture(drawn, f"{PROTOCOLS[name].title}: mean over splits.") for name, drawn in drawings.items()}
    if isinstance(ranks, str):
        parts = [pictures.pop(next(iter(pictures), ""), ""), f"<p>{in_markup(ranks)}</p>"]
    else:
        parts = [picture(encode_figure(draw_ranks(ranks), "svg"), rank_sentence(ranks))]
    parts.append(f'<p class="lead">{in_markup(_lead(data))}</p>')
    for name, table in tables.items():
        shown = pictures.get(name, "")
        parts.append(f"<h2>{in_markup(PROTOCOLS[name].title)}</h2>{to_html(table)}{shown}")
    missing = {METHODS[name].title: why for name, why in results.absent.items()}
    missing |= {PROTOCOLS[name].title: why for name, why in results.skipped.items()} | data.left_out
    if missing:
        rows: list[tuple[str, ...]] = list(missing.items())
        parts.append(f"<h2>Left out</h2>{to_html(Table('Methods, protocols, files', ('what', 'why'), rows))}")
    first, *others = sentences(results)
    versions = facts["versions"]
    listed = {key: value for key, value in facts.items() if key != "versions"} | versions
    return page(
        f"kineme: evaluation on {data.name}",
        f"Recognition on {data.name}",
        [first, best_rival(results), *others],
        "\n".join(parts),
        listed,
    )


def _lead(data: DataSet) -> str:
    labels = set(require_labels(data.demonstrations).tolist())
    return (
        f"{len(data.demonstrations)} movements of {len(labels)} classes in {data.demonstrations.n_dims} dimensions. "
        "All methods see the same splits and the same perturbed movements. Numbers are means over splits, with their "
        "range where there is room. Rivals get positions that are centered, scaled, smoothed and even along the path; "
        "plain DTW gets them even in time."
    )


def draw_protocol(protocol: str, results: Results) -> bytes | None:
    """SVG of accuracy over strength; None for protocols without several strengths."""
    panels: dict[str, list[Condition]] = {}
    for condition in results.conditions(protocol):
        panels.setdefault(condition.varied, []).append(condition)
    panels = {name: conditions for name, conditions in panels.items() if name in _AXES and len(conditions) > 1}
    if not panels or protocol.startswith("open-set"):
        return None
    columns = min(3, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = new_figure(2.6 * columns + 1.8, 2.1 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for k, (name, conditions) in enumerate(panels.items()):
        _draw_panel(axes.flat[k], protocol, results, conditions)
        axes.flat[k].set(xlabel=_AXES[name], ylim=(0, 1.03))
        if name == "shots":  # no half movements
            axes.flat[k].set_xticks([one.strength for one in conditions])
    for row in axes:
        row[0].set_ylabel("accuracy")
    for empty in axes.flat[len(panels) :]:
        empty.set_visible(False)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside right upper")
    return encode_figure(figure, "svg")


def _draw_panel(axes, protocol: str, results: Results, conditions: list[Condition]) -> None:  # type: ignore[no-untyped-def]
    for method in results.outcomes[protocol]:
        points = [
            (condition.strength, results.mean(protocol, method, condition, "accuracy")) for condition in conditions
        ]
        measured = [(x, y) for x, y in points if y is not None]
        color, line = _STYLES[method]
        label = METHODS[method].title
        width, front = (2.2, 3) if method == OURS else (1.1, 2)
        x, y = [x for x, _ in measured], [y for _, y in measured]
        axes.plot(x, y, line, color=color, label=label, linewidth=width, marker="o", markersize=2.5, zorder=front)
